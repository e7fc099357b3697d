use super::gather_tests::{Case, alpha_of, bits, check_sums, run};
use super::*;
use crate::gpu::testing::device;

/// A small case with n × n classes of lights; its sides are no multiples of anything.
fn interleaved(scene: &str, preset: &str, side: u32) -> Case {
    let mut case = Case::new(scene, preset, [70, 37], 2500);
    case.settings.grid.evals = 150;
    case.settings.interleave = side;
    case
}

#[test]
fn interleaved_sums_are_those_of_the_processor() {
    let Some(gpu) = device() else { return };
    let cases = [
        ("builtin:cornell", "balanced", 2),
        ("builtin:atrium", "balanced", 4),
        ("builtin:cornell", "paper", 4),
    ];
    for (scene, preset, side) in cases {
        let case = interleaved(scene, preset, side).with_alpha();
        check_sums(&case, &run(gpu, &case, GatherCapacity::default()));
    }
}

#[test]
fn alpha_knows_nothing_of_interleaving() {
    let Some(gpu) = device() else { return };
    let [one, four] =
        [1, 4].map(|side| alpha_of(gpu, &interleaved("builtin:atrium", "fast", side)));
    assert_eq!(one.alpha.to_bits(), four.alpha.to_bits());
    assert!(one.alpha != 1.0);
}

#[test]
fn bands_of_interleaved_blocks_change_no_bit() {
    let Some(gpu) = device() else { return };
    let case = interleaved("builtin:cornell", "balanced", 4);
    let whole = run(gpu, &case, GatherCapacity::default());
    let small = GatherCapacity { band_blocks: 5, slice_rays: 3, ..Default::default() };
    assert!(bits(&whole) == bits(&run(gpu, &case, small)), "bands matter");
}
