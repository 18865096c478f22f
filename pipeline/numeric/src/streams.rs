//! Named random streams.
//!
//! Every draw of the project comes from a stream that is named by words: the caller, the stage, the item and the purpose. The words
//! are hashed with BLAKE3 (key derivation mode, context [`CONTEXT`]) to the seed of a ChaCha20 generator. Nothing else (thread, shard,
//! order, time) has any influence. `docs/random-streams.md` describes the derivation for users; golden values below freeze it.

use rand_chacha::ChaCha20Rng;
use rand_core::{Rng, SeedableRng};
use std::fmt;
use std::sync::Arc;

/// Context string of the BLAKE3 key derivation.
pub const CONTEXT: &str = "sastrugi 2026-11 random streams v1";

/// The family of streams of one item in one stage.
///
/// ```
/// use sastrugi_numeric::Streams;
///
/// let streams = Streams::for_seed(42, "terrain");
/// // The words name the stream, so whoever asks for it, whenever, gets the same numbers.
/// assert_eq!(streams.stream("phases").bits(), 14_865_957_119_134_067_284);
/// let mut of_mission = streams.child("mission-0001").stream("start");
/// let east_m = of_mission.uniform_in(-5.0, 5.0);
/// assert!((-5.0..5.0).contains(&east_m));
/// assert_eq!(streams.child("mission-0001").label(), "seed/42/terrain/mission-0001");
/// ```
#[derive(Clone, PartialEq, Eq)]
pub struct Streams {
    /// Every word after its length in bytes (32-bit little-endian): what is hashed. Shared, because a study may have a million families.
    words: Arc<[u8]>,
}

impl Streams {
    /// Streams of study item `item` in `stage`: words `item, study seed, stage, item id`.
    pub fn for_item(study_seed: u64, stage: &str, item: &str) -> Self {
        Self::of(&[], &["item", &study_seed.to_string(), stage, item])
    }

    /// Streams of an explicit seed in `stage`: words `seed, seed, stage`. An item of a study with `seed = N` and a verb
    /// with `--seed N` draw from the same streams.
    pub fn for_seed(seed: u64, stage: &str) -> Self {
        Self::of(&[], &["seed", &seed.to_string(), stage])
    }

    /// The family one level below, for example for one mission of a terrain.
    pub fn child(&self, word: &str) -> Self {
        Self::of(&self.words, &[word])
    }

    /// Words after those that are hashed already.
    fn of(before: &[u8], words: &[&str]) -> Self {
        let mut all = before.to_vec();
        for word in words {
            all.extend((word.len() as u32).to_le_bytes());
            all.extend(word.as_bytes());
        }
        Self { words: all.into() }
    }

    /// The stream for `purpose`.
    pub fn stream(&self, purpose: &str) -> Stream {
        let mut hasher = blake3::Hasher::new_derive_key(CONTEXT);
        hasher.update(&self.words).update(&(purpose.len() as u32).to_le_bytes()).update(purpose.as_bytes());
        Stream { generator: ChaCha20Rng::from_seed(*hasher.finalize().as_bytes()), spare_normal: None }
    }

    /// The words joined by `/`, as written in manifests.
    pub fn label(&self) -> String {
        let mut words = Vec::new();
        let mut rest = &*self.words;
        while let Some((length, after)) = rest.split_first_chunk() {
            let (word, others) = after.split_at(u32::from_le_bytes(*length) as usize);
            words.push(String::from_utf8_lossy(word));
            rest = others;
        }
        words.join("/")
    }
}

impl fmt::Debug for Streams {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Streams").field(&self.label()).finish()
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

    /// Fills `values` with the next values of [`Self::uniform`].
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

    /// Standard normal, by Box and Muller (1958). Values are computed in pairs; the second is kept for the next call.
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

    /// A child's name ends where the purpose begins.
    #[test]
    fn val_children_and_labels() {
        let streams = Streams::for_item(7, "terrain", "a-0001").child("process-2");
        assert_eq!(streams.label(), "item/7/terrain/a-0001/process-2");
        assert_eq!(Streams::for_seed(7, "terrain").label(), "seed/7/terrain");
        let first = |streams: &Streams, purpose: &str| streams.stream(purpose).bits();
        let root = Streams::for_seed(7, "terrain");
        let (apart, joined) = (root.child("ab"), root.child("a"));
        assert_ne!(first(&apart, "c"), first(&joined, "bc"));
        assert_eq!(first(&apart, "c"), first(&Streams::for_seed(7, "terrain").child("ab"), "c"));
        assert_ne!(first(&root, "c"), first(&Streams::for_seed(8, "terrain"), "c"));
    }

    /// From the two frozen words: their top 53 bits times 2^-53, computed with exact integers.
    #[test]
    fn val_uniform_numbers_are_the_top_bits() {
        let stream = Streams::for_seed(42, "terrain").stream("phases");
        let mut one = stream.clone();
        assert_eq!([one.uniform(), one.uniform()], [0.805_885_150_232_075_3, 0.081_099_652_150_442_24]);
        assert!((stream.clone().uniform_in(-2.0, 6.0) - 4.447_081_201_856_602).abs() < 1e-14);
        assert_eq!((unit(0), unit(u64::MAX)), (0.0, 1.0 - f64::EPSILON / 2.0));
    }

    /// From the same words: remainders, and the second word where the first lies at or above the largest multiple of n.
    #[test]
    fn val_integers_below_n() {
        let stream = Streams::for_seed(42, "terrain").stream("phases");
        let mut tens = stream.clone();
        assert_eq!([tens.below(10), tens.below(10)], [4, 7]);
        assert_eq!(stream.clone().below((1 << 63) + 1), GOLD_SEED[1]);
        assert_eq!(stream.clone().below(1), 0);
    }

    #[test]
    #[should_panic(expected = "below(0) has no value")]
    fn val_nothing_lies_below_zero() {
        Streams::for_seed(42, "terrain").stream("phases").below(0);
    }

    /// Null: draws below 7 are uniform. n = 70 000; chi-squared with 6 degrees of freedom exceeds 38.3 with a probability of 1e-6; would
    /// catch a class with 8 % too many draws.
    #[test]
    fn stat_integers_below_n_are_uniform() {
        let mut s = Streams::for_seed(7, "test").stream("below");
        let mut counts = [0_u32; 7];
        (0..70_000).for_each(|_| counts[s.below(7) as usize] += 1);
        let chi2: f64 = counts.iter().map(|n| f64::from(*n) - 1e4).map(|off| off * off / 1e4).sum();
        assert!(chi2 < 38.3, "{chi2} {counts:?}");
    }

    /// Box and Muller backwards: both normal numbers of a pair, in this order, give back the uniform numbers they came from.
    #[test]
    fn val_pairs_of_normal_numbers_give_back_their_uniform_numbers() {
        let mut normals = Streams::for_seed(3, "test").stream("pairs");
        let mut uniforms = normals.clone();
        for _ in 0..1000 {
            let (x, y) = (normals.normal(), normals.normal());
            let (u, v) = (uniforms.uniform(), uniforms.uniform());
            let turn = libm::atan2(y, x) / (2.0 * std::f64::consts::PI);
            assert!((1.0 - libm::exp(-0.5 * (x * x + y * y)) - u).abs() < 1e-14, "{u}");
            assert!((turn - turn.floor() - v).abs() < 1e-14, "{v}");
        }
    }

    /// Filling a slice gives the same draws as single calls, even when both are mixed.
    #[test]
    fn prop_filling_gives_the_same_draws() {
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
