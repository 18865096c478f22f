// Display settings of the ground, and the processes that shape it.

import { state, set, on } from './state.js';
import { h, slider } from './dom.js';
import { layerName, processName } from './names.js';

const BASES = ['relief', 'hillshade', 'albedo'];

export function looksPanel() {
  const element = h('div', {});
  const degrees = (value) => `${value}°`;
  const azimuth = slider('Sun azimuth', { min: 0, max: 355, step: 5, value: state.azimuth, show: degrees, onchange: (value) => set({ azimuth: value }) });
  const elevation = slider('Sun elevation', { min: 2, max: 90, step: 1, value: state.elevation, show: degrees, onchange: (value) => set({ elevation: value }) });
  const shine = () => { azimuth.set(state.azimuth); elevation.set(state.elevation); };
  function renew() {
    shine();
    const { layers, phenomena, credit, license } = state.collection;
    const bases = BASES.filter((name) => layers.includes(name));
    const radio = (name) => {
      const input = h('input', { type: 'radio', name: 'base', value: name, onchange: () => set({ layer: name }) });
      input.checked = state.layer === name;
      return h('label', {}, input, h('span', {}, layerName(name)));
    };
    const acts = (number) => state.phenomena === null || state.phenomena.includes(number);
    const check = ({ number, kind, summary }) => {
      const input = h('input', { type: 'checkbox', onchange: () => {
        const all = phenomena.map((one) => one.number);
        const acting = all.filter((one) => (one === number ? input.checked : acts(one)));
        set({ phenomena: acting.length === all.length ? null : acting });
      } });
      input.checked = acts(number);
      return h('label', { class: 'check' }, input, h('span', {}, h('b', {}, processName(kind)), h('small', {}, summary)));
    };
    element.replaceChildren(
      h('fieldset', { class: 'segments' }, h('legend', {}, 'Base map'), bases.map(radio)),
      layers.includes('class') ? slider('Rock cover overlay', { min: 0, max: 1, step: 0.05, value: state.classOpacity, show: (value) => (value ? `${Math.round(value * 100)} %` : 'off'), onchange: (classOpacity) => set({ classOpacity }) }) : '',
      azimuth, elevation,
      slider('Vertical exaggeration', { min: 1, max: 10, step: 0.5, value: state.exaggeration, show: (value) => `${value} ×`, onchange: (exaggeration) => set({ exaggeration }) }),
      phenomena.length ? h('fieldset', {}, h('legend', {}, 'Processes'), phenomena.map(check)) : '',
      h('p', { class: 'hint' }, [credit, license].filter(Boolean).join(', ')));
  }
  on(['collection'], renew);
  on(['azimuth', 'elevation'], shine);
  return { title: 'Layers', element, renew, open: renew, close() {} };
}
