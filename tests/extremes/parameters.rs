//! Rotations, opacities, colors and lobes at the ends of their ranges.

use glam::DVec3;
use glint::{
    pipelines::{
        model::{Model, Room},
        render::{Needs, RenderOptions, Renderer},
        views::Views,
    },
    reference::random_scene,
    scene::{Camera, Scene, color::BETAS, layout},
};

use super::{
    check,
    common::Gpu,
    company, middle,
    probe::{BACKGROUND, Blob, Probe, RATES, Setup, distance, ripple, scene, with_lobes},
    stage, usual,
};

#[test]
fn quaternions_of_any_length() {
    let (camera, [near, far], mut probe) = stage(Setup::default());
    let blob = Blob { scale: [0.6, 0.1, 0.2], ..middle(&camera) };
    let unit = {
        let n = blob.quat.iter().map(|q| q * q).sum::<f32>().sqrt();
        Blob { quat: blob.quat.map(|q| q / n), ..blob }
    };
    let twin = probe.twin(&scene(&[near, unit, far]), &camera, 1e-4);
    let want = probe.shoot(&scene(&[near, unit, far]), &camera, &twin.image_grad);
    for length in [1e-36f32, 1e-30, 1e-20, 1e-10, 1e-3, 1.0, 1e3, 1e10, 1e19, 1e30, 1e37] {
        let stretched = Blob { quat: unit.quat.map(|q| q * length), ..unit };
        let before = scene(&[near, stretched, far]);
        let shot = probe.shoot(&before, &camera, &twin.image_grad);
        // The same rotation, up to a rounding of each component.
        for (a, b) in shot.image.iter().flatten().zip(want.image.iter().flatten()) {
            assert!((a - b).abs() < 1e-5, "length {length}: {a} {b}");
        }
        assert!(shot.stepped.base.quats.iter().flatten().all(|q| q.is_finite()));
        // A step rotates it at most as far as a unit quaternion: 2 · √4 · rate, for any length.
        let norm = |q: [f32; 4]| q.iter().map(|&x| f64::from(x).powi(2)).sum::<f64>().sqrt();
        let (old, new) = (unit.quat, shot.stepped.base.quats[1]);
        let cosine =
            old.iter().zip(&new).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum::<f64>() / (norm(old) * norm(new));
        let turn = 2.0 * cosine.min(1.0).acos();
        println!("quaternion of length {length:e}: turned by {turn:.1e}, now of length {:.1e}", norm(new));
        let shortest = f64::from(length).clamp(0.01, 1.0);
        assert!(
            turn <= 4.1 * f64::from(RATES.quat) / if length < 0.01 { 1.0 } else { shortest },
            "length {length}: turned by {turn}"
        );
        // And the step does rotate it.
        assert!(turn > 1e-6 || (1.0..=100.0).contains(&length) && turn > 1e-8, "length {length}: turned by {turn}");
    }
    for quat in [[0.0; 4], [1e-40, 0.0, 0.0, 0.0], [f32::NAN, 1.0, 0.0, 0.0], [f32::INFINITY, 0.0, 0.0, 0.0]] {
        let shot = probe.shoot(&scene(&[near, far, Blob { quat, ..unit }]), &camera, &twin.image_grad);
        assert_eq!(shot.tile_counts[2], 0, "{quat:?}");
        assert!(shot.image.iter().flatten().all(|x| x.is_finite()), "{quat:?}");
    }
}

