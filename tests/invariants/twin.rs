//! Twins that replace stages at run time: all of a render and of a training step at once, and the
//! handling of a twin that is wrong or fails.

use glint::{
    gpu::{Buffer, Context, ContextOptions, GpuError, Twin},
    pipelines::{
        model::Model,
        render::{Needs, RenderOptions, Renderer},
        views::Views,
    },
    reference::{random_camera, random_scene, twin, twins},
    stages::{blend, status},
    verify::{check, judged},
};

use super::common::Gpu;

const BACKGROUND: [f32; 3] = [0.2, 0.5, 0.7];

fn with(twins: &[Twin]) -> Gpu {
    Gpu::with(ContextOptions { twins: twins.to_vec(), ..ContextOptions::from_env() })
}

/// Renders and trains with every kernel replaced by its twin. In the render, both sides of a row are then the same function of the
/// same buffers; they differ only if the recorder loses a result between the host and the device.
#[test]
fn a_device_of_twins_is_its_twins() {
    let gpu = with(&twins());
    assert!(check(&gpu).unwrap().is_empty());
    let rows = judged(&gpu, |context| image(context).map(drop)).unwrap();
    assert!(["project", "radix_downsweep", "blend"].iter().all(|stage| rows.iter().any(|row| row.stage == *stage)));
    for row in rows {
        let errors = &row.errors;
        let off = (errors.flips.unwrap_or(0.0), errors.max.unwrap_or(0.0), errors.unequal.unwrap_or(0));
        assert_eq!(off, (0.0, 0.0, 0), "{row:?}");
    }
}

fn image(gpu: &Context) -> Result<Vec<f32>, glint::Error> {
    let views = Views::upload(gpu, &[random_camera(40, 30)], &[]).unwrap();
    let model = Model::upload(gpu, &random_scene(5, 200, 0, 1), 0).unwrap();
    let mut renderer = Renderer::new(gpu, Needs::of(&model), &views, RenderOptions::default()).unwrap();
    renderer.render(&model, &views, 0, BACKGROUND).map(|rendered| rendered.color)
}

#[test]
fn a_wrong_twin_is_seen() {
    let wrong = Twin {
        stage: "blend",
        run: |call| {
            (twin("blend").unwrap().run)(call)?;
            let host = blend::Host::new(call);
            assert_eq!((host.push.background, host.spec.median), (BACKGROUND, false));
            host.image.iter_mut().for_each(|pixel| pixel[1] += 1.0);
            Ok(())
        },
    };
    let [right, wrong] = [twin("blend").unwrap(), wrong].map(|twin| image(&with(&[twin])).unwrap());
    for (k, (right, wrong)) in right.iter().zip(&wrong).enumerate() {
        assert_eq!(*wrong, if k % 3 == 1 { right + 1.0 } else { *right });
    }
}

#[test]
fn what_a_twin_cannot_do_is_an_error_of_the_submission() {
    let refuses = Twin { stage: "blend", run: |_| Err("no tiles today".into()) };
    let told = image(&with(&[refuses])).unwrap_err().to_string();
    assert!(told.contains("the twin of blend: no tiles today"), "{told}");
    let panics = Twin { stage: "emit", run: |call| Err(format!("{}", call.bindings[99].bytes().len())) };
    let told = image(&with(&[panics])).unwrap_err().to_string();
    assert!(told.contains("the twin of emit: index out of bounds"), "{told}");

    let gpu = with(&[refuses]);
    let before = gpu.counters();
    let mut recorder = gpu.recorder("fill").unwrap();
    recorder.fill(&Buffer::<u32>::zeroed(&gpu, "words", 4).unwrap(), 1);
    assert!(!matches!(recorder.submit().unwrap().wait(), Err(GpuError::Twin { .. })));
    assert_eq!(gpu.counters().twins, before.twins);
}

/// The stage's time is wall-clock time; the other stages keep theirs.
#[test]
fn stages_around_a_twin_are_timed() {
    let gpu = with(&[twin("step_done").unwrap()]);
    let words = Buffer::<u32>::zeroed(&gpu, "status", status::WORDS).unwrap();
    let spec = glint::stages::step_done::Spec { workgroup_size: 1 };
    let stage = glint::stages::step_done::Stage::new(&gpu, &spec).unwrap();
    let mut recorder = gpu.recorder("steps").unwrap();
    recorder.time_stages();
    for _ in 0..3 {
        let buffers = glint::stages::step_done::Buffers { status: &words };
        stage.record(&mut recorder, &buffers, &glint::stages::step_done::Push {}, 1);
        recorder.fill(&Buffer::<u32>::new(&gpu, "other", 64, glint::gpu::Location::Device).unwrap(), 7);
    }
    let times = recorder.submit().unwrap().wait().unwrap();
    assert_eq!(words.download().unwrap()[status::STEPS], 3);
    assert_eq!(gpu.counters().twins, 3);
    if gpu.info().timestamp_period > 0.0 {
        let names: Vec<&str> = times.iter().map(|t| t.name).collect();
        assert_eq!(names, ["step_done", "fill", "step_done", "fill", "step_done", "fill"]);
    }
}
