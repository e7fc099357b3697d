//! The program as a user meets it: exit codes, one-sentence errors, files.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A folder of its own for one test, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path =
            std::env::temp_dir().join(format!("manylight-cli-{}-{name}", std::process::id()));
        std::fs::create_dir_all(&path).expect("temporary folder");
        Self(path)
    }

    fn file(&self, name: &str) -> String {
        self.0.join(name).display().to_string()
    }

    /// A picture of 2 × 2 pixels.
    fn pfm(&self, name: &str, values: [f32; 12]) -> String {
        let raster =
            manylight_image::Raster { width: 2, height: 2, channels: 3, data: values.into() };
        manylight_image::write_pfm(&raster, &self.0.join(name)).expect("temporary file");
        self.file(name)
    }

    fn write(&self, name: &str, text: &str) -> String {
        std::fs::write(self.0.join(name), text).expect("temporary file");
        self.file(name)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn manylight(args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_manylight"));
    // Software drivers complain on standard error where it is not set.
    command.env("XDG_RUNTIME_DIR", std::env::temp_dir());
    command.args(args).output().expect("the program runs")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Quick settings for pictures nobody looks at.
const QUICK: [&str; 6] = ["--size", "48x32", "--set", "vpls.count=500", "--set", "shadow.rays=1"];

#[test]
fn render_and_compare_go_together() {
    let folder = Folder::new("render");
    let (exr, png, heat) = (folder.file("a.exr"), folder.file("a.png"), folder.file("h.png"));
    let args = ["render", "builtin:cornell", "-o", &exr, "-o", &png, "--heatmap", &heat, "--json"];
    let output = manylight(&[&args[..], &QUICK].concat());
    assert!(output.status.success(), "{}", text(&output.stderr));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON alone");
    assert_eq!(report["size"], serde_json::json!([48, 32]));
    assert!(report["stages"].as_array().is_some_and(|s| s.len() >= 5));
    assert!(report["backend"].is_string() && report["device"].is_string(), "{report}");
    assert_eq!(report["files"], serde_json::json!([exr, png, heat]));
    assert!(report["times"]["open_device_ms"].is_number() && report["warning"].is_null());
    let exposure_ev = report["exposure_ev"].as_f64().expect("a number") as f32;
    for path in [&exr, &png, &heat] {
        assert!(Path::new(path).metadata().is_ok_and(|m| m.len() > 500), "{path}");
    }

    let picture = manylight_image::read_exr(Path::new(&exr)).expect("our own file");
    let layers = "Albedo N P depth direct emission evals indirect indirect_unshadowed shadow_ratio";
    for layer in layers.split(' ') {
        assert!(picture.layers.iter().any(|l| l.0 == layer), "{layer} is missing");
    }
    let told = |key: &str| {
        let found = picture.metadata.iter().find(|m| m.0 == format!("manylight.{key}"));
        &found.unwrap_or_else(|| panic!("{key} is missing")).1
    };
    "settings seed sceneHash deviceFeatures version worldFromCamera".split(' ').for_each(|key| {
        told(key);
    });
    assert_eq!(report["backend"], told("backend").as_str());
    assert_eq!(report["device"], told("device").as_str());
    assert_eq!(told("exposureEv").parse(), Ok(exposure_ev));
    assert_eq!(told("projection"), "perspective");
    assert!(told("vfovRad").parse::<f32>().is_ok_and(|v| v > 0.1 && v < 2.0));

    // The exposure that was found makes the same picture.
    let again = folder.file("again.png");
    let fixed = format!("film.exposure_ev={exposure_ev}");
    let args = ["render", "builtin:cornell", "-q", "-o", &again, "--set", &fixed];
    assert!(manylight(&[&args[..], &QUICK].concat()).status.success());
    assert!(std::fs::read(&again).expect("picture") == std::fs::read(&png).expect("picture"));

    let same = manylight(&["compare", &exr, &exr, "--max-flip", "0", "--max-bias", "0"]);
    assert_eq!(same.status.code(), Some(0), "{}", text(&same.stderr));
    let other = folder.file("b.exr");
    let args = ["render", "builtin:cornell", "-q", "-o", &other, "--method", "direct"];
    assert!(manylight(&[&args[..], &QUICK].concat()).status.success());
    let worse = manylight(&["compare", &other, &exr, "--max-bias", "0.01"]);
    assert_eq!(worse.status.code(), Some(1), "{}", text(&worse.stdout));
    let mixed = manylight(&["compare", &png, &exr]);
    assert_eq!(mixed.status.code(), Some(2));
    assert!(text(&mixed.stderr).contains("tone-mapped"), "{}", text(&mixed.stderr));
    let beauty = manylight(&["compare", &exr, &exr, "--layer", "beauty", "--max-flip", "0"]);
    assert_eq!(beauty.status.code(), Some(0), "{}", text(&beauty.stderr));
    let layer = manylight(&["compare", &exr, &exr, "--layer", "glory"]);
    assert_eq!(layer.status.code(), Some(2));
    assert!(text(&layer.stderr).contains("shadow_ratio"), "{}", text(&layer.stderr));
}

#[test]
fn the_same_seed_writes_the_same_picture_at_any_thread_count() {
    let folder = Folder::new("seed");
    let beauty = |threads: &str| {
        let path = folder.file(&format!("{threads}.pfm"));
        let args = ["render", "builtin:cornell", "-q", "-o", &path, "--threads", threads];
        assert!(manylight(&[&args[..], &QUICK].concat()).status.success());
        std::fs::read(path).expect("picture")
    };
    let one = beauty("1");
    assert!(one == beauty("2") && one == beauty("7"));
}

/// The Cornell box with a camera that moves a little.
const MOVING: &str = r#"{"scene": "builtin:cornell", "camera": {
    "position": [0, 1, 3.4], "target": [0, 1, 0], "vfov_deg": 40,
    "keys": [{"frame": 8, "position": [0.1, 1, 3.4]}]}}"#;

