//! One submission: stages and their dispatches, in order.

use super::groups::Key;
use super::loops::LAST_LOOP_GROUP;
use super::timer::Timer;
use super::{
    Bound, Buf, Gpu, HeldBytes, Kernel, KernelInfo, Later, MAX_GROUPS, Place, Record, SceneGroup,
    SceneTraits, StageTime,
};
use crate::error::Error;
use std::marker::PhantomData;
use std::sync::{Arc, Mutex, PoisonError};

/// Bytes from one uniform to the next: the largest alignment a device may ask for.
const UNIFORM_STRIDE: usize = 256;
/// Bytes of the uniforms that share a buffer.
const PAGE_BYTES: usize = 4096 * UNIFORM_STRIDE;

/// A uniform value of one submission.
#[derive(Debug)]
pub struct Uniform<T> {
    page: usize,
    offset: u64,
    holds: PhantomData<fn() -> T>,
}

impl<T> Clone for Uniform<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Uniform<T> {}

impl<T> Uniform<T> {
    /// Where it lies in the submission's uniforms.
    pub fn binding<'a>(&self, uniforms: &'a UniformMemory) -> Bound<'a> {
        let page = &uniforms.pages[self.page];
        let (memory, offset, size) = (page.held.memory, self.offset, size_of::<T>() as u64);
        Bound::Bytes(&page.raw, Place { memory, offset, size })
    }
}

/// Where the uniforms of a submission lie: as many pages as it needs.
#[derive(Debug)]
pub struct UniformMemory {
    pages: Vec<UniformPage>,
}

#[derive(Debug)]
struct UniformPage {
    raw: wgpu::Buffer,
    held: HeldBytes,
}

