// Automatic exposure from the counts of luminances; twin of compute_auto_exposure_ev, whose
// middle four fifths are counted here in steps. Clears the counts.

struct Exposure {
    // Stops, and the factor that they are.
    ev: f32,
    scale: f32,
}

@group(0) @binding(0) var<storage, read_write> histogram: array<u32>;
@group(0) @binding(1) var<storage, read_write> exposure: array<Exposure>;

const RUN = STEPS / GROUP_X;
var<workgroup> counts: array<u32, GROUP_X>;
var<workgroup> sums: array<f32, GROUP_X>;

@compute @workgroup_size(GROUP_X)
fn main(@builtin(local_invocation_index) local: u32) {
    // How many pixels lie in each run of steps, and before it.
    var own = 0u;
    for (var i = 0u; i < RUN; i++) {
        own += histogram[local * RUN + i];
    }
    counts[local] = own;
    for (var step = 1u; step < GROUP_X; step *= 2u) {
        workgroupBarrier();
        var before = 0u;
        if local >= step {
            before = counts[local - step];
        }
        workgroupBarrier();
        counts[local] += before;
    }
    workgroupBarrier();
    let total = counts[GROUP_X - 1u];
    let cut = total / TRIM_PARTS;

    // Sum of the middle pixels' stops.
    var at = counts[local] - own;
    var sum = 0.0;
    for (var i = 0u; i < RUN; i++) {
        let bin = local * RUN + i;
        let first = max(at, cut);
        at += histogram[bin];
        let last = min(at, total - cut);
        let stop = LEAST_STOP + (f32(bin) + 0.5) / STEPS_PER_STOP;
        sum += f32(max(last, first) - first) * stop;
        histogram[bin] = 0u;
    }
    sums[local] = sum;
    for (var half = GROUP_X / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if local < half {
            sums[local] += sums[local + half];
        }
    }
    if local == 0u {
        let middle = f32(max(total - 2u * cut, 1u));
        var ev = clamp(MIDDLE_GREY_STOP - sums[0] / middle, -MAX_EV, MAX_EV);
        ev = select(0.0, ev, total > 0u);
        exposure[0] = Exposure(ev, exp2(ev));
    }
}
