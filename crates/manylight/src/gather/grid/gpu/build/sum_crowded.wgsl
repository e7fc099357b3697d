// The crowded grid lights of level 1: a workgroup each.
import package::gather::grid::gpu::build::around_vertex;

@group(0) @binding(0) var<uniform> info: GridInfo;
@group(0) @binding(1) var<storage, read> cells: array<Cell>;
@group(0) @binding(2) var<storage, read> octants: array<Octants>;
@group(0) @binding(3) var<storage, read> vpls: array<Vpl>;
@group(0) @binding(4) var<storage, read> points: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> lights: array<GridLight>;

var<workgroup> sums: array<Moments, GROUP_X>;

fn join(a: Moments, b: Moments) -> Moments {
    return Moments(a.light + b.light, a.offset + b.offset, a.offset_sq + b.offset_sq,
        a.normal + b.normal);
}

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let index = group.y * groups.x + group.x;
    if index >= info.levels[1].light_count || info.level_count == 0u {
        return;
    }
    let around = octants[index].cells;
    if count_around(around) <= CROWDED {
        return;
    }
    var own: Moments;
    add_vpls(&own, around, vertex_of(lights[index]), local, GROUP_X);
    sums[local] = own;
    for (var half = GROUP_X / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if local < half {
            sums[local] = join(sums[local], sums[local + half]);
        }
    }
    if local == 0u {
        lights[index] = light_of(sums[0], lights[index], info.origin, cell_size(info, 1u));
    }
}
