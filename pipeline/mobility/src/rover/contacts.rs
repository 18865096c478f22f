//! Rock contacts of a rover: rocks that came under it and stand higher than its clearance above the sand plane around it.

use super::pose::{Chassis, Pose};
use super::sand::{PlaneSums, SandPlane};
use sastrugi_numeric::{Ground, GroundClass, NoGround};

/// Half the side of the square in which the sand plane is fitted, m.
const AROUND_M: f64 = 0.75;

/// Counts of contacts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Contacts {
    /// Rocks above the clearance that came under the rover, between or under its wheels.
    pub anywhere: u32,
    /// Those of them that its centre line passed over.
    pub on_centre_line: u32,
    /// Whether a rock is under it now: anywhere, and on the centre line.
    now: [bool; 2],
}

impl Contacts {
    /// Checks the ground under the rover. A rock counts once, for as long as it stays there.
    ///
    /// # Errors
    /// Unknown ground.
    pub fn look(
        &mut self,
        ground: &impl Ground,
        pose: &Pose,
        chassis: &Chassis,
        clearance_m: f64,
    ) -> Result<(), NoGround> {
        let (a, t) = (chassis.axle_m, chassis.track_m);
        let (axes, mut now) = (pose.axes(), [false; 2]);
        // The sand plane is fitted only if there is a rock.
        let mut sand = None;
        for left in [-t, -0.5 * t, 0.0, 0.5 * t, t] {
            for ahead in [-a, -0.5 * a, 0.0, 0.5 * a, a] {
                let [x, y] = axes.to_ground([ahead, left]);
                let point = ground.at(x, y)?;
                if point.class != GroundClass::Rock {
                    continue;
                }
                let plane = match sand {
                    Some(plane) => plane,
                    None => *sand.insert(sand_plane(ground, pose.position_m)?),
                };
                let offset = [x - pose.position_m[0], y - pose.position_m[1]];
                let met = point.height_m - plane.height_m(offset) > clearance_m;
                now[0] |= met;
                now[1] |= met && left == 0.0;
            }
        }
        self.anywhere += u32::from(now[0] && !self.now[0]);
        self.on_centre_line += u32::from(now[1] && !self.now[1]);
        self.now = now;
        Ok(())
    }
}

/// The plane of the sand around a point, with the origin at that point; a level plane at the lowest height if there is too little
/// sand.
///
/// # Errors
/// Unknown ground.
pub fn sand_plane(ground: &impl Ground, [x, y]: [f64; 2]) -> Result<SandPlane, NoGround> {
    let step_m = ground.cell_m().max(AROUND_M / 10.0);
    let reach = libm::ceil(AROUND_M / step_m) as i32;
    let mut sums = PlaneSums::default();
    let mut lowest = f64::INFINITY;
    // Heights relative to the centre, so that squares lose no digits.
    let level_m = ground.at(x, y)?.height_m;
    for i in -reach..=reach {
        for j in -reach..=reach {
            let offset = [f64::from(i) * step_m, f64::from(j) * step_m];
            let point = ground.at(x + offset[0], y + offset[1])?;
            lowest = lowest.min(point.height_m);
            if point.class == GroundClass::Sand {
                sums.add(offset, point.height_m - level_m);
            }
        }
    }
    let around = sums.plane().map(|plane| SandPlane { level_m: level_m + plane.level_m, ..plane });
    Ok(around.unwrap_or(SandPlane { level_m: lowest, slopes: [0.0; 2] }))
}
