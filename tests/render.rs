//! Rendering and its gradients on the device against the float64 twins.

mod common;

use common::Gpu;
use glint::{
    gpu::Buffer,
    pipelines::{
        model::Model,
        raster::WORKGROUP,
        render::{RenderOptions, Renderer},
        views::Views,
    },
    reference::{self, Background, Options, Params, random_camera, random_scene},
    stages::{
        project_backward::{self, ProjectBackward},
        step_done::STATUS_WORDS,
    },
};

const BACKGROUND: [f32; 3] = [0.1, 0.2, 0.3];

fn options(renderer: &Renderer, degree: u32, compensate: bool) -> Options {
    let tile = renderer.raster.tile;
    Options {
        active_degree: degree,
        compensate,
        tile_width: tile.width,
        tile_height: tile.height,
        median_threshold: 0.5,
    }
}

/// Float32 may decide otherwise than float64 where a pixel is this close (relatively) to a threshold. The exponent has an
/// error of some 1e-6 (|w|² ≤ 11 from coordinates of 1e2 px with 1e-7 of rounding, times slopes up to 1/0.55 per px: 2e-5 px·/px),
/// α as much again, and a transmittance is a product of up to a few hundred factors: 1e-4 holds all of them.
const NEAR_THRESHOLD: f64 = 1e-4;

#[test]
fn images_agree_with_the_twin_but_where_a_threshold_is_met() {
    let gpu = Gpu::new();
    for (seed, count, supplement, degree, width, height) in
        [(1, 3000, 600, 3, 97, 71), (2, 2000, 0, 0, 64, 64), (3, 4000, 1000, 2, 128, 96), (4, 1500, 500, 1, 33, 130)]
    {
        let scene = random_scene(seed, count, supplement, degree);
        let camera = random_camera(width, height);
        for compensate in [false, true] {
            let views = Views::upload(&gpu, &[camera], &[]).unwrap();
            let model = Model::upload(&gpu, &scene, 0).unwrap();
            let render = RenderOptions { compensate, depth: true, ..Default::default() };
            let mut renderer = Renderer::new(&gpu, model.count(), &views, render).unwrap();
            let image = renderer.render(&model, &views, 0, BACKGROUND).unwrap();

            let params = Params::from_scene(&scene).unwrap();
            let view = reference::View::from_camera(&camera).rounded();
            let twin = reference::render(
                &params,
                &view,
                &options(&renderer, degree, compensate),
                Background::Color(BACKGROUND.map(f64::from)),
            );
            let (mut sum, mut beyond, mut worst) = (0.0, 0, 0.0f64);
            for (pixel, want) in twin.blended.image.iter().enumerate() {
                let got = [
                    image.color[3 * pixel],
                    image.color[3 * pixel + 1],
                    image.color[3 * pixel + 2],
                    image.transmittance[pixel],
                ];
                let difference = (0..4).map(|c| (f64::from(got[c]) - want[c]).abs()).fold(0.0, f64::max);
                let margin = twin.blended.margins[pixel].image();
                sum += difference;
                if difference > 1e-3 {
                    beyond += 1;
                    assert!(margin < NEAR_THRESHOLD, "pixel {pixel} is off by {difference} at margin {margin}");
                }
                if margin > NEAR_THRESHOLD {
                    worst = worst.max(difference);
                }
            }
            let mean = sum / twin.blended.image.len() as f64;
            println!("scene {seed}: mean {mean:.2e}, {beyond} at thresholds beyond 1e-3, else at most {worst:.2e}");
            assert!(mean < 1e-5, "mean difference {mean}");
        }
    }
}

