//! Tests of heights from images.

mod accuracy;
mod integration;
mod limits;
mod scene;
mod stereo;
mod sweeps;
