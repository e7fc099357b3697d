use super::scan::Scan;
use super::testing::{device, device_with};
use super::{Arrival, Buf, Feature, Features, Gpu, GpuOptions, Memory, Pool};
use crate::math::hash_u32;

#[test]
fn prefix_sums_of_any_length_are_running_sums() {
    device().into_iter().for_each(check_prefix_sums);
}

#[test]
fn subgroups_find_the_same_prefix_sums() {
    device_with(Feature::Subgroups).iter().for_each(check_prefix_sums);
}

fn check_prefix_sums(gpu: &Gpu) {
    for count in [1usize, 2, 255, 2048, 2049, 70_000, 4_200_000] {
        let values: Vec<u32> = (0..count as u32).map(|i| hash_u32(i) % 7).collect();
        let buffer = gpu.upload("values", &values).expect("buffer");
        let scan = Scan::new(gpu, count).expect("scan");
        let mut rec = gpu.record(None);
        scan.record(&mut rec, &buffer, count);
        rec.submit().wait().expect("done");
        let found = gpu.read(&buffer, count).expect("read");
        let mut sum = 0;
        for (i, (value, found)) in values.iter().zip(found).enumerate() {
            assert_eq!(found, sum, "value {i} of {count}");
            sum += value;
        }
    }
}

#[test]
fn work_that_is_not_done_in_time_is_a_sentence() {
    if device().is_none() {
        return;
    }
    let timeout = Some(std::time::Duration::from_millis(1));
    let options = GpuOptions { base: true, software: true, timeout, ..GpuOptions::default() };
    let gpu = Gpu::open(&options).expect("a device");
    let values = gpu.buffer::<u32>("values", 4_000_000).expect("list");
    let scan = Scan::new(&gpu, values.len()).expect("scan");
    let mut rec = gpu.record(None);
    (0..300).for_each(|_| scan.record(&mut rec, &values, values.len()));
    let problem = rec.submit().wait().expect_err("300 scans in a thousandth of a second");
    let problem = problem.to_string();
    assert!(problem.contains("not done after 0.001 s; render with --backend cpu"), "{problem}");
    assert!(gpu.wait().is_err_and(|e| e.to_string() == problem), "it is of use again");
}

#[test]
fn a_submission_has_as_many_uniforms_as_it_needs() {
    let Some(gpu) = device() else { return };
    let scan = Scan::new(gpu, 3).expect("scan");
    let [many, last] = ["many", "last"].map(|name| gpu.upload(name, &[1u32, 2, 3]).expect("list"));
    let mut rec = gpu.record(None);
    (0..9000).for_each(|_| scan.record(&mut rec, &many, 1));
    scan.record(&mut rec, &last, 3);
    rec.submit().wait().expect("done");
    assert_eq!(gpu.read(&many, 3).expect("read"), [0, 2, 3]);
    assert_eq!(gpu.read(&last, 3).expect("read"), [0, 1, 3]);
}

#[test]
fn memory_is_counted_until_it_is_dropped() {
    let Some(gpu) = device() else { return };
    // Other tests share the device: only the order of magnitude is certain.
    let large = gpu.buffer::<u32>("large", 20_000_000).expect("buffer");
    assert!(gpu.bytes() >= 80_000_000 && large.len() == 20_000_000);
    let too_large = gpu.buffer::<u32>("too large", 40_000_000).expect_err("beyond the limit");
    assert!(too_large.to_string().contains("too large needs 160000000 bytes"), "{too_large}");
}

#[test]
fn large_limits_are_those_of_the_device_and_others_those_of_every_one() {
    let Some(gpu) = device_with(Feature::LargeLimits) else { return };
    assert_eq!(gpu.limits(), &gpu.device().limits());
    let (raw, queue) = (gpu.device().clone(), gpu.queue().clone());
    let without = Gpu::from_device(raw, queue, "theirs".to_owned(), Features::NONE);
    let (without, least) = (without.expect("device"), wgpu::Limits::defaults());
    assert_eq!(without.max_list_bytes(), least.max_storage_buffer_binding_size);
    assert_eq!(without.limits().max_texture_dimension_2d, least.max_texture_dimension_2d);
    let is_larger = gpu.max_list_bytes() > without.max_list_bytes();
    let words = without.max_list_bytes() as usize / 4 + 1;
    assert_eq!(gpu.buffer::<u32>("large", words).is_ok(), is_larger);
    assert!(without.buffer::<u32>("large", words).is_err());
}

