use super::*;
use crate::math::{Sequence, uniform_sphere};
use glam::Vec3;

fn random_triangles(count: u32, size: f32) -> Vec<Triangle> {
    let corner = |s: &mut Sequence, scale: f32| {
        let [x, y] = s.next_2d();
        (Vec3::new(x, y, s.next_1d()) - 0.5) * scale
    };
    (0..count)
        .map(|i| {
            let mut s = Sequence::new(11, i);
            let a = corner(&mut s, 10.0);
            let corners = [a, a + corner(&mut s, size), a + corner(&mut s, size)];
            Triangle { corners, opaque: true }
        })
        .collect()
}

/// Plain double-precision intersection of one triangle.
fn reference_t(triangle: &Triangle, ray: &Ray) -> Option<f64> {
    let [a, b, c] = triangle.corners.map(|p| p.as_dvec3());
    let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let n = (b - a).cross(c - a);
    let t = (a - origin).dot(n) / direction.dot(n);
    let p = origin + direction * t;
    let inside =
        [(a, b), (b, c), (c, a)].iter().all(|(s, e)| (*e - *s).cross(p - *s).dot(n) >= 0.0);
    (inside && t > 0.0 && t < f64::from(ray.t_max)).then_some(t)
}

fn random_ray(i: u32) -> Ray {
    let mut s = Sequence::new(5, i);
    let origin = uniform_sphere(s.next_2d()) * 12.0;
    let target = uniform_sphere(s.next_2d()) * 4.0;
    Ray { origin, direction: target - origin, t_max: 2.0 }
}

#[test]
fn closest_and_occluded_agree_with_a_loop_over_all_triangles() {
    for (count, size) in [(1, 4.0), (7, 3.0), (8, 3.0), (9, 3.0), (100, 2.0), (3000, 0.8)] {
        let triangles = random_triangles(count, size);
        let bvh = Bvh::build(&triangles);
        let mut differing = 0;
        for i in 0..2000 {
            let ray = random_ray(i);
            let expected =
                triangles.iter().filter_map(|t| reference_t(t, &ray)).min_by(f64::total_cmp);
            let hit = bvh.closest(&ray, |_| true);
            assert_eq!(hit.is_some(), bvh.occluded(&ray, |_| true));
            let same = match (hit, expected) {
                (Some(h), Some(t)) => (f64::from(h.t) - t).abs() < 1e-4,
                (None, None) => true,
                _ => false,
            };
            differing += u32::from(!same);
        }
        // A ray through an edge may round either way.
        assert!(differing <= 1, "{differing} of 2000 rays differ over {count} triangles");
    }
}

#[test]
fn plain_lanes_and_registers_give_the_same_bits() {
    let triangles = random_triangles(3000, 1.5);
    let bvh = Bvh::build(&triangles);
    let mut met = 0;
    for i in 0..2000 {
        let ray = random_ray(i);
        let mut leaves =
            triangles::Hits::<_, false> { packs: &bvh.packs, accept: |_: &_| true, nearest: None };
        traverse::visit_near_lanes::<lanes::Plain>((), &bvh.nodes, &ray, &mut leaves);
        let bits = |h: RayHit| (h.triangle, [h.t, h.barycentrics[0], h.barycentrics[1]]);
        assert_eq!(leaves.nearest.map(bits), bvh.closest(&ray, |_| true).map(bits));
        met += u32::from(leaves.nearest.is_some());
    }
    assert!(met > 1000);
}

#[test]
fn plain_lanes_and_registers_ask_about_the_same_triangles_in_turn() {
    let mut triangles = random_triangles(3000, 1.5);
    triangles.iter_mut().step_by(4).for_each(|t| t.opaque = false);
    let bvh = Bvh::build(&triangles);
    let (mut asked, mut stopped) = (0, 0);
    for i in 0..2000 {
        let ray = random_ray(i);
        let bits = |h: &RayHit| (h.triangle, [h.t, h.barycentrics[0], h.barycentrics[1]]);
        let (mut plain, mut registers) = (Vec::new(), Vec::new());
        let accept = |h: &RayHit| {
            plain.push(bits(h));
            false
        };
        let mut leaves = triangles::Hits::<_, true> { packs: &bvh.packs, accept, nearest: None };
        let ends = traverse::visit_any_lanes::<lanes::Plain>((), &bvh.nodes, &ray, &mut leaves);
        let found = bvh.occluded(&ray, |h| {
            registers.push(bits(h));
            false
        });
        assert_eq!((ends, &plain), (found, &registers));
        (asked, stopped) = (asked + plain.len(), stopped + u32::from(ends));
    }
    assert!(asked > 50 && stopped > 1000, "{asked} asked, {stopped} stopped");
}

