// Counts the lights that give a receiver something at the present alpha: a workgroup per receiver.
// Twin of count in reach.rs.
import package::gather::grid::gpu::params;
import package::gather::grid::gpu::tiles;
import package::gather::grid::gpu::descend;
import package::gather::grid::gpu::stats;

@group(0) @binding(0) var<uniform> params: GatherParams;
@group(0) @binding(1) var<uniform> reach: Reach;
@group(0) @binding(2) var<uniform> info: GridInfo;
@group(0) @binding(3) var<storage, read> asked: array<vec4f>;
@group(0) @binding(4) var<storage, read> cells: array<Cell>;
@group(0) @binding(5) var<storage, read> lights: array<GridLight>;
@group(0) @binding(6) var<storage, read> vpls: array<Vpl>;
@group(0) @binding(7) var<storage, read_write> frontier: array<u32>;
@group(0) @binding(8) var<storage, read_write> counts: array<u32>;
@group(0) @binding(9) var<storage, read_write> stats: array<GatherStats>;

fn is_wanted(level: u32, index: u32, bounds: Bounds) -> bool {
    let light = load_light(level, index);
    if !is_in_reach(light, level, bounds) {
        return false;
    }
    let near = tile_light(light, level);
    let offset = near.position - bounds.low;
    let blended = blend(near.nearer, near.rise, near.fall, offset);
    return blended > 0.0 && blended * geometry(near, offset, bounds.normal_low, 0.0) > 0.0;
}

fn keep(place: u32, level: u32, index: u32) {}

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    fill_shells(local);
    workgroupBarrier();
    var seen = vec2u(0u);
    if reach.is_done == 0u && reach.asked > 0u && is_whole() {
        let p = asked[group.x].xyz;
        let n = asked[ASKED + group.x].xyz;
        seen = descend(Bounds(p, p, n, n), group.x, local);
    }
    if local == 0u {
        counts[group.x] = seen.x;
        atomicMax(&stats[0].frontier, seen.y);
    }
}
