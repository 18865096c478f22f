//! Named random streams.
//!
//! Every draw of the project comes from a stream that is named by words: who asks, in which stage, for which item, for
//! what purpose. The words are hashed with BLAKE3 (key derivation mode, context [`CONTEXT`]) to the seed of a ChaCha20
//! generator. Nothing else (thread, shard, order, time) enters. `docs/random-streams.md` is the page for people;
//! golden values below freeze the derivation.

use rand_chacha::ChaCha20Rng;
use rand_core::{Rng, SeedableRng};

/// Context string of the BLAKE3 key derivation.
pub const CONTEXT: &str = "sastrugi 2026-11 random streams v1";

/// The family of streams of one item in one stage.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Streams {
    words: Vec<String>,
}

impl Streams {
    /// Streams of study item `item` in `stage`: words `item, study seed, stage, item id`.
    pub fn for_item(study_seed: u64, stage: &str, item: &str) -> Self {
        let words = ["item", &study_seed.to_string(), stage, item].map(str::to_owned);
        Self { words: words.to_vec() }
    }

    /// Streams of an explicit seed in `stage`: words `seed, seed, stage`. An item of a study with `seed = N` and a verb
    /// with `--seed N` draw from the same streams.
    pub fn for_seed(seed: u64, stage: &str) -> Self {
        let words = ["seed", &seed.to_string(), stage].map(str::to_owned);
        Self { words: words.to_vec() }
    }

    /// The family one level below, as for one mission of a terrain.
    pub fn child(&self, word: &str) -> Self {
        let mut words = self.words.clone();
        words.push(word.to_owned());
        Self { words }
    }

    /// The stream for `purpose`.
    pub fn stream(&self, purpose: &str) -> Stream {
        let mut hasher = blake3::Hasher::new_derive_key(CONTEXT);
        for word in self.words.iter().map(String::as_str).chain([purpose]) {
            hasher.update(&(word.len() as u32).to_le_bytes());
            hasher.update(word.as_bytes());
        }
        Stream { generator: ChaCha20Rng::from_seed(*hasher.finalize().as_bytes()), spare_normal: None }
    }

    /// The words joined by `/`, as written in manifests.
    pub fn label(&self) -> String {
        self.words.join("/")
    }
}

/// One stream of random numbers.
#[derive(Clone, Debug)]
pub struct Stream {
    generator: ChaCha20Rng,
    spare_normal: Option<f64>,
}

impl Stream {
    /// 64 uniform bits.
    pub fn bits(&mut self) -> u64 {
        self.generator.next_u64()
    }

    /// Uniform in [0, 1): the top 53 of 64 bits.
    pub fn uniform(&mut self) -> f64 {
        unit(self.bits())
    }

    /// The next values of [`Self::uniform`], all at once.
    pub fn fill_uniform(&mut self, values: &mut [f64]) {
        values.iter_mut().for_each(|v| *v = self.uniform());
    }

    /// Uniform in [low, high).
    pub fn uniform_in(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// Uniform in 0..n, without bias (rejection).
    ///
    /// # Panics
    /// If `n` is 0.
    pub fn below(&mut self, n: u64) -> u64 {
        assert!(n > 0, "below(0) has no value");
        let limit = u64::MAX - u64::MAX % n;
        loop {
            let bits = self.bits();
            if bits < limit {
                return bits % n;
            }
        }
    }

    /// Standard normal, by Box and Muller (1958); values come in pairs, the second is kept for the next call.
    pub fn normal(&mut self) -> f64 {
        if let Some(value) = self.spare_normal.take() {
            return value;
        }
        // 1 - u lies in (0, 1], so the logarithm is finite.
        let radius = (-2.0 * libm::log(1.0 - self.uniform())).sqrt();
        let (sin, cos) = libm::sincos(2.0 * std::f64::consts::PI * self.uniform());
        self.spare_normal = Some(radius * sin);
        radius * cos
    }
}

/// The top 53 bits as a fraction.
fn unit(bits: u64) -> f64 {
    (bits >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gold_derivation_is_frozen() {
        let mut a = Streams::for_item(42, "terrain", "rough-0001").stream("phases");
        assert_eq!([a.bits(), a.bits()], GOLD_ITEM);
        let mut b = Streams::for_seed(42, "terrain").stream("phases");
        assert_eq!([b.bits(), b.bits()], GOLD_SEED);
    }
    const GOLD_ITEM: [u64; 2] = [9930470887049169247, 10174605234734328215];
    const GOLD_SEED: [u64; 2] = [14865957119134067284, 1496024527686076577];

    #[test]
    fn prop_word_boundaries_matter() {
        let a = Streams::for_item(1, "ab", "c").stream("p").bits();
        let b = Streams::for_item(1, "a", "bc").stream("p").bits();
        assert_ne!(a, b);
    }

    /// Many at once are the draws one by one, also after single ones.
    #[test]
    fn prop_filling_changes_no_draw() {
        let mut one_by_one = Streams::for_seed(3, "test").stream("uniform");
        let mut at_once = one_by_one.clone();
        for n in [1, 5, 128, 300, 7] {
            let mut values = vec![0.0; n];
            at_once.fill_uniform(&mut values);
            assert!(values.iter().all(|v| v.to_bits() == one_by_one.uniform().to_bits()), "{n}");
            assert_eq!(at_once.bits(), one_by_one.bits());
        }
    }

    /// Null: draws are standard normal. n = 200 000; thresholds at 5 standard errors of each moment
    /// (false alarm about 6e-7 each); would catch a mean off by 0.011 or a variance off by 1.6 %.
    #[test]
    fn stat_normal_moments() {
        let mut s = Streams::for_seed(7, "test").stream("normal");
        let n = 200_000;
        let draws: Vec<f64> = (0..n).map(|_| s.normal()).collect();
        let moment =
            |k: i32| crate::sums::mean(&draws.iter().map(|v| (0..k).map(|_| v).product::<f64>()).collect::<Vec<_>>());
        let se = |variance: f64| 5.0 * (variance / f64::from(n)).sqrt();
        assert!(moment(1).abs() < se(1.0));
        assert!((moment(2) - 1.0).abs() < se(2.0));
        assert!(moment(3).abs() < se(15.0));
        assert!((moment(4) - 3.0).abs() < se(96.0));
    }
}
