// A node of a binary hierarchy against a ray: what the eight-wide one is measured against.
import package::bvh::traverse;

// Two children follow each other. In a leaf `first` is its triangle and `count` their number; in
// others `first` is the first child and `count` zero.
struct BinaryNode {
    low: vec3f,
    first: u32,
    high: vec3f,
    count: u32,
}

// Where a ray enters a box before t_max; FAR_AWAY where it does not.
fn enter_box(node: BinaryNode, s: RaySetup, t_max: f32) -> f32 {
    let a = (node.low - s.origin) * s.inverse;
    let b = (node.high - s.origin) * s.inverse;
    let near = min(a, b);
    let far = max(a, b);
    let t_enter = max(max(near.x, near.y), max(near.z, 0.0));
    // A few roundings of the far side, so that a grazed box is never missed.
    let t_leave = min(min(far.x, far.y), far.z) * 1.000001;
    return select(FAR_AWAY, t_enter, t_enter <= min(t_leave, t_max));
}
