//! Simulator-specific parts of an export.

use serde_json::Value;

/// The parts of an export that the module of a simulator provides.
pub(super) struct Parts {
    /// Name of the simulator.
    pub title: &'static str,
    /// Files of the folder: name and bytes.
    pub files: Vec<(String, Vec<u8>)>,
    /// Rows of the matrix from scene coordinates (x, y, z, 1) to those of the simulator.
    pub scene_to_target: [[f64; 4]; 3],
    /// Axes and unit of the simulator's coordinates.
    pub axes: &'static str,
    /// Values required by the import.
    pub settings: Value,
    /// Import steps, in order.
    pub steps: Vec<String>,
}

/// Scene coordinates unchanged.
pub(super) const SAME: [[f64; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
