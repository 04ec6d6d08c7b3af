//! Training problems with curvatures that differ by many orders of magnitude.

use glam::DVec3;
use glint::{
    pipelines::{
        model::{Model, Room},
        render::{Needs, Renderer},
        session::Session,
        train::{BaseOptions, train_base},
        views::Views,
    },
    scene::{Camera, Scene, layout},
};

use super::{
    common::{Gpu, session},
    probe::{BACKGROUND, Blob, Probe, Setup, ripple, scene},
    scattered, usual,
};

/// Result of training.
struct Trained {
    start: f64,
    end: f64,
    scene: Scene,
}

/// Trains this scene for `iterations` steps.
fn train(
    gpu: &Gpu,
    (cameras, photographs): (&[Camera], &[Vec<u8>]),
    scene: &Scene,
    origin: DVec3,
    iterations: u32,
) -> Trained {
    let images: Vec<&[u8]> = photographs.iter().map(Vec::as_slice).collect();
    let views = Views::upload_around(gpu, origin, cameras, &images).unwrap();
    let model = Model::upload_around(gpu, origin, scene, Room::default()).unwrap();
    let session = Session { background: BACKGROUND, extent: 2.0, seed: 7, ..session(gpu) };
    let options = BaseOptions { iterations, sh_degree: 0, ..Default::default() };
    let report = train_base(&session, &model, &views, &options, false, |_| ()).unwrap();
    assert!(report.losses.iter().all(|l| l.is_finite()));
    let mean = |l: &[f32]| l.iter().map(|&l| f64::from(l)).sum::<f64>() / l.len() as f64;
    let v = cameras.len();
    Trained {
        start: mean(&report.losses[..v]),
        end: mean(&report.losses[report.losses.len() - v..]),
        scene: model.download().unwrap(),
    }
}

/// Four cameras around a scene of 150 blobs, their photographs, and the blobs; all translated by `offset`.
fn photographed(gpu: &Gpu, offset: DVec3) -> (Vec<Camera>, Vec<Vec<u8>>, Vec<Blob>) {
    let first = usual();
    let middle = first.unproject(36.0, 28.0, 4.0);
    let cameras: Vec<Camera> = (0..4)
        .map(|k| {
            let turn = glam::DMat3::from_rotation_y(0.15 * (f64::from(k) - 1.5));
            let rotation = first.rotation * turn;
            let eye = middle + turn.transpose() * (first.eye() - middle) + offset;
            Camera { rotation, translation: -(rotation * eye), ..first }
        })
        .collect();
    let truth: Vec<Blob> = (0..150)
        .map(|i| {
            let (x, y, z, px) = scattered(i);
            let s = 3.0 * px * (2.0 + 0.4 * z) / first.fx;
            let rgb = [(i % 7) as f32 / 7.0, (i % 5) as f32 / 5.0, (i % 3) as f32 / 3.0];
            // Multiples of 1/4, exact in float32 at 1e6: the offset itself loses nothing.
            let mean = (first.unproject(x, y, 2.0 + 0.4 * z) * 4.0).round() / 4.0 + offset;
            Blob { mean, scale: [s, 0.7 * s, 0.5 * s], logit: 2.0, rgb, ..Default::default() }
        })
        .collect();
    let origin = offset;
    let views = Views::upload_around(gpu, origin, &cameras, &[]).unwrap();
    let model = Model::upload_around(gpu, origin, &scene(&truth), Room::default()).unwrap();
    let mut renderer = Renderer::new(gpu, Needs::of(&model), &views, Default::default()).unwrap();
    let photographs = (0..4)
        .map(|v| {
            let image = renderer.render(&model, &views, v, BACKGROUND).unwrap();
            image.color.iter().map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8).collect()
        })
        .collect();
    (cameras, photographs, truth)
}

/// No parameter moves further than Newton's bound: 3 rates per step; rates are higher in shorter runs.
fn assert_bounded(before: &Scene, after: &Scene, iterations: u32, what: &str) {
    let g = (&before.base, &after.base);
    let far = |a: &[[f32; 3]], b: &[[f32; 3]]| {
        a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max)
    };
    let shorter = (30_000.0 / f64::from(iterations)).powf(0.2);
    let steps = f64::from(iterations) * 3.0 * shorter;
    assert!(far(&g.0.log_scales, &g.1.log_scales) <= steps * 5e-3, "{what}");
    assert!(far(&g.0.sh, &g.1.sh) <= steps * 2.5e-3, "{what}");
    // The position's rate starts at twice 1.6e-4 × extent; float32 has steps of 0.06 at 1e6.
    let ulp = g.0.means.iter().flatten().map(|m| m.abs()).fold(0.0, f32::max) * f32::EPSILON;
    assert!(far(&g.0.means, &g.1.means) <= steps * 2.0 * 3.2e-4 + f64::from(ulp), "{what}");
    let p = glint::reference::Params::from_scene(after).unwrap();
    assert!(p.geometry.iter().chain(&p.sh).all(|x| x.is_finite()), "{what}");
}

