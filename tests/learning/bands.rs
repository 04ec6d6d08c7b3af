//! Bands for the Gaussians that gain by them: what is found, what it gains, and scenes in which only some have bands.

use glam::{DMat3, DVec3};
use glint::{
    data::{band_bytes, gaussian_bytes, read_scene, scene_bytes, write_scene},
    gpu::Context,
    pipelines::{
        bands::Bands,
        classes::{BASE_PART, MEASURED_AT, Trial, demote, measure},
        density::{DensityOptions, Strategy},
        enhance::{EnhanceOptions, Enhancer, Event, enhance},
        learn::{Learner, Lesson, Rates, Seen},
        model::{Model, Room, Segment},
        render::{Needs, RenderOptions, Renderer, Show},
        train::{BaseOptions, dense_trainer},
        views::Views,
    },
    reference::{random_camera, random_scene},
    scene::{Camera, Gaussians, Scene, layout},
    stages::status,
};

use super::common::{Gpu, session};

const VIEWS: u32 = 30;

/// A random scene with bands of `degree` on every third Gaussian.
fn mixed(count: usize, degree: u32) -> Scene {
    let mut scene = random_scene(8, count, 40, degree);
    let k = scene.base.sh_coefficients();
    (0..count).filter(|i| i % 3 != 0).for_each(|i| scene.base.sh[i * k + 1..(i + 1) * k].fill([0.0; 3]));
    let order: Vec<usize> = (0..count).filter(|i| i % 3 != 0).chain((0..count).step_by(3)).collect();
    Scene { base: scene.base.reordered(&order), mixed: true, ..scene }
}

/// A scene in which some Gaussians have no bands is shown like one in which these have bands of 0, to the bit.
#[test]
fn gaussians_without_bands_are_those_with_bands_of_0() {
    let gpu = Gpu::new();
    let scene = mixed(300, 2);
    let views = Views::upload(&gpu, &[random_camera(90, 61)], &[]).unwrap();
    let shown = |mixed: bool, page, half, upto, degree| {
        let model = Model::upload_around(
            &gpu,
            DVec3::ZERO,
            &Scene { mixed, ..scene.clone() },
            Room { page, half, ..Room::default() },
        );
        let model = model.unwrap();
        let counts = model.counts().unwrap();
        assert_eq!(counts, if mixed { [200, 100, 40] } else { [300, 0, 40] });
        let needs = Needs::at(&model, [0, degree, 3]);
        let mut renderer =
            Renderer::new(&gpu, needs, &views, RenderOptions { depth: true, ..Default::default() }).unwrap();
        let image = renderer.render_shown(&model, &views, 0, &Show { upto, degree, background: [0.2; 3] }).unwrap();
        if !half {
            assert!(model.download().unwrap() == Scene { mixed, ..scene.clone() });
        }
        image
    };
    for upto in [Segment::Base, Segment::Supplement] {
        for degree in [3, 1, 0] {
            let whole = shown(false, None, false, upto, degree);
            assert!(whole.color.iter().any(|&v| v > 0.3));
            for page in [None, Some(64), Some(97)] {
                assert!(shown(true, page, false, upto, degree) == whole, "{upto:?} {degree} {page:?}");
            }
        }
        assert!(shown(true, None, true, upto, 3) == shown(false, None, true, upto, 3), "half width");
    }
    // Constant colors take no memory for bands: of 12 quads per Gaussian they have one.
    let model = Model::upload(&gpu, &scene, 0).unwrap();
    let [constant, banded] = [Segment::Base, Segment::Banded].map(|segment| model.part(segment).sh.planes());
    assert_eq!([constant, banded], [3, 27]);
    let image = |scene: &Scene| {
        let model = Model::upload(&gpu, scene, 0).unwrap();
        let renderer = Renderer::new(&gpu, Needs::of_scene(scene, false), &views, RenderOptions::default());
        renderer.unwrap().render(&model, &views, 0, [0.0; 3]).unwrap()
    };
    assert!(image(&scene) == image(&Scene { mixed: false, ..scene.clone() }), "needs of a scene");
    for all in [0, 300] {
        let order: Vec<usize> = if all == 0 { (200..300).collect() } else { (0..200).collect() };
        let part = Scene { base: scene.base.reordered(&order), supplement: None, ..scene.clone() };
        assert!(image(&part) == image(&Scene { mixed: false, ..part.clone() }), "one class alone");
    }
}

