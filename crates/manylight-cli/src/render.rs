//! `manylight render`

use crate::args::{RenderArgs, SettingArgs};
use crate::backend::Engine;
use crate::sequence::{self, Step};
use crate::{Failure, Outcome, memory, output};
use indicatif::{ProgressBar, ProgressStyle};
use manylight::frame::{Past, Progress};
use manylight::{Frame, Method, Renderer, Settings};
use manylight_image::compute_auto_exposure_ev;
use manylight_scene::{Camera, MAX_PIXELS, Projection, Shot};
use serde_json::{Value, json};
use std::collections::VecDeque;
use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Size of a picture that nobody chose.
const DEFAULT_SIZE: [usize; 2] = [1280, 720];
/// A bar appears for work that takes longer than this.
const BAR_DELAY: Duration = Duration::from_secs(1);

/// Settings of a shot: preset, then the shot's own, then the command line's.
pub fn settings(args: &SettingArgs, shot: &Shot) -> Result<Settings, Failure> {
    let mut settings = Settings::preset(args.preset.as_deref().unwrap_or("balanced"))?;
    // What a shot states is wrong in its file, not on the command line.
    let of_shot = |e: manylight::Error| -> Failure {
        let file = shot.files.first().map(|file| format!("{}: ", file.display()));
        format!("{}{e}", file.unwrap_or_default()).into()
    };
    settings.apply(&shot.settings).map_err(of_shot)?;
    let is_wrong_before = settings.validate().is_err();
    for set in &args.sets {
        let named = set.split_once('=').filter(|(path, _)| !path.trim().is_empty());
        let (path, value) = named.ok_or_else(|| {
            format!("--set {set}: write PATH=VALUE, for example --set grid.alpha=1.5")
        })?;
        settings.set(path.trim(), value)?;
    }
    settings.seed = args.seed.unwrap_or(settings.seed);
    match settings.validate() {
        Err(e) if is_wrong_before => Err(of_shot(e)),
        result => Ok(result.map(|()| settings)?),
    }
}

/// Size of the picture: command line, else shot, else 1280×720.
pub fn size(args: &SettingArgs, camera: &Camera) -> Result<[usize; 2], Failure> {
    let Some(text) = &args.size else {
        return Ok(camera.size_px.map_or(DEFAULT_SIZE, |s| s.map(|v| v as usize)));
    };
    let parse = |s: &str| s.trim().parse::<usize>().ok().filter(|&v| v > 0);
    let size = text.split_once(['x', 'X']).and_then(|(w, h)| Some([parse(w)?, parse(h)?]));
    let size = size.filter(|[w, h]| w.checked_mul(*h).is_some_and(|n| n <= MAX_PIXELS));
    let problem =
        format!("write WIDTHxHEIGHT of at most {MAX_PIXELS} pixels, for example 1280x720");
    size.ok_or_else(|| format!("--size {text}: {problem}").into())
}

/// Loads a scene, chooses its camera, and passes its warnings on.
pub fn load(path: &str, camera: Option<&str>, quiet: bool) -> Result<Shot, Failure> {
    let mut shot = manylight_scene::load(path)?;
    if let Some(camera) = camera {
        shot.use_camera(camera, "--camera")?;
    }
    if !quiet {
        for warning in &shot.warnings {
            let _ = writeln!(std::io::stderr(), "warning: {warning}");
        }
    }
    Ok(shot)
}

