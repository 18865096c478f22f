// The scale bar: 1, 2 or 5 times a power of ten metres.

import { map } from './ground.js';
import { length } from './dom.js';

export function scaleBar(element) {
  const bar = element.querySelector('i');
  const text = element.querySelector('span');
  const update = () => {
    const resolution = map.getView()?.getResolution();
    if (!resolution) return;
    const room = 120 * resolution;
    const power = 10 ** Math.floor(Math.log10(room));
    const metres = [5, 2, 1].map((step) => step * power).find((step) => step <= room * (1 + 1e-9));
    bar.style.width = `${metres / resolution}px`;
    text.textContent = length(metres);
  };
  map.on('postrender', update);
}