#[test]
fn gradients_agree_with_the_twin() {
    let gpu = Gpu::new();
    for (seed, count, supplement, degree, compensate) in
        [(11, 600, 300, 3, false), (12, 800, 0, 1, true), (13, 500, 400, 2, true)]
    {
        let scene = random_scene(seed, count, supplement, degree);
        let camera = random_camera(80, 60);
        let views = Views::upload(&gpu, &[camera], &[]).unwrap();
        let model = Model::upload(&gpu, &scene, 0).unwrap();
        let render = RenderOptions { compensate, backward: true, ..Default::default() };
        let mut renderer = Renderer::new(&gpu, model.count(), &views, render).unwrap();
        renderer.render_on_device(&model, &views, 0, BACKGROUND).unwrap();
        let grid = renderer.raster.grid(0, 1, 80, 60);

        let params = Params::from_scene(&scene).unwrap();
        let view = reference::View::from_camera(&camera).rounded();
        let options = options(&renderer, degree, compensate);
        let twin = reference::render(&params, &view, &options, Background::Color(BACKGROUND.map(f64::from)));
        // A smooth gradient that differs by channel; zero where float32 may have decided otherwise, so that the comparison is
        // of the arithmetic alone.
        let image_grad: Vec<[f64; 3]> = (0..80 * 60)
            .map(|p| {
                let calm = twin.blended.margins[p].gradient() > NEAR_THRESHOLD;
                [0.0, 1.0, 2.0].map(|c: f64| if calm { f64::from((p as f64 * 0.013 + c).sin() as f32) } else { 0.0 })
            })
            .collect();
        let flat: Vec<f32> = image_grad.iter().flatten().map(|&g| g as f32).collect();
        renderer.raster.image_grad.upload(0, &flat).unwrap();
        let want = twin.backward(&params, &view, &options, &image_grad).params;

        let status = Buffer::<u32>::zeroed(&gpu, "status", STATUS_WORDS).unwrap();
        let mut recorder = gpu.recorder("gradients").unwrap();
        renderer.raster.record_blend_backward(&mut recorder, &grid, &views.frames, 0);
        let mut parts = Vec::new();
        for (lobes, first, count) in [(false, 0, model.base_count), (true, model.base_count, model.supplement_count)] {
            if count == 0 {
                continue;
            }
            let zeros = |planes: u32| Buffer::<f32>::zeroed(&gpu, "gradients", (2 * planes * count) as usize).unwrap();
            let (geometry, sh, lobe) = (zeros(11), zeros(3 * model.coefficients()), zeros(5));
            let spec = project_backward::Spec {
                workgroup_size: WORKGROUP,
                compensate,
                lobes,
                opacity_only: false,
                sparse: false,
                gradients: true,
            };
            let push = project_backward::Push {
                first,
                count,
                stride: model.stride,
                moment_stride: count,
                lobe_stride: model.lobe_stride,
                view: 0,
                active_degree: degree,
                stored_coefficients: model.coefficients(),
                ..bytemuck::Zeroable::zeroed()
            };
            ProjectBackward::new(&gpu, &spec).unwrap().record(
                &mut recorder,
                &project_backward::Buffers {
                    views: &views.views,
                    status: &status,
                    tile_counts: &renderer.raster.tile_counts,
                    first_slot: &renderer.raster.first_slot,
                    records: &renderer.raster.records,
                    geometry: &model.geometry,
                    sh: &model.sh,
                    lobes: &model.lobes,
                    geometry_moments: &geometry,
                    sh_moments: &sh,
                    lobe_moments: &lobe,
                },
                &push,
            );
            parts.push((first as usize, count as usize, geometry, sh, lobe));
        }
        recorder.submit().unwrap().wait().unwrap();

        for (first, count, geometry, sh, lobe) in parts {
            let planes = 3 * model.coefficients() as usize;
            let groups = [
                ("mean", &geometry, 0..3, &want.geometry, want.stride, first),
                ("log scale", &geometry, 3..6, &want.geometry, want.stride, first),
                ("quaternion", &geometry, 6..10, &want.geometry, want.stride, first),
                ("opacity", &geometry, 10..11, &want.geometry, want.stride, first),
                ("DC", &sh, 0..3, &want.sh, want.stride, first),
                ("SH", &sh, 3..planes, &want.sh, want.stride, first),
                ("lobe direction", &lobe, 0..3, &want.lobes, want.lobe_stride, 0),
                ("lobe width", &lobe, 3..4, &want.lobes, want.lobe_stride, 0),
                ("lobe sharpness", &lobe, 4..5, &want.lobes, want.lobe_stride, 0),
            ];
            for (name, buffer, planes, want, stride, from) in groups {
                if planes.is_empty() || (name.starts_with("lobe") && first == 0) {
                    continue;
                }
                let got = buffer.download().unwrap();
                let pairs: Vec<(f64, f64)> = planes
                    .flat_map(|p| (0..count).map(move |i| (p, i)))
                    .map(|(p, i)| (f64::from(got[2 * p * count + i]), want[p * stride + from + i]))
                    .collect();
                let norm = |f: fn(&(f64, f64)) -> f64| pairs.iter().map(f).sum::<f64>().sqrt();
                let (difference, size) = (norm(|(g, w)| (g - w).powi(2)), norm(|(_, w)| w * w));
                let cosine = pairs.iter().map(|(g, w)| g * w).sum::<f64>() / (size * norm(|(g, _)| g * g));
                println!("{name} of {count} from {first}: relative L2 {:.1e}, cosine {cosine:.7}", difference / size);
                // Float32 sums of some hundred terms that partly cancel: 1e-5 is usual, 1e-4 the bound that is promised.
                assert!(difference <= 1e-4 * size, "{name}: relative L2 {}", difference / size);
                assert!(cosine > 0.9999, "{name}: cosine {cosine}");
            }
        }
    }
}

