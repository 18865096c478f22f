//! What a rover draws, by name. The words below a rover's key are frozen: another order is other noise.

use sastrugi_numeric::Counter;

/// What is drawn in a cycle.
#[derive(Clone, Copy, Debug)]
pub enum Purpose {
    /// Turns of a policy that are drawn.
    Turn = 0,
    /// Error of a turn.
    Heading = 1,
    /// Drift of the heading over a drive.
    Drift = 2,
    /// Slip of a drive.
    Slip = 3,
    /// Error of a sensed height, with the number of the ray or pixel below.
    Height = 4,
}

/// The draws of one rover in one cycle.
#[derive(Clone, Copy, Debug)]
pub struct CycleDraws(Counter);

impl CycleDraws {
    /// Those of a cycle, from 0, of the rover with this key.
    pub fn new(rover: Counter, cycle: u32) -> Self {
        Self(rover.at(i64::from(cycle)))
    }

    /// A standard normal number.
    pub fn normal(&self, purpose: Purpose) -> f64 {
        self.0.at(purpose as i64).normal()
    }

    /// A standard normal number for each of many.
    pub fn normal_of(&self, purpose: Purpose, number: usize) -> f64 {
        self.0.at(purpose as i64).at(number as i64).normal()
    }
}
