// Browsers that alter canvas pixels to prevent fingerprinting corrupt decoded heights. A PNG of two known pixels detects this.

const KNOWN = 'data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAIAAAABCAIAAAB7QOjdAAAAD0lEQVR4nGMQMglbffY9AAdZAwSh3xl9AAAAAElFTkSuQmCC';
const PIXELS = [18, 52, 86, 255, 171, 205, 239, 255];

export async function pixelsAreTrue() {
  const image = new Image();
  image.src = KNOWN;
  await image.decode();
  const canvas = document.createElement('canvas');
  canvas.width = 2;
  canvas.height = 1;
  const context = canvas.getContext('2d', { willReadFrequently: true });
  context.drawImage(image, 0, 0);
  return context.getImageData(0, 0, 2, 1).data.every((value, at) => value === PIXELS[at]);
}
