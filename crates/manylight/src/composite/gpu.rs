//! Layers on the graphics device: planes of four numbers a pixel.
//!
//! In: irradiances, shadow ratios, [`GpuReceivers`] · Out: [`GpuLayers`], and [`Layers`] read back

use super::Layers;
use crate::error::Error;
use crate::gpu::{Buf, Constant, GROUP, Gpu, KernelInfo, MAX_GROUPS, Memory, Recorder, Value};
use crate::gpu::{kernel, record};
use crate::surface::gpu::{GpuReceivers, NO_SURFACE};
use glam::Vec3;
use std::f32::consts::FRAC_1_PI;

pub(super) const LIST_CONSTANTS: &[Constant] =
    &[Constant { name: "MAX_GROUPS", value: Value::U32(MAX_GROUPS) }];
/// Constants of `brdf.wgsl`.
const BRDF_CONSTANTS: &[Constant] =
    &[Constant { name: "INVERSE_PI", value: Value::F32(FRAC_1_PI) }];
const RATIO_CONSTANTS: &[Constant] =
    &[Constant { name: "LEAST_POSITIVE", value: Value::F32(f32::MIN_POSITIVE) }];

record! {
    /// What beginning a sample needs.
    pub struct BeginParams {
        /// Pixels.
        pub pixels: u32,
        /// Of this sample among all of a pixel.
        pub weight: f32,
        /// Whether the layers hold nothing worth keeping.
        pub is_first: u32,
        /// Whether albedo and emission are summed up.
        pub is_sum: u32,
        /// Shadow ratio where no gather will tell one.
        pub ratio: f32,
    }
}

record! {
    /// What adding a gather needs.
    pub struct GatheredParams {
        /// Pixels.
        pub pixels: u32,
        /// Of this sample among all of a pixel.
        pub weight: f32,
        /// Whether the lights are sources, and no surfaces that they light.
        pub is_direct: u32,
        /// Whether what arrives is known in every channel.
        pub is_exact: u32,
    }
}

record! {
    /// What adding up the picture needs.
    pub struct BeautyParams {
        /// Pixels.
        pub pixels: u32,
    }
}

kernel! {
    /// What needs no gather.
    struct Begin = "composite/begin", [GROUP, 1, 1], [LIST_CONSTANTS, BRDF_CONSTANTS];
    uniform params: BeginParams, read irradiances: [f32; 4], read albedos: [f32; 4],
    read emissions: [f32; 4], write direct: [f32; 4], write indirect: [f32; 4],
    write unshadowed: [f32; 4], write mean_albedos: [f32; 4], write mean_emissions: [f32; 4]
}

kernel! {
    /// What was gathered.
    struct AddGathered = "composite/gathered", [GROUP, 1, 1],
        [LIST_CONSTANTS, BRDF_CONSTANTS, RATIO_CONSTANTS];
    uniform params: GatheredParams, read gathered: [f32; 4], read ratios: [f32; 2],
    read shadowed: [f32; 4], read albedos: [f32; 4], write direct: [f32; 4],
    write indirect: [f32; 4], write unshadowed: [f32; 4]
}

kernel! {
    /// The picture.
    struct AddBeauty = "composite/beauty", [GROUP, 1, 1], [LIST_CONSTANTS];
    uniform params: BeautyParams, read direct: [f32; 4], read indirect: [f32; 4],
    read emissions: [f32; 4], write beauty: [f32; 4]
}

/// Every kernel of this file.
pub const KERNELS: &[&KernelInfo] = &[&Begin::INFO, &AddGathered::INFO, &AddBeauty::INFO];

