//! What the file of one simulator gives to its export.

use serde_json::Value;

/// What the module of a simulator adds to what all exports have.
pub(super) struct Parts {
    /// The program's name.
    pub title: &'static str,
    /// Files of the folder: name and bytes.
    pub files: Vec<(String, Vec<u8>)>,
    /// Rows of the matrix from scene coordinates (x, y, z, 1) to the program's.
    pub scene_to_target: [[f64; 4]; 3],
    /// Axes and unit of the program's coordinates.
    pub axes: &'static str,
    /// What the import asks for.
    pub settings: Value,
    /// What to do, in order.
    pub steps: Vec<String>,
}

/// Scene coordinates as they are.
pub(super) const SAME: [[f64; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
