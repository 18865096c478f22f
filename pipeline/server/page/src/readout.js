// Coordinates and elevation under the cursor. Requests that are out of date are aborted.

import { map } from './ground.js';
import { json, query, base } from './api.js';
import { failed } from './tell.js';
import { state, phenomena, on } from './state.js';
import { debounce, decimals, fixed, length } from './dom.js';
import { containsCoordinate } from 'ol/extent.js';

let stop = new AbortController();

export function readout(element) {
  const [place, height, kind] = element.children;
  const ask = debounce(async (x, y, step) => {
    stop = new AbortController();
    try {
      const point = await json(`${base(state.collection)}/point${query({ x, y, ...phenomena() })}`, stop.signal);
      height.textContent = point.elevation_m === null ? 'no data' : `${fixed(point.elevation_m, decimals(step))} m`;
      height.title = `interpolated between samples ${length(point.resolution_m)} apart`;
      kind.textContent = point.class ?? '';
      element.dataset.elevation = point.elevation_m ?? '';
    } catch (error) {
      if (error.name === 'AbortError') return;
      height.textContent = '';
      failed(error);
    }
  }, 120);
  let last = null;
  const at = ([x, y]) => {
    last = [x, y];
    stop.abort();
    delete element.dataset.elevation;
    const step = map.getView().getResolution();
    const places = decimals(step);
    place.textContent = `${fixed(x, places)}, ${fixed(y, places)} m`;
    kind.textContent = '';
    const inside = containsCoordinate(state.collection.bounds_m, [x, y]);
    height.textContent = inside ? '…' : 'outside';
    if (inside) ask(x, y, step);
  };
  map.on('pointermove', (event) => { if (!event.dragging) at(event.coordinate); });
  map.on('click', (event) => at(event.coordinate));
  // Without a pointer, read the centre: after a move by keyboard, and on touch screens.
  map.on('moveend', () => {
    const touch = matchMedia('(hover: none)').matches;
    if (touch || map.getTargetElement().contains(document.activeElement) && document.activeElement.matches(':focus-visible')) at(map.getView().getCenter());
  });
  on(['collection'], () => { stop.abort(); last = null; place.textContent = height.textContent = kind.textContent = ''; });
  on(['phenomena'], () => { if (last) at(last); });
}
