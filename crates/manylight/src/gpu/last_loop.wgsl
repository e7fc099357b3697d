// A loop at the end of a kernel: a driver that ended one before it early ends this one too.

struct LastLoop {
    turns: u32,
    is_cut: atomic<u32>,
}

@group(2) @binding(0) var<storage, read_write> last_loop: LastLoop;

fn make_last_loop() {
    let turns = last_loop.turns;
    var made = 0u;
    for (var i = 0u; i < turns; i++) {
        made = i + 1u;
    }
    if made < turns {
        atomicStore(&last_loop.is_cut, 1u);
    }
}
