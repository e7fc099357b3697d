//! What documents say of shots is what the program takes.

use manylight::Settings;
use manylight_scene::{load, parse_shot_text};
use std::path::Path;

fn read(document: &str) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    std::fs::read_to_string(root.join(document)).expect("a document of the repository")
}

/// The blocks of a document in one language.
fn blocks(text: &str, language: &str) -> Vec<String> {
    let parts = text.split("\n```").skip(1).step_by(2);
    let named = parts.filter_map(|part| part.strip_prefix(language)?.strip_prefix('\n'));
    named.map(str::to_owned).collect()
}

#[test]
fn every_shot_in_a_document_is_one() {
    for (document, count) in [("docs/SHOTS.md", 2), ("README.md", 1)] {
        let shots = blocks(&read(document), "json");
        assert_eq!(shots.len(), count, "{document}");
        for text in shots {
            let shot = parse_shot_text(document, &text).expect("a shot");
            let mut settings = Settings::default();
            settings.apply(&shot.settings).expect("settings");
            settings.validate().expect("values within their ranges");
            if shot.scene.starts_with("builtin:") {
                let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join("documented.json");
                std::fs::write(&file, &text).expect("a temporary file");
                let shot = load(&file.display().to_string()).expect("a shot of a scene");
                assert_eq!(shot.camera.size_px, Some([960, 540]));
            }
        }
    }
}

/// The keys that a shot takes are those that it names where it refuses another one.
#[test]
fn every_key_of_a_shot_is_documented() {
    let document = read("docs/SHOTS.md");
    let camera = r#"{"position": [0, 0, 0], "target": [0, 0, 1], "vfov_deg": 9"#;
    let mut shots = vec![
        r#"{"no": 1}"#.to_owned(),
        r#"{"scene": "a", "camera": {"no": 1}}"#.to_owned(),
        format!(r#"{{"scene": "a", "camera": {camera}, "keys": [{{"no": 1}}]}}}}"#),
    ];
    for kind in ["sun", "point", "spot", "area", "emissive", "sky"] {
        assert!(document.contains(&format!("| `{kind}` |")), "{kind}");
        let light = format!(r#"{{"type": "{kind}", "no": 1}}"#);
        shots.push(format!(r#"{{"scene": "a", "lights": [{light}]}}"#));
    }
    let mut count = 0;
    for shot in shots {
        let message = parse_shot_text("a", &shot).expect_err(&shot).to_string();
        let allowed = message.split("unknown key; allowed: ").nth(1).expect(&message);
        for key in allowed.split(", ") {
            assert!(document.contains(&format!("`{key}`")), "{key}");
            count += 1;
        }
    }
    assert!(count > 40, "{count}");
    let message = parse_shot_text("a", r#"{"scene": "a", "lights": [{"type": ""}]}"#);
    let message = message.expect_err("no type").to_string();
    assert!(message.ends_with("allowed: sun, point, spot, area, sky, emissive"), "{message}");
}

/// The example of the readme is the one that the library's own documentation runs.
#[test]
fn the_program_of_the_readme_is_tested() {
    let library = read("crates/manylight/src/lib.rs");
    let lines = library.lines().skip_while(|l| *l != "//! ```").skip(1);
    let lines = lines.take_while(|l| *l != "//! ```");
    let plain = |line: &str| {
        let line = line.trim_start_matches("//!").trim();
        line.trim_start_matches("# ").to_owned()
    };
    let tested: Vec<String> = lines.map(plain).collect();
    let shown = blocks(&read("README.md"), "rust").concat();
    let shown: Vec<String> = shown.lines().map(|line| line.trim().to_owned()).collect();
    assert_eq!(shown, tested);
}
