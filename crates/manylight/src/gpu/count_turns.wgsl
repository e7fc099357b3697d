// Counts how many turns the driver gives a loop, of as many as are asked for.

struct Turns {
    asked: u32,
    made: u32,
}

@group(0) @binding(0) var<storage, read_write> turns: array<Turns>;

@compute @workgroup_size(GROUP_X)
fn main() {
    var made = 0u;
    for (var i = 0u; i < turns[0].asked; i++) {
        made = i + 1u;
    }
    turns[0].made = made;
}
