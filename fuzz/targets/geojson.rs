//! Polygons, as masks of a small grid and as obstacles of routes on it.
#![no_main]

use sastrugi_fuzz::file;
use sastrugi_numeric::Geometry;
use sastrugi_stages::operations::masks::obstacles;
use sastrugi_stages::operations::place::Place;
use sastrugi_store::mask;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let path = file("a.geojson", bytes);
    let geometry = Geometry::square(20, 30, 0.5);
    let _ = mask::read(&path, &geometry);
    let _ = obstacles(&geometry, &Place::of(&geometry, &geometry), &path);
});
