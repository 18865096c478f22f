// Smoke test of the page: node test/smoke.mjs URL FOLDER. Needs Chromium (CHROMIUM names it when it is not on the path).
// SMOKE_ONLY, a regular expression, picks checks by their names; SMOKE_SECONDS is the patience with each.
// Each check prints one line; the screenshots go into FOLDER; the exit code is 1 when a check failed.

import puppeteer from 'puppeteer-core';
import { mkdirSync, existsSync } from 'node:fs';
import { join } from 'node:path';

const url = (process.argv[2] ?? 'http://127.0.0.1:8080').replace(/\/$/, '');
const folder = process.argv[3] ?? 'smoke';
const CHROMIUM = [process.env.CHROMIUM, '/usr/bin/chromium', '/usr/bin/chromium-browser', '/usr/bin/google-chrome'].find((path) => path && existsSync(path));
const ONLY = process.env.SMOKE_ONLY && new RegExp(process.env.SMOKE_ONLY);
const PATIENCE = Number(process.env.SMOKE_SECONDS ?? 60) * 1000;
if (!CHROMIUM) {
  console.error('Chromium was not found: install it or name it in the variable CHROMIUM.');
  process.exit(2);
}
mkdirSync(folder, { recursive: true });

const browser = await puppeteer.launch({ executablePath: CHROMIUM, headless: true, args: ['--no-sandbox', '--disable-gpu', '--enable-unsafe-swiftshader', '--hide-scrollbars'] });
const page = await browser.newPage();
page.setDefaultTimeout(PATIENCE);
const complaints = [];
page.on('console', (message) => { if (message.type() === 'error') complaints.push(message.text()); });
page.on('pageerror', (error) => complaints.push(String(error)));
page.on('response', (response) => { if (response.status() >= 400) complaints.push(`${response.status()} ${response.url()}`); });
page.on('requestfailed', (request) => { const why = request.failure()?.errorText; if (why !== 'net::ERR_ABORTED') complaints.push(`${why} ${request.url()}`); });

let failures = 0;
async function check(name, run) {
  if (ONLY && !ONLY.test(name)) return;
  try {
    const note = await run();
    console.log(`ok    ${name}${note ? `: ${note}` : ''}`);
  } catch (error) {
    failures++;
    console.log(`FAIL  ${name}: ${error.message}`);
  }
}
function must(truth, sentence) { if (!truth) throw new Error(sentence); }
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
/** Mean colour of the base canvas over a box around a place, by the map's own pixels. */
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

await page.setViewport({ width: 1280, height: 900 });
await visit();
const collection = await page.evaluate(() => window.sastrugi.state.collection);
await check('the page loads and tiles come', async () => {
  await shot('home');
  const tiles = await page.evaluate(() => performance.getEntriesByType('resource').filter((entry) => entry.name.includes('/map/tiles/')).length);
  must(tiles > 0, 'no tile was asked for');
  return `${collection.id}, ${tiles} tiles`;
});

const [west, south, east, north] = collection.home_m;
const middle = [west + 0.53 * (east - west), south + 0.47 * (north - south)];
const resolutions = collection.tile_grid.resolutions_m;
const finest = resolutions.at(-1);
const at = (resolution, more = '', place = middle) => `#c=${encodeURIComponent(collection.id)}&x=${place[0]}&y=${place[1]}&r=${resolution}${more}`;

await check('four scales', async () => {
  const coarse = Math.log(resolutions[0]), fine = Math.log(finest / 8);
  for (let k = 0; k < 4; k++) {
    await visit(at(Math.exp(coarse + (fine - coarse) * (0.25 + 0.25 * k))));
    const colours = await page.evaluate(() => {
      const canvas = window.sastrugi.map.getViewport().querySelector('canvas');
      const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
      const seen = new Set();
      for (let i = 0; i < data.length; i += 4 * 97) seen.add((data[i] << 16) | (data[i + 1] << 8) | data[i + 2]);
      return seen.size;
    });
    await shot(`scale-${k + 1}`);
    must(colours > 8, `the map shows ${colours} colours at scale ${k + 1}`);
  }
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
  const jump = Math.max(...means.slice(1).flatMap((mean, k) => mean.map((value, c) => Math.abs(value - means[k][c]))));
  must(jump < 12, `the mean colour jumps by ${jump.toFixed(1)} of 255`);
  return `mean colours within ${jump.toFixed(1)} of 255`;
});

await check('the elevation readout equals /point', async () => {
  await visit(at(finest));
  await page.mouse.move(700, 420);
  await page.mouse.move(701, 421);
  await page.waitForFunction(() => document.getElementById('readout').dataset.elevation !== undefined);
  const { place, shown, exact } = await page.evaluate(() => {
    const box = document.getElementById('readout');
    return { place: window.sastrugi.map.getCoordinateFromPixel([701, 421]), shown: box.querySelector('b').textContent, exact: Number(box.dataset.elevation) };
  });
  const point = await (await fetch(`${url}/v1/collections/${encodeURIComponent(collection.id)}/point?x=${place[0]}&y=${place[1]}`)).json();
  must(point.elevation_m === exact, `the page has ${exact} m, the server ${point.elevation_m} m`);
  must(Math.abs(Number(shown.replace('\u2212', '-').replace(' m', '')) - exact) <= 0.0051 + finest, `the page shows ${shown}, the server ${exact} m`);
  return shown;
});

