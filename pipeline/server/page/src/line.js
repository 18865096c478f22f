// A line on the ground: its horizontal and surface length, and its height profile.

import Draw from 'ol/interaction/Draw.js';
import Feature from 'ol/Feature.js';
import LineString from 'ol/geom/LineString.js';
import { map, drawn } from './ground.js';
import { json, query, base } from './api.js';
import { failed } from './tell.js';
import { state, phenomena, on } from './state.js';
import { chart } from './chart.js';
import { h, length, save, plain } from './dom.js';
import { line as ink, marker, BLUE } from './ink.js';

const SAMPLES = 512;

export function linePanel() {
  const place = h('input', { type: 'text', placeholder: 'x, y; x, y', 'aria-label': 'Points of the line: x, y; x, y' });
  const result = h('div', { class: 'result' });
  const mark = marker(BLUE);
  let feature = null, draw = null, stop = new AbortController();

  const clear = () => {
    stop.abort();
    mark.remove();
    if (feature && drawn.hasFeature(feature)) drawn.removeFeature(feature);
    feature = null;
    result.replaceChildren(h('p', { class: 'hint' }, 'Click or tap points on the map; double-click to finish.'));
  };

  async function measure(points) {
    clear();
    feature = new Feature(new LineString(points));
    feature.setStyle(ink(BLUE));
    drawn.addFeature(feature);
    place.value = points.map((point) => point.map((value) => plain(value, 9)).join(', ')).join('; ');
    result.replaceChildren(h('p', { class: 'hint' }, '…'));
    stop = new AbortController();
    try {
      const line = points.map((point) => point.join(',')).join(';');
      const profile = await json(`${base(state.collection)}/profile${query({ line, samples: SAMPLES, ...phenomena() })}`, stop.signal);
      show(profile);
    } catch (error) {
      if (error.status === undefined) failed(error);
      else result.replaceChildren(h('p', { class: 'refused', role: 'alert' }, error.message));
    }
  }

  function show({ distance_m: along, x_m: x, y_m: y, elevation_m: heights, resolution_m: step }) {
    let surface = 0, whole = true, climb = 0;
    for (let at = 1; at < along.length; at++) {
      if (heights[at] === null || heights[at - 1] === null) { whole = false; continue; }
      const rise = heights[at] - heights[at - 1];
      surface += Math.hypot(along[at] - along[at - 1], rise);
      climb += Math.max(0, rise);
    }
    const known = heights.filter((z) => z !== null);
    const row = (name, value) => [h('dt', {}, name), h('dd', {}, value)];
    const curve = chart({ along, heights, hover: (at) => (at === null ? mark.hide() : mark.at([x[at], y[at]])) });
    const csv = () => save(new Blob([`distance_m,x_m,y_m,elevation_m\n${along.map((d, at) => [d, x[at], y[at], heights[at] ?? ''].join(',')).join('\n')}\n`], { type: 'text/csv' }), `${state.collection.id}-profile.csv`);
    result.replaceChildren(
      h('dl', {},
        row('Horizontal distance', length(along.at(-1), 5)),
        row('Surface distance', whole ? length(surface, 5) : 'gaps in the data'),
        known.length ? row('Relief', length(Math.max(...known) - Math.min(...known))) : [],
        row('Total ascent', length(climb))),
      curve,
      h('p', { class: 'hint' }, `${along.length} samples, ${length(along[1] - along[0])} apart; terrain resolution ${length(step)}.`),
      h('button', { type: 'button', onclick: csv }, 'Download CSV'));
    result.dataset.samples = known.length;
  }

  const typed = () => {
    const points = place.value.split(';').map((text) => text.trim().split(/[\s,]+/).map(Number)).filter((point) => point.length === 2 && point.every(Number.isFinite));
    if (points.length < 2) return failed({ status: 0, message: 'Enter at least two points: x, y; x, y' });
    measure(points);
  };
  const element = h('div', {}, result, h('form', { class: 'row', onsubmit: (event) => { event.preventDefault(); typed(); } }, place, h('button', {}, 'Measure')));
  clear();
  on(['collection'], () => { clear(); place.value = ''; });
  on(['phenomena'], () => { if (feature) measure(feature.getGeometry().getCoordinates()); });
  return {
    title: 'Profile and distance', element, measure,
    open() {
      draw = new Draw({ type: 'LineString', style: ink(BLUE) });
      draw.on('drawstart', clear);
      draw.on('drawend', (event) => measure(event.feature.getGeometry().getCoordinates()));
      map.addInteraction(draw);
    },
    close() { map.removeInteraction(draw); clear(); },
  };
}