/// A step moves all numbers of two segments like those of one; bands that do not exist stay 0.
#[test]
fn a_step_moves_each_class_like_gaussians_of_one_class() {
    let gpu = Gpu::new();
    let scene = Scene { supplement: None, ..mixed(300, 2) };
    let camera = random_camera(70, 51);
    let photo: Vec<u8> = (0..3 * camera.pixels()).map(|n| (n * 37 % 251) as u8).collect();
    let views = Views::upload(&gpu, &[camera], &[&photo]).unwrap();
    let rates = Rates {
        mean: 1e-3,
        log_scale: 1e-2,
        quat: 1e-2,
        opacity: 1e-2,
        dc: 1e-2,
        sh: 1e-2,
        newton: 0.1,
        ..Rates::default()
    };
    let stepped = |mixed: bool, newton: bool| {
        let model = Model::upload(&gpu, &Scene { mixed, ..scene.clone() }, 0).unwrap();
        let render = RenderOptions { backward: true, ..Default::default() };
        let mut renderer = Renderer::new(&gpu, Needs::of(&model), &views, render).unwrap();
        let segments: &[Segment] = if mixed { &[Segment::Base, Segment::Banded] } else { &[Segment::Base] };
        let lesson = |&segment: &Segment| Lesson { newton, ..Lesson::new(segment) };
        let learners: Vec<_> = segments.iter().map(|s| Learner::new(&model, lesson(s), false).unwrap()).collect();
        let status = glint::gpu::Buffer::<u32>::zeroed(&gpu, "status", status::WORDS).unwrap();
        renderer.render_on_device(&model, &views, 0, &Show::all(&model, [0.0; 3])).unwrap();
        let gradient: Vec<f32> = (0..3 * camera.pixels()).map(|n| (n as f32 * 7.0).sin()).collect();
        renderer.raster.buffers.image_grad.upload(0, &gradient).unwrap();
        let grid = renderer.raster.grid(0, 1, camera.width, camera.height);
        let mut recorder = gpu.recorder("step").unwrap();
        renderer.raster.record_blend_backward(&mut recorder, &grid, &views.frames, &model.population, 0);
        let seen = Seen { model: &model, views: &views, view: 0, raster: &renderer.raster, degree: 2, status: &status };
        for learner in &learners {
            if newton {
                learner.record_probe(&mut recorder, &seen, 0);
            }
            learner.record_step(&mut recorder, &seen, &rates, 0);
        }
        recorder.submit().unwrap().wait().unwrap();
        model.download().unwrap().base
    };
    for newton in [false, true] {
        let (apart, together) = (stepped(true, newton), stepped(false, newton));
        assert!(apart.means != scene.base.means && apart.opacities != scene.base.opacities);
        assert_eq!(
            (&apart.means, &apart.log_scales, &apart.quats),
            (&together.means, &together.log_scales, &together.quats)
        );
        assert_eq!(apart.opacities, together.opacities);
        let rows = apart.sh.chunks(9).zip(together.sh.chunks(9)).zip(scene.base.sh.chunks(9)).enumerate();
        for (i, ((apart, together), before)) in rows {
            let bands = if i < 200 { &before[1..] } else { &together[1..] };
            assert!(apart[0] == together[0] && apart[1..] == *bands, "{i}");
        }
        assert!(apart.sh[200 * 9..] != scene.base.sh[200 * 9..]);
    }
}

