// The list of collections: worlds, and the terrains of releases.

import { state, on } from './state.js';
import { h, length } from './dom.js';

export function worldsPanel(choose) {
  const list = h('div', {});
  const search = h('input', { type: 'search', placeholder: 'Search', 'aria-label': 'Search collections', oninput: fill });
  function fill() {
    const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
    const found = state.collections.filter((one) => words.every((word) => `${one.title} ${one.id} ${one.release ?? ''} ${one.kind}`.toLowerCase().includes(word)));
    const groups = new Map();
    for (const one of found) {
      const name = one.kind === 'world' ? 'Worlds' : one.release ? `Release ${one.release}` : 'Terrains';
      groups.set(name, [...(groups.get(name) ?? []), one]);
    }
    list.replaceChildren(...[...groups].sort(([a], [b]) => (b === 'Worlds') - (a === 'Worlds')).flatMap(([name, ones]) => [h('h3', {}, name), h('ul', { class: 'list' }, ones.map(item))]));
    if (!found.length) list.append(h('p', { class: 'hint' }, 'No matching collections.'));
  }
  function item(one) {
    const [west, south, east, north] = one.bounds_m;
    const note = `${length(east - west)} × ${length(north - south)}, to ${length(one.spacing_m)}${one.tracks ? `, ${one.tracks} tracks` : ''}`;
    return h('li', {}, h('button', { type: 'button', class: 'item', 'aria-pressed': String(one === state.collection), onclick: () => choose(one) }, h('b', {}, one.title), h('span', {}, note)));
  }
  on(['collection', 'collections'], fill);
  return { title: 'Collections', element: h('div', {}, search, list), open: fill, close() {} };
}
