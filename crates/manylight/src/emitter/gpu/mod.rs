//! The sources on the graphics device: one list of words, and the functions that draw from it.
//!
//! In: [`World`], [`Emitters`] · Out: [`SourceLists`]: the words of binding 4 of group 1, and the
//! texels of a map of the sky
//! The words are a header, see [`CONSTANTS`], then the tables it points at. A distribution is its
//! thresholds, see [`Discrete::thresholds`], and after them its probabilities as `f32`.
//! A texel of a map is its radiance and its threshold among all of them.
//! Limits: 28 B per emissive triangle in one list; 16 B per texel of a sky map in a texture.

use super::Emitters;
use crate::gpu::{Constant, Recorder, Value, kernel};
use crate::math::Discrete;
use crate::surface::ViewFrame;
use crate::surface::gpu::{GpuReceivers, ViewRecord};
use crate::world::World;
use crate::world::gpu::{SkyTexels, SourceLists};
use crate::{bvh, surface, world};
use glam::{Vec2, Vec3};
use manylight_scene::{Light, Sky, SkyMap};

/// Words of one punctual light: kind, position, direction, intensity or irradiance, two cosines.
const LIGHT_WORDS: usize = 12;
/// Words of one emissive triangle: instance, triangle, area, whether double-sided.
const TRIANGLE_WORDS: usize = 4;
/// Stands where an instance has no emissive triangle.
const NO_TRIANGLE: u32 = u32::MAX;

/// Kinds of punctual lights.
const KIND_SUN: u32 = 0;
const KIND_POINT: u32 = 1;
const KIND_SPOT: u32 = 2;
/// Kinds of skies; 0 is none.
const SKY_CONSTANT: u32 = 1;
const SKY_MAP: u32 = 2;

/// Positions in the header.
const LIGHT_COUNT: usize = 0;
const LIGHTS: usize = 1;
const BY_FLUX: usize = 2;
const TRIANGLE_COUNT: usize = 3;
const TRIANGLES: usize = 4;
const TRIANGLES_BY_FLUX: usize = 5;
const INSTANCE_COUNT: usize = 6;
const FIRST_OF_INSTANCE: usize = 7;
const SKY_KIND: usize = 8;
const SKY_WIDTH: usize = 9;
const SKY_HEIGHT: usize = 10;
const SKY_TURN: usize = 11;
const SKY_INVERSE_TOTAL: usize = 12;
const SKY_RADIANCE: usize = 13;
const SKY_ROWS_BY_FLUX: usize = 14;
const SKY_ROWS: usize = 15;
const SKY_MEAN: usize = 16;
const HEADER_WORDS: usize = 19;

const fn word(name: &'static str, value: usize) -> Constant {
    Constant { name, value: Value::U32(value as u32) }
}

/// Constants of the room's shaders: where the header says what.
pub const CONSTANTS: &[Constant] = &[
    word("SOURCE_LIGHT_COUNT", LIGHT_COUNT),
    word("SOURCE_LIGHTS", LIGHTS),
    word("SOURCE_BY_FLUX", BY_FLUX),
    word("SOURCE_TRIANGLE_COUNT", TRIANGLE_COUNT),
    word("SOURCE_TRIANGLES", TRIANGLES),
    word("SOURCE_TRIANGLES_BY_FLUX", TRIANGLES_BY_FLUX),
    word("SOURCE_INSTANCE_COUNT", INSTANCE_COUNT),
    word("SOURCE_FIRST_OF_INSTANCE", FIRST_OF_INSTANCE),
    word("SOURCE_SKY_KIND", SKY_KIND),
    word("SOURCE_SKY_WIDTH", SKY_WIDTH),
    word("SOURCE_SKY_HEIGHT", SKY_HEIGHT),
    word("SOURCE_SKY_TURN", SKY_TURN),
    word("SOURCE_SKY_INVERSE_TOTAL", SKY_INVERSE_TOTAL),
    word("SOURCE_SKY_RADIANCE", SKY_RADIANCE),
    word("SOURCE_SKY_ROWS_BY_FLUX", SKY_ROWS_BY_FLUX),
    word("SOURCE_SKY_ROWS", SKY_ROWS),
    word("SOURCE_SKY_MEAN", SKY_MEAN),
    word("LIGHT_WORDS", LIGHT_WORDS),
    word("TRIANGLE_WORDS", TRIANGLE_WORDS),
    word("NO_TRIANGLE", NO_TRIANGLE as usize),
    word("KIND_SUN", KIND_SUN as usize),
    word("KIND_POINT", KIND_POINT as usize),
    word("SKY_CONSTANT", SKY_CONSTANT as usize),
    word("SKY_MAP", SKY_MAP as usize),
];

kernel! {
    /// The sky behind everything.
    struct Background = "emitter/background", [8, 8, 1], scene,
        [CONSTANTS, surface::gpu::CONSTANTS, world::gpu::CONSTANTS, bvh::gpu::CONSTANTS];
    uniform view: ViewRecord, read positions: [f32; 4], write emissions: [f32; 4]
}

/// Every kernel of this room.
#[cfg(test)]
pub(crate) const KERNELS: &[&crate::gpu::KernelInfo] = &[&Background::INFO];

/// Radiance of the sky for pixels that see no surface; `offset_px` as for the receivers.
pub fn record_background(
    rec: &mut Recorder<'_>,
    receivers: &GpuReceivers,
    view: &ViewFrame,
    offset_px: Vec2,
) {
    let GpuReceivers { width, height, positions, emissions, .. } = receivers;
    let view = rec.uniform(&ViewRecord::new(view, offset_px));
    rec.dispatch_pixels(&Background { view, positions, emissions }, *width, *height);
}