#[test]
fn what_was_bound_is_kept_until_its_memory_goes() {
    let Some(opened) = device() else { return };
    let (raw, queue) = (opened.device().clone(), opened.queue().clone());
    let gpu = Gpu::from_device(raw, queue, "theirs".to_owned(), Features::ALL).expect("device");
    const NAME: &str = "bound and dropped";
    let is_held = || {
        let report = gpu.device().generate_allocator_report()?;
        Some(report.allocations.iter().any(|allocation| allocation.name == NAME))
    };
    let groups = || gpu.account().groups.len();
    let scan = Scan::new(&gpu, 5000).expect("scan");
    let bind = |values: &Buf<u32>| {
        let mut rec = gpu.record(None);
        scan.record(&mut rec, values, 5000);
        rec.submit().wait().expect("done");
        groups()
    };
    let others = gpu.upload("bound and kept", &[1u32; 5000]).expect("buffer");
    let before = bind(&others);
    let values = gpu.upload(NAME, &[1u32; 5000]).expect("buffer");
    let bound = bind(&values);
    assert!(before > 0 && bound > before, "{before} groups, then {bound}");
    assert_eq!([bind(&others), bind(&values)], [bound; 2], "nothing was kept");
    assert_ne!(is_held(), Some(false));
    drop(values);
    assert_eq!(groups(), before);
    assert_ne!(is_held(), Some(true), "its memory is still there");
    drop((others, scan));
    assert_eq!(groups(), 0);
}

#[test]
fn kernels_match_their_shaders() {
    super::KERNELS
        .iter()
        .copied()
        .flatten()
        .for_each(|kernel| super::testing::check_kernel(kernel));
}

#[test]
fn says_which_device() {
    if let Some(gpu) = device() {
        println!("tests of the graphics device run on {}", gpu.name());
    }
}

#[test]
fn records_come_back_when_their_commands_are_done() {
    let Some(gpu) = device() else { return };
    let buffers = [gpu.upload("a", &[1u32, 2]).expect("a"), gpu.upload("b", &[3u32]).expect("b")];
    let raw = buffers.each_ref().map(|b| b.raw());
    let mut encoder = gpu.device().create_command_encoder(&Default::default());
    let later = gpu.record_into(&mut encoder, None, |rec| rec.read_later(&raw));
    assert_eq!(later.look(gpu).expect("look"), Arrival::Pending);
    gpu.queue().submit([encoder.finish()]);
    gpu.wait().expect("done");
    let bytes = [1u32, 2, 3].map(u32::to_le_bytes).concat();
    assert_eq!(later.look(gpu).expect("look"), Arrival::Here(bytes));

    let mut encoder = gpu.device().create_command_encoder(&Default::default());
    let later = gpu.record_into(&mut encoder, None, |rec| rec.read_later(&raw));
    drop(encoder);
    assert_eq!(later.look(gpu).expect("look"), Arrival::Never);
}

#[test]
fn what_goes_wrong_on_someone_elses_device_is_a_sentence() {
    let Some(opened) = device() else { return };
    let (raw, queue) = (opened.device().clone(), opened.queue().clone());
    let gpu = Gpu::from_device(raw, queue, "theirs".to_owned(), Features::ALL).expect("device");
    let invalid = gpu.guard(|| {
        // A uniform cannot be mapped.
        let _ = gpu.device().create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: 4,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        Ok(())
    });
    let problem = invalid.expect_err("invalid").to_string();
    assert!(problem.contains("theirs: ") && problem.lines().count() == 1, "{problem}");
    gpu.guard(|| Ok(())).expect("nothing is left of it");
}

