//! Opening a device, its pipelines, and reading back from it.

use super::adapter::{GpuOptions, MOST_TEXTURES, choose, device_descriptor, lacks};
use super::buffer::{Account, HeldBytes};
use super::features::smallest;
use super::loops::{Loops, Watch};
use super::pipelines::PipelineKey;
use super::recorder::{Arena, Recorder};
#[cfg(debug_assertions)]
use super::reload::Reload;
use super::{Buf, Feature, Features, Record, SceneGroup};
use crate::error::Error;
use std::collections::HashMap;
use std::num::NonZeroU32;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// After which work that is not done counts as lost, unless someone asked for another time.
const TIMEOUT: Duration = Duration::from_secs(600);
/// Most bytes that are copied back at a time, unless one list has more.
const MOST_STAGED: u64 = 128 << 20;

/// An open device.
#[derive(Debug)]
pub struct Gpu {
    device: wgpu::Device,
    queue: wgpu::Queue,
    /// Name of the adapter and its driver.
    name: String,
    features: Features,
    limits: wgpu::Limits,
    /// After which work that is not done counts as lost.
    timeout: Option<Duration>,
    /// Whether every loop counts its turns, so that one without end cannot hang the device.
    pub(super) bounds_loops: AtomicBool,
    scene_layout: wgpu::BindGroupLayout,
    /// Whether its driver makes all turns of a loop.
    loops: Loops,
    /// By the path of the shader, and what is in its scene.
    pub(super) pipelines: Mutex<HashMap<PipelineKey, wgpu::ComputePipeline>>,
    /// By the path of the shader.
    pub(super) stage_layouts: Mutex<HashMap<&'static str, wgpu::BindGroupLayout>>,
    /// Shader files that may change; locked after `pipelines`.
    #[cfg(debug_assertions)]
    pub(super) reload: Mutex<Option<Reload>>,
    /// Those that no recording holds.
    arenas: Arc<Mutex<Vec<Arena>>>,
    account: Arc<Account>,
    dispatches: AtomicU64,
    /// The first thing that went wrong on the device.
    problem: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    /// Opens a device, with less than was asked for where it does not open with all that it offers;
    /// [`Gpu::features`] tells.
    ///
    /// Errors: no adapter, none of that name, or what the chosen one lacks
    pub fn open(options: &GpuOptions) -> Result<Self, Error> {
        if options.shaders.is_some() && !cfg!(debug_assertions) {
            let problem =
                "gpu.shaders: only builds with debug assertions take shaders from a folder";
            return Err(device(problem.to_owned()));
        }
        let (description, adapter) = choose(options)?;
        let open = |&features: &Features| {
            let asked = device_descriptor(&adapter, &GpuOptions { features, ..options.clone() });
            pollster::block_on(adapter.request_device(&asked)).map(|opened| (opened, features))
        };
        let tried = options.features.fewer();
        let mut opened = tried.iter().map(open);
        let first = opened.next().expect("what was asked for is tried first");
        let ((raw, queue), features) = first
            .or_else(|problem| opened.find_map(Result::ok).ok_or(problem))
            .map_err(|e| device(format!("{} does not open: {e}", description.name)))?;
        let name = format!("{}, {}", description.name, description.driver);
        let mut gpu = Self::with_features(raw, queue, name, features)?;
        let timeout = Some(TIMEOUT).filter(|_| !gpu.is_emulated());
        gpu.give_up_after(options.timeout.or(timeout));
        if options.base {
            gpu.bound_loops();
        }
        gpu.listen();
        #[cfg(debug_assertions)]
        if let Some(folder) = &options.shaders {
            gpu.reload_from(folder);
        }
        Ok(gpu)
    }