#[test]
fn every_triangle_is_in_one_pack_and_slots_are_filled_from_the_first() {
    for count in [1, 9, 5000] {
        let bvh = Bvh::build(&random_triangles(count, 0.5));
        let mut seen = vec![0; count as usize];
        let ids = bvh.packs.iter().flat_map(|p| p.id).filter(|&id| id != pack::NO_TRIANGLE);
        ids.for_each(|id| seen[(id & !pack::OPAQUE) as usize] += 1);
        assert!(seen.iter().all(|&n| n == 1));
        for node in &bvh.nodes {
            assert!(node.children.is_sorted_by_key(|&c| c == pack::EMPTY));
        }
    }
}

#[test]
fn boxes_along_a_ray_are_all_met_and_none_behind_its_end() {
    let boxes: Vec<[Vec3; 2]> = random_triangles(2000, 1.0)
        .iter()
        .map(|t| {
            let [a, b, c] = t.corners;
            [a.min(b).min(c), a.max(b).max(c)]
        })
        .collect();
    let tree = BoxTree::build(&boxes);
    for i in 0..500 {
        let ray = random_ray(i);
        let enter = |b: [Vec3; 2]| {
            let sides = b.map(|p| (p - ray.origin) / ray.direction);
            let near = sides[0].min(sides[1]).max_element().max(0.0);
            (near < sides[0].max(sides[1]).min_element().min(ray.t_max)).then_some(near)
        };
        let mut met = Vec::new();
        tree.visit_near(&ray, |index, t_max| {
            met.push(index);
            t_max
        });
        for (k, b) in boxes.iter().enumerate() {
            assert!(enter(*b).is_none() || met.contains(&(k as u32)), "box {k} of ray {i}");
        }
        let mut end = ray.t_max;
        tree.visit_near(&ray, |index, t_max| {
            assert_eq!(t_max, end);
            let t = enter(boxes[index as usize]).unwrap_or(end);
            assert!(t <= end + 1e-5, "box {index} of ray {i} lies behind the end");
            end = end.min(t);
            end
        });
        assert_eq!(tree.visit_any(&ray, |_| true), !met.is_empty());
    }
}

#[test]
fn no_ray_slips_through_a_closed_mesh() {
    // A fan of thin triangles around an axis: every ray downwards must be stopped.
    let ring = |i: u32| {
        let (sin, cos) = (i as f32 / 997.0 * std::f32::consts::TAU).sin_cos();
        Vec3::new(cos * 3.0, 0.0, sin * 3.0)
    };
    let triangles: Vec<Triangle> = (0..997)
        .map(|i| Triangle { corners: [Vec3::ZERO, ring(i), ring((i + 1) % 997)], opaque: true })
        .collect();
    let bvh = Bvh::build(&triangles);
    for i in 0..20_000 {
        let u = Sequence::new(2, i).next_2d();
        let to = Vec3::new(u[0] * 4.0 - 2.0, 0.0, u[1] * 4.0 - 2.0);
        let origin = Vec3::new(0.1, 2.0, 0.2);
        let ray = Ray { origin, direction: (to - origin) * 1.5, t_max: 1.0 };
        assert!(bvh.occluded(&ray, |_| true), "{to}");
    }
}

#[test]
fn refused_triangles_let_the_ray_through() {
    let mut triangles = random_triangles(500, 3.0);
    triangles.iter_mut().for_each(|t| t.opaque = false);
    let bvh = Bvh::build(&triangles);
    for i in 0..500 {
        let ray = random_ray(i);
        assert!(!bvh.occluded(&ray, |_| false));
        let Some(first) = bvh.closest(&ray, |_| true) else { continue };
        if let Some(second) = bvh.closest(&ray, |h| h.triangle != first.triangle) {
            assert!(second.t >= first.t && second.triangle != first.triangle);
        }
    }
}