/// Values beyond half width's range are drawn like at full width, or not at all.
#[test]
fn half_width_at_the_ends_of_what_it_holds() {
    let (gpu, camera) = (Gpu::new(), usual());
    let views = Views::upload(&gpu, &[camera], &[]).unwrap();
    let image = |scene: &Scene, half: bool| {
        let model = Model::upload_around(&gpu, DVec3::ZERO, scene, Room { half, ..Default::default() }).unwrap();
        let mut renderer = Renderer::new(&gpu, Needs::of(&model), &views, RenderOptions::default()).unwrap();
        renderer.render(&model, &views, 0, BACKGROUND).unwrap()
    };
    let [near, far] = company(&camera);
    let blob = Blob { scale: [0.6, 0.1, 0.2], ..middle(&camera) };
    let alone = image(&scene(&[near, far]), true);
    let full = image(&scene(&[near, far, blob]), false);
    // Unit quaternions, and shorter, longer and negated ones.
    for length in [1.0f32, -1.0, 1e-36, 1e37] {
        let got = image(&scene(&[near, far, Blob { quat: blob.quat.map(|q| q * length), ..blob }]), true);
        let off = got.color.iter().zip(&full.color).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        // Half an 8-bit step, as in tests/frames.
        assert!(off < 0.5 / 255.0, "length {length}: {off}");
        assert!(got != alone);
    }
    let with = |quat: [f32; 4], log_scale: f32| {
        let mut scene = scene(&[near, far, Blob { quat, ..blob }]);
        scene.base.log_scales[2][0] = log_scale;
        scene
    };
    for quat in [[0.0; 4], [1e-40, 0.0, 0.0, 0.0], [f32::NAN, 1.0, 0.0, 0.0], [f32::INFINITY, 0.0, 0.0, 0.0]] {
        assert_eq!(image(&with(quat, -1.0), true), alone, "{quat:?}");
    }
    let unit = [1.0, 0.0, 0.0, 0.0];
    for scale in [f32::NAN, f32::INFINITY] {
        assert_eq!(image(&with(unit, scale), true), alone, "{scale}");
    }
    // Up to the limits of half width, and beyond: a line to the horizon, and a disc.
    for scale in [28.0f32, 31.9, 33.0, 40.0, -31.0, -33.0, -80.0, f32::NEG_INFINITY] {
        let [got, want] = [true, false].map(|half| image(&with(unit, scale), half));
        let off = got.color.iter().zip(&want.color).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off < 0.5 / 255.0 && want != alone, "log scale {scale}: {off}");
    }
}

#[test]
fn logits_to_100_either_way() {
    let (camera, [near, far], mut probe) = stage(Setup::default());
    for logit in [-100.0f32, -20.0, -5.6, 5.0, 10.0, 16.0, 18.0, 20.0, 25.0, 30.0, 60.0, 88.0, 89.0, 100.0] {
        let blob = Blob { scale: [0.6, 0.3, 0.4], logit, ..middle(&camera) };
        // Only this Gaussian's gradient: next to the others' it would be negligible.
        let alone = scene(&[blob]);
        let shot = check(&mut probe, &camera, &alone, &format!("logit {logit}"), 1e-4, 1e-5, 1e-4);
        let gradient = shot.gradients.geometry[layout::OPACITY];
        if (5.0..=80.0).contains(&logit) {
            assert!(gradient != 0.0, "logit {logit} has no gradient");
        }
        // Adam ignores the size of gradients above 1e-15, so that an opacity of 1 − 2e-9 learns like any
        // other.
        let moved = (shot.stepped.base.opacities[0] - logit).abs();
        if (5.0..=25.0).contains(&logit) {
            assert!(moved > 0.9 * RATES.opacity, "logit {logit} moved by {moved}");
        }
        check(&mut probe, &camera, &scene(&[near, blob, far]), &format!("logit {logit} in company"), 1e-4, 1e-5, 1e-4);
    }
}

/// A Gaussian much wider than the image has one α: on both sides of each threshold, by the smallest visible
/// step of the logit.
#[test]
fn alpha_at_its_two_thresholds() {
    let camera = usual();
    let mut probe = Probe::new(8, &camera, Setup::default());
    let image_grad: Vec<_> = (0..camera.pixels() as usize).map(ripple).collect();
    let logit = |alpha: f64| (alpha / (1.0 - alpha)).ln() as f32;
    for (threshold, what) in [(1.0 / 255.0, "1/255"), (0.99, "0.99")] {
        let mut states = std::collections::BTreeSet::new();
        for k in -12..=12 {
            // One float32 step of the logit is 5e-7: α changes by 2e-9 at 1/255, 5e-9 at 0.99: below a step
            // of α itself.
            let blob = Blob {
                mean: camera.unproject(36.5, 28.5, 4.0),
                scale: [1e5; 3],
                logit: logit(threshold) + k as f32 * 1e-6,
                ..Default::default()
            };
            let shot = probe.shoot(&scene(&[blob]), &camera, &image_grad);
            let t = shot.image[0][3];
            // α may differ between pixels by the roundings of exp(−1e-9); the decision may not.
            for pixel in &shot.image {
                let alpha = 1.0 - f64::from(pixel[3]);
                let taken = alpha >= 1.0 / 255.0 - 1e-7;
                assert!(pixel[3] == 1.0 || taken, "{what}: α {alpha}");
                assert!(alpha <= 0.99 + 1e-7);
            }
            assert!(shot.is_finite());
            let learns = shot.gradients.geometry[layout::OPACITY] != 0.0;
            states.insert((t == 1.0, learns));
        }
        // Both sides occurred: not taken and taken; taken, and taken without a gradient of its opacity.
        let sides = if threshold < 0.5 { [(false, true), (true, false)] } else { [(false, false), (false, true)] };
        assert_eq!(states.into_iter().collect::<Vec<_>>(), sides, "{what}");
    }
}

