//! `metadata.yaml` of a bag, in the format of version 5 ("Humble"), which later distributions also read.

use super::super::{ChannelSummary, McapSummary};
use sastrugi_schemas::topics::Topic;
use sastrugi_schemas::topics::ros2::{
    MEMBER_PATH, ROVER_MARKERS, ROVER_PATH, TEAM_MARKERS, TEAM_ROUTE, TERRAIN, TERRAIN_POINTS, TF_STATIC,
};

/// Topics with a single message, at the start.
const LASTING: [&Topic; 8] =
    [&TF_STATIC, &TERRAIN, &TERRAIN_POINTS, &TEAM_ROUTE, &TEAM_MARKERS, &MEMBER_PATH, &ROVER_PATH, &ROVER_MARKERS];

/// Quality of service offered for a topic on playback. Messages sent once at the start are transient local, for late subscribers.
pub(super) fn quality_of_service(topic: &Topic) -> String {
    let lasting = LASTING.contains(&topic);
    // history 1: keep last; reliability 1: reliable; durability 1: transient local, 2: volatile; no other limits.
    let durability = if lasting { 1 } else { 2 };
    let depth = if lasting { 1 } else { 10 };
    let forever = "\n    sec: 9223372036\n    nsec: 854775807";
    format!(
        "- history: 1\n  depth: {depth}\n  reliability: 1\n  durability: {durability}\n  deadline:{forever}\n  lifespan:{forever}\n  \
         liveliness: 1\n  liveliness_lease_duration:{forever}\n  avoid_ros_namespace_conventions: false"
    )
}

/// The text of `metadata.yaml` for a bag of one file.
pub(in super::super) fn metadata(file: &str, summary: &McapSummary) -> String {
    let duration_ns = summary.end_ns.saturating_sub(summary.start_ns);
    let (start_ns, messages) = (summary.start_ns, summary.messages);
    let topics: String = summary.channels.iter().map(topic_entry).collect();
    format!(
        "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  duration:\n    nanoseconds: {duration_ns}\n  \
         starting_time:\n    nanoseconds_since_epoch: {start_ns}\n  message_count: {messages}\n  \
         topics_with_message_count:\n{topics}  compression_format: \"\"\n  compression_mode: \"\"\n  relative_file_paths:\n    \
         - {file}\n  files:\n    - path: {file}\n      starting_time:\n        nanoseconds_since_epoch: {start_ns}\n      \
         duration:\n        nanoseconds: {duration_ns}\n      message_count: {messages}\n"
    )
}

/// Names of the message files in a `metadata.yaml`, in order: the list below `relative_file_paths`, one per line, as ROS 2 writes
/// it.
pub(in super::super) fn names(metadata: &str) -> Vec<String> {
    let mut lines = metadata.lines().map(str::trim).skip_while(|line| *line != "relative_file_paths:");
    lines.next();
    let entries = lines.map_while(|line| line.strip_prefix("- "));
    entries.map(|name| name.trim().trim_matches(['"', '\'']).to_owned()).collect()
}

fn topic_entry(channel: &ChannelSummary) -> String {
    let quality = quality_of_service(channel.topic).replace('\n', "\\n");
    format!(
        "    - topic_metadata:\n        name: {}\n        type: {}\n        serialization_format: cdr\n        \
         offered_qos_profiles: \"{quality}\"\n      message_count: {}\n",
        channel.name, channel.topic.schema, channel.messages
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_the_names_of_a_bags_files() {
        let summary = McapSummary {
            messages: 1,
            channels: vec![ChannelSummary { name: "/terrain".to_owned(), topic: &TERRAIN, messages: 1 }],
            start_ns: 0,
            end_ns: 1,
            data_bytes: 1,
            content_sha256: String::new(),
        };
        assert_eq!(names(&metadata("a-0001.mcap", &summary)), ["a-0001.mcap"]);
        let split = "rosbag2_bagfile_information:\n  relative_file_paths:\n  - drive_0.mcap\n  - \"drive_1.mcap\"\n  - 'drive_10.mcap'\n  files:\n  - path: x\n";
        assert_eq!(names(split), ["drive_0.mcap", "drive_1.mcap", "drive_10.mcap"]);
        assert!(names("").is_empty() && names("relative_file_paths:").is_empty());
    }
}
