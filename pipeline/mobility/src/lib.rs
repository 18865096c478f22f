//! Vehicles on terrain: random missions, a dynamic vehicle model that drives them, and the metrics that evaluate the drive.
//!
//! # From a terrain to a row of metrics
//! 1. [`missions::draw_missions`] draws starts and goals on a closed roughness-class map; [`missions::Mission::between`] and
//!    [`missions::Mission::along`] make single missions.
//! 2. [`vehicle::TraverseParameters::prepare`] checks a vehicle and how it drives; [`registry::kinds`] lists the vehicles.
//! 3. [`vehicle::Ground::new`] prepares the terrain for that vehicle.
//! 4. [`vehicle::drive()`] turns one mission into a [`Recording`](sastrugi_schemas::topics::Recording).
//! 5. [`metrics::Metrics::of`] and [`metrics::mission_row`] evaluate it; [`metrics::log::analyse`] evaluates logs of real vehicles.
//!
//! Beside these, [`rover::drive()`] simulates rovers that find their own way with limited sensing.
//!
//! ```
//! use sastrugi_mobility::metrics::{Differentiator, Metrics};
//! use sastrugi_mobility::missions::Mission;
//! use sastrugi_mobility::vehicle::{Ground, TraverseParameters, drive};
//! use sastrugi_numeric::{Geometry, Grid};
//! use sastrugi_schemas::topics::EventKind;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // Level ground, 6 x 16 m in cells of 5 cm, and a Husky that drives 10 m to the east.
//! let terrain = Grid::filled(Geometry::square(120, 320, 0.05), 0.0);
//! let (vehicle, settings) = TraverseParameters::default().prepare()?;
//! let ground = Ground::new(&terrain, &vehicle)?;
//! let mission = Mission::between(0, [3.0, 3.0], [13.0, 3.0]);
//! let recording = drive(&ground, &vehicle, &settings, &mission)?;
//!
//! assert_eq!(recording.events.last().map(|event| event.kind), Some(EventKind::Success));
//! let metrics = Metrics::of(&recording.states, recording.sample_rate_hz, Differentiator::default());
//! // It arrives within 0.5 m of the goal, the tolerance, on a straight path.
//! assert!((metrics.path_length_m - 9.5).abs() < 0.1);
//! assert!(metrics.efficiency > 0.999);
//! # Ok(())
//! # }
//! ```
//!
//! # What is absent
//! The crate touches no file, clock, thread or environment variable. Random numbers are drawn only in [`missions`] and
//! [`rover`].

pub mod metrics;
pub mod missions;
pub mod registry;
pub mod rover;
pub mod vehicle;
