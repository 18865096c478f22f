//! The path of a body, composed from transforms between frames.

use super::LogError;
use super::series::{Rotation, between};
use sastrugi_schemas::counted;
use sastrugi_schemas::log::{PoseStream, TimedPose, TransformStream};
use std::collections::BTreeMap;

/// Maximum number of frames between the fixed frame and the body.
const DEPTH_MAX: usize = 32;

/// Poses of `body` in `fixed` (the root of its tree when absent), at the times of the most frequent transform in the chain. The
/// others are interpolated to these times; a transform with a single pose is static.
///
/// # Errors
/// [`LogError::NoFrame`] when no transform leads to the body or from the fixed frame.
pub(super) fn path(transforms: &[TransformStream], body: &str, fixed: Option<&str>) -> Result<PoseStream, LogError> {
    let mut by_child: BTreeMap<&str, &TransformStream> = BTreeMap::new();
    for stream in transforms {
        let kept = by_child.entry(&stream.child).or_insert(stream);
        if stream.poses.len() > kept.poses.len() {
            *kept = stream;
        }
    }
    // From the body up.
    let mut chain: Vec<&TransformStream> = Vec::new();
    let mut frame = body;
    while let Some(&stream) = by_child.get(frame).filter(|_| fixed != Some(frame) && chain.len() < DEPTH_MAX) {
        chain.push(stream);
        frame = &stream.parent;
    }
    let missing = || LogError::NoFrame {
        frame: fixed.filter(|_| by_child.contains_key(body)).unwrap_or(body).to_owned(),
        known: by_child.keys().map(|k| (*k).to_owned()).collect(),
    };
    if chain.is_empty() || fixed.is_some_and(|fixed| fixed != frame) {
        return Err(missing());
    }
    chain.reverse();
    let densest = chain.iter().max_by_key(|stream| stream.poses.len()).ok_or_else(missing)?;
    let poses = densest.poses.iter().filter_map(|pose| composed(&chain, pose.time_ns)).collect();
    let schema = format!("{frame} to {body} by {}", counted(chain.len(), "transform"));
    Ok(PoseStream { topic: densest.topic.clone(), schema, frame: frame.to_owned(), body: body.to_owned(), poses })
}

/// The product of all transforms at a time; `None` where one is unknown.
fn composed(chain: &[&TransformStream], time_ns: i64) -> Option<TimedPose> {
    let start =
        TimedPose { time_ns, position_m: [0.0; 3], orientation: [0.0, 0.0, 0.0, 1.0], angular_velocity_rad_s: None };
    chain.iter().try_fold(start, |outer, stream| {
        let inner = at(&stream.poses, time_ns)?;
        let turn = Rotation(outer.orientation);
        let moved = turn.of(inner.position_m);
        Some(TimedPose {
            position_m: std::array::from_fn(|i| outer.position_m[i] + moved[i]),
            orientation: turn.after(inner.orientation),
            ..outer
        })
    })
}

/// A transform at a time; one that was sent only once is static.
fn at(poses: &[TimedPose], time_ns: i64) -> Option<TimedPose> {
    if let [only] = poses {
        return Some(TimedPose { time_ns, ..*only });
    }
    let after = poses.partition_point(|pose| pose.time_ns < time_ns);
    let later = poses.get(after)?;
    if later.time_ns == time_ns {
        return Some(*later);
    }
    Some(between(&poses[after.checked_sub(1)?], later, time_ns))
}