/// The sources as words.
///
/// Cost: O(n); 28 B per emissive triangle, 16 B per texel of a sky map
pub fn pack(world: &World, emitters: &Emitters) -> SourceLists {
    let mut heap = Heap { words: vec![0; HEADER_WORDS], sky: SkyTexels::default() };
    heap.words[LIGHT_COUNT] = emitters.lights.len() as u32;
    heap.table(LIGHTS, emitters.lights.iter().flat_map(light_words));
    heap.distribution(BY_FLUX, &emitters.by_flux);
    heap.surface(world, emitters);
    heap.sky(world, emitters);
    SourceLists { words: heap.words, sky: heap.sky }
}

/// Words under construction.
struct Heap {
    words: Vec<u32>,
    sky: SkyTexels,
}

impl Heap {
    /// Appends a table and says in the header where it begins.
    fn table(&mut self, header: usize, words: impl IntoIterator<Item = u32>) {
        self.words[header] = self.words.len() as u32;
        self.words.extend(words);
    }

    fn distribution(&mut self, header: usize, discrete: &Discrete) {
        let thresholds = discrete.thresholds();
        let pmf = |i: usize| if discrete.total() > 0.0 { discrete.pmf(i).to_bits() } else { 0 };
        let pmfs: Vec<u32> = (0..thresholds.len()).map(pmf).collect();
        self.table(header, thresholds.into_iter().chain(pmfs));
    }

    fn surface(&mut self, world: &World, emitters: &Emitters) {
        let surface = &emitters.surface;
        // None where no triangle shines: nothing to draw from.
        let triangles = if surface.is_empty() { &[][..] } else { &surface.triangles };
        self.words[TRIANGLE_COUNT] = triangles.len() as u32;
        let words = triangles
            .iter()
            .flat_map(|t| [t.instance, t.triangle, t.area.to_bits(), u32::from(t.double_sided)]);
        self.table(TRIANGLES, words);
        if surface.is_empty() {
            return;
        }
        self.distribution(TRIANGLES_BY_FLUX, &surface.by_flux);
        let instances = world.scene.instances.len() as u32;
        self.words[INSTANCE_COUNT] = instances;
        let first = |i| surface.first_of_instance.get(&i).copied().unwrap_or(NO_TRIANGLE);
        self.table(FIRST_OF_INSTANCE, (0..instances).map(first));
    }

    fn sky(&mut self, world: &World, emitters: &Emitters) {
        let (Some(emitter), Some(sky)) = (&emitters.sky, &world.scene.sky) else { return };
        let mean = emitter.mean_radiance().to_array().map(f32::to_bits);
        self.words[SKY_MEAN..SKY_MEAN + 3].copy_from_slice(&mean);
        match sky {
            Sky::Constant(radiance) => {
                self.words[SKY_KIND] = SKY_CONSTANT;
                self.table(SKY_RADIANCE, bits(*radiance));
            }
            Sky::Map(map) => {
                self.words[SKY_KIND] = SKY_MAP;
                self.words[SKY_WIDTH] = map.width;
                self.words[SKY_HEIGHT] = map.height;
                self.words[SKY_TURN] = (map.rotation_rad / std::f32::consts::TAU).to_bits();
                let total = emitter.by_flux.total();
                let inverse = if total > 0.0 { (1.0 / total) as f32 } else { 0.0 };
                self.words[SKY_INVERSE_TOTAL] = inverse.to_bits();
                self.sky_tables(map, &emitter.by_flux);
            }
        }
    }

    /// Texels with their thresholds, the last threshold of each row and the cosines between rows. A
    /// direction's density is luminance over total, so that a table of probabilities is not needed.
    fn sky_tables(&mut self, map: &SkyMap, by_flux: &Discrete) {
        let thresholds = by_flux.thresholds();
        let width = map.width as usize;
        self.table(
            SKY_ROWS_BY_FLUX,
            thresholds.chunks(width).filter_map(|row| row.last().copied()),
        );
        let rows = (0..=map.height).map(|row| super::sky::row_cos(map, row as f32).to_bits());
        self.table(SKY_ROWS, rows);
        let texel = |(&radiance, &threshold): (&Vec3, &u32)| {
            let [r, g, b] = bits(radiance);
            [r, g, b, threshold]
        };
        let texels = map.radiance.iter().zip(&thresholds).map(texel).collect();
        self.sky = SkyTexels { size: [map.width, map.height], texels };
    }
}

fn bits(v: Vec3) -> [u32; 3] {
    v.to_array().map(f32::to_bits)
}

fn light_words(light: &Light) -> [u32; LIGHT_WORDS] {
    let (kind, position, direction, intensity, cosines) = match *light {
        Light::Sun { direction, irradiance } => {
            (KIND_SUN, Vec3::ZERO, direction, irradiance, [0.0; 2])
        }
        Light::Point { position, intensity } => {
            (KIND_POINT, position, Vec3::ZERO, intensity, [0.0; 2])
        }
        Light::Spot { position, direction, intensity, cos_outer, cos_inner } => {
            (KIND_SPOT, position, direction, intensity, [cos_outer, cos_inner])
        }
    };
    let mut words = [kind; LIGHT_WORDS];
    words[1..4].copy_from_slice(&bits(position));
    words[4..7].copy_from_slice(&bits(direction));
    words[7..10].copy_from_slice(&bits(intensity));
    words[10..12].copy_from_slice(&cosines.map(f32::to_bits));
    words
}

#[cfg(test)]
pub(crate) mod testing;
#[cfg(test)]
mod tests;
