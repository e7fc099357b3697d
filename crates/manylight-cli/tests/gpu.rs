//! The graphics device as a user meets it.

use manylight_testing::{skip, skip_without_device};
use serde_json::Value;
use std::process::{Command, Output};

fn manylight(args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_manylight"));
    // Software drivers complain on standard error where it is not set.
    command.env("XDG_RUNTIME_DIR", std::env::temp_dir());
    command.args(args).output().expect("the program runs")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).expect("JSON alone")
}

fn devices() -> Vec<Value> {
    let listed = json(&manylight(&["devices", "--json"]));
    listed["gpu"].as_array().expect("a list").clone()
}

/// Whether there is a device that can render; without one the test at hand is skipped.
fn has_device() -> bool {
    find_device().is_some()
}

/// The first device that can render; without one the test at hand is skipped.
fn find_device() -> Option<Value> {
    let device = devices().into_iter().find(|device| device["lacks"].is_null());
    if device.is_none() {
        skip_without_device("there is no graphics device");
    }
    device
}

/// The first that the processor does the work of: there its time and memory are known.
fn find_emulated_device() -> Option<Value> {
    find_device()?;
    let is_emulated = |device: &Value| device["lacks"].is_null() && device["kind"] == "software";
    let device = devices().into_iter().find(is_emulated);
    if device.is_none() {
        skip("no graphics device here is emulated");
    }
    device
}

/// The setting that chooses it.
fn setting_of(device: &Value) -> String {
    format!("gpu.device=#{}", device["number"])
}

/// One sentence on standard error, and exit code 2.
fn assert_refused(args: &[&str], parts: &[&str]) {
    let output = manylight(args);
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{args:?}: {message}");
    assert_eq!(message.trim_end().lines().count(), 1, "{args:?}: {message}");
    parts.iter().for_each(|part| assert!(message.contains(part), "{args:?}: {message}"));
    assert!(!message.contains("panicked") && output.stdout.is_empty(), "{args:?}: {message}");
}

const RENDER: [&str; 8] =
    ["render", "builtin:cornell", "--size", "16x9", "--set", "vpls.count=200", "--backend", "gpu"];

#[test]
fn devices_say_what_they_are() {
    let listed = json(&manylight(&["devices", "--json"]));
    assert!(listed["cpu"].as_str().is_some_and(|cpu| cpu.contains("threads")));
    for device in devices() {
        for key in ["name", "kind", "backend", "driver"] {
            assert!(device[key].is_string(), "{key}: {device}");
        }
        for key in ["max_binding", "max_buffer", "workgroup_memory"] {
            assert!(device[key].as_u64().is_some_and(|n| n > 0), "{key}: {device}");
        }
        for key in ["subgroups", "half", "timestamps", "large_limits", "ray_queries", "bindless"] {
            assert!(device["features"][key].is_boolean(), "{key}: {device}");
        }
        assert!(device["lacks"].is_null() || device["lacks"].is_string(), "{device}");
    }
}

#[test]
fn an_emulated_device_renders_only_where_it_is_named() {
    if devices().iter().any(|device| device["kind"] != "software") {
        skip("there is a graphics device that is not emulated");
        return;
    }
    assert_refused(&RENDER, &["no graphics device", "--backend cpu"]);
    if !devices().is_empty() {
        assert_refused(&RENDER, &["software drivers", "--set gpu.device="]);
    }
}

#[test]
fn a_device_that_is_not_there_is_named_with_those_that_are() {
    let args = [&RENDER[..], &["--set", "gpu.device=nonexistent"]].concat();
    let devices = devices();
    if devices.is_empty() {
        assert_refused(&args, &["no graphics device found"]);
        return;
    }
    let names: Vec<_> = devices.iter().filter_map(|device| device["name"].as_str()).collect();
    assert_refused(&args, &[&["\"nonexistent\"", "found:"][..], &names].concat());
    let args = ["diff-stages", "builtin:cornell", "--set", "gpu.device=nonexistent"];
    assert_refused(&args, &names);
}

