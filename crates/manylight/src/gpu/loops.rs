//! Drivers that end loops early, and how it is noticed.
//!
//! Software Vulkan of Mesa 22 gives all loops of an invocation together 65,535 turns
//! (`LP_MAX_TGSI_LOOP_ITERATIONS` in its sources; Mesa 25 has no such limit) and goes on behind
//! them as if they were done: light would be missing, and nobody told. Where a device does that,
//! each kernel gets one more loop at its end, which is ended early too; what it finds comes back
//! with all else that a submission tells.

#[cfg(test)]
use super::KernelInfo;
#[cfg(doc)]
use super::Recorder;
use super::features::LISTS_BESIDE_TEXTURES;
use super::{Buf, Feature, Features, Gpu, SHADERS, kernel, record};
use crate::error::Error;

/// Turns that a loop is tried with.
const TRIED: u32 = 1 << 17;
/// The group in which the last loop finds its list.
pub(super) const LAST_LOOP_GROUP: u32 = 2;
/// The shader of the last loop.
const LAST_LOOP: &str = "gpu/last_loop";

record! {
    /// Turns of a loop.
    struct Turns {
        /// Asked for.
        pub asked: u32,
        /// Made.
        pub made: u32,
    }
}

kernel! {
    /// Counts the turns of a loop.
    struct CountTurns = "gpu/count_turns", [1, 1, 1];
    write turns: Turns
}

/// Every kernel of this file.
#[cfg(test)]
pub(super) const KERNELS: &[&KernelInfo] = &[&CountTurns::INFO];

record! {
    /// What the last loop needs and finds.
    struct LastLoop {
        /// Turns that it should make.
        pub turns: u32,
        /// Whether any invocation made fewer.
        pub is_cut: u32,
    }
}

/// What is known of the loops of a device.
#[derive(Debug, Default)]
pub(super) struct Loops {
    /// Turns that all loops of an invocation have together; `None`: any number.
    pub most_turns: Option<u32>,
    /// The last loop of all kernels, where the driver ends loops early.
    pub watch: Option<Watch>,
}

impl Loops {
    /// Counts turns on the device, which must have nothing else to do.
    ///
    /// Errors: what the device reported
    pub fn new(gpu: &Gpu) -> Result<Self, Error> {
        // Only drivers that emulate a device are known to end loops early.
        if !gpu.is_emulated() {
            return Ok(Self::default());
        }
        let turns = gpu.upload("turns of a loop", &[Turns { asked: TRIED, made: 0 }])?;
        let mut rec = gpu.record(None);
        rec.dispatch(&CountTurns { turns: &turns }, [1, 1, 1]);
        rec.submit().wait()?;
        let made = gpu.read(&turns, 1)?[0].made;
        if made == TRIED {
            return Ok(Self::default());
        }
        let lists = gpu.device().limits().max_storage_buffers_per_shader_stage;
        let is_watched = lists >= lists_with_last_loop(gpu.features());
        let watch = is_watched.then(|| Watch::new(gpu)).transpose()?;
        Ok(Self { most_turns: Some(made), watch })
    }
}

/// Lists that a kernel binds with the last loop.
pub(super) fn lists_with_last_loop(features: Features) -> u32 {
    let own = wgpu::Limits::defaults().max_storage_buffers_per_shader_stage;
    1 + if features.has(Feature::Bindless) { LISTS_BESIDE_TEXTURES } else { own }
}

/// The last loop of all kernels of a device.
#[derive(Debug)]
pub(super) struct Watch {
    found: Buf<LastLoop>,
    pub layout: wgpu::BindGroupLayout,
    pub group: wgpu::BindGroup,
}

