//! Any bytes are a scene or an error: `cargo +nightly fuzz run gltf`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    if let Err(e) = manylight_scene::load_gltf_bytes("fuzz.glb", bytes) {
        assert!(!e.to_string().contains('\n'));
    }
});
