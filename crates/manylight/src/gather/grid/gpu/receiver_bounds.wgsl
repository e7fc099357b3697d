// Bounds of the receivers that a workgroup looks at; twin of Bounds::of in tiles.rs.

const NOTHING = 3e38;

var<workgroup> bounds_parts: array<Bounds, GROUP_X * GROUP_Y>;

fn no_bounds() -> Bounds {
    let most = vec3f(NOTHING);
    return Bounds(most, -most, most, -most);
}

fn join(a: Bounds, b: Bounds) -> Bounds {
    return Bounds(
        min(a.low, b.low),
        max(a.high, b.high),
        min(a.normal_low, b.normal_low),
        max(a.normal_high, b.normal_high),
    );
}

// Joins the bounds of all invocations; every one of them must come here.
fn join_all(own: Bounds, local: u32) -> Bounds {
    bounds_parts[local] = own;
    for (var step = GROUP_X * GROUP_Y / 2u; step > 0u; step /= 2u) {
        workgroupBarrier();
        if local < step {
            bounds_parts[local] = join(bounds_parts[local], bounds_parts[local + step]);
        }
    }
    return workgroupUniformLoad(&bounds_parts[0]);
}