    /// Takes a device that someone else opened. What goes wrong on it is told by the functions that
    /// did it; the device's own handlers are left alone. Of `features` those are used that it was
    /// opened with, but textures are not bound one by one; ray queries also need limits for
    /// acceleration structures, and without [`Feature::LargeLimits`] lists have at most 128 MiB
    /// whatever the device allows.
    ///
    /// Make its `wgpu::Instance` without `InstanceFlags::VALIDATION_INDIRECT_CALL`, which is among
    /// the default flags: else wgpu checks each indirect dispatch, some fifty a frame, by one of
    /// its own. Those of this library are clamped where they are written.
    ///
    /// On a device that is emulated on the processor this submits work and waits for it, to see
    /// whether it makes all turns of a loop; see [`Gpu::most_turns`].
    ///
    /// Errors: less than `wgpu::Limits::defaults()`
    pub fn from_device(
        device: wgpu::Device,
        queue: wgpu::Queue,
        name: String,
        features: Features,
    ) -> Result<Self, Error> {
        Self::with_features(device, queue, name, features.without(Feature::Bindless))
    }

    fn with_features(
        device: wgpu::Device,
        queue: wgpu::Queue,
        name: String,
        wanted: Features,
    ) -> Result<Self, Error> {
        let lacks = lacks(&device.limits());
        if !lacks.is_empty() {
            let problem = format!("{name} was opened with too little: {}", lacks.join(", "));
            return Err(Error::Device { problem });
        }
        let features = wanted.offered_by(device.features(), &device.limits());
        let scene_layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("scene"),
            entries: &scene_entries(features, most_textures(features, &device.limits())),
        });
        let limits = match features.has(Feature::LargeLimits) {
            true => device.limits(),
            false => smallest(device.limits()),
        };
        let mut gpu = Self {
            features,
            limits,
            timeout: None,
            bounds_loops: AtomicBool::default(),
            device,
            queue,
            name,
            scene_layout,
            loops: Loops::default(),
            pipelines: Mutex::default(),
            stage_layouts: Mutex::default(),
            #[cfg(debug_assertions)]
            reload: Mutex::default(),
            arenas: Arc::default(),
            account: Arc::default(),
            dispatches: AtomicU64::default(),
            problem: Arc::default(),
        };
        gpu.loops = gpu.guard(|| Loops::new(&gpu))?;
        // The kernel that counted turns has no last loop.
        gpu.pipelines = Mutex::default();
        Ok(gpu)
    }

    /// After which work that is not done counts as lost, see [`Gpu::wait`]; `None`: never, as on a
    /// device that someone else opened.
    pub fn give_up_after(&mut self, timeout: Option<Duration>) {
        self.timeout = timeout;
    }

    /// Gives every loop of kernels that are not built yet a counter, so that none can hang the
    /// device; with it all take longer. Done by [`GpuOptions::base`] and where shaders are taken
    /// from a folder.
    pub fn bound_loops(&self) {
        self.bounds_loops.store(true, Ordering::Relaxed);
    }

    /// Keeps the first thing that goes wrong for [`Gpu::check`].
    fn listen(&self) {
        let keep = || {
            let problem = self.problem.clone();
            move |text: String| {
                let mut first = problem.lock().unwrap_or_else(PoisonError::into_inner);
                first.get_or_insert(text);
            }
        };
        let (keep_error, keep_loss) = (keep(), keep());
        self.device.on_uncaptured_error(Arc::new(move |e: wgpu::Error| keep_error(one_line(&e))));
        self.device.set_device_lost_callback(move |reason, text| {
            keep_loss(format!(
                "the device was lost: {}",
                if text.is_empty() { format!("{reason:?}") } else { text }
            ));
        });
    }

    /// The device behind it.
    pub fn device(&self) -> &wgpu::Device {
        &self.device
    }

    /// Its queue.
    pub fn queue(&self) -> &wgpu::Queue {
        &self.queue
    }

    /// Name of the adapter and its driver.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether the processor does the work of the device.
    pub fn is_emulated(&self) -> bool {
        self.device.adapter_info().device_type == wgpu::DeviceType::Cpu
    }

    /// What kernels make use of beyond what every device has.
    pub fn features(&self) -> Features {
        self.features
    }

    /// Limits that this library keeps to: those of the device with [`Feature::LargeLimits`], else
    /// the smallest for lists, buffers and textures.
    pub fn limits(&self) -> &wgpu::Limits {
        &self.limits
    }

    /// How many textures the scene may bind one by one; `None` where it binds an array of pages.
    pub fn most_textures(&self) -> Option<u32> {
        most_textures(self.features, &self.limits).map(NonZeroU32::get)
    }

    /// Bytes of all buffers that are held at present.
    pub fn bytes(&self) -> u64 {
        self.lists().iter().map(|(_, bytes)| bytes).sum()
    }

    /// Bytes of all buffers and textures that are held at present, by name, the most first.
    pub fn lists(&self) -> Vec<(&'static str, u64)> {
        self.account.list()
    }

    /// Dispatches that were recorded so far, those for which the device counts no workgroup among
    /// them. Nearly all wait for the one before.
    pub fn dispatches(&self) -> u64 {
        self.dispatches.load(Ordering::Relaxed)
    }

    pub(super) fn count_dispatch(&self) {
        self.dispatches.fetch_add(1, Ordering::Relaxed);
    }

    /// Keeps account of memory that is no [`Buf`], until the account is dropped.
    pub fn hold_bytes(&self, name: &'static str, bytes: u64) -> HeldBytes {
        HeldBytes::new(self.account.clone(), name, bytes)
    }

    /// What is kept about its memory.
    pub(super) fn account(&self) -> &Account {
        &self.account
    }

    /// Most bytes of one list.
    pub fn max_list_bytes(&self) -> u64 {
        self.limits.max_storage_buffer_binding_size.min(self.limits.max_buffer_size)
    }

    /// Turns after which the driver ends all loops of an invocation, whatever is left to do; `None`
    /// where it does not. What needs more fails with a sentence where its submission is waited for
    /// or its records come back, if a kernel may bind a ninth list on the device (a tenth with
    /// textures bound one by one). 65,535 on software Vulkan of Mesa 22.
    pub fn most_turns(&self) -> Option<u32> {
        self.loops.most_turns
    }

    /// The last loop of all kernels, where the driver ends loops early.
    pub(super) fn watch(&self) -> Option<&Watch> {
        self.loops.watch.as_ref()
    }

    /// Whether shaders may change while the program runs; see `gpu.shaders`.
    pub fn reloads_shaders(&self) -> bool {
        #[cfg(debug_assertions)]
        return self.reload.lock().unwrap_or_else(PoisonError::into_inner).is_some();
        #[cfg(not(debug_assertions))]
        false
    }

    /// Layout of group 1: the scene's records and textures.
    pub fn scene_layout(&self) -> &wgpu::BindGroupLayout {
        &self.scene_layout
    }

    /// A buffer of zeros.
    ///
    /// Errors: more bytes than one binding of this device may have, or than it has left
    pub fn buffer<T: Record>(&self, name: &'static str, len: usize) -> Result<Buf<T>, Error> {
        let most = self.max_list_bytes();
        let needed = (len as u64).saturating_mul(size_of::<T>() as u64);
        if needed > most {
            return Err(device(format!(
                "the list of {name} needs {needed} bytes, and {} allows {most} in one; render \
                 with fewer virtual lights or pixels, or with --backend cpu",
                self.name
            )));
        }
        let scope = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let buffer = Buf::new(self, name, len);
        match pollster::block_on(scope.pop()) {
            None => Ok(buffer),
            Some(_) => Err(device(format!(
                "the list of {name} needs {needed} bytes, and {} has no room for it beside {} \
                 bytes of other lists; render with fewer virtual lights or pixels, or with \
                 --backend cpu",
                self.name,
                self.bytes().saturating_sub(buffer.raw().size()),
            ))),
        }
    }

    /// Does something and tells what went wrong on the device meanwhile, whoever opened it.
    ///
    /// Errors: as `work`, and what the device reported
    pub fn guard<T>(&self, work: impl FnOnce() -> Result<T, Error>) -> Result<T, Error> {
        use wgpu::ErrorFilter::{Internal, OutOfMemory, Validation};
        let scopes = [OutOfMemory, Internal, Validation].map(|f| self.device.push_error_scope(f));
        let result = work();
        // The last one first.
        let problems = scopes.into_iter().rev().map(|scope| pollster::block_on(scope.pop()));
        let problems: Vec<_> = problems.collect();
        match problems.into_iter().flatten().next() {
            Some(e) => {
                // What was made meanwhile may be of no use.
                self.account.groups.clear();
                // Whatever is done on a lost device goes wrong; polling tells of the loss.
                self.poll()?;
                result.and(Err(self.problem(&one_line(&e))))
            }
            None => result,
        }
    }

    /// A buffer that holds some records.
    ///
    /// Errors: as [`Gpu::buffer`]
    pub fn upload<T: Record>(&self, name: &'static str, items: &[T]) -> Result<Buf<T>, Error> {
        let buffer = self.buffer(name, items.len())?;
        self.write(&buffer, items);
        Ok(buffer)
    }

    /// Overwrites the first records of a buffer, before any work submitted later.
    pub fn write<T: Record>(&self, buffer: &Buf<T>, items: &[T]) {
        if !items.is_empty() {
            self.queue.write_buffer(buffer.raw(), buffer.offset(), bytemuck::cast_slice(items));
        }
    }

    /// Waits for the device and copies the first `count` records of a buffer back.
    ///
    /// Errors: what the device reported
    pub fn read<T: Record>(&self, buffer: &Buf<T>, count: usize) -> Result<Vec<T>, Error> {
        let count = count.min(buffer.len());
        if count == 0 {
            return Ok(Vec::new());
        }
        Ok(self.read_each(&[buffer], count, |_, items| items.to_vec())?.remove(0))
    }

    /// Waits for the device and makes something of the first records of each of some buffers, of
    /// which every one has that many; `make` is given the position of the buffer too. As many are
    /// copied at a time as 128 MiB hold, one at least.
    ///
    /// Errors: what the device reported
    pub fn read_each<T: Record, M>(
        &self,
        buffers: &[&Buf<T>],
        count: usize,
        mut make: impl FnMut(usize, &[T]) -> M,
    ) -> Result<Vec<M>, Error> {
        let size = Buf::<T>::bytes(count);
        let mut made = Vec::with_capacity(buffers.len());
        for some in buffers.chunks((MOST_STAGED / size).max(1) as usize) {
            let mut encoder = self.device.create_command_encoder(&Default::default());
            let stage = |buffer: &&Buf<T>| {
                let mapped = self.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("read back"),
                    size,
                    usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                    mapped_at_creation: false,
                });
                encoder.copy_buffer_to_buffer(buffer.raw(), buffer.offset(), &mapped, 0, size);
                encoder.map_buffer_on_submit(&mapped, wgpu::MapMode::Read, .., |_| ());
                mapped
            };
            let staged: Vec<_> = some.iter().map(stage).collect();
            self.queue.submit([encoder.finish()]);
            self.wait()?;
            for mapped in staged {
                let view = mapped.slice(..).get_mapped_range().map_err(|e| device(one_line(&e)))?;
                let items = bytemuck::cast_slice(&view[..count * size_of::<T>()]);
                made.push(make(made.len(), items));
            }
        }
        Ok(made)
    }

    /// Waits until all submitted work is done.
    ///
    /// Errors: what the device reported since it was opened; work that is not done in time, whoever
    /// submitted it, after which the device is of no use
    pub fn wait(&self) -> Result<(), Error> {
        self.check()?;
        let timeout = self.timeout;
        match self.device.poll(wgpu::PollType::Wait { submission_index: None, timeout }) {
            Ok(_) => {}
            Err(wgpu::PollError::Timeout) => self.give_up(),
            Err(e) => return Err(self.problem(&one_line(&e))),
        }
        self.check()
    }

    /// The device may never be done: whatever is asked of it from now on is refused.
    fn give_up(&self) {
        // The last owner would wait for it; and must where it works inside this process, which
        // cannot end before.
        if !self.is_emulated() {
            std::mem::forget((self.device.clone(), self.queue.clone()));
        }
        let seconds = self.timeout.unwrap_or_default().as_secs_f32();
        let problem = format!(
            "its work is not done after {seconds} s; render with --backend cpu, or give it more \
             time with --set gpu.timeout=SECONDS"
        );
        self.problem.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(problem);
    }

    /// Makes known what is done, without waiting.
    ///
    /// Errors: what the device reported since it was opened
    pub fn poll(&self) -> Result<(), Error> {
        let polled = self.device.poll(wgpu::PollType::Poll);
        polled.map_err(|e| self.problem(&one_line(&e)))?;
        self.check()
    }

    /// An error of this device.
    pub(super) fn problem(&self, text: &str) -> Error {
        device(format!("{}: {text}", self.name))
    }

    /// Errors: the first thing that went wrong on the device
    pub fn check(&self) -> Result<(), Error> {
        match &*self.problem.lock().unwrap_or_else(PoisonError::into_inner) {
            None => Ok(()),
            Some(problem) => Err(self.problem(problem)),
        }
    }

    /// A recorder of one submission; `scene` is what kernels find in group 1.
    pub fn record<'g>(&'g self, scene: Option<&'g SceneGroup>) -> Recorder<'g> {
        #[cfg(debug_assertions)]
        self.reload_shaders();
        Recorder::new(self, scene)
    }

    /// Records between the commands of an encoder that someone else submits later.
    ///
    /// Several recordings may wait for one submission, and several submissions may run at a time:
    /// each has uniforms of its own until it is done.
    pub fn record_into<'g, T>(
        &'g self,
        encoder: &'g mut wgpu::CommandEncoder,
        scene: Option<&'g SceneGroup>,
        work: impl FnOnce(&mut Recorder<'g>) -> T,
    ) -> T {
        #[cfg(debug_assertions)]
        self.reload_shaders();
        Recorder::lend(self, encoder, scene, work)
    }

    pub(super) fn take_arena(&self) -> Arena {
        let kept = self.arenas.lock().unwrap_or_else(PoisonError::into_inner).pop();
        kept.unwrap_or_else(|| Arena::new(self))
    }

    pub(super) fn arenas(&self) -> Arc<Mutex<Vec<Arena>>> {
        self.arenas.clone()
    }
}

