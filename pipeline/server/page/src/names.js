// Display names of the server's identifiers. An unknown identifier, for example from a newer server, is shown with spaces for underscores.

const LAYERS = { relief: 'Shaded relief', hillshade: 'Hillshade', albedo: 'Albedo' };
const FIELDS = { elevation: 'Elevation (m)', albedo: 'Albedo', class: 'Rock cover (0 to 1)', rock_potential: 'Potential rock cover (0 to 1)', image: 'Nadir image (I/F)' };
const FORMATS = { tif: 'GeoTIFF (COG)', npy: 'NumPy array', raw: 'Raw float32', png: '16-bit PNG' };
const PROCESSES = { base_slope: 'Base slope', texture: 'Texture', primary_craters: 'Primary craters', secondary_craters: 'Secondary craters', rocks: 'Rocks', albedo: 'Albedo', dust: 'Dust' };
const VEHICLES = { husky_a200: 'Husky A200', ugv_4x4: '4 × 4 UGV', rocker_bogie_rover: 'Rocker-bogie rover', sojourner_like: 'Sojourner-like rover' };
const OUTCOMES = {
  success: 'success', tipped: 'tipped', stuck: 'stuck', out_of_bounds: 'out of bounds', timeout: 'timeout',
  reached: 'goal reached', lost: 'lost', no_way: 'no path found', distance_limit: 'distance limit', cycle_limit: 'cycle limit', off_ground: 'left the mapped ground',
};

const plainly = (name) => name.replaceAll('_', ' ');
const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);
const heading = (names) => (name) => names[name] ?? capital(plainly(name));
const phrase = (names) => (name) => names[name] ?? plainly(name);

export const layerName = heading(LAYERS);
export const fieldName = heading(FIELDS);
export const formatName = heading(FORMATS);
export const processName = heading(PROCESSES);
export const vehicleName = heading(VEHICLES);
export const outcomeName = phrase(OUTCOMES);
