//! Reading textures: wrapping, filtering, decoding.

use glam::{Vec2, Vec3, Vec4};
use manylight_scene::{TextureImage, TextureSlot, Wrap};
use std::sync::LazyLock;

/// sRGB code value → linear.
static SRGB_TO_LINEAR: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|code| {
        let c = code as f32 / 255.0;
        if c <= 0.040_45 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    })
});

/// A texel's color decoded from sRGB to linear, filtered after decoding; alpha is linear.
pub fn sample_srgb(images: &[TextureImage], slot: &TextureSlot, uv: Vec2) -> Vec4 {
    filter(images, slot, uv, |[r, g, b, a]| {
        let table = &*SRGB_TO_LINEAR;
        Vec3::new(table[r as usize], table[g as usize], table[b as usize])
            .extend(f32::from(a) / 255.0)
    })
}

/// A texel's stored values in 0…1, filtered.
pub fn sample_rgba(images: &[TextureImage], slot: &TextureSlot, uv: Vec2) -> Vec4 {
    filter(images, slot, uv, |texel| Vec4::from_array(texel.map(|v| f32::from(v) / 255.0)))
}

fn filter(
    images: &[TextureImage],
    slot: &TextureSlot,
    uv: Vec2,
    decode: impl Fn([u8; 4]) -> Vec4,
) -> Vec4 {
    let image = &images[slot.image as usize];
    let uv = slot.transform.transform_point2(uv);
    let uv = if uv.is_finite() { uv } else { Vec2::ZERO };
    // Coordinates are wrapped before they are scaled, so that large ones keep their fraction.
    let at = |coordinate: f32, wrap: Wrap, size: u32| {
        let period = if wrap == Wrap::Mirror { 2.0 } else { 1.0 };
        let inside = match wrap {
            Wrap::Clamp => coordinate.clamp(0.0, 1.0),
            _ => coordinate - (coordinate / period).floor() * period,
        };
        inside * size as f32
    };
    let x = at(uv.x, slot.wrap[0], image.width);
    let y = at(uv.y, slot.wrap[1], image.height);
    let texel = |x: i64, y: i64| {
        let x = wrap_texel(x, slot.wrap[0], image.width);
        let y = wrap_texel(y, slot.wrap[1], image.height);
        decode(image.texels[y * image.width as usize + x])
    };
    if !slot.linear_filter {
        return texel(x.floor() as i64, y.floor() as i64);
    }
    let (x, y) = (x - 0.5, y - 0.5);
    let (x0, y0) = (x.floor(), y.floor());
    let (fx, fy) = (x - x0, y - y0);
    let (x0, y0) = (x0 as i64, y0 as i64);
    let top = texel(x0, y0).lerp(texel(x0 + 1, y0), fx);
    let bottom = texel(x0, y0 + 1).lerp(texel(x0 + 1, y0 + 1), fx);
    top.lerp(bottom, fy)
}

fn wrap_texel(index: i64, wrap: Wrap, size: u32) -> usize {
    let size = i64::from(size);
    let wrapped = match wrap {
        Wrap::Repeat => index.rem_euclid(size),
        Wrap::Clamp => index.clamp(0, size - 1),
        Wrap::Mirror => {
            let i = index.rem_euclid(2 * size);
            if i < size { i } else { 2 * size - 1 - i }
        }
    };
    wrapped as usize
}
