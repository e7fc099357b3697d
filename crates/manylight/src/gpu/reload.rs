//! Shaders that change while the program runs, in builds with debug assertions alone.
//!
//! In: a folder of shader files · Out: texts of kernels that changed and can be parsed
//! Limits: ports, records and constants are Rust's, and change with a new build.

use super::pipelines::{PipelineKey, key_of};
use super::{Features, Gpu, KernelInfo, SHADERS, SceneTraits, Sources, link};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::PoisonError;
use std::time::SystemTime;
use wgpu::naga;

/// When a file was changed, and its bytes; `None` where there is no such file.
type Stamp = Option<(SystemTime, u64)>;

/// Shader files that are looked at before each submission.
#[derive(Debug)]
pub(super) struct Reload {
    folder: PathBuf,
    stamps: Vec<Stamp>,
    texts: Vec<String>,
    /// Kernels that are in use, and their texts.
    kernels: HashMap<PipelineKey, (&'static KernelInfo, String)>,
    /// What was told last.
    told: Option<String>,
}

impl Reload {
    /// Reads all files; where one is missing the text that was compiled in stands for it.
    pub fn new(folder: &Path) -> Self {
        let mut reload = Self {
            folder: folder.to_owned(),
            stamps: vec![None; SHADERS.files.len()],
            texts: SHADERS.files.iter().map(|(_, text)| (*text).to_owned()).collect(),
            kernels: HashMap::new(),
            told: None,
        };
        reload.read();
        reload
    }

    /// Reads the files that changed; whether there was any.
    fn read(&mut self) -> bool {
        let mut any = false;
        for (i, (path, built_in)) in SHADERS.files.iter().enumerate() {
            let file = self.folder.join(path).with_extension("wgsl");
            let stamp = file.metadata().and_then(|m| Ok((m.modified()?, m.len()))).ok();
            if stamp != self.stamps[i] {
                let text = stamp.and_then(|_| std::fs::read_to_string(&file).ok());
                self.texts[i] = text.unwrap_or_else(|| (*built_in).to_owned());
                self.stamps[i] = stamp;
                any = true;
            }
        }
        any
    }

    /// Text of a kernel that is used for the first time; none where it cannot be parsed, which is
    /// told.
    pub fn begin(
        &mut self,
        kernel: &'static KernelInfo,
        features: Features,
        traits: SceneTraits,
    ) -> Option<String> {
        let text = self.link(kernel, features, traits);
        let kept = text.clone().unwrap_or_default();
        self.kernels.insert(key_of(kernel, traits), (kernel, kept));
        text.map_err(|problem| self.tell(problem)).ok()
    }

    /// Kernels whose texts have changed, as far as they can be parsed; the others are told.
    pub fn changed(
        &mut self,
        features: Features,
    ) -> Vec<(PipelineKey, &'static KernelInfo, String)> {
        if !self.read() {
            return Vec::new();
        }
        self.told = None;
        let mut changed = Vec::new();
        let kernels = self.kernels.iter().map(|(&key, &(kernel, _))| (key, kernel));
        let mut kernels: Vec<_> = kernels.collect();
        kernels.sort_by_key(|(key, _)| key.0);
        for (key, kernel) in kernels {
            match self.link(kernel, features, key.1) {
                Ok(text) if self.kernels[&key].1 != text => {
                    self.kernels.insert(key, (kernel, text.clone()));
                    changed.push((key, kernel, text));
                }
                Ok(_) => {}
                Err(problem) => self.tell(problem),
            }
        }
        changed
    }

    /// Links and checks a kernel.
    ///
    /// Errors: one sentence with file and line
    fn link(
        &self,
        kernel: &KernelInfo,
        features: Features,
        traits: SceneTraits,
    ) -> Result<String, String> {
        let files = SHADERS.files.iter().zip(&self.texts);
        let files: Vec<_> = files.map(|((path, _), text)| (*path, text.as_str())).collect();
        let text = link(kernel, Sources { files: &files, ..SHADERS }, features, traits)?;
        check(&text).map(|()| text)
    }

    /// Prints a sentence, once; many kernels may import one file.
    pub fn tell(&mut self, problem: String) {
        if self.told.as_ref() != Some(&problem) {
            eprintln!("{problem}; the kernels that use it stay as they were");
            self.told = Some(problem);
        }
    }

