//! Elementary effects against closed forms and a published function.

use super::*;
use proptest::prelude::*;
use sastrugi_numeric::Streams;

fn stream(purpose: &str) -> Stream {
    Streams::for_seed(1, "morris-test").stream(purpose)
}

/// Trajectories over the unit cube.
fn trajectories(count: usize, parameters: usize, levels: u32, s: &mut Stream) -> Vec<(Vec<Vec<f64>>, Vec<usize>)> {
    let unit = |levels_of: &Vec<u32>| levels_of.iter().map(|l| f64::from(*l) / f64::from(levels - 1)).collect();
    let one = |t: Trajectory| (t.levels.iter().map(unit).collect(), t.order);
    (0..count).map(|_| one(Trajectory::draw(parameters, levels, s))).collect()
}

/// Effects by parameter, trajectory and world of an output that depends on the world's number.
fn effects_of(
    trajectories: &[(Vec<Vec<f64>>, Vec<usize>)],
    worlds: usize,
    mut output: impl FnMut(&[f64], usize) -> f64,
) -> Vec<Vec<Vec<f64>>> {
    let parameters = trajectories[0].1.len();
    let mut effects = vec![vec![Vec::new(); trajectories.len()]; parameters];
    for (t, (points, order)) in trajectories.iter().enumerate() {
        for world in 0..worlds {
            let values: Vec<f64> = points.iter().map(|x| output(x, world)).collect();
            let of = elementary_effects(points, order, &values);
            of.into_iter().enumerate().for_each(|(k, d)| effects[k][t].push(d));
        }
    }
    effects
}

/// Every parameter moves once, by half of the levels, and all levels occur equally often. Null: each of 4 levels has probability 1/4 among the
/// first designs of 2000 trajectories, of 6 parameters: 12 000 draws. Bound 5 standard deviations of each count: false alarm 4 x 6e-7.
#[test]
fn stat_trajectories_move_each_parameter_once() {
    let mut counts = [0.0; 4];
    let mut firsts = [0.0; 6];
    let mut s = stream("trajectories");
    for _ in 0..2000 {
        let t = Trajectory::draw(6, 4, &mut s);
        assert_eq!(t.levels.len(), 7);
        let mut sorted = t.order.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, [0, 1, 2, 3, 4, 5]);
        for (pair, &moved) in t.levels.windows(2).zip(&t.order) {
            let steps = |k: usize| pair[1][k].abs_diff(pair[0][k]);
            assert!((0..6).all(|k| steps(k) == if k == moved { 2 } else { 0 }), "{t:?}");
        }
        t.levels[0].iter().for_each(|l| counts[*l as usize] += 1.0);
        firsts[t.order[0]] += 1.0;
    }
    let near = |count: f64, n: f64, p: f64| (count - n * p).abs() < 5.0 * (n * p * (1.0 - p)).sqrt();
    assert!(counts.iter().all(|c| near(*c, 12_000.0, 0.25)), "{counts:?}");
    assert!(firsts.iter().all(|c| near(*c, 2000.0, 1.0 / 6.0)), "{firsts:?}");
}

/// The effects of a linear output are its coefficients, without scatter. Tolerance 1e-12 for rounding.
#[test]
fn val_linear_outputs_have_their_coefficients() {
    let coefficients = [3.0, -2.0, 0.0, 0.5];
    let t = trajectories(5, 4, 8, &mut stream("linear"));
    let output = |x: &[f64], world: usize| x.iter().zip(coefficients).map(|(x, c)| c * x).sum::<f64>() + world as f64;
    let found = screen(&effects_of(&t, 3, output), 200, 0.95, &mut stream("redraws"));
    for (i, c) in found.iter().zip(coefficients) {
        let close = |value: f64, truth: f64| (value - truth).abs() < 1e-12;
        assert!(close(i.mu, c) && close(i.mu_star, c.abs()) && close(i.sigma, 0.0) && close(i.noise, 0.0), "{i:?}");
        let (mu, star) = (i.mu_interval.unwrap(), i.mu_star_interval.unwrap());
        assert!([mu.low, mu.high].iter().all(|v| close(*v, c)) && close(star.high, c.abs()), "{i:?}");
    }
    // A parameter without influence has an effect of exactly +0.
    let none = &screen(&effects_of(&t, 3, |x, world| x[0] * x[1] + world as f64), 200, 0.95, &mut stream("dummy"))[2];
    let interval = none.mu_star_interval.unwrap();
    let zeros = [none.mu, none.mu_star, none.sigma, none.noise, interval.low, interval.high];
    assert!(zeros.iter().all(|v| v.to_bits() == 0), "{none:?}");
}