#[test]
fn lists_of_different_phases_share_memory_and_those_of_one_do_not() {
    let Some(gpu) = device() else { return };
    let pool = Pool::new(gpu);
    let held = |name| gpu.lists().iter().find(|(n, _)| *n == name).map_or(0, |&(_, bytes)| bytes);
    let first = pool.phase();
    let large = first.list::<u32>("pool: large", 5000).expect("list");
    let small = first.list::<u32>("pool: small", 100).expect("list");
    assert_ne!(large.raw(), small.raw());
    let second = pool.phase();
    let middle = second.list::<[u32; 4]>("pool: middle", 1000).expect("list");
    let own = second.list::<u32>("pool: own", 101).expect("list");
    assert_eq!(middle.raw(), large.raw(), "the least that has room");
    assert_ne!(own.raw(), small.raw(), "too small by one");
    // What goes on from a phase keeps its lists.
    let third = pool.phase();
    let kept = third.list::<u32>("pool: kept", 5000).expect("list");
    let branch = third.clone();
    let other = branch.list::<u32>("pool: other", 90).expect("list");
    assert_eq!((kept.raw(), other.raw()), (large.raw(), small.raw()));
    assert_eq!(held("pool: large") + held("pool: small") + held("pool: own"), 20_000 + 400 + 404);
    assert_eq!(held("pool: middle") + held("pool: kept") + held("pool: other"), 0);
    drop((pool, first, second, third, branch, large, middle));
    assert_eq!(held("pool: large"), 20_000, "another list is in it");
    drop(kept);
    assert_eq!(held("pool: large"), 0);
}

#[test]
fn a_list_ends_where_its_memory_goes_on() {
    let Some(gpu) = device() else { return };
    let pool = Pool::new(gpu);
    let stale = pool.phase().list::<u32>("stale", 10_000).expect("list");
    gpu.write(&stale, &vec![9; 10_000]);
    let phase = pool.phase();
    let values = phase.list::<u32>("values", 3000).expect("list");
    gpu.write(&values, &vec![1; 3000]);
    let scan = Scan::new(&phase, 3000).expect("scan");
    let mut rec = gpu.record(None);
    scan.record(&mut rec, &values, 3000);
    rec.submit().wait().expect("done");
    let sums: Vec<u32> = (0..3000).collect();
    assert_eq!(values.raw(), stale.raw());
    assert_eq!(gpu.read(&values, 10_000).expect("read"), sums);
    assert_eq!(gpu.read(&stale, 10_000).expect("read")[3000..], vec![9; 7000]);

    // Neighbors in one piece of memory.
    let bytes = [Buf::<u32>::bytes(100), Buf::<[f32; 4]>::bytes(5)];
    let phase = pool.phase();
    let both = phase.together(&bytes).expect("memory");
    let first = both.list::<u32>("first", 100).expect("list");
    let second = both.list::<[f32; 4]>("second", 5).expect("list");
    assert_eq!(first.raw(), second.raw());
    gpu.write(&first, &vec![1; 100]);
    gpu.write(&second, &[[2.0; 4]; 5]);
    let scan = Scan::new(gpu, 100).expect("scan");
    let copy = gpu.buffer::<[f32; 4]>("copy", 5).expect("list");
    let mut rec = gpu.record(None);
    scan.record(&mut rec, &first, 100);
    rec.copy(&second, 1, &copy, 4);
    rec.submit().wait().expect("done");
    assert_eq!(gpu.read(&first, 100).expect("read"), sums[..100]);
    assert_eq!(gpu.read(&second, 5).expect("read"), [[2.0; 4]; 5]);
    assert_eq!(gpu.read(&copy, 5).expect("read")[..4], [[2.0; 4]; 4]);
}

/// A copy of some shader files that a test may change.
#[cfg(debug_assertions)]
struct Shaders(std::path::PathBuf);

#[cfg(debug_assertions)]
impl Shaders {
    fn new() -> Self {
        let folder = std::env::temp_dir().join(format!("manylight-shaders-{}", std::process::id()));
        let shaders = Self(folder);
        for (path, text) in super::SHADERS.files.iter().filter(|file| file.0.starts_with("gpu/")) {
            shaders.write(path, text);
        }
        shaders
    }

    fn write(&self, path: &str, text: &str) {
        let file = self.0.join(path).with_extension("wgsl");
        std::fs::create_dir_all(file.parent().expect("a folder")).expect("a folder");
        std::fs::write(file, text).expect("a shader");
    }
}

