// The 3-D view: heights of the window relative to their mean, lit by the map's sun, with shadows cast by the ground.

import { WebGLRenderer, Scene, PerspectiveCamera, BufferGeometry, BufferAttribute, Mesh, MeshBasicMaterial, Line, LineBasicMaterial, Color, DoubleSide, ArrowHelper, Vector3 } from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';

const TINTS = [[92, 83, 77], [171, 154, 135], [226, 218, 206]], GREY = [190, 190, 190];
/** Albedo at which the ground has exactly its tint, as on the map. */
const PLAIN_ALBEDO = 0.25;

function el(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}
const say = (metres) => (metres >= 1000 ? `${+(metres / 1000).toPrecision(3)} km` : metres >= 1 ? `${+metres.toPrecision(3)} m` : metres >= 0.01 ? `${+(metres * 100).toPrecision(3)} cm` : `${+(metres * 1000).toPrecision(3)} mm`);

/** Heights relative to their mean, in units of half the window, so that single precision resolves millimetres on a high plateau. */
function surface({ heights, columns, rows, cell }) {
  let sum = 0, count = 0, low = Infinity, high = -Infinity;
  for (const z of heights) if (Number.isFinite(z)) { sum += z; count++; low = Math.min(low, z); high = Math.max(high, z); }
  if (!count) throw new Error('No data in this view.');
  const mean = sum / count;
  const unit = 2 / (Math.max(columns, rows) * cell);
  const relative = Float32Array.from(heights, (z) => (z - mean) * unit);
  return { relative, mean, unit, low, high, step: cell * unit };
}

function geometry({ relative, step }, columns, rows) {
  const place = new Float32Array(columns * rows * 3);
  for (let r = 0, at = 0; r < rows; r++) for (let c = 0; c < columns; c++, at++) {
    place[3 * at] = (c - (columns - 1) / 2) * step;
    place[3 * at + 1] = Number.isFinite(relative[at]) ? relative[at] : 0;
    place[3 * at + 2] = (r - (rows - 1) / 2) * step;
  }
  const index = [];
  for (let r = 0; r + 1 < rows; r++) for (let c = 0; c + 1 < columns; c++) {
    const a = r * columns + c, b = a + 1, d = a + columns, e = d + 1;
    if ([a, b, d].every((k) => Number.isFinite(relative[k]))) index.push(a, d, b);
    if ([b, d, e].every((k) => Number.isFinite(relative[k]))) index.push(b, d, e);
  }
  const shape = new BufferGeometry();
  shape.setAttribute('position', new BufferAttribute(place, 3));
  shape.setAttribute('color', new BufferAttribute(new Float32Array(columns * rows * 3), 3));
  shape.setIndex(index);
  return shape;
}

/** Share of the sun visible from each sample, by marching towards it over the grid; the penumbra is about one degree wide. */
function shadows({ relative, step }, columns, rows, sun, stretch) {
  const seen = new Float32Array(relative.length).fill(1);
  const flat = Math.hypot(sun[0], sun[1]);
  if (flat < 1e-3) return seen;
  const dc = sun[0] / flat, dr = -sun[1] / flat, slope = sun[2] / flat;
  let top = -Infinity;
  for (const z of relative) if (z > top) top = z;
  top *= stretch;
  const rise = slope * step;
  for (let r = 0, at = 0; r < rows; r++) for (let c = 0; c < columns; c++, at++) {
    const own = relative[at] * stretch;
    let worst = 1;
    for (let k = 1; own + k * rise < top; k += 1 + (k >> 4)) {
      const x = c + k * dc, y = r + k * dr;
      const c0 = Math.floor(x), r0 = Math.floor(y);
      if (c0 < 0 || r0 < 0 || c0 + 1 >= columns || r0 + 1 >= rows) break;
      const a = x - c0, b = y - r0, i = r0 * columns + c0;
      const z = ((relative[i] * (1 - a) + relative[i + 1] * a) * (1 - b) + (relative[i + columns] * (1 - a) + relative[i + columns + 1] * a) * b) * stretch;
      const gap = (own + k * rise - z) / (k * step * 0.03) + 0.5;
      if (gap < worst) { worst = gap; if (worst <= 0) { worst = 0; break; } }
    }
    seen[at] = worst;
  }
  return seen;
}

const linear = (value) => (value / 255) ** 2.2;

