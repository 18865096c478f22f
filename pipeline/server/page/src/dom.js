// Elements, icons and number formatting.

export function h(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith('on')) element.addEventListener(name.slice(2), value);
    else if (name in element && name !== 'list' && typeof value !== 'string') element[name] = value;
    else if (value !== null && value !== undefined && value !== false) element.setAttribute(name, value);
  }
  element.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return element;
}

const SVG = 'http://www.w3.org/2000/svg';
export function s(tag, attributes = {}, ...children) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

const ICONS = {
  worlds: 'M12 3a9 9 0 1 0 0 18 9 9 0 0 0 0-18M3 12h18M12 3c-6 6-6 12 0 18M12 3c6 6 6 12 0 18',
  ground: 'M3 8l9-4 9 4-9 4zM3 12l9 4 9-4M3 16l9 4 9-4',
  line: 'M4 19L9 11l4 3 7-10M4 19v0M20 4v0',
  box: 'M12 4v10M8 11l4 4 4-4M4 19h16',
  tracks: 'M6 20c0-6 12-5 12-11a3 3 0 0 0-6 0M6 20h.01M12 9h.01',
  relief: 'M3 18l6-10 4 6 3-4 5 8z',
  close: 'M6 6l12 12M18 6L6 18',
  plus: 'M12 5v14M5 12h14',
  minus: 'M5 12h14',
  home: 'M4 11l8-7 8 7M6 10v9h12v-9',
};
export function icon(name) {
  return s('svg', { viewBox: '0 0 24 24', width: 20, height: 20, fill: 'none', stroke: 'currentColor',
    'stroke-width': 1.6, 'stroke-linecap': 'round', 'stroke-linejoin': 'round', 'aria-hidden': 'true' },
    s('path', { d: ICONS[name] }));
}

/** Decimals to show for a value with resolution `step`. */
export const decimals = (step) => Math.max(0, Math.min(3, Math.ceil(-Math.log10(step) - 1e-9)));

export function length(metres, digits = 3) {
  const size = Math.abs(metres);
  const [unit, factor] = size >= 1000 ? ['km', 1e-3] : size >= 1 || size === 0 ? ['m', 1] : size >= 0.01 ? ['cm', 100] : ['mm', 1000];
  return `${plain(metres * factor, digits)} ${unit}`;
}
export const plain = (value, digits = 3) => String(Number(value.toPrecision(digits)));
export const fixed = (value, places) => value.toFixed(places).replace(/^-(?=0(\.0*)?$)/, '').replace('-', '\u2212');
export const bytes = (count) => count < 1e3 ? `${count} B` : count < 1e6 ? `${plain(count / 1e3)} kB` : count < 1e9 ? `${plain(count / 1e6)} MB` : `${plain(count / 1e9)} GB`;

export function slider(label, { min, max, step, value, show = String, onchange }) {
  const output = h('output', {}, show(value));
  const input = h('input', { type: 'range', min: String(min), max: String(max), step: String(step), 'aria-label': label });
  input.value = value;
  input.addEventListener('input', () => { output.textContent = show(Number(input.value)); onchange(Number(input.value)); });
  const row = h('label', { class: 'slider' }, h('span', {}, label), output, input);
  row.set = (next) => { input.value = next; output.textContent = show(next); };
  return row;
}

export function save(blob, name) {
  const link = h('a', { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

export function debounce(run, wait) {
  let timer;
  return (...values) => { clearTimeout(timer); timer = setTimeout(() => run(...values), wait); };
}
