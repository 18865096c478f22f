// Smoke test of the page: node test/smoke.mjs URL FOLDER. Needs Chromium; set CHROMIUM if it is not on the path.
// SMOKE_ONLY, a regular expression, selects checks by name; SMOKE_SECONDS is the time limit of each; SMOKE_SIZE is the size of the window, at least
// 960x640.
// Each check prints one line; screenshots go into FOLDER; the exit code is 1 if a check failed.

import puppeteer from 'puppeteer-core';
import { mkdirSync, existsSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';

const url = (process.argv[2] ?? 'http://127.0.0.1:8080').replace(/\/$/, '');
const folder = process.argv[3] ?? 'smoke';
const CHROMIUM = [process.env.CHROMIUM, '/usr/bin/chromium', '/usr/bin/chromium-browser', '/usr/bin/google-chrome'].find((path) => path && existsSync(path));
const ONLY = process.env.SMOKE_ONLY && new RegExp(process.env.SMOKE_ONLY);
const [width, height] = (process.env.SMOKE_SIZE ?? '1280x900').split('x').map(Number);
const PATIENCE = Number(process.env.SMOKE_SECONDS ?? 60) * 1000;
if (!CHROMIUM) {
  console.error('Chromium not found; install it, or set the variable CHROMIUM to its path.');
  process.exit(2);
}
mkdirSync(folder, { recursive: true });

const browser = await puppeteer.launch({ executablePath: CHROMIUM, headless: true, args: ['--no-sandbox', '--disable-gpu', '--enable-unsafe-swiftshader', '--hide-scrollbars'] });
const page = await browser.newPage();
page.setDefaultTimeout(PATIENCE);
const complaints = [];
let provoked = false;
const complain = (text) => { if (!provoked) complaints.push(text); };
page.on('console', (message) => { if (message.type() === 'error') complain(message.text()); });
page.on('pageerror', (error) => complain(String(error)));
page.on('response', (response) => { if (response.status() >= 400) complain(`${response.status()} ${response.url()}`); });
page.on('requestfailed', (request) => { const why = request.failure()?.errorText; if (why !== 'net::ERR_ABORTED') complain(`${why} ${request.url()}`); });

let failures = 0;
async function check(name, run) {
  if (ONLY && !ONLY.test(name)) return;
  try {
    const start = Date.now();
    const note = await run();
    console.log(`ok    ${name}${note ? `: ${note}` : ''} (${((Date.now() - start) / 1000).toFixed(1)} s)`);
  } catch (error) {
    failures++;
    console.log(`FAIL  ${name}: ${error.message}`);
  }
}
function must(truth, sentence) { if (!truth) throw new Error(sentence); }
const wait = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));
/** Waits until `test` is true in the page; fails with `sentence` if it never is. */
async function until(sentence, test, ...values) {
  await page.waitForFunction(test, { polling: 50 }, ...values).catch((error) => { throw error.name === 'TimeoutError' ? new Error(sentence) : error; });
}
const slide = (label, value) => page.evaluate((name, to) => {
  const input = [...document.querySelectorAll(`input[aria-label="${name}"]`)].at(-1);
  input.value = to;
  for (const kind of ['input', 'change']) input.dispatchEvent(new Event(kind, { bubbles: true }));
}, label, value);
const tilesAsked = () => page.evaluate(() => performance.getEntriesByType('resource').map(({ name }) => name).filter((name) => name.includes('/map/tiles/')));
const levelsAsked = async () => [...new Set((await tilesAsked()).map((name) => Number(/\/tiles\/[^/]+\/(\d+)\//.exec(name)[1])))];
const nearest = (numbers, to) => numbers.reduce((best, one) => (Math.abs(one - to) < Math.abs(best - to) ? one : best));
const shot = (name) => page.screenshot({ path: join(folder, `${name}.png`) });
const settled = () => page.evaluate(() => new Promise((resolve) => {
  const { map } = window.sastrugi;
  const done = () => setTimeout(resolve, 350);
  map.once('rendercomplete', done);
  map.render();
}));
async function visit(hash = '') {
  await page.goto('about:blank');
  await page.goto(`${url}/${hash}`, { waitUntil: 'load' });
  await page.evaluate(() => window.sastrugi.ready);
  await settled();
}
/** Mean colour of the base canvas in a box around a position, in pixels of the map. */
const colour = (x, y, half) => page.evaluate((cx, cy, size) => {
  const { map } = window.sastrugi;
  const ratio = devicePixelRatio;
  const [px, py] = map.getPixelFromCoordinate([cx, cy]);
  const canvas = map.getViewport().querySelector('canvas');
  const side = Math.max(2, Math.round(2 * size / map.getView().getResolution() * ratio));
  const data = canvas.getContext('2d').getImageData(Math.round(px * ratio - side / 2), Math.round(py * ratio - side / 2), side, side).data;
  const mean = [0, 0, 0];
  for (let at = 0; at < data.length; at += 4) for (let k = 0; k < 3; k++) mean[k] += data[at + k] / (data.length / 4);
  return mean;
}, x, y, half);

/** Colours of every 97th pixel of the base canvas. */
const thinned = () => page.evaluate(() => {
  const canvas = window.sastrugi.map.getViewport().querySelector('canvas');
  const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
  return Array.from({ length: Math.floor(data.length / 388) }, (_, k) => [...data.subarray(388 * k, 388 * k + 3)]);
});
/** Mean difference between two lists of colours. */
const difference = (ours, theirs) => ours.reduce((sum, colour, k) => sum + colour.reduce((all, value, c) => all + Math.abs(value - theirs[k][c]), 0), 0) / (3 * ours.length);

/** Mean differences between adjacent columns of pixels around a position: the largest in the middle, and the largest elsewhere. */
const steps = (x, y) => page.evaluate((cx, cy) => {
  const { map } = window.sastrugi;
  const [px, py] = map.getPixelFromCoordinate([cx, cy]).map((at) => Math.round(at * devicePixelRatio));
  const [wide, high] = [48, 120];
  const { data } = map.getViewport().querySelector('canvas').getContext('2d').getImageData(px - wide / 2, py - high / 2, wide, high);
  const step = (column) => {
    let sum = 0;
    for (let row = 0; row < high; row++) for (let k = 0; k < 3; k++) sum += Math.abs(data[4 * (row * wide + column + 1) + k] - data[4 * (row * wide + column) + k]);
    return sum / (3 * high);
  };
  const all = [...Array(wide - 1).keys()].map((column) => [Math.abs(column + 1 - wide / 2) <= 1, step(column)]);
  return [true, false].map((middle) => Math.max(...all.filter(([is]) => is === middle).map(([, value]) => value)));
}, x, y);

await page.setViewport({ width, height });
await visit();
const collection = await page.evaluate(() => window.sastrugi.state.collection);
await check('the page and its tiles load', async () => {
  await shot('home');
  const tiles = await page.evaluate(() => performance.getEntriesByType('resource').filter((entry) => entry.name.includes('/map/tiles/')).length);
  must(tiles > 0, 'no tile was requested');
  return `${collection.id}, ${tiles} tiles`;
});

const [west, south, east, north] = collection.home_m;
const middle = [west + 0.53 * (east - west), south + 0.47 * (north - south)];
const resolutions = collection.tile_grid.resolutions_m;
const finest = resolutions.at(-1);
const at = (resolution, more = '', place = middle) => `#c=${encodeURIComponent(collection.id)}&x=${place[0]}&y=${place[1]}&r=${resolution}${more}`;

// A small window, because each scale has to generate its own tiles.
await page.setViewport({ width: width >> 1, height: height / 3 | 0 });
await check('four scales', async () => {
  const pictures = [], levels = [];
  for (const [k, factor] of [1.4, 1.2, 0.8, 0.125].entries()) {
    const resolution = resolutions[Math.round((resolutions.length - 1) * (k + 1) / 4)] * factor;
    await visit(at(resolution));
    const fitting = resolutions.indexOf(nearest(resolutions, resolution));
    const asked = await levelsAsked();
    // The next coarser level is preloaded to fill gaps.
    must(Math.max(...asked) === fitting && Math.min(...asked) >= fitting - 1, `at ${resolution} m per pixel, levels ${asked.join(', ')} were requested; expected ${fitting}`);
    levels.push(fitting);
    pictures.push(await thinned());
    await shot(`scale-${k + 1}`);
    const colours = new Set(pictures[k].map(String)).size;
    must(colours > 8, `the map shows ${colours} colours at scale ${k + 1}`);
  }
  must(resolutions.length < 5 || new Set(levels).size === 4, `the four scales show levels ${levels.join(', ')}`);
  const least = Math.min(...pictures.flatMap((one, k) => pictures.slice(k + 1).map((other) => difference(one, other))));
  must(least > 5, `two of the scales differ by only ${least.toFixed(1)} of 255`);
  return `levels ${levels.join(', ')}; pictures differ by at least ${least.toFixed(1)} of 255`;
});

await check('levels agree across a tile seam', async () => {
  const grid = collection.tile_grid;
  const level = Math.floor(resolutions.length / 2);
  const step = resolutions[level];
  const edge = (value, origin) => origin + Math.round((value - origin) / (256 * step)) * 256 * step;
  const seam = [edge(middle[0], grid.origin_m[0]), edge(middle[1], grid.origin_m[1])];
  const means = [];
  for (const resolution of [step * 1.3, step, step / 1.3]) {
    await visit(at(resolution, '', seam));
    means.push(await colour(seam[0], seam[1], 60 * step));
  }
  await visit(at(step, '', seam));
  const [across, elsewhere] = await steps(seam[0], seam[1]);
  must(across <= 1.5 * elsewhere + 1, `colours differ by ${across.toFixed(1)} across the seam and by at most ${elsewhere.toFixed(1)} elsewhere`);
  const jump = Math.max(...means.slice(1).flatMap((mean, k) => mean.map((value, c) => Math.abs(value - means[k][c]))));
  must(jump < 12, `the mean colour jumps by ${jump.toFixed(1)} of 255`);
  return `mean colours within ${jump.toFixed(1)} of 255; ${across.toFixed(1)} across the seam, ${elsewhere.toFixed(1)} elsewhere`;
});

await page.setViewport({ width, height });
await check('the elevation readout equals /point and the patch around it', async () => {
  await visit(at(finest));
  await page.mouse.move(700, 420);
  await page.mouse.move(701, 421);
  await page.waitForFunction(() => document.getElementById('readout').dataset.elevation !== undefined);
  const { place, shown, exact } = await page.evaluate(() => {
    const box = document.getElementById('readout');
    return { place: window.sastrugi.map.getCoordinateFromPixel([701, 421]), shown: box.querySelector('b').textContent, exact: Number(box.dataset.elevation) };
  });
  const point = await (await fetch(`${url}/v1/collections/${encodeURIComponent(collection.id)}/point?x=${place[0]}&y=${place[1]}`)).json();
  must(point.elevation_m === exact, `the page has ${exact} m, the server has ${point.elevation_m} m`);
  // Interpolate between the four samples of a patch around the point.
  const spacing = collection.spacing_m;
  const [column, row] = place.map((value) => Math.floor(value / spacing));
  const corner = await fetch(`${url}/v1/collections/${encodeURIComponent(collection.id)}/patch?origin=${column * spacing},${row * spacing}&size=2,2&resolution_m=${spacing}&format=raw`);
  const [northWest, northEast, southWest, southEast] = new Float32Array(await corner.arrayBuffer());
  const [u, v] = [place[0] / spacing - column, place[1] / spacing - row];
  const between = (southWest * (1 - u) + southEast * u) * (1 - v) + (northWest * (1 - u) + northEast * u) * v;
  must(Math.abs(between - exact) < 1e-4, `the page has ${exact} m, the patch around it gives ${between} m`);
  must(Math.abs(Number(shown.replace('\u2212', '-').replace(' m', '')) - exact) <= 0.0051 + finest, `the page shows ${shown}, the server has ${exact} m`);
  return shown;
});

await check('a permalink round-trips', async () => {
  const more = '&layer=hillshade&class=0.5&sun=120,20&exaggeration=2';
  await visit(at(finest * 4, more));
  await wait(700);
  const first = await page.evaluate(() => location.hash);
  await visit(first);
  await wait(700);
  const second = await page.evaluate(() => location.hash);
  must(first === second, `${first} became ${second}`);
  must(second.includes('sun=120,20') && second.includes('layer=hillshade') && second.includes('class=0.5'), `display settings were lost: ${second}`);
  await shot('permalink');
  return second;
});

await check('back and forward', async () => {
  await visit(at(finest * 4));
  await wait(700);
  const first = await page.evaluate(() => location.hash);
  const before = await page.evaluate(() => window.sastrugi.map.getView().getResolution());
  await page.focus('#map');
  await page.keyboard.press('+');
  await page.keyboard.press('+');
  await until('the key + does not zoom', (coarse) => window.sastrugi.map.getView().getResolution() < 0.6 * coarse && !window.sastrugi.map.getView().getAnimating(), before);
  await until('the URL is not updated', (hash) => location.hash !== hash, first);
  await page.evaluate(() => history.back());
  await until(`going back does not restore ${before} m per pixel`, (coarse) => Math.abs(window.sastrugi.map.getView().getResolution() / coarse - 1) < 1e-3, before);
});

await check('a profile shows its metrics', async () => {
  await visit(at(finest * 4));
  await page.click('[data-panel=line]');
  await page.mouse.click(520, 400);
  await wait(400);
  await page.mouse.click(900, 560);
  await wait(400);
  await page.mouse.click(900, 560);
  await page.waitForSelector('.result[data-samples]');
  const samples = await page.$eval('.result', (element) => Number(element.dataset.samples));
  const box = await (await page.$('.chart')).boundingBox();
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await shot('profile');
  must(samples > 100, `only ${samples} samples have a height`);
  return (await page.$eval('.result dl', (element) => element.innerText)).replace(/\s+/g, ' ');
});

await check('the stated size of a download is right', async () => {
  await visit(at(finest * 4));
  await page.click('[data-panel=box]');
  await page.mouse.click(520, 400);
  await page.mouse.move(700, 500);
  await wait(300);
  await page.mouse.click(760, 560);
  await page.waitForFunction(() => /samples/.test(document.querySelector('#panel .hint').textContent));
  await shot('download');
  const told = [];
  for (const format of ['raw', 'npy', 'tif', 'png']) {
    await page.evaluate((name) => {
      const select = [...document.querySelectorAll('#panel select')].find((one) => [...one.options].some((option) => option.value === 'npy'));
      select.value = name;
      select.dispatchEvent(new Event('change', { bubbles: true }));
    }, format);
    const hint = await page.$eval('#panel .hint', (element) => element.textContent);
    await page.evaluate(() => {
      const make = URL.createObjectURL;
      window.saved = undefined;
      URL.createObjectURL = (blob) => { window.saved = blob.size; URL.createObjectURL = make; return make.call(URL, blob); };
      document.querySelector('#panel form').requestSubmit();
    });
    await until(`no ${format} was downloaded`, () => window.saved !== undefined);
    const length = await page.evaluate(() => window.saved);
    const [, number, unit] = /([\d.,]+) (B|kB|MB)$/.exec(hint.replace(/\u202f|\u00a0/g, ' '));
    const said = Number(number.replace(',', '')) * { B: 1, kB: 1e3, MB: 1e6 }[unit];
    const most = hint.includes('at most') ? 0 : 0.9;
    must(length <= 1.1 * said + 2000 && length >= most * said, `${format}: the page states "${hint}", but ${length} bytes were downloaded`);
    told.push(`${format}: ${said} B stated, ${length} B downloaded`);
  }
  return told.join('; ');
});

if (collection.kind === 'world') await check('a drawn box gives a study', async () => {
  // Edges of the box do not lie on samples.
  await visit(at(finest * 3.7, '&phenomena=1'));
  await page.click('[data-panel=box]');
  await page.mouse.click(520, 400);
  await page.mouse.move(700, 500);
  await wait(300);
  await page.mouse.click(760, 560);
  await until('no box was drawn', () => /samples/.test(document.querySelector('#panel .hint').textContent));
  await page.evaluate(() => [...document.querySelectorAll('#panel button')].find((button) => button.textContent === 'Study TOML').click());
  await until('neither a study nor a refusal is shown', () => ['pre', '.refused'].some((name) => !document.querySelector(`#panel ${name}`).hidden));
  must(await page.$eval('#panel .refused', (one) => one.hidden), await page.$eval('#panel .refused', (one) => one.textContent));
  must((await page.$eval('#panel', (panel) => panel.innerText)).includes('switched off'), 'the page does not say that switched-off processes apply');
  // The caller runs the study.
  const study = await page.$eval('#panel pre', (one) => one.textContent);
  writeFileSync(join(folder, 'study.toml'), study);
  await shot('study');
  return /size_px = .*/.exec(study)[0];
});

await check('the 3-D view opens', async () => {
  await visit(at(finest * 8));
  await page.click('[data-panel=relief]');
  await page.waitForSelector('#space canvas');
  let picture = await shot('space');
  for (const end = Date.now() + PATIENCE; picture.length <= 80000 && Date.now() < end;) picture = await shot('space');
  must(!complaints.some((text) => text.includes('THREE')), 'three.js reports a shader error');
  must(picture.length > 80000, `the picture is empty: ${picture.length} bytes`);
  const words = await page.$eval('.space-bar p', (element) => element.innerText);
  await page.click('.space-bar .main');
  must(await page.$eval('#space', (element) => element.hidden), 'the back button does not close the view');
  return words.replace(/\s+/g, ' ');
});

await check('one sun for the map and the 3-D view', async () => {
  await visit(at(finest * 8));
  await page.click('[data-panel=relief]');
  await page.waitForSelector('#space canvas');
  await slide('Sun azimuth', 100);
  await page.click('.space-bar .main');
  await until('the map does not take over the sun', () => location.hash.includes('sun=100,45'));
  await settled();
  must((await page.$eval('#panel input[aria-label="Sun azimuth"]', (input) => input.value)) === '100', 'the slider of the map shows a different sun');
  must((await tilesAsked()).some((name) => name.includes('sun_azimuth_deg=100')), 'no tile with that sun was requested');
});

if (collection.phenomena.length) await check('all processes can be switched off', async () => {
  await visit(at(finest * 8));
  const relief = () => page.evaluate(() => document.querySelectorAll('#panel .check input:checked').length);
  for (let left = await relief(); left > 0; left--) await page.click('#panel .check input:checked');
  must(await relief() === 0, 'a process cannot be switched off');
  await until('no tile of the base ground was requested', () => performance.getEntriesByType('resource').some(({ name }) => /\/tiles\/.*[?&]phenomena=(&|$)/.test(name)));
  await settled();
  must(await page.$eval('#message', (element) => element.hidden), await page.$eval('#message', (element) => element.innerText));
  await shot('base-ground');
});

await check('a refusal shows the server message', async () => {
  await visit(at(finest * 4));
  await page.click('[data-panel=line]');
  provoked = true;
  const far = 1e200;
  await page.$eval('#panel input', (input, x) => { input.value = `0, 0; ${x}, 0`; }, far);
  await page.evaluate(() => document.querySelector('#panel form').requestSubmit());
  await page.waitForSelector('#panel .refused');
  const shown = await page.$eval('#panel .refused', (element) => element.textContent);
  const { detail } = await (await fetch(`${url}/v1/collections/${encodeURIComponent(collection.id)}/profile?line=0,0;${encodeURIComponent(far)},0&samples=512`)).json();
  await shot('refused');
  provoked = false;
  must(shown === detail, `the page shows "${shown}", the server sent "${detail}"`);
  return shown;
});

/** The first collection with a track of each kind. */
async function driven() {
  const { collections } = await (await fetch(`${url}/v1/collections`)).json();
  const found = new Map();
  for (const one of collections.filter(({ tracks }) => tracks)) {
    const { tracks } = await (await fetch(`${url}/v1/collections/${encodeURIComponent(one.id)}/tracks`)).json();
    for (const track of tracks) if (!found.has(track.kind)) found.set(track.kind, { collection: one, track });
  }
  return [...found];
}
const rides = await driven();
/** Colours of the chosen track on the map, and of tracks in the 3-D view. */
const CHOSEN = [0xa8, 0x45, 0x2c], IN_SPACE = [0xd2, 0x55, 0x2f];
/** A drawn track: its coordinates, and the share of positions along it whose pixels have its colour. */
const drawnTrack = (id, colour) => page.evaluate((name, wanted) => {
  const { map } = window.sastrugi;
  const lines = map.getLayers().getArray().at(-1);
  const line = lines.getSource().getFeatures().find((feature) => feature.get('track') === name)?.getGeometry();
  if (!line) return { coordinates: [], coloured: 0 };
  const canvas = map.getViewport().querySelector(`.${lines.getClassName()} canvas`);
  const isColoured = (place) => {
    const [x, y] = map.getPixelFromCoordinate(place).map((value) => Math.floor(value * devicePixelRatio));
    const { data } = canvas.getContext('2d').getImageData(x - 1, y - 1, 3, 3);
    return [...Array(9).keys()].some((k) => wanted.every((value, c) => Math.abs(data[4 * k + c] - value) <= 12) && data[4 * k + 3] === 255);
  };
  const places = [...Array(50).keys()].map((k) => line.getCoordinateAt((k + 0.5) / 50));
  return { coordinates: line.getCoordinates(), coloured: places.filter(isColoured).length / places.length };
}, id, colour);

/** Opens a collection and waits for its tracks. */
async function showTracks(ground) {
  await visit(`#c=${encodeURIComponent(ground.id)}`);
  await until(`the ${ground.tracks} tracks are not drawn`, (count) => window.sastrugi.map.getLayers().getArray().at(-1).getSource().getFeatures().filter((feature) => feature.get('track')).length === count, Math.min(24, ground.tracks));
}

/** A screenshot of the 3-D view of a collection without its controls, once it has stopped changing. */
async function relief(ground, tracks) {
  if (tracks) await showTracks(ground);
  else await visit(`#c=${encodeURIComponent(ground.id)}`);
  await page.click('[data-panel=relief]');
  await page.waitForSelector('#space canvas');
  await page.$eval('.space-bar', (bar) => { bar.style.visibility = 'hidden'; });
  let before, now;
  const end = Date.now() + PATIENCE;
  do {
    must(Date.now() < end, 'the 3-D view keeps changing');
    before = now;
    await wait(500);
    now = await page.screenshot({ encoding: 'base64' });
  } while (now !== before);
  return now;
}
/** The same, as if the collection had no tracks. */
async function reliefWithoutTracks(ground) {
  const answer = (request) => (request.url().endsWith('/tracks') ? request.respond({ contentType: 'application/json', body: '{"tracks":[]}' }) : request.continue());
  await page.setRequestInterception(true);
  page.on('request', answer);
  try {
    return await relief(ground, false);
  } finally {
    page.off('request', answer);
    await page.setRequestInterception(false);
  }
}
/** Number of pixels that differ between two pictures, and how many of them are closer to a colour in the first. */
const changed = (one, other, colour) => page.evaluate(async (pictures, wanted) => {
  const read = async (text) => {
    const image = await createImageBitmap(new Blob([Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0))]));
    const context = new OffscreenCanvas(image.width, image.height).getContext('2d');
    context.drawImage(image, 0, 0);
    return context.getImageData(0, 0, image.width, image.height).data;
  };
  const [ours, theirs] = await Promise.all(pictures.map(read));
  const away = (data, at) => wanted.reduce((sum, value, k) => sum + Math.abs(data[at + k] - value), 0);
  let pixels = 0, nearer = 0;
  for (let at = 0; at < ours.length; at += 4) {
    if (ours[at] === theirs[at] && ours[at + 1] === theirs[at + 1] && ours[at + 2] === theirs[at + 2]) continue;
    pixels++;
    if (away(ours, at) < away(theirs, at)) nearer++;
  }
  return { pixels, nearer };
}, [one, other], colour);

for (const [kind, { collection: ground, track }] of rides) await check(`a ${kind} is listed and played`, async () => {
  await visit(`#c=${encodeURIComponent(ground.id)}`);
  await page.click('[data-panel=tracks]');
  await page.waitForSelector('#panel [data-track]');
  await page.click(`#panel [data-track="${track.id}"]`);
  await page.waitForSelector('#panel .chart');
  const speed = [300, 60, 10, 1].find((factor) => track.duration_s / factor >= 2.5) ?? 1;
  await page.select('#panel select[aria-label=Speed]', String(speed));
  const seen = page.evaluate(() => new Promise((resolve) => {
    const frames = [];
    const features = () => window.sastrugi.map.getLayers().getArray().at(-1).getSource().getFeatures();
    const look = () => {
      for (const feature of features()) {
        const image = feature.getStyle()?.getImage?.();
        if (image?.getPoints?.() === 3) frames.push([...feature.getGeometry().getCoordinates(), image.getRotation()]);
      }
      if (performance.now() < end) requestAnimationFrame(look); else resolve(frames);
    };
    const end = performance.now() + 2500;
    [...document.querySelectorAll('#panel button')].find((button) => button.textContent === 'Play').click();
    look();
  }));
  await wait(1000);
  await shot(`tracks-${kind}`);
  const frames = await seen;
  const clock = await page.$eval('#panel .slider output', (element) => parseFloat(element.textContent));
  must(clock > 0, 'the playback clock does not advance');
  // Directions of moves that are long compared with the rounding of a position and with a turn on the spot.
  let from = 0, moves = 0, along = 0;
  for (let to = 1; to < frames.length; to++) {
    const [dx, dy] = [0, 1].map((k) => frames[to][k] - frames[from][k]);
    if (Math.hypot(dx, dy) < 0.01 * track.length_m) continue;
    const rotation = frames[(from + to) >> 1][2];
    moves++;
    if (Math.sin(rotation) * dx + Math.cos(rotation) * dy > Math.SQRT1_2 * Math.hypot(dx, dy)) along++;
    from = to;
  }
  must(moves >= 5, `the marker moved only ${moves} times`);
  must(along >= 0.9 * moves, `the arrow points along the motion in only ${along} of ${moves} moves`);
  return `${ground.id}, ${track.id}: the arrow points along the motion in ${along} of ${moves} moves`;
});
for (const [kind, { collection: ground, track }] of rides) await check(`the track of a ${kind} is on the map`, async () => {
  await visit(`#c=${encodeURIComponent(ground.id)}&track=${encodeURIComponent(track.id)}`);
  await page.click('[data-panel=tracks]');
  await page.waitForSelector('#panel .chart');
  await settled();
  const { x_m: x, y_m: y } = await (await fetch(`${url}/v1/collections/${encodeURIComponent(ground.id)}/tracks/${encodeURIComponent(track.id)}`)).json();
  const { coordinates, coloured } = await drawnTrack(track.id, CHOSEN);
  await shot(`track-${kind}`);
  must(coordinates.length === x.length && coordinates.every((place, k) => place[0] === x[k] && place[1] === y[k]), `the line of ${track.id} differs from the server's`);
  must(coloured >= 0.9, `only ${(100 * coloured).toFixed()} % of the track has its colour`);
  return `${x.length} points, ${(100 * coloured).toFixed()} % of the line in its colour`;
});
for (const [kind, { collection: ground }] of rides) await check(`tracks of a ${kind} leave connections free`, async () => {
  await showTracks(ground);
  const times = await page.evaluate(() => performance.getEntriesByType('resource').filter(({ name }) => /\/tracks\/[^/]+$/.test(name)).map(({ startTime, responseEnd }) => [startTime, responseEnd]));
  times.sort(([a], [b]) => a - b);
  must(times.length === Math.min(24, ground.tracks), `${times.length} requests for ${ground.tracks} tracks`);
  must(times.every(([start], k) => k === 0 || start >= times[k - 1][1]), 'several tracks are requested at once');
  return `${times.length} requests, one after the other`;
});
for (const [kind, { collection: ground }] of rides) await check(`the track of a ${kind} is in the 3-D view`, async () => {
  const shown = await relief(ground, true);
  await shot(`space-tracks-${kind}`);
  const { pixels, nearer } = await changed(shown, await reliefWithoutTracks(ground), IN_SPACE);
  must(pixels > 100, `only ${pixels} pixels show tracks`);
  must(nearer > 0.9 * pixels, `only ${nearer} of ${pixels} pixels have the colour of tracks`);
  return `${pixels} pixels`;
});

await check('altered pixels are noticed', async () => {
  const warning = (one) => one.$eval('#message p', (text) => /alters image pixels/.test(text.textContent));
  await visit();
  must(!await warning(page), 'the page warns of pixels that are as they should be');
  const other = await browser.newPage();
  try {
    // As browsers do that protect against fingerprinting.
    await other.evaluateOnNewDocument(() => {
      const read = CanvasRenderingContext2D.prototype.getImageData;
      CanvasRenderingContext2D.prototype.getImageData = function (...box) { const image = read.apply(this, box); image.data[0] ^= 1; return image; };
    });
    await other.goto(`${url}/`, { waitUntil: 'load' });
    await other.evaluate(() => window.sastrugi.ready);
    must(await warning(other), 'the page does not warn');
  } finally {
    await other.close();
    await page.bringToFront();
  }
});

await check('a dense screen gets the next finer level', async () => {
  await page.setViewport({ width: 480, height: 320, deviceScaleFactor: 2 });
  await visit(at(finest * 2));
  const levels = await levelsAsked();
  await shot('dense');
  await page.setViewport({ width, height });
  must(Math.max(...levels) === resolutions.length - 1, `levels ${levels.join(', ')} of ${resolutions.length} were requested; expected the finest`);
});

await check('every control can be reached by keyboard', async () => {
  await visit(at(finest * 8));
  const names = new Set();
  for (let k = 0; k < 60; k++) {
    await page.keyboard.press('Tab');
    const name = await page.evaluate(() => { const one = document.activeElement; return one === document.body ? null : one.getAttribute('aria-label') ?? one.name ?? one.id; });
    if (name) names.add(name);
  }
  const missing = ['Zoom in', 'Zoom out', 'Home view', 'Close', 'Collections', 'Profile and distance', 'Sun azimuth'].filter((name) => !names.has(name));
  must(!missing.length, `not reached: ${missing.join(', ')}`);
  await page.keyboard.press('Escape');
  must(await page.$eval('#panel', (element) => element.hidden), 'Escape does not close the panel');
});

await check('no horizontal scroll on a phone', async () => {
  await page.setViewport({ width: 390, height: 844, isMobile: true, hasTouch: true, deviceScaleFactor: 1 });
  await visit(at(finest * 16));
  await shot('phone');
  for (const panel of ['worlds', 'ground', 'line', 'box']) {
    await page.tap(`[data-panel=${panel}]`);
    await wait(200);
    await fits(panel);
  }
  await page.tap('[data-panel=ground]');
  await wait(200);
  await shot('phone-panel');
  await page.tap('[data-panel=relief]');
  await page.waitForSelector('#space canvas');
  await fits('relief');
  await page.tap('.space-bar .main');
  await page.tap('#panel-close');
  must(await page.$eval('#panel', (element) => element.hidden), 'the panel does not close');
});
async function fits(panel) {
  const wide = await page.evaluate(() => Math.max(document.documentElement.scrollWidth, document.body.scrollWidth));
  must(wide <= 390, `${panel}: the page is ${wide} px wide`);
  const outside = await page.evaluate(() => [...document.querySelectorAll('button, input, select')].filter((one) => { const box = one.getBoundingClientRect(); return box.width && box.height && (box.right > 391 || box.left < -1); }).length);
  must(outside === 0, `${panel}: ${outside} controls lie outside the page`);
}

await check('dark colour scheme', async () => {
  await page.setViewport({ width, height });
  await page.emulateMediaFeatures([{ name: 'prefers-color-scheme', value: 'dark' }]);
  await visit(at(finest * 8));
  await page.click('[data-panel=worlds]');
  await shot('dark');
});

await check('no errors in the console, no failed request', async () => must(complaints.length === 0, complaints.slice(0, 5).join(' | ')));
await browser.close();
process.exit(failures ? 1 : 0);