/// What arrives of the gathered light.
#[derive(Clone, Copy, Debug)]
pub enum Arriving<'a> {
    /// A share of it, 0…1, the first of each pair.
    Ratio(&'a Buf<[f32; 2]>),
    /// This irradiance, W·m⁻²; the fourth is unused.
    Exact(&'a Buf<[f32; 4]>),
}

/// [`Gathered`](crate::gather::Gathered) as the layers need it.
#[derive(Clone, Copy, Debug)]
pub struct GatheredLight<'a> {
    /// Irradiance without visibility, W·m⁻², and lights evaluated.
    pub unshadowed: &'a Buf<[f32; 4]>,
    /// What arrives of it.
    pub arriving: Arriving<'a>,
    /// Whether the lights are sources, and no surfaces that they light.
    pub is_direct: bool,
}

/// What the layers keep where a pixel has several samples.
#[derive(Debug)]
struct Kept {
    /// Means.
    albedos: Buf<[f32; 4]>,
    emissions: Buf<[f32; 4]>,
    /// Of the first sample.
    positions: Buf<[f32; 4]>,
    normals: Buf<[f32; 4]>,
}

/// [`Layers`] on the device, row-major from the top.
#[derive(Debug)]
pub struct GpuLayers {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// The picture, W·m⁻²·sr⁻¹; the fourth is 1.
    pub beauty: Buf<[f32; 4]>,
    /// Reflected light straight from its source, W·m⁻²·sr⁻¹, and lights evaluated.
    pub direct: Buf<[f32; 4]>,
    /// Reflected light that was scattered before, W·m⁻²·sr⁻¹, and its shadow ratio.
    pub indirect: Buf<[f32; 4]>,
    /// The same without visibility; the fourth is unused.
    pub unshadowed: Buf<[f32; 4]>,
    samples: u32,
    kept: Option<Kept>,
    /// In the place of what is not there.
    nothing: [Buf<[f32; 4]>; 2],
    no_ratios: Buf<[f32; 2]>,
}

impl GpuLayers {
    /// Room for a picture of some samples per pixel; `light` for its parts, `picture` for their
    /// sum.
    ///
    /// Errors: more pixels than the device can hold in one list
    pub fn new(
        light: &impl Memory,
        picture: &impl Memory,
        [width, height]: [usize; 2],
        samples: u32,
    ) -> Result<Self, Error> {
        let pixels = width * height;
        let gpu = light.gpu();
        let plane = |name| gpu.buffer(name, pixels);
        let keep = || -> Result<_, Error> {
            Ok(Kept {
                albedos: plane("mean albedos")?,
                emissions: plane("mean emissions")?,
                positions: plane("first positions")?,
                normals: plane("first normals")?,
            })
        };
        Ok(Self {
            width,
            height,
            beauty: picture.list("picture", pixels)?,
            direct: light.list("direct light", pixels)?,
            indirect: light.list("indirect light", pixels)?,
            unshadowed: light.list("unshadowed light", pixels)?,
            samples,
            kept: (samples > 1).then(keep).transpose()?,
            nothing: [gpu.buffer("nothing", 1)?, gpu.buffer("nothing", 1)?],
            no_ratios: gpu.buffer("no ratios", 1)?,
        })
    }

    /// Begins a sample, counted from 0, with what its receivers and irradiances from sun, point and
    /// spot lights tell; begins the stage `composite`. `is_lit` tells whether a gather of indirect
    /// light will follow.
    pub fn begin(
        &self,
        rec: &mut Recorder<'_>,
        receivers: &GpuReceivers,
        irradiances: &Buf<[f32; 4]>,
        sample: u32,
        is_lit: bool,
    ) {
        let pixels = self.width * self.height;
        if let Some(kept) = self.kept.as_ref().filter(|_| sample == 0) {
            rec.copy(&receivers.positions, 0, &kept.positions, pixels);
            rec.copy(&receivers.normals, 0, &kept.normals, pixels);
        }
        rec.stage("composite");
        let params = rec.uniform(&BeginParams {
            pixels: pixels as u32,
            weight: self.weight(),
            is_first: u32::from(sample == 0),
            is_sum: u32::from(self.kept.is_some()),
            ratio: f32::from(u8::from(!is_lit)),
        });
        let [no_albedos, no_emissions] = &self.nothing;
        let kept = self.kept.as_ref();
        let kernel = Begin {
            params,
            irradiances,
            albedos: &receivers.albedos,
            emissions: &receivers.emissions,
            direct: &self.direct,
            indirect: &self.indirect,
            unshadowed: &self.unshadowed,
            mean_albedos: kept.map_or(no_albedos, |kept| &kept.albedos),
            mean_emissions: kept.map_or(no_emissions, |kept| &kept.emissions),
        };
        rec.dispatch_items(&kernel, pixels);
    }