/// Frames of the moving shot, by a run with more options; the bytes of each.
fn frames(folder: &Folder, name: &str, range: &str, more: &[&str]) -> Vec<Vec<u8>> {
    let shot = folder.write("moving.json", MOVING);
    let out = folder.file(&format!("{name}-###.pfm"));
    let args = ["render", &shot, "-o", &out, "--frames", range, "--backend", "cpu"];
    let output = manylight(&[&args[..], &QUICK, more].concat());
    assert!(output.status.success(), "{}", text(&output.stderr));
    let read =
        |n: u32| std::fs::read(folder.file(&format!("{name}-{n:03}.pfm"))).unwrap_or_default();
    (0..4).map(read).collect()
}

#[test]
fn frames_of_a_sequence_are_the_same_in_any_run() {
    let folder = Folder::new("sequence");
    let whole = frames(&folder, "whole", "0..3", &[]);
    assert!(whole.iter().all(|frame| frame.len() > 500) && whole[0] != whole[1]);
    let single = folder.file("single.pfm");
    let args = ["render", &folder.file("moving.json"), "-q", "-o", &single, "--backend", "cpu"];
    assert!(manylight(&[&args[..], &QUICK].concat()).status.success());
    assert!(std::fs::read(single).expect("picture") == whole[0], "frame 0 is the shot");
    frames(&folder, "parts", "2..3", &[]);
    assert!(frames(&folder, "parts", "0..1", &[]) == whole);

    // Finished frames are kept, unless they are to be overwritten.
    folder.write("parts-001.pfm", "mine");
    assert_eq!(frames(&folder, "parts", "0..3", &[])[1], b"mine");
    assert!(frames(&folder, "parts", "0..3", &["--overwrite"]) == whole);
}

#[test]
fn frames_that_add_up_are_the_same_after_the_same_frames() {
    let folder = Folder::new("added");
    let temporal = ["--set", "filter.temporal=true"];
    let whole = frames(&folder, "whole", "0..3", &temporal);
    assert!(whole == frames(&folder, "again", "0..3", &temporal));
    // A run that begins later renders those before, or not.
    frames(&folder, "resumed", "2..3", &temporal);
    std::fs::remove_file(folder.file("resumed-002.pfm")).expect("removed");
    assert!(frames(&folder, "resumed", "0..3", &temporal) == whole);
    let cold = frames(&folder, "cold", "3..3", &[&temporal[..], &["--warm-up", "1"]].concat());
    assert!(cold[3].len() > 500 && cold[3] != whole[3] && cold[2].is_empty());
    let alone = frames(&folder, "alone", "0..3", &[]);
    assert!(whole[0] == alone[0] && whole[1] != alone[1]);
}

