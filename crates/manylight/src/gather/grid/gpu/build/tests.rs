use super::sort::Sort;
use super::*;
use crate::gather::grid::gpu::record::{CellRecord, GridLightRecord};
use crate::gather::grid::record::LightingGrid;
use crate::gpu::testing::{check_kernel, device, device_with};
use crate::gpu::{Feature, Gpu};
use crate::math::{Sequence, hash_u32, luminance, uniform_sphere};
use crate::vlight::Vpl;
use glam::{DVec3, Vec3};
use std::collections::HashMap;

#[test]
fn kernels_match_their_shaders() {
    kernels::KERNELS.iter().copied().flatten().for_each(|kernel| check_kernel(kernel));
}

fn light(i: u32, position: Vec3, normal: Vec3) -> Vpl {
    let mut s = Sequence::new(41, i);
    let intensity = Vec3::new(s.next_1d(), s.next_1d(), s.next_1d()) * 2.0;
    Vpl { position, normal, intensity }
}

fn in_a_box(count: u32) -> Vec<Vpl> {
    let place = |i| {
        let mut s = Sequence::new(7, i);
        let p = Vec3::new(s.next_1d(), s.next_1d() * 0.5, s.next_1d() * 2.0) * 10.0 - 3.0;
        light(i, p, uniform_sphere(s.next_2d()))
    };
    (0..count).map(place).collect()
}

/// On the walls of a box, and some in a corner of it.
fn on_walls(count: u32) -> Vec<Vpl> {
    let place = |i: u32| {
        let mut s = Sequence::new(9, i);
        let mut p = Vec3::new(s.next_1d(), s.next_1d(), s.next_1d()) * 4.0;
        let mut n = Vec3::ZERO;
        let axis = i as usize % 3;
        p[axis] = if i.is_multiple_of(2) { 0.0 } else { 4.0 };
        n[axis] = if i.is_multiple_of(2) { 1.0 } else { -1.0 };
        if i.is_multiple_of(5) {
            p *= 0.01;
        }
        light(i, p, n)
    };
    (0..count).map(place).collect()
}

/// Lights that are left out among others.
fn with_bad_ones(count: u32) -> Vec<Vpl> {
    let mut lights = on_walls(count);
    for (i, light) in lights.iter_mut().enumerate() {
        match i % 7 {
            0 => light.intensity = Vec3::ZERO,
            3 => light.position.x = f32::NAN,
            5 => light.intensity.y = f32::INFINITY,
            _ => {}
        }
    }
    lights
}

struct Built {
    info: GridInfo,
    cells: Vec<CellRecord>,
    lights: Vec<GridLightRecord>,
    octants: Vec<crate::gather::grid::gpu::record::OctantsRecord>,
    points: Vec<[f32; 4]>,
}

fn build(gpu: &Gpu, lights: &[Vpl], rules: &GridRules) -> Built {
    let mut rules = *rules;
    let mut capacity = GridCapacity { vpls: lights.len(), cells: 64, lights: 64 };
    let vpls = GpuVpls::upload(gpu, lights, 1).expect("lights");
    for _ in 0..12 {
        let grid = GpuGrid::new(gpu, &capacity).expect("grid");
        let job = GridBuild::new(gpu, capacity).expect("memory");
        let mut rec = gpu.record(None);
        job.record(&mut rec, &vpls, &rules, &grid);
        rec.submit().wait().expect("done");
        let info = gpu.read(&grid.info, 1).expect("info")[0];
        if let Some(grown) = capacity.grown(gpu, &info) {
            capacity = grown;
            continue;
        }
        if let Some(cap) = rules.next_cap(&info) {
            rules.level_cap = cap;
            continue;
        }
        return Built {
            info,
            cells: gpu.read(&grid.cells, info.cell_count as usize).expect("cells"),
            lights: gpu.read(&grid.lights, info.light_count as usize).expect("lights"),
            octants: gpu.read(&grid.octants, info.light_count as usize).expect("octants"),
            points: gpu.read(&grid.points, info.vpl_count as usize).expect("points"),
        };
    }
    panic!("the lists grow without end");
}

/// Vertex and lobe of a light.
fn key(light: &GridLightRecord) -> ([u16; 3], u8) {
    let vertex = [light.vertex_xy & 0xffff, light.vertex_xy >> 16, light.vertex_z_lobe & 0xffff];
    (vertex.map(|v| v as u16), (light.vertex_z_lobe >> 16) as u8)
}

fn assert_near(name: &str, a: f32, b: f32, scale: f32) {
    assert!((a - b).abs() <= 1e-4 * scale, "{name}: {a} and {b}, of {scale}");
}

