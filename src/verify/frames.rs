//! Verifies frames in a caller's renderer: texels of every format, and the whole chain with its frame-only
//! features.

use glam::{DMat3, DQuat, DVec3};

use super::{Bench, raster::BACKGROUND, sort::noise};
use crate::{
    error::Result,
    gpu::{Buffer, BufferRange, Pixels},
    pipelines::{
        frames::{Blend, DepthForm, Frame, FrameView, Frames, Instance, Limits, Target, Texel, Transform},
        model::{Model, Room},
    },
    reference::{random_camera, random_scene, resolve as twin},
    stages::{
        WORKGROUP,
        constants::resolve::{BGRA8, OPAQUE, OVER, PREMULTIPLIED, RGBA8, RGBA16F, RGBA32F},
        resolve,
    },
};

pub(super) fn cases(bench: &Bench<'_>, quick: bool) -> Result<()> {
    texels(bench, if quick { 5000 } else { 1 << 20 })?;
    whole(bench, quick)
}

/// All formats and blend modes.
fn texels(bench: &Bench<'_>, pixels: usize) -> Result<()> {
    let unit = |i: usize| noise(i as u32) as f32 / u32::MAX as f32;
    let channels: [Vec<f32>; 7] = std::array::from_fn(|c| (0..pixels).map(|p| unit(c * pixels + p)).collect());
    // Premultiplied colors up to 1.5 times alpha; transmittances from 0 to 1; a background; depths, one in
    // eight empty.
    let image: Vec<[f32; 4]> = (0..pixels)
        .map(|p| {
            let t = channels[3][p];
            [0, 1, 2].map(|c| 1.5 * (1.0 - t) * channels[c][p]).into_iter().chain([t]).collect::<Vec<_>>()
        })
        .map(|v| [v[0], v[1], v[2], v[3]])
        .collect();
    let depths: Vec<f32> = (0..pixels).map(|p| if p % 8 == 0 { 0.0 } else { 0.2 + 50.0 * channels[4][p] }).collect();
    let below: Vec<[f64; 4]> =
        (0..pixels).map(|p| [channels[5][p], channels[6][p], channels[0][p], channels[4][p]].map(f64::from)).collect();
    let context = &bench.shadowed;
    let (image_there, depths_there) =
        (Buffer::from_slice(context, "image", &image)?, Buffer::from_slice(context, "depths", &depths)?);
    let depth_target = Buffer::<f32>::zeroed(context, "depth_target", pixels)?;
    let background = [0.2, 0.5, 0.9f32];
    let cases = [
        (RGBA32F, OPAQUE, false, 1.0),
        (RGBA32F, OPAQUE, true, 1.7),
        (RGBA32F, PREMULTIPLIED, true, 2.5),
        (RGBA32F, OVER, false, 0.5),
        (RGBA32F, OVER, true, 1.0),
        (RGBA16F, OVER, true, 1.0),
        (RGBA8, OVER, false, 1.0),
        (BGRA8, PREMULTIPLIED, false, 1.0),
    ];
    for (format, blend, linear, exposure) in cases {
        let curves = linear || exposure != 1.0;
        let stage = resolve::Stage::new(context, &resolve::Spec { workgroup_size: WORKGROUP, curves })?;
        let words = twin::words(format);
        let mut texels = vec![0; words * pixels];
        texels.chunks_mut(words).zip(&below).for_each(|(texel, below)| twin::pack(format, *below, texel));
        let form = [0.1, -0.3f32];
        let push = resolve::Push {
            pixels: pixels as u32,
            format,
            blend,
            linear: linear.into(),
            depth: 1,
            exposure,
            depth_form: form,
            background,
        };
        let buffers = resolve::Buffers {
            image: &image_there,
            depths: &depths_there,
            target: &Buffer::from_slice(context, "target", &texels)?,
            depth_target: &depth_target,
        };
        bench.run(|recorder| stage.record(recorder, &buffers, &push, push.pixels))?;
    }
    Ok(())
}

/// A rotated and scaled scene behind a mesh's depths, at full and half width, with depths as output.
fn whole(bench: &Bench<'_>, quick: bool) -> Result<()> {
    let (count, supplement, width, height) = if quick { (1500, 500, 97, 71) } else { (20_000, 5_000, 403, 301) };
    let scene = random_scene(41, count, supplement, 3);
    let camera = random_camera(width, height);
    let transform = Transform {
        rotation: DQuat::from_axis_angle(DVec3::new(1.0, -2.0, 0.5).normalize(), 1.1),
        scale: 1.5,
        translation: DVec3::new(0.4, -0.3, 0.2),
    };
    // The camera moves along with the model, so that its view stays the same.
    let rotation = camera.rotation * DMat3::from_quat(transform.rotation).transpose();
    let translation = transform.scale * camera.translation - rotation * transform.translation;
    let moved = crate::scene::Camera { rotation, translation, ..camera };
    let form = DepthForm::reversed_infinite(0.3);
    let pixels = (width * height) as usize;
    // A wall that leans back, in world units; nothing in the right half.
    let depth = |p: usize| {
        if p as u32 % width < width / 2 { (0.3 / (1.5 + 8.0 * p as f64 / pixels as f64)) as f32 } else { 0.0 }
    };
    let depths: Vec<f32> = (0..pixels).map(depth).collect();
    let context = &bench.shadowed;
    let (mesh, target) =
        (Buffer::from_slice(context, "mesh", &depths)?, Buffer::<[f32; 4]>::zeroed(context, "target", pixels)?);
    let depth_target = Buffer::<f32>::zeroed(context, "depth_target", pixels)?;
    let place = |buffer| Pixels::Buffer(BufferRange { buffer, offset: 0 });
    let view = FrameView {
        near: 0.2 * transform.scale,
        depth_form: form,
        depth_in: Some(place(mesh.raw().handle())),
        color: Some(Target {
            blend: Blend::Opaque(BACKGROUND),
            ..Target::new(place(target.raw().handle()), Texel::Rgba32F)
        }),
        ..FrameView::new(moved)
    };
    for (half, depth_out) in [(false, false), (false, true), (true, false)] {
        let model = Model::upload_around(context, DVec3::ZERO, &scene, Room { half, ..Default::default() })?;
        let limits = Limits { depth_in: true, depth_out, texel: Texel::Rgba32F, ..Limits::of(&model, width, height) };
        let mut frames = Frames::new(context, limits)?;
        let instances = [Instance { transform, ..Instance::of(&model) }];
        let depth_to = depth_out.then(|| place(depth_target.raw().handle()));
        let view = FrameView { depth_out: depth_to, ..view };
        let frame = Frame { slot: 0, instances: &instances, views: &[view] };
        frames.reserve(16 * (count + supplement) as u32)?;
        // SAFETY: mesh and target live, and nobody else uses them.
        bench.run(|recorder| drop(unsafe { frames.record_into(recorder, &frame) }))?;
    }
    Ok(())
}
