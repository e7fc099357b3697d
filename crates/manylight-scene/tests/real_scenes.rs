//! The eleven shots of the test scene collection load as their author described them.

use manylight_scene::{Light, Projection, Sky, load};
use manylight_testing::scenes;

/// (file, triangles as documented, flat triangles to be dropped)
const SCENES: [(&str, u64, u64); 6] = [
    ("animated_stage", 9_848, 0),
    ("classroom", 103_832, 2),
    ("cornell_box", 36, 0),
    ("country_kitchen", 1_021_813, 219),
    ("sponza", 262_267, 1),
    ("white_room", 414_841, 14_462),
];

#[test]
fn scenes_have_their_documented_triangles() {
    let Some(folder) = scenes() else { return };
    for (name, documented_count, flat_count) in SCENES {
        let shot = load(&folder.join(format!("{name}.glb")).display().to_string()).unwrap();
        let flat = shot.warnings.iter().filter(|w| w.message.contains("without area"));
        assert_eq!(flat.map(|w| w.count).sum::<u64>(), flat_count, "{name}");
        assert_eq!(shot.scene.triangle_count(), documented_count - flat_count, "{name}");
    }
}

#[test]
fn all_shots_load() {
    let Some(folder) = scenes() else { return };
    let mut count = 0;
    for entry in std::fs::read_dir(folder.join("shots")).unwrap() {
        let path = entry.unwrap().path();
        let shot = load(&path.display().to_string()).unwrap();
        let size = shot.camera.size_px.unwrap();
        assert!(size == [1280, 720] || size == [720, 720]);
        assert!(matches!(shot.camera.projection, Projection::Perspective { .. }));
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if name.starts_with("sponza") {
            assert!(matches!(shot.scene.lights[..], [Light::Sun { .. }]));
            assert!(matches!(shot.scene.sky, Some(Sky::Constant(_))));
        }
        count += 1;
    }
    assert_eq!(count, 11);
}
