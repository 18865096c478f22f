//! Small files in users' folders: vehicles, worlds to serve, and the records of items in a work area. The first byte selects which.
#![no_main]

use sastrugi_fuzz::{file, folder};
use sastrugi_numeric::Geometry;
use sastrugi_stages::operations::place::{PLACE, Place};
use sastrugi_stages::runner::cache::{RECORD, load_record};
use sastrugi_stages::verbs::parameters::{assign_vehicle, vehicle_doubts};
use sastrugi_stages::verbs::served::served;
use serde_json::json;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Some((choice, bytes)) = bytes.split_first() else { return };
    match choice % 5 {
        0 => vehicle("vehicle.json", bytes),
        1 => vehicle("vehicle.toml", bytes),
        2 => drop(served(&file("world.toml", bytes))),
        3 => {
            file(RECORD, bytes);
            load_record(folder());
        }
        _ => place(bytes),
    }
});

fn vehicle(name: &str, bytes: &[u8]) {
    let mut parameters = json!({});
    if assign_vehicle(&mut parameters, &file(name, bytes).to_string_lossy()).is_ok() {
        vehicle_doubts(&parameters);
    }
}

/// A place that is read has its window within the raster, so points are moved without overflow.
fn place(bytes: &[u8]) {
    let heights = Geometry::square(4, 5, 30.0);
    let Ok(place) = Place::read(&file(PLACE, bytes), &heights) else { return };
    place.was_converted(&heights);
    place.from_heights(place.to_heights([1.0, 2.0], &heights), &heights);
}