/// Runs the command.
pub fn run(args: &RenderArgs) -> Result<Outcome, Failure> {
    let frames = args.frames.as_deref().map(sequence::parse).transpose()?;
    output::check(&args.output, &["exr", "png", "pfm"])?;
    output::check(args.heatmap.as_slice(), &["png"])?;
    let files = args.output.iter().chain(&args.heatmap);
    match frames {
        None => output::check_distinct(files)?,
        Some(_) => {
            let files: Vec<_> = files.collect();
            for (i, a) in files.iter().enumerate() {
                let same_folder = |b: &&PathBuf| output::folder_of(a) == output::folder_of(b);
                let earlier = files[..i].iter().copied().filter(same_folder);
                if let Some(b) = earlier.into_iter().find(|b| sequence::may_meet(a, b)) {
                    let (a, b) = (a.display(), b.display());
                    let problem = "a frame of one may have the name of a frame of the other";
                    return Err(format!("{b} and {a}: {problem}; name them apart").into());
                }
            }
        }
    }
    if args.quiet && !args.json && args.output.is_empty() && args.heatmap.is_none() {
        return Err("--quiet without -o would leave nothing; name a file".into());
    }
    let start = Instant::now();
    let shot = load(&args.scene, args.settings.camera.as_deref(), args.quiet)?;
    let mut settings = settings(&args.settings, &shot)?;
    if let Some(method) = &args.method {
        settings.set("method", method)?;
    }
    if args.heatmap.is_some() && settings.method == Method::Path {
        return Err("--heatmap: paths evaluate no virtual lights; leave it out".into());
    }
    let size = size(&args.settings, &shot.camera)?;
    memory::check_render(size, &settings, frames.is_some())?;
    let inputs = output::Inputs::new(&shot.files);
    let files: Vec<_> = args.output.iter().chain(&args.heatmap).collect();
    let frames = match frames {
        None => files.iter().try_for_each(|file| inputs.check(file)).map(|()| None)?,
        Some(f) => Some(sequence::find_unfinished(f, &files, args.overwrite, &inputs)?),
    };
    let scene_hash = hash_of(&shot);
    let (camera, path) = (shot.camera, shot.path);
    let load_ms = start.elapsed().as_secs_f64() * 1e3;
    let start = Instant::now();
    let renderer = Renderer::new(shot.scene)?;
    let build_ms = start.elapsed().as_secs_f64() * 1e3;
    let start = Instant::now();
    let engine = Engine::new(renderer, args.backend, &settings, args.quiet)?;
    let open_ms = start.elapsed().as_secs_f64() * 1e3;
    let prepared = [("load scene", load_ms), ("build bvh", build_ms), ("open device", open_ms)];
    let mut run = Run { args, engine, settings, size, scene_hash, prepared };
    match frames {
        None => run.render_picture(&camera)?,
        Some(frames) => run.render_frames(frames, &|n| path.at(n).unwrap_or(camera.clone()))?,
    }
    if args.output.is_empty() && args.heatmap.is_none() && !args.quiet {
        let _ = writeln!(std::io::stderr(), "nothing was written; -o FILE writes the picture");
    }
    Ok(Outcome::Done)
}

