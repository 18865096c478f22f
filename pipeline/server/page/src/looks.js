// How the ground is shown and which phenomena shape it.

import { state, set, on } from './state.js';
import { h, slider } from './dom.js';

const BASES = ['relief', 'hillshade', 'albedo'];

export function looksPanel() {
  const element = h('div', {});
  const degrees = (value) => `${value}°`;
  function renew() {
    const { layers, phenomena } = state.collection;
    const bases = BASES.filter((name) => layers.includes(name));
    const radio = (name) => {
      const input = h('input', { type: 'radio', name: 'base', value: name, onchange: () => set({ layer: name }) });
      input.checked = state.layer === name;
      return h('label', {}, input, h('span', {}, name));
    };
    const acts = (number) => state.phenomena === null || state.phenomena.includes(number);
    const check = ({ number, kind, summary }) => {
      const input = h('input', { type: 'checkbox', onchange: () => {
        const all = phenomena.map((one) => one.number);
        const acting = all.filter((one) => (one === number ? input.checked : acts(one)));
        if (!acting.length) { input.checked = true; return; }
        set({ phenomena: acting.length === all.length ? null : acting });
      } });
      input.checked = acts(number);
      return h('label', { class: 'check' }, input, h('span', {}, h('b', {}, kind), h('small', {}, summary)));
    };
    element.replaceChildren(
      h('fieldset', { class: 'segments' }, h('legend', {}, 'Base'), bases.map(radio)),
      layers.includes('class') ? slider('Rock overlay', { min: 0, max: 1, step: 0.05, value: state.classOpacity, show: (value) => (value ? `${Math.round(value * 100)} %` : 'off'), onchange: (classOpacity) => set({ classOpacity }) }) : '',
      slider('Sun azimuth', { min: 0, max: 355, step: 5, value: state.azimuth, show: degrees, onchange: (azimuth) => set({ azimuth }) }),
      slider('Sun elevation', { min: 2, max: 90, step: 1, value: state.elevation, show: degrees, onchange: (elevation) => set({ elevation }) }),
      slider('Exaggeration', { min: 1, max: 10, step: 0.5, value: state.exaggeration, show: (value) => `${value} ×`, onchange: (exaggeration) => set({ exaggeration }) }),
      phenomena.length ? h('fieldset', {}, h('legend', {}, 'Phenomena'), phenomena.map(check)) : '');
  }
  on(['collection'], renew);
  return { title: 'Ground', element, renew, open: renew, close() {} };
}