/// Black from the only view: a loss that wants more red and less blue raises the red and leaves the blue.
#[test]
fn a_black_gaussian_learns_what_would_light_it() {
    let (camera, [near, far], mut probe) = stage(Setup::default());
    let black = Blob { scale: [0.3; 3], rgb: [-0.3, 0.0, -0.01], ..middle(&camera) };
    let before = scene(&[near, black, far]);
    for (grad, raised) in [([-1.0, -0.5, 1.0], [true, true, false]), ([0.5, 1.0, -1.0], [false, false, true])] {
        let shot = probe.shoot(&before, &camera, &vec![grad; camera.pixels() as usize]);
        let learned: [f32; 3] = std::array::from_fn(|c| shot.stepped.base.sh[1][c] - before.base.sh[1][c]);
        // Adam's first step has the length of the rate.
        assert_eq!(learned.map(|change| change > 0.9 * RATES.dc), raised, "{learned:?}");
        assert_eq!(learned.map(|change| change == 0.0), raised.map(|raised| !raised), "{learned:?}");
    }
}

#[test]
fn sh_coefficients_of_1e4() {
    let camera = usual();
    let mut probe = Probe::new(64, &camera, Setup { degree: 3, ..Default::default() });
    for factor in [1e2f32, 1e4, -1e4] {
        let mut random = random_scene(5, 40, 12, 3);
        random
            .base
            .sh
            .iter_mut()
            .chain(&mut random.supplement.as_mut().unwrap().gaussians.sh)
            .flatten()
            .for_each(|c| *c *= factor);
        // Colors are sums of 16 terms of up to 1e4: a remaining 1 has a rounding error of 1e-3, relative to
        // the largest 1e-6. A gradient of the direction through them is a difference of such terms.
        check(&mut probe, &camera, &random, &format!("SH × {factor}"), 1e-4, 1e-4, 1e-4);
    }
}

#[test]
fn betas_at_the_ends_of_their_ranges() {
    let (camera, [near, far], mut probe) = stage(Setup { degree: BETAS, ..Default::default() });
    let blob = Blob { scale: [0.5, 0.3, 0.4], logit: 2.0, ..middle(&camera) };
    let v = (blob.mean - camera.eye()).normalize();
    let (theta, phi) = (v.z.acos() as f32, v.y.atan2(v.x) as f32);
    for b in [-100.0, -1.387, -1.3, 0.0, 4.0, 6.999, 100.0f32] {
        // Half of the light, for the bluntest at 60°; both sides of the edge; behind.
        let half = (-2f64.ln() / (4.0 * f64::from(b.clamp(-1.386, 7.0)).exp())).exp().acos() as f32;
        for off in [0.0, half, 1.57, 1.5709, 3.1] {
            for color in [[1.0, 0.0, -0.5], [3.0, -100.0, 0.3]] {
                let mut before = scene(&[near, blob, far]);
                before.base = before.base.with_degree(BETAS);
                before.base.sh[6..10].copy_from_slice(&[color, [theta + off, phi, b], color, [theta, phi + off, b]]);
                // Roundings of the cosine and of its derivatives, which are nearly 0 along the axis, times
                // exponent and light.
                let steep = 4.0 * f64::from(b.clamp(-1.386, 7.0)).exp();
                let [image, gradient] = [0.5e-6, 1e-6 * f64::from(color[0])].map(|part| (part * steep).max(1e-4));
                let what = format!("b {b}, {off} off the axis, color {color:?}");
                let shot = check(&mut probe, &camera, &before, &what, 1e-4, image, gradient);
                assert!(shot.tile_counts[1] > 0, "{what}");
                let moved = [7, 9].map(|k| shot.stepped.base.sh[k][2]);
                assert!(moved.iter().all(|b| (-1.3863..=7.0).contains(b)), "{what}: {moved:?}");
            }
        }
    }
}

