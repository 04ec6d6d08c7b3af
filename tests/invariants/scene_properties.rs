//! Any scene with numbers in their documented ranges survives a round trip bit for bit: through a PLY file,
//! through the twins' planes, through the device.

use glam::DVec3;
use glint::{
    data::{read_scene, write_scene},
    pipelines::model::{Model, Room},
    reference::Params,
    scene::{Gaussians, Lobes, Scene, Supplement},
};
use proptest::{
    array::{uniform3, uniform4},
    collection::vec,
    num::f32::{NEGATIVE, NORMAL, POSITIVE, SUBNORMAL, ZERO},
    prelude::*,
    test_runner::{Config, TestRunner},
};

use super::common::Gpu;

/// Every finite number, of all magnitudes.
fn finite() -> impl Strategy<Value = f32> {
    POSITIVE | NEGATIVE | NORMAL | SUBNORMAL | ZERO
}

/// Not zero, with a squared length within float32's normal numbers, 2⁻¹²⁶ to 2¹²⁸.
fn direction<const N: usize>(parts: impl Strategy<Value = [f32; N]>) -> impl Strategy<Value = [f32; N]> {
    let long_enough = |v: &[f32; N]| v.iter().any(|x| x.abs() > 0.1);
    (parts.prop_filter("a direction", long_enough), -59..62i32).prop_map(|(v, e)| v.map(|x| x * 2f32.powi(e)))
}

fn gaussians(n: usize, sh_degree: u32) -> impl Strategy<Value = Gaussians> {
    let coefficients = ((sh_degree + 1) * (sh_degree + 1)) as usize;
    (
        vec(uniform3(finite()), n),
        vec(uniform3(finite()), n),
        vec(direction(uniform4(-1f32..1.0)), n),
        vec(finite(), n),
        vec(uniform3(finite()), n * coefficients),
    )
        .prop_map(move |(means, log_scales, quats, opacities, sh)| Gaussians {
            sh_degree,
            means,
            log_scales,
            quats,
            opacities,
            sh,
        })
}

fn lobes(n: usize) -> impl Strategy<Value = Lobes> {
    (vec(direction(uniform3(-1f32..1.0)), n), vec(0.01f32..=1.0, n), vec(finite(), n))
        .prop_map(|(directions, widths, sharpness)| Lobes { directions, widths, sharpness })
}

/// Up to 50 Gaussians of any SH degrees, one degree per segment; without a supplement, with an empty one, or
/// with up to 50.
fn scene() -> impl Strategy<Value = Scene> {
    (0..=50usize, proptest::option::of(0..=50usize), 0..=3u32, 0..=3u32).prop_flat_map(|(n, m, degree, lobe_degree)| {
        let size = m.unwrap_or(0);
        let parts = (gaussians(n, degree), gaussians(size, lobe_degree), lobes(size));
        parts.prop_map(move |(base, gaussians, lobes)| Scene {
            base,
            supplement: m.map(|_| Supplement { gaussians, lobes }),
            ..Scene::default()
        })
    })
}

/// Fails unless `back` equals `scene` to the bit: `==` alone takes −0 for 0.
fn assert_same(back: &Scene, scene: &Scene) -> Result<(), TestCaseError> {
    prop_assert_eq!(back, scene);
    let bits = |scene: &Scene| {
        let none = Supplement::default();
        let Supplement { gaussians, lobes } = scene.supplement.as_ref().unwrap_or(&none);
        let mut bits: Vec<u32> = Vec::new();
        for g in [&scene.base, gaussians] {
            let triples = g.means.iter().chain(&g.log_scales).chain(&g.sh).flatten();
            bits.extend(triples.chain(g.quats.iter().flatten()).chain(&g.opacities).map(|v| v.to_bits()));
        }
        let lobes = lobes.directions.iter().flatten().chain(&lobes.widths).chain(&lobes.sharpness);
        bits.extend(lobes.map(|v| v.to_bits()));
        bits
    };
    prop_assert!(bits(back) == bits(scene), "numbers differ in their bits");
    Ok(())
}

/// Drops an empty supplement, for formats that only keep the numbers.
fn without_empty_supplement(mut scene: Scene) -> Scene {
    scene.supplement = scene.supplement.filter(|supplement| !supplement.gaussians.is_empty());
    scene
}

/// Runs a test on random scenes; a failing one is shrunk and reported.
fn for_scenes(cases: u32, test: impl Fn(Scene) -> Result<(), TestCaseError>) {
    let config = Config { cases, failure_persistence: None, ..Config::default() };
    TestRunner::new(config).run(&scene(), test).unwrap_or_else(|failure| panic!("{failure}"));
}

#[test]
fn a_ply_file_keeps_every_scene_exactly() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.ply");
    for_scenes(256, |scene| {
        write_scene(&path, &scene).map_err(|error| TestCaseError::fail(error.to_string()))?;
        let back = read_scene(&path).map_err(|error| TestCaseError::fail(error.to_string()))?;
        assert_same(&back, &scene)
    });
}

#[test]
fn planes_keep_every_scene_exactly() {
    for_scenes(256, |scene| {
        let params = Params::from_scene(&scene).map_err(|error| TestCaseError::fail(error.to_string()))?;
        // All have the same number of planes: missing ones of a segment are 0.
        let Scene { base, supplement, .. } = without_empty_supplement(scene);
        let degree = params.sh_degree;
        let supplement = supplement.map(|s| Supplement { gaussians: s.gaussians.with_degree(degree), ..s });
        prop_assert!(degree <= 3 && (supplement.is_some() || base.sh_degree == degree));
        assert_same(&params.to_scene(), &Scene { base: base.with_degree(degree), supplement, ..Default::default() })
    });
}

#[test]
fn a_device_keeps_every_scene_exactly() {
    let gpu = Gpu::new();
    // Spare room, and pages of one, a few and all Gaussians, change the planes' layout but not the result.
    for (base, supplement, page) in [(0, 0, None), (0, 1, None), (9, 37, Some(3)), (2, 0, Some(1))] {
        for_scenes(24, |scene| {
            let failed = |error: &dyn std::fmt::Display| TestCaseError::fail(error.to_string());
            let room = Room { base, supplement, page, ..Room::default() };
            let model = Model::upload_around(&gpu, DVec3::ZERO, &scene, room).map_err(|error| failed(&error))?;
            let back = model.download().map_err(|error| failed(&error))?;
            assert_same(&back, &without_empty_supplement(scene))
        });
    }
}
