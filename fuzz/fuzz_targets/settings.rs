//! Any text is settings or an error: `cargo +nightly fuzz run settings`.
#![no_main]

use manylight::Settings;

// Each line is `PATH=VALUE`, as behind `--set`.
libfuzzer_sys::fuzz_target!(|text: &str| {
    let mut settings = Settings::default();
    for (path, value) in text.lines().filter_map(|line| line.split_once('=')) {
        let before = settings.clone();
        if let Err(e) = settings.set(path, value) {
            assert!(!e.to_string().contains('\n'));
            assert_eq!(settings, before);
        }
    }
    if let Err(e) = settings.validate() {
        assert!(!e.to_string().contains('\n'));
    }
});
