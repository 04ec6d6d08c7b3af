//! Scenes far from the world's origin, and floaters far from all other Gaussians.

use glam::DVec3;

use super::*;

const UTM: DVec3 = DVec3::new(5e5, 4.5e6, 120.125);

/// A scene with one Gaussian at these coordinates.
fn with_floater(count: usize, at: [f32; 3]) -> Scene {
    let mut scene = sample(3, count, 1);
    scene.base.means[count / 2] = at;
    scene
}

fn converted(scene: &Scene, format: SceneFormat) -> (SceneFile, Vec<String>) {
    kept(&scene.clone().into(), format)
}

/// The largest distance of a mean (except Gaussian `but`) to the nearest one read.
fn off(scene: &Scene, back: &Scene, but: usize) -> f64 {
    let distance = |a: DVec3| back.world_means().map(|b| a.distance(b)).fold(f64::INFINITY, f64::min);
    scene.world_means().enumerate().filter(|(i, _)| *i != but).map(|(_, a)| distance(a)).fold(0.0, f64::max)
}

#[test]
fn a_floater_costs_an_spz_no_bit_of_the_others() {
    for (version, far) in [(4, 1e6), (3, 2e5), (2, 2.1e7)] {
        let scene = with_floater(200, [0.0, -far, 0.5 * far]);
        let (back, notes) = converted(&scene, spz(version));
        // Half of 2⁻¹², in each coordinate.
        assert!(off(&scene, &back.scene, 100) < 0.87 * 2f64.powi(-12));
        let [x, y, z] = back.scene.base.means[100];
        assert!(x == 0.0 && (y + 2048.0).abs() < 0.01 && (z - 1024.0).abs() < 0.01, "{y} {z}");
        assert!(notes.len() == 1 && notes[0].contains("1 of 200 Gaussians lie beyond ±2048"), "{notes:?}");
        assert!(notes[0].contains("step of 0.000244140625"), "{notes:?}");
    }
    // No note if all are within 2,048 units, and small scenes keep more bits.
    let (back, notes) = converted(&sample(3, 200, 1), spz(4));
    assert!(notes.is_empty() && off(&sample(3, 200, 1), &back.scene, 200) < 2f64.powi(-15), "{notes:?}");
    // Float16's maximum is 65,504.
    let scene = with_floater(200, [7e4, 0.0, 0.0]);
    let (back, notes) = converted(&scene, spz(1));
    assert!(back.scene.base.means[100][0] == 65504.0 && notes[0].contains("1 of 200"), "{notes:?}");
}

#[test]
fn a_coarse_grid_is_told() {
    let moved = |by: f32| {
        let mut scene = sample(4, 50, 0);
        scene.base.means.iter_mut().for_each(|mean| mean[0] += by);
        scene.base.log_scales.fill([-3.0; 3]);
        scene
    };
    for (version, by, step) in [(4, 5e5, "0.0625"), (3, 1e6, "0.125"), (1, 2000.0, "1")] {
        let (_, notes) = converted(&moved(by), spz(version));
        let wanted = format!("positions lie on a grid of step {step}, and the median size of a Gaussian is 0.050");
        assert_eq!(notes, [wanted]);
    }
}

#[test]
fn a_floater_has_a_chunk_of_its_own() {
    for count in [256, 300] {
        let scene = with_floater(count, [1e5, 0.0, 0.0]);
        let (back, notes) = converted(&scene, format("a.compressed.ply"));
        // A chunk is as wide as the scene, 24 units; a step is 1/1023 of that.
        assert!(off(&scene, &back.scene, count / 2) < 24.0 / 1023.0 * 0.87);
        assert!(back.scene.world_means().any(|mean| mean.x == 1e5));
        let fill = (count - 1usize).next_multiple_of(256) - (count - 1);
        assert_eq!(back.scene.base.len(), count + fill);
        let seen = back.scene.base.opacities.iter().filter(|&&logit| logit > -6.0).count();
        assert!(
            seen <= count && notes.len() == 1 && notes[0].starts_with(&format!("1 of {count} Gaussians lie far")),
            "{seen}, {notes:?}"
        );
        assert!(notes[0].contains(&format!("{fill} invisible Gaussians")), "{notes:?}");
    }
    // No floaters, and a chunk's grid is fine enough for Gaussians of this size.
    let mut scene = sample(3, 300, 1);
    scene.base.log_scales.as_flattened_mut().iter_mut().for_each(|v| *v += 1.0);
    let (back, notes) = converted(&scene, format("a.compressed.ply"));
    assert!(notes.is_empty() && back.scene.base.len() == 300);
    // In so small a scene none counts as a floater.
    let (_, notes) = converted(&with_floater(60, [1e5, 0.0, 0.0]), format("a.compressed.ply"));
    assert!(notes[0].contains("60 of 60 positions lie on a grid that is coarse"), "{notes:?}");
}

#[test]
fn an_origin_is_kept_or_told() {
    let scene = Scene { origin: UTM, ..sample(5, 40, 1) };
    for &format in SceneFormat::ALL {
        let ending = format.ending;
        let (back, notes) = converted(&scene, format);
        if format.keeps_origin {
            assert_eq!((back.scene.origin, notes), (UTM, vec![]), "{ending}");
        } else {
            let wanted = "positions count from (500000, 4500000, 120.125), which this format does not keep";
            assert!(notes.len() == 1 && notes[0].contains(wanted), "{ending}: {notes:?}");
            assert_eq!(back.scene.origin, DVec3::ZERO, "{ending}");
        }
        // Whatever the format's grid, it is relative to the scene's origin.
        let there = Scene { origin: UTM, ..back.scene };
        assert!(off(&scene, &there, 40) < 0.02, "{ending}: {}", off(&scene, &there, 40));
    }
}

/// For far translations of any node, not only in glint's own files.
#[test]
fn a_far_node_of_a_gltf_becomes_the_origin_and_a_near_one_moves_its_gaussians() {
    let scene = Scene { origin: DVec3::new(-3.5, 2.0, 1.0), ..sample(6, 30, 1) };
    let (back, _) = converted(&scene, format("a.glb"));
    assert_eq!(back.scene.origin, DVec3::ZERO);
    assert!(off(&scene, &back.scene, 30) < 1e-5);
}
