// Sort key of every light: lobe above the interleaved bits of the finest cell.
import package::gpu::index;
import package::gather::grid::gpu::build::cube;
import package::gather::grid::gpu::build::extent;

struct KeyParams {
    lobes: u32,
}

@group(0) @binding(0) var<uniform> params: KeyParams;
@group(0) @binding(1) var<uniform> vpl_info: VplInfo;
@group(0) @binding(2) var<storage, read> lights: array<Vpl>;
@group(0) @binding(3) var<storage, read_write> extent: Extent;
@group(0) @binding(4) var<storage, read_write> items: array<vec4u>;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let index = item_index(group, groups, local);
    if index >= min(vpl_info.count, arrayLength(&lights)) {
        return;
    }
    var low: vec3f;
    var high: vec3f;
    for (var axis = 0u; axis < 3u; axis++) {
        low[axis] = from_ordered(atomicLoad(&extent.low[axis]));
        high[axis] = from_ordered(atomicLoad(&extent.high[axis]));
    }
    let light = lights[index];
    var lobe = LEFT_OUT;
    var cell = vec3u(0u);
    if is_valid(light) {
        let cube = cube_around(low, high);
        lobe = lobe_of(light.normal, params.lobes);
        cell = cell_of(cube, MAX_LEVELS, light.position);
    }
    let code = morton(cell);
    let lobe_bits = 3u * (MAX_LEVELS - 1u);
    items[index] = vec4u(code.x, code.y | (lobe << (lobe_bits - 32u)), index, 0u);
}
