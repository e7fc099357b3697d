//! Closed form (the furnace), counts, and soundness of every builtin mesh.

use std::collections::HashMap;

use glam::Vec3;

use super::{BUILTINS, builtin};
use crate::{Mesh, Shot};

fn shot(name: &str) -> Shot {
    builtin(name).expect("listed in BUILTINS")
}

fn emissive_instances(shot: &Shot) -> usize {
    let s = &shot.scene;
    let shines = |m: u32| s.materials[s.meshes[m as usize].material as usize].emission.x > 0.0;
    s.instances.iter().filter(|i| shines(i.mesh)).count()
}

/// Edges that are not shared by exactly two triangles running in opposite directions.
fn open_edges(mesh: &Mesh) -> usize {
    let weld = |i: u32| mesh.positions[i as usize].to_array().map(|x| (x * 1e5).round() as i64);
    let mut edges: HashMap<_, i32> = HashMap::new();
    for t in &mesh.triangles {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            let (a, b) = (weld(a), weld(b));
            *edges.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
        }
    }
    edges.values().filter(|&&n| n != 0).count()
}

#[test]
fn unknown_names_are_none() {
    assert!(builtin("").is_none() && builtin("builtin:cornell").is_none());
}

#[test]
fn every_mesh_is_sound() {
    for name in BUILTINS {
        let s = shot(name).scene;
        for i in &s.instances {
            assert!((i.mesh as usize) < s.meshes.len() && i.world_from_object.is_finite());
        }
        for mesh in &s.meshes {
            let at = format!("{name}/{}", mesh.name);
            let n = mesh.positions.len();
            assert!((mesh.material as usize) < s.materials.len(), "{at}");
            assert!(!mesh.triangles.is_empty(), "{at}");
            assert!(mesh.positions.iter().all(|p| p.is_finite()), "{at}");
            assert!(mesh.normals.is_empty() || mesh.normals.len() == n, "{at}");
            for normal in &mesh.normals {
                assert!((normal.length() - 1.0).abs() < 1e-3, "{at}: {normal}");
            }
            for t in &mesh.triangles {
                assert!(t.iter().all(|&i| (i as usize) < n), "{at}");
                let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
                assert!((b - a).cross(c - a).length() > 1e-9, "{at}: {a} {b} {c}");
            }
        }
    }
}

#[test]
fn shading_normals_agree_with_the_winding() {
    for name in BUILTINS {
        for mesh in &shot(name).scene.meshes {
            let mut wrong = 0;
            for t in mesh.triangles.iter().filter(|_| !mesh.normals.is_empty()) {
                let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
                let face = (b - a).cross(c - a);
                let mean: Vec3 = t.iter().map(|&i| mesh.normals[i as usize]).sum();
                wrong += usize::from(face.dot(mean) <= 0.0);
            }
            assert!(wrong * 500 <= mesh.triangles.len(), "{name}/{}: {wrong}", mesh.name);
        }
    }
}

#[test]
fn bodies_are_closed() {
    let open = ["curtain", "banner", "bush", "water", "vault", "vault_corner", "tiles"];
    for name in ["atrium", "many_lamps", "furnace"] {
        for mesh in shot(name).scene.meshes.iter().filter(|m| !open.contains(&&*m.name)) {
            assert_eq!(open_edges(mesh), 0, "{name}/{}", mesh.name);
        }
    }
}

#[test]
fn counts_and_bounds_are_as_documented() {
    let atrium = shot("atrium");
    let count = atrium.scene.triangle_count();
    assert!((100_000..600_000).contains(&count), "{count}");
    let s = &atrium.scene;
    for i in &s.instances {
        for &p in &s.meshes[i.mesh as usize].positions {
            let w = i.world_from_object.transform_point3(p).abs();
            assert!(w.cmple(Vec3::new(10.51, 10.3, 16.51)).all(), "{w}");
        }
    }
    assert!(s.images.iter().all(|i| i.texels.len() as u32 == i.width * i.height));
    assert!(s.meshes.iter().any(|m| m.uvs[0].len() == m.positions.len()));
    assert_eq!(emissive_instances(&shot("many_lamps")), 4096);
    assert_eq!(shot("cornell").scene.triangle_count(), 12 + 2 * 12);
    assert_eq!(shot("furnace").scene.triangle_count(), 20 * 64);
}

#[test]
fn builtins_are_deterministic() {
    for name in BUILTINS {
        assert_eq!(format!("{:?}", shot(name)), format!("{:?}", shot(name)), "{name}");
    }
}

#[test]
fn the_furnace_faces_inward_with_radiance_one() {
    let s = shot("furnace").scene;
    let m = &s.materials[0];
    assert_eq!(m.emission / (Vec3::ONE - m.base_color.truncate()), Vec3::ONE);
    let mesh = &s.meshes[0];
    assert!(mesh.normals.is_empty());
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
        assert!((b - a).cross(c - a).dot(a) < 0.0);
        assert!((a.length() - 1.0).abs() < 1e-6);
    }
}
