//! Memory for what is under way: patches that are being put together, and answers on their way to clients.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use tokio::sync::{AcquireError, OwnedSemaphorePermit, Semaphore};

/// Most bytes that a sample of a patch takes while the patch is put together: four fields of it and, where it lies between lattice points, of the
/// four around it, and three copies for turns and files.
const SAMPLE_BYTES: usize = 128;
/// Room is counted in so many bytes.
const UNIT: usize = 1 << 20;
/// Room for small patches, and as much for large ones, in units: the largest at a time.
const UNITS: usize = 1 << 9;
/// A patch of more units is large: 362 x 362 samples.
const SMALL_UNITS: usize = 16;

/// Room for patches, in two lines: small ones do not wait behind large ones.
pub struct Rooms {
    small: Arc<Semaphore>,
    large: Arc<Semaphore>,
}

impl Default for Rooms {
    fn default() -> Self {
        let [small, large] = [0, 1].map(|_| Arc::new(Semaphore::new(UNITS)));
        Self { small, large }
    }
}

impl Rooms {
    /// Waits in line for the memory that the samples of a patch take, which is given back when the permit is dropped. A patch that would need more
    /// than there is waits for all of it.
    ///
    /// # Errors
    /// None: a room is never closed.
    pub async fn take(&self, samples: usize) -> Result<OwnedSemaphorePermit, AcquireError> {
        let units = (samples * SAMPLE_BYTES).div_ceil(UNIT).min(UNITS);
        let line = if units > SMALL_UNITS { &self.large } else { &self.small };
        Arc::clone(line).acquire_many_owned(units as u32).await
    }
}

/// Bytes of answers on their way to clients.
#[derive(Clone, Default)]
pub struct Sending(Arc<AtomicU64>);

impl Sending {
    /// How many there are.
    pub fn bytes(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }

    /// Adds an answer, unless more than `most` bytes would be on their way; one answer alone may have any length, and one that does not count always
    /// goes.
    pub fn add(&self, bytes: u64, most: u64) -> Option<Load> {
        let more = |sending: u64| (bytes == 0 || sending == 0 || sending + bytes <= most).then_some(sending + bytes);
        self.0.fetch_update(Ordering::Relaxed, Ordering::Relaxed, more).ok()?;
        Some(Load { sending: self.clone(), bytes })
    }
}

/// Bytes of one answer; no longer on their way when dropped.
pub struct Load {
    sending: Sending,
    bytes: u64,
}

impl Drop for Load {
    fn drop(&mut self) {
        self.sending.0.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::pin::{Pin, pin};
    use std::task::{Context, Poll, Waker};

    const LARGEST: usize = 1 << 22;

    /// The permit, if there is room now.
    fn now(
        taking: Pin<&mut impl Future<Output = Result<OwnedSemaphorePermit, AcquireError>>>,
    ) -> Option<OwnedSemaphorePermit> {
        match taking.poll(&mut Context::from_waker(Waker::noop())) {
            Poll::Ready(permit) => permit.ok(),
            Poll::Pending => None,
        }
    }

    /// The largest patch takes all of its room, one that is larger still no more; small ones pass by it.
    #[test]
    fn val_large_patches_wait_and_small_ones_do_not() {
        let rooms = Rooms::default();
        let first = now(pin!(rooms.take(LARGEST))).unwrap();
        let mut second = pin!(rooms.take(4 * LARGEST));
        assert!(now(second.as_mut()).is_none());
        // 32 of 16 MB.
        let small: Vec<_> = (0..32).map(|_| now(pin!(rooms.take(362 * 362))).unwrap()).collect();
        let mut one_more = pin!(rooms.take(1));
        assert!(now(one_more.as_mut()).is_none());
        drop(small);
        assert!(now(one_more).is_some() && now(second.as_mut()).is_none());
        drop(first);
        assert!(now(second).is_some());
    }

    #[test]
    fn val_answers_on_their_way_are_bounded() {
        let sending = Sending::default();
        let alone = sending.add(200, 100).unwrap();
        assert!(sending.add(1, 100).is_none() && sending.add(0, 100).is_some() && sending.bytes() == 200);
        drop(alone);
        let (first, second) = (sending.add(60, 100), sending.add(40, 100));
        assert!(first.is_some() && second.is_some() && sending.add(1, 100).is_none());
        drop(second);
        assert!(sending.add(40, 100).is_some() && sending.bytes() == 60);
    }
}
