// The rays of a slice become shares; after the last slice, ratio and trust. Twin of the sums of
// shadow_ratio in sample.rs.
import package::gather::grid::gpu::params;
import package::gather::grid::gpu::stats;

@group(0) @binding(0) var<uniform> params: GatherParams;
@group(0) @binding(1) var<storage, read> positions: array<vec4f>;
@group(0) @binding(2) var<storage, read> candidates: array<u32>;
@group(0) @binding(3) var<storage, read> picks: array<Pick>;
@group(0) @binding(4) var<storage, read_write> ratio: array<vec2f>;
@group(0) @binding(5) var<storage, read_write> stats: array<GatherStats>;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    if group.x == 0u && local == 0u {
        atomicMax(&stats[0].chunks, candidates[params.block_count]);
    }
    let pixel = pixel_index(pixel_position(group.x, local));
    if pixel == NO_PIXEL {
        return;
    }
    // Seen and drawn.
    var sums = vec2f(0.0);
    if params.first_ray > 0u {
        sums = ratio[pixel];
    }
    var is_dark = params.rays == 0u || positions[pixel].w >= NO_SURFACE;
    if !is_dark {
        for (var ray = 0u; ray < params.slice_rays; ray++) {
            let pick = picks[pick_place(group.x, local, ray)];
            if pick.light == PICK_NOTHING {
                is_dark = true;
                break;
            }
            if pick.light != PICK_NONE {
                sums.y += pick.geometry;
                sums.x += select(0.0, pick.geometry, (pick.light & IS_SEEN) != 0u);
            }
        }
    }
    if params.first_ray + params.slice_rays >= params.rays {
        if sums.y > 0.0 {
            sums = vec2f(sums.x / sums.y, sums.y / f32(params.rays));
        } else {
            sums = vec2f(0.0);
        }
    }
    // Without anything to draw from all of nothing arrives.
    ratio[pixel] = select(sums, vec2f(1.0), is_dark);
}