/// Cameras around a wall of Gaussians at the origin.
fn cameras() -> Vec<Camera> {
    let camera = |v: u32| {
        let angle = f64::from(v) * 2.4;
        let eye = DVec3::new(2.2 * angle.cos(), 1.7 * angle.sin(), -3.0 - 0.3 * f64::from(v % 4));
        let forward = -eye.normalize();
        let right = DVec3::Y.cross(forward).normalize();
        let rotation = DMat3::from_cols(right, forward.cross(right), forward).transpose();
        Camera { rotation, translation: -(rotation * eye), ..Camera::new(80, 70, 90.0) }
    };
    (0..VIEWS).map(camera).collect()
}

/// A wall of `count` Gaussians; `glossy` ones have bands of `degree`.
fn wall(degree: u32, glossy: impl Fn(usize) -> bool) -> Scene {
    let mut base = Gaussians { sh_degree: degree, ..Default::default() };
    for i in 0..15 {
        for j in 0..15 {
            base.means.push([0.14 * (i as f32 - 7.0), 0.14 * (j as f32 - 7.0), 0.0]);
            base.log_scales.push([-2.6, -2.6, -4.0]);
            base.quats.push([1.0, 0.0, 0.0, 0.0]);
            base.opacities.push(2.5);
            let n = 15 * i + j;
            base.sh.push([0.1 + 0.02 * (n % 7) as f32, 0.2, 0.3 - 0.01 * (n % 5) as f32]);
            let band = |k: usize| {
                if glossy(n) { [0.0, 1.0, 2.0].map(|c| 0.25 * (k as f32 * 1.7 + n as f32 + c).sin()) } else { [0.0; 3] }
            };
            base.sh.extend((1..base.sh_coefficients()).map(band));
        }
    }
    Scene { base, ..Default::default() }
}

fn photographed(context: &Context, scene: &Scene) -> Views {
    let cameras = cameras();
    let views = Views::upload(context, &cameras, &[]).unwrap();
    let model = Model::upload(context, scene, 0).unwrap();
    let mut renderer = Renderer::new(context, Needs::of(&model), &views, RenderOptions::default()).unwrap();
    let photo = |v: u32| -> Vec<u8> {
        let color = renderer.render(&model, &views, v, [0.0; 3]).unwrap().color;
        color.into_iter().map(|value| (255.0 * value.clamp(0.0, 1.0)).round() as u8).collect()
    };
    let photos: Vec<Vec<u8>> = (0..VIEWS).map(photo).collect();
    Views::upload(context, &cameras, &photos.iter().map(|p| &p[..]).collect::<Vec<_>>()).unwrap()
}

/// Squared error, summed over pixels and channels of all views.
fn error(context: &Context, scene: &Scene, views: &Views) -> f64 {
    let model = Model::upload(context, scene, 0).unwrap();
    let mut renderer = Renderer::new(context, Needs::of(&model), views, RenderOptions::default()).unwrap();
    let of = |v: u32| {
        let color = renderer.render(&model, views, v, [0.0; 3]).unwrap().color;
        let photo = views.download_photograph(v as usize).unwrap();
        let wanted = photo.iter().flat_map(|word| [0, 8, 16].map(|shift| f64::from(word >> shift & 255) / 255.0));
        color.iter().zip(wanted).map(|(&shown, wanted)| (f64::from(shown) - wanted).powi(2)).sum::<f64>()
    };
    (0..VIEWS).map(of).sum()
}

fn found(context: &Context, scene: &Scene, views: &Views) -> Bands {
    let mut bands = Bands::new(&session(context), scene, views, 0).unwrap();
    let mut last = [0, 1];
    while let Some(now) = bands.advance(views).unwrap() {
        last = now;
    }
    assert_eq!(last[0], last[1]);
    // A view's error is a sum of 16,800 float32, in a tree: less than 32 roundings of 6e-8.
    let (squared, wanted) = (bands.squared_error(&session(context), views).unwrap(), error(context, scene, views));
    assert!((squared - wanted).abs() < 2e-6 * wanted, "{squared} and {wanted}");
    bands
}

