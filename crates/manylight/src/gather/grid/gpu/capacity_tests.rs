use super::gather_tests::{Case, Run, bits, run, try_run};
use super::params::{BLOCK_PIXELS, CHUNK};
use super::*;
use crate::gpu::testing::device;
use crate::settings::Settings;

#[test]
fn bands_slices_and_repetitions_change_no_bit() {
    let Some(gpu) = device() else { return };
    let mut case = Case::new("builtin:cornell", "balanced", [70, 37], 800);
    case.settings.grid.evals = 60;
    let whole = run(gpu, &case, GatherCapacity::default());
    let again = run(gpu, &case, GatherCapacity::default());
    assert!(bits(&whole) == bits(&again), "two runs differ");
    let small = GatherCapacity { band_blocks: 4, slice_rays: 3, ..Default::default() };
    assert!(bits(&whole) == bits(&run(gpu, &case, small)), "bands matter");
}

#[test]
fn bands_are_of_one_size_and_small_where_lights_are_many() {
    let Some(gpu) = device() else { return };
    let fit = |evals| {
        let mut settings = Settings::default();
        settings.grid.evals = evals;
        GatherCapacity::default().fit(gpu, 1280, 720, &settings)
    };
    // 80 × 45 blocks.
    assert_eq!(fit(480).band_blocks, 1800);
    assert_eq!(fit(960).band_blocks, 900);
    assert_eq!(fit(65_536).band_blocks, 14);
    // All have nearly the same room.
    for evals in [480, 960, 65_536] {
        assert!((79_000..82_000).contains(&fit(evals).chunks()), "{evals}");
    }
}

#[test]
fn what_does_not_fit_is_told_and_fits_after_growing() {
    let Some(gpu) = device() else { return };
    let mut case = Case::new("builtin:cornell", "balanced", [20, 16], 1500);
    case.settings.grid.alpha = Some(0.8);
    let expected = bits(&run(gpu, &case, GatherCapacity::default()));
    let mut capacity = GatherCapacity {
        frontier: 16,
        least_frontiers: 1,
        block_chunks: 1,
        least_chunks: 1,
        ..Default::default()
    };
    for attempt in 0.. {
        assert!(attempt < 6, "grows without end: {capacity:?}");
        let found = try_run(gpu, &case, capacity);
        match found.capacity.grown(&found.stats) {
            Some(grown) => capacity = grown,
            None => {
                assert!(attempt > 0 && bits(&found) == expected);
                break;
            }
        }
    }
}

#[test]
fn lists_that_are_kept_are_those_of_a_second_search() {
    let Some(gpu) = device() else { return };
    let case = Case::small("builtin:atrium", "balanced").with_alpha();
    let blocks = case.blocks().len();
    let lists = |run: &Run| {
        let used = blocks + 1 + run.candidates[blocks] as usize * CHUNK;
        run.candidates[..used].to_vec()
    };
    // Frontiers that take all the memory.
    let full = GatherCapacity { least_frontiers: 1 << 26, ..GatherCapacity::default() };
    let expected = run(gpu, &case, full);
    let sizes = expected.candidates[..=blocks].windows(2).map(|w| (w[1] - w[0]) as usize * CHUNK);
    let (least, most) = (sizes.clone().min().expect("blocks"), sizes.max().expect("blocks"));
    // Room for an average list.
    let some = GatherCapacity {
        block_chunks: expected.stats.chunks.div_ceil(blocks as u32),
        least_chunks: 1,
        ..GatherCapacity::default()
    };
    let keeps = |run: &Run| run.capacity.search(gpu)[2];
    assert!(keeps(&expected) < least.max(1), "{} of {least}", keeps(&expected));
    for (capacity, kept) in
        [(GatherCapacity::default(), most..usize::MAX), (some, least.max(1)..most)]
    {
        let found = run(gpu, &case, capacity);
        assert!(kept.contains(&keeps(&found)), "{} of {least} to {most}", keeps(&found));
        assert!(lists(&found) == lists(&expected), "room for {}", keeps(&found));
        assert!(bits(&found) == bits(&expected), "room for {}", keeps(&found));
    }
}

#[test]
fn searches_keep_what_memory_holds() {
    let Some(gpu) = device() else { return };
    let most = gpu.max_list_bytes() as usize / 4;
    let settings = Settings::default();
    for (size, frontier) in [([16, 16], 3584), ([128, 128], 16_384), ([1280, 720], 3584)] {
        let capacity = GatherCapacity { frontier, ..GatherCapacity::default() };
        let capacity = capacity.fit(gpu, size[0], size[1], &settings);
        let [words, start, kept] = capacity.search(gpu);
        let blocks = capacity.band_blocks as usize;
        let weights = capacity.chunks() as usize * BLOCK_PIXELS;
        assert!(words <= most && words >= weights && start + kept * blocks <= words, "{size:?}");
        let average = capacity.block_chunks as usize * CHUNK;
        assert!(kept >= average || words == most, "{size:?}: {kept} of {average}");
    }
    // The frame whose memory is promised takes none for it.
    let capacity = GatherCapacity::default().fit(gpu, 1280, 720, &settings);
    assert_eq!(capacity.search(gpu)[0], capacity.chunks() as usize * BLOCK_PIXELS);
}
