//! Declaring kernels: a shader's entry point with everything it is bound to.

use super::recorder::UniformMemory;
use super::{Place, SceneTraits};

/// How a kernel uses what is bound to a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// A few numbers, the same for all invocations.
    Uniform,
    /// A list that is read.
    Read,
    /// A list that is written, and may be read.
    Write,
    /// A texture of floats that is read texel by texel; its format need not be filterable.
    Texture,
    /// A texture that is written: `rgba16float`, see [`STORE_FORMAT`].
    Store,
}

/// Format of the textures that kernels write.
pub const STORE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;

/// One binding of a kernel; its position in [`KernelInfo::ports`] is its binding index in group 0.
#[derive(Clone, Copy, Debug)]
pub struct Port {
    /// Name in the shader.
    pub name: &'static str,
    /// How it is used.
    pub access: Access,
    /// Bytes of one record; no matter for textures.
    pub size: usize,
    /// Its fields, see [`Record`](super::Record).
    pub fields: &'static [(&'static str, usize)],
}

/// A constant that Rust gives to a shader.
#[derive(Clone, Copy, Debug)]
pub struct Constant {
    /// Name in the shader.
    pub name: &'static str,
    /// Its value.
    pub value: Value,
}

/// Type and value of a [`Constant`].
#[derive(Clone, Copy, Debug)]
pub enum Value {
    /// `u32`
    U32(u32),
    /// `i32`
    I32(i32),
    /// `f32`
    F32(f32),
    /// `bool`
    Bool(bool),
}

/// Everything there is to know about a kernel without a device.
#[derive(Debug)]
pub struct KernelInfo {
    /// Path of the shader below `src`, without extension; its entry point is `main`.
    pub shader: &'static str,
    /// Invocations per workgroup.
    pub workgroup: [u32; 3],
    /// Whether it traces rays or looks at surfaces: group 1 is the scene.
    pub scene: bool,
    /// Constants that the shader and what it imports take from Rust.
    pub constants: &'static [&'static [Constant]],
    /// Bindings in group 0.
    pub ports: &'static [Port],
}

/// What is bound to a port.
#[derive(Clone, Copy, Debug)]
pub enum Bound<'a> {
    /// Some bytes of a buffer.
    Bytes(&'a wgpu::Buffer, Place),
    /// A texture.
    Texture(&'a wgpu::TextureView),
}

impl<'a> Bound<'a> {
    pub(super) fn resource(self) -> wgpu::BindingResource<'a> {
        match self {
            Self::Texture(view) => wgpu::BindingResource::TextureView(view),
            Self::Bytes(buffer, Place { offset, size, .. }) => {
                let size = wgpu::BufferSize::new(size);
                wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer, offset, size })
            }
        }
    }
}

/// A kernel with what is bound to it.
pub trait Kernel {
    /// What it is.
    const INFO: &'static KernelInfo;

    /// What is bound, in the order of the ports; `uniforms` holds the values of uniform ports.
    fn bindings<'a>(&'a self, uniforms: &'a UniformMemory) -> Vec<Bound<'a>>;
}

