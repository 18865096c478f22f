//! Vehicle models for other simulators: MJCF for MuJoCo, and URDF for ROS, Gazebo, Isaac Sim and others.
//!
//! Both contain the same bodies, joints and names, in SI units; values that a format cannot express are given in comments. The
//! same vehicle gives the same bytes.
//!
//! * MJCF (MuJoCo XML reference): springs, dampers and stops, the rocker differential as an equality constraint, motors as
//!   servos, rolling resistance as rolling friction.
//! * URDF (ROS, `urdf/XML`): damping and stops; the differential as `mimic`; springs and rolling resistance as comments; friction
//!   in `gazebo` elements.

mod mjcf;
mod urdf;

#[cfg(test)]
mod tests;

use crate::atomic::{self, Target};
use sastrugi_schemas::mechanism::{Link, Mechanism, Motion};
use std::io;
use std::path::Path;

/// Formats of vehicle files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// MuJoCo model.
    Mjcf,
    /// ROS robot description.
    Urdf,
}

/// File name endings that [`write()`] supports.
pub const WRITTEN_ENDINGS: &str = ".xml (MJCF) and .urdf";

impl Format {
    /// All formats.
    pub const ALL: [Self; 2] = [Self::Mjcf, Self::Urdf];

    /// The format with the ending of a file name.
    pub fn of_name(path: &Path) -> Option<Self> {
        let ending = path.extension()?.to_str()?.to_ascii_lowercase();
        Self::ALL.into_iter().find(|format| format.ending() == ending)
    }

    /// Ending of file names, without the dot.
    pub const fn ending(self) -> &'static str {
        match self {
            Self::Mjcf => "xml",
            Self::Urdf => "urdf",
        }
    }

    /// Name of the format.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Mjcf => "mjcf",
            Self::Urdf => "urdf",
        }
    }
}

/// The text of a vehicle file.
pub fn render(mechanism: &Mechanism, format: Format) -> String {
    match format {
        Format::Mjcf => mjcf::render(mechanism),
        Format::Urdf => urdf::render(mechanism),
    }
}

/// Writes the file of a vehicle.
///
/// # Errors
/// The file system failed.
pub fn write<'a>(target: impl Into<Target<'a>>, mechanism: &Mechanism, format: Format) -> io::Result<()> {
    atomic::write(target.into(), render(mechanism, format).as_bytes())
}

/// Notes for the user on a file of this format.
pub fn notes(mechanism: &Mechanism, format: Format) -> Vec<String> {
    let springs = mechanism.links.iter().flat_map(|link| &link.joints).any(|joint| joint.spring.is_some());
    let lost = (format == Format::Urdf && springs)
        .then(|| "URDF has no springs; set them in the simulator from the comments in the file".to_owned());
    mechanism.links.iter().filter_map(impossible).chain(lost).collect()
}

/// Reports moments of inertia of a link that are physically impossible.
fn impossible(link: &Link) -> Option<String> {
    let [x, y, z] = link.inertia_kg_m2;
    let largest = x.max(y).max(z);
    (2.0 * largest > x + y + z).then(|| {
        format!(
            "the largest moment of inertia of {}, {largest} kg m2, exceeds the sum of the other two, which is impossible for a rigid \
             body; MuJoCo refuses to load it",
            link.name
        )
    })
}

/// Header lines common to both formats.
fn head(mechanism: &Mechanism) -> Vec<String> {
    let friction = &mechanism.friction;
    let mass_kg: f64 = mechanism.links.iter().map(|link| link.mass_kg).sum();
    vec![
        format!(
            "{}: vehicle {}. SI units, angles in rad. Axes: x forward, y left, z up.",
            crate::PROGRAM,
            mechanism.name
        ),
        format!(
            "{mass_kg:.3} kg. On level ground, with all joints at zero, base_link is {:.4} m above the ground.",
            mechanism.standing_height_m
        ),
        format!(
            "Wheels are rigid here; in sastrugi's own model the tyres sag by {:.4} m under the weight.",
            mechanism.tyre_sag_m
        ),
        format!(
            "Friction on surface {}: wheels {}, chassis {}, rolling resistance {}.",
            friction.surface, friction.wheel, friction.belly, friction.rolling
        ),
    ]
}

/// Children of a link, with their indices.
fn children(mechanism: &Mechanism, parent: Option<usize>) -> impl Iterator<Item = (usize, &Link)> {
    mechanism.links.iter().enumerate().filter(move |(_, link)| link.parent == parent)
}

/// Direction of a joint's axis.
const fn axis(motion: Motion) -> &'static str {
    match motion {
        Motion::SlideZ | Motion::TurnZ => "0 0 1",
        Motion::TurnY => "0 1 0",
    }
}

/// Numbers with spaces between them.
fn numbers(values: &[f64]) -> String {
    // Adding zero turns -0 into 0.
    values.iter().map(|v| (v + 0.0).to_string()).collect::<Vec<_>>().join(" ")
}

/// Text escaped for an attribute in double quotes.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}