#[test]
fn bands_are_found_where_colors_depend_on_the_view_and_gain_what_they_promise() {
    let gpu = Gpu::new();
    for degree in [1, 3] {
        let truth = wall(degree, |n| n % 5 == 0);
        let views = photographed(&gpu, &truth);
        let base = Scene { base: truth.base.clone().with_degree(0), ..truth.clone() };
        let bands = found(&gpu, &base, &views);
        let all = bands.choose(45 * band_bytes(degree), 0.0);
        let glossy = all.gains.iter().take(45).filter(|found| found.number % 5 == 0).count();
        // If the truth has degree 3, degree 2 may explain more per byte.
        let fine = if degree == 1 { all.degree == 1 } else { all.degree > 1 };
        assert!(fine && glossy >= 40, "degree {} for {degree}; {glossy} of 45", all.degree);
        let before = error(&gpu, &base, &views);
        // Before anything learns, the error falls by at least the gain: no pixel overshoots, and a fit explains the views that it
        // had at least as well as views that were left out. Measured are 3.3 to 6.5 times as much, because the gain counts the
        // weights of a pixel as 1 and neighbors here share its error.
        for most in [10_000, u64::MAX] {
            let chosen = bands.choose(most, 0.0);
            assert!(chosen.bytes() <= most && chosen.gains.is_sorted_by(|a, b| a.gain >= b.gain));
            let promoted = Scene { base: bands.promoted(&base.base, &chosen), mixed: true, ..base.clone() };
            assert_eq!(promoted.base.constants(), 225 - chosen.gains.len());
            let gained = before - error(&gpu, &promoted, &views);
            let promised = chosen.gain();
            assert!(gained > promised && gained < 8.0 * promised, "degree {degree}: {gained} for {promised}");
        }
        let price = f64::from(all.gains[9].gain) / band_bytes(degree) as f64;
        let dear = bands.choose(u64::MAX, price);
        let each = band_bytes(dear.degree) as f64;
        assert!(dear.gains.iter().all(|found| f64::from(found.gain) > price * each), "{price}");
        assert_eq!(bands.promoted(&base.base, &bands.choose(0, 0.0)), base.base);
    }
}

/// Bands that show nothing are removed. If the bytes are fewer, those that show least follow. Nothing else changes.
#[test]
fn bands_that_show_nothing_are_removed_and_then_those_that_show_least() {
    let gpu = Gpu::new();
    for degree in [1, 3] {
        let truth = wall(degree, |n| n % 5 == 0);
        let views = photographed(&gpu, &truth);
        let mut steps = Vec::new();
        let mut demoted = |scene: &Scene, bytes| demote(&session(&gpu), scene, &views, bytes, |done| steps.push(done));
        let whole = demoted(&truth, scene_bytes(&truth)).unwrap().unwrap();
        let order: Vec<usize> = (0..225).filter(|n| n % 5 != 0).chain((0..225).step_by(5)).collect();
        assert!(whole == Scene { base: truth.base.reordered(&order), mixed: true, ..truth.clone() });
        // Bands for ten Gaussians, in the part of the bytes that a base may take.
        let constant = 225 * gaussian_bytes(0, false);
        let bytes = ((constant + 10 * band_bytes(degree) + 1) as f64 / BASE_PART) as u64;
        let least = demoted(&truth, bytes).unwrap().unwrap();
        assert_eq!((least.base.constants(), scene_bytes(&least)), (215, constant + 10 * band_bytes(degree)));
        let again = demoted(&whole, bytes).unwrap().unwrap().base;
        let last: Vec<usize> = (215..225).collect();
        assert!(again.constants() == 215 && again.reordered(&last) == least.base.reordered(&last), "of a mixed scene");
        assert!(demoted(&least, bytes).unwrap().is_none(), "it leaves room");
        let (best, lost) = (error(&gpu, &truth, &views), error(&gpu, &least, &views));
        // The same number with the bands that show most removed.
        let mut order: Vec<usize> = (0..225).collect();
        order.sort_by_key(|&i| least.base.means[215..].contains(&truth.base.means[i]) || i % 5 != 0);
        let mut worst = truth.base.reordered(&order);
        worst.sh.chunks_mut(layout::coefficients(degree)).skip(10).for_each(|sh| sh[1..].fill([0.0; 3]));
        let worst = error(&gpu, &Scene { base: worst, ..truth.clone() }, &views);
        assert!(best < 0.1 * lost && lost < worst, "{best}, {lost}, {worst}");
        assert_eq!(demoted(&truth, constant).unwrap().unwrap().base.constants(), 225);
        let error = demoted(&truth, constant - 1).unwrap_err().to_string();
        assert!(error.contains("225 Gaussians take 12600 bytes without bands"), "{error}");
        assert_eq!(steps[0], [1, 31]);
        let none = Scene { base: truth.base.clone().with_degree(0), ..truth.clone() };
        assert!(demote(&session(&gpu), &none, &views, constant, |_| panic!("no bands")).unwrap().is_none());
    }
}

