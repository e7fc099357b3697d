// What a gather would have needed; described in params.rs.
struct GatherStats {
    frontier: atomic<u32>,
    chunks: atomic<u32>,
}
