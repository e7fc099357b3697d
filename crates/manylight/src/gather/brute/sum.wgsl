// Sums a run of virtual lights at the receivers of a tile, a shadow ray each; twin of sum in
// mod.rs.

import package::direct::receiver;
import package::gpu::index;
import package::shadow::shadow;
import package::vlight::vpl::record;
import package::gather::brute::record;

struct SumParams {
    // Receivers of the tile.
    first_pixel: u32,
    pixels: u32,
    // Lights of the run.
    first_light: u32,
    end_light: u32,
    d_min_sq: f32,
}

@group(0) @binding(0) var<uniform> params: SumParams;
// World position, and depth: NO_SURFACE where there is none.
@group(0) @binding(1) var<storage, read> positions: array<vec4f>;
// Shading normal, and the packed geometric one.
@group(0) @binding(2) var<storage, read> normals: array<vec4f>;
@group(0) @binding(3) var<storage, read> lights: array<Vpl>;
// One per receiver of the tile.
@group(0) @binding(4) var<storage, read_write> sums: array<BruteSum>;

// Adds a block of lights; blocks are summed by themselves, so that long sums keep their digits.
fn block_sum(s: SurfacePoint, first: u32, end: u32) -> BruteSum {
    var sum = BruteSum(vec3f(0.0), 0u, vec3f(0.0));
    for (var i = first; i < end; i++) {
        let light = lights[i];
        let shape =
            vpl_geometry(light.position, light.normal, s.position, s.ns, params.d_min_sq);
        let e = light.intensity * shape;
        if all(e == vec3f(0.0)) {
            continue;
        }
        sum.evals += 1u;
        sum.unshadowed += e;
        if is_seen(s, light.position, light.normal) {
            sum.shadowed += e;
        }
    }
    return sum;
}

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
    var sum = BruteSum(vec3f(0.0), 0u, vec3f(0.0));
    if params.first_light > 0u {
        sum = sums[index];
    }
    let pixel = params.first_pixel + index;
    if positions[pixel].w < NO_SURFACE {
        let s = bare_receiver(positions[pixel], normals[pixel]);
        let end = min(params.end_light, arrayLength(&lights));
        for (var first = params.first_light; first < end; first += BRUTE_BLOCK) {
            let block = block_sum(s, first, min(first + BRUTE_BLOCK, end));
            sum.unshadowed += block.unshadowed;
            sum.evals += block.evals;
            sum.shadowed += block.shadowed;
        }
    }
    sums[index] = sum;
}