/// If nothing depends on the view, nearly all bytes are for constant colors. If all does, they are not.
#[test]
fn the_number_follows_from_what_depends_on_the_view() {
    let gpu = Gpu::new();
    let session = session(&gpu);
    let measured = |is_glossy: bool| {
        let truth = wall(3, |_| is_glossy);
        let views = photographed(&gpu, &truth);
        let mut start = truth;
        // Every color is off, and no band has been learned.
        for (i, sh) in start.base.sh.chunks_mut(16).enumerate() {
            sh[0] = sh[0].map(|v| v + 0.05 * (i as f32).sin());
            sh[1..].fill([0.0; 3]);
        }
        let model = Model::upload(&gpu, &start, 0).unwrap();
        let options = BaseOptions { iterations: 600, ..Default::default() };
        let density = DensityOptions { strategy: Strategy::Budget, limit: 225, first: 225, iterations: 600 };
        let mut trainer = dense_trainer(&session, &model, &views, &options, &density).unwrap();
        trainer.start(false).unwrap();
        trainer.go_on_to((MEASURED_AT * 600.0) as u32);
        while trainer.advance(&model, &views).unwrap().is_some() {}
        let trial = Trial { options: &options, density: &density, host: false, goes_on: &|| true };
        let measured = measure(&session, &model, &mut trainer, (&views, 0), 225 * 236, 1000, &trial);
        measured.unwrap().unwrap().0.limit
    };
    let [glossy, diffuse] = [true, false].map(measured);
    // 948 without bands, 225 if all have some, 617 if a sixth has.
    assert!(glossy < 400 && diffuse > 600, "{glossy} {diffuse}");
}

/// If nothing depends on the view, bands promise 0.3 % of the error. A choice without a price still takes most Gaussians.
#[test]
fn constant_colors_promise_next_to_nothing() {
    let gpu = Gpu::new();
    let truth = wall(0, |_| false);
    let views = photographed(&gpu, &truth);
    let mut base = truth.clone();
    // Not yet trained: every color is off.
    base.base.sh.iter_mut().enumerate().for_each(|(i, c)| *c = c.map(|v| v + 0.05 * (i as f32).sin()));
    let all = found(&gpu, &base, &views).choose(u64::MAX, 0.0);
    let before = error(&gpu, &base, &views);
    // Photographs are rounded, and views mix the wrong colors of neighbors in different proportions: 1 %.
    assert!(all.gain() < 0.01 * before, "{} of {before} by {} Gaussians", all.gain(), all.gains.len());
}

#[test]
fn a_scene_of_two_classes_is_kept_with_bands_for_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mixed.ply");
    for degree in 1..=3 {
        let scene = mixed(90, degree);
        write_scene(&path, &scene).unwrap();
        assert_eq!(read_scene(&path).unwrap(), scene);
        let bytes = std::fs::read(&path).unwrap();
        let header = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
        let lobed = 4 * (14 + 3 * (layout::coefficients(degree) - 1) + 5);
        let bands = 12 * (layout::coefficients(degree) - 1);
        assert_eq!(bytes.len() - header, 90 * 56 + 30 * bands + 40 * lobed);
        assert_eq!((bytes.len() - header) as u64, scene_bytes(&scene));
        // Other viewers read the first element: constant colors.
        let text = String::from_utf8_lossy(&bytes[..header]).into_owned();
        let vertex = text.lines().skip_while(|line| *line != "element vertex 90").skip(1);
        let own: Vec<&str> = vertex.take_while(|line| line.starts_with("property float ")).collect();
        assert!(own.len() == 14 && !own.iter().any(|line| line.contains("f_rest")), "{text}");
        // Of constant colors alone.
        let constant = Scene { base: scene.base.clone().with_degree(0), ..scene };
        write_scene(&path, &constant).unwrap();
        assert_eq!(read_scene(&path).unwrap(), Scene { mixed: false, ..constant });
    }
}