    /// What was told since files last changed.
    #[cfg(test)]
    pub fn told(&self) -> Option<&str> {
        self.told.as_deref()
    }
}

impl Gpu {
    /// Takes shaders from a folder laid out as `crates/manylight/src`, or a copy of parts of it,
    /// and looks before each submission whether they have changed. So does a device that is opened
    /// with `gpu.shaders`. For builds with debug assertions; others lack it.
    pub fn reload_from(&self, folder: &Path) {
        let mut pipelines = self.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
        *self.reload.lock().unwrap_or_else(PoisonError::into_inner) = Some(Reload::new(folder));
        self.bound_loops();
        pipelines.clear();
    }

    /// What was wrong with the shaders that changed last.
    #[cfg(test)]
    pub(super) fn shader_problem(&self) -> Option<String> {
        let reload = self.reload.lock().unwrap_or_else(PoisonError::into_inner);
        reload.as_ref().and_then(Reload::told).map(str::to_owned)
    }

    /// The pipeline of a kernel whose text lies in the folder of shaders, if there is one and the
    /// text is one of a kernel.
    pub(super) fn build_from_folder(
        &self,
        kernel: &'static KernelInfo,
        traits: SceneTraits,
    ) -> Option<wgpu::ComputePipeline> {
        let mut reload = self.reload.lock().unwrap_or_else(PoisonError::into_inner);
        let reload = reload.as_mut()?;
        let text = reload.begin(kernel, self.features(), traits)?;
        self.try_build(kernel, text).map_err(|problem| reload.tell(problem)).ok()
    }

    /// Builds the pipelines of shaders that have changed; where that fails the old one stays.
    pub(super) fn reload_shaders(&self) {
        let mut pipelines = self.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
        let mut reload = self.reload.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(reload) = reload.as_mut() else { return };
        for (key, kernel, text) in reload.changed(self.features()) {
            match self.try_build(kernel, text) {
                Ok(pipeline) => drop(pipelines.insert(key, pipeline)),
                Err(problem) => reload.tell(problem),
            }
        }
    }

    /// Errors: what the device has against the text, in one line
    fn try_build(
        &self,
        kernel: &KernelInfo,
        text: String,
    ) -> Result<wgpu::ComputePipeline, String> {
        let text = self.watched(kernel, text)?;
        let scope = self.device().push_error_scope(wgpu::ErrorFilter::Validation);
        let pipeline = self.build(kernel, text);
        match pollster::block_on(scope.pop()) {
            None => Ok(pipeline),
            Some(e) => {
                let text = e.to_string();
                let lines: Vec<_> = text.lines().map(str::trim).collect();
                Err(format!("{}.wgsl: {}", kernel.shader, lines.join(" ")))
            }
        }
    }
}

/// Errors: one sentence with file and line
fn check(text: &str) -> Result<(), String> {
    let place = |location: Option<naga::SourceLocation>| {
        location.map_or_else(String::new, |at| place_of(text, at.line_number as usize) + ": ")
    };
    let module = naga::front::wgsl::parse_str(text)
        .map_err(|e| format!("{}{}", place(e.location(text)), e.message()))?;
    // What the device lacks is its own to refuse.
    let all = naga::valid::Capabilities::all();
    let mut validator = naga::valid::Validator::new(naga::valid::ValidationFlags::all(), all);
    let checked = validator.validate(&module);
    checked.map(|_| ()).map_err(|e| {
        let mut reasons = vec![e.as_inner().to_string()];
        let mut source = std::error::Error::source(e.as_inner());
        while let Some(reason) = source {
            reasons.push(reason.to_string());
            source = reason.source();
        }
        format!("{}{}", place(e.location(text)), reasons.join(": "))
    })
}

/// File and line of a line of a linked text, both as an editor counts.
fn place_of(text: &str, line: usize) -> String {
    let lines: Vec<_> = text.lines().take(line).collect();
    let file_of = |line: &str| {
        let path = line.strip_prefix("// ")?.strip_suffix(".wgsl")?;
        SHADERS.files.iter().find(|file| file.0 == path).map(|file| file.0)
    };
    let found = lines.iter().enumerate().rev().find_map(|(i, line)| Some((i, file_of(line)?)));
    match found {
        Some((i, path)) => format!("{path}.wgsl:{}", line - i - 1),
        None => "constants".to_owned(),
    }
}
