//! Any text is a shot or an error: `cargo +nightly fuzz run shot`.
#![no_main]

libfuzzer_sys::fuzz_target!(|text: &str| {
    if let Err(e) = manylight_scene::parse_shot_text("fuzz.json", text) {
        assert!(!e.to_string().contains('\n'));
    }
});