/** Colours of the ground in full light, as in the map's base layer, but with tints that span the heights of the window. */
function groundColours({ relative }, { layer, albedo }) {
  const colours = new Float32Array(3 * relative.length);
  const tints = TINTS.map((rgb) => rgb.map(linear)), grey = GREY.map(linear);
  let low = Infinity, high = -Infinity;
  for (const z of relative) { if (z < low) low = z; if (z > high) high = z; }
  relative.forEach((z, at) => {
    const bright = Number.isFinite(albedo?.[at]) ? albedo[at] : PLAIN_ALBEDO;
    const share = high > low && Number.isFinite(z) ? Math.min(1.999, ((z - low) / (high - low)) * 2) : 1;
    const [from, to] = share < 1 ? [tints[0], tints[1]] : [tints[1], tints[2]];
    for (let k = 0; k < 3; k++) {
      const tint = from[k] + (share % 1) * (to[k] - from[k]);
      colours[3 * at + k] = layer === 'hillshade' ? grey[k] : layer === 'albedo' ? linear(Math.min(255, 510 * bright)) : tint * (0.4 + 0.6 * bright / PLAIN_ALBEDO) ** 2.2;
    }
  });
  return colours;
}

function paint(shape, field, colours, columns, rows, sun, stretch, cast) {
  const { relative, step } = field;
  const seen = cast ? shadows(field, columns, rows, sun, stretch) : null;
  const color = shape.attributes.color.array;
  for (let r = 0, at = 0; r < rows; r++) for (let c = 0; c < columns; c++, at++) {
    const z = relative[at];
    const or = (k) => (Number.isFinite(relative[k]) ? relative[k] : z);
    const west = or(c ? at - 1 : at), east = or(c + 1 < columns ? at + 1 : at), north = or(r ? at - columns : at), south = or(r + 1 < rows ? at + columns : at);
    const gx = ((east - west) / ((c && c + 1 < columns ? 2 : 1) * step)) * stretch;
    const gy = ((north - south) / ((r && r + 1 < rows ? 2 : 1) * step)) * stretch;
    const lit = Math.max(0, (-gx * sun[0] - gy * sun[1] + sun[2]) / Math.sqrt(1 + gx * gx + gy * gy)) * (seen ? seen[at] : 1);
    const bright = 0.1 + 0.95 * lit / Math.max(0.55, sun[2]);
    for (let k = 0; k < 3; k++) color[3 * at + k] = colours[3 * at + k] * bright * [1, 1, 1 + 0.12 * (1 - lit)][k];
  }
  shape.attributes.color.needsUpdate = true;
}

const direction = (azimuth, elevation) => {
  const a = azimuth * Math.PI / 180, e = elevation * Math.PI / 180;
  return [Math.sin(a) * Math.cos(e), Math.cos(a) * Math.cos(e), Math.sin(e)];
};

/** Lines of the tracks inside the window, split where they leave it; the window's corner is the position of a sample. */
function paths(tracks, { mean, unit }, { corner, columns, rows, cell }) {
  const half = [(columns - 1) * cell / 2, (rows - 1) * cell / 2];
  const middle = [corner[0] + half[0], corner[1] + half[1]];
  const pieces = [];
  for (const track of tracks) {
    let piece = [];
    for (let at = 0; at < track.x_m.length; at++) {
      const x = track.x_m[at] - middle[0], y = track.y_m[at] - middle[1], z = track.z_m[at];
      if (Math.abs(x) <= half[0] && Math.abs(y) <= half[1] && z !== null) piece.push(x * unit, (z - mean) * unit, -y * unit);
      else { if (piece.length > 3) pieces.push(piece); piece = []; }
    }
    if (piece.length > 3) pieces.push(piece);
  }
  return pieces;
}

