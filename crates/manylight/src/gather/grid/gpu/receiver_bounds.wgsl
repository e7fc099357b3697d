// Bounds of the receivers that a workgroup looks at; twin of Bounds::of in tiles.rs.
import package::gather::grid::gpu::bounds_of;

var<workgroup> bounds_parts: array<Bounds, GROUP_X * GROUP_Y>;

// Joins the bounds of all invocations, which must all come here, once.
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
