// The map: a plane in metres, the collection's tile grid, and its layers.

import OlMap from 'ol/Map.js';
import View from 'ol/View.js';
import Projection from 'ol/proj/Projection.js';
import TileLayer from 'ol/layer/Tile.js';
import VectorLayer from 'ol/layer/Vector.js';
import VectorSource from 'ol/source/Vector.js';
import { defaults } from 'ol/interaction/defaults.js';
import { intersects } from 'ol/extent.js';
import { Tiles, forget } from './tiles.js';
import { state, on } from './state.js';
import { base as address } from './api.js';
import { debounce } from './dom.js';

/** Finest resolution of the map, metres per screen pixel: the scale bar then reads 1 cm. */
const FINEST_PIXEL_M = 1e-4;
const calm = matchMedia('(prefers-reduced-motion: reduce)');

export const drawn = new VectorSource();
export const map = new OlMap({
  controls: [],
  interactions: defaults({ altShiftDragRotate: false, pinchRotate: false }),
  maxTilesLoading: 12,
});

const base = new TileLayer({ className: 'base', preload: 1 });
const classes = new TileLayer({ className: 'classes' });
map.addLayer(base);
map.addLayer(classes);
map.addLayer(new VectorLayer({ source: drawn, updateWhileInteracting: true, updateWhileAnimating: true, zIndex: 9 }));

let projection;
let shown = null;

/** Shows a collection at a position, or at its home view. */
export function open(collection, place) {
  shown = collection;
  const [west, south, east, north] = collection.bounds_m;
  const span = Math.max(east - west, north - south);
  projection = new Projection({ code: `plane:${collection.id}`, units: 'm', metersPerUnit: 1, global: false });
  map.setView(new View({
    projection, center: [(west + east) / 2, (south + north) / 2], resolution: span / 800,
    minResolution: FINEST_PIXEL_M, maxResolution: span / 200, extent: collection.bounds_m, constrainOnlyCenter: true,
    smoothResolutionConstraint: false, smoothExtentConstraint: false, enableRotation: false,
  }));
  drawn.clear();
  lay();
  if (place) moveTo(place);
  else home(false);
}

export function moveTo({ center, resolution }) {
  const view = map.getView();
  view.cancelAnimations();
  view.setResolution(resolution);
  view.setCenter(center);
}

/** Insets of the part of the map that no control covers (px): top, right, bottom, left. */
function free() {
  const panel = document.getElementById('panel').getBoundingClientRect();
  const padding = [24, 24, 24, 24];
  if (panel.width && panel.width < 0.5 * innerWidth) padding[3] += panel.right;
  else if (panel.height) padding[2] += panel.height;
  return padding;
}

export function home(animate = true) {
  map.updateSize();
  map.getView().fit(shown.home_m, { padding: free(), duration: animate && !calm.matches ? 500 : 0 });
}

export function zoomBy(levels) {
  const view = map.getView();
  view.cancelAnimations();
  view.animate({ resolution: view.getConstrainedResolution(view.getResolution() / 2 ** levels), duration: calm.matches ? 0 : 200 });
}

export const windowOf = () => map.getView().calculateExtent(map.getSize());

function lay() {
  if (!shown) return;
  const layer = shown.layers.includes(state.layer) ? state.layer : shown.layers[0];
  base.setSource(new Tiles(shown, layer, projection, map.getView()));
  layClasses();
}

function layClasses() {
  const wanted = Boolean(state.classOpacity > 0 && shown?.layers.includes('class'));
  classes.setVisible(wanted);
  classes.setOpacity(state.classOpacity);
  if (!wanted || classes.getSource()?.view === map.getView()) return;
  classes.setSource(new Tiles(shown, 'class', projection, map.getView()));
}

on(['layer'], lay);
on(['classOpacity'], layClasses);
on(['azimuth', 'elevation', 'exaggeration', 'phenomena'], debounce(() => {
  base.getSource()?.redraw();
  classes.getSource()?.redraw();
}, 200));

map.on('movestart', tidy);
map.on('moveend', tidy);

/** Aborts tiles two levels away from the view or outside it, for example during a long zoom. */
function tidy() {
  const source = base.getSource();
  if (!source || !map.getSize()) return;
  const grid = source.getTileGrid();
  const level = grid.getZForResolution(map.getView().getResolution());
  const extent = windowOf();
  forget((coordinate, path) => path.startsWith(`${address(shown)}/`) && Math.abs(coordinate[0] - level) <= 1
    && intersects(grid.getTileCoordExtent(coordinate), extent));
}