await check('a permalink comes back', async () => {
  const more = '&layer=hillshade&class=0.5&sun=120,20&exaggeration=2';
  await visit(at(finest * 4, more));
  await new Promise((resolve) => setTimeout(resolve, 700));
  const first = await page.evaluate(() => location.hash);
  await visit(first);
  await new Promise((resolve) => setTimeout(resolve, 700));
  const second = await page.evaluate(() => location.hash);
  must(first === second, `${first} became ${second}`);
  must(second.includes('sun=120,20') && second.includes('layer=hillshade') && second.includes('class=0.5'), `looks were lost: ${second}`);
  await shot('permalink');
  return second;
});

await check('back and forward', async () => {
  await visit(at(finest * 4));
  await new Promise((resolve) => setTimeout(resolve, 500));
  const before = await page.evaluate(() => window.sastrugi.map.getView().getResolution());
  await page.focus('#map');
  await page.keyboard.press('+');
  await page.keyboard.press('+');
  await new Promise((resolve) => setTimeout(resolve, 1200));
  const closer = await page.evaluate(() => window.sastrugi.map.getView().getResolution());
  must(closer < 0.6 * before, 'the key + does not zoom');
  await page.evaluate(() => history.back());
  await new Promise((resolve) => setTimeout(resolve, 800));
  const after = await page.evaluate(() => window.sastrugi.map.getView().getResolution());
  must(Math.abs(after / before - 1) < 1e-3, `back leads to ${after} m a pixel, not ${before}`);
});

await check('a profile gives numbers', async () => {
  await visit(at(finest * 4));
  await page.click('[data-panel=line]');
  await page.mouse.click(520, 400);
  await new Promise((resolve) => setTimeout(resolve, 400));
  await page.mouse.click(900, 560);
  await new Promise((resolve) => setTimeout(resolve, 400));
  await page.mouse.click(900, 560);
  await page.waitForSelector('.result[data-samples]');
  const samples = await page.$eval('.result', (element) => Number(element.dataset.samples));
  const box = await (await page.$('.chart')).boundingBox();
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await shot('profile');
  must(samples > 100, `${samples} samples have a height`);
  return (await page.$eval('.result dl', (element) => element.innerText)).replace(/\s+/g, ' ');
});

await check('a download says its size beforehand', async () => {
  await visit(at(finest * 4));
  await page.click('[data-panel=box]');
  await page.mouse.click(520, 400);
  await page.mouse.move(700, 500);
  await new Promise((resolve) => setTimeout(resolve, 300));
  await page.mouse.click(760, 560);
  await page.waitForFunction(() => /samples/.test(document.querySelector('#panel .hint').textContent));
  await shot('download');
  return page.$eval('#panel .hint', (element) => element.textContent);
});

await check('the 3-D view opens', async () => {
  await visit(at(finest * 8));
  await page.click('[data-panel=relief]');
  await page.waitForSelector('#space canvas');
  await new Promise((resolve) => setTimeout(resolve, 2500));
  const picture = await shot('space');
  must(!complaints.some((text) => text.includes('THREE')), 'three.js complains of a shader');
  must(picture.length > 80000, `the picture is empty: ${picture.length} bytes`);
  const words = await page.$eval('.space-bar p', (element) => element.innerText);
  await page.click('.space-bar .main');
  must(await page.$eval('#space', (element) => element.hidden), 'the button back does not lead back');
  return words.replace(/\s+/g, ' ');
});

const { collections } = await (await fetch(`${url}/v1/collections`)).json();
const driven = collections.find((one) => one.tracks);
if (driven) await check('tracks are listed and played', async () => {
  await visit(`#c=${encodeURIComponent(driven.id)}`);
  await page.click('[data-panel=tracks]');
  await page.waitForSelector('#panel [data-track]');
  await page.click('#panel [data-track]');
  await page.waitForSelector('#panel .chart');
  await page.evaluate(() => [...document.querySelectorAll('#panel button')].find((button) => button.textContent === 'Play').click());
  await new Promise((resolve) => setTimeout(resolve, 1500));
  const clock = await page.$eval('#panel .slider output', (element) => parseFloat(element.textContent));
  await shot('tracks');
  must(clock > 0, 'the clock of the playback stands still');
  await page.click('[data-panel=relief]');
  await page.waitForSelector('#space canvas');
  await new Promise((resolve) => setTimeout(resolve, 2500));
  await shot('space-tracks');
});

await check('a phone has no horizontal scroll', async () => {
  await page.setViewport({ width: 390, height: 844, isMobile: true, hasTouch: true, deviceScaleFactor: 2 });
  await visit(at(finest * 16));
  await shot('phone');
  await page.tap('[data-panel=ground]');
  await new Promise((resolve) => setTimeout(resolve, 300));
  await shot('phone-panel');
  const wide = await page.evaluate(() => Math.max(document.documentElement.scrollWidth, document.body.scrollWidth));
  must(wide <= 390, `the page is ${wide} px wide`);
  const outside = await page.evaluate(() => [...document.querySelectorAll('button, input, select')].filter((one) => { const box = one.getBoundingClientRect(); return box.width && box.height && (box.right > 391 || box.left < -1); }).length);
  must(outside === 0, `${outside} controls stick out`);
});

await check('dark', async () => {
  await page.setViewport({ width: 1280, height: 900 });
  await page.emulateMediaFeatures([{ name: 'prefers-color-scheme', value: 'dark' }]);
  await visit(at(finest * 64));
  await page.click('[data-panel=worlds]');
  await shot('dark');
});

await check('no errors in the console, no failed request', async () => must(complaints.length === 0, complaints.slice(0, 5).join(' | ')));
await browser.close();
process.exit(failures ? 1 : 0);