#[test]
fn degenerate_scenes_miss_and_do_not_hang() {
    assert!(Bvh::build(&[]).closest(&random_ray(0), |_| true).is_none());
    assert!(!Bvh::build(&[]).occluded(&random_ray(0), |_| true));
    let point = Triangle { corners: [Vec3::ONE; 3], opaque: true };
    let bvh = Bvh::build(&vec![point; 1000]);
    for i in 0..100 {
        assert!(bvh.closest(&random_ray(i), |_| true).is_none());
    }
    let ray = Ray { direction: Vec3::ZERO, ..random_ray(0) };
    assert!(bvh.closest(&ray, |_| true).is_none());
}

#[test]
fn rays_that_are_not_finite_miss() {
    let triangles = random_triangles(9, 3.0);
    let bvh = Bvh::build(&triangles);
    let tree = BoxTree::build(&[[Vec3::NEG_ONE, Vec3::ONE]; 3]);
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for axis in 0..3 {
            let good = random_ray(0);
            let mut rays = [good; 2];
            rays[0].origin[axis] = bad;
            rays[1].direction[axis] = bad;
            for ray in &rays {
                assert!(bvh.closest(ray, |_| true).is_none() && !bvh.occluded(ray, |_| true));
                assert!(!tree.visit_any(ray, |_| true));
                tree.visit_near(ray, |index, _| panic!("box {index}"));
            }
        }
    }
}

#[test]
fn boxes_whose_cost_is_no_number_are_kept_apart() {
    // Too long for a float, and flat: ∞ · 0.
    let line = [Vec3::X * -3e38, Vec3::X * 3e38];
    for count in [1, 2, 9, 100] {
        let tree = BoxTree::build(&vec![line; count]);
        let mut items = tree.items.clone();
        items.sort_unstable();
        assert_eq!(items, (0..count as u32).collect::<Vec<_>>());
    }
}

#[test]
fn stacks_and_nests_are_built_in_time_and_hit() {
    // Equal triangles, and ones that contain each other: quadratic time would be hours here, and
    // the tree of least cost a chain deeper than any stack.
    let triangle = |scale: f32| Triangle {
        corners: [Vec3::ZERO, Vec3::X * scale, Vec3::Y * scale],
        opaque: true,
    };
    let equal = vec![triangle(1.0); 200_000];
    let nested: Vec<_> = (0..200_000).map(|i| triangle(1.0 + 1e-5 * i as f32)).collect();
    // Both in the corner of a large scene.
    let far = triangle(1000.0).corners.map(|c| c - Vec3::splat(1000.0));
    let in_corner = |stack: &[Triangle]| {
        let mut triangles = stack.to_vec();
        triangles.push(Triangle { corners: far, opaque: true });
        triangles
    };
    let (equal_corner, nested_corner) = (in_corner(&equal[..50_000]), in_corner(&nested));
    // A nest that grows too fast to be a stack, which the builder does meet.
    let growing: Vec<_> = (0..2000).map(|i| triangle(1.01f32.powi(i) * 0.5)).collect();
    assert!(!is_stacked(&growing));
    let stacks = [equal, nested, equal_corner, nested_corner];
    assert!(stacks.iter().all(|triangles| is_stacked(triangles)));
    for triangles in stacks.into_iter().chain([growing]) {
        let bvh = Bvh::build(&triangles);
        let (origin, direction) = (Vec3::new(0.2, 0.2, 1.0), Vec3::NEG_Z);
        let ray = Ray { origin, direction, t_max: 9.0 };
        let hit = bvh.closest(&ray, |_| true);
        assert!(hit.is_some_and(|h| (h.t - 1.0).abs() < 1e-6), "{hit:?}");
        assert!(bvh.occluded(&ray, |_| true));
        let beside = Ray { origin: Vec3::new(-0.2, 2.0, 1.0), ..ray };
        assert!(!bvh.occluded(&beside, |_| true));
    }
}

fn is_stacked(triangles: &[Triangle]) -> bool {
    let corners = triangles.iter().map(|t| t.corners.map(Into::into));
    build::is_stacked(&corners.map(|c| obvhs::aabb::Aabb::from_points(&c)).collect::<Vec<_>>())
}

#[test]
fn ordinary_scenes_are_no_stacks() {
    // A plane of equal squares, points of no order, and slivers that cross.
    let squares: Vec<_> = (0..40_000)
        .map(|i| {
            let at = Vec3::new((i % 200) as f32, (i / 200) as f32, 0.0);
            Triangle { corners: [at, at + Vec3::X, at + Vec3::Y], opaque: true }
        })
        .collect();
    for triangles in [squares, random_triangles(40_000, 0.01), random_triangles(40_000, 0.5)] {
        assert!(!is_stacked(&triangles));
    }
}
