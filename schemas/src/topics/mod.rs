//! MCAP topics of a release and the recording of a mission that fills them.

pub mod recording;

pub use recording::{
    CommandSample, Event, EventKind, ImuSample, Recording, StateSample, VehicleOutline, WheelOutline, WheelSample,
    WheelState,
};