    /// Adds gathered light to the sample that was begun.
    pub fn add(&self, rec: &mut Recorder<'_>, receivers: &GpuReceivers, light: &GatheredLight<'_>) {
        let pixels = self.width * self.height;
        let params = rec.uniform(&GatheredParams {
            pixels: pixels as u32,
            weight: self.weight(),
            is_direct: u32::from(light.is_direct),
            is_exact: u32::from(matches!(light.arriving, Arriving::Exact(_))),
        });
        let (ratios, shadowed) = match light.arriving {
            Arriving::Ratio(ratios) => (ratios, &self.nothing[0]),
            Arriving::Exact(shadowed) => (&self.no_ratios, shadowed),
        };
        let kernel = AddGathered {
            params,
            gathered: light.unshadowed,
            ratios,
            shadowed,
            albedos: &receivers.albedos,
            direct: &self.direct,
            indirect: &self.indirect,
            unshadowed: &self.unshadowed,
        };
        rec.dispatch_items(&kernel, pixels);
    }

    /// Adds up the picture after the last sample, or after any to show what there is so far.
    pub fn finish(&self, rec: &mut Recorder<'_>, receivers: &GpuReceivers) {
        let pixels = self.width * self.height;
        let kernel = AddBeauty {
            params: rec.uniform(&BeautyParams { pixels: pixels as u32 }),
            direct: &self.direct,
            indirect: &self.indirect,
            emissions: self.kept.as_ref().map_or(&receivers.emissions, |kept| &kept.emissions),
            beauty: &self.beauty,
        };
        rec.dispatch_items(&kernel, pixels);
    }

    /// Copies the layers back; `receivers` are those of the sample, if a pixel has one.
    ///
    /// Errors: what the device reported
    pub fn download(&self, gpu: &Gpu, receivers: &GpuReceivers) -> Result<Layers, Error> {
        let GpuReceivers { positions, normals, albedos, emissions, .. } = receivers;
        let (albedos, emissions, positions, normals) = match &self.kept {
            None => (albedos, emissions, positions, normals),
            Some(kept) => (&kept.albedos, &kept.emissions, &kept.positions, &kept.normals),
        };
        let planes = [&self.direct, &self.indirect, positions, &self.unshadowed];
        let planes = [&planes[..], &[emissions, albedos, normals]].concat();
        let parts = |i: usize, plane: &[[f32; 4]]| {
            let colors = plane.iter().map(|[x, y, z, _]| Vec3::new(*x, *y, *z));
            // The fourth of the other planes tells nothing.
            let fourth = if i < 3 { plane } else { &[] };
            (colors.collect(), fourth.iter().map(|v| v[3]).collect())
        };
        let parts: Vec<(Vec<Vec3>, Vec<f32>)> =
            gpu.read_each(&planes, self.width * self.height, parts)?;
        let [direct, indirect, position, unshadowed, emission, albedo, normal] =
            parts.try_into().expect("as many as there are planes");
        let depth = |depth: f32| if depth < NO_SURFACE { depth } else { f32::INFINITY };
        Ok(Layers {
            width: self.width,
            height: self.height,
            direct: direct.0,
            indirect: indirect.0,
            indirect_unshadowed: unshadowed.0,
            shadow_ratio: indirect.1,
            emission: emission.0,
            albedo: albedo.0,
            normal: normal.0,
            position: position.0,
            depth: position.1.into_iter().map(depth).collect(),
            evals: direct.1,
        })
    }

