// From scene-linear light to the eight bits of a screen: AgX with its default contrast.
//
// Source: Sobotka, AgX; matrices and sixth-order fit from Wrensch 2023, Minimal AgX
// Implementation. The specification is tone_map of manylight-image.

import package::gpu::index;

struct Exposure {
    // Stops, and the factor that they are.
    ev: f32,
    scale: f32,
}

struct ToneParams {
    pixels: u32,
    // Whether the exposure is the one found on the device.
    is_auto: u32,
    // Else the factor that it is.
    scale: f32,
}

@group(0) @binding(0) var<uniform> params: ToneParams;
@group(0) @binding(1) var<uniform> exposure: Exposure;
@group(0) @binding(2) var<storage, read> beauty: array<vec4f>;
// Red in the lowest byte, then green, blue and 255.
@group(0) @binding(3) var<storage, read_write> codes: array<u32>;

// Light that replaces +∞ and everything brighter, after exposure.
const BRIGHTEST = 65504.0;
// Columns: AgX's inset from linear Rec.709.
const AGX_FROM_REC709 = mat3x3f(
    vec3f(0.84247906, 0.042328242, 0.042375655),
    vec3f(0.0784336, 0.87846864, 0.0784336),
    vec3f(0.079223745, 0.07916613, 0.879143),
);
// Columns: the way back, on code values.
const REC709_FROM_AGX = mat3x3f(
    vec3f(1.196879, -0.052896852, -0.052971636),
    vec3f(-0.09802088, 1.1519031, -0.09804345),
    vec3f(-0.09902974, -0.09896118, 1.1510737),
);
// Exposure range of the curve, log2 of light.
const AGX_MIN_EV = -12.47393;
const AGX_MAX_EV = 4.026069;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let index = item_index(group, groups, local);
    if index >= params.pixels {
        return;
    }
    let light = beauty[index].rgb * select(params.scale, exposure.scale, params.is_auto != 0u);
    let code = vec3u(eval_agx(vec3f(bound(light.r), bound(light.g), bound(light.b))) * 255.0 + 0.5);
    codes[index] = code.r | (code.g << 8u) | (code.b << 16u) | (255u << 24u);
}

// A value in 0…BRIGHTEST; what is no number, by its bits, and what is negative becomes 0.
fn bound(value: f32) -> f32 {
    let bits = bitcast<u32>(value);
    if bits > 0x7f800000u {
        return 0.0;
    }
    return min(value, BRIGHTEST);
}

fn eval_agx(rgb: vec3f) -> vec3f {
    let ev = clamp(
        log2(max(AGX_FROM_REC709 * rgb, vec3f(1e-10))),
        vec3f(AGX_MIN_EV),
        vec3f(AGX_MAX_EV),
    );
    let curved = eval_agx_contrast((ev - AGX_MIN_EV) / (AGX_MAX_EV - AGX_MIN_EV));
    return clamp(REC709_FROM_AGX * curved, vec3f(0.0), vec3f(1.0));
}

// Wrensch's sixth-order fit of the contrast curve on 0…1.
fn eval_agx_contrast(x: vec3f) -> vec3f {
    var sum = vec3f(15.5);
    sum = sum * x - 40.14;
    sum = sum * x + 31.96;
    sum = sum * x - 6.868;
    sum = sum * x + 0.4298;
    sum = sum * x + 0.1191;
    return sum * x - 0.00232;
}