#[test]
fn frames_report_a_line_each() {
    let folder = Folder::new("lines");
    let out = folder.file("a.png");
    let args = ["render", "builtin:cornell", "-o", &out, "--frames", "3..4", "--json"];
    let output = manylight(&[&args[..], &QUICK].concat());
    let lines: Vec<serde_json::Value> = text(&output.stdout)
        .lines()
        .map(|line| serde_json::from_str(line).expect("JSON"))
        .collect();
    assert_eq!(lines.iter().map(|l| l["frame"].as_u64()).collect::<Vec<_>>(), [Some(3), Some(4)]);
    assert!(Path::new(&folder.file("a.0003.png")).exists() && !Path::new(&out).exists());
    assert_eq!(lines[1]["files"], serde_json::json!([folder.file("a.0004.png")]));

    // Exposures that may differ are told once, with a way to keep the first.
    let message = text(&output.stderr);
    let setting = message.split("--set ").nth(1).expect(&message).trim();
    assert_eq!(message.lines().count(), 1, "{message}");
    let ev = setting.strip_prefix("film.exposure_ev=").map(str::parse::<f32>);
    assert_eq!(ev, lines[0]["exposure_ev"].as_f64().map(|ev| Ok(ev as f32)), "{setting}");
    let more = ["--overwrite", "--set", setting];
    let fixed = manylight(&[&args[..], &QUICK, &more].concat());
    assert!(fixed.status.success() && fixed.stderr.is_empty(), "{}", text(&fixed.stderr));
}

#[test]
fn a_render_tells_what_it_wrote_and_where_it_ran() {
    let folder = Folder::new("told");
    let out = folder.file("a.png");
    let args = ["render", "builtin:cornell", "--backend", "cpu", "--threads", "2"];
    let told = text(&manylight(&[&args[..], &["-o", &out], &QUICK].concat()).stderr);
    for part in ["open device", "cpu: 2 threads; exposure ", "EV, automatic", &out] {
        assert!(told.contains(part), "{part}: {told}");
    }
    let nothing = manylight(&[&args[..], &QUICK].concat());
    assert!(nothing.status.success() && text(&nothing.stderr).contains("nothing was written"));
}

#[test]
fn a_shot_is_described_before_it_is_rendered() {
    let folder = Folder::new("info");
    let shot = folder.write("moving.json", MOVING);
    let output = manylight(&["info", &shot, "--json"]);
    let told: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON alone");
    assert_eq!(told["position"], serde_json::json!([0.0, 1.0, 3.4]));
    assert!(told["direction"][2].as_f64().is_some_and(|z| (z + 1.0).abs() < 1e-6), "{told}");
    assert_eq!(told["vfov_deg"].as_f64().map(f64::round), Some(40.0));
    assert_eq!(told["size"], serde_json::json!([1280, 720]));
    let bounds = &told["bounds_m"];
    assert!(bounds[0][0].as_f64() < Some(-0.5) && bounds[1][1].as_f64() > Some(1.5), "{bounds}");
    let names = told["material_names"].as_array().expect("a list");
    assert_eq!(Some(names.len() as u64), told["materials"].as_u64());
    let plain = manylight(&["info", &shot]);
    assert!(plain.stderr.is_empty() && text(&plain.stdout).contains("material names"));
}