    /// Of one sample.
    fn weight(&self) -> f32 {
        1.0 / self.samples.max(1) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Renderer;
    use crate::gather::Gathered;
    use crate::gpu::testing::{check_kernel, device};
    use crate::math::{hash_u32, unit_f32};
    use crate::surface::{Receivers, ViewFrame};
    use glam::Vec2;

    const SIZE: [usize; 2] = [37, 29];

    #[test]
    fn kernels_match_their_shaders() {
        let kernels = KERNELS.iter().chain(crate::composite::store::KERNELS);
        kernels.for_each(|kernel| check_kernel(kernel));
    }

    fn random(i: usize, key: u32) -> f32 {
        unit_f32(hash_u32(i as u32 ^ hash_u32(key)))
    }

    fn colors(count: usize, key: u32) -> Vec<Vec3> {
        let color = |i| Vec3::new(random(i, key), random(i, key + 1), random(i, key + 2));
        (0..count).map(color).collect()
    }

    /// One sample: receivers, exact irradiance, and gathers with whether they are direct.
    struct Sample {
        receivers: Receivers,
        irradiance: Vec<Vec3>,
        gathers: Vec<(Gathered, bool)>,
    }

    /// `is_exact` tells whether the gather of indirect light is; `None`: there is none.
    fn sample(renderer: &Renderer, view: &ViewFrame, key: u32, is_exact: Option<bool>) -> Sample {
        let offset = Vec2::new(random(0, key), random(1, key));
        let receivers = Receivers::trace(&renderer.world, view, offset, true);
        let count = receivers.samples.len();
        let gathered = |key: u32, is_exact: bool| {
            let mut gathered = Gathered::dark(count);
            gathered.evals = (0..count as u32).map(|i| hash_u32(i ^ key) % 900).collect();
            let (all, seen) = (colors(count, key), colors(count, key + 5));
            if is_exact {
                // Some are all dark.
                let sum = |i: usize| match random(i, key) < 0.1 {
                    true => [Vec3::ZERO; 2],
                    false => [all[i] + seen[i], seen[i]],
                };
                gathered.set_exact((0..count).map(sum));
            } else {
                gathered.unshadowed = all;
                gathered.shadow_ratio = seen.iter().map(|seen| seen.x).collect();
            }
            gathered
        };
        let mut gathers = vec![(gathered(key + 10, true), true), (gathered(key + 20, false), true)];
        gathers.extend(is_exact.map(|is_exact| (gathered(key + 30, is_exact), false)));
        Sample { receivers, irradiance: colors(count, key + 50), gathers }
    }

    fn sky(direction: Vec3) -> Vec3 {
        direction.abs()
    }

    /// The layers of one sample.
    fn layers(sample: &Sample) -> Layers {
        let mut layers = Layers::new(&sample.receivers, sky);
        layers.set_direct(&sample.irradiance);
        for (gathered, is_direct) in &sample.gathers {
            match is_direct {
                true => layers.add_direct(gathered),
                false => layers.set_indirect(gathered),
            }
        }
        layers
    }

    fn four(colors: &[Vec3], fourth: impl Fn(usize) -> f32) -> Vec<[f32; 4]> {
        colors.iter().enumerate().map(|(i, c)| c.extend(fourth(i)).to_array()).collect()
    }

    /// The layers of some samples by the device, and its picture.
    fn run(gpu: &Gpu, samples: &[Sample]) -> (Layers, Vec<Vec3>) {
        let [width, height] = SIZE;
        let on_device =
            GpuLayers::new(gpu, gpu, [width, height], samples.len() as u32).expect("layers");
        let mut last = None;
        for (i, sample) in samples.iter().enumerate() {
            let receivers = GpuReceivers::upload(gpu, &sample.receivers, sky).expect("receivers");
            let irradiances =
                gpu.upload("irradiances", &four(&sample.irradiance, |_| 0.0)).expect("irradiances");
            let mut rec = gpu.record(None);
            let is_lit = sample.gathers.iter().any(|(_, is_direct)| !is_direct);
            on_device.begin(&mut rec, &receivers, &irradiances, i as u32, is_lit);
            for (gathered, is_direct) in &sample.gathers {
                let evals = |i: usize| gathered.evals[i] as f32;
                let sums = four(&gathered.unshadowed, evals);
                let unshadowed = gpu.upload("unshadowed", &sums).expect("unshadowed");
                let pairs: Vec<_> = gathered.shadow_ratio.iter().map(|&r| [r, 1.0]).collect();
                let ratios = gpu.upload("ratios", &pairs).expect("ratios");
                let shadowed = four(&gathered.shadowed, |_| 0.0);
                let shadowed = gpu.upload("shadowed", &shadowed).expect("shadowed");
                let arriving = match gathered.shadowed.is_empty() {
                    true => Arriving::Ratio(&ratios),
                    false => Arriving::Exact(&shadowed),
                };
                let is_direct = *is_direct;
                let light = GatheredLight { unshadowed: &unshadowed, arriving, is_direct };
                on_device.add(&mut rec, &receivers, &light);
            }
            on_device.finish(&mut rec, &receivers);
            rec.submit().wait().expect("done");
            last = Some(receivers);
        }
        let layers = on_device.download(gpu, &last.expect("a sample")).expect("layers");
        let beauty = gpu.read(&on_device.beauty, width * height).expect("beauty");
        (layers, beauty.iter().map(|&[r, g, b, _]| Vec3::new(r, g, b)).collect())
    }

    fn assert_near(name: &str, expected: &[Vec3], found: &[Vec3]) {
        assert_eq!(expected.len(), found.len(), "{name}");
        for (i, (a, b)) in expected.iter().zip(found).enumerate() {
            assert!(a.abs_diff_eq(*b, 1e-5 * (1.0 + a.max_element())), "{name} {i}: {a} and {b}");
        }
    }

    fn assert_alike(expected: &Layers, (found, beauty): &(Layers, Vec<Vec3>)) {
        assert_near("direct", &expected.direct, &found.direct);
        assert_near("indirect", &expected.indirect, &found.indirect);
        assert_near("unshadowed", &expected.indirect_unshadowed, &found.indirect_unshadowed);
        assert_near("emission", &expected.emission, &found.emission);
        assert_near("albedo", &expected.albedo, &found.albedo);
        assert_near("beauty", &expected.beauty(), beauty);
        let numbers = |values: &[f32]| values.iter().map(|&v| Vec3::splat(v)).collect::<Vec<_>>();
        assert_near("ratio", &numbers(&expected.shadow_ratio), &numbers(&found.shadow_ratio));
        assert_near("evals", &numbers(&expected.evals), &numbers(&found.evals));
        assert_eq!([expected.width, expected.height], [found.width, found.height]);
        assert_eq!(expected.normal, found.normal);
        assert_eq!(expected.position, found.position);
        assert_eq!(expected.depth, found.depth);
    }

    #[test]
    fn the_device_makes_the_layers_that_the_processor_makes() {
        let Some(gpu) = device() else { return };
        let shot = manylight_scene::builtin("atrium").expect("atrium");
        let renderer = Renderer::new(shot.scene).expect("atrium");
        let view = ViewFrame::new(&shot.camera, SIZE[0], SIZE[1]);
        for is_exact in [Some(false), Some(true), None] {
            let one = [sample(&renderer, &view, 100, is_exact)];
            assert_alike(&layers(&one[0]), &run(gpu, &one));
            let three = [1000, 2000, 3000].map(|key| sample(&renderer, &view, key, is_exact));
            let mut sum = layers(&three[0]).scaled(1.0 / 3.0);
            three[1..].iter().for_each(|s| sum.add_weighted(&layers(s), 1.0 / 3.0));
            let found = run(gpu, &three);
            assert_alike(&sum, &found);
            assert_eq!(found.1, run(gpu, &three).1, "two runs");
        }
    }
}
