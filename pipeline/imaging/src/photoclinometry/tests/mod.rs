//! Tests of photoclinometry.

mod accuracy;
mod integration;
mod limits;
mod parts;
mod scene;
mod stereo;
mod sweeps;
