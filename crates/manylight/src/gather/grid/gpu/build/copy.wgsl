// The virtual lights in order, and their positions in level-1 cells.
import package::gpu::index;
import package::math::color;
import package::vlight::vpl::record;
import package::gather::grid::gpu::record;
import package::gather::grid::gpu::build::cube;

@group(0) @binding(0) var<uniform> info: GridInfo;
@group(0) @binding(1) var<storage, read> lights: array<Vpl>;
@group(0) @binding(2) var<storage, read> items: array<vec4u>;
@group(0) @binding(3) var<storage, read_write> vpls: array<Vpl>;
@group(0) @binding(4) var<storage, read_write> points: array<vec4f>;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let index = item_index(group, groups, local);
    if index >= min(info.vpl_count, arrayLength(&vpls)) || info.level_count == 0u {
        return;
    }
    let light = lights[items[index].z];
    let cube = Cube(info.origin, info.edge);
    let p = lattice_position(cube, info.level_count, light.position);
    vpls[index] = light;
    points[index] = vec4f(p, luminance(light.intensity));
}
