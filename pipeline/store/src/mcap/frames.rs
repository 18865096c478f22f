//! Common to recordings of both flavours: frames, colours, and where the ground is drawn at full resolution.

use super::MissionMcap;
use super::mesh::Square;
use sastrugi_schemas::RoughnessClass;
use sastrugi_schemas::topics::Recording;

/// Frame of the terrain's own coordinates.
pub(super) const MAP: &str = "map";
/// Frame of the vehicle's body.
pub(super) const BASE: &str = "base_link";
/// Quaternion of no rotation.
pub(super) const IDENTITY: [f64; 4] = [0.0, 0.0, 0.0, 1.0];
/// Colour of a start.
pub(super) const START: [u8; 3] = [0x2c, 0xa0, 0x5a];
/// Colour of a goal.
pub(super) const GOAL: [u8; 3] = [0xc8, 0x32, 0x32];
/// Class code of sand, for ground classified by material instead of roughness; outside the codes of [`RoughnessClass`].
pub const SAND: u8 = 100;
/// Class code of rock.
pub const ROCK: u8 = 101;
/// Colour of sand.
const SAND_RGB: [u8; 3] = [0xc8, 0x9b, 0x6c];
/// Colour of rock.
const ROCK_RGB: [u8; 3] = [0x5e, 0x4b, 0x45];
/// Colour of ground without a class.
const GREY: [u8; 3] = [0x9a, 0x9a, 0x94];

/// Quaternion of a wheel in base_link: steering turns its axle about z, forward rolling turns z towards x about the axle.
pub(super) fn wheel_rotation(steering_rad: f64, angle_rad: f64) -> [f64; 4] {
    let ((sin, cos), (steer_sin, steer_cos)) = (libm::sincos(0.5 * angle_rad), libm::sincos(0.5 * steering_rad));
    [-steer_sin * sin, steer_cos * sin, steer_sin * cos, steer_cos * cos]
}

/// Where the terrain is drawn at full resolution: under the wheels at every sample, with a margin of one cell.
pub(super) fn corridor(mission: &MissionMcap) -> Vec<Square> {
    let Recording { vehicle, states, wheels, .. } = mission.recording;
    let [dx, dy] = mission.terrain.dem.geometry.cell;
    let cell = dx.max(dy);
    let mut near = vec![];
    for state in states {
        let [x, y, _] = state.position_m;
        for wheel in &vehicle.wheels {
            let half_side = (0.5 * wheel.radius_m).max(0.5 * wheel.width_m) + cell;
            for ahead in [-wheel.radius_m, 0.0, wheel.radius_m] {
                let [hub_x, hub_y, hub_z] = wheel.hub_m;
                let [dx, dy, _] = rotated(state.orientation, [hub_x + ahead, hub_y, hub_z]);
                near.push(Square { centre: [x + dx, y + dy], half_side });
            }
        }
    }
    let touching = wheels.iter().flat_map(|sample| &sample.wheels).filter(|wheel| wheel.normal_force_n != 0.0);
    near.extend(touching.map(|w| Square { centre: [w.contact_m[0], w.contact_m[1]], half_side: cell }));
    near
}

/// `v` rotated by a unit quaternion `[x, y, z, w]`: v + 2 w (q x v) + 2 q x (q x v).
pub(super) fn rotated([qx, qy, qz, qw]: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    let cross =
        |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let q = [qx, qy, qz];
    let t = cross(q, v).map(|c| 2.0 * c);
    let u = cross(q, t);
    [v[0] + qw * t[0] + u[0], v[1] + qw * t[1] + u[1], v[2] + qw * t[2] + u[2]]
}

/// Colour of a roughness class, of sand and of rock.
pub(super) fn class_rgb(code: u8) -> [u8; 3] {
    match code {
        SAND => SAND_RGB,
        ROCK => ROCK_RGB,
        _ => RoughnessClass::from_code(code).map_or(GREY, RoughnessClass::colour),
    }
}
