//! The distributions against `statrs`, as an independent reference.
//!
//! Only a reference: its functions call the C library, whose last bits change with the CPU, so nothing that ends in a file may come from it
//! (see `sastrugi_statistics::normal`). Tolerances allow for its own errors, some 1e-12.

use sastrugi_statistics::{Intraclass, chi_square, normal, proportion, student};
use statrs::distribution::{
    Beta, Binomial, ChiSquared, Continuous, ContinuousCDF, DiscreteCDF, FisherSnedecor, Gamma, Normal, StudentsT,
};

fn close(what: &str, ours: f64, theirs: f64) {
    assert!((ours - theirs).abs() < 1e-10, "{what}: {ours} {theirs}");
}

#[test]
fn val_normal() {
    let theirs = Normal::new(0.0, 1.0).unwrap();
    for k in -60..=60 {
        let x = 0.1 * f64::from(k);
        close("cdf", normal::cdf(x), theirs.cdf(x));
        close("upper tail", normal::cdf(-x), theirs.sf(x));
        close("pdf", normal::pdf(x), theirs.pdf(x));
        close("central", normal::central(x.abs()), statrs::function::erf::erf(x.abs() / std::f64::consts::SQRT_2));
    }
    for k in 1..200 {
        let p = f64::from(k) / 200.0;
        close("quantile", theirs.cdf(normal::quantile(p)), p);
    }
}

#[test]
fn val_student() {
    for freedom in [1.0, 2.5, 7.0, 38.6, 300.0] {
        let theirs = StudentsT::new(0.0, 1.0, freedom).unwrap();
        for k in -40..=40 {
            let t = 0.25 * f64::from(k);
            close("cdf", student::cdf(t, freedom), theirs.cdf(t));
        }
        for p in [0.005, 0.025, 0.3, 0.5, 0.9, 0.975] {
            close("quantile", theirs.cdf(student::quantile(p, freedom)), p);
        }
    }
}

/// The chi-square distribution, and the gamma distribution that it is.
#[test]
fn val_chi_square_and_gamma() {
    for freedom in 1..=40u32 {
        let theirs = ChiSquared::new(f64::from(freedom)).unwrap();
        let gamma = Gamma::new(0.5 * f64::from(freedom), 0.5).unwrap();
        for k in 1..=60 {
            let x = 1.5 * f64::from(k);
            let ours = chi_square::above(x, freedom as usize);
            close("chi-square", ours, theirs.sf(x));
            close("gamma", ours, gamma.sf(x));
        }
    }
}

/// Clopper and Pearson's ends are quantiles of beta distributions, and by the definition tails of binomial ones.
#[test]
fn val_beta_and_binomial() {
    for (ones, n) in [(1u64, 2u64), (3, 4), (1, 12), (7, 12), (20, 25), (60, 200)] {
        let values: Vec<f64> = (0..n).map(|k| if k < ones { 1.0 } else { 0.0 }).collect();
        let i = proportion::of_shares(&values, 0.95).unwrap();
        let (x, rest) = (ones as f64, (n - ones) as f64);
        close("beta, low", Beta::new(x, rest + 1.0).unwrap().cdf(i.low), 0.025);
        close("beta, high", Beta::new(x + 1.0, rest).unwrap().cdf(i.high), 0.975);
        close("binomial, low", Binomial::new(i.low, n).unwrap().sf(ones - 1), 0.025);
        close("binomial, high", Binomial::new(i.high, n).unwrap().cdf(ones), 0.025);
    }
}

/// The interval of an intraclass correlation, solved for the quantiles of Fisher's distribution that it comes from: six clusters of four.
#[test]
fn val_fisher() {
    let targets =
        [[9., 2., 5., 8.], [6., 1., 3., 2.], [8., 4., 6., 8.], [7., 1., 2., 6.], [10., 5., 6., 9.], [6., 2., 4., 7.]];
    let i = Intraclass::of(&targets.map(|t| t.to_vec()), 0.95).unwrap().correlation;
    // F / F_high = (1 + 3 rho) / (1 - rho) at the low end, F F'_high at the high end, F itself at the estimate.
    let ratio = |rho: f64| (1.0 + 3.0 * rho) / (1.0 - rho);
    let low = ratio(i.estimate) / ratio(i.low);
    let high = ratio(i.high) / ratio(i.estimate);
    close("low", FisherSnedecor::new(5.0, 18.0).unwrap().cdf(low), 0.975);
    close("high", FisherSnedecor::new(18.0, 5.0).unwrap().cdf(high), 0.975);
}
