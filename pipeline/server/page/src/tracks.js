// Missions and rovers on their terrain: a list, their lines, and playback of one.

import Feature from 'ol/Feature.js';
import LineString from 'ol/geom/LineString.js';
import { map, drawn } from './ground.js';
import { json, base } from './api.js';
import { failed } from './tell.js';
import { state, set, on } from './state.js';
import { chart } from './chart.js';
import { h, slider, length, plain } from './dom.js';
import { outcomeName, vehicleName } from './names.js';
import { line as ink, marker, BLUE, RUST } from './ink.js';

/** Number of lines drawn at once; the others in a longer list are drawn when selected. */
const DRAWN_MAX = 24;
const known = new Map();

async function trackOf(id, signal) {
  const path = `${base(state.collection)}/tracks/${encodeURIComponent(id)}`;
  if (!known.has(path)) known.set(path, await json(path, signal));
  return known.get(path);
}
export const tracksShown = new Map();

const told = ({ id, label, outcome, length_m: way, duration_s: time }) =>
  [vehicleName(label.replace(id, '').trim()), outcomeName(outcome), Number.isFinite(way) && length(way), Number.isFinite(time) && `${plain(time)} s`].filter(Boolean).join(', ');

export function tracksPanel() {
  const list = h('ul', { class: 'list' });
  const player = h('div', { class: 'player' });
  const mark = marker(RUST);
  let lines = [], listed = null, filled = null, playback = null, leave = new AbortController();

  async function renew() {
    if (listed === state.collection) return;
    const asked = listed = state.collection;
    leave.abort();
    const { signal } = leave = new AbortController();
    stop();
    lines = [];
    tracksShown.clear();
    list.replaceChildren();
    player.replaceChildren();
    if (asked.tracks === 0) { list.append(h('li', { class: 'hint' }, 'There are no tracks here. A release lists the missions and rovers of each terrain.')); return; }
    try {
      const { tracks } = await json(`${base(asked)}/tracks`, signal);
      for (const track of tracks) list.append(h('li', {}, h('button', { type: 'button', class: 'item', 'data-track': track.id, onclick: () => set({ track: track.id }) },
        h('b', {}, track.id), h('span', {}, told(track)))));
      filled = asked;
      if (state.track) play(state.track);
      // One after the other, so that tiles find a free connection.
      for (const { id } of tracks.slice(0, DRAWN_MAX)) await draw(id, signal);
    } catch (error) { failed(error); }
  }
  function stop() {
    playback?.pause();
    playback = null;
    mark.hide();
  }
  const look = (feature) => feature.setStyle(feature.get('track') === state.track ? ink(RUST, 2.4) : ink(BLUE, state.track ? 1.4 : 1.6));
  async function draw(id, signal) {
    const path = await trackOf(id, signal);
    signal.throwIfAborted();
    if (tracksShown.has(id)) return path;
    tracksShown.set(id, path);
    const feature = new Feature(new LineString(path.x_m.map((x, at) => [x, path.y_m[at]])));
    feature.set('track', id);
    look(feature);
    lines.push(feature);
    drawn.addFeature(feature);
    return path;
  }
  async function play(id) {
    stop();
    try {
      const path = await draw(id, leave.signal);
      lines.forEach(look);
      for (const button of list.querySelectorAll('button')) button.setAttribute('aria-pressed', String(button.dataset.track === id));
      controls(path);
    } catch (error) { failed(error); }
  }
  function controls(path) {
    const { time_s: time, x_m: x, y_m: y, z_m: z, heading_deg: heading, events = [] } = path;
    const first = time[0], last = time.at(-1);
    let now = first, speed = 10, playing = false, before = 0, frame = 0;
    const index = (t) => { let low = 0, high = time.length - 1; while (high - low > 1) { const mid = (low + high) >> 1; if (time[mid] <= t) low = mid; else high = mid; } return low; };
    const show = (t) => {
      now = t;
      const at = index(t);
      const share = time.length > 1 ? Math.min(1, Math.max(0, (t - time[at]) / (time[at + 1] - time[at] || 1))) : 0;
      const between = (list) => list[at] + share * ((list[at + 1] ?? list[at]) - list[at]);
      mark.at([between(x), between(y)], heading[at]);
      figure.show?.(at);
      clock.set(t);
    };
    const clock = slider('Time', { min: first, max: last, step: (last - first) / 1000 || 1, value: first, show: (t) => `${t.toFixed(1)} s`, onchange: show });
    const rate = h('select', { 'aria-label': 'Speed', onchange: () => { speed = Number(rate.value); } }, [1, 10, 60, 300].map((k) => h('option', { value: String(k), selected: k === speed }, `${k} ×`)));
    const button = h('button', { type: 'button', class: 'main', onclick: () => { if (playing) return pause(); if (now >= last) now = first; before = performance.now(); playing = true; button.textContent = 'Pause'; frame = requestAnimationFrame(step); } }, 'Play');
    const pause = () => { playing = false; cancelAnimationFrame(frame); button.textContent = 'Play'; };
    const step = (stamp) => {
      if (!playing) return;
      show(Math.min(last, now + (Math.max(0, stamp - before) / 1000) * speed));
      before = stamp;
      if (now >= last) pause(); else frame = requestAnimationFrame(step);
    };
    const figure = chart({ along: time, heights: z, label: 'time (s)', hover: (at) => { if (at !== null) show(time[at]); } });
    player.replaceChildren(figure, clock, h('div', { class: 'row' }, button, rate),
      h('ul', { class: 'list' }, events.map((event) => h('li', {}, h('button', { type: 'button', class: 'item', onclick: () => show(event.time_s) }, h('b', {}, `${plain(event.time_s, 4)} s`), h('span', {}, event.what))))));
    playback = { pause, show: () => show(now) };
    show(first);
    player.scrollIntoView({ block: 'nearest' });
  }
  on(['collection'], renew);
  on(['track'], () => { if (state.track && filled === state.collection) play(state.track); });
  const element = h('div', {}, player, list);
  return {
    title: 'Tracks', element, renew, open() { renew(); playback?.show(); }, close() { playback?.pause(); mark.remove(); },
  };
}
