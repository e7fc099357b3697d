//! A small rasterizer that knows nothing of light: it draws what the camera sees into textures, and
//! shows what comes back.

use glam::Vec3;
use manylight::surface::gpu::ReceiverTextures;
use manylight_scene::{Camera, Projection, Scene};
use wgpu::TextureFormat::{Depth32Float, Rgba8UnormSrgb, Rgba16Float, Rgba32Float};
use wgpu::util::DeviceExt;

/// Distance of the near plane, m.
const NEAR: f32 = 0.01;
/// Attributes of a corner: position, normal, normal of the face, albedo, emission.
const CORNER: [wgpu::VertexAttribute; 5] = wgpu::vertex_attr_array![
    0 => Float32x3, 1 => Float32x3, 2 => Float32x3, 3 => Float32x3, 4 => Float32x4
];

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Corner {
    position: [f32; 3],
    normal: [f32; 3],
    face_normal: [f32; 3],
    albedo: [f32; 3],
    emission: [f32; 4],
}

/// Device, geometry and textures.
pub struct Engine {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    pub size: [u32; 2],
    corners: wgpu::Buffer,
    corner_count: u32,
    view: wgpu::Buffer,
    view_group: wgpu::BindGroup,
    surface_pipeline: wgpu::RenderPipeline,
    normals_pipeline: wgpu::RenderPipeline,
    depth: wgpu::TextureView,
    position_depth: wgpu::TextureView,
    albedo: wgpu::TextureView,
    emission: wgpu::TextureView,
    normal: wgpu::TextureView,
    face_normal: wgpu::TextureView,
    /// What manylight fills.
    pub composite: wgpu::TextureView,
    tone_pipeline: wgpu::RenderPipeline,
    tone_group: wgpu::BindGroup,
    /// What a window would show.
    pub screen: wgpu::TextureView,
}

/// Opens any device, with the limits that every device has.
pub fn open() -> Option<(wgpu::Device, wgpu::Queue, String)> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle_from_env();
    // Else each indirect dispatch of a frame is checked by a dispatch of its own.
    descriptor.flags.remove(wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL);
    let instance = wgpu::Instance::new(descriptor);
    let adapter = pollster::block_on(instance.request_adapter(&Default::default())).ok()?;
    let (device, queue) = pollster::block_on(adapter.request_device(&Default::default())).ok()?;
    Some((device, queue, adapter.get_info().name))
}

