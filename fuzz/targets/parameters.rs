//! Parameters of terrains: an object of JSON with `kind`.
#![no_main]

use serde_json::Value;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(Value::Object(mut parameters)) = serde_json::from_slice(bytes) else { return };
    let Some(Value::String(kind)) = parameters.remove("kind") else { return };
    if let Ok(generator) = sastrugi_terrain::prepare(&kind, &Value::Object(parameters)) {
        let stated = generator.parameters();
        assert!(sastrugi_terrain::prepare(&kind, &stated).is_ok(), "{stated}");
        assert!(generator.seconds() >= 0.0);
        generator.memory_bytes();
    }
});
