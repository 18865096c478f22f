//! Vehicles for other simulators: MJCF, the model files of MuJoCo, and URDF, which ROS, Gazebo, Isaac Sim and others read.
//!
//! Both hold the same bodies, joints and names, in SI units; every number that a format cannot hold stands in a comment. The same
//! vehicle gives the same bytes.
//!
//! * MJCF (MuJoCo XML reference): springs, dampers and stops, the differential of rockers as an equality constraint, motors as
//!   servos, rolling resistance as rolling friction.
//! * URDF (ROS, `urdf/XML`): damping and stops; the differential as `mimic`; springs and rolling resistance as comments; friction as
//!   the `gazebo` elements that Gazebo reads.

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
    /// MuJoCo's.
    Mjcf,
    /// That of ROS.
    Urdf,
}

/// Endings of names that [`write()`] takes.
pub const WRITTEN_ENDINGS: &str = ".xml (MJCF) and .urdf";

impl Format {
    /// Every format.
    pub const ALL: [Self; 2] = [Self::Mjcf, Self::Urdf];

    /// The format of a file name's ending.
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

/// The text of a vehicle's file.
pub fn render(mechanism: &Mechanism, format: Format) -> String {
    match format {
        Format::Mjcf => mjcf::render(mechanism),
        Format::Urdf => urdf::render(mechanism),
    }
}

/// Writes the file of a vehicle.
///
/// # Errors
/// When the file system refuses.
pub fn write<'a>(target: impl Into<Target<'a>>, mechanism: &Mechanism, format: Format) -> io::Result<()> {
    atomic::write(target.into(), render(mechanism, format).as_bytes())
}

/// Sentences a user must know before a file of this format is loaded.
pub fn notes(mechanism: &Mechanism, format: Format) -> Vec<String> {
    let springs = mechanism.links.iter().flat_map(|link| &link.joints).any(|joint| joint.spring.is_some());
    let lost = (format == Format::Urdf && springs)
        .then(|| "URDF has no springs; the file states them in comments, to be set in the simulator".to_owned());
    mechanism.links.iter().filter_map(impossible).chain(lost).collect()
}

/// What is wrong with the moments of inertia of a link, if anything.
fn impossible(link: &Link) -> Option<String> {
    let [x, y, z] = link.inertia_kg_m2;
    let largest = x.max(y).max(z);
    (2.0 * largest > x + y + z).then(|| {
        format!(
            "the largest moment of inertia of {}, {largest} kg m2, exceeds the sum of the other two, which no rigid body has; \
             MuJoCo refuses to load it",
            link.name
        )
    })
}

/// What both formats state at their head, a line each.
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
            "{mass_kg:.3} kg. On level ground base_link stands {:.4} m high, all joints at zero.",
            mechanism.standing_height_m
        ),
        format!(
            "Wheels are rigid here. In the model of sastrugi tyres give way by {:.4} m under the weight.",
            mechanism.tyre_sag_m
        ),
        format!(
            "Friction of the surface {}: wheels {}, chassis {}, rolling resistance {}.",
            friction.surface, friction.wheel, friction.belly, friction.rolling
        ),
    ]
}

/// Children of a link, by number.
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
    // No minus sign before zero.
    values.iter().map(|v| (v + 0.0).to_string()).collect::<Vec<_>>().join(" ")
}

/// Text inside of an attribute in double quotes.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}
