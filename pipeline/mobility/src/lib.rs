//! Vehicles on terrain: random missions, a dynamic vehicle model that drives them, and the figures that judge the drive.
//!
//! * [`missions`] draws start and goal points on a closed roughness-class map.
//! * [`vehicle`] holds vehicles as data, their contact with the ground, the steering, and [`vehicle::drive`], which
//!   turns one mission into a [`Recording`](sastrugi_schemas::topics::Recording).
//! * [`metrics`] turns recorded poses into the figures and rows of the tables `missions` and `samples`.
//! * [`rover`] holds rovers that find their own way over any ground.
//! * [`registry`] lists the vehicles.
//!
//! No file, clock, thread or environment is touched; the only random draws are those of [`missions`].

pub mod metrics;
pub mod missions;
pub mod registry;
pub mod rover;
pub mod vehicle;
