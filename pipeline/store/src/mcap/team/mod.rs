//! Recordings of teams: writers, and parts common to both flavours.

mod check;
mod drawing;
mod ros2;
mod viewer;

#[cfg(test)]
mod tests;

use super::{Channel, Flavour, McapError, McapSummary, TerrainView, Timeline, encode, write};
use crate::atomic::Target;
use sastrugi_schemas::study::McapFlavour;
use sastrugi_schemas::topics::ros2::{MEMBER_ODOM, MEMBER_PATH, TEAM_ROS2};
use sastrugi_schemas::topics::{self, TEAM_VIEWER, TeamEvent, TeamEventKind, TeamRecording, Topic};
use std::collections::BTreeMap;

/// A team's run to write.
#[derive(Clone, Copy, Debug)]
pub struct TeamMcap<'a> {
    /// Messages and their encoding.
    pub flavour: McapFlavour,
    /// Recording.
    pub recording: &'a TeamRecording,
    /// Terrain of the recording.
    pub terrain: &'a TerrainView<'a>,
    /// Start of the route, m.
    pub start_m: [f64; 2],
    /// Goal of the route, m.
    pub goal_m: [f64; 2],
    /// Start of the run's clock, ns since 1970-01-01 UTC.
    pub epoch_ns: u64,
    /// Metadata records by name.
    pub metadata: &'a BTreeMap<String, BTreeMap<String, String>>,
}

/// Writes a team's run to a file.
///
/// # Errors
/// See [`McapError`].
pub fn write_team<'a>(target: impl Into<Target<'a>>, team: &TeamMcap<'_>) -> Result<McapSummary, McapError> {
    write(target.into(), encode_team(team)?)
}

/// A team's run as the bytes of an MCAP file.
///
/// # Errors
/// [`McapError::Unfit`] for a recording without members or states, with member names that cannot be frames, with states at different
/// times, with a number that is not finite, or with an event of an unknown member.
pub fn encode_team(team: &TeamMcap) -> Result<(Vec<u8>, McapSummary), McapError> {
    check::recording(team)?;
    let mut timeline = Timeline::new(channels(team), team.epoch_ns);
    match team.flavour {
        McapFlavour::Viewer => viewer::messages(team, &mut timeline)?,
        McapFlavour::Ros2 => ros2::messages(team, &mut timeline)?,
    }
    encode(Flavour::of(team.flavour), timeline, team.metadata)
}

/// The channels of the flavour; those of members are grouped by member.
fn channels(team: &TeamMcap) -> Vec<Channel> {
    const OF_MEMBERS: [&Topic; 2] = [&MEMBER_ODOM, &MEMBER_PATH];
    let listed: &[&'static Topic] = match team.flavour {
        McapFlavour::Viewer => &TEAM_VIEWER,
        McapFlavour::Ros2 => &TEAM_ROS2,
    };
    let own = |member: &topics::Member| OF_MEMBERS.map(|topic| Channel::of_member(topic, &member.name));
    let mut channels = vec![];
    for topic in listed {
        if !OF_MEMBERS.contains(topic) {
            channels.push(Channel::of(topic));
        } else if *topic == &MEMBER_ODOM {
            channels.extend(team.recording.members.iter().flat_map(own));
        }
    }
    channels
}

/// Level of an event, from 1 (debug) to 3 (warning): the numbers of `foxglove.Log`, and tenths of those of `rcl_interfaces/msg/Log`.
fn level(kind: TeamEventKind) -> u8 {
    match kind {
        TeamEventKind::Wait | TeamEventKind::Dodge => 1,
        TeamEventKind::Start
        | TeamEventKind::Rearranged
        | TeamEventKind::Arrived
        | TeamEventKind::Replanned
        | TeamEventKind::End => 2,
        TeamEventKind::Lost | TeamEventKind::Squeezed | TeamEventKind::Stuck | TeamEventKind::Timeout => 3,
    }
}

/// Text of an event, preceded by the name of the member concerned.
fn text(recording: &TeamRecording, event: &TeamEvent) -> String {
    let member = recording.members.iter().find(|member| Some(member.number) == event.member);
    member.map_or_else(|| event.text.clone(), |member| format!("{}: {}", member.name, event.text))
}
