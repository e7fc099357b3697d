//! One submission: stages and their dispatches, in order.

use super::timer::Timer;
use super::{Buf, Gpu, Kernel, MAX_GROUPS, Record, StageTime};
use crate::error::Error;
use std::marker::PhantomData;
use std::sync::{Arc, Mutex, PoisonError};

/// Bytes from one uniform to the next: the largest alignment a device may ask for.
const UNIFORM_STRIDE: usize = 256;
/// Most uniforms of one submission.
const MOST_UNIFORMS: usize = 4096;

/// A uniform value of one submission.
#[derive(Debug)]
pub struct Uniform<T> {
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
    pub fn binding<'a>(&self, uniforms: &'a wgpu::Buffer) -> wgpu::BindingResource<'a> {
        wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: uniforms,
            offset: self.offset,
            size: wgpu::BufferSize::new(size_of::<T>() as u64),
        })
    }
}

/// Memory that submissions use one after another.
#[derive(Debug)]
pub(super) struct Arena {
    uniforms: wgpu::Buffer,
    timer: Option<Timer>,
}

impl Arena {
    pub fn new(gpu: &Gpu) -> Self {
        let uniforms = gpu.device().create_buffer(&wgpu::BufferDescriptor {
            label: Some("uniforms"),
            size: (UNIFORM_STRIDE * MOST_UNIFORMS) as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
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
    pass: Option<wgpu::ComputePass<'static>>,
    scene: Option<&'g wgpu::BindGroup>,
    arena: Arena,
    uniforms: Vec<u8>,
}

impl<'g> Recorder<'g> {
    /// An empty submission; `scene` is what kernels find in group 1.
    pub fn new(gpu: &'g Gpu, scene: Option<&'g wgpu::BindGroup>) -> Self {
        let encoder = gpu.device().create_command_encoder(&Default::default());
        let mut arena = gpu.take_arena();
        if let Some(timer) = &mut arena.timer {
            timer.clear();
        }
        let commands = Commands::Own(encoder);
        Self { gpu, commands, pass: None, scene, arena, uniforms: Vec::new() }
    }

    /// Records between the commands of someone who submits them later.
    pub(super) fn lend<T>(
        gpu: &'g Gpu,
        encoder: &'g mut wgpu::CommandEncoder,
        scene: Option<&'g wgpu::BindGroup>,
        work: impl FnOnce(&mut Self) -> T,
    ) -> T {
        let (commands, arena) = (Commands::Lent(encoder), gpu.take_arena());
        let mut rec = Self { gpu, commands, pass: None, scene, arena, uniforms: Vec::new() };
        let result = work(&mut rec);
        rec.write_uniforms();
        rec.pass = None;
        let Self { mut commands, arena, .. } = rec;
        // Nobody else writes its uniforms before these commands have run, or were dropped.
        let loan = Loan { arena: Some(arena), shelf: gpu.arenas() };
        commands.encoder().on_submitted_work_done(move || drop(loan));
        result
    }

    /// The device.
    pub fn gpu(&self) -> &'g Gpu {
        self.gpu
    }

    /// Begins a stage: what follows is timed under this name.
    pub fn stage(&mut self, name: &'static str) {
        self.pass = None;
        // Someone else's commands are timed by whom they belong to.
        let timer = self.arena.timer.as_mut().filter(|_| matches!(self.commands, Commands::Own(_)));
        let timestamp_writes = timer.and_then(|t| t.next(name));
        let descriptor = wgpu::ComputePassDescriptor { label: Some(name), timestamp_writes };
        let encoder = self.commands.encoder();
        self.pass = Some(encoder.begin_compute_pass(&descriptor).forget_lifetime());
    }

    /// The commands, between passes.
    pub(super) fn encoder(&mut self) -> &mut wgpu::CommandEncoder {
        self.pass = None;
        self.commands.encoder()
    }

    /// A uniform of this submission.
    ///
    /// Panics: beyond 4096 uniforms, which no frame needs
    pub fn uniform<T: Record>(&mut self, value: &T) -> Uniform<T> {
        let offset = self.uniforms.len();
        assert!(offset < UNIFORM_STRIDE * MOST_UNIFORMS, "too many uniforms in one submission");
        self.uniforms.extend_from_slice(bytemuck::bytes_of(value));
        self.uniforms.resize(offset + size_of::<T>().next_multiple_of(UNIFORM_STRIDE), 0);
        Uniform { offset: offset as u64, holds: PhantomData }
    }

    /// Runs a kernel in a grid of workgroups.
    pub fn dispatch<K: Kernel>(&mut self, kernel: &K, [x, y, z]: [u32; 3]) {
        if x > 0 && y > 0 && z > 0 {
            self.bind(kernel).dispatch_workgroups(x, y, z);
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
        self.bind(kernel).dispatch_workgroups_indirect(groups.raw(), offset);
    }

    /// Sets a kernel and everything bound to it.
    fn bind<K: Kernel>(&mut self, kernel: &K) -> &mut wgpu::ComputePass<'static> {
        if self.pass.is_none() {
            self.stage("unnamed");
        }
        let pipeline = self.gpu.pipeline(K::INFO);
        let bindings = kernel.bindings(&self.arena.uniforms);
        let entries: Vec<_> = bindings
            .into_iter()
            .enumerate()
            .map(|(i, resource)| wgpu::BindGroupEntry { binding: i as u32, resource })
            .collect();
        let group = self.gpu.device().create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(K::INFO.shader),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries,
        });
        let pass = self.pass.as_mut().expect("begun above");
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &group, &[]);
        if K::INFO.scene {
            pass.set_bind_group(1, self.scene.expect("a scene for a kernel that needs it"), &[]);
        }
        pass
    }

    /// Copies records from one buffer to the start of another.
    pub fn copy<T: Record>(&mut self, from: &Buf<T>, first: usize, to: &Buf<T>, count: usize) {
        let size = size_of::<T>() as u64;
        let (start, bytes) = (from.offset() + first as u64 * size, count as u64 * size);
        self.encoder().copy_buffer_to_buffer(from.raw(), start, to.raw(), to.offset(), bytes);
    }

    /// Hands the work to the device.
    pub fn submit(self) -> Submitted<'g> {
        self.write_uniforms();
        let Self { gpu, commands, pass, arena, .. } = self;
        drop(pass);
        if let Commands::Own(mut encoder) = commands {
            if let Some(timer) = &arena.timer {
                timer.resolve(&mut encoder);
            }
            gpu.queue().submit([encoder.finish()]);
        }
        // Later writes to it come after this submission.
        Submitted { gpu, loan: Loan { arena: Some(arena), shelf: gpu.arenas() } }
    }

    /// Before whatever is submitted next.
    fn write_uniforms(&self) {
        if !self.uniforms.is_empty() {
            self.gpu.queue().write_buffer(&self.arena.uniforms, 0, &self.uniforms);
        }
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
    loan: Loan,
}

impl Submitted<'_> {
    /// Waits for the end and tells what the stages took; empty where the device has no clock.
    ///
    /// Errors: what the device reported
    pub fn wait(self) -> Result<Vec<StageTime>, Error> {
        self.gpu.wait()?;
        let timer = self.loan.arena.as_ref().and_then(|arena| arena.timer.as_ref());
        timer.map_or(Ok(Vec::new()), |timer| timer.read(self.gpu))
    }
}
