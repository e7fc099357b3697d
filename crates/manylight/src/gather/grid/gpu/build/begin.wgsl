// Empties what a build counts in.
import package::gather::grid::gpu::build::extent;

@group(0) @binding(0) var<uniform> vpl_info: VplInfo;
@group(0) @binding(1) var<storage, read_write> extent: Extent;
@group(0) @binding(2) var<storage, read_write> splits: array<atomic<u32>>;
@group(0) @binding(3) var<storage, read_write> sort_count: array<u32>;
@group(0) @binding(4) var<storage, read_write> crowded: array<u32>;

@compute @workgroup_size(GROUP_X)
fn main(@builtin(local_invocation_index) local: u32) {
    if local < 3u {
        atomicStore(&extent.low[local], 0xffffffffu);
        atomicStore(&extent.high[local], 0u);
    }
    if local == 0u {
        atomicStore(&extent.count, 0u);
        sort_count[0] = vpl_info.count;
        crowded[0] = 0u;
    }
    if local < LEVEL_ENTRIES {
        atomicStore(&splits[local], 0u);
    }
}
