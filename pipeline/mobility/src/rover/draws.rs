//! Random numbers of a rover, by purpose. The numbers of the purposes are frozen: changing them changes the noise.

use sastrugi_numeric::Counter;

/// Purpose of a random number in a cycle.
#[derive(Clone, Copy, Debug)]
pub enum Purpose {
    /// Random turns of a policy.
    Turn = 0,
    /// Error of a turn.
    Heading = 1,
    /// Drift of the heading over a drive.
    Drift = 2,
    /// Slip of a drive.
    Slip = 3,
    /// Error of a sensed height, keyed by the number of the ray or pixel.
    Height = 4,
}

/// The random numbers of one rover in one cycle.
#[derive(Clone, Copy, Debug)]
pub struct CycleDraws(Counter);

impl CycleDraws {
    /// The random numbers of a cycle, counted from 0, of the rover with this key.
    pub fn new(rover: Counter, cycle: u32) -> Self {
        Self(rover.at(i64::from(cycle)))
    }

    /// A standard normal variate.
    pub fn normal(&self, purpose: Purpose) -> f64 {
        self.0.at(purpose as i64).normal()
    }

    /// A standard normal variate for each of many items.
    pub fn normal_of(&self, purpose: Purpose, number: usize) -> f64 {
        self.0.at(purpose as i64).at(number as i64).normal()
    }
}
