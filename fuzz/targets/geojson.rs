//! Polygons, as masks of a small grid.
#![no_main]

use sastrugi_fuzz::file;
use sastrugi_numeric::Geometry;
use sastrugi_store::mask;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = mask::read(&file("a.geojson", bytes), &Geometry::square(20, 30, 0.5));
});
