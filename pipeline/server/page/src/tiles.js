// Tiles of one layer of one collection: fetched, retried while the server is busy, aborted when the view has moved on.

import TileImage from 'ol/source/TileImage.js';
import TileGrid from 'ol/tilegrid/TileGrid.js';
import TileState from 'ol/TileState.js';
import { get, query, base } from './api.js';
import { failed } from './tell.js';
import { light, phenomena } from './state.js';

/** Tile pixels per page pixel: dense screens get the next finer level at half its size. */
const DENSITY = devicePixelRatio > 1.2 ? 2 : 1;
const loading = new Map();
const BUSY = [429, 503];

export class Tiles extends TileImage {
  constructor(collection, layer, projection, view) {
    const grid = collection.tile_grid;
    super({
      projection,
      tileGrid: new TileGrid({ origin: grid.origin_m, resolutions: grid.resolutions_m.map((step) => step * DENSITY), tileSize: grid.tile_size / DENSITY, sizes: grid.matrix_sizes }),
      tilePixelRatio: DENSITY,
      tileLoadFunction: load,
      transition: matchMedia('(prefers-reduced-motion: reduce)').matches ? 0 : 180,
      wrapX: false,
    });
    this.view = view;
    this.finest = grid.resolutions_m.at(-1);
    this.path = `${base(collection)}/styles/${layer}/map/tiles/${encodeURIComponent(grid.id)}`;
    this.lit = layer === 'relief' || layer === 'hillshade';
    this.redraw();
  }

  /** Beyond the finest level, samples are drawn as squares, without smoothing. */
  getInterpolate() {
    return !this.view || this.view.getResolution() > 0.75 * this.finest * devicePixelRatio;
  }

  redraw() {
    const text = query({ ...phenomena(), ...(this.lit ? light() : {}) });
    if (text === this.text) return;
    this.text = text;
    this.setTileUrlFunction(([level, column, row]) => `${this.path}/${level}/${row}/${column}${text}`, this.path + text);
  }
}

async function load(tile, path) {
  const stop = new AbortController();
  loading.set(tile, { stop, path });
  const image = tile.getImage();
  try {
    const response = await patiently(path, stop.signal);
    if (response.status === 204) return tile.setState(TileState.EMPTY);
    const url = URL.createObjectURL(await response.blob());
    image.addEventListener('load', () => URL.revokeObjectURL(url), { once: true });
    image.src = url;
  } catch (error) {
    tile.setState(TileState.ERROR);
    if (error.name === 'AbortError') tile.state = TileState.IDLE;
    else if (error.status === 404) tile.setState(TileState.EMPTY);
    else failed(error);
  } finally {
    loading.delete(tile);
  }
}

async function patiently(path, signal, attempt = 1) {
  try {
    return await get(path, signal);
  } catch (error) {
    if (!BUSY.includes(error.status) || attempt === 8) throw error;
    await new Promise((resolve) => setTimeout(resolve, 1000 * error.retry * Math.min(attempt, 4)));
    signal.throwIfAborted();
    return patiently(path, signal, attempt + 1);
  }
}

/** Aborts requests that the view no longer needs, so that the server can stop too. */
export function forget(wanted) {
  for (const [tile, { stop, path }] of loading) if (!wanted(tile.getTileCoord(), path)) stop.abort();
}
