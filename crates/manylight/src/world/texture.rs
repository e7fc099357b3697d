//! Reading textures: wrapping, filtering, decoding.

use glam::{Vec2, Vec4};
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
    let table = &*SRGB_TO_LINEAR;
    filter(images, slot, uv, |[r, g, b, a]| {
        let [r, g, b] = [r, g, b].map(|code| table[usize::from(code)]);
        Vec4::new(r, g, b, f32::from(a) / 255.0)
    })
}

/// A texel's stored values in 0…1, filtered.
pub fn sample_rgba(images: &[TextureImage], slot: &TextureSlot, uv: Vec2) -> Vec4 {
    filter(images, slot, uv, |texel| Vec4::from_array(texel.map(f32::from)) / 255.0)
}

#[inline(always)]
fn filter(
    images: &[TextureImage],
    slot: &TextureSlot,
    uv: Vec2,
    decode: impl Fn([u8; 4]) -> Vec4,
) -> Vec4 {
    let image = &images[slot.image as usize];
    let uv = slot.transform.transform_point2(uv);
    let uv = if uv.is_finite() { uv } else { Vec2::ZERO };
    let x = scale_inside(uv.x, slot.wrap[0], image.width);
    let y = scale_inside(uv.y, slot.wrap[1], image.height);
    let columns = |x: i32| wrap_texel(x, slot.wrap[0], image.width);
    let rows = |y: i32| wrap_texel(y, slot.wrap[1], image.height) * image.width as usize;
    if !slot.linear_filter {
        return decode(image.texels[rows(floor(y) as i32) + columns(floor(x) as i32)]);
    }
    let (x, y) = (x - 0.5, y - 0.5);
    let (x0, y0) = (floor(x), floor(y));
    let (fx, fy) = (x - x0, y - y0);
    let (x0, y0) = (x0 as i32, y0 as i32);
    let (left, right) = (columns(x0), columns(x0 + 1));
    let (top, bottom) = (rows(y0), rows(y0 + 1));
    // All four are read before one is decoded, so that they are waited for together.
    let texels = [top + left, top + right, bottom + left, bottom + right];
    let [a, b, c, d] = texels.map(|i| image.texels[i]).map(decode);
    a.lerp(b, fx).lerp(c.lerp(d, fx), fy)
}

/// A coordinate in texels, 0…size; 0…2 · size for mirrored ones.
///
/// Coordinates are wrapped before they are scaled, so that large ones keep their fraction.
#[inline(always)]
fn scale_inside(coordinate: f32, wrap: Wrap, size: u32) -> f32 {
    let inside = match wrap {
        Wrap::Clamp => coordinate.clamp(0.0, 1.0),
        Wrap::Repeat => coordinate - floor(coordinate),
        Wrap::Mirror => coordinate - floor(coordinate * 0.5) * 2.0,
    };
    inside * size as f32
}

/// `f32::floor` without a call on processors that need one for it.
#[inline(always)]
fn floor(x: f32) -> f32 {
    let whole = x as i32 as f32;
    // Numbers beyond 2^23 have no fraction.
    match x.abs() < 8_388_608.0 {
        true if whole > x => whole - 1.0,
        true => whole,
        false => x,
    }
}

/// The texel at an index that is at most one outside of 0…size, or 0…2 · size if mirrored.
#[inline(always)]
fn wrap_texel(index: i32, wrap: Wrap, size: u32) -> usize {
    let size = size as i32;
    let around = |index: i32, period: i32| match index {
        i if i < 0 => i + period,
        i if i >= period => i - period,
        i => i,
    };
    let wrapped = match wrap {
        Wrap::Repeat => around(index, size),
        Wrap::Clamp => index.clamp(0, size - 1),
        Wrap::Mirror => {
            let i = around(index, 2 * size);
            if i < size { i } else { 2 * size - 1 - i }
        }
    };
    wrapped as usize
}