/// A scene that is ready, and what is to be made of it.
struct Run<'a> {
    args: &'a RenderArgs,
    engine: Engine,
    settings: Settings,
    size: [usize; 2],
    scene_hash: u64,
    /// What took how long before, ms.
    prepared: [(&'static str, f64); 3],
}

impl Run<'_> {
    fn render_picture(&mut self, camera: &Camera) -> Result<(), Failure> {
        let args = self.args;
        let Self { engine, settings, size, .. } = self;
        let start = Instant::now();
        let frame = with_bar(args.quiet, &mut |progress| {
            engine.render(camera, *size, settings, progress, args.quiet)
        })?;
        let render_ms = start.elapsed().as_secs_f64() * 1e3;
        let written = self.write(&frame, camera, render_ms, None)?;
        if !args.json && !args.quiet {
            // Nobody may be there to read it; the picture is what counts.
            let _ = self.print_table(&frame, render_ms, &written);
        }
        Ok(())
    }

    fn render_frames(
        &mut self,
        (finished, unfinished): (usize, Vec<u32>),
        camera: &dyn Fn(u32) -> Camera,
    ) -> Result<(), Failure> {
        let args = self.args;
        if finished > 0 && !args.quiet {
            let kept = "are there already and kept; --overwrite renders them again";
            let _ = writeln!(std::io::stderr(), "{finished} frames {kept}");
        }
        let filter = &self.settings.filter;
        let warm_up = self.settings.adds_up().then(|| args.warm_up.unwrap_or(filter.history));
        let mut past = Past::default();
        // Where what is remembered begins.
        let mut first = None;
        let mut is_told = false;
        let mut steps = VecDeque::from(sequence::plan(unfinished.iter().copied(), warm_up));
        while let Some(step) = steps.pop_front() {
            let number = match step {
                Step::Forget => {
                    self.engine.forget(&mut past);
                    first = None;
                    continue;
                }
                Step::WarmUp(number) | Step::Write(number) => number,
            };
            let began = *first.get_or_insert(number);
            let camera = camera(number);
            let start = Instant::now();
            let Self { engine, settings, size, .. } = self;
            let frame = with_bar(args.quiet, &mut |progress| {
                let (view, next) = ((&camera, *size), (number, &mut past));
                engine.render_next(view, settings, next, progress, args.quiet)
            })?;
            let Some(frame) = frame else {
                let left = unfinished.iter().copied().filter(|&n| n >= number);
                steps = sequence::plan(left, warm_up).into();
                continue;
            };
            let render_ms = start.elapsed().as_secs_f64() * 1e3;
            let mut note = ", not written".to_owned();
            if matches!(step, Step::Write(_)) {
                let written = self.write(&frame, &camera, render_ms, Some([began, number]))?;
                let [_, device] = self.engine.names();
                note = format!(" on {device}, exposure {:.2} EV", written.exposure_ev);
                if !std::mem::replace(&mut is_told, true) {
                    self.tell_exposure(number, written.exposure_ev);
                }
            }
            if !args.json && !args.quiet {
                let _ = writeln!(std::io::stderr(), "frame {number}: {render_ms:.1} ms{note}");
            }
        }
        Ok(())
    }

    /// Says that the frames of a sequence differ in exposure, if they do.
    fn tell_exposure(&self, number: u32, exposure_ev: f32) {
        let Self { args, settings, .. } = self;
        let is_shown = args.output.iter().any(|path| output::is_png(path));
        if is_shown && settings.film.exposure_ev.is_none() && !args.quiet {
            let _ = writeln!(
                std::io::stderr(),
                "each frame has an exposure of its own; for that of frame {number} in all: --set \
                 film.exposure_ev={exposure_ev}"
            );
        }
    }

    /// Writes a picture into all files, and about it as JSON; `frames` is where its past began,
    /// and itself.
    fn write(
        &self,
        frame: &Frame,
        camera: &Camera,
        render_ms: f64,
        frames: Option<[u32; 2]>,
    ) -> Result<Written, Failure> {
        let Self { args, settings, .. } = self;
        let number = frames.map(|[_, number]| number);
        let warning = find_reason_of_black(frame);
        if let Some(reason) = warning.filter(|_| !args.quiet) {
            let _ = writeln!(std::io::stderr(), "warning: {reason}");
        }
        let file_of = |path: &PathBuf| match number {
            Some(number) => sequence::file_of(path, number),
            None => path.clone(),
        };
        let mut picture = output::picture(frame);
        let automatic_ev = || compute_auto_exposure_ev(&picture.beauty);
        let exposure_ev = settings.film.exposure_ev.unwrap_or_else(automatic_ev);
        picture.metadata = metadata(self, frame, camera, render_ms, exposure_ev);
        if let Some([first, number]) = frames {
            picture.metadata.push(("manylight.frame".to_owned(), number.to_string()));
            let first = settings.adds_up().then(|| first.to_string());
            picture.metadata.extend(first.map(|n| ("manylight.firstFrame".to_owned(), n)));
        }
        let mut files = Vec::new();
        for path in &args.output {
            output::write(&picture, &file_of(path), exposure_ev)?;
            files.push(file_of(path));
        }
        if let Some(path) = &args.heatmap {
            let evals = &picture.layers.iter().find(|l| l.0 == "evals").ok_or("no evals")?.1;
            let top = evals.data.iter().copied().fold(1.0, f32::max);
            let rgb = manylight_image::heatmap(evals, 0.0, top)?;
            let path = file_of(path);
            manylight_image::write_png_rgb8(&rgb, evals.width, evals.height, &path)?;
            files.push(path);
        }
        let written = Written { files, exposure_ev, warning };
        if args.json {
            let mut report = self.report(frame, render_ms, &written);
            if let Some(number) = number {
                report["frame"] = json!(number);
            }
            let has_files = !args.output.is_empty() || args.heatmap.is_some();
            output::print(&report.to_string(), has_files)?;
        }
        Ok(written)
    }

    /// What there is to say about a picture, for programs.
    fn report(&self, frame: &Frame, render_ms: f64, written: &Written) -> Value {
        let times = self.prepared.into_iter().chain([("render", render_ms)]);
        let times = times.map(|(n, t)| (format!("{}_ms", n.replace(' ', "_")), json!(t)));
        let times: serde_json::Map<String, Value> = times.collect();
        let [backend, device] = self.engine.names();
        let files: Vec<_> = written.files.iter().map(|f| f.display().to_string()).collect();
        json!({
            "scene": self.args.scene, "size": self.size, "backend": backend, "device": device,
            "files": files, "warning": written.warning, "exposure_ev": written.exposure_ev,
            "d_min": frame.d_min, "alpha": frame.alpha, "times": times,
            "stages": stages_json(frame), "settings": self.settings.to_json(),
        })
    }

    fn print_table(&self, frame: &Frame, render_ms: f64, written: &Written) -> Result<(), Failure> {
        let mut err = std::io::stderr().lock();
        writeln!(err, "{:<16}{:>12}{:>16}", "stage", "ms", "count")?;
        for stage in &frame.stages {
            writeln!(err, "{:<16}{:>12.1}{:>16}", stage.name, stage.time_ms, stage.count)?;
        }
        for (name, time_ms) in self.prepared.into_iter().chain([("render", render_ms)]) {
            writeln!(err, "{name:<16}{time_ms:>12.1}")?;
        }
        let lit = frame.layers.evals.iter().filter(|e| **e > 0.0).count().max(1);
        let evals: f64 = frame.layers.evals.iter().map(|&e| f64::from(e)).sum();
        let mean = evals / lit as f64;
        let [width, height] = self.size;
        writeln!(err, "{width}x{height} pixels, {mean:.0} lights evaluated per lit pixel")?;
        let [backend, device] = self.engine.names();
        let is_automatic = self.settings.film.exposure_ev.is_none();
        let note = if is_automatic { ", automatic" } else { "" };
        writeln!(err, "{backend}: {device}; exposure {:.2} EV{note}", written.exposure_ev)?;
        let files: Vec<_> = written.files.iter().map(|f| f.display().to_string()).collect();
        if !files.is_empty() {
            writeln!(err, "wrote {}", files.join(", "))?;
        }
        Ok(())
    }
}

