// Entry point: assembles the page and opens what the URL specifies.

import './page.css';
import { map, open, home, moveTo, zoomBy } from './ground.js';
import { state, set, on } from './state.js';
import { json } from './api.js';
import { tell, failed } from './tell.js';
import { icon, h } from './dom.js';
import { scaleBar } from './scale.js';
import { readout } from './readout.js';
import { keep, read } from './link.js';
import { pixelsAreTrue } from './pixels.js';
import { worldsPanel } from './worlds.js';
import { looksPanel } from './looks.js';
import { linePanel } from './line.js';
import { boxPanel } from './box.js';
import { tracksPanel } from './tracks.js';
import { open3d, close3d } from './window3d.js';

const $ = (id) => document.getElementById(id);
const panels = { worlds: worldsPanel((one) => go({ id: one.id, place: null, looks: { phenomena: null, track: null } })), ground: looksPanel(), line: linePanel(), tracks: tracksPanel(), box: boxPanel() };
const NAMES = { worlds: 'Collections', ground: 'Layers, sun and processes', line: 'Profile and distance', tracks: 'Tracks', box: 'Download', relief: '3-D view' };
let opened = null;

function toggle(name) {
  if (opened) panels[opened].close();
  opened = name === opened ? null : name;
  $('panel').hidden = !opened;
  document.body.classList.toggle('open', Boolean(opened));
  for (const button of $('tools').children) button.setAttribute('aria-expanded', String(button.dataset.panel === opened));
  if (!opened) return;
  $('panel-title').textContent = panels[opened].title;
  $('panel-body').replaceChildren(panels[opened].element);
  panels[opened].open();
}

function furnish() {
  for (const name of Object.keys(NAMES)) {
    $('tools').append(h('button', { type: 'button', 'data-panel': name, title: NAMES[name], 'aria-label': NAMES[name], 'aria-expanded': 'false',
      onclick: () => (name === 'relief' ? open3d($('space')) : toggle(name)) }, icon(name)));
  }
  $('panel-close').append(icon('close'));
  $('panel-close').addEventListener('click', () => { const name = opened; toggle(name); $('tools').querySelector(`[data-panel=${name}]`).focus(); });
  for (const [name, label, run] of [['plus', 'Zoom in', () => zoomBy(1)], ['minus', 'Zoom out', () => zoomBy(-1)], ['home', 'Home view', () => home()]]) $('zoom').append(h('button', { type: 'button', title: label, 'aria-label': label, onclick: run }, icon(name)));
  $('message').querySelector('button').append(icon('close'));
  $('message').querySelector('button').addEventListener('click', () => { $('message').hidden = true; });
  $('space').addEventListener('leave', () => { close3d($('space')); });
  addEventListener('keydown', (event) => {
    if (event.target.closest?.('dialog')) return;
    if (event.key === 'Escape' && !$('space').hidden) close3d($('space'));
    else if (event.key === 'Escape' && opened) $('panel-close').click();
    else if (event.target.closest?.('#map, input, select, pre') || !$('space').hidden || event.ctrlKey || event.metaKey) return;
    else if (['+', '='].includes(event.key)) zoomBy(1);
    else if (event.key === '-') zoomBy(-1);
  });
  map.setTarget($('map'));
  scaleBar($('scale'));
  on(['collection'], () => {
    const { title, release, credit, license, tracks } = state.collection;
    document.title = `${title} - Sastrugi`;
    $('title').textContent = title;
    $('title').title = release ? `${title}, release ${release}` : title;
    $('credit').textContent = [credit, license].filter(Boolean).join(', ');
    $('tools').querySelector('[data-panel=tracks]').hidden = tracks === 0;
    if (tracks === 0 && opened === 'tracks') toggle('tracks');
  });
}

/** A thin progress bar while tiles are loading. */
function progress() {
  let asked = 0, came = 0;
  const bar = $('progress');
  const update = () => {
    if (came >= asked) { asked = came = 0; bar.style.width = '0'; bar.classList.remove('on'); return; }
    bar.classList.add('on');
    bar.style.width = `${10 + 90 * came / asked}%`;
  };
  const watch = (source) => {
    source.on('tileloadstart', () => { asked++; update(); });
    source.on(['tileloadend', 'tileloaderror'], () => { came++; update(); });
  };
  map.getLayers().forEach((layer) => { layer.on('change:source', () => { if (layer.getSource()?.redraw) watch(layer.getSource()); }); });
}

async function go({ id, place, looks }) {
  const known = state.collections.find((one) => one.id === id);
  if (id && !known) tell(`Collection "${id}" not found; showing another one instead.`);
  const collection = known ?? state.collections.find(({ kind }) => kind === 'world') ?? state.collections[0];
  if (!collection) return tell('This server has no collections.', true);
  const same = collection === state.collection;
  if (!$('space').hidden) close3d($('space'));
  const { track, ...ground } = looks;
  set(ground);
  if (!same) open(collection, place);
  else if (place) moveTo(place);
  else home(false);
  set({ collection, track });
  if (same && opened === 'ground') panels.ground.renew();
}

async function start() {
  furnish();
  progress();
  const { collections } = await json('/v1/collections');
  set({ collections });
  await go(read());
  readout($('readout'));
  keep(go)();
  if (innerWidth >= 700) toggle('ground');
  if (!read().place) home(false);
  if (!(await pixelsAreTrue())) tell('This browser alters image pixels (fingerprinting protection), so colours may be wrong; allow this page to read canvas data.', true);
}
const ready = start().catch((error) => { failed(error); throw error; });
ready.catch(() => {});
window.sastrugi = { map, state, ready, panels };