#[test]
fn lobes_at_the_ends_of_their_ranges() {
    let (camera, company, mut probe) = stage(Setup::default());
    let blob = Blob { scale: [0.5, 0.3, 0.4], logit: 2.0, ..middle(&camera) };
    let v = (camera.eye() - blob.mean).normalize();
    let across = v.any_orthonormal_vector();
    let at = |theta: f64, length: f64| ((v * theta.cos() + across * theta.sin()) * length).as_vec3().to_array();
    let pi = std::f64::consts::PI;
    // (direction, T, β, visible, bound of the gradients)
    let mut cases = Vec::new();
    for width in [0.01f64, 0.1, 1.0] {
        let t = f64::from(width as f32);
        for sharpness in [-20.0f32, -2.0, 0.0, 8.0, 20.0] {
            // On the axis all derivatives vanish except β's own. Off it: half of the angle that halves the
            // factor, or half of T.
            let half = (2.0 * (0.5f64.ln() / (2.0 * f64::from(sharpness).exp())).exp().acos() * t).min(0.5 * t * pi);
            let bound = if sharpness > 10.0 || (sharpness > 5.0 && width < 0.05) {
                f64::INFINITY
            } else if width < 0.05 {
                1e-2
            } else {
                1e-3
            };
            cases.push((at(0.5 * half, 1.0), width as f32, sharpness, None, bound));
            cases.push((
                at(0.0, 1.0),
                width as f32,
                sharpness,
                if sharpness > 10.0 { None } else { Some(true) },
                f64::INFINITY,
            ));
            if width > 0.05 {
                cases.push((at(0.1 * half, 1.0), width as f32, sharpness, Some(true), bound));
            }
            if width < 1.0 {
                cases.push((at(pi * t * 1.0001, 1.0), width as f32, sharpness, Some(false), 0.0));
            }
            // The cosine of ψ/2 is 1 again at 4 π.
            if width < 0.25 {
                cases.push((at(4.0 * pi * t, 1.0), width as f32, sharpness, Some(false), 0.0));
            }
            cases.push((
                at((pi * t * 0.9).min(pi * 0.9), 1.0),
                width as f32,
                sharpness,
                None,
                if sharpness < 5.0 { 1e-3 } else { f64::INFINITY },
            ));
        }
    }
    cases.push((at(pi, 1.0), 1.0, 0.0, Some(false), 0.0));
    // At θ near π with T = 1 the sine is small again, the quotient is not.
    cases.push((at(pi - 5e-5, 1.0), 1.0, -2.0, Some(true), 5e-2));
    for length in [1e-36, 1e-25, 1e-10, 1e10, 1e25, 1e37] {
        cases.push((at(0.4, length), 0.5, 0.5, Some(true), f64::INFINITY));
    }
    for direction in [[0.0; 3], [1e-40, 0.0, 0.0], [f32::NAN, 0.0, 1.0], [f32::INFINITY, 0.0, 0.0]] {
        cases.push((direction, 0.5, 0.0, Some(false), f64::INFINITY));
    }
    let plain = probe.shoot(&scene(&company), &camera, &vec![[0.0; 3]; camera.pixels() as usize]);
    for (direction, width, sharpness, seen, bound) in cases {
        let scene = with_lobes(&company, &[(blob, direction, width, sharpness)]);
        let what = format!("lobe {direction:?}, T {width}, β {sharpness}");
        let twin = probe.twin(&scene, &camera, 1e-4);
        let shot = probe.shoot(&scene, &camera, &twin.image_grad);
        assert!(seen.is_none_or(|seen| seen == (shot.tile_counts[2] > 0)), "{what}: seen {}", shot.tile_counts[2]);
        let finite = shot.image.iter().flatten().all(|x| x.is_finite());
        let supplement = shot.stepped.supplement.as_ref().unwrap();
        assert!(finite && supplement.gaussians.means[0].iter().all(|x| x.is_finite()), "{what}");
        if direction.iter().all(|d| d.is_finite()) {
            assert!(shot.is_finite(), "{what}");
            let [t, b] = [supplement.lobes.widths[0], supplement.lobes.sharpness[0]];
            assert!((0.01..=1.0).contains(&t), "{what}: {t}");
            assert!(shot.tile_counts[2] == 0 || (-2.0..=8.0).contains(&b), "{what}: {b}");
        }
        if shot.tile_counts[2] == 0 {
            assert_eq!(shot.image, plain.image, "{what}");
        } else if bound < f64::INFINITY {
            let d = distance(&shot, &twin);
            println!(
                "{what}: image {:.1e}, gradients {:?}",
                d.image,
                d.groups.iter().map(|g| format!("{} {:.1e}", g.0, g.1)).collect::<Vec<_>>()
            );
            assert!(d.worst() <= bound && d.image < 1e-3, "{what}: {d:?}");
        }
    }
}

