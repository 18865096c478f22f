// A height profile as inline SVG, with rounded axis labels and a cursor that reports the position.

import { s, h, fixed, plain } from './dom.js';

const WIDTH = 320, HEIGHT = 150, LEFT = 44, RIGHT = 8, TOP = 10, FOOT = 24;

function ticks(low, high, count) {
  const raw = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((k) => k * power).find((k) => k >= raw);
  const list = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + step * 1e-9; k++) list.push(k * step);
  return { list, places: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
}

/** Calls `hover(index)` with the sample under the pointer, or with null. */
export function chart({ along, heights, label = 'distance (m)', hover = () => {} }) {
  const known = heights.filter((z) => z !== null && Number.isFinite(z));
  if (known.length < 2 || !(along.at(-1) > along[0])) return h('p', { class: 'hint' }, 'No data along this line.');
  let low = Math.min(...known), high = Math.max(...known);
  const pad = Math.max((high - low) * 0.08, 1e-4);
  low -= pad; high += pad;
  const first = along[0], last = along.at(-1);
  const px = (value) => LEFT + ((value - first) / (last - first)) * (WIDTH - LEFT - RIGHT);
  const py = (value) => TOP + ((high - value) / (high - low)) * (HEIGHT - TOP - FOOT);
  const svg = s('svg', { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, class: 'chart', role: 'img', tabindex: 0,
    'aria-label': `Elevation profile, ${plain(Math.min(...known), 4)} m to ${plain(Math.max(...known), 4)} m; use the arrow keys to read values` });
  const y = ticks(low, high, 4), x = ticks(first, last, 4);
  for (const tick of y.list) svg.append(s('line', { x1: LEFT, x2: WIDTH - RIGHT, y1: py(tick), y2: py(tick), class: 'grid' }),
    s('text', { x: LEFT - 5, y: py(tick) + 3, 'text-anchor': 'end' }, fixed(tick, y.places)));
  for (const tick of x.list) svg.append(s('text', { x: Math.min(px(tick), WIDTH - 14), y: HEIGHT - 12, 'text-anchor': 'middle' }, fixed(tick, x.places)));
  svg.append(s('text', { x: WIDTH - RIGHT, y: HEIGHT - 1, 'text-anchor': 'end', class: 'axis' }, `elevation (m), ${label}`));
  let path = '', pen = 'M';
  heights.forEach((z, at) => {
    if (z === null || !Number.isFinite(z)) { pen = 'M'; return; }
    path += `${pen}${px(along[at]).toFixed(1)} ${py(z).toFixed(1)}`;
    pen = 'L';
  });
  const mark = s('line', { y1: TOP, y2: HEIGHT - FOOT, class: 'mark', visibility: 'hidden' });
  svg.append(s('path', { d: path, class: 'curve' }), mark);
  const text = h('p', { class: 'hint', 'aria-live': 'polite' }, '\u00a0');
  let current = null;
  svg.show = (at) => {
    current = at;
    mark.setAttribute('visibility', at === null ? 'hidden' : 'visible');
    if (at !== null) { mark.setAttribute('x1', px(along[at])); mark.setAttribute('x2', px(along[at])); }
    text.textContent = at === null ? '\u00a0' : `${plain(along[at], 5)} ${label.includes('(s)') ? 's' : 'm'}: ${heights[at] === null ? 'no data' : `${fixed(heights[at], 3)} m`}`;
  };
  const pick = (at) => { svg.show(at); hover(at); };
  svg.addEventListener('pointermove', (event) => {
    const box = svg.getBoundingClientRect();
    const value = first + (((event.clientX - box.left) / box.width) * WIDTH - LEFT) / (WIDTH - LEFT - RIGHT) * (last - first);
    let at = along.findIndex((d) => d >= value);
    if (at < 0) at = along.length - 1;
    pick(at);
  });
  svg.addEventListener('pointerleave', () => pick(null));
  svg.addEventListener('keydown', (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    event.preventDefault();
    pick(Math.max(0, Math.min(along.length - 1, (current ?? -1) + step * (event.shiftKey ? 10 : 1))));
  });
  const figure = h('figure', {}, svg, text);
  figure.show = svg.show;
  return figure;
}
