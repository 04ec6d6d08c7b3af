//! Any scene with finite numbers can be written in every format and read again: valid, and as precise as the
//! format allows.

use proptest::{
    array::{uniform3, uniform4},
    collection::vec,
    num::f32::{NEGATIVE, NORMAL, POSITIVE, ZERO},
    prelude::*,
    test_runner::{Config, TestRunner},
};

use super::*;

/// Mostly realistic numbers, sometimes any finite number.
fn number(most: f32) -> impl Strategy<Value = f32> {
    prop_oneof![9 => -most..most, 1 => POSITIVE | NEGATIVE | NORMAL | ZERO]
}

/// Any rotation whose squared length float32 holds.
fn rotation() -> impl Strategy<Value = [f32; 4]> {
    let long_enough = |v: &[f32; 4]| v.iter().any(|x| x.abs() > 0.1);
    (uniform4(-1f32..1.0).prop_filter("a direction", long_enough), -30..30i32)
        .prop_map(|(v, e)| v.map(|x| x * 2f32.powi(e)))
}

fn scene() -> impl Strategy<Value = Gaussians> {
    (0..=40usize, 0..=3u32).prop_flat_map(|(n, sh_degree)| {
        let coefficients = ((sh_degree + 1) * (sh_degree + 1)) as usize;
        let parts = (
            vec(uniform3(number(10.0)), n),
            vec(uniform3(number(8.0)), n),
            vec(rotation(), n),
            vec(number(6.0), n),
            vec(uniform3(number(2.0)), n * coefficients),
        );
        parts.prop_map(move |(means, log_scales, quats, opacities, sh)| Gaussians {
            sh_degree,
            means,
            log_scales,
            quats,
            opacities,
            sh,
        })
    })
}

/// Properties of a scene after a round trip, Gaussian by Gaussian if the order is kept.
fn check(ending: &str, before: &Gaussians, back: &Gaussians) -> Result<(), TestCaseError> {
    prop_assert_eq!(before.len(), back.len());
    if before.is_empty() {
        return Ok(());
    }
    prop_assert_eq!(back.sh_degree, if ending == "splat" { 0 } else { before.sh_degree });
    if !["glb", "usda", "usdz", "spz", "splat"].contains(&ending) {
        return Ok(());
    }
    // SPZ: half a step in each of three components, and the resulting error of the fourth, which is the largest: at most twice as much
    // in chord, twice that in angle. Splat: half a step of 1/128 in each of four components, across the quaternion, is at most 1/128 of
    // chord; bytes whose length is not 1 lose nothing.
    let (angle, step) = match ending {
        "glb" | "usda" | "usdz" => (ROUNDING, 0.0),
        "spz" => (2.0 * 2.0 * 3f64.sqrt() * 0.5 / (511.0 * 2f64.sqrt()), 0.5 / 255.0),
        _ => (2.0 / 128.0 * 1.01, 0.5 / 255.0),
    };
    prop_assert!(largest(before, back, opacity) <= step + ROUNDING);
    prop_assert!(turned(before, back) <= angle, "turned by {}", turned(before, back));
    if ending == "splat" {
        // Colors beyond 0 to 1 are clamped.
        let color = |g: &Gaussians, i: usize| {
            let rgb = vector(g.sh[i * g.sh_coefficients()]);
            rgb.iter().map(|v| (0.5 + 0.28209479177387814 * v).clamp(0.0, 1.0)).collect()
        };
        prop_assert!(largest(before, back, color) <= step + ROUNDING);
    } else if step == 0.0 {
        prop_assert_eq!(&before.sh, &back.sh);
    }
    if ending != "spz" {
        prop_assert_eq!(&before.means, &back.means);
        // Logarithms of scales within float32's range.
        let held = |g: &Gaussians, i: usize| log_scales(g, i).iter().map(|v| v.clamp(-87.0, 88.0)).collect();
        prop_assert!(largest(before, back, held) <= 1e-5);
    }
    Ok(())
}

#[test]
fn every_scene_comes_back_from_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let config = Config { cases: 48, failure_persistence: None, ..Config::default() };
    for &format in SceneFormat::ALL.iter().filter(|format| format.ending != "ply") {
        let ending = format.ending;
        let [path, again] = ["scene", "again"].map(|stem| named(folder.path(), stem, format));
        let round = |base: Gaussians| {
            let fail = |error: glint::Error| TestCaseError::fail(format!("{ending}: {error}"));
            let file = |base: &Gaussians| SceneFile::from(Scene { base: base.clone(), ..Default::default() });
            if ending == "splat" && base.is_empty() {
                // An empty file is not a scene.
                return Ok(());
            }
            match write_scene_file(&path, &file(&base)) {
                // Only positions too far for 24 bits may be refused.
                Err(error) if ending == "spz" && error.to_string().contains("beyond what SPZ version 4 holds") => {
                    let far = base.means.iter().flatten().any(|v| v.abs() > 8_388_607.0);
                    prop_assert!(far, "{}", error);
                    return Ok(());
                }
                other => drop(other.map_err(fail)?),
            }
            let back = read_scene(&path).map_err(fail)?.base;
            check(ending, &base, &back)?;
            // The result can be written and read again.
            write_scene_file(&again, &file(&back)).map_err(fail)?;
            check(ending, &back, &read_scene(&again).map_err(fail)?.base)
        };
        TestRunner::new(config.clone()).run(&scene(), round).unwrap_or_else(|failure| panic!("{ending}: {failure}"));
    }
}