#[cfg(debug_assertions)]
impl Drop for Shaders {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

#[cfg(debug_assertions)]
#[test]
fn shaders_change_while_the_program_runs() {
    let Some(opened) = device() else { return };
    let (raw, queue) = (opened.device().clone(), opened.queue().clone());
    let gpu = Gpu::from_device(raw, queue, "theirs".to_owned(), Features::ALL).expect("device");
    let shaders = Shaders::new();
    gpu.reload_from(&shaders.0);
    let scan = Scan::new(&gpu, 3).expect("scan");
    let sums = || {
        let buffer = gpu.upload("values", &[5u32, 7, 1]).expect("buffer");
        let mut rec = gpu.record(None);
        scan.record(&mut rec, &buffer, 3);
        rec.submit().wait().expect("done");
        gpu.read(&buffer, 3).expect("read")
    };
    assert_eq!(sums(), [0, 5, 12]);

    let path = "gpu/scan_blocks";
    let find = |path| super::SHADERS.files.iter().find(|file| file.0 == path).expect("a file").1;
    let text = find(path);
    let stores = |(_, line): &(usize, &str)| line.contains("values[first + i] = ");
    let (line, stored) = text.lines().enumerate().find(stores).expect("a store");
    let changed = stored.replace(";", " + 100u;");
    shaders.write(path, &text.replace(stored, &changed));
    let more = sums();
    assert_ne!(more, [0, 5, 12], "{changed}");
    assert_eq!(gpu.shader_problem(), None);

    // What cannot be parsed, what is no program, and what imports nothing.
    let broken = stored.replace(" = ", " = = ");
    let wrong = stored.replace(";", " + 1.5f;");
    for (bad, at) in [(broken, true), (wrong, true), ("import package::no::file;".into(), false)] {
        shaders.write(path, &text.replace(stored, &bad));
        assert_eq!(sums(), more, "the old one stays: {bad}");
        let problem = gpu.shader_problem().expect("a sentence");
        let place = if at { format!("{path}.wgsl:{}: ", line + 1) } else { "no/file".to_owned() };
        assert!(problem.contains(&place) && problem.lines().count() == 1, "{problem}");
    }
    shaders.write(path, text);
    assert_eq!(sums(), [0, 5, 12]);
    assert_eq!(gpu.shader_problem(), None);
    // Where a file is gone, the one that was compiled in stands for it.
    std::fs::remove_file(shaders.0.join("gpu/scan_blocks.wgsl")).expect("removed");
    assert_eq!(sums(), [0, 5, 12]);
}

#[cfg(debug_assertions)]
#[test]
fn a_shader_that_changes_does_so_for_every_kind_of_scene() {
    use super::reload::Reload;
    use super::{SHADERS, SceneTraits};
    let folder = std::env::temp_dir().join(format!("manylight-traits-{}", std::process::id()));
    let shaders = Shaders(folder);
    let mut reload = Reload::new(&shaders.0);
    let cast = &crate::world::gpu::Cast::INFO;
    let [full, .., bare] = SceneTraits::COMBINATIONS;
    let texts = [full, bare].map(|traits| reload.begin(cast, Features::NONE, traits));
    assert!(texts.iter().all(Option::is_some) && texts[0] != texts[1]);
    assert!(reload.changed(Features::NONE).is_empty());
    let (path, text) = SHADERS.files.iter().find(|file| file.0 == "world/cast").expect("a file");
    shaders.write(path, &format!("{text}\nconst CHANGED = 1u;\n"));
    let changed = reload.changed(Features::NONE);
    let traits: Vec<_> = changed.iter().map(|(key, ..)| key.1).collect();
    assert!(traits.len() == 2 && traits.contains(&full) && traits.contains(&bare), "{traits:?}");
    for ((_, traits), _, text) in &changed {
        let constant = format!("const HAS_PLACEMENTS: bool = {};", traits.placements);
        assert!(text.contains(&constant) && text.contains("CHANGED"));
    }
}

#[test]
fn ray_queries_need_limits_that_leave_room() {
    let (offered, limits) = (wgpu::Features::all(), wgpu::Limits::defaults());
    let features = Features::ALL.offered_by(offered, &limits);
    assert!(!features.has(Feature::RayQueries) && features.has(Feature::Subgroups));
    let limits = limits.using_minimum_supported_acceleration_structure_values();
    assert!(Features::ALL.offered_by(offered, &limits).has(Feature::RayQueries));
}

#[test]
fn ray_queries_are_taken_from_someone_elses_device() {
    let Some(opened) = device_with(Feature::RayQueries) else { return };
    let (raw, queue) = (opened.device().clone(), opened.queue().clone());
    let gpu = Gpu::from_device(raw, queue, "theirs".to_owned(), Features::ALL).expect("device");
    assert!(gpu.features().has(Feature::RayQueries));
}