/// An augmentation of constant colors ends with two classes and within its bytes, without Gaussians that no image shows; resumed, it gives the
/// same bits.
#[test]
fn an_augmentation_gives_bands_and_goes_on_from_a_checkpoint() {
    let gpu = Gpu::new();
    let truth = wall(1, |n| n % 3 == 0);
    let views = photographed(&gpu, &truth);
    let mut base = Scene { base: truth.base.clone().with_degree(0), ..truth.clone() };
    let transparent = |part: f64| (part / (255.0 - part)).ln() as f32;
    base.base.opacities[7] = transparent(0.9);
    let bytes = 4000;
    let mut options = EnhanceOptions { bytes: Some(bytes), ratio: 1.0, ..EnhanceOptions::pursuit() };
    options.join.steps_per_view = 2;
    let session = session(&gpu);
    let whole = enhance(&session, &base, &views, &options, |_| ()).unwrap();
    let banded = whole.scene.base.len() - whole.scene.base.constants();
    assert!(whole.scene.mixed && banded == whole.promotion.gains.len() && banded > 0, "{banded}");
    assert!(scene_bytes(&whole.scene) - scene_bytes(&base) <= bytes);
    assert_eq!(whole.scene.base.len(), base.base.len() + whole.plain as usize - 1);
    // Even one that is just not removed would be in no image.
    let mut more = whole.scene.clone();
    more.base = more.base.reordered(&[&[0], &(0..more.base.len()).collect::<Vec<_>>()[..]].concat());
    more.base.opacities[0] = transparent(0.9995);
    assert_eq!(error(&gpu, &more, &views), error(&gpu, &whole.scene, &views));
    assert!(error(&gpu, &whole.scene, &views) < 0.5 * error(&gpu, &base, &views));
    let mut first = Enhancer::new(&session, &base, &views, &options).unwrap();
    let checkpoint = loop {
        match first.next(&views).unwrap().unwrap() {
            Event::Join { step, .. } if step >= 20 => break first.checkpoint(&views).unwrap(),
            _ => {}
        }
    };
    let mut second = Enhancer::new(&session, &base, &views, &options).unwrap();
    while let Some(event) = second.next(&views).unwrap() {
        if matches!(event, Event::Join { step: 0, .. }) {
            second.resume_join(&checkpoint).unwrap();
        }
    }
    assert!(second.finish(&views).unwrap().scene == whole.scene);
    // Without bands, and of a base that has some, nothing is given any.
    options.join.steps_per_view = 1;
    for (scene, options) in [(&base, EnhanceOptions { bands: false, ..options }), (&truth, options)] {
        let found = enhance(&session, scene, &views, &options, |_| ()).unwrap();
        assert!(found.promotion.gains.is_empty() && !found.scene.mixed);
    }
    // A scene stays mixed if no image shows those with bands.
    let mut lone = Scene { mixed: true, ..truth };
    lone.base.sh.chunks_mut(4).for_each(|sh| sh[1..].fill([0.0; 3]));
    lone.base.sh.last_mut().unwrap()[0] = 0.1;
    *lone.base.opacities.last_mut().unwrap() = transparent(0.9);
    let found = enhance(&session, &lone, &views, &options, |_| ()).unwrap();
    assert!(found.scene.mixed && found.join.is_some());
    assert_eq!(found.scene.base.len(), lone.base.len() + found.plain as usize);
}
