// Luminance of every grid light's share in each cell around its vertex: an invocation each.
import package::gpu::index;
import package::gather::grid::gpu::record;

@group(0) @binding(0) var<uniform> info: GridInfo;
@group(0) @binding(1) var<storage, read> shares: array<array<f32, 8>>;
@group(0) @binding(2) var<storage, read_write> octants: array<Octants>;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let item = item_index(group, groups, local);
    let light = item / 8u;
    let octant = item % 8u;
    if light >= info.light_count || info.level_count == 0u {
        return;
    }
    let cell = octants[light].cells[octant];
    if cell == NONE {
        octants[light].luminance[octant] = 0.0;
        octants[light].cells[octant] = 0u;
    } else {
        // Seen from its corner, the cell lies on the other side.
        octants[light].luminance[octant] = shares[cell][7u - octant];
    }
}
