//! Fit files, and the statistics in them.
#![no_main]

use sastrugi_fuzz::file;
use sastrugi_stages::verbs::texture::read_fit;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(fit) = read_fit(&file("fit.json", bytes)) else { return };
    if let Some(statistics) = fit.statistics.filter(|s| s.check().is_ok()) {
        statistics.numbers();
        assert!(statistics.covariance.variance() > 0.0);
    }
});