/// SparseAdam moves what the view blends. Where α is clamped at 0.99 in every pixel there is no gradient, but momentum goes on.
#[test]
fn a_gaussian_that_is_clamped_in_every_pixel_counts_as_blended() {
    let gpu = Gpu::new();
    let camera = random_camera(16, 16);
    let mut scene = random_scene(21, 2, 0, 0);
    // One fills the image, one is behind the camera.
    for (i, z) in [3.0, -3.0].into_iter().enumerate() {
        scene.base.means[i] = camera.unproject(8.0, 8.0, z).as_vec3().to_array();
        scene.base.log_scales[i] = [3.0; 3];
        scene.base.opacities[i] = 12.0;
    }
    let views = Views::upload(&gpu, &[camera], &[]).unwrap();
    let model = Model::upload(&gpu, &scene, 0).unwrap();
    let render = RenderOptions { backward: true, ..Default::default() };
    let mut renderer = Renderer::new(&gpu, 2, &views, render).unwrap();
    renderer.render_on_device(&model, &views, 0, BACKGROUND).unwrap();
    renderer.raster.image_grad.upload(0, &[1.0; 3 * 16 * 16]).unwrap();
    let spec = project_backward::Spec {
        workgroup_size: WORKGROUP,
        compensate: false,
        lobes: false,
        opacity_only: true,
        sparse: true,
        gradients: false,
    };
    let (m, v) = (0.5f32, 0.25f32);
    let moments = Buffer::from_slice(&gpu, "moments", &[m, m, v, v]).unwrap();
    let none = Buffer::<f32>::zeroed(&gpu, "none", 1).unwrap();
    let status = Buffer::<u32>::zeroed(&gpu, "status", STATUS_WORDS).unwrap();
    let raster = &renderer.raster;
    let mut recorder = gpu.recorder("step").unwrap();
    raster.record_blend_backward(&mut recorder, &raster.grid(0, 1, 16, 16), &views.frames, 2);
    ProjectBackward::new(&gpu, &spec).unwrap().record(
        &mut recorder,
        &project_backward::Buffers {
            views: &views.views,
            status: &status,
            tile_counts: &raster.tile_counts,
            first_slot: &raster.first_slot,
            records: &raster.records,
            geometry: &model.geometry,
            sh: &model.sh,
            lobes: &model.lobes,
            geometry_moments: &moments,
            sh_moments: &none,
            lobe_moments: &none,
        },
        &project_backward::Push {
            count: 2,
            stride: model.stride,
            moment_stride: 2,
            rate_opacity: 0.02,
            first_correction: 1.0,
            second_correction: 1.0,
            ..bytemuck::Zeroable::zeroed()
        },
    );
    recorder.submit().unwrap().wait().unwrap();
    let (got, opacities) = (moments.download().unwrap(), model.download().unwrap().base.opacities);
    assert!((got[0] - 0.9 * m).abs() < 1e-6 && (got[2] - 0.999 * v).abs() < 1e-6, "{got:?}");
    assert!((opacities[0] - (12.0 - 0.02 * 0.45 / 0.24975f32.sqrt())).abs() < 1e-5, "{opacities:?}");
    assert_eq!((got[1], got[3], opacities[1]), (m, v, 12.0));
}

/// Slots that were counted and are not needed drop out of the sort by tile: the image is the same to the last bit.
#[test]
fn tiles_counted_in_vain_change_no_pixel() {
    let gpu = Gpu::new();
    let (scene, camera) = (random_scene(8, 1500, 300, 1), random_camera(97, 71));
    let views = Views::upload(&gpu, &[camera], &[]).unwrap();
    let model = Model::upload(&gpu, &scene, 0).unwrap();
    let mut renderer = Renderer::new(&gpu, model.count(), &views, RenderOptions::default()).unwrap();
    renderer.render(&model, &views, 0, BACKGROUND).unwrap();
    let raster = &renderer.raster;
    let pixels = camera.pixels() as usize;
    let want = raster.image.download_range(0, pixels).unwrap();
    let mut counts = raster.tile_counts.download().unwrap();
    counts.iter_mut().enumerate().filter(|(_, n)| **n > 0).for_each(|(i, n)| *n += [1, 0, 30][i % 3]);
    raster.tile_counts.upload(0, &counts).unwrap();
    assert!(counts.iter().sum::<u32>() < raster.capacity());
    let grid = raster.grid(0, 1, camera.width, camera.height);
    let status = Buffer::<u32>::zeroed(&gpu, "status", STATUS_WORDS).unwrap();
    // Twice, so that what an earlier order left in the lists is there to be taken for tiles.
    for _ in 0..2 {
        let mut recorder = gpu.recorder("order again").unwrap();
        raster.record_order(&mut recorder, model.count(), &grid, &views.frames, &raster.tile_counts, &status);
        raster.record_blend(&mut recorder, &grid, &views.frames, BACKGROUND, 0.5);
        recorder.submit().unwrap().wait().unwrap();
        assert_eq!(status.download().unwrap(), [0; STATUS_WORDS]);
        assert!(raster.image.download_range(0, pixels).unwrap() == want);
    }
}