#[test]
fn bad_input_is_one_sentence_and_exit_code_2() {
    let folder = Folder::new("bad");
    let out = folder.file("out.png");
    let heat = folder.file("heat.png");
    let unknown_key = folder.write("key.json", r#"{"scene":"builtin:cornell","camra":{}}"#);
    let unknown_setting =
        folder.write("set.json", r#"{"scene":"builtin:cornell","settings":{"grid":{"alfa":1}}}"#);
    let empty = folder.write("empty.glb", "");
    let noise = folder.write("noise.gltf", "\u{1}\u{2}{{{");
    let wrong_value = folder
        .write("value.json", r#"{"scene":"builtin:cornell","settings":{"vpls":{"count":-1}}}"#);
    let text_file = folder.write("text.exr", "hello");
    let dark = folder.pfm("dark.pfm", [0.0; 12]);
    let lost = folder.pfm("lost.pfm", [f32::NAN; 12]);
    let wide = folder.write("wide.pfm", "Pf\n3 1\n-1.0\n0123456789ab");
    let missing_folder = folder.file("no/such/folder/a.png");
    let own_folder = folder.0.display().to_string();
    let folder_png = folder.file("folder.png");
    std::fs::create_dir(&folder_png).expect("a folder");
    let same = format!("{own_folder}/../{}/out.png", folder.0.file_name().unwrap().display());
    let long_name = folder.file(&format!("{}.png", "n".repeat(300)));
    let huge_path = format!("{}=1", "a.".repeat(50_000));
    let dumped = folder.file("no/rays");
    let cornell = "builtin:cornell";
    let cases: Vec<(Vec<&str>, &str)> = vec![
        (vec!["render", "no-such.glb", "-o", &out], "no-such.glb"),
        (vec!["render", "builtin:nothing", "-o", &out], "atrium"),
        (vec!["render", &unknown_key, "-o", &out], "camra"),
        (vec!["render", &unknown_setting, "-o", &out], "grid.alfa"),
        (vec!["render", &empty, "-o", &out], "empty.glb"),
        (vec!["render", &noise, "-o", &out], "noise.gltf"),
        (vec!["render", cornell, "-o", &missing_folder], "folder"),
        (vec!["render", cornell, "-o", "/proc/a.png"], "/proc/a.png"),
        (vec!["render", cornell, "-o", "a.bmp"], ".exr or .png"),
        (vec!["render", cornell, "-o", "/dev/full"], ".exr or .png"),
        (vec!["render", cornell, "-o", &folder_png], "it is a folder"),
        (vec!["render", cornell, "-o", &long_name], "choose a shorter name"),
        (vec!["render", cornell, "-o", &out, "-o", &out], "named twice"),
        (vec!["render", cornell, "-o", &out, "-o", &same], "named twice"),
        (vec!["render", cornell, "-o", &out, "--heatmap", &out], "named twice"),
        (vec!["render", "", "-o", &out], "the name is empty"),
        (vec!["render", &own_folder, "-o", &out], "not a file"),
        (vec!["render", &wrong_value, "-o", &out], "value.json: setting vpls.count: -1 found"),
        (vec!["render", cornell, "-o", &out, "--size", "0x4"], "--size 0x4"),
        (vec!["render", cornell, "-o", &out, "--size", "999999x999999"], "pixels"),
        (vec!["render", cornell, "-o", &out, "--size", "big"], "WIDTHxHEIGHT"),
        (vec!["render", cornell, "-o", &out, "--threads", "0"], "--threads 0"),
        (vec!["render", cornell, "-o", &out, "--threads", "100000"], "use 1 to 1024"),
        (vec!["render", cornell, "-o", &out, "--method", "magic"], "magic"),
        (vec!["render", cornell, "-o", &out, "--preset", "best"], "balanced"),
        (vec!["render", cornell, "-o", &out, "--set", "grid.alpha"], "PATH=VALUE"),
        (vec!["render", cornell, "-o", &out, "--set", "grid.alpha=0"], "grid.alpha"),
        (vec!["render", cornell, "-o", &out, "--set", "grid.alpha=-1"], "grid.alpha"),
        (vec!["render", cornell, "-o", &out, "--set", "grid.alpha=NaN"], "grid.alpha"),
        (vec!["render", cornell, "-o", &out, "--set", "vpls.count=0"], "vpls.count"),
        (vec!["render", cornell, "-o", &out, "--set", "vpls.count=1e12"], "vpls.count"),
        (vec!["render", cornell, "-o", &out, "--set", "no.such=1"], "no"),
        (vec!["render", cornell, "-o", &out, "--set", &huge_path], "setting a: unknown"),
        (vec!["render", cornell, "-o", &out, "--set", "grid.al\nfa\u{1b}[2J=1"], "unknown"),
        (vec!["render", cornell, "-o", &out, "--method", "a\nb"], "one of `grid`"),
        (vec!["render", cornell, "--quiet"], "name a file"),
        (vec!["render", cornell, "--heatmap", &heat, "--method", "path"], "--heatmap"),
        (vec!["render", cornell, "-o", &out, "--set", "=5"], "PATH=VALUE"),
        (vec!["render", cornell, "-o", &out, "--size", "-5x10"], "--size -5x10"),
        (vec!["bench", cornell, "--dump-rays", &dumped], "--rays"),
        (vec!["render", cornell, "--no-such"], "--no-such"),
        (vec!["render", cornell, "-o", &out, "--frames", "5..3"], "--frames 5..3: write FIRST"),
        (vec!["render", cornell, "-o", &out, "--frames", "-1..3"], "--frames -1..3"),
        (vec!["render", cornell, "-o", &out, "--frames", "7"], "for example 0..47"),
        (vec!["render", cornell, "-o", &out, "--overwrite"], "--frames"),
        (vec!["render", cornell, "-o", &out, "--warm-up", "3"], "--frames"),
        (
            vec![
                "render",
                cornell,
                "-o",
                &out,
                "--set",
                "filter.temporal=true",
                "--set",
                "film.samples=2",
            ],
            "filter.temporal: true goes with one sample",
        ),
        (vec!["bench", cornell, "--frames", "0"], "0 is not in 1..=10000"),
        (vec!["bench", cornell, "--quality", "9", "--rays"], "cannot be used with"),
        (vec!["compare", "no-a.exr", "no-b.exr"], "no-a.exr"),
        (vec!["compare", &dark, &text_file], "text.exr"),
        (vec!["compare", &dark, &own_folder], "directory"),
        (vec!["compare", &dark, &wide], "render both at one size"),
        (vec!["compare", &dark, &lost], "no pixel is finite"),
        (vec!["compare", &dark, &dark, "--layer", "direct"], "its layers: beauty"),
        (vec!["compare", &dark, &dark, "--max-flip", "nan"], "--max-flip NaN"),
        (vec!["compare", &dark, &dark, "--max-bias=-1"], "0 or more"),
        (vec!["compare", &dark, &dark, "-o", &missing_folder], "folder"),
        (vec!["info", &empty], "empty.glb"),
        (vec!["info", &unknown_setting], "grid.alfa"),
        (vec!["info", &wrong_value], "vpls.count: -1 found"),
        (vec!["info", cornell, "--camera", "a"], "--camera: the scene has no camera \"a\""),
        (vec!["render", cornell, "-o", &out, "--camera", "7"], "by name or number it has: builtin"),
        (vec!["bench", cornell, "--quality", "0"], "use 1 to"),
        (vec!["bench", cornell, "--quality", "18446744073709551615"], "use 1 to"),
        (vec!["bench", cornell, "--rays", "--dump-rays", &dumped], "folder"),
        (vec!["bench", cornell, "--set", "vpls.bounces=0"], "vpls.bounces"),
    ];
    for (args, expected) in cases {
        let output = manylight(&args);
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {message}");
        assert!(message.contains(expected), "{args:?}: {message}");
        assert_eq!(message.trim_end().lines().count(), 1, "{args:?}: {message}");
        assert!(!message.contains("panicked"), "{args:?}: {message}");
        assert!(!Path::new(&out).exists(), "{args:?} left a picture");
    }
    let left: Vec<_> = std::fs::read_dir(&folder.0).expect("folder").flatten().collect();
    assert_eq!(left.len(), 10, "only the inputs remain: {left:?}");
}

#[test]
fn a_picture_with_lost_pixels_meets_no_limit() {
    let folder = Folder::new("lost");
    let whole = folder.pfm("whole.pfm", [0.5; 12]);
    let mut values = [0.5; 12];
    values[4] = f32::INFINITY;
    let damaged = folder.pfm("damaged.pfm", values);
    assert!(manylight(&["compare", &damaged, &whole]).status.success());
    let judged = manylight(&["compare", &damaged, &whole, "--max-flip", "1"]);
    assert_eq!(judged.status.code(), Some(1));
    assert!(text(&judged.stderr).contains("1 pixels are not finite"), "{}", text(&judged.stderr));
}

#[test]
fn a_camera_that_sees_nothing_makes_a_black_picture_with_a_warning() {
    let folder = Folder::new("black");
    // The room is closed: from inside the floor and from outside, looking away, all is dark.
    let away = r#"{"position": [0, 1, 90], "target": [0, 1, 99], "vfov_deg": 40}"#;
    let in_wall = r#"{"position": [0, -0.001, 0], "target": [0, -1, 0.1], "vfov_deg": 40}"#;
    for (name, camera) in [("away", away), ("in_wall", in_wall)] {
        let shot = format!(r#"{{"scene": "builtin:cornell", "camera": {camera}}}"#);
        let shot = folder.write(&format!("{name}.json"), &shot);
        for method in ["grid", "brute", "path", "direct"] {
            let out = folder.file(&format!("{name}-{method}.png"));
            let args = ["render", &shot, "-o", &out, "--method", method, "--set", "path.spp=1"];
            let output = manylight(&[&args[..], &QUICK].concat());
            let message = text(&output.stderr);
            assert!(output.status.success() && Path::new(&out).exists(), "{message}");
            assert!(message.contains("warning: the picture is black"), "{name}: {message}");
        }
    }
    let args = ["render", &folder.file("away.json"), "-q", "--json"];
    let output = manylight(&[&args[..], &QUICK].concat());
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON alone");
    assert!(report["warning"].as_str().is_some_and(|w| w.contains("sees no surface")), "{report}");
    assert!(output.stderr.is_empty());
}

/// Every way a full disk shows itself: nothing half-written, the earlier picture kept.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_leaves_the_earlier_picture() {
    let folder = Folder::new("full");
    let out = folder.write("out.exr", "earlier");
    let link = folder.file("link.png");
    std::os::unix::fs::symlink("/dev/full", &link).expect("a link");
    let program = env!("CARGO_BIN_EXE_manylight");
    let sized = r#"trap '' XFSZ; ulimit -f 8; exec "$@""#; // files end after 4 or 8 KiB
    let plain = r#"exec "$@""#;
    let cases = [
        (sized, vec!["render", "builtin:cornell", "-q", "-o", &out], "cannot write"),
        (plain, vec!["render", "builtin:cornell", "-q", "-o", &link], "No space left"),
        (r#"exec "$@" > /dev/full"#, vec!["info", "builtin:cornell"], "cannot print the result"),
    ];
    for (script, args, expected) in cases {
        let quick: &[&str] = if args[0] == "render" { &QUICK } else { &[] };
        let output = Command::new("sh")
            .args(["-c", script, "sh", program])
            .args(args)
            .args(quick)
            .output()
            .expect("a shell");
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{script}: {message}");
        assert!(message.contains(expected), "{script}: {message}");
        assert_eq!(message.trim_end().lines().count(), 1, "{message}");
        assert_eq!(std::fs::read(&out).expect("the earlier file"), b"earlier");
    }
    assert_eq!(std::fs::read_dir(&folder.0).expect("folder").count(), 2, "no temporary file");
}

#[test]
fn lists_print_text_and_json() {
    for command in [vec!["methods"], vec!["devices"], vec!["info", "builtin:many_lamps"]] {
        let plain = manylight(&command);
        assert!(plain.status.success() && !plain.stdout.is_empty());
        let json = manylight(&[&command[..], &["--json"]].concat());
        let value: serde_json::Value = serde_json::from_slice(&json.stdout).expect("JSON alone");
        assert!(value.as_object().is_some_and(|m| !m.is_empty()));
    }
    assert!(text(&manylight(&["methods"]).stdout).contains("brute"));
    assert!(manylight(&["--help"]).status.success());
    assert!(manylight(&["render", "--help"]).status.success());
    assert_eq!(manylight(&["frobnicate"]).status.code(), Some(2));
}

#[test]
fn bench_measures_time_and_quality() {
    let quick =
        ["--set", "vpls.count=2000", "--set", "shadow.rays=48", "--size", "64x48", "--json"];
    let output =
        manylight(&[&["bench", "builtin:cornell", "--quality", "20"], &quick[..]].concat());
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let rmse = report[0]["report"]["shadowed_rmse"].as_f64().expect("number");
    assert!(rmse > 0.0 && rmse < 0.5, "{rmse}");
    let output = manylight(&[&["bench", "builtin:cornell", "--frames", "1"], &quick[..]].concat());
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert!(report[0]["report"]["frame"]["median_ms"].as_f64().is_some_and(|ms| ms > 0.0));

    let scenes = ["bench", "builtin:cornell", "builtin:cornell", "--frames", "1"];
    let table = text(&manylight(&[&scenes[..], &quick[..6]].concat()).stdout);
    let heads = table
        .lines()
        .filter(|l| l.split_whitespace().eq("stage median ms p10 ms p90 ms".split(' ')));
    assert_eq!(heads.count(), 2, "{table}");
    let numbers: Vec<_> = table.lines().filter(|l| l.starts_with("  frame")).collect();
    let digits =
        |l: &&str| l.split_whitespace().skip(1).all(|n| n.parse::<f64>().is_ok() && n.len() < 9);
    assert!(numbers.len() == 2 && numbers.iter().all(digits), "{table}");
    assert!(!table.contains(['{', '[']) && table.contains("peak_memory_mib"), "{table}");
}