#[test]
fn stiff_problems_train_without_divergence() {
    let gpu = Gpu::new();
    let (cameras, photographs, truth) = photographed(&gpu, DVec3::ZERO);
    // Initial values: off by a few pixels, and grey.
    let ordinary: Vec<Blob> = truth
        .iter()
        .enumerate()
        .map(|(i, b)| Blob {
            mean: b.mean + 0.05 * DVec3::new((i % 3) as f64 - 1.0, (i % 5) as f64 - 2.0, 0.0),
            rgb: [0.5; 3],
            ..*b
        })
        .collect();
    type Spoil = fn(usize, Blob) -> Blob;
    let problems: [(&str, Spoil); 6] = [
        ("ordinary", |_, b| b),
        ("scales from 1e-5 to 1e3", |i, b| match i % 5 {
            0 => Blob { scale: [1e-5; 3], ..b },
            1 if i < 50 => Blob { scale: [1e3; 3], logit: -4.0, ..b },
            2 if i < 50 => Blob { scale: [1e3, 1e-5, 1e-5], ..b },
            _ => b,
        }),
        ("opacities from 0.0025 to 1 − 2e-9", |i, b| Blob { logit: [-6.0, 20.0, 2.0, 10.0, -3.0][i % 5], ..b }),
        ("quaternions of length 1e-20 to 1e20", |i, b| {
            let length = [1e-20, 1e-3, 1.0, 1e3, 1e20][i % 5];
            Blob { quat: b.quat.map(|q| q * length), ..b }
        }),
        ("needles of 1 : 1e5 across the image", |i, b| Blob {
            scale: if i % 4 == 0 { [10.0, 1e-4, 1e-4] } else { b.scale },
            ..b
        }),
        ("all of it", |i, b| Blob {
            scale: [[1e-5, 1e-5, 1e-5], b.scale, [1e2, 1e-3, 1e-5], b.scale][i % 4],
            logit: [-6.0, 20.0, 2.0, 10.0, -3.0][i % 5],
            quat: b.quat.map(|q| q * [1e-20, 1.0, 1e20][i % 3]),
            ..b
        }),
    ];
    for (what, spoil) in problems {
        let blobs: Vec<Blob> = ordinary.iter().enumerate().map(|(i, &b)| spoil(i, b)).collect();
        let start = scene(&blobs);
        // Squares of gradients by parameter, as estimated by a probe, stand for the Hessian's diagonal.
        // Quaternions are left out, as their gradients have an arbitrary scale.
        let mut probe = Probe::new(150, &cameras[0], Setup::default());
        let image_grad: Vec<_> = (0..cameras[0].pixels() as usize).map(ripple).collect();
        let g = probe.shoot(&start, &cameras[0], &image_grad).gradients;
        let turns = layout::QUAT..layout::QUAT + 4;
        let kept =
            g.geometry.chunks(g.stride).enumerate().filter(|(p, _)| !turns.contains(p)).flat_map(|(_, plane)| plane);
        let squares: Vec<f64> = kept.filter(|g| **g != 0.0).map(|g| g * g).collect();
        let span = squares.iter().copied().fold(0.0, f64::max) / squares.iter().copied().fold(f64::INFINITY, f64::min);
        let trained = train(&gpu, (&cameras, &photographs), &start, DVec3::ZERO, 200);
        println!("{what}: curvatures span {span:.0e}; loss {:.4} → {:.4}", trained.start, trained.end);
        assert!((span > 1e10 || what == "ordinary") && trained.end < trained.start, "{what}");
        assert_bounded(&start, &trained.scene, 200, what);
    }
}

/// At 1e6 units from the origin float32 has steps of 0.06: without recentring positions can neither learn nor
/// be drawn correctly.
#[test]
fn a_scene_far_from_its_origin_trains_as_it_does_at_home() {
    let gpu = Gpu::new();
    let offset = DVec3::new(1048576.0, -524288.0, 1048576.0);
    let trained = |offset: DVec3, recentred: bool| {
        let (cameras, photographs, truth) = photographed(&gpu, offset);
        let grey: Vec<Blob> =
            truth.iter().map(|b| Blob { mean: b.mean + DVec3::new(0.25, 0.0, 0.0), rgb: [0.5; 3], ..*b }).collect();
        let origin = if recentred { glint::pipelines::views::origin_for(&cameras) } else { DVec3::ZERO };
        let trained = train(&gpu, (&cameras, &photographs), &scene(&grey), origin, 500);
        println!("{offset}: loss {:.5} → {:.5} counted from {origin:.0}", trained.start, trained.end);
        if recentred {
            assert_bounded(&scene(&grey), &trained.scene, 500, "far");
        }
        (trained.start, trained.end)
    };
    let [home, far, naive] = [(DVec3::ZERO, true), (offset, true), (offset, false)].map(|(at, how)| trained(at, how));
    // Same start. Another origin rounds differently, and 500 steps amplify that to a tenth of the final loss,
    // itself a twentieth of the initial one.
    assert!((far.0 - home.0).abs() < 1e-5 && (far.1 - home.1).abs() < 0.2 * home.1, "{home:?}, {far:?}");
    // The purpose of recentring.
    assert!(naive.1 > 1.3 * home.1, "{home:?}, {naive:?}");
}
