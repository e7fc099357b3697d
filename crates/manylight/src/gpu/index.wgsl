// Position of an invocation in a list whose workgroups may be folded into two dimensions.
fn item_index(group: vec3u, groups: vec3u, local: u32) -> u32 {
    return (group.y * groups.x + group.x) * GROUP_X + local;
}

// Workgroups for a number of items, folded where there are many.
fn groups_for(items: u32, group_size: u32) -> vec3u {
    let groups = (items + group_size - 1u) / group_size;
    let rows = max((groups + MAX_GROUPS - 1u) / MAX_GROUPS, 1u);
    return vec3u((groups + rows - 1u) / rows, rows, 1u);
}
