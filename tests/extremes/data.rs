//! NaN and infinite inputs, and gradients with squares beyond float32.

use glint::{reference::random_scene, scene::layout};

use super::{
    WIDTH, assert_one_step,
    probe::{Probe, RATES, Setup, Shot, ripple, scene},
    stage, usual,
};

/// Every parameter of a base and of a supplementary Gaussian becomes non-finite in turn: all other results
/// stay the same to the last bit.
#[test]
fn what_is_nan_stays_where_it_is() {
    let camera = usual();
    let mut probe = Probe::new(512, &camera, Setup { degree: 1, ..Default::default() });
    let clean = random_scene(9, 160, 80, 1);
    let image_grad: Vec<_> = (0..camera.pixels() as usize).map(ripple).collect();
    let reference = probe.shoot(&clean, &camera, &image_grad);
    let base = (0..160).filter(|&i| reference.tile_counts[i] > 0).max_by_key(|&i| reference.tile_counts[i]).unwrap();
    let extra = (0..80)
        .filter(|&j| reference.tile_counts[160 + j] > 0)
        .max_by_key(|&j| reference.tile_counts[160 + j])
        .unwrap();
    // A Gaussian with opacity 0 counts as missing.
    let mut without = clean.clone();
    without.base.opacities[base] = -100.0;
    without.supplement.as_mut().unwrap().gaussians.opacities[extra] = -100.0;
    let absent = probe.shoot(&without, &camera, &image_grad);
    assert_ne!(absent.image, reference.image);
    let others = |shot: &Shot| {
        let mut s = shot.clone();
        let n = s.gradients.stride;
        for i in [base, 160 + extra] {
            s.tile_counts[i] = 0;
            for array in [&mut s.gradients.geometry, &mut s.gradients.sh] {
                (0..array.len() / n).for_each(|p| array[p * n + i] = 0.0);
            }
        }
        (0..5).for_each(|p| s.gradients.lobes[p * 80 + extra] = 0.0);
        let supplement = s.stepped.supplement.as_mut().unwrap();
        for (g, i) in [(&mut s.stepped.base, base), (&mut supplement.gaussians, extra)] {
            (g.means[i], g.log_scales[i], g.quats[i], g.opacities[i]) = ([0.0; 3], [0.0; 3], [0.0; 4], 0.0);
            g.sh[4 * i..4 * i + 4].fill([0.0; 3]);
        }
        let lobes = &mut supplement.lobes;
        (lobes.directions[extra], lobes.widths[extra], lobes.sharpness[extra]) = ([0.0; 3], 0.0, 0.0);
        s.bits()
    };
    let want = others(&absent);
    let mut poisoned = 0;
    // Infinities are negative in every other field.
    for infinite in [false, true] {
        for field in 0..28 {
            let bad = match (infinite, field % 2) {
                (false, _) => f32::NAN,
                (true, 0) => f32::INFINITY,
                (true, _) => f32::NEG_INFINITY,
            };
            let mut scene = without.clone();
            let supplement = scene.supplement.as_mut().unwrap();
            let (g, i) = if field < 14 { (&mut scene.base, base) } else { (&mut supplement.gaussians, extra) };
            let clean = if field < 14 { &clean.base } else { &clean.supplement.as_ref().unwrap().gaussians };
            g.opacities[i] = clean.opacities[i];
            match field % 14 {
                f @ 0..3 => g.means[i][f] = bad,
                f @ 3..6 => g.log_scales[i][f - 3] = bad,
                f @ 6..10 => g.quats[i][f - 6] = bad,
                10 => g.opacities[i] = bad,
                11 => g.sh[4 * i][1] = bad,
                12 => g.sh[4 * i + 2][0] = bad,
                _ if field < 14 => continue,
                _ => supplement.lobes.directions[extra][1] = bad,
            }
            // A logit of +∞ is an opacity of 1, and a log scale of −∞ a size of 0: these are meaningful and
            // drawn.
            if bad == f32::INFINITY && field % 14 == 10 || bad == f32::NEG_INFINITY && (3..6).contains(&(field % 14)) {
                let shot = probe.shoot(&scene, &camera, &image_grad);
                assert!(shot.image.iter().flatten().all(|x| x.is_finite()), "{bad} in field {field}");
                continue;
            }
            let shot = probe.shoot(&scene, &camera, &image_grad);
            assert!(
                shot.tile_counts[if field < 14 { base } else { 160 + extra }] == 0,
                "{bad} in field {field} is seen"
            );
            assert!(shot.image == absent.image, "{bad} in field {field} shows in the image");
            assert!(others(&shot) == want, "{bad} in field {field} shows in gradients or steps");
            poisoned += 1;
        }
    }
    for (width, sharpness) in
        [(f32::NAN, 0.0), (0.5, f32::NAN), (0.5, f32::INFINITY), (f32::INFINITY, 0.0), (-1.0, 0.0), (0.0, 0.0)]
    {
        let mut scene = without.clone();
        let supplement = scene.supplement.as_mut().unwrap();
        supplement.gaussians.opacities[extra] = clean.supplement.as_ref().unwrap().gaussians.opacities[extra];
        (supplement.lobes.widths[extra], supplement.lobes.sharpness[extra]) = (width, sharpness);
        let shot = probe.shoot(&scene, &camera, &image_grad);
        assert!(shot.image.iter().flatten().all(|x| x.is_finite()), "T {width}, β {sharpness}");
        if shot.tile_counts[160 + extra] == 0 {
            assert!(others(&shot) == want, "T {width}, β {sharpness}");
        }
        poisoned += 1;
    }
    println!("{poisoned} poisoned scenes");
}

/// The loss is steeper than float32's squares: Adam must move by its rate, not by rate · g / ∞.
#[test]
fn a_gradient_whose_square_overflows_moves_a_parameter_by_its_rate() {
    let (camera, company, mut probe) = stage(Setup::default());
    let before = scene(&company);
    let steep: Vec<_> = (0..camera.pixels() as usize).map(|p| ripple(p).map(|g| g * 1e22)).collect();
    let shot = probe.shoot(&before, &camera, &steep);
    assert!(shot.is_finite() && shot.gradients.geometry[layout::OPACITY * 2].abs() > 1e20);
    assert_one_step(&shot, &before, "steep");
    // A non-finite gradient leaves its Gaussian unchanged.
    let mut broken = vec![[0.0; 3]; camera.pixels() as usize];
    broken[25 * WIDTH as usize + 30] = [f64::NAN, 0.0, 0.0];
    assert_eq!(probe.shoot(&before, &camera, &broken).stepped, before);
    // Also with packed records.
    let mut packed = Probe::new(8, &camera, Setup { packed: true, ..Default::default() });
    assert_eq!(packed.shoot(&before, &camera, &broken).stepped, before);
    // Also for Gaussians that only learn opacities.
    let mut frozen = Probe::new(8, &camera, Setup { opacity_only: true, ..Default::default() });
    assert_eq!(frozen.shoot(&before, &camera, &broken).stepped, before);
    let moved = frozen.shoot(&before, &camera, &steep).stepped.base;
    for (new, old) in moved.opacities.iter().zip(&before.base.opacities) {
        assert!(((new - old).abs() - RATES.opacity).abs() < 1e-4 * RATES.opacity, "{old} → {new}");
    }
    assert_eq!(moved.means, before.base.means);
}
