// Values of texture slots at given coordinates, for comparison.
import package::world::texture;

struct ProbeParams {
    count: u32,
    // Whether colors are decoded.
    srgb: u32,
}

@group(0) @binding(0) var<uniform> params: ProbeParams;
// Coordinates, and which slot.
@group(0) @binding(1) var<storage, read> asked: array<vec4f>;
@group(0) @binding(2) var<storage, read_write> found: array<vec4f>;

@compute @workgroup_size(GROUP_X)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= params.count {
        return;
    }
    let at = asked[id.x];
    found[id.x] = sample_slot(u32(at.z), at.xy, params.srgb != 0u);
}