export function show(element, scenery) {
  const { columns, rows, cell } = scenery;
  const field = surface(scenery);
  const colours = groundColours(field, scenery);
  const canvas = el('canvas', { tabindex: '0', 'aria-label': '3-D view: arrow keys rotate, plus and minus zoom' });
  let renderer;
  try {
    renderer = new WebGLRenderer({ canvas, antialias: true });
  } catch {
    throw new Error('The 3-D view needs WebGL, which this browser does not offer.');
  }
  renderer.setPixelRatio(Math.min(2, devicePixelRatio));
  const night = matchMedia('(prefers-color-scheme: dark)').matches;
  const scene = new Scene();
  scene.background = new Color(night ? '#15161a' : '#e9e7e3');
  const camera = new PerspectiveCamera(38, 1, 0.005, 40);
  const shape = geometry(field, columns, rows);
  const ground = new Mesh(shape, new MeshBasicMaterial({ vertexColors: true, side: DoubleSide }));
  scene.add(ground);
  const lift = 0.6 * field.step * 0.5 + 0.001;
  for (const piece of paths(scenery.tracks, field, scenery)) {
    const line = new BufferGeometry();
    line.setAttribute('position', new BufferAttribute(Float32Array.from(piece, (v, at) => (at % 3 === 1 ? v + lift : v)), 3));
    ground.add(new Line(line, new LineBasicMaterial({ color: '#d2552f' })));
  }
  const depth = rows / Math.max(columns, rows), width = columns / Math.max(columns, rows);
  const north = new ArrowHelper(new Vector3(0, 0, -1), new Vector3(width + 0.07, 0, 0.11), 0.22, night ? '#e6e3dc' : '#3b3733', 0.08, 0.05);
  scene.add(north);

  const controls = new OrbitControls(camera, canvas);
  controls.maxPolarAngle = Math.PI * 0.495;
  controls.minDistance = 0.05;
  controls.maxDistance = 8;
  controls.enableDamping = !matchMedia('(prefers-reduced-motion: reduce)').matches;
  const home = () => {
    const far = 2.35 * Math.max(1, 1 / camera.aspect * 0.9);
    camera.position.set(0.32 * far * 0.6, 0.62 * far, 0.8 * far * Math.max(0.8, depth));
    controls.target.set(0, 0, 0);
    controls.update();
  };

  let stretch = 1, azimuth = scenery.azimuth, elevation = scenery.elevation, timer, live = true;
  const relight = () => {
    ground.scale.y = stretch;
    const sun = direction(azimuth, elevation);
    paint(shape, field, colours, columns, rows, sun, stretch, false);
    clearTimeout(timer);
    timer = setTimeout(() => { paint(shape, field, colours, columns, rows, sun, stretch, true); draw(); }, 120);
    draw();
  };
  let asked = 0;
  const draw = () => { if (!asked && live) asked = requestAnimationFrame(() => { asked = 0; if (controls.update()) draw(); renderer.render(scene, camera); }); };
  controls.addEventListener('change', draw);

  const slider = (name, min, max, step, value, unit, run) => {
    const out = el('output', {}, `${value}${unit}`);
    const input = el('input', { type: 'range', min, max, step, 'aria-label': name });
    input.value = value;
    input.addEventListener('input', () => { out.textContent = `${input.value}${unit}`; run(Number(input.value)); relight(); });
    input.addEventListener('change', () => scenery.shone(azimuth, elevation));
    return el('label', { class: 'slider' }, el('span', {}, name), out, input);
  };
  const leave = el('button', { type: 'button', class: 'main' }, 'Back to the map');
  leave.addEventListener('click', () => element.dispatchEvent(new Event('leave')));
  const bar = el('div', { class: 'space-bar' },
    el('p', {}, el('b', {}, `${say(columns * cell)} × ${say(rows * cell)}`), ` of ${scenery.title}`, el('br'),
      el('small', {}, `relief ${say(field.high - field.low)}; ${columns} × ${rows} samples, ${say(cell)} apart; the arrow points north`)),
    slider('Vertical exaggeration', 0.5, 8, 0.5, 1, ' ×', (v) => { stretch = v; }),
    slider('Sun azimuth', 0, 355, 5, azimuth, '°', (v) => { azimuth = v; }),
    slider('Sun elevation', 2, 90, 1, elevation, '°', (v) => { elevation = v; }), leave);
  element.replaceChildren(canvas, bar);

  const size = () => {
    const { clientWidth, clientHeight } = element;
    if (!clientWidth || !clientHeight) return;
    renderer.setSize(clientWidth, clientHeight, false);
    camera.aspect = clientWidth / clientHeight;
    camera.updateProjectionMatrix();
    draw();
  };
  const watcher = new ResizeObserver(size);
  watcher.observe(element);
  canvas.addEventListener('keydown', (event) => {
    const turn = { ArrowLeft: [-0.08, 0], ArrowRight: [0.08, 0], ArrowUp: [0, -0.06], ArrowDown: [0, 0.06] }[event.key];
    const scale = { '+': 0.88, '=': 0.88, '-': 1.14 }[event.key];
    if (!turn && !scale) return;
    event.preventDefault();
    const arm = camera.position.clone().sub(controls.target);
    if (scale) arm.multiplyScalar(scale);
    else {
      const radius = arm.length();
      const polar = Math.min(1.55, Math.max(0.02, Math.acos(arm.y / radius) + turn[1]));
      const round = Math.atan2(arm.x, arm.z) + turn[0];
      arm.set(Math.sin(polar) * Math.sin(round), Math.cos(polar), Math.sin(polar) * Math.cos(round)).multiplyScalar(radius);
    }
    camera.position.copy(controls.target).add(arm);
    controls.update();
    draw();
  });
  size();
  home();
  relight();
  canvas.focus({ preventScroll: true });
  return {
    dispose() {
      live = false;
      clearTimeout(timer);
      watcher.disconnect();
      controls.dispose();
      scene.traverse((one) => { one.geometry?.dispose(); one.material?.dispose?.(); });
      renderer.dispose();
      renderer.forceContextLoss();
      element.replaceChildren();
    },
  };
}