impl Engine {
    pub fn new(
        device: wgpu::Device,
        queue: wgpu::Queue,
        scene: &Scene,
        size: [u32; 2],
        exposure: f32,
    ) -> Self {
        let corners = corners(scene);
        let buffer = |usage, contents: &[u8]| {
            let descriptor = wgpu::util::BufferInitDescriptor { label: None, contents, usage };
            device.create_buffer_init(&descriptor)
        };
        let uniform = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let view = buffer(uniform, &[0; 64]);
        let exposure = buffer(uniform, bytemuck::bytes_of(&exposure));

        let draw = device.create_shader_module(wgpu::include_wgsl!("gbuffer.wgsl"));
        let always = (wgpu::CompareFunction::Greater, true);
        let again = (wgpu::CompareFunction::Equal, false);
        let surface = [Rgba32Float, Rgba16Float, Rgba16Float];
        let view_layout = view_layout(&device);
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            bind_group_layouts: &[Some(&view_layout)],
            ..Default::default()
        });
        let drawing = |fragment, targets: &[_], depth| {
            pipeline(&device, &draw, fragment, targets, Some((&layout, depth)))
        };
        let surface_pipeline = drawing("surface", &surface, always);
        let normals_pipeline = drawing("normals", &[Rgba16Float; 2], again);
        let tone = device.create_shader_module(wgpu::include_wgsl!("tone.wgsl"));
        let tone_pipeline = pipeline(&device, &tone, "tone", &[Rgba8UnormSrgb], None);

        let texture = |format, usage| texture(&device, size, format, usage);
        let drawn = wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING;
        let filled = wgpu::TextureUsages::STORAGE_BINDING
            | wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::COPY_SRC;
        let shown = wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC;
        let composite = texture(Rgba16Float, filled);
        let group = |layout: &wgpu::BindGroupLayout, resources: Vec<wgpu::BindingResource<'_>>| {
            let entries = resources.into_iter().zip(0..);
            let entries =
                entries.map(|(resource, binding)| wgpu::BindGroupEntry { binding, resource });
            device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: None,
                layout,
                entries: &entries.collect::<Vec<_>>(),
            })
        };
        let light = wgpu::BindingResource::TextureView(&composite);
        Self {
            size,
            corner_count: corners.len() as u32,
            corners: buffer(wgpu::BufferUsages::VERTEX, bytemuck::cast_slice(&corners)),
            view_group: group(&view_layout, vec![view.as_entire_binding()]),
            view,
            surface_pipeline,
            normals_pipeline,
            depth: texture(Depth32Float, wgpu::TextureUsages::RENDER_ATTACHMENT),
            position_depth: texture(Rgba32Float, drawn),
            albedo: texture(Rgba16Float, drawn),
            emission: texture(Rgba16Float, drawn),
            normal: texture(Rgba16Float, drawn),
            face_normal: texture(Rgba16Float, drawn),
            tone_group: group(
                &tone_pipeline.get_bind_group_layout(0),
                vec![light, exposure.as_entire_binding()],
            ),
            tone_pipeline,
            composite,
            screen: texture(Rgba8UnormSrgb, shown),
            device,
            queue,
        }
    }

    /// What manylight needs to know of every pixel.
    pub fn receivers(&self) -> ReceiverTextures<'_> {
        ReceiverTextures {
            position_depth: &self.position_depth,
            normal: &self.normal,
            geometric_normal: Some(&self.face_normal),
            albedo: &self.albedo,
            emission: Some(&self.emission),
        }
    }

    /// Draws the scene into the textures.
    pub fn draw(&self, encoder: &mut wgpu::CommandEncoder, camera: &Camera) {
        let Projection::Perspective { vfov_rad } = camera.projection else {
            panic!("this engine has pinhole cameras alone")
        };
        let half_height = (0.5 * vfov_rad).tan();
        let half_width = half_height * self.size[0] as f32 / self.size[1] as f32;
        let right = camera.forward.cross(camera.up) / half_width;
        let up = camera.up / half_height;
        let rows = [(camera.position, NEAR), (camera.forward, 0.0), (right, 0.0), (up, 0.0)];
        let view = rows.map(|(v, w)| v.extend(w).to_array());
        self.queue.write_buffer(&self.view, 0, bytemuck::bytes_of(&view));

        let surface = [&self.position_depth, &self.albedo, &self.emission];
        // Cleared to zero: a depth that says that nothing is seen.
        let mut pass = self.begin(encoder, &surface, wgpu::LoadOp::Clear(0.0));
        self.draw_corners(&mut pass, &self.surface_pipeline);
        drop(pass);
        // One pixel of all five would be more than every device allows in one pass.
        let normals = [&self.normal, &self.face_normal];
        let mut pass = self.begin(encoder, &normals, wgpu::LoadOp::Load);
        self.draw_corners(&mut pass, &self.normals_pipeline);
    }

    fn begin<'e>(
        &self,
        encoder: &'e mut wgpu::CommandEncoder,
        targets: &[&wgpu::TextureView],
        depth: wgpu::LoadOp<f32>,
    ) -> wgpu::RenderPass<'e> {
        let targets: Vec<_> = targets.iter().map(|view| attachment(view)).collect();
        let depth_ops = wgpu::Operations { load: depth, store: wgpu::StoreOp::Store };
        encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &targets,
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &self.depth,
                depth_ops: Some(depth_ops),
                stencil_ops: None,
            }),
            ..Default::default()
        })
    }

    fn draw_corners(&self, pass: &mut wgpu::RenderPass<'_>, pipeline: &wgpu::RenderPipeline) {
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &self.view_group, &[]);
        pass.set_vertex_buffer(0, self.corners.slice(..));
        pass.draw(0..self.corner_count, 0..1);
    }

    /// Shows the light.
    pub fn show(&self, encoder: &mut wgpu::CommandEncoder) {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &[attachment(&self.screen)],
            ..Default::default()
        });
        pass.set_pipeline(&self.tone_pipeline);
        pass.set_bind_group(0, &self.tone_group, &[]);
        pass.draw(0..3, 0..1);
    }

    /// The texels of a texture, without the padding between rows.
    pub fn read(&self, view: &wgpu::TextureView, texel_bytes: u32) -> Vec<u8> {
        let row = self.size[0] * texel_bytes;
        let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: u64::from(padded * self.size[1]),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = self.device.create_command_encoder(&Default::default());
        encoder.copy_texture_to_buffer(
            view.texture().as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &buffer,
                layout: wgpu::TexelCopyBufferLayout {
                    bytes_per_row: Some(padded),
                    ..Default::default()
                },
            },
            view.texture().size(),
        );
        encoder.map_buffer_on_submit(&buffer, wgpu::MapMode::Read, .., |_| ());
        self.queue.submit([encoder.finish()]);
        self.device.poll(wgpu::PollType::wait_indefinitely()).expect("the device works");
        let bytes = buffer.get_mapped_range(..).expect("copied");
        bytes.chunks(padded as usize).flat_map(|r| &r[..row as usize]).copied().collect()
    }
}

