// Downloads a box of ground as heights, as an image, or as a terrain section of a study.

import Draw, { createBox } from 'ol/interaction/Draw.js';
import Feature from 'ol/Feature.js';
import { fromExtent } from 'ol/geom/Polygon.js';
import { map, drawn, windowOf } from './ground.js';
import { get, query, base } from './api.js';
import { failed } from './tell.js';
import { state, phenomena, light, on } from './state.js';
import { h, bytes, save, plain, length } from './dom.js';
import { fieldName, formatName } from './names.js';
import { line as ink, RUST } from './ink.js';

/** Bytes per sample; for compressed formats an upper bound. */
const BYTES = { tif: 4, npy: 8, raw: 4, png: 2 };
const PACKED = ['tif', 'png'];

export function boxPanel() {
  let draw = null, feature = null;
  const sides = ['West', 'South', 'East', 'North'].map((name) => h('input', { type: 'number', step: 'any', 'aria-label': `${name} (m)`, oninput: changed }));
  const resolution = h('input', { type: 'number', step: 'any', min: '0', oninput: tellSize });
  const field = h('select', { onchange: tellSize });
  const format = h('select', { onchange: tellSize }, ['tif', 'npy', 'raw', 'png'].map((name) => h('option', { value: name }, formatName(name))));
  const size = h('p', { class: 'hint', 'aria-live': 'polite' });
  const text = h('pre', { tabindex: '0', hidden: true });
  const copy = h('button', { type: 'button', hidden: true, onclick: async () => { try { await navigator.clipboard.writeText(text.textContent); copy.textContent = 'Copied'; } catch { getSelection().selectAllChildren(text); } } }, 'Copy');
  const study = h('button', { type: 'button', onclick: snippet }, 'Study TOML');
  const complete = h('p', { class: 'hint', hidden: true }, 'The study applies all processes, including those that are switched off here.');
  const refused = h('p', { class: 'refused', role: 'alert', hidden: true });

  const extent = () => sides.map((side) => Number(side.value));
  const samples = () => { const [w, s, e, n] = extent(); const step = Number(resolution.value); return [Math.round((e - w) / step), Math.round((n - s) / step)]; };
  const good = () => samples().every((count) => Number.isFinite(count) && count >= 1);
  const corner = () => extent().slice(0, 2);
  const where = () => ({ origin: corner().join(','), size: samples().join(','), resolution_m: resolution.value });
  /** The same window by its centre, which the server moves to the nearest samples: those of a study lie at multiples of the cell. */
  const nearest = () => {
    const counts = samples();
    const center = corner().map((edge, at) => edge + 0.5 * (counts[at] - 1) * Number(resolution.value));
    return { center: center.join(','), size: counts.join(','), resolution_m: resolution.value };
  };

  function take(box) {
    const places = Math.max(0, Math.min(4, 1 - Math.floor(Math.log10(Math.max(box[2] - box[0], 1e-6) / 1000))));
    box.forEach((value, at) => { sides[at].value = value.toFixed(places); });
    changed();
  }
  function changed() {
    const box = extent();
    if (feature && drawn.hasFeature(feature)) drawn.removeFeature(feature);
    if (box[2] > box[0] && box[3] > box[1]) {
      feature = new Feature(fromExtent(box));
      feature.setStyle(ink(RUST));
      drawn.addFeature(feature);
    }
    tellSize();
  }
  function tellSize() {
    refused.hidden = true;
    if (!good()) { size.textContent = 'Draw a box on the map (two clicks) or enter its edges.'; return; }
    const [columns, rows] = samples();
    size.textContent = `${columns} × ${rows} samples, ${length(columns * resolution.value)} × ${length(rows * resolution.value)}, ${PACKED.includes(format.value) ? 'at most ' : ''}${bytes(columns * rows * BYTES[format.value])}`;
  }
  const told = (error) => { refused.textContent = error.message; refused.hidden = false; };
  async function download() {
    if (!good()) return tellSize();
    const sun = field.value === 'image' ? { sun_azimuth_deg: light().sun_azimuth_deg, sun_elevation_deg: light().sun_elevation_deg } : {};
    try {
      const response = await get(`${base(state.collection)}/patch${query({ ...where(), field: field.value, format: format.value, ...phenomena(), ...sun })}`);
      save(await response.blob(), `${state.collection.id}-${field.value}.${format.value}`);
    } catch (error) { told(error); }
  }
  async function snippet() {
    if (!good()) return tellSize();
    try {
      text.textContent = await (await get(`${base(state.collection)}/study${query(nearest())}`)).text();
      text.hidden = copy.hidden = false;
      complete.hidden = !state.phenomena;
      copy.textContent = 'Copy';
    } catch (error) { told(error); }
  }
  function renew() {
    const { fields, cell_m: cell, kind } = state.collection;
    field.replaceChildren(...fields.map((name) => h('option', { value: name }, fieldName(name))));
    resolution.value = cell;
    study.hidden = kind !== 'world';
    text.hidden = copy.hidden = complete.hidden = true;
    sides.forEach((side) => { side.value = ''; });
    changed();
  }
  on(['collection'], renew);
  const element = h('form', { onsubmit: (event) => { event.preventDefault(); download(); } },
    h('div', { class: 'pairs' }, ['West', 'South', 'East', 'North'].map((name, at) => h('label', {}, `${name} (m)`, sides[at]))),
    h('div', { class: 'pairs' }, h('label', {}, 'Field', field), h('label', {}, 'Format', format)),
    h('div', { class: 'pairs' }, h('label', {}, 'Resolution (m)', resolution), h('button', { type: 'button', onclick: () => take(windowOf()) }, 'Use map view')),
    size, refused, h('div', { class: 'row' }, h('button', { class: 'main' }, 'Download'), study), complete, text, copy);
  return {
    title: 'Download', element, take,
    open() {
      if (!field.options.length) renew();
      draw = new Draw({ type: 'Circle', geometryFunction: createBox(), style: ink(RUST) });
      draw.on('drawend', (event) => take(event.feature.getGeometry().getExtent()));
      map.addInteraction(draw);
      tellSize();
    },
    close() { map.removeInteraction(draw); if (feature && drawn.hasFeature(feature)) drawn.removeFeature(feature); feature = null; },
  };
}