impl Watch {
    fn new(gpu: &Gpu) -> Result<Self, Error> {
        let found = gpu.upload("loops that were cut", &[LastLoop { turns: 2, is_cut: 0 }])?;
        let layout = gpu.device().create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(LAST_LOOP),
            entries: &[wgpu::BindGroupLayoutEntry {
                binding: 0,
                visibility: wgpu::ShaderStages::COMPUTE,
                ty: wgpu::BindingType::Buffer {
                    ty: wgpu::BufferBindingType::Storage { read_only: false },
                    has_dynamic_offset: false,
                    min_binding_size: None,
                },
                count: None,
            }],
        });
        let group = gpu.device().create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(LAST_LOOP),
            layout: &layout,
            entries: &[wgpu::BindGroupEntry {
                binding: 0,
                resource: found.raw().as_entire_binding(),
            }],
        });
        Ok(Self { found, layout, group })
    }

    /// What was found, for [`Recorder::read_later`].
    pub fn found(&self) -> &wgpu::Buffer {
        self.found.raw()
    }

    /// Looks at what came back, behind the bytes that someone else asked for. Submissions that were
    /// under way with one whose loops were cut may be told of it too.
    ///
    /// Errors: loops were cut
    pub fn check(&self, gpu: &Gpu, bytes: &mut Vec<u8>) -> Result<(), Error> {
        let at = bytes.len() - self.found.raw().size() as usize;
        let found: LastLoop = bytemuck::pod_read_unaligned(&bytes[at..at + size_of::<LastLoop>()]);
        bytes.truncate(at);
        if found.is_cut == 0 {
            return Ok(());
        }
        // What comes next may need fewer.
        gpu.write(&self.found, &[LastLoop { is_cut: 0, ..found }]);
        Err(gpu.problem(&format!(
            "its driver ends the loops of a shader after {} turns, too few for this picture; take \
             a newer driver or --backend cpu, or try fewer virtual lights or more pixels",
            gpu.most_turns().unwrap_or(0)
        )))
    }
}

/// The text of a kernel with the last loop at its end.
///
/// Errors: a sentence, where the text has no entry point as all of ours are written, which a test
/// rules out for those of the program
pub(super) fn with_last_loop(kernel: &str, text: &str) -> Result<String, String> {
    let split = || {
        let (head, entry) = text.split_once("@compute")?;
        let (attributes, entry) = entry.split_once("fn main(")?;
        let (ports, body) = entry.split_once(") {")?;
        Some((head, attributes, ports, body))
    };
    let (head, attributes, ports, body) = split()
        .ok_or_else(|| format!("{kernel}.wgsl has no `@compute … fn main(…) {{` to be watched"))?;
    let parameters: Vec<_> = ports.split(',').filter_map(parameter_of).collect();
    let typed: Vec<_> = parameters.iter().map(|(name, kind)| format!("{name}: {kind}")).collect();
    let names: Vec<_> = parameters.iter().map(|(name, _)| *name).collect();
    let (typed, names) = (typed.join(", "), names.join(", "));
    let last_loop = SHADERS.files.iter().find(|file| file.0 == LAST_LOOP).expect("it is there").1;
    Ok(format!(
        "{head}fn kernel_main({typed}) {{{body}\n{last_loop}\n@compute{attributes}fn main({ports}) \
         {{\n    kernel_main({names});\n    make_last_loop();\n}}\n"
    ))
}

/// Name and type of `@builtin(workgroup_id) group: vec3u`.
fn parameter_of(text: &str) -> Option<(&str, &str)> {
    let (_, typed) = text.split_once(')')?;
    let (name, kind) = typed.split_once(':')?;
    Some((name.trim(), kind.trim()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::testing::device;

    #[test]
    fn a_loop_makes_all_turns_or_it_is_told() {
        let Some(opened) = device() else { return };
        // Others must not hear of it.
        let (raw, queue) = (opened.device().clone(), opened.queue().clone());
        let features = opened.features();
        let gpu = Gpu::from_device(raw, queue, "theirs".to_owned(), features).expect("device");
        let count = |asked: u32| {
            let turns = gpu.upload("turns", &[Turns { asked, made: 0 }]).expect("buffer");
            let mut rec = gpu.record(None);
            rec.dispatch(&CountTurns { turns: &turns }, [1, 1, 1]);
            let problem = rec.submit().wait().err();
            (gpu.read(&turns, 1).expect("turns")[0].made, problem.map(|e| e.to_string()))
        };
        assert_eq!(count(60_000), (60_000, None));
        match (count(TRIED), gpu.most_turns()) {
            ((made, None), None) => assert_eq!(made, TRIED),
            ((_, Some(problem)), Some(most)) => {
                let turns = format!("ends the loops of a shader after {most} turns");
                assert!(problem.contains(&turns) && most < TRIED, "{problem}");
            }
            (found, most) => panic!("{found:?} of {most:?}"),
        }
        assert_eq!(count(3), (3, None));
    }
}