/// How many textures are bound one by one, if any.
fn most_textures(features: Features, limits: &wgpu::Limits) -> Option<NonZeroU32> {
    let most = limits.max_binding_array_elements_per_shader_stage.min(MOST_TEXTURES);
    NonZeroU32::new(most).filter(|_| features.has(Feature::Bindless))
}

/// Group 1 of kernels that trace rays: info, nodes, triangles, geometry, sources, textures, the
/// hierarchy of the hardware where it follows rays, and the map of the sky. Beside textures that
/// are bound one by one no uniform may stand.
fn scene_entries(
    features: Features,
    most_textures: Option<NonZeroU32>,
) -> Vec<wgpu::BindGroupLayoutEntry> {
    let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty,
        count: None,
    };
    let buffer =
        |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    let list = || buffer(wgpu::BufferBindingType::Storage { read_only: true });
    let texture = |view_dimension| wgpu::BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Uint,
        view_dimension,
        multisampled: false,
    };
    let (info, textures) = match most_textures {
        None => {
            let pages = entry(5, texture(wgpu::TextureViewDimension::D2Array));
            (buffer(wgpu::BufferBindingType::Uniform), pages)
        }
        count => {
            let each = entry(5, texture(wgpu::TextureViewDimension::D2));
            (list(), wgpu::BindGroupLayoutEntry { count, ..each })
        }
    };
    let mut entries = vec![
        entry(0, info),
        entry(1, list()),
        entry(2, list()),
        entry(3, list()),
        entry(4, list()),
        textures,
        entry(7, texture(wgpu::TextureViewDimension::D2)),
    ];
    if features.has(Feature::RayQueries) {
        let tree = wgpu::BindingType::AccelerationStructure { vertex_return: false };
        entries.push(entry(6, tree));
    }
    entries
}

fn device(problem: String) -> Error {
    Error::Device { problem }
}

/// A message of several lines in one.
fn one_line(error: &dyn std::error::Error) -> String {
    let text = error.to_string();
    text.lines().map(str::trim).filter(|l| !l.is_empty()).collect::<Vec<_>>().join(" ")
}
