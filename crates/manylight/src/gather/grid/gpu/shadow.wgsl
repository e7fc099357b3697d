// Traces the rays to the drawn virtual lights; twin of is_vpl_seen in shadow/mod.rs.
//
// A pick whose light is seen gets IS_SEEN.
import package::gather::grid::gpu::params;
import package::vlight::vpl::record;
import package::surface::octahedral;
import package::shadow::shadow;

@group(0) @binding(0) var<uniform> params: GatherParams;
@group(0) @binding(1) var<storage, read_write> picks: array<Pick>;
@group(0) @binding(2) var<storage, read> positions: array<vec4f>;
@group(0) @binding(3) var<storage, read> normals: array<vec4f>;
@group(0) @binding(4) var<storage, read> vpls: array<Vpl>;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let pixel = pixel_index(pixel_position(group.x, local));
    if pixel == NO_PIXEL {
        return;
    }
    let place = pick_place(group.x, local, group.y);
    let light = picks[place].light;
    if light == PICK_NONE || light == PICK_NOTHING || (light & NEEDS_RAY) == 0u {
        return;
    }
    let p = positions[pixel].xyz;
    let ng = unpack_octahedral(bitcast<u32>(normals[pixel].w));
    let vpl = vpls[light & INDEX_MASK];
    if !occluded(segment_ray(p + ng * ray_offset(p), vpl.position, vpl.normal)) {
        picks[place].light = light | IS_SEEN;
    }
}
