//! What is in the way of a run: inputs under the names of outputs, folders and pipes in the place
//! of files, readers that go away, threads that cannot be had.

use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

/// A folder of its own for one test, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path =
            std::env::temp_dir().join(format!("manylight-obstacles-{}-{name}", std::process::id()));
        std::fs::create_dir_all(&path).expect("temporary folder");
        Self(path)
    }

    fn file(&self, name: &str) -> String {
        self.0.join(name).display().to_string()
    }

    fn write(&self, name: &str, text: &str) -> String {
        std::fs::write(self.0.join(name), text).expect("temporary file");
        self.file(name)
    }

    /// Bytes of a file; none where there is no such file.
    fn len(&self, name: &str) -> u64 {
        self.0.join(name).metadata().map_or(0, |m| m.len())
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

const CORNELL: &str = "builtin:cornell";
/// Quick settings for pictures nobody looks at.
const QUICK: [&str; 8] = [
    "--size",
    "8x6",
    "--set",
    "vpls.count=50",
    "--set",
    "vpls.emitter_count=50",
    "--backend",
    "cpu",
];

fn command(args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_manylight"));
    command.args(args);
    command
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// One sentence on standard error with all these parts, and exit code 2.
fn assert_failure(output: &Output, parts: &[&str]) {
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert_eq!(message.trim_end().lines().count(), 1, "{message}");
    for part in parts {
        assert!(message.contains(part), "{message} lacks {part}");
    }
}

fn assert_refused(args: &[&str], parts: &[&str]) {
    assert_failure(&command(args).output().expect("the program runs"), parts);
}

fn render(args: &[&str]) -> Vec<String> {
    ["render", CORNELL].iter().chain(&QUICK).chain(args).map(|s| (*s).to_owned()).collect()
}

fn assert_done(args: &[String]) {
    let args: Vec<&str> = args.iter().map(String::as_str).collect();
    let output = command(&args).output().expect("the program runs");
    assert!(output.status.success(), "{}", text(&output.stderr));
}

#[test]
fn outputs_do_not_take_the_place_of_inputs() {
    let folder = Folder::new("inputs");
    let sky = folder.file("sky.exr");
    assert_done(&render(&["-q", "-o", &sky, "-o", &folder.file("a.png")]));
    let with_sky =
        format!(r#"{{"scene": "{CORNELL}", "lights": [{{"type": "sky", "map": "sky.exr"}}]}}"#);
    let shot = folder.write("shot.png", &with_sky);
    let numbered = folder.write("a.0001.png", &with_sky);
    let rays = folder.write("s.ray", &with_sky);
    let picture = folder.file("a.png");
    let beside =
        format!("{}/../{}/sky.exr", folder.0.display(), folder.0.file_name().unwrap().display());
    let length = folder.len("sky.exr");
    #[cfg(unix)]
    {
        let link = folder.file("link.png");
        std::os::unix::fs::symlink("a.png", &link).expect("a link");
        assert_refused(&["render", CORNELL, "-o", &link, "-o", &picture], &["named twice"]);
    }
    for args in [
        vec!["render", &shot, "-o", &shot],
        vec!["render", &shot, "-o", &sky],
        vec!["render", &shot, "-o", &beside],
        vec!["render", &shot, "--heatmap", &shot],
        vec!["render", &numbered, "-o", &picture, "--frames", "0..1", "--overwrite"],
        vec!["compare", &picture, &picture, "-o", &picture],
        vec!["bench", &rays, "--rays", "--dump-rays", &rays],
    ] {
        assert_refused(&args, &["is read by this command; name another output"]);
    }
    assert!(folder.len("sky.exr") == length && folder.len("shot.png") == with_sky.len() as u64);
    assert_eq!(folder.len("a.0000.png"), 0, "refused before anything is rendered");
}

#[test]
fn only_whole_files_are_finished_frames() {
    let folder = Folder::new("frames");
    let out = folder.file("a.png");
    folder.write("a.0000.png", "");
    folder.write("a.0001.png", "kept");
    let args = render(&["-q", "-o", &out, "--frames", "0..1"]);
    assert_done(&args);
    assert!(folder.len("a.0000.png") > 4 && folder.len("a.0001.png") == 4);

    std::fs::create_dir(folder.file("b.0001.png")).expect("a folder");
    let long = folder.file(&format!("{}#.png", "n".repeat(249)));
    let cases = [
        (folder.file("b.png"), "0..1", "b.0001.png: it is a folder"),
        // Frames 0 to 9 have names of 254 bytes.
        (long, "8..100", "choose a shorter name"),
    ];
    let count = || std::fs::read_dir(&folder.0).expect("folder").count();
    let before = count();
    for (out, frames, expected) in &cases {
        let args = render(&["-q", "-o", out, "--frames", frames]);
        assert_refused(&args.iter().map(String::as_str).collect::<Vec<_>>(), &[expected]);
        assert_eq!(count(), before, "refused before anything is rendered");
    }
}

/// Exit code of a run whose results and notes nobody reads.
fn run_unread(args: &[String]) -> Option<i32> {
    let args: Vec<_> = args.iter().map(String::as_str).collect();
    let mut command = command(&args);
    let mut child =
        command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the program runs");
    drop(child.stdout.take());
    drop(child.stderr.take());
    child.wait().expect("it ends").code()
}

#[test]
fn readers_that_go_away_take_no_files_with_them() {
    let folder = Folder::new("readers");
    for (name, stream) in [("out", "--json"), ("err", "--overwrite")] {
        let out = folder.file(&format!("{name}.png"));
        let args = render(&["-o", &out, "--frames", "0..5", stream]);
        assert_eq!(run_unread(&args), Some(0));
        for frame in 0..6 {
            assert!(folder.len(&format!("{name}.000{frame}.png")) > 0, "{name} {frame}");
        }
    }
    // A limit that is not kept stays a failure.
    let (a, b) = (folder.file("a.pfm"), folder.file("b.pfm"));
    assert_done(&render(&["-q", "-o", &a]));
    assert_done(&render(&["-q", "-o", &b, "--method", "direct"]));
    let compare = ["compare", &a, &b, "--max-flip", "0"].map(str::to_owned);
    assert_eq!(run_unread(&compare), Some(1));
    // Nothing else to do: a quiet end.
    assert_eq!(run_unread(&["methods".to_owned()]), Some(0));
}

/// A full standard error is no reason either.
#[cfg(target_os = "linux")]
#[test]
fn notes_that_cannot_be_written_are_left_out() {
    let folder = Folder::new("notes");
    let out = folder.file("a.png");
    let full = || std::fs::OpenOptions::new().write(true).open("/dev/full").expect("a device");
    let run = |args: Vec<String>| {
        let status =
            Command::new(env!("CARGO_BIN_EXE_manylight")).args(args).stderr(full()).status();
        assert!(status.expect("the program runs").success());
    };
    run(render(&["-o", &out]));
    run(render(&["-o", &out, "--frames", "0..2"]));
    run(render(&["-o", &out, "--frames", "0..3"]));
    assert!(folder.len("a.png") > 0 && folder.len("a.0003.png") > 0);
}

#[cfg(unix)]
#[test]
fn pipes_are_refused_at_once() {
    let folder = Folder::new("pipes");
    let pipes = ["a.png", "a.exr", "a.0001.png"].map(|name| folder.file(name));
    for pipe in &pipes {
        assert!(Command::new("mkfifo").arg(pipe).status().expect("mkfifo").success());
    }
    let [png, exr, _] = &pipes;
    assert_refused(
        &["render", CORNELL, "-o", png],
        &["a.png: it is a pipe or a socket; name a file"],
    );
    assert_refused(&["compare", exr, exr], &["a.exr", "pipe"]);
    assert_refused(&["info", exr], &["a.exr: not a file"]);
    let frames = folder.file("a.####.png");
    assert_refused(&["render", CORNELL, "-o", &frames, "--frames", "0..1"], &["0001.png", "pipe"]);
    assert_eq!(folder.len("a.0000.png"), 0, "refused before anything is rendered");
}

#[test]
fn reports_of_finished_scenes_are_not_lost() {
    let folder = Folder::new("reports");
    let both = folder.file("both");
    let args = ["bench", CORNELL, CORNELL, "--rays", "--dump-rays", &both];
    assert_refused(&args, &["--dump-rays", "name one scene"]);
    let args = ["bench", CORNELL, "no-such.json", "--build", "--json", "--set", "vpls.count=50"];
    let output = command(&args).output().expect("the program runs");
    assert_failure(&output, &["no-such.json"]);
    let reports: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(reports[0]["scene"], CORNELL);
    let output = command(&["bench", "no-such.json", "--json"]).output().expect("the program runs");
    assert!(output.stdout.is_empty());
}

#[test]
fn threads_that_cannot_be_had_are_one_sentence() {
    for args in [vec!["info", CORNELL], vec!["methods"], vec!["compare", "a.pfm", "b.pfm"]] {
        let run = |name: &str, value: &str| {
            command(&args).env(name, value).output().expect("the program runs")
        };
        let output = run("RAYON_NUM_THREADS", "65536");
        assert_failure(&output, &["RAYON_NUM_THREADS=65536: use 1 to 1024"]);
        if cfg!(target_os = "linux") {
            let output = run("RUST_MIN_STACK", "999999999999999");
            assert_failure(&output, &["cannot start", "RUST_MIN_STACK"]);
        }
    }
}

#[test]
fn scenes_that_are_too_small_say_so() {
    let folder = Folder::new("small");
    let scene = folder.write(
        "small.gltf",
        r#"{"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0, "scale": [1e-18, 1e-18, 1e-18]}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
            "bufferViews": [{"buffer": 0, "byteLength": 36}],
            "buffers": [{"byteLength": 36,
                "uri": "data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]}"#,
    );
    assert_refused(&["bench", &scene, "--json"], &["no triangle that is large enough", "scale"]);
}