/// By hand: effects of two trajectories on two worlds, (1, 3) and (-2, -4). Means 2 and -3: mu -1/2, mu* 5/2, sigma 5 / sqrt(2). Over the
/// worlds both have a standard deviation of sqrt(2), and their means one of 1: noise sqrt(2/pi).
#[test]
fn val_means_by_hand() {
    let effects = vec![vec![vec![1.0, 3.0], vec![-2.0, -4.0]]];
    let [i] = screen(&effects, 500, 0.95, &mut stream("hand"))[..] else { panic!() };
    assert_eq!((i.mu, i.mu_star), (-0.5, 2.5));
    assert!(
        (i.sigma - 5.0 / 2f64.sqrt()).abs() < 1e-12 && (i.noise - (2.0 / std::f64::consts::PI).sqrt()).abs() < 1e-12
    );
    // Replicates with a single world and a single trajectory range from -4 to 3.
    let interval = i.mu_interval.unwrap();
    assert_eq!((interval.low, interval.high, interval.estimate), (-4.0, 3.0, -0.5));
    assert_eq!(i.mu_star_interval.map(|star| (star.low, star.high)), Some((1.0, 4.0)));
}

#[test]
fn val_no_interval_without_worlds_or_trajectories() {
    let one_world = screen(&[vec![vec![1.0], vec![2.0]]], 99, 0.95, &mut stream("world"))[0];
    assert!(one_world.mu_interval.is_none() && one_world.mu_star_interval.is_none() && one_world.noise.is_nan());
    assert!((one_world.mu_star - 1.5).abs() < 1e-15 && (one_world.sigma - 0.5f64.sqrt()).abs() < 1e-15);
    let one_trajectory = screen(&[vec![vec![1.0, 2.0]]], 99, 0.95, &mut stream("trajectory"))[0];
    assert!(one_trajectory.mu_interval.is_none() && one_trajectory.sigma.is_nan());
    // Standard deviation sqrt(1/2) over the worlds, 1/2 of their mean.
    assert!((one_trajectory.noise - 0.5 * (2.0 / std::f64::consts::PI).sqrt()).abs() < 1e-15);
    assert_eq!(screen(&[], 99, 0.95, &mut stream("nothing")), []);
}

/// Inputs of Morris's function: linear except inputs 3, 5 and 7.
fn w(i: usize, x: f64) -> f64 {
    2.0 * (if [2, 4, 6].contains(&i) { 1.1 * x / (x + 0.1) } else { x } - 0.5)
}

fn sign(exponent: usize) -> f64 {
    if exponent.is_multiple_of(2) { 1.0 } else { -1.0 }
}

/// Morris (1991), section 5: 20 inputs; coefficients of first order 20 for inputs 1 to 10, of second -15 among 1 to 6, of third -10 among 1
/// to 5, of fourth 5 among 1 to 4. The other coefficients of first and second order are standard normal there; here they are (-1)^i and
/// (-1)^(i+j), so that the expected effects have a closed form.
fn morris_function(x: &[f64]) -> f64 {
    let w: Vec<f64> = x.iter().enumerate().map(|(i, x)| w(i, *x)).collect();
    let mut y = 0.0;
    for i in 0..20 {
        y += w[i] * if i < 10 { 20.0 } else { sign(i + 1) };
        for j in i + 1..20 {
            y += w[i] * w[j] * if j < 6 { -15.0 } else { sign(i + j) };
            for l in j + 1..5 {
                y += -10.0 * w[i] * w[j] * w[l];
                (l + 1..4).for_each(|s| y += 5.0 * w[i] * w[j] * w[l] * w[s]);
            }
        }
    }
    y
}

/// Expected effects of that function where the inputs are independent and each of four levels equally likely: w is linear for these inputs,
/// so that the effect of input i is 2 (b_i + sum_j b_ij E w_j).
fn expected_mu(i: usize) -> f64 {
    let mean = |j: usize| (0..4).map(|l| w(j, f64::from(l) / 3.0)).sum::<f64>() / 4.0;
    let first = if i < 10 { 20.0 } else { sign(i + 1) };
    2.0 * (first + (0..20).filter(|j| *j != i).map(|j| sign(i + j) * mean(j)).sum::<f64>())
}

/// The paper's result (figure 1; 4 trajectories, 4 levels): inputs 1 to 10 are separated from the other ten; 8 to 10 have effects near 40 with
/// little spread, 1 to 7 have a wide spread. Here with 10 trajectories.
#[test]
fn val_morriss_function_has_its_ranking() {
    let t = trajectories(10, 20, 4, &mut stream("morris"));
    let found = screen(&effects_of(&t, 1, |x, _| morris_function(x)), 0, 0.95, &mut stream("redraws"));
    let star = |k: usize| found[k].mu_star;
    let least_important = (0..10).map(star).fold(f64::INFINITY, f64::min);
    let most_unimportant = (10..20).map(star).fold(0.0, f64::max);
    assert!(least_important > 1.5 * most_unimportant, "{least_important} {most_unimportant}");
    for i in &found[7..10] {
        assert!((i.mu - 40.0).abs() < 6.0 && i.sigma < 12.0, "{i:?}");
    }
    assert!(found[..6].iter().all(|i| i.sigma > 20.0), "{found:?}");
}

