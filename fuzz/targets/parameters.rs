//! Parameters of terrains and textures: a JSON object with `kind` or `method`.
#![no_main]

use serde_json::Value;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(Value::Object(mut parameters)) = serde_json::from_slice(bytes) else { return };
    if let Some(Value::String(name)) = parameters.remove("method") {
        if let Ok(texture) = sastrugi_texture::method(&name, &Value::Object(parameters)) {
            let stated = texture.parameters();
            assert!(sastrugi_texture::method(&name, &stated).is_ok(), "{stated}");
            assert!(texture.cost().operations >= 0.0);
        }
        return;
    }
    let Some(Value::String(kind)) = parameters.remove("kind") else { return };
    if let Ok(generator) = sastrugi_terrain::prepare(&kind, &Value::Object(parameters)) {
        let stated = generator.parameters();
        assert!(sastrugi_terrain::prepare(&kind, &stated).is_ok(), "{stated}");
        assert!(generator.seconds() >= 0.0);
        generator.memory_bytes();
    }
});