/// Declares a kernel: a struct with one field per port.
///
/// `kernel! { struct Name = "room/file", [64, 1, 1], scene, [CONSTANTS]; uniform params:
/// Params, shared info: Info, read items: Item, write sums: f32 }`; `scene` and the constants may
/// be left out. A `uniform` is a value of the submission, `shared` the one record of a buffer,
/// bound as a uniform too. `texture normals: [f32; 4]` and `store target: [f32; 4]` are textures
/// that are read and written.
macro_rules! kernel {
    (@access uniform) => { $crate::gpu::Access::Uniform };
    (@access shared) => { $crate::gpu::Access::Uniform };
    (@access read) => { $crate::gpu::Access::Read };
    (@access write) => { $crate::gpu::Access::Write };
    (@access texture) => { $crate::gpu::Access::Texture };
    (@access store) => { $crate::gpu::Access::Store };
    (@type uniform, $type:ty, $life:lifetime) => { $crate::gpu::Uniform<$type> };
    (@type shared, $type:ty, $life:lifetime) => { &$life $crate::gpu::Buf<$type> };
    (@type read, $type:ty, $life:lifetime) => { &$life $crate::gpu::Buf<$type> };
    (@type write, $type:ty, $life:lifetime) => { &$life $crate::gpu::Buf<$type> };
    (@type texture, $type:ty, $life:lifetime) => { &$life wgpu::TextureView };
    (@type store, $type:ty, $life:lifetime) => { &$life wgpu::TextureView };
    (@bind uniform, $value:expr, $uniforms:ident) => { $value.binding($uniforms) };
    (@bind shared, $value:expr, $uniforms:ident) => { $value.binding() };
    (@bind read, $value:expr, $uniforms:ident) => { $value.binding() };
    (@bind write, $value:expr, $uniforms:ident) => { $value.binding() };
    (@bind texture, $value:expr, $uniforms:ident) => { $crate::gpu::Bound::Texture($value) };
    (@bind store, $value:expr, $uniforms:ident) => { $crate::gpu::Bound::Texture($value) };
    (@scene) => { false };
    (@scene scene) => { true };
    ($(#[$meta:meta])* $vis:vis struct $name:ident = $shader:literal, [$x:expr, $y:expr, $z:expr]
        $(, $scene:ident)? $(, [$($constants:expr),* $(,)?])?;
        $($access:ident $port:ident: $type:ty),* $(,)?
    ) => {
        $(#[$meta])*
        #[derive(Debug)]
        #[allow(missing_docs, reason = "ports are described in the shader")]
        $vis struct $name<'a> {
            $(pub $port: $crate::gpu::kernel!(@type $access, $type, 'a),)*
        }
        impl $name<'_> {
            /// What the kernel is.
            pub const INFO: $crate::gpu::KernelInfo = $crate::gpu::KernelInfo {
                shader: $shader,
                workgroup: [$x, $y, $z],
                scene: $crate::gpu::kernel!(@scene $($scene)?),
                constants: &[$($($constants),*)?],
                ports: &[$($crate::gpu::Port {
                    name: stringify!($port),
                    access: $crate::gpu::kernel!(@access $access),
                    size: size_of::<$type>(),
                    fields: <$type as $crate::gpu::Record>::FIELDS,
                },)*],
            };
        }
        impl $crate::gpu::Kernel for $name<'_> {
            const INFO: &'static $crate::gpu::KernelInfo = &$name::INFO;

            fn bindings<'b>(
                &'b self,
                uniforms: &'b $crate::gpu::UniformMemory,
            ) -> Vec<$crate::gpu::Bound<'b>> {
                let _ = uniforms;
                vec![$($crate::gpu::kernel!(@bind $access, self.$port, uniforms),)*]
            }
        }
    };
}
pub(crate) use kernel;

impl KernelInfo {
    /// The constants as shader text, the size of its workgroup, and what is in its scene.
    pub(super) fn prefix(&self, traits: SceneTraits) -> String {
        let mut text = String::new();
        let traits = self.scene.then(|| traits.constants()).into_iter().flatten();
        let traits = traits.map(|(name, value)| Constant { name, value });
        let group = ["GROUP_X", "GROUP_Y", "GROUP_Z"].into_iter().zip(self.workgroup);
        let group = group.map(|(name, n)| Constant { name, value: Value::U32(n) });
        let own = self.constants.iter().copied().flatten().copied();
        for constant in group.chain(own).chain(traits) {
            let (kind, value) = match constant.value {
                Value::U32(v) => ("u32", format!("{v}u")),
                Value::I32(v) => ("i32", format!("{v}i")),
                // All digits that matter; a decimal point or an exponent makes it a float.
                Value::F32(v) => ("f32", format!("{v:e}f")),
                Value::Bool(v) => ("bool", v.to_string()),
            };
            text += &format!("const {}: {kind} = {value};\n", constant.name);
        }
        text
    }

    /// Layout entries of group 0.
    pub(super) fn layout_entries(&self) -> Vec<wgpu::BindGroupLayoutEntry> {
        let entry = |(i, port): (usize, &Port)| wgpu::BindGroupLayoutEntry {
            binding: i as u32,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: port.access.binding_type(),
            count: None,
        };
        self.ports.iter().enumerate().map(entry).collect()
    }
}

impl Access {
    fn binding_type(self) -> wgpu::BindingType {
        let buffer = |ty| wgpu::BindingType::Buffer {
            ty,
            has_dynamic_offset: false,
            min_binding_size: None,
        };
        let view_dimension = wgpu::TextureViewDimension::D2;
        match self {
            Self::Uniform => buffer(wgpu::BufferBindingType::Uniform),
            Self::Read => buffer(wgpu::BufferBindingType::Storage { read_only: true }),
            Self::Write => buffer(wgpu::BufferBindingType::Storage { read_only: false }),
            Self::Texture => wgpu::BindingType::Texture {
                sample_type: wgpu::TextureSampleType::Float { filterable: false },
                view_dimension,
                multisampled: false,
            },
            Self::Store => wgpu::BindingType::StorageTexture {
                access: wgpu::StorageTextureAccess::WriteOnly,
                format: STORE_FORMAT,
                view_dimension,
            },
        }
    }
}