/// A step of fixed length must not rotate a short direction arbitrarily, nor leave a long one unchanged.
#[test]
fn lobe_directions_of_any_length_turn_alike() {
    let camera = usual();
    let mut probe = Probe::new(8, &camera, Setup::default());
    let blob = Blob { scale: [0.5, 0.3, 0.4], logit: 2.0, ..middle(&camera) };
    let v = (camera.eye() - blob.mean).normalize();
    let direction = v * 0.4f64.cos() + v.any_orthonormal_vector() * 0.4f64.sin();
    let image_grad: Vec<_> = (0..camera.pixels() as usize).map(ripple).collect();
    for length in [1e-36, 1e-20, 1e-3, 0.1, 1.0, 10.0, 1e3, 1e20, 1e37] {
        let lobe = (blob, (direction * length).as_vec3().to_array(), 0.5, 0.5);
        let shot = probe.shoot(&with_lobes(&company(&camera), &[lobe]), &camera, &image_grad);
        let stepped = shot.stepped.supplement.unwrap().lobes.directions[0];
        let stepped = DVec3::from_array(stepped.map(f64::from)) / if length > 100.0 { 1.0 } else { length.max(1e-30) };
        let turn = direction.angle_between(stepped.normalize());
        println!("direction of length {length:e}: turned by {turn:.1e}");
        // Each component moves by the rate; the vector counts as a unit vector if its length is outside 0.01
        // to 100.
        let moved = f64::from(RATES.direction) / if (0.01..=100.0).contains(&length) { length } else { 1.0 };
        assert!(turn <= 1.8 * moved && turn > 0.1 * moved, "length {length}: turned by {turn}");
    }
}

/// θ is exactly 0: the quotient of two zeros needs its limit.
#[test]
fn a_lobe_seen_along_its_axis_learns() {
    let camera = Camera { rotation: glam::DMat3::IDENTITY, translation: DVec3::ZERO, ..usual() };
    let mut probe = Probe::new(8, &camera, Setup::default());
    let blob = Blob { mean: DVec3::new(0.0, 0.0, 4.0), scale: [0.5, 0.3, 0.4], ..Default::default() };
    let before = with_lobes(&[], &[(blob, [0.0, 0.0, -1.0], 0.5, 0.5)]);
    let twin = probe.twin(&before, &camera, 1e-4);
    let shot = probe.shoot(&before, &camera, &twin.image_grad);
    let d = distance(&shot, &twin);
    assert!(shot.is_finite() && d.image < 1e-5 && d.worst() < 1e-4, "{d:?}");
    assert!(shot.gradients.lobes[..3].iter().all(|&g| g == 0.0));
    let (old, new) = (before.supplement.unwrap().gaussians, shot.stepped.supplement.unwrap().gaussians);
    assert!((new.opacities[0] - old.opacities[0]).abs() > 0.9 * RATES.opacity);
}