/// The device's hierarchy is that of the processor.
fn assert_agrees(name: &str, expected: &LightingGrid, found: &Built) {
    let info = &found.info;
    assert_eq!(info.level_count as usize, expected.levels.len(), "{name}: levels");
    assert_eq!(info.vpl_count as usize, expected.lights.len(), "{name}: lights");
    for (a, b) in expected.points.iter().zip(&found.points) {
        for axis in 0..3 {
            assert_near(name, a[axis], b[axis], 1.0);
        }
        assert_near(name, a[3], b[3], a[3]);
    }
    for (l, level) in expected.levels.iter().enumerate() {
        let place = info.levels[l + 1];
        let name = format!("{name}, level {}", l + 1);
        assert_eq!(place.cell_count as usize, level.cells.len() - 1, "{name}: cells");
        let first = place.first_cell as usize;
        let below = if l == 0 { 0 } else { info.levels[l].first_cell };
        for (i, cell) in level.cells.iter().enumerate() {
            let record = &found.cells[first + i];
            let inner = if l == 0 { 0 } else { cell.inner + below };
            assert_eq!([record.light, record.inner], [cell.light, inner], "{name}: cell {i}");
            if i + 1 < level.cells.len() {
                assert_eq!(record.octant_owned & 7, cell.octant, "{name}: octant of {i}");
                let sum: f32 = cell.share.iter().sum();
                for c in 0..8 {
                    assert_near(&name, cell.share[c], record.share[c], sum);
                }
            }
        }
        let range = place.first_light as usize..(place.first_light + place.light_count) as usize;
        let lights: HashMap<_, _> = range.map(|i| (key(&found.lights[i]), i)).collect();
        assert_eq!(lights.len(), level.lights.len(), "{name}: grid lights");
        let (h, mut sum) = (level.cell_size, DVec3::ZERO);
        for (light, octants) in level.lights.iter().zip(&level.octants) {
            let i = lights.get(&(light.vertex, light.lobe)).expect("vertex");
            let record = &found.lights[*i];
            // The share of a light near the other end of its cell loses its digits.
            let scale = light.luminance + 1e-3;
            assert_near(&name, light.luminance, record.luminance, scale);
            for axis in 0..3 {
                assert_near(&name, light.position[axis], record.position[axis], h);
                assert_near(&name, light.normal[axis], record.normal[axis], 1.0);
                assert_near(&name, light.variance[axis], record.variance[axis], h * h);
                let intensity = light.intensity[axis];
                assert_near(&name, intensity, record.intensity[axis], scale);
            }
            for o in 0..8 {
                let (expected, record) = (octants.luminance[o], &found.octants[*i]);
                assert_near(&name, expected, record.luminance[o], scale);
                if expected > 0.0 {
                    assert_eq!(octants.cells[o] + place.first_cell, record.cells[o], "{name}");
                }
            }
            sum += Vec3::from(record.intensity).as_dvec3();
        }
        let all: DVec3 = expected.lights.iter().map(|l| l.intensity.as_dvec3()).sum();
        assert!((sum / all - 1.0).abs().max_element() < 1e-5, "{name}: {sum} of {all}");
    }
}

#[test]
fn the_device_builds_what_the_processor_builds() {
    let Some(gpu) = device() else { return };
    let sets = [
        ("box", in_a_box(3000)),
        ("walls", on_walls(8000)),
        ("bad ones", with_bad_ones(2000)),
        ("one", in_a_box(1)),
        ("one place", vec![light(0, Vec3::splat(3.0), Vec3::X); 3000]),
    ];
    for (name, lights) in &sets {
        for settings in [
            GridSettings::default(),
            GridSettings { lobes: 1, start_level: 1, ..GridSettings::default() },
            GridSettings { levels: Some(4), ..GridSettings::default() },
        ] {
            let rules = GridRules::new(&settings, 0.05);
            let expected = LightingGrid::build(lights, &settings, 0.05);
            let found = build(gpu, lights, &rules);
            assert_agrees(name, &expected, &found);
            let again = build(gpu, lights, &rules);
            assert!(found.lights == again.lights && found.octants == again.octants, "{name}");
            let level0 = if settings.start_level == 0 { expected.lights.len() } else { 0 };
            assert_eq!(found.info.levels[0].light_count as usize, level0);
        }
    }
}

/// More crowded vertices than workgroups for them.
#[test]
fn every_crowded_vertex_is_summed_up() {
    let Some(gpu) = device() else { return };
    let place = |i: u32| {
        let corner = Vec3::new((i % 6) as f32, (i / 6 % 6) as f32, (i / 36) as f32);
        light(i, corner * 3.0 + Vec3::splat(0.3), Vec3::X)
    };
    let (places, each) = (200, CROWDED + 1);
    let lights: Vec<_> = (0..places * each).map(|i| place(i % places)).collect();
    let settings = GridSettings { levels: Some(7), ..GridSettings::default() };
    let found = build(gpu, &lights, &GridRules::new(&settings, 0.05));
    let crowded = found.info.levels[1].light_count;
    assert!(crowded > CROWDED_GROUPS, "{crowded} vertices");
    assert_agrees("crowded", &LightingGrid::build(&lights, &settings, 0.05), &found);
}