/// What became of a picture.
struct Written {
    files: Vec<PathBuf>,
    /// Stops by which tone-mapped files amplify it.
    exposure_ev: f32,
    /// Why it shows nothing, if it does.
    warning: Option<&'static str>,
}

/// Why a picture shows nothing, if it does.
fn find_reason_of_black(frame: &Frame) -> Option<&'static str> {
    let layers = &frame.layers;
    if layers.beauty().iter().any(|color| color.max_element() > 0.0) {
        return None;
    }
    Some(match layers.depth.iter().any(|depth| depth.is_finite()) {
        true => {
            "the picture is black: no light reaches what the camera sees; move the camera out of \
             walls, or add a light"
        }
        false => {
            "the picture is black: the camera sees no surface; turn it toward the scene, or move it"
        }
    })
}

/// Renders with a progress bar on a terminal.
fn with_bar<T>(
    quiet: bool,
    render: &mut dyn FnMut(Progress<'_>) -> Result<T, Failure>,
) -> Result<T, Failure> {
    if quiet || !std::io::stderr().is_terminal() {
        return render(&|_, _| ());
    }
    let style = ProgressStyle::with_template("{msg:<14} {wide_bar} {percent:>3} % {eta:>5} left")?;
    let start = Instant::now();
    let bar: Mutex<Option<ProgressBar>> = Mutex::new(None);
    let tick = |stage: &str, share: f64| {
        let Ok(mut bar) = bar.lock() else { return };
        if bar.is_none() && start.elapsed() > BAR_DELAY {
            *bar = Some(ProgressBar::new(1000).with_style(style.clone()));
        }
        if let Some(bar) = &*bar {
            bar.set_message(stage.to_owned());
            bar.set_position((share * 1000.0) as u64);
        }
    };
    let frame = render(&tick);
    if let Ok(Some(bar)) = bar.into_inner() {
        bar.finish_and_clear();
    }
    frame
}

/// Stages as JSON.
pub fn stages_json(frame: &Frame) -> Value {
    frame
        .stages
        .iter()
        .map(|s| json!({ "stage": s.name, "ms": s.time_ms, "count": s.count }))
        .collect()
}

fn metadata(
    run: &Run<'_>,
    frame: &Frame,
    camera: &Camera,
    render_ms: f64,
    exposure_ev: f32,
) -> Vec<(String, String)> {
    let world_from_camera = glam::Mat4::from_cols(
        camera.forward.cross(camera.up).extend(0.0),
        camera.up.extend(0.0),
        (-camera.forward).extend(0.0),
        camera.position.extend(1.0),
    );
    let [backend, device] = run.engine.names();
    let mut all = vec![
        ("version", env!("CARGO_PKG_VERSION").to_owned()),
        ("scene", run.args.scene.clone()),
        ("sceneHash", format!("{:016x}", run.scene_hash)),
        ("settings", Value::Object(run.settings.to_json()).to_string()),
        ("seed", run.settings.seed.to_string()),
        ("backend", backend),
        ("device", device),
        ("deviceFeatures", run.engine.features().join(" ")),
        ("renderTimeMs", format!("{render_ms:.1}")),
        ("exposureEv", exposure_ev.to_string()),
        ("worldFromCamera", format!("{:?}", world_from_camera.to_cols_array())),
    ];
    all.extend(match camera.projection {
        Projection::Perspective { vfov_rad } => {
            [("projection", "perspective".to_owned()), ("vfovRad", vfov_rad.to_string())]
        }
        Projection::Orthographic { half_height } => {
            [("projection", "orthographic".to_owned()), ("halfHeight", half_height.to_string())]
        }
    });
    all.extend(frame.alpha.map(|alpha| ("alpha", alpha.to_string())));
    // A prefix, because OpenEXR reserves many plain names.
    all.into_iter().map(|(key, value)| (format!("manylight.{key}"), value)).collect()
}

/// A hash of everything in a scene that is rendered.
fn hash_of(shot: &Shot) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325u64;
    let mut add = |bits: u64| {
        hash = (hash ^ bits).wrapping_mul(0x0000_0100_0000_01b3);
        hash ^= hash >> 29;
    };
    for mesh in &shot.scene.meshes {
        mesh.positions.iter().flat_map(|p| p.to_array()).for_each(|v| add(v.to_bits().into()));
        mesh.triangles.iter().flatten().for_each(|&v| add(v.into()));
    }
    for instance in &shot.scene.instances {
        add(instance.mesh.into());
        instance.world_from_object.to_cols_array().iter().for_each(|v| add(v.to_bits().into()));
    }
    for image in &shot.scene.images {
        image.texels.iter().for_each(|t| add(u32::from_le_bytes(*t).into()));
    }
    let text = format!("{:?}{:?}", shot.scene.materials, shot.scene.lights);
    text.bytes().for_each(|b| add(b.into()));
    hash
}
