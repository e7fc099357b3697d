//! Images on the device: on pages of one array, or each a texture of its own.
//!
//! In: [`Scene`], what the device binds · Out: [`Plan`], [`Textures`]
//! Only images that a kernel reads: color, emission and normals of materials that are in the scene.
//! Limits: images of at most the device's largest texture.

use super::pages::Pages;
use super::slots_of;
use crate::error::Error;
use crate::gpu::{Gpu, HeldBytes};
use manylight_scene::{Scene, TextureImage};

/// Where an image lies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Place {
    /// Layer of the array, or position among the textures.
    pub page: u32,
    /// Its first column there.
    pub x: u32,
    /// Its first row there.
    pub y: u32,
    /// Texels across and down.
    pub size: [u32; 2],
}

/// What a device allows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Texels along a side.
    pub side: u32,
    /// Layers of an array.
    pub layers: u32,
    /// Textures that it binds one by one; none where it binds an array.
    pub textures: Option<u32>,
}

impl From<&Gpu> for Limits {
    fn from(gpu: &Gpu) -> Self {
        let limits = gpu.limits();
        let (side, layers) = (limits.max_texture_dimension_2d, limits.max_texture_array_layers);
        Self { side, layers, textures: gpu.most_textures() }
    }
}

/// Which texture holds what.
#[derive(Debug)]
pub(super) struct Plan {
    /// Sizes of the array's layers, all the same, or of the textures.
    pub pages: Vec<[u32; 2]>,
    /// Of every image; of size 0 for those that nothing reads.
    pub places: Vec<Place>,
}

impl Plan {
    /// Each image that is read in a texture of its own where the device binds as many, on pages
    /// otherwise.
    ///
    /// Errors: a sentence that tells which image is too large, or how many pages are too many
    pub fn new(scene: &Scene, limits: Limits) -> Result<Self, String> {
        let read = images_read(scene);
        let of = |&i: &usize| [scene.images[i].width, scene.images[i].height];
        let sizes: Vec<[u32; 2]> = read.iter().map(of).collect();
        let Limits { side, layers, textures } = limits;
        if let Some(n) = sizes.iter().position(|s| s[0].max(s[1]) > side) {
            let ([width, height], name) = (sizes[n], &scene.images[read[n]].name);
            return Err(format!(
                "the texture {name} has {width} x {height} texels, and at most {side} along a side \
                 are allowed; make it smaller"
            ));
        }
        let mut places = vec![Place::default(); scene.images.len()];
        if textures.is_some_and(|most| sizes.len() <= most as usize) {
            for (page, (&i, &size)) in read.iter().zip(&sizes).enumerate() {
                places[i] = Place { page: page as u32, size, ..Place::default() };
            }
            return Ok(Self { pages: sizes, places });
        }
        let most = textures.unwrap_or(layers);
        let pages = Pages::pack(&sizes, side, most);
        let count = pages.heights.len();
        if count > most as usize {
            let (width, height) = (pages.width, pages.height());
            return Err(format!(
                "the textures fill {count} pages of {width} x {height} texels, and {most} are \
                 allowed; make them smaller"
            ));
        }
        for ((&i, &size), &[page, x, y]) in read.iter().zip(&sizes).zip(&pages.corners) {
            places[i] = Place { page, x, y, size };
        }
        // Layers of an array have the same size, textures need not.
        let height = |&own| if textures.is_some() { own } else { pages.height() };
        let pages = pages.heights.iter().map(|own| [pages.width, height(own)]).collect();
        Ok(Self { pages, places })
    }

    /// Bytes of all pages.
    pub fn bytes(&self) -> u64 {
        self.pages.iter().map(|&[w, h]| 4 * u64::from(w) * u64::from(h)).sum()
    }
}

/// Images that some kernel reads, in order.
fn images_read(scene: &Scene) -> Vec<usize> {
    let mut is_read = vec![false; scene.images.len()];
    for instance in &scene.instances {
        let material = scene.meshes[instance.mesh as usize].material;
        let material = &scene.materials[material as usize];
        slots_of(material).iter().for_each(|slot| is_read[slot.image as usize] = true);
    }
    (0..is_read.len()).filter(|&i| is_read[i]).collect()
}

/// The textures of a scene, as group 1 binds them.
#[derive(Debug)]
pub(super) struct Textures {
    /// One array, or one for each page.
    views: Vec<wgpu::TextureView>,
    is_array: bool,
    _held: HeldBytes,
}

impl Textures {
    /// Copies all images to their places.
    pub fn upload(gpu: &Gpu, images: &[TextureImage], plan: &Plan) -> Self {
        let is_array = gpu.most_textures().is_none();
        // A binding may not be empty.
        let pages = if plan.pages.is_empty() { &[[1; 2]] } else { &plan.pages[..] };
        let textures: Vec<_> = match is_array {
            true => vec![texture(gpu, pages[0], pages.len() as u32)],
            false => pages.iter().map(|&size| texture(gpu, size, 1)).collect(),
        };
        for (image, place) in images.iter().zip(&plan.places) {
            let (page, layer) = if is_array { (0, place.page) } else { (place.page as usize, 0) };
            let [width, height] = place.size;
            if width > 0 {
                let origin = wgpu::Origin3d { x: place.x, y: place.y, z: layer };
                write(gpu, &textures[page], origin, [width, height], &image.texels);
            }
        }
        let dimension = match is_array {
            true => wgpu::TextureViewDimension::D2Array,
            false => wgpu::TextureViewDimension::D2,
        };
        let descriptor =
            wgpu::TextureViewDescriptor { dimension: Some(dimension), ..Default::default() };
        let views = textures.iter().map(|t| t.create_view(&descriptor)).collect();
        let bytes = plan.bytes().max(4);
        Self { views, is_array, _held: gpu.hold_bytes("textures", bytes) }
    }

    /// All views.
    pub fn views(&self) -> Vec<&wgpu::TextureView> {
        self.views.iter().collect()
    }

    /// What is bound; `views` are [`Textures::views`].
    pub fn binding<'a>(&self, views: &'a [&'a wgpu::TextureView]) -> wgpu::BindingResource<'a> {
        match self.is_array {
            true => wgpu::BindingResource::TextureView(views[0]),
            false => wgpu::BindingResource::TextureViewArray(views),
        }
    }
}

fn texture(gpu: &Gpu, [width, height]: [u32; 2], layers: u32) -> wgpu::Texture {
    gpu.device().create_texture(&wgpu::TextureDescriptor {
        label: Some("textures"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: layers },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba8Uint,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    })
}

/// Copies texels of any format to a part of a texture.
pub(super) fn write<T: bytemuck::Pod>(
    gpu: &Gpu,
    texture: &wgpu::Texture,
    origin: wgpu::Origin3d,
    [width, height]: [u32; 2],
    texels: &[T],
) {
    gpu.queue().write_texture(
        wgpu::TexelCopyTextureInfo {
            texture,
            mip_level: 0,
            origin,
            aspect: wgpu::TextureAspect::All,
        },
        bytemuck::cast_slice(texels),
        wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(size_of::<T>() as u32 * width),
            rows_per_image: Some(height),
        },
        wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
    );
}

/// The sentence of an error that a device has with textures.
pub(super) fn refused(gpu: &Gpu, problem: &str) -> Error {
    Error::Device { problem: format!("{}: {problem}, or render with --backend cpu", gpu.name()) }
}