#[test]
fn it_does_not_matter_which_levels_one_workgroup_sums_up() {
    let Some(gpu) = device() else { return };
    let lights = on_walls(4000);
    let mut rules = GridRules::new(&GridSettings::default(), 0.05);
    let expected = build(gpu, &lights, &rules);
    let fine = fine_levels(&expected.info);
    assert!(fine > 1 && fine < expected.info.level_count, "{fine} fine levels");
    for fine_levels in [0, 1, fine, expected.info.level_count, MAX_LEVELS - 1] {
        rules.fine_levels = fine_levels;
        let found = build(gpu, &lights, &rules);
        assert!(found.lights == expected.lights, "{fine_levels} fine levels");
        assert!(found.cells == expected.cells && found.octants == expected.octants);
    }
}

#[test]
fn fine_levels_end_at_the_last_that_is_large() {
    let level =
        |cell_count, light_count| LevelInfo { cell_count, light_count, ..LevelInfo::default() };
    let mut info = GridInfo { level_count: 4, ..GridInfo::default() };
    info.levels[1..6].copy_from_slice(&[
        level(900, 2000),
        level(COARSE, COARSE + 1),
        level(9, COARSE),
        level(6, 40),
        level(5000, 5000),
    ]);
    assert_eq!(fine_levels(&info), 2);
    assert_eq!(fine_levels(&GridInfo::default()), MAX_LEVELS);
    assert_eq!(fine_levels(&GridInfo { level_count: u32::MAX, ..info }), 5);
    info.levels[4].cell_count = COARSE + 1;
    assert_eq!(fine_levels(&info), 4);
}

#[test]
fn without_lights_there_are_no_levels() {
    let Some(gpu) = device() else { return };
    let dark = vec![Vpl::default(); 100];
    for lights in [&[][..], &dark] {
        let rules = GridRules::new(&GridSettings::default(), 0.1);
        let info = build(gpu, lights, &rules).info;
        assert_eq!([info.level_count, info.vpl_count, info.light_count], [0; 3]);
    }
}

#[test]
fn owners_come_first() {
    let Some(gpu) = device() else { return };
    let found = build(gpu, &on_walls(5000), &GridRules::new(&GridSettings::default(), 0.2));
    let mut owned = 0;
    for cell in &found.cells {
        assert_eq!(cell.first_owned, owned);
        owned += (cell.octant_owned >> 8).count_ones();
    }
    assert_eq!(owned, found.info.light_count);
    for (light, octants) in found.lights.iter().zip(&found.octants) {
        let total: f32 = octants.luminance.iter().sum();
        assert!((total / light.luminance - 1.0).abs() < 1e-4, "{total} {light:?}");
        assert!((luminance(light.intensity.into()) / light.luminance - 1.0).abs() < 1e-4);
    }
}

/// Words as they come out of a sort by `bits` bits of their keys.
fn sorted(gpu: &Gpu, items: &[[u32; 4]], bits: u32) -> Vec<[u32; 4]> {
    let sort = Sort::new(gpu, items.len().max(1)).expect("memory");
    gpu.write(&sort.items, items);
    let count = gpu.upload("count", &[items.len() as u32]).expect("count");
    let mut rec = gpu.record(None);
    sort.record(&mut rec, &count, bits);
    rec.submit().wait().expect("done");
    gpu.read(&sort.items, items.len()).expect("items")
}

/// Random keys, few different keys, one key, and numbers of items that do not fill a block.
fn check_sort(gpu: &Gpu) {
    for (count, mask) in [(0, 0), (1, !0), (255, !0), (1025, 0x0101), (5000, !0), (9000, 0)] {
        let key = |i: u32| [hash_u32(i) & mask, hash_u32(!i) & mask & 0xff, i, 0];
        let items: Vec<_> = (0..count).map(key).collect();
        let mut expected = items.clone();
        expected.sort_by_key(|item| (item[1], item[0]));
        assert!(sorted(gpu, &items, 40) == expected, "{count} items, keys {mask:x}");
    }
}

#[test]
fn sorting_keeps_the_order_of_equal_keys() {
    device().into_iter().for_each(check_sort);
}

#[test]
fn subgroups_sort_alike() {
    device_with(Feature::Subgroups).iter().for_each(check_sort);
}

#[test]
fn subgroups_build_the_same_bits() {
    let Some(base) = device() else { return };
    let Some(gpu) = device_with(Feature::Subgroups) else { return };
    for (lights, lobes) in [(in_a_box(3000), 6), (with_bad_ones(1000), 1), (in_a_box(1), 6)] {
        let settings = GridSettings { lobes, ..GridSettings::default() };
        let rules = GridRules::new(&settings, 0.05);
        let [a, b] = [base, &gpu].map(|gpu| build(gpu, &lights, &rules));
        assert!(bytemuck::bytes_of(&a.info) == bytemuck::bytes_of(&b.info));
        let bytes = |built: &Built| {
            let Built { cells, lights, octants, points, .. } = built;
            [
                bytemuck::cast_slice::<_, u8>(cells).to_vec(),
                bytemuck::cast_slice(lights).to_vec(),
                bytemuck::cast_slice(octants).to_vec(),
                bytemuck::cast_slice(points).to_vec(),
            ]
        };
        assert!(bytes(&a) == bytes(&b), "{} lights, {lobes} lobes", lights.len());
    }
}