#[test]
fn a_device_is_chosen_by_its_number_too() {
    let devices = devices();
    for device in devices.iter().filter(|device| device["lacks"].is_null()) {
        let set = setting_of(device);
        let device = device["name"].as_str().expect("a name");
        let quick = ["--size", "16x9", "--frames", "1", "--set", "vpls.count=200", "--json"];
        let args = ["bench", "builtin:cornell", "--backend", "gpu", "--set", &set];
        let output = manylight(&[&args[..], &quick].concat());
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        let used = json(&output)[0]["report"]["device"].to_string();
        assert!(used.contains(device), "{set}: {used}");
    }
    let none = format!("gpu.device=#{}", devices.len() + 1);
    let args = [&RENDER[..], &["--set", &none]].concat();
    let expected =
        if devices.is_empty() { "no graphics device found" } else { "no graphics device #" };
    assert_refused(&args, &[expected]);
}

#[test]
fn the_processor_takes_over_from_a_device_that_is_not_done_in_time() {
    let Some(device) = find_emulated_device() else { return };
    let few = ["builtin:cornell", "--size", "64x36", "--set", "gpu.timeout=0.001"];
    let device = setting_of(&device);
    let few = [&few[..], &["--set", &device]].concat();
    let bench = [&["bench"], &few[..], &["--frames", "2", "--backend"]].concat();
    for kind in [&[][..], &["--rays"]] {
        let output = manylight(&[&bench[..], &["auto", "--json"], kind].concat());
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        let used = json(&output)[0]["report"]["device"].to_string();
        assert!(used.contains("threads"), "{used}");
    }
    let render = [&["render"], &few[..], &["--backend", "auto"]].concat();
    assert!(text(&manylight(&render).stderr).contains("the processor takes over"));
    let late = ["is not done after 0.001 s; render with --backend cpu"];
    assert_refused(&[&bench[..], &["gpu"]].concat(), &late);
    // What the processor would not keep it is not asked for.
    assert_refused(&[&bench[..], &["auto", "--static"]].concat(), &late);
}

#[cfg(debug_assertions)]
#[test]
fn what_a_wrong_shader_leaves_behind_is_told() {
    let Some(device) = find_device() else { return };
    let device = setting_of(&device);
    let file = "composite/beauty.wgsl";
    let sources = concat!(env!("CARGO_MANIFEST_DIR"), "/../manylight/src");
    let right = std::fs::read_to_string(format!("{sources}/{file}")).expect("a shader");
    let folder = std::env::temp_dir().join(format!("manylight-wrong-{}", std::process::id()));
    std::fs::create_dir_all(folder.join("composite")).expect("a folder");
    let shaders = format!("gpu.shaders={}", folder.display());
    let args = [&RENDER[..], &["--set", &device, "--set", &shaders]].concat();
    let no_number = "bitcast<f32>(0x7fc00000u | index)";
    for (wrong, faults) in [(no_number, ": 432 numbers"), ("vec3f(-9.0)", ": 0 numbers")] {
        let text = right.replace("emissions[index].rgb, 1.0", &format!("{wrong}, 1.0"));
        assert_ne!(text, right);
        std::fs::write(folder.join(file), text).expect("written");
        assert_refused(&args, &[faults, "of the list of picture are not finite", "below zero"]);
    }
    std::fs::remove_dir_all(folder).expect("removed");
}

