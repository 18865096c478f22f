// Makes the pictures of docs/server.md: node test/pictures.mjs URL FOLDER, with a server that serves only fixtures/worlds/planet.toml.
// server.png (the page), server-zooms.png (one place at four scales), server-phone.png; PNG with a palette.
// Needs node >= 20.15 and Chromium.

import puppeteer from 'puppeteer-core';
import { existsSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { crc32, deflateSync } from 'node:zlib';

const [url = 'http://127.0.0.1:8080', folder = '.'] = process.argv.slice(2);
const CHROMIUM = [process.env.CHROMIUM, '/usr/bin/chromium', '/usr/bin/chromium-browser', '/usr/bin/google-chrome'].find((path) => path && existsSync(path));
const COLOURS = 128, SIDE = 232, GAP = 6;
const ACROSS_M = [100000, 1000, 20, 1];

const browser = await puppeteer.launch({ executablePath: CHROMIUM, headless: true, args: ['--no-sandbox', '--disable-gpu', '--hide-scrollbars'] });
const page = await browser.newPage();
page.setDefaultTimeout(180000);

async function view(size, hash) {
  await page.setViewport(size);
  await page.goto('about:blank');
  await page.goto(`${url}/#c=planet&${hash}`);
  await page.evaluate(() => window.sastrugi.ready);
  await page.evaluate(() => new Promise((resolve) => { window.sastrugi.map.once('rendercomplete', () => setTimeout(resolve, 600)); window.sastrugi.map.render(); }));
  return page.screenshot({ encoding: 'base64' });
}

/** Pictures side by side as indices into a palette of the most frequent colours; each pixel gets the nearest of them. */
const reduced = (pictures, gap, colours) => page.evaluate(async (all, space, most) => {
  const images = await Promise.all(all.map(async (text) => { const image = new Image(); image.src = `data:image/png;base64,${text}`; await image.decode(); return image; }));
  const width = images.reduce((sum, image) => sum + image.width + space, -space), height = images[0].height;
  const context = Object.assign(document.createElement('canvas'), { width, height }).getContext('2d', { willReadFrequently: true });
  context.fillStyle = '#fff';
  context.fillRect(0, 0, width, height);
  images.reduce((x, image) => { context.drawImage(image, x, 0); return x + image.width + space; }, 0);
  const { data } = context.getImageData(0, 0, width, height);
  const count = new Map();
  const key = (at) => ((data[at] >> 3) << 10) | ((data[at + 1] >> 3) << 5) | (data[at + 2] >> 3);
  const sums = new Map();
  for (let at = 0; at < data.length; at += 4) {
    const k = key(at), sum = sums.get(k) ?? [0, 0, 0];
    sums.set(k, sum.map((v, c) => v + data[at + c]));
    count.set(k, (count.get(k) ?? 0) + 1);
  }
  const rgb = (k) => sums.get(k).map((v) => Math.round(v / count.get(k)));
  const apart = (a, b) => a.reduce((sum, v, c) => sum + (v - b[c]) ** 2, 0);
  const palette = [];
  // Skip colours close to one already chosen at first, so that rare but distinct colours find room.
  for (let near = 500; near >= 0 && palette.length < most; near = near > 20 ? near / 2 : near - 20) {
    for (const [k] of [...count].sort((a, b) => b[1] - a[1] || a[0] - b[0])) {
      if (palette.length < most && palette.every((one) => apart(one, rgb(k)) > near)) palette.push(rgb(k));
    }
  }
  const nearest = new Map([...count.keys()].map((k) => [k, palette.reduce((best, one, at) => (apart(one, rgb(k)) < apart(palette[best], rgb(k)) ? at : best), 0)]));
  let indices = '';
  for (let at = 0; at < data.length; at += 4) indices += String.fromCharCode(nearest.get(key(at)));
  return { width, height, palette, indices: btoa(indices) };
}, pictures, gap, colours);

function png({ width, height, palette, indices }) {
  const chunk = (name, data) => {
    const body = Buffer.concat([Buffer.from(name), data]);
    const [length, sum] = [Buffer.alloc(4), Buffer.alloc(4)];
    length.writeUInt32BE(data.length);
    sum.writeUInt32BE(crc32(body));
    return Buffer.concat([length, body, sum]);
  };
  const head = Buffer.alloc(13);
  head.writeUInt32BE(width, 0);
  head.writeUInt32BE(height, 4);
  head.set([8, 3, 0, 0, 0], 8);
  const pixels = Buffer.from(indices, 'base64');
  const rows = Buffer.alloc((width + 1) * height);
  for (let r = 0; r < height; r++) pixels.copy(rows, r * (width + 1) + 1, r * width, (r + 1) * width);
  return Buffer.concat([Buffer.from('\x89PNG\r\n\x1a\n', 'latin1'), chunk('IHDR', head), chunk('PLTE', Buffer.from(palette.flat())), chunk('IDAT', deflateSync(rows, { level: 9 })), chunk('IEND', Buffer.alloc(0))]);
}

async function save(name, pictures) {
  const bytes = png(await reduced(pictures, GAP, COLOURS));
  writeFileSync(join(folder, name), bytes);
  console.log(`${name}: ${(bytes.length / 1000).toFixed(0)} kB`);
}

await save('server.png', [await view({ width: 960, height: 740 }, 'x=-1.7&y=0&r=0.0125')]);
await save('server-phone.png', [await view({ width: 390, height: 700, isMobile: true, hasTouch: true, deviceScaleFactor: 1 }, 'x=0&y=0&r=0.2')]);
const bare = () => {
  const style = document.createElement('style');
  style.textContent = '#head, #panel, #zoom, #readout, #credit { display: none !important }';
  document.head.append(style);
};
await page.evaluateOnNewDocument(`addEventListener('DOMContentLoaded', ${bare})`);
const zooms = [];
for (const across of ACROSS_M) zooms.push(await view({ width: SIDE, height: SIDE }, `x=0&y=0&r=${across / SIDE}`));
await save('server-zooms.png', zooms);
await browser.close();
