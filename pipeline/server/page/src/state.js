// State of the page. Modules read `state`, change it through `set`, and listen for `change`.

export const DEFAULTS = { layer: 'relief', classOpacity: 0, azimuth: 315, elevation: 45, exaggeration: 1, phenomena: null, track: null };
export const state = { collection: null, collections: [], ...DEFAULTS };
export const events = new EventTarget();

export function set(changes) {
  const names = Object.keys(changes).filter((name) => state[name] !== changes[name]);
  Object.assign(state, changes);
  if (names.length) events.dispatchEvent(new CustomEvent('change', { detail: names }));
}
export function on(names, run) {
  events.addEventListener('change', ({ detail }) => { if (names.some((name) => detail.includes(name))) run(); });
}

/** Query parameters for the active processes; none if all are active. */
export const phenomena = () => ({ phenomena: state.phenomena?.join(',') });
/** Query parameters for the light and the vertical exaggeration. */
export const light = () => ({ sun_azimuth_deg: state.azimuth, sun_elevation_deg: state.elevation, exaggeration: state.exaggeration === 1 ? null : state.exaggeration });
