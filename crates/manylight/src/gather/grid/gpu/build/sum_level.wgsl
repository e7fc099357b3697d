// Grid lights of some levels, each from those of the level below; twin of sweep_level. Eight
// invocations a light. More than one level takes a single workgroup.
import package::gpu::index;
import package::gather::grid::gpu::build::octant_sums;

struct LevelParams {
    first_level: u32,
    last_level: u32,
}

@group(0) @binding(0) var<uniform> params: LevelParams;
@group(0) @binding(1) var<uniform> info: GridInfo;
@group(0) @binding(2) var<storage, read> cells: array<Cell>;
@group(0) @binding(3) var<storage, read> octants: array<Octants>;
@group(0) @binding(4) var<storage, read_write> lights: array<GridLight>;

// Adds the lights of the level below that one of its cells owns, as far as they are near enough.
fn add_owned(sum: ptr<function, Moments>, cell: u32, level: u32, vertex: vec3u) {
    let flags = cells[cell].octant_owned >> 8u;
    var index = cells[cell].first_owned;
    let size = cell_size(info, level);
    for (var corner = 0u; corner < 8u; corner++) {
        if (flags >> corner & 1u) == 0u {
            continue;
        }
        let fine = lights[index];
        index++;
        let step = vec3i(vertex_of(fine)) - 2 * vec3i(vertex);
        if any(abs(step) > vec3i(1)) {
            continue;
        }
        let hat = 1.0 - 0.5 * vec3f(abs(step));
        let p_fine = info.origin + vec3f(vertex_of(fine)) * (0.5 * size);
        let mean = (fine.position - p_fine) * (1.0 / size) + 0.5 * vec3f(step);
        let variance = fine.variance * (1.0 / (size * size));
        let light = vec4f(fine.intensity, fine.luminance);
        add_share(sum, light, fine.normal, hat.x * hat.y * hat.z, mean, variance);
    }
}

// What lies in the cell in one octant around the vertex of a light of a level.
fn sum_in_octant(level: u32, index: u32, octant: u32) -> Moments {
    var sum: Moments;
    let coarse = octants[index].cells[octant];
    if coarse != NONE {
        let vertex = vertex_of(lights[index]);
        // Each vertex of the level below is owned by one cell, inside a cell around this vertex.
        for (var cell = cells[coarse].inner; cell < cells[coarse + 1u].inner; cell++) {
            add_owned(&sum, cell, level, vertex);
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
    let invocations = groups.x * groups.y * GROUP_X;
    let last_level = min(params.last_level, info.level_count);
    for (var level = params.first_level; level <= last_level; level++) {
        let place = info.levels[level];
        for (var first = 0u; first < 8u * place.light_count; first += invocations) {
            let item = first + item_index(group, groups, local);
            let index = place.first_light + item / 8u;
            let is_there = item < 8u * place.light_count;
            var own: Moments;
            if is_there {
                own = sum_in_octant(level, index, item % 8u);
            }
            let sum = sum_octants(own, local);
            if is_there && item % 8u == 0u {
                lights[index] = light_of(sum, lights[index], info.origin, cell_size(info, level));
            }
        }
        // The next level reads what this one wrote.
        storageBarrier();
    }
}
