// Where tracing stands; described in trace.rs.
struct TraceState {
    light_count: u32,
    path_count: u32,
    batch: u32,
}
