//! Descriptions of images: sun, camera, photometry and noise. A description that was read is written and read again.
#![no_main]

use sastrugi_fuzz::file;
use sastrugi_stages::operations::photoclinometry::read_description;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(description) = read_description(&file("a.json", bytes)) else { return };
    let written = serde_json::to_vec(&description).expect("finite numbers can be written");
    let again = read_description(&file("b.json", &written)).expect("what was written can be read");
    assert_eq!(again, description);
    let [rows, cols] = description.camera.camera().shape();
    assert!(rows.checked_mul(cols).is_some_and(|pixels| pixels > 0));
});
