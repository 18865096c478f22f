//! Counter-based random numbers, keyed by a named stream and by lattice point.
//!
//! An unbounded surface cannot draw from a stream, because the order of the draws would depend on the patch being generated. A
//! [`Counter`] is instead a pure function of its words: `counter.at(purpose).at(i).at(j)` is always the same number, in any order of
//! evaluation.
//!
//! Every word `w` (an integer modulo 2^64) maps the state `s` to `mix(s + (w + 1) g)`, with the golden-ratio step `g` and the
//! finaliser `mix` of SplitMix64 (Steele, Lea and Flood, 2014, doi:10.1145/2660193.2660195, variant 13 of Stafford). The states for
//! consecutive words are therefore the outputs of that generator. The first state is a 64-bit word of a named stream
//! ([`crate::Streams`]), so that every draw still has a name. For a given state, the map from words to states is one to one.

use crate::streams::Stream;

/// Step of SplitMix64: 2^64 over the golden ratio, odd.
const STEP: u64 = 0x9e37_79b9_7f4a_7c15;
/// Largest mean of a Poisson distribution, chosen so that the probability of 0 is well within the normal floating-point range.
pub const POISSON_MEAN_MAX: f64 = 600.0;

/// A node in the tree of words.
///
/// ```
/// use sastrugi_numeric::{Counter, Streams};
///
/// let root = Counter::new(&mut Streams::for_seed(42, "terrain").stream("texture-1"));
/// let at = |row: i64, col: i64| root.at(row).at(col).normal();
/// // The number of a lattice point does not depend on the order in which the points are visited.
/// let ahead: Vec<f64> = (-3..3).map(|col| at(5, col)).collect();
/// let mut behind: Vec<f64> = (-3..3).rev().map(|col| at(5, col)).collect();
/// behind.reverse();
/// assert_eq!(ahead, behind);
/// assert_ne!(at(1, 2), at(2, 1));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counter {
    state: u64,
}

impl Counter {
    /// The root: the next 64 bits of a named stream.
    pub fn new(stream: &mut Stream) -> Self {
        Self { state: stream.bits() }
    }

    /// The child node for a word.
    #[inline]
    pub fn at(self, word: i64) -> Self {
        Self { state: mix(self.state.wrapping_add(STEP.wrapping_mul((word as u64).wrapping_add(1)))) }
    }

    /// 64 uniform bits.
    #[inline]
    pub fn bits(self) -> u64 {
        self.state
    }

    /// Uniform in the open interval (0, 1): the midpoints of 2^52 equal parts.
    #[inline]
    pub fn uniform(self) -> f64 {
        ((self.state >> 12) as f64 + 0.5) * (1.0 / (1u64 << 52) as f64)
    }

    /// Standard normal, by the inverse of its distribution function.
    #[inline]
    pub fn normal(self) -> f64 {
        normal_quantile(self.uniform())
    }
}

