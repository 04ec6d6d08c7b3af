//! Frames of somebody else's renderer: texels of every kind, and the whole chain with what only frames have.

use glam::{DMat3, DQuat, DVec3};

use super::{
    Bench,
    bounds::NEAR_THRESHOLD,
    half::rounded,
    judge::Work,
    raster::{BACKGROUND, compare_image},
    sort::noise,
};
use crate::{
    error::Result,
    gpu::{Buffer, BufferRange, Pixels},
    pipelines::{
        frames::{Blend, DepthForm, Frame, FrameView, Frames, Instance, Limits, Target, Texel, Transform},
        model::{Model, Room},
    },
    reference::{
        Background, Intersections, Options, Params, View,
        blend::{Margin, blend_before},
        median_depth::{DepthAt, median_depth},
        packed_splat::packed,
        project::project,
        random_camera, random_scene,
        resolve::{self as twin, To},
        tiles::Tiling,
    },
    stages::{
        WORKGROUP,
        constants::resolve::{BGRA8, OPAQUE, OVER, PREMULTIPLIED, RGBA8, RGBA16F, RGBA32F},
        resolve,
    },
};

pub(super) fn cases(bench: &mut Bench<'_>, quick: bool) -> Result<()> {
    texels(bench, if quick { 5000 } else { 1 << 20 })?;
    whole(bench, quick)
}

/// Numbers of floats, and of texels whether they are the nearest.
fn texels(bench: &mut Bench<'_>, pixels: usize) -> Result<()> {
    let unit = |i: usize| noise(i as u32) as f32 / u32::MAX as f32;
    let channels: [Vec<f32>; 7] = std::array::from_fn(|c| (0..pixels).map(|p| unit(c * pixels + p)).collect());
    // Colours weighed by alpha, up to 1.5 of it; transmittances from 0 to 1; what is below; depths, one in eight of nothing.
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
    let context = bench.context;
    let (image_there, depths_there) =
        (Buffer::from_slice(context, "image", &image)?, Buffer::from_slice(context, "depths", &depths)?);
    let depth_target = Buffer::<f32>::zeroed(context, "depth_target", pixels)?;
    let background = [0.2, 0.5, 0.9f32];
    let cases = [
        (RGBA32F, OPAQUE, false, 1.0, "opaque"),
        (RGBA32F, OPAQUE, true, 1.7, "opaque, linear, exposed"),
        (RGBA32F, PREMULTIPLIED, true, 2.5, "premultiplied, linear, exposed"),
        (RGBA32F, OVER, false, 0.5, "over, exposed"),
        (RGBA32F, OVER, true, 1.0, "over, linear"),
        (RGBA16F, OVER, true, 1.0, "half, over, linear"),
        (RGBA8, OVER, false, 1.0, "8 bits, over"),
        (BGRA8, PREMULTIPLIED, false, 1.0, "8 bits, premultiplied"),
    ];
    for (format, blend, linear, exposure, name) in cases {
        let curves = linear || exposure != 1.0;
        let stage = resolve::Stage::new(context, &resolve::Spec { workgroup_size: WORKGROUP, curves })?;
        let words = twin::words(format);
        let mut texels = vec![0; words * pixels];
        texels.chunks_mut(words).zip(&below).for_each(|(texel, below)| twin::pack(format, *below, texel));
        let target = Buffer::from_slice(context, "target", &texels)?;
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
            target: &target,
            depth_target: &depth_target,
        };
        let times = bench.time_after(
            || Ok(target.upload(0, &texels)?),
            |recorder| stage.record(recorder, &buffers, &push, push.pixels),
        )?;
        let (got, depths_got) = (target.download()?, depth_target.download()?);
        let to = To { blend, linear, exposure: exposure.into(), background: background.map(f64::from) };
        let mut row = bench.row("resolve", name);
        row.chosen = format == RGBA8;
        row.time = times.of("resolve");
        let read = if blend == OVER { 4.0 * words as f64 } else { 0.0 };
        row.work = Work { bytes: pixels as f64 * (16.0 + 4.0 + 4.0 + 4.0 * words as f64 + read), operations: 0.0 };
        let mut wrong = 0;
        let mut numbers = Vec::new();
        for ((color, before), after) in image.iter().zip(texels.chunks_exact(words)).zip(got.chunks_exact(words)) {
            let want = to.resolve(color.map(f64::from), twin::unpack(format, before));
            let have = twin::unpack(format, after);
            for c in 0..4 {
                if format == RGBA32F {
                    numbers.push((have[c] as f32, want[c]));
                } else {
                    // Half a step of the texel, and the error that the row's bound allows before it is rounded.
                    let step = if format == RGBA16F { want[c].abs().max(6e-5) / 1024.0 } else { 1.0 / 255.0 };
                    let want = if format == RGBA16F { want[c] } else { want[c].clamp(0.0, 1.0) };
                    wrong += u64::from((have[c] + bench.shift() - want).abs() > 0.5 * step + 2e-5);
                }
            }
        }
        row.numbers(numbers);
        row.numbers(depths_got.iter().zip(&depths).map(|(&got, &z)| (got, twin::depth(z.into(), form.map(f64::from)))));
        row.unequal(wrong);
        bench.push(row);
    }
    Ok(())
}