/// Null: the effects of the inputs without curvature are those of the closed form. 400 trajectories; the mean lies within 5 standard errors of
/// the true value: false alarm 13 x 6e-7 = 8e-6. Standard errors are 0.2 to 0.4, so that an error of 5 % for inputs 8 to 10 is detected.
#[test]
fn stat_expected_effects_of_morriss_function() {
    let t = trajectories(400, 20, 4, &mut stream("expected"));
    let found = screen(&effects_of(&t, 1, |x, _| morris_function(x)), 0, 0.95, &mut stream("redraws"));
    for (i, of) in found.iter().enumerate().skip(7) {
        let error = of.sigma / 20.0;
        assert!((of.mu - expected_mu(i)).abs() < 5.0 * error, "{i}: {of:?}, truth {}", expected_mu(i));
        assert!(error < 0.5, "{i}: {error}");
    }
}

/// Null: 95 % intervals of mu. 300 screenings of 12 trajectories on 12 worlds; an effect is 1 + N(0, 0.5) for the trajectory + N(0, 0.5) for
/// the world + N(0, 1) for both. The pigeonhole bootstrap is conservative for the mean, its percentile intervals with 12 of each slightly short
/// (290 of 300 here). Fewer than 258 hits of 300 has probability 7e-6 if the coverage is 0.93 (binomial).
#[test]
fn stat_intervals_cover_worlds_and_trajectories() {
    let mut s = stream("coverage");
    let mut hits = 0;
    for _ in 0..300 {
        let worlds: Vec<f64> = (0..12).map(|_| 0.5 * s.normal()).collect();
        let of = |_| {
            let centre = 1.0 + 0.5 * s.normal();
            worlds.iter().map(|w| centre + w + s.normal()).collect()
        };
        let effects: Vec<Vec<f64>> = (0..12).map(of).collect();
        hits += usize::from(screen(&[effects], 200, 0.95, &mut s)[0].mu_interval.is_some_and(|i| i.holds(1.0)));
    }
    assert!(hits >= 258, "{hits} of 300");
}

/// The noise is the expected mu* without a mean effect, but for the bias of a standard deviation. Null: 200 screenings of 20 trajectories on
/// 10 worlds, effects N(0, 2). Statistic: the mean noise over the mean mu*, which is c4(10) = sqrt(2/9) Gamma(5) / Gamma(4.5) = 0.9727, the
/// expectation of s from 10 values over the standard deviation. Relative standard errors: a half-normal number scatters by
/// sqrt(pi/2 - 1) = 0.756 of its mean, so that mu* is good to 0.756 / sqrt(200 x 20) = 0.0119; s scatters by sqrt(1 / c4^2 - 1) = 0.239 of its
/// mean, so that the noise is good to 0.239 / sqrt(200 x 20) = 0.0038; both are independent for normal effects: 0.0125, or 0.0122 of the
/// ratio. Bound: 5 of these, 0.061 (false alarm 6e-7). A missing factor sqrt(2/pi) = 0.80 or sqrt(10) would be far outside.
#[test]
fn stat_noise_is_the_star_of_no_effect() {
    let mut s = stream("noise");
    let (mut star, mut noise) = (0.0, 0.0);
    for _ in 0..200 {
        let effects: Vec<Vec<f64>> = (0..20).map(|_| (0..10).map(|_| 2.0 * s.normal()).collect()).collect();
        let i = screen(&[effects], 0, 0.95, &mut s)[0];
        star += i.mu_star;
        noise += i.noise;
    }
    assert!((noise / star - 0.9727).abs() < 0.061, "{}", noise / star);
}

proptest! {
    /// Effects do not depend on the order of worlds or trajectories, nor on a constant, and scale with the unit of the output; mu* is at
    /// least |mu|. Tolerance 1e-9 for rounding, for effects up to 100.
    #[test]
    fn prop_effects_scale_with_the_output(
        effects in prop::collection::vec(prop::collection::vec(-100.0..100.0f64, 3), 2..6),
        unit in 0.1..10.0f64,
        constant in -10.0..10.0f64,
    ) {
        let of = |effects: &[Vec<f64>]| screen(&[effects.to_vec()], 0, 0.95, &mut stream("property"))[0];
        let plain = of(&effects);
        let mut turned: Vec<Vec<f64>> = effects.iter().map(|t| t.iter().rev().map(|d| d * unit).collect()).collect();
        turned.reverse();
        let other = of(&turned);
        let close = |a: f64, b: f64| (a * unit - b).abs() < 1e-9;
        prop_assert!(close(plain.mu, other.mu) && close(plain.mu_star, other.mu_star));
        prop_assert!(close(plain.sigma, other.sigma) && close(plain.noise, other.noise));
        prop_assert!(plain.mu_star >= plain.mu.abs() - 1e-12);
        // One trajectory whose output is shifted by a constant.
        let (points, order) = (vec![vec![0.9, 1.1], vec![1.1, 1.1], vec![1.1, 0.9]], [0, 1]);
        let values = [effects[0][0], effects[0][1], effects[0][2]];
        let moved = values.map(|v| v + constant);
        let pairs = [values, moved].map(|v| elementary_effects(&points, &order, &v));
        prop_assert!(pairs[0].iter().zip(&pairs[1]).all(|(a, b)| (a - b).abs() < 1e-9));
    }
}