/// Finaliser of SplitMix64.
#[inline]
fn mix(z: u64) -> u64 {
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Quantile of the standard normal distribution at probability `p`, 0 < p < 1; relative error about 1e-16 (Wichura, 1988,
/// algorithm AS 241, doi:10.2307/2347330).
///
/// ```
/// use sastrugi_numeric::counter::normal_quantile;
///
/// assert_eq!(normal_quantile(0.5), 0.0);
/// assert!((normal_quantile(0.975) - 1.959_963_984_540_054).abs() < 1e-14);
/// ```
#[inline]
pub fn normal_quantile(p: f64) -> f64 {
    let q = p - 0.5;
    if q.abs() <= 0.425 {
        let r = 0.180_625 - q * q;
        return q * ratio(&CENTRE, r);
    }
    tail_quantile(p, q)
}

fn tail_quantile(p: f64, q: f64) -> f64 {
    let r = (-libm::log(if q < 0.0 { p } else { 1.0 - p })).sqrt();
    let value = if r <= 5.0 { ratio(&TAIL, r - 1.6) } else { ratio(&FAR_TAIL, r - 5.0) };
    if q < 0.0 { -value } else { value }
}

/// Quotient of two polynomials, coefficients of the highest powers first.
#[inline]
fn ratio([above, below]: &[[f64; 8]; 2], r: f64) -> f64 {
    let value = |c: &[f64; 8]| c[1..].iter().fold(c[0], |sum, a| sum * r + a);
    value(above) / value(below)
}

const CENTRE: [[f64; 8]; 2] = [
    [
        2.509_080_928_730_122_6e3,
        3.343_057_558_358_813e4,
        6.726_577_092_700_87e4,
        4.592_195_393_154_987e4,
        1.373_169_376_550_946e4,
        1.971_590_950_306_551_4e3,
        1.331_416_678_917_843_8e2,
        3.387_132_872_796_366_6,
    ],
    [
        5.226_495_278_852_854e3,
        2.872_908_573_572_194_3e4,
        3.930_789_580_009_271e4,
        2.121_379_430_158_659_6e4,
        5.394_196_021_424_751e3,
        6.871_870_074_920_579e2,
        4.231_333_070_160_091e1,
        1.0,
    ],
];
const TAIL: [[f64; 8]; 2] = [
    [
        7.745_450_142_783_414e-4,
        2.272_384_498_926_918_4e-2,
        2.417_807_251_774_506e-1,
        1.270_458_252_452_368_4,
        3.647_848_324_763_204_5,
        5.769_497_221_460_691,
        4.630_337_846_156_546,
        1.423_437_110_749_683_5,
    ],
    [
        1.050_750_071_644_416_9e-9,
        5.475_938_084_995_345e-4,
        1.519_866_656_361_645_7e-2,
        1.481_039_764_274_800_8e-1,
        6.897_673_349_851e-1,
        1.676_384_830_183_803_8,
        2.053_191_626_637_759,
        1.0,
    ],
];
const FAR_TAIL: [[f64; 8]; 2] = [
    [
        2.010_334_399_292_288_1e-7,
        2.711_555_568_743_487_6e-5,
        1.242_660_947_388_078_4e-3,
        2.653_218_952_657_612_4e-2,
        2.965_605_718_285_048_7e-1,
        1.784_826_539_917_291_3,
        5.463_784_911_164_114,
        6.657_904_643_501_103,
    ],
    [
        2.044_263_103_389_939_8e-15,
        1.421_511_758_316_446e-7,
        1.846_318_317_510_054_8e-5,
        7.868_691_311_456_133e-4,
        1.487_536_129_085_061_5e-2,
        1.369_298_809_227_358e-1,
        5.998_322_065_558_88e-1,
        1.0,
    ],
];

/// Poisson counts by the inverse of their distribution function.
///
/// ```
/// use sastrugi_numeric::Poisson;
///
/// // With a mean of 3, the probability of 0 is 0.0498, and that of at most 2 is 0.4232.
/// let rocks = Poisson::new(3.0);
/// assert_eq!([0.01, 0.42, 0.43].map(|u| rocks.count(u)), [0, 2, 3]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Poisson {
    mean: f64,
    probability_of_zero: f64,
}

impl Poisson {
    /// Counts with the given mean, 0 to [`POISSON_MEAN_MAX`].
    pub fn new(mean: f64) -> Self {
        Self { mean, probability_of_zero: libm::exp(-mean) }
    }

    /// The count for a uniform number: `count(u) <= n` for a share `P(N <= n)` of all `u`. Time is proportional to the mean.
    #[inline]
    pub fn count(&self, u: f64) -> u32 {
        if u <= self.probability_of_zero { 0 } else { self.count_from_one(u) }
    }

    fn count_from_one(&self, u: f64) -> u32 {
        let (mut count, mut share, mut below) = (0, self.probability_of_zero, self.probability_of_zero);
        // Far beyond the mean, the remaining probability is smaller than the rounding error of `below`.
        while u > below && (share > 1e-18 || f64::from(count) < self.mean) {
            count += 1;
            share *= self.mean / f64::from(count);
            below += share;
        }
        count
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Streams;

    fn root() -> Counter {
        Counter::new(&mut Streams::for_seed(42, "terrain").stream("phases"))
    }

    /// The Python code in `docs/random-streams.md` gives the same numbers.
    #[test]
    fn gold_words_are_frozen() {
        let place = root().at(1).at(-3).at(1 << 40).at(0);
        assert_eq!((root().bits(), place.bits()), GOLD);
        assert_eq!(place.uniform(), GOLD_UNIFORM);
        assert_eq!(place.normal(), GOLD_NORMAL);
    }
    const GOLD: (u64, u64) = (14_865_957_119_134_067_284, 2_216_049_819_962_081_367);
    const GOLD_UNIFORM: f64 = 0.120_132_301_456_950_09;
    const GOLD_NORMAL: f64 = -1.174_325_675_452_943_2;

    /// R 4.3, `qnorm`; Wichura's own check values at 0.25, 0.001 and 1e-20.
    #[test]
    fn val_normal_quantiles() {
        let known = [
            (0.5, 0.0),
            (0.25, -0.674_489_750_196_081_7),
            (0.001, -3.090_232_306_167_813_5),
            (1e-20, -9.262_340_089_798_408),
            (0.975, 1.959_963_984_540_054),
        ];
        for (p, value) in known {
            assert!((normal_quantile(p) - value).abs() <= 4e-15 * f64::max(1.0, value.abs()), "{p}");
        }
        for u in [root().at(5).uniform(), 1e-9, 0.07499, 0.07501, 0.3] {
            assert!((normal_quantile(u) + normal_quantile(1.0 - u)).abs() < 1e-7);
        }
    }

    /// The distribution function by the error function, which is independent of the quotients: out to 1e-300, past both of their ends.
    #[test]
    fn val_quantiles_give_back_their_probabilities() {
        let tails = (1..=300).map(|k| libm::pow(10.0, -f64::from(k)));
        let rest = (1..1000).map(|k| f64::from(k) / 1000.0);
        for p in tails.chain(rest).chain([0.0749, 0.0751, 0.9249, 0.9251]) {
            let z = normal_quantile(p);
            let back = 0.5 * libm::erfc(-z * std::f64::consts::FRAC_1_SQRT_2);
            // An error of one unit in the last place of z counts for z^2 units of p.
            assert!((back / p - 1.0).abs() < 4e-15 * (1.0 + z * z), "{p}: {z} {back}");
        }
    }

    #[test]
    fn val_uniform_numbers_are_neither_0_nor_1() {
        let [lowest, highest] = [0, u64::MAX].map(|state| Counter { state }.uniform());
        assert_eq!((lowest, highest), (0.5 / (1_u64 << 52) as f64, 1.0 - f64::EPSILON / 2.0));
        assert!(Counter { state: 0 }.normal().is_finite() && Counter { state: u64::MAX }.normal().is_finite());
    }

    /// By hand: the probabilities of at most 0 to 4 are 1, 4, 8.5, 13 and 16.375 times e^-3.
    #[test]
    fn val_counts_of_mean_three() {
        let poisson = Poisson::new(3.0);
        let u = [0.0497, 0.0498, 0.1991, 0.1992, 0.4231, 0.4232, 0.6472, 0.6473, 0.8152, 0.8153];
        assert_eq!(u.map(|u| poisson.count(u)), [0, 1, 1, 2, 2, 3, 3, 4, 4, 5]);
        let nothing = Poisson::new(0.0);
        assert_eq!([1e-300, 0.5, 1.0 - 1e-16].map(|u| nothing.count(u)), [0; 3]);
    }

    /// Both the mean and the variance of the counts are the mean, here over 20 000 evenly spaced numbers.
    #[test]
    fn val_counts_have_equal_mean_and_variance() {
        for mean in [0.2, 3.0, 80.0, 600.0] {
            let poisson = Poisson::new(mean);
            let off = |k: u32| f64::from(poisson.count((f64::from(k) + 0.5) / 20_000.0)) - mean;
            let bias = crate::sums::mean(&(0..20_000).map(off).collect::<Vec<_>>());
            let spread = crate::sums::mean(&(0..20_000).map(off).map(|d| d * d).collect::<Vec<_>>());
            assert!(bias.abs() < 1e-3 && (spread / mean - 1.0).abs() < 1e-3, "{mean}: {bias} {spread}");
        }
    }

    #[test]
    fn val_counts_invert_the_distribution() {
        for mean in [0.0, 0.2, 3.0, 80.0, 600.0] {
            let poisson = Poisson::new(mean);
            let mut share = libm::exp(-mean);
            let mut below = share;
            for n in 0..(mean as u32 + 20) {
                if below > 1e-12 && below < 1.0 - 1e-12 {
                    assert_eq!(poisson.count(below * (1.0 - 1e-13)), n, "{mean}");
                    assert_eq!(poisson.count(below * (1.0 + 1e-13)), n + 1, "{mean}");
                }
                share *= mean / f64::from(n + 1);
                below += share;
            }
        }
        assert!(Poisson::new(600.0).count(1.0 - 1e-16) < 900);
    }

    /// Null: values at the points of a lattice are independent standard normals. Moments one to four of 512 x 512 values, and the
    /// correlations over eight shifts and across words, at 5 standard errors each (6e-7 per statistic, 13 statistics); a
    /// correlation of 0.01 would be caught.
    #[test]
    fn stat_lattice_draws_are_normal_and_uncorrelated() {
        let n = 512usize;
        let field = |purpose: i64| -> Vec<f64> {
            let here = root().at(purpose);
            (0..n * n).map(|k| here.at((k / n) as i64 - 256).at((k % n) as i64 - 256).normal()).collect()
        };
        let (a, b) = (field(1), field(2));
        let mean = |values: Vec<f64>| crate::sums::mean(&values);
        let count = (n * n) as f64;
        for (power, expected, variance) in [(1, 0.0, 1.0), (2, 1.0, 2.0), (3, 0.0, 15.0), (4, 3.0, 96.0)] {
            let moment = mean(a.iter().map(|v| (0..power).map(|_| v).product()).collect());
            assert!((moment - expected).abs() < 5.0 * f64::sqrt(variance / count), "moment {power}: {moment}");
        }
        for shift in [1, n - 1, n, n + 1, 2, 2 * n, 255 * n, 257] {
            let product = mean(a.iter().zip(&a[shift..]).map(|(x, y)| x * y).collect());
            assert!(product.abs() < 5.0 / (count - shift as f64).sqrt(), "shift {shift}: {product}");
        }
        let product = mean(a.iter().zip(&b).map(|(x, y)| x * y).collect());
        assert!(product.abs() < 5.0 / count.sqrt());
    }

    #[test]
    fn prop_words_do_not_commute() {
        assert_ne!(root().at(1).at(2), root().at(2).at(1));
        assert_ne!(root().at(0), root());
        assert_ne!(root().at(0), root().at(-1));
    }
}