/// A scene that stands turned and scaled in the world behind a mesh's depths, at both widths and with depths of its own,
/// against a twin that shares nothing with the device but the scene.
fn whole(bench: &mut Bench<'_>, quick: bool) -> Result<()> {
    let (count, supplement, width, height) = if quick { (1500, 500, 97, 71) } else { (20_000, 5_000, 403, 301) };
    let scene = random_scene(41, count, supplement, 3);
    let camera = random_camera(width, height);
    let transform = Transform {
        rotation: DQuat::from_axis_angle(DVec3::new(1.0, -2.0, 0.5).normalize(), 1.1),
        scale: 1.5,
        translation: DVec3::new(0.4, -0.3, 0.2),
    };
    // The camera goes with the model, so that it sees what it saw.
    let rotation = camera.rotation * DMat3::from_quat(transform.rotation).transpose();
    let translation = transform.scale * camera.translation - rotation * transform.translation;
    let moved = crate::scene::Camera { rotation, translation, ..camera };
    let form = DepthForm::reversed_infinite(0.3);
    let pixels = (width * height) as usize;
    // A wall that leans back, in the world's units; nothing in the right half.
    let depth = |p: usize| {
        if p as u32 % width < width / 2 { (0.3 / (1.5 + 8.0 * p as f64 / pixels as f64)) as f32 } else { 0.0 }
    };
    let depths: Vec<f32> = (0..pixels).map(depth).collect();
    let context = bench.context;
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
    let mut params = Params::from_scene(&scene)?;
    for (half, depth_out, name) in [
        (false, false, "turned, occluded"),
        (false, true, "turned, occluded, with depths"),
        (true, false, "turned, occluded, half width"),
    ] {
        let model = Model::upload_around(context, DVec3::ZERO, &scene, Room { half, ..Default::default() })?;
        if half {
            params = rounded(&params);
        }
        let limits = Limits { depth_in: true, depth_out, texel: Texel::Rgba32F, ..Limits::of(&model, width, height) };
        let mut frames = Frames::new(context, limits)?;
        let instances = [Instance { transform, ..Instance::of(&model) }];
        let depth_to = depth_out.then(|| place(depth_target.raw().handle()));
        let view = FrameView { depth_out: depth_to, ..view };
        let frame = Frame { slot: 0, instances: &instances, views: &[view] };
        frames.reserve(16 * (count + supplement) as u32)?;
        // SAFETY: mesh and target live, and nobody else uses them.
        let times = bench.time(|recorder| drop(unsafe { frames.record_into(recorder, &frame) }))?;
        let options = Options { active_degree: 3, ..Default::default() };
        let seen = View::from_camera(&camera).rounded();
        let tiling = Tiling::new(width, height, &options);
        let mut projected = project(&params, &seen, &options);
        if half {
            projected = packed(projected, &tiling);
        }
        let isects = Intersections::new(&projected, tiling);
        // In the model's own units.
        let farthest = |p: usize| twin::camera_z(depths[p].into(), [form.a, form.b]) / transform.scale;
        let behind = Background::Color(BACKGROUND.map(f64::from));
        let want = blend_before(&projected.splats, &isects, behind, 0.5, farthest);
        let mut got = target.download()?;
        // Opaque texels have alpha 1; the transmittance is the twin's.
        got.iter_mut().zip(&want.image).for_each(|(got, want)| got[3] = want[3] as f32);
        let mut row = bench.row("(frame)", name);
        row.chosen = true;
        row.time = times.sum();
        compare_image(&mut row, &got, &want, Margin::image);
        if depth_out {
            // Of the model's own units to those of the world.
            let own = median_depth(&params, &seen, &want.median, DepthAt::MaximumResponse, 1.0);
            let form = [form.a, form.b];
            let wanted: Vec<f64> = own.iter().map(|z| twin::depth(transform.scale * z, form)).collect();
            let got = depth_target.download()?;
            // Where Gaussians change places, or a point meets the near plane, one side may take another depth.
            let near = |depth: f64| (twin::camera_z(depth, form) / view.near - 1.0).abs() < NEAR_THRESHOLD;
            let is_calm = |p: &usize| {
                let margin = &want.margins[*p];
                let calm = margin.image().min(margin.median) > NEAR_THRESHOLD;
                calm && !near(wanted[*p]) && !near(got[*p].into())
            };
            row.numbers((0..pixels).filter(is_calm).map(|p| (got[p], wanted[p])));
        }
        bench.push(row);
    }
    Ok(())
}