/// Takes the pictures off the surfaces of a scene: this engine has none.
pub fn remove_pictures(scene: &mut Scene) {
    for material in &mut scene.materials {
        (material.base_color_texture, material.emission_texture) = (None, None);
        material.normal_texture = None;
    }
}

/// The corners of all triangles in the world.
fn corners(scene: &Scene) -> Vec<Corner> {
    let mut corners = Vec::new();
    for instance in &scene.instances {
        let mesh = &scene.meshes[instance.mesh as usize];
        let material = &scene.materials[mesh.material as usize];
        let normal_matrix = instance.world_from_object.matrix3.inverse().transpose();
        let emission = material.emission.extend(f32::from(u8::from(material.double_sided)));
        for triangle in &mesh.triangles {
            let at = triangle.map(|v| mesh.positions[v as usize]);
            let flat = (at[1] - at[0]).cross(at[2] - at[0]);
            let to_world = |normal: Vec3| (normal_matrix * normal).normalize_or_zero();
            for (&vertex, position) in triangle.iter().zip(at) {
                let normal = mesh.normals.get(vertex as usize).copied().unwrap_or(flat);
                let tint = mesh.colors.get(vertex as usize).map_or(Vec3::ONE, |c| c.truncate());
                corners.push(Corner {
                    position: instance.world_from_object.transform_point3(position).to_array(),
                    normal: to_world(normal).to_array(),
                    face_normal: to_world(flat).to_array(),
                    albedo: (material.base_color.truncate() * tint).to_array(),
                    emission: emission.to_array(),
                });
            }
        }
    }
    corners
}

/// The view, for both pipelines that draw.
fn view_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: None,
        entries: &[wgpu::BindGroupLayoutEntry {
            binding: 0,
            visibility: wgpu::ShaderStages::VERTEX_FRAGMENT,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Uniform,
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        }],
    })
}

/// A pipeline whose entry points are `corner` and `fragment`; `drawing`: its layout, how depths
/// compare, and whether it writes them. Without it there are no corners to read either.
fn pipeline(
    device: &wgpu::Device,
    module: &wgpu::ShaderModule,
    fragment: &str,
    targets: &[wgpu::TextureFormat],
    drawing: Option<(&wgpu::PipelineLayout, (wgpu::CompareFunction, bool))>,
) -> wgpu::RenderPipeline {
    let targets: Vec<_> = targets.iter().map(|&format| Some(format.into())).collect();
    let corners = [Some(wgpu::VertexBufferLayout {
        array_stride: size_of::<Corner>() as u64,
        step_mode: wgpu::VertexStepMode::Vertex,
        attributes: &CORNER,
    })];
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(fragment),
        layout: drawing.map(|(layout, _)| layout),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some("corner"),
            compilation_options: Default::default(),
            buffers: if drawing.is_some() { &corners } else { &[] },
        },
        primitive: Default::default(),
        depth_stencil: drawing.map(|(_, (compare, writes))| wgpu::DepthStencilState {
            format: Depth32Float,
            depth_write_enabled: Some(writes),
            depth_compare: Some(compare),
            stencil: Default::default(),
            bias: Default::default(),
        }),
        multisample: Default::default(),
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some(fragment),
            compilation_options: Default::default(),
            targets: &targets,
        }),
        multiview_mask: None,
        cache: None,
    })
}

fn texture(
    device: &wgpu::Device,
    [width, height]: [u32; 2],
    format: wgpu::TextureFormat,
    usage: wgpu::TextureUsages,
) -> wgpu::TextureView {
    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage,
        view_formats: &[],
    });
    texture.create_view(&Default::default())
}

fn attachment(view: &wgpu::TextureView) -> Option<wgpu::RenderPassColorAttachment<'_>> {
    let load = wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT);
    let ops = wgpu::Operations { load, store: wgpu::StoreOp::Store };
    Some(wgpu::RenderPassColorAttachment { view, depth_slice: None, resolve_target: None, ops })
}
