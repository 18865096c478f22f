// Fetches the heights of the window for the 3-D view, whose code is loaded on first use.

import { map, windowOf } from './ground.js';
import { get, query, base } from './api.js';
import { failed } from './tell.js';
import { state, set, phenomena } from './state.js';
import { tracksShown } from './tracks.js';
import { getIntersection } from 'ol/extent.js';

const ACROSS_MAX = 384;

/** Sample spacing, from the tile grid or the finest of the collection, with at most 384 samples across. */
function spacing(span, { tile_grid: grid, spacing_m: finest }) {
  const steps = [...grid.resolutions_m, finest].sort((a, b) => a - b);
  return steps.find((step) => span / step <= ACROSS_MAX) ?? steps.at(-1);
}

/** Whether the ground has albedo; a world has none while the process that produces it is off. */
function hasAlbedo() {
  const { fields, phenomena: processes } = state.collection;
  const own = processes.find(({ kind }) => kind === 'albedo');
  return state.layer !== 'hillshade' && fields.includes('albedo') && (!own || !state.phenomena || state.phenomena.includes(own.number));
}

let view = null;
export async function open3d(element, done) {
  const extent = getIntersection(windowOf(), state.collection.bounds_m);
  const across = Math.max(extent[2] - extent[0], extent[3] - extent[1]);
  const step = spacing(across, state.collection);
  const count = (span) => Math.max(4, Math.round(span / step));
  const size = [count(extent[2] - extent[0]), count(extent[3] - extent[1])];
  const snap = (value, edge) => edge + Math.round((value - edge) / step) * step;
  const origin = [snap(extent[0], state.collection.bounds_m[0]), snap(extent[1], state.collection.bounds_m[1])];
  document.body.classList.add('busy');
  try {
    const patch = (field) => get(`${base(state.collection)}/patch${query({ origin: origin.join(','), size: size.join(','), resolution_m: step, field, format: 'raw', feature_min_m: state.collection.kind === 'world' ? 2 * step : null, ...phenomena() })}`);
    const [{ show }, response, bright] = await Promise.all([import('./three.js'), patch('elevation'), hasAlbedo() ? patch('albedo') : null]);
    const [heights, albedo] = await Promise.all([response, bright].map(async (one) => one && new Float32Array(await one.arrayBuffer())));
    const columns = Number(response.headers.get('Grid-Columns') ?? size[0]);
    const rows = Number(response.headers.get('Grid-Rows') ?? size[1]);
    const cell = Number(response.headers.get('Grid-Resolution-M') ?? step);
    const corner = (response.headers.get('Grid-Origin-M') ?? origin.join(',')).split(',').map(Number);
    element.hidden = false;
    view = show(element, { heights, albedo, columns, rows, cell, corner, layer: state.layer, azimuth: state.azimuth, elevation: state.elevation, tracks: [...tracksShown.values()], title: state.collection.title,
      shone: (azimuth, elevation) => set({ azimuth, elevation }) });
    done?.();
  } catch (error) {
    element.hidden = true;
    failed(error);
  } finally {
    document.body.classList.remove('busy');
  }
}
export function close3d(element) {
  view?.dispose();
  view = null;
  element.hidden = true;
  map.getTargetElement().focus();
}