/// An emulated device has the memory of its process, which a shell can bound. With too little even
/// the program itself ends; with a little more it is the device that has no room.
#[cfg(target_os = "linux")]
#[test]
fn a_device_without_memory_is_a_sentence() {
    let Some(device) = find_emulated_device() else { return };
    let device = setting_of(&device);
    let mut said = Vec::new();
    for most in (12..60).step_by(3) {
        let output = Command::new("sh")
            .args(["-c", &format!("ulimit -v {most}00000 && exec \"$@\""), "sh"])
            .args([
                env!("CARGO_BIN_EXE_manylight"),
                "render",
                "builtin:cornell",
                "--size",
                "320x180",
            ])
            .args(["--backend", "gpu", "--set", &device, "--set", "vpls.count=2500000"])
            .args(["--threads", "2"])
            .env("XDG_RUNTIME_DIR", std::env::temp_dir())
            // Room for each thread would come first.
            .envs([("MALLOC_ARENA_MAX", "2"), ("LP_NUM_THREADS", "2")])
            .output()
            .expect("a shell");
        let message = text(&output.stderr);
        if output.status.code() == Some(2) && message.contains("has no room for it beside") {
            assert_eq!(message.trim_end().lines().count(), 1, "{message}");
            return;
        }
        said.push((most, output.status, message));
    }
    panic!("{said:#?}");
}

#[test]
fn a_benchmark_refuses_what_it_would_not_time() {
    let Some(device) = find_device() else { return };
    let device = setting_of(&device);
    let bench =
        ["bench", "builtin:cornell", "--size", "16x9", "--backend", "gpu", "--set", &device];
    for set in ["method=path", "film.samples=2"] {
        assert_refused(&[&bench[..], &["--set", set]].concat(), &["render tells", "--backend cpu"]);
    }
}

#[test]
fn a_benchmark_tells_which_features_it_used() {
    let Some(device) = find_device() else { return };
    let name = setting_of(&device);
    let used = |sets: &[&str]| {
        let quick = ["--size", "16x9", "--frames", "1", "--set", "vpls.count=200", "--set", &name];
        let args = ["bench", "builtin:cornell", "--backend", "gpu", "--json"];
        let output = manylight(&[&args[..], &quick, sets].concat());
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        json(&output)[0]["report"]["features"].to_string()
    };
    let all = used(&["--set", "gpu.bindless=true"]);
    for feature in ["subgroups", "half", "timestamps", "large_limits", "ray_queries", "bindless"] {
        let is_offered = device["features"][feature] == true;
        assert_eq!(all.contains(&format!("\"{feature}\"")), is_offered, "{feature}: {all}");
    }
    let without = used(&["--set", "gpu.subgroups=false", "--set", "gpu.half=false"]);
    assert!(!without.contains("subgroups") && !without.contains("half"), "{without}");
    assert_eq!(used(&["--set", "gpu.base=true"]), "[]");
}

#[test]
fn stages_agree() {
    if !has_device() {
        return;
    }
    let quick = ["--size", "48x27", "--set", "vpls.count=1500", "--set", "vpls.emitter_count=300"];
    let args = ["diff-stages", "builtin:cornell", "--json"];
    let output = manylight(&[&args[..], &quick].concat());
    let report = json(&output);
    assert_eq!(output.status.code(), Some(0), "{report:#}");
    assert!(report["first"].is_null() && report["device"].is_string());
    let stages = report["stages"].as_array().expect("stages");
    for stage in ["receivers", "direct", "emitter vpls", "grid", "shadow", "filter", "composite"] {
        let rows: Vec<_> = stages.iter().filter(|row| row["stage"] == stage).collect();
        assert!(!rows.is_empty(), "{stage} is missing");
        assert!(rows.iter().any(|row| row["compared"].as_u64() > Some(0)), "{stage}");
    }
    let args = ["diff-stages", "builtin:cornell", "--set", "method=direct", "--size", "24x16"];
    let output = manylight(&[&args[..], &quick[2..]].concat());
    let table = text(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{table}");
    assert!(table.ends_with("all stages agree\n") && table.contains("receivers"), "{table}");
    assert!(!table.contains("\nvpls"), "{table}");
    assert_refused(
        &["diff-stages", "builtin:cornell", "--set", "method=path"],
        &["grid or direct"],
    );
}
