//! Losses and moving obstacles, drawn at random.

use super::obstacles::MovingObstacle;
use super::parameters::{Loss, TeamParameters};
use super::plane::{Vector, add, direction, distance, scale, sub, to_the_right};
use sastrugi_numeric::Streams;

#[cfg(test)]
mod tests;

/// Range of losses and obstacles along the route, as shares of it.
const MIDDLE: [f64; 2] = [0.1, 0.9];
/// Obstacles cross the route within this time of the leader's passage, s.
const NEAR_S: f64 = 10.0;
/// Distance from the route at which obstacles start and end, m.
const ASIDE_M: f64 = 15.0;
/// Range of an obstacle's speed, relative to that of the members.
const SPEEDS: [f64; 2] = [0.25, 1.0];

/// Adds the losses and obstacles that `drawn_losses` and `drawn_obstacles` request, along a route of at least two points, m. The n-th of each kind
/// draws from its own stream, so requesting more does not change earlier ones.
pub fn draw(parameters: &TeamParameters, route_m: &[Vector], members: u32, streams: &Streams) -> TeamParameters {
    let mut drawn = TeamParameters { drawn_losses: 0, drawn_obstacles: 0, ..parameters.clone() };
    let legs = || route_m.windows(2).map(|pair| distance(pair[0], pair[1]));
    let length_m: f64 = legs().sum();
    let mut left: Vec<u32> =
        (1..=members).filter(|m| !parameters.losses.iter().any(|loss| loss.member == *m)).collect();
    for k in 1..=parameters.drawn_losses {
        if left.len() > 1 {
            let mut stream = streams.stream(&format!("loss-{k:04}"));
            let time_s = stream.uniform_in(MIDDLE[0], MIDDLE[1]) * length_m / parameters.speed_m_s;
            let member = left.remove(stream.below(left.len() as u64) as usize);
            drawn.losses.push(Loss { time_s, member });
        }
    }
    for k in 1..=parameters.drawn_obstacles {
        let mut stream = streams.stream(&format!("obstacle-{k:04}"));
        let along_m = stream.uniform_in(MIDDLE[0], MIDDLE[1]) * length_m;
        let side_m = if stream.below(2) == 0 { ASIDE_M } else { -ASIDE_M };
        let speed_m_s = stream.uniform_in(SPEEDS[0], SPEEDS[1]) * parameters.speed_m_s;
        let meets_s = along_m / parameters.speed_m_s + stream.uniform_in(-NEAR_S, NEAR_S);
        let Some((point_m, forward)) = point_along(route_m, along_m) else { continue };
        let across = scale(to_the_right(forward), side_m);
        drawn.obstacles.push(MovingObstacle {
            points_m: vec![sub(point_m, across), add(point_m, across)],
            speed_m_s,
            radius_m: parameters.radius_m,
            start_s: (meets_s - ASIDE_M / speed_m_s).max(0.0),
        });
    }
    drawn
}

/// The point of a route at a distance from its start, and the direction there.
fn point_along(route_m: &[Vector], along_m: f64) -> Option<(Vector, Vector)> {
    let mut left_m = along_m;
    let mut last = None;
    for pair in route_m.windows(2) {
        let Some(forward) = direction(sub(pair[1], pair[0])) else { continue };
        let leg_m = distance(pair[0], pair[1]);
        last = Some((add(pair[0], scale(forward, left_m.min(leg_m))), forward));
        if left_m <= leg_m {
            break;
        }
        left_m -= leg_m;
    }
    last
}
