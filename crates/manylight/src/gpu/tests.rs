use super::scan::Scan;
use super::testing::{device, device_with};
use super::{Arrival, Feature, Features, Gpu};
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
fn memory_is_counted_until_it_is_dropped() {
    let Some(gpu) = device() else { return };
    // Other tests share the device: only the order of magnitude is certain.
    let large = gpu.buffer::<u32>("large", 20_000_000).expect("buffer");
    assert!(gpu.bytes() >= 80_000_000 && large.len() == 20_000_000);
    let too_large = gpu.buffer::<u32>("too large", 40_000_000).expect_err("beyond the limit");
    assert!(too_large.to_string().contains("too large needs 160000000 bytes"), "{too_large}");
}

#[test]
fn kernels_match_their_shaders() {
    super::KERNELS.iter().for_each(|kernel| super::testing::check_kernel(kernel));
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
    let gpu = Gpu::from_device(raw, queue, "theirs".to_owned()).expect("device");
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
    let gpu = Gpu::from_device(raw, queue, "theirs".to_owned()).expect("device");
    assert!(gpu.features().has(Feature::RayQueries));
}
