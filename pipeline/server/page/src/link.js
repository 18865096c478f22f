// The permalink: collection, position and display settings in the hash of the URL.

import { map } from './ground.js';
import { state, DEFAULTS, events } from './state.js';
import { debounce } from './dom.js';

const round = (value, step) => Number(value.toFixed(Math.max(0, Math.min(9, 2 - Math.floor(Math.log10(step))))));

export function write() {
  if (!state.collection || !map.getView().getCenter()) return '';
  const [x, y] = map.getView().getCenter();
  const resolution = map.getView().getResolution();
  const parts = [['c', encodeURIComponent(state.collection.id)], ['x', round(x, resolution)], ['y', round(y, resolution)], ['r', Number(resolution.toPrecision(6))]];
  const different = (name, key, text = String) => { if (state[name] !== DEFAULTS[name]) parts.push([key, text(state[name])]); };
  different('layer', 'layer');
  different('classOpacity', 'class');
  if (state.azimuth !== DEFAULTS.azimuth || state.elevation !== DEFAULTS.elevation) parts.push(['sun', `${state.azimuth},${state.elevation}`]);
  different('exaggeration', 'exaggeration');
  different('phenomena', 'phenomena', (list) => list.join(','));
  different('track', 'track', encodeURIComponent);
  return `#${parts.map((part) => part.join('=')).join('&')}`;
}

export function read(hash = location.hash) {
  const values = Object.fromEntries(hash.slice(1).split('&').filter(Boolean).map((part) => part.split(/=(.*)/s).slice(0, 2)));
  const number = (text, otherwise) => (text !== undefined && text !== '' && Number.isFinite(Number(text)) ? Number(text) : otherwise);
  const sun = (values.sun ?? '').split(',');
  const place = [values.x, values.y, values.r].map((text) => number(text, NaN));
  const decode = (text) => { try { return decodeURIComponent(text); } catch { return text; } };
  return {
    id: values.c === undefined ? null : decode(values.c),
    place: place.every(Number.isFinite) && place[2] > 0 ? { center: place.slice(0, 2), resolution: place[2] } : null,
    looks: {
      layer: values.layer ?? DEFAULTS.layer,
      classOpacity: Math.min(1, Math.max(0, number(values.class, DEFAULTS.classOpacity))),
      azimuth: number(sun[0], DEFAULTS.azimuth), elevation: number(sun[1], DEFAULTS.elevation),
      exaggeration: number(values.exaggeration, DEFAULTS.exaggeration),
      phenomena: values.phenomena === undefined ? null : values.phenomena.split(',').filter(Boolean).map(Number),
      track: values.track === undefined ? null : decode(values.track),
    },
  };
}

/** A small pan replaces the history entry; a new position, scale or collection adds one. */
export function keep(apply) {
  let last = null;
  const update = debounce(() => {
    const hash = write();
    if (!hash) return;
    const center = map.getView().getCenter();
    const resolution = map.getView().getResolution();
    last ??= { id: state.collection.id, center, resolution };
    if (hash === location.hash) return;
    const far = (last.id !== state.collection.id || Math.abs(Math.log2(last.resolution / resolution)) > 0.9
      || Math.hypot(center[0] - last.center[0], center[1] - last.center[1]) > 300 * resolution);
    history[far ? 'pushState' : 'replaceState'](null, '', hash);
    if (far) last = { id: state.collection.id, center, resolution };
  }, 300);
  map.on('moveend', update);
  events.addEventListener('change', update);
  addEventListener('popstate', () => { last = null; apply(read()); });
  return update;
}
