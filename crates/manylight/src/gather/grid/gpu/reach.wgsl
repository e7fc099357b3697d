// How far the levels reach, as the device chose it; described in alpha.rs.
struct Reach {
    alpha: f32,
    is_done: u32,
    asked: u32,
    _pad: u32,
}