impl UniformPage {
    fn new(gpu: &Gpu) -> Self {
        let raw = gpu.device().create_buffer(&wgpu::BufferDescriptor {
            label: Some("uniforms"),
            size: PAGE_BYTES as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        Self { raw, held: gpu.hold_bytes("uniforms", PAGE_BYTES as u64) }
    }
}

/// Memory that submissions use one after another.
#[derive(Debug)]
pub(super) struct Arena {
    uniforms: UniformMemory,
    timer: Option<Timer>,
}

impl Arena {
    pub fn new(gpu: &Gpu) -> Self {
        let uniforms = UniformMemory { pages: vec![UniformPage::new(gpu)] };
        Self { uniforms, timer: Timer::new(gpu) }
    }
}

/// An arena that goes back to its shelf when nobody needs what is in it.
#[derive(Debug)]
struct Loan {
    arena: Option<Arena>,
    shelf: Arc<Mutex<Vec<Arena>>>,
}

impl Drop for Loan {
    fn drop(&mut self) {
        self.shelf.lock().unwrap_or_else(PoisonError::into_inner).extend(self.arena.take());
    }
}

/// What is encoded as soon as all pipelines are there.
#[derive(Debug)]
enum Waiting {
    Stage(&'static str),
    Run { kernel: &'static KernelInfo, group: wgpu::BindGroup, grid: Grid },
}

/// How many workgroups run.
#[derive(Debug)]
enum Grid {
    Size([u32; 3]),
    /// Those written there.
    Written(wgpu::Buffer, u64),
}

/// Where commands go.
#[derive(Debug)]
enum Commands<'g> {
    /// Into a submission of their own.
    Own(wgpu::CommandEncoder),
    /// Among those of someone who submits them later.
    Lent(&'g mut wgpu::CommandEncoder),
}

/// Records dispatches into one submission.
#[derive(Debug)]
pub struct Recorder<'g> {
    gpu: &'g Gpu,
    commands: Commands<'g>,
    waiting: Vec<Waiting>,
    pass: Option<wgpu::ComputePass<'static>>,
    scene: Option<&'g SceneGroup>,
    arena: Arena,
    uniforms: Vec<u8>,
}

impl<'g> Recorder<'g> {
    /// An empty submission; `scene` is what kernels find in group 1.
    pub fn new(gpu: &'g Gpu, scene: Option<&'g SceneGroup>) -> Self {
        let encoder = gpu.device().create_command_encoder(&Default::default());
        let mut arena = gpu.take_arena();
        if let Some(timer) = &mut arena.timer {
            timer.clear();
        }
        let commands = Commands::Own(encoder);
        Self::with(gpu, commands, scene, arena)
    }

    /// Records between the commands of someone who submits them later.
    pub(super) fn lend<T>(
        gpu: &'g Gpu,
        encoder: &'g mut wgpu::CommandEncoder,
        scene: Option<&'g SceneGroup>,
        work: impl FnOnce(&mut Self) -> T,
    ) -> T {
        let (commands, arena) = (Commands::Lent(encoder), gpu.take_arena());
        let mut rec = Self::with(gpu, commands, scene, arena);
        let result = work(&mut rec);
        rec.write_uniforms();
        rec.encoder();
        let Self { mut commands, arena, .. } = rec;
        // Nobody else writes its uniforms before these commands have run, or were dropped.
        let loan = Loan { arena: Some(arena), shelf: gpu.arenas() };
        commands.encoder().on_submitted_work_done(move || drop(loan));
        result
    }

    fn with(
        gpu: &'g Gpu,
        commands: Commands<'g>,
        scene: Option<&'g SceneGroup>,
        arena: Arena,
    ) -> Self {
        let (waiting, uniforms) = (Vec::new(), Vec::new());
        Self { gpu, commands, waiting, pass: None, scene, arena, uniforms }
    }

    /// The device.
    pub fn gpu(&self) -> &'g Gpu {
        self.gpu
    }

    /// Begins a stage: what follows is timed under this name.
    pub fn stage(&mut self, name: &'static str) {
        self.waiting.push(Waiting::Stage(name));
    }

    /// The commands, between passes; all that was recorded before is among them.
    pub(super) fn encoder(&mut self) -> &mut wgpu::CommandEncoder {
        self.encode();
        self.pass = None;
        self.commands.encoder()
    }

    /// Encodes what waits, with its pipelines.
    fn encode(&mut self) {
        let waiting = std::mem::take(&mut self.waiting);
        let kernels = waiting.iter().filter_map(|w| match w {
            Waiting::Stage(_) => None,
            Waiting::Run { kernel, .. } => Some(*kernel),
        });
        self.gpu.build_pipelines(kernels, self.traits());
        for command in waiting {
            match command {
                Waiting::Stage(name) => self.begin_pass(name),
                Waiting::Run { kernel, group, grid } => self.encode_run(kernel, &group, &grid),
            }
        }
    }

    /// What kernels are built for.
    fn traits(&self) -> SceneTraits {
        self.scene.map_or(SceneTraits::ALL, |scene| scene.traits)
    }

    fn begin_pass(&mut self, name: &'static str) {
        self.pass = None;
        // Someone else's commands are timed by whom they belong to.
        let timer = self.arena.timer.as_mut().filter(|_| matches!(self.commands, Commands::Own(_)));
        let timestamp_writes = timer.and_then(|t| t.next(name));
        let descriptor = wgpu::ComputePassDescriptor { label: Some(name), timestamp_writes };
        let encoder = self.commands.encoder();
        self.pass = Some(encoder.begin_compute_pass(&descriptor).forget_lifetime());
    }

    fn encode_run(&mut self, kernel: &'static KernelInfo, group: &wgpu::BindGroup, grid: &Grid) {
        if self.pass.is_none() {
            self.begin_pass("unnamed");
        }
        let pipeline = self.gpu.pipeline(kernel, self.traits());
        let pass = self.pass.as_mut().expect("begun above");
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, group, &[]);
        if kernel.scene {
            let scene = self.scene.expect("a scene for a kernel that needs it");
            pass.set_bind_group(1, &scene.group, &[]);
        }
        if let Some(watch) = self.gpu.watch() {
            pass.set_bind_group(LAST_LOOP_GROUP, &watch.group, &[]);
        }
        match grid {
            Grid::Size([x, y, z]) => pass.dispatch_workgroups(*x, *y, *z),
            Grid::Written(groups, offset) => pass.dispatch_workgroups_indirect(groups, *offset),
        }
    }

    /// A uniform of this submission.
    pub fn uniform<T: Record>(&mut self, value: &T) -> Uniform<T> {
        const { assert!(size_of::<T>() <= UNIFORM_STRIDE) };
        let first = self.uniforms.len();
        let (page, offset) = (first / PAGE_BYTES, (first % PAGE_BYTES) as u64);
        let pages = &mut self.arena.uniforms.pages;
        if page == pages.len() {
            pages.push(UniformPage::new(self.gpu));
        }
        self.uniforms.extend_from_slice(bytemuck::bytes_of(value));
        self.uniforms.resize(first + UNIFORM_STRIDE, 0);
        Uniform { page, offset, holds: PhantomData }
    }

    /// Runs a kernel in a grid of workgroups.
    pub fn dispatch<K: Kernel>(&mut self, kernel: &K, [x, y, z]: [u32; 3]) {
        if x > 0 && y > 0 && z > 0 {
            self.run(kernel, Grid::Size([x, y, z]));
        }
    }

    /// Runs a kernel over a list: enough workgroups for `count` items, folded into two dimensions
    /// where there are many.
    pub fn dispatch_items<K: Kernel>(&mut self, kernel: &K, count: usize) {
        let groups = (count as u64).div_ceil(u64::from(K::INFO.workgroup[0]));
        let rows = groups.div_ceil(u64::from(MAX_GROUPS)).max(1);
        self.dispatch(kernel, [groups.div_ceil(rows) as u32, rows as u32, 1]);
    }

    /// Runs a kernel over a picture: enough workgroups for its pixels.
    pub fn dispatch_pixels<K: Kernel>(&mut self, kernel: &K, width: usize, height: usize) {
        let [x, y, _] = K::INFO.workgroup.map(|side| side as usize);
        self.dispatch(kernel, [width.div_ceil(x) as u32, height.div_ceil(y) as u32, 1]);
    }

    /// Runs a kernel in a grid of workgroups that the device has written at `index` of `groups`.
    pub fn dispatch_indirect<K: Kernel>(
        &mut self,
        kernel: &K,
        groups: &Buf<[u32; 3]>,
        index: usize,
    ) {
        let offset = groups.offset() + (index * size_of::<[u32; 3]>()) as u64;
        self.run(kernel, Grid::Written(groups.raw().clone(), offset));
    }

    /// Records a kernel with everything that is bound to it.
    fn run<K: Kernel>(&mut self, kernel: &K, grid: Grid) {
        let bindings = kernel.bindings(&self.arena.uniforms);
        let make = || {
            let resources = bindings.iter().map(|bound| bound.resource()).enumerate();
            let entries =
                resources.map(|(i, resource)| wgpu::BindGroupEntry { binding: i as u32, resource });
            self.gpu.device().create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some(K::INFO.shader),
                layout: &self.gpu.stage_layout(K::INFO),
                entries: &entries.collect::<Vec<_>>(),
            })
        };
        let group = match Key::new(K::INFO, &bindings) {
            Some(key) => self.gpu.account().groups.get(key, make),
            None => make(),
        };
        self.gpu.count_dispatch();
        self.waiting.push(Waiting::Run { kernel: K::INFO, group, grid });
    }

    /// Copies records from one buffer to the start of another.
    pub fn copy<T: Record>(&mut self, from: &Buf<T>, first: usize, to: &Buf<T>, count: usize) {
        let size = size_of::<T>() as u64;
        let (start, bytes) = (from.offset() + first as u64 * size, count as u64 * size);
        self.encoder().copy_buffer_to_buffer(from.raw(), start, to.raw(), to.offset(), bytes);
    }

    /// Hands the work to the device.
    pub fn submit(mut self) -> Submitted<'g> {
        self.write_uniforms();
        let watched = self.gpu.watch().map(|_| self.read_later(&[]));
        self.encoder();
        let Self { gpu, commands, mut arena, .. } = self;
        if let Commands::Own(mut encoder) = commands {
            if let Some(timer) = &mut arena.timer {
                timer.resolve(&mut encoder);
            }
            gpu.queue().submit([encoder.finish()]);
        }
        // Later writes to it come after this submission.
        Submitted { gpu, watched, loan: Loan { arena: Some(arena), shelf: gpu.arenas() } }
    }

    /// Before whatever is submitted next.
    fn write_uniforms(&self) {
        let pages = self.uniforms.chunks(PAGE_BYTES).zip(&self.arena.uniforms.pages);
        pages.for_each(|(bytes, page)| self.gpu.queue().write_buffer(&page.raw, 0, bytes));
    }
}

impl Commands<'_> {
    fn encoder(&mut self) -> &mut wgpu::CommandEncoder {
        match self {
            Self::Own(encoder) => encoder,
            Self::Lent(encoder) => encoder,
        }
    }
}

/// Work that the device has been given.
#[derive(Debug)]
pub struct Submitted<'g> {
    gpu: &'g Gpu,
    /// What comes back where the driver ends loops early.
    watched: Option<Later>,
    loan: Loan,
}

impl Submitted<'_> {
    /// Waits for the end and tells what the stages took; empty where the device has no clock.
    ///
    /// Errors: what the device reported; the driver ended loops early
    pub fn wait(mut self) -> Result<Vec<StageTime>, Error> {
        self.gpu.wait()?;
        if let Some(watched) = &self.watched {
            watched.bytes(self.gpu)?;
        }
        let timer = self.loan.arena.as_mut().and_then(|arena| arena.timer.as_mut());
        timer.map_or(Ok(Vec::new()), |timer| timer.take(self.gpu))
    }
}
