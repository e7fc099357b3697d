//! Pipelines: built when they are first needed, those of a submission side by side.

#[cfg(doc)]
use super::Recorder;
use super::loops::with_last_loop;
use super::{Gpu, KernelInfo, SHADERS, SceneTraits, link};
use rayon::prelude::*;
use std::sync::PoisonError;
use std::sync::atomic::Ordering;

/// Which pipeline: the path of its shader, and what is in its scene as far as that matters.
pub(super) type PipelineKey = (&'static str, SceneTraits);

/// The key of a kernel's pipeline for a scene.
pub(super) fn key_of(kernel: &KernelInfo, traits: SceneTraits) -> PipelineKey {
    (kernel.shader, traits.of_kernel(kernel))
}

impl Gpu {
    /// Builds those of some kernels that are not there yet, on all processors.
    ///
    /// Panics: where a shader does not link, which a test rules out
    pub(super) fn build_pipelines(
        &self,
        kernels: impl Iterator<Item = &'static KernelInfo>,
        traits: SceneTraits,
    ) {
        let mut missing: Vec<_> = {
            let pipelines = self.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
            kernels.filter(|kernel| !pipelines.contains_key(&key_of(kernel, traits))).collect()
        };
        missing.sort_by_key(|kernel| kernel.shader);
        missing.dedup_by_key(|kernel| kernel.shader);
        if missing.len() < 2 {
            return;
        }
        // Each thread is told its own errors: what fails is built again by who asks for it.
        let build = |kernel| self.guard(|| Ok((kernel, self.first_pipeline(kernel, traits)))).ok();
        let built: Vec<_> = missing.into_par_iter().filter_map(build).collect();
        let mut pipelines = self.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
        for (kernel, pipeline) in built {
            pipelines.entry(key_of(kernel, traits)).or_insert(pipeline);
        }
    }

    /// The pipeline of a kernel for a scene, built when it is first asked for.
    ///
    /// Panics: where a shader does not link, which a test rules out
    pub(super) fn pipeline(
        &self,
        kernel: &'static KernelInfo,
        traits: SceneTraits,
    ) -> wgpu::ComputePipeline {
        let mut pipelines = self.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
        let pipeline = pipelines.entry(key_of(kernel, traits));
        pipeline.or_insert_with(|| self.first_pipeline(kernel, traits)).clone()
    }

    fn first_pipeline(
        &self,
        kernel: &'static KernelInfo,
        traits: SceneTraits,
    ) -> wgpu::ComputePipeline {
        #[cfg(debug_assertions)]
        if let Some(pipeline) = self.build_from_folder(kernel, traits) {
            return pipeline;
        }
        let text = link(kernel, SHADERS, self.features(), traits);
        let text = text.expect("a test links every shader");
        self.build(kernel, self.watched(kernel, text).expect("a test watches every shader"))
    }

    /// The text with a last loop, where the driver ends loops early.
    ///
    /// Errors: as [`with_last_loop`]
    pub(super) fn watched(&self, kernel: &KernelInfo, text: String) -> Result<String, String> {
        match self.watch() {
            Some(_) => with_last_loop(kernel.shader, &text),
            None => Ok(text),
        }
    }

    pub(super) fn build(&self, kernel: &KernelInfo, text: String) -> wgpu::ComputePipeline {
        let (device, label) = (self.device(), Some(kernel.shader));
        let source =
            wgpu::ShaderModuleDescriptor { label, source: wgpu::ShaderSource::Wgsl(text.into()) };
        let checks = wgpu::ShaderRuntimeChecks {
            force_loop_bounding: self.bounds_loops.load(Ordering::Relaxed),
            ..wgpu::ShaderRuntimeChecks::checked()
        };
        // SAFETY: every loop of our own shaders ends: each turn takes one of finitely many items,
        // of a range of numbers or of a tree that was built here. Shaders of a folder have bounds
        // put to theirs. Other checks stay.
        let module = unsafe { device.create_shader_module_trusted(source, checks) };
        let stage_layout = self.stage_layout(kernel);
        let scene_layout = Some(self.scene_layout()).filter(|_| kernel.scene);
        let layouts = [Some(&stage_layout), scene_layout, self.watch().map(|w| &w.layout)];
        let count = layouts.iter().rposition(Option::is_some).map_or(0, |last| last + 1);
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label,
            bind_group_layouts: &layouts[..count],
            immediate_size: 0,
        });
        device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label,
            layout: Some(&layout),
            module: &module,
            entry_point: Some("main"),
            // Our shaders write what they read of a workgroup's memory: it need not be emptied.
            compilation_options: wgpu::PipelineCompilationOptions {
                zero_initialize_workgroup_memory: false,
                ..Default::default()
            },
            cache: None,
        })
    }

    /// Layout of group 0 of a kernel: that of its ports, whatever becomes of its text.
    pub(super) fn stage_layout(&self, kernel: &KernelInfo) -> wgpu::BindGroupLayout {
        let mut layouts = self.stage_layouts.lock().unwrap_or_else(PoisonError::into_inner);
        let make = || {
            self.device().create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: Some(kernel.shader),
                entries: &kernel.layout_entries(),
            })
        };
        layouts.entry(kernel.shader).or_insert_with(make).clone()
    }
}
