// Bounds of some receivers.

const NOTHING = 3e38;

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
