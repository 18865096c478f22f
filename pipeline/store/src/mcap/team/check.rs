//! Validation of a team recording before it is written.

use super::super::McapError;
use super::super::frames::MAP;
use super::super::ros2::TERRAIN;
use super::TeamMcap;
use super::drawing::moving_name;
use sastrugi_schemas::topics::{Member, MemberState, TeamRecording};
use std::collections::BTreeSet;

/// Refuses recordings that cannot be expressed in the messages.
pub(super) fn recording(team: &TeamMcap) -> Result<(), McapError> {
    let recording = team.recording;
    let times = times(recording)?;
    names(recording)?;
    for member in &recording.members {
        let name = &member.name;
        radius(name, member.radius_m)?;
        same_times(name, &times, member.states.iter().map(|state| state.time_s))?;
        member.states.iter().try_for_each(|state| finite(&format!("{name} at {} s", state.time_s), &numbers(state)))?;
    }
    for (disc, index) in recording.moving.iter().zip(0..) {
        let name = moving_name(index);
        radius(&name, disc.radius_m)?;
        same_times(&name, &times, disc.states.iter().map(|state| state.time_s))?;
        disc.states.iter().try_for_each(|s| finite(&format!("{name} at {} s", s.time_s), &s.position_m))?;
    }
    finite("the sampling rate", &[recording.sample_rate_hz])?;
    finite("the start or goal", &[team.start_m, team.goal_m].concat())?;
    lines(recording)?;
    events(recording)
}

/// Times of all states, taken from the first member.
fn times(recording: &TeamRecording) -> Result<Vec<f64>, McapError> {
    let first = recording.members.first().ok_or_else(|| McapError::unfit("the team has no members"))?;
    if first.states.is_empty() {
        return Err(McapError::unfit(format!("{} has no states", first.name)));
    }
    let times: Vec<f64> = first.states.iter().map(|state| state.time_s).collect();
    finite(&format!("a time of {}", first.name), &times)?;
    Ok(times)
}

/// Names are used as frames and in topic names; ROS 2 allows letters, digits and underscores, starting with a letter.
fn names(recording: &TeamRecording) -> Result<(), McapError> {
    let mut frames = BTreeSet::from([MAP.to_owned(), TERRAIN.to_owned()]);
    frames.extend((0..recording.moving.len()).map(moving_name));
    let mut numbers = BTreeSet::new();
    for Member { number, name, .. } in &recording.members {
        let fit = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
        if !fit || !name.starts_with(|c: char| c.is_ascii_alphabetic()) {
            return Err(McapError::unfit(format!(
                "member name \"{name}\" must start with a letter and contain only letters, digits and underscores"
            )));
        }
        if !frames.insert(name.clone()) {
            return Err(McapError::unfit(format!("member name \"{name}\" is already used by another frame")));
        }
        if *number < 1 || !numbers.insert(*number) {
            return Err(McapError::unfit(format!("the number of {name} must be at least 1 and unique, got {number}")));
        }
    }
    Ok(())
}

fn radius(name: &str, radius_m: f64) -> Result<(), McapError> {
    if radius_m > 0.0 && radius_m.is_finite() {
        return Ok(());
    }
    Err(McapError::unfit(format!("the radius of {name} must be positive and finite, got {radius_m} m")))
}

fn same_times(name: &str, times: &[f64], own: impl ExactSizeIterator<Item = f64>) -> Result<(), McapError> {
    if own.len() != times.len() {
        return Err(McapError::unfit(format!(
            "{name} must have the same number of states as the first member, {}, got {}",
            times.len(),
            own.len()
        )));
    }
    match own.zip(times).find(|(own, time)| own != *time) {
        Some((own, time)) => {
            Err(McapError::unfit(format!("{name} has a state at {own} s, but the first member has one at {time} s")))
        }
        None => Ok(()),
    }
}

fn numbers(state: &MemberState) -> Vec<f64> {
    let errors = [state.depth_error_m, state.width_error_m].map(Option::unwrap_or_default);
    let single = [state.heading_rad, state.target_distance_m];
    [&state.position_m[..], &state.velocity_m_s, &errors, &single].concat()
}

fn lines(recording: &TeamRecording) -> Result<(), McapError> {
    for route in &recording.routes {
        finite(
            &format!("the route at {} s", route.time_s),
            &[route.points_m.as_flattened(), &[route.time_s]].concat(),
        )?;
    }
    finite("the search path", recording.search_path_m.as_flattened())?;
    finite("the roadmap", recording.vertices_m.as_flattened())?;
    for one in &recording.boxes {
        finite(&format!("the box at {} s", one.time_s), &[one.corners_m.as_flattened(), &[one.time_s]].concat())?;
    }
    for (ring, number) in recording.obstacles.iter().zip(1..) {
        if ring.len() < 3 {
            return Err(McapError::unfit(format!(
                "obstacle {number} must have at least 3 corners, got {}",
                ring.len()
            )));
        }
        finite(&format!("obstacle {number}"), ring.as_flattened())?;
    }
    Ok(())
}

fn events(recording: &TeamRecording) -> Result<(), McapError> {
    for event in &recording.events {
        finite("the time of an event", &[event.time_s])?;
        let known = |number: i64| recording.members.iter().any(|member| member.number == number);
        if let Some(number) = event.member.filter(|&number| !known(number)) {
            let kind = event.kind.name();
            return Err(McapError::unfit(format!("{kind} at {} s names an unknown member {number}", event.time_s)));
        }
    }
    Ok(())
}

fn finite(what: &str, values: &[f64]) -> Result<(), McapError> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(value) => Err(McapError::unfit(format!("{what} contains {value}; every number must be finite"))),
        None => Ok(()),
    }
}
