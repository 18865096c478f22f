//! Memory budgets: for patches being assembled, and for responses being sent.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use tokio::sync::{AcquireError, OwnedSemaphorePermit, Semaphore};

/// Most memory that a patch takes per sample while it is assembled, bytes: four fields, plus those of the four surrounding samples if it lies between
/// lattice points, plus three copies for rotation and encoding.
const SAMPLE_BYTES: usize = 128;
/// Unit of the budgets, bytes.
const UNIT: usize = 1 << 20;
/// Budget of small patches, and separately of large ones, in units; enough for the largest patch.
const UNITS: usize = 1 << 9;
/// A patch of more than this many units, 362 x 362 samples, is large.
const SMALL_UNITS: usize = 16;

/// Memory budget of patches, in two queues, so that small patches do not wait behind large ones.
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
    /// Waits in line for the memory of a patch of `samples`; dropping the permit releases it. A patch larger than the budget waits for all of it.
    ///
    /// # Errors
    /// None: the semaphores are never closed.
    pub async fn take(&self, samples: usize) -> Result<OwnedSemaphorePermit, AcquireError> {
        let units = (samples * SAMPLE_BYTES).div_ceil(UNIT).min(UNITS);
        let line = if units > SMALL_UNITS { &self.large } else { &self.small };
        Arc::clone(line).acquire_many_owned(units as u32).await
    }
}

/// Bytes of responses being sent.
#[derive(Clone, Default)]
pub struct Sending(Arc<AtomicU64>);

impl Sending {
    /// The present number.
    pub fn bytes(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }

    /// Adds a response unless the total would exceed `most` bytes. A single response may have any size, and one of 0 bytes is always accepted.
    pub fn add(&self, bytes: u64, most: u64) -> Option<Load> {
        let more = |sending: u64| (bytes == 0 || sending == 0 || sending + bytes <= most).then_some(sending + bytes);
        self.0.fetch_update(Ordering::Relaxed, Ordering::Relaxed, more).ok()?;
        Some(Load { sending: self.clone(), bytes })
    }
}

/// Bytes of one response; subtracted when dropped.
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

    /// The permit, if it is available now.
    fn now(
        taking: Pin<&mut impl Future<Output = Result<OwnedSemaphorePermit, AcquireError>>>,
    ) -> Option<OwnedSemaphorePermit> {
        match taking.poll(&mut Context::from_waker(Waker::noop())) {
            Poll::Ready(permit) => permit.ok(),
            Poll::Pending => None,
        }
    }

    /// The largest patch takes the complete budget of large ones, and an even larger one no more than that; small ones bypass them.
    #[test]
    fn val_large_patches_wait_and_small_ones_do_not() {
        let rooms = Rooms::default();
        let first = now(pin!(rooms.take(LARGEST))).unwrap();
        let mut second = pin!(rooms.take(4 * LARGEST));
        assert!(now(second.as_mut()).is_none());
        // 32 patches of 16 MB.
        let small: Vec<_> = (0..32).map(|_| now(pin!(rooms.take(362 * 362))).unwrap()).collect();
        let mut one_more = pin!(rooms.take(1));
        assert!(now(one_more.as_mut()).is_none());
        drop(small);
        assert!(now(one_more).is_some() && now(second.as_mut()).is_none());
        drop(first);
        assert!(now(second).is_some());
    }

    #[test]
    fn val_responses_being_sent_are_bounded() {
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
