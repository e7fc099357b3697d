// The G-buffer of an engine. What the sky gives to pixels without a surface is added elsewhere.
import package::surface::octahedral;

struct LoadParams {
    width: u32,
    height: u32,
    // Whether there are geometric normals of their own, and emission.
    has_geometric_normals: u32,
    has_emissions: u32,
}

@group(0) @binding(0) var<uniform> params: LoadParams;
@group(0) @binding(1) var position_depths: texture_2d<f32>;
@group(0) @binding(2) var shading_normals: texture_2d<f32>;
@group(0) @binding(3) var geometric_normals: texture_2d<f32>;
@group(0) @binding(4) var reflectances: texture_2d<f32>;
@group(0) @binding(5) var radiances: texture_2d<f32>;
@group(0) @binding(6) var<storage, read_write> positions: array<vec4f>;
@group(0) @binding(7) var<storage, read_write> normals: array<vec4f>;
@group(0) @binding(8) var<storage, read_write> albedos: array<vec4f>;
@group(0) @binding(9) var<storage, read_write> emissions: array<vec4f>;

// Largest length that a coordinate may have, m: its square is still a number.
const LARGEST = 1e18;

@compute @workgroup_size(GROUP_X, GROUP_Y)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= params.width || id.y >= params.height {
        return;
    }
    let pixel = id.y * params.width + id.x;
    let at = vec2i(id.xy);
    let position = textureLoad(position_depths, at, 0);
    var ns = textureLoad(shading_normals, at, 0).xyz;
    var ng = ns;
    if params.has_geometric_normals != 0u {
        ng = textureLoad(geometric_normals, at, 0).xyz;
    }
    let is_surface = is_number(position) && position.w > 0.0 && position.w < LARGEST
        && all(abs(position.xyz) < vec3f(LARGEST)) && is_direction(ns) && is_direction(ng);
    if !is_surface {
        positions[pixel] = vec4f(vec3f(0.0), NO_SURFACE);
        normals[pixel] = vec4f(0.0);
        albedos[pixel] = vec4f(0.0);
        emissions[pixel] = vec4f(0.0);
        return;
    }
    ns = normalize(ns);
    ng = normalize(ng);
    ns = select(ns, -ns, dot(ns, ng) < 0.0);
    let albedo = bounded(textureLoad(reflectances, at, 0).rgb, 1.0);
    var emission = vec3f(0.0);
    if params.has_emissions != 0u {
        emission = bounded(textureLoad(radiances, at, 0).rgb, LARGEST);
    }
    positions[pixel] = position;
    normals[pixel] = vec4f(ns, bitcast<f32>(pack_octahedral(ng)));
    albedos[pixel] = vec4f(albedo, 0.0);
    emissions[pixel] = vec4f(emission, 0.0);
}

// Whether nothing is infinite or no number, by the bits: comparisons with NaN are not reliable.
fn is_number(v: vec4f) -> bool {
    let exponents = bitcast<vec4u>(v) & vec4u(0x7f800000u);
    return all(exponents != vec4u(0x7f800000u));
}

// Whether a vector can be brought to unit length.
fn is_direction(v: vec3f) -> bool {
    let length = length(v);
    return is_number(vec4f(v, length)) && length > 1e-6;
}

// A color in 0…most; 0 where it is no number.
fn bounded(color: vec3f, most: f32) -> vec3f {
    let clamped = clamp(color, vec3f(0.0), vec3f(most));
    return select(vec3f(0.0), clamped, is_number(vec4f(color, 0.0)));
}
