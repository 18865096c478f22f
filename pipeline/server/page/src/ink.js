// Styles of lines, boxes, tracks and markers on the map.

import Style from 'ol/style/Style.js';
import Stroke from 'ol/style/Stroke.js';
import Fill from 'ol/style/Fill.js';
import Circle from 'ol/style/Circle.js';
import RegularShape from 'ol/style/RegularShape.js';
import Feature from 'ol/Feature.js';
import Point from 'ol/geom/Point.js';
import { drawn } from './ground.js';

export const line = (color, width = 2) => [
  new Style({ stroke: new Stroke({ color: 'rgba(255,255,255,.75)', width: width + 2.5 }), fill: new Fill({ color: 'rgba(255,255,255,.08)' }) }),
  new Style({ stroke: new Stroke({ color, width }), image: new Circle({ radius: 4, fill: new Fill({ color }), stroke: new Stroke({ color: '#fff', width: 1.5 }) }) }),
];
export const BLUE = '#1c5f8a';
export const RUST = '#a8452c';

/** A marker that is moved, not redrawn. With a heading (degrees counterclockwise from east, as in the tables) it is an arrow. */
export function marker(color) {
  const feature = new Feature(new Point([0, 0]));
  feature.setStyle([]);
  const dot = new Style({ zIndex: 5, image: new Circle({ radius: 5, fill: new Fill({ color }), stroke: new Stroke({ color: '#fff', width: 2 }) }) });
  const arrow = (degrees) => new Style({ zIndex: 5, image: new RegularShape({ points: 3, radius: 10, scale: [0.75, 1.15], rotation: (90 - degrees) * Math.PI / 180,
    rotateWithView: true, fill: new Fill({ color }), stroke: new Stroke({ color: '#fff', width: 1.5 }) }) });
  return {
    at(place, heading = null) {
      if (!drawn.hasFeature(feature)) drawn.addFeature(feature);
      feature.getGeometry().setCoordinates(place);
      feature.setStyle(heading === null ? dot : arrow(heading));
    },
    hide() { feature.setStyle([]); },
    remove() { if (drawn.hasFeature(feature)) drawn.removeFeature(feature); },
  };
}
