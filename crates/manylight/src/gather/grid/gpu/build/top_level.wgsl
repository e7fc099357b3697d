// Where cells begin among sorted lights.
import package::gather::grid::gpu::build::split;

// The highest level at which a light is the first of its cell; 0 where it never is. For kernels
// that bind `info` and `items`.
fn top_level(index: u32) -> u32 {
    if index >= min(info.vpl_count, arrayLength(&items)) {
        return 0u;
    }
    if index == 0u {
        return info.level_count;
    }
    let level = split_level(items[index - 1u].xy, items[index].xy);
    return select(0u, info.level_count + 1u - level, level <= info.level_count);
}
