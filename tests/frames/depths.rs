//! Depths as input and as output of frames.

use super::*;

#[test]
fn a_mesh_hides_what_is_behind_it_in_every_form_of_depth() {
    let gpu = Gpu::new();
    let (scene, camera) = (random_scene(9, 700, 150, 2), random_camera(53, 41));
    let pixels = camera.pixels() as usize;
    let model = Model::upload(&gpu, &scene, 0).unwrap();
    let limits = Limits { depth_in: true, ..wide(Limits::of(&model, 53, 41)) };
    let mut frames = Frames::new(&gpu, limits).unwrap();
    let mut engine = Engine::new(&gpu, 1);
    let float = Float::new(&gpu, camera.pixels());
    let view = View::from_camera(&camera).rounded();
    // A tilted quad from 1 to 6 units, in the left two thirds; nothing behind the rest.
    let quad = |pixel: usize| match pixel % 53 < 35 {
        true => Some(1.0 + 5.0 * (pixel / 53) as f64 / 41.0),
        false => None,
    };
    // Gaussians beyond the far plane are drawn, unless something is in front of them.
    let beyond = twin(&scene, &view, |_| FAR);
    let all = twin(&scene, &view, |_| f64::INFINITY);
    assert!(all.iter().zip(&beyond).filter(|(a, b)| (a.0[3] - b.0[3]).abs() > 0.05).count() > 100);
    for (form, projection) in FORMS {
        let depth = |pixel: usize| quad(pixel).map_or(form.empty(), |z| (form.a + form.b / z) as f32);
        let depths: Vec<u32> = (0..pixels).map(|p| depth(p).to_bits()).collect();
        // The quad's depth after rounding to float32.
        let farthest = |pixel: usize| match quad(pixel) {
            Some(_) => form.b as f32 as f64 / (f64::from(depth(pixel)) - f64::from(form.a as f32)),
            None => f64::INFINITY,
        };
        let want = twin(&scene, &view, farthest);
        for format in [None].into_iter().chain(DEPTH_FORMATS.map(Some)) {
            let buffer = Buffer::from_slice(&gpu, "mesh", &depths).unwrap();
            let depth_in = if let Some(format) = format {
                let mut image = engine.image(format, 53, 41);
                engine.write(&image, [53, 41], &depths);
                engine.turn(&mut image, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
                Pixels::Image(image)
            } else {
                Pixels::Buffer(BufferRange { buffer: buffer.raw().handle(), offset: 0 })
            };
            let seen = FrameView {
                depth_form: form,
                depth_in: Some(depth_in),
                color: Some(float.target(Blend::Premultiplied)),
                ..FrameView::new(camera)
            };
            draw(&engine, &mut frames, &[Instance::of(&model)], seen);
            let (mut calm, mut hidden) = (0, 0);
            for (pixel, (got, (want, margin))) in float.pixels().iter().zip(&want).enumerate() {
                // A depth near the far end has fewer digits than a camera z.
                if *margin > 10.0 * NEAR {
                    calm += 1;
                    hidden += usize::from(quad(pixel).is_some());
                    for c in 0..3 {
                        assert!((f64::from(got[c]) - want[c]).abs() < 1e-5, "{projection} {pixel} {got:?} {want:?}");
                    }
                    assert!((f64::from(got[3]) - (1.0 - want[3])).abs() < 1e-5, "{projection} {pixel}");
                }
            }
            assert!(calm > pixels * 8 / 10 && hidden > pixels / 2, "{calm} {hidden}");
        }
    }
    // The quad hides something; otherwise the test would prove nothing.
    let some = twin(&scene, &view, |p| quad(p).unwrap_or(1e9));
    assert!(all.iter().zip(&some).filter(|(a, b)| (a.0[3] - b.0[3]).abs() > 0.05).count() > pixels / 4);
    // Limits with depths, but a view without: nothing is hidden.
    let seen = FrameView { color: Some(float.target(Blend::Opaque(GREY))), ..FrameView::new(camera) };
    draw(&engine, &mut frames, &[Instance::of(&model)], seen);
    let plain = rendered(&gpu, &scene, &camera);
    let got: Vec<[f32; 4]> = float.pixels().iter().zip(&plain).map(|(p, w)| [p[0], p[1], p[2], w[3]]).collect();
    assert_eq!(got, plain);
}

#[test]
fn depths_and_numbers_come_out_in_the_form_that_was_asked_for() {
    let gpu = Gpu::new();
    let (scene, camera) = (random_scene(9, 700, 150, 2), random_camera(53, 41));
    let model = Model::upload(&gpu, &scene, 0).unwrap();
    let limits = Limits { depth_out: true, ..wide(Limits::of(&model, 53, 41)) };
    let mut frames = Frames::new(&gpu, limits).unwrap();
    let mut engine = Engine::new(&gpu, 1);
    let ids = Buffer::<u32>::zeroed(&gpu, "ids", camera.pixels() as usize).unwrap();
    let mut images = DEPTH_FORMATS.map(|format| engine.image(format, 53, 41));
    let mut image = engine.image(vk::Format::R32_UINT, 53, 41);
    let form = DepthForm::reversed_infinite(0.2);
    let mut into = |depth: ImageRegion, ids| {
        let view = FrameView {
            depth_form: form,
            depth_out: Some(Pixels::Image(depth)),
            ids: Some(ids),
            ..FrameView::new(camera)
        };
        draw(&engine, &mut frames, &[Instance::of(&model)], view);
    };
    // Images of every format give the same bits, and so does a buffer.
    let in_buffer = Pixels::Buffer(BufferRange { buffer: ids.raw().handle(), offset: 0 });
    for (depth, ids) in images.iter().zip([in_buffer, Pixels::Image(image), in_buffer]) {
        into(*depth, ids);
    }
    let ids = ids.download().unwrap();
    assert_eq!(engine.read(&mut image, [53, 41], 1), ids);
    let [got, others @ ..] = images.each_mut().map(|image| engine.read(image, [53, 41], 1));
    assert!(others.iter().all(|other| *other == got));
    // The twin gives the same Gaussian, and the depth is that Gaussian's.
    let (params, view) = (Params::from_scene(&scene).unwrap(), View::from_camera(&camera).rounded());
    let options = Options { active_degree: params.sh_degree, ..Default::default() };
    let projected = project(&params, &view, &options);
    let isects = Intersections::new(&projected, Tiling::new(53, 41, &options));
    let twin = blend_before(&projected.splats, &isects, Background::Color([0.0; 3]), 0.5, |_| f64::INFINITY);
    let want = median_depth(&params, &view, &twin.median, DepthAt::MaximumResponse, 1.0);
    let check = |got: &[u32], ids: &[u32], form: DepthForm, scale: f64, what: &str| {
        let (mut seen, mut nothing, mut beyond) = (0, 0, [0, 0]);
        for (pixel, (&got, z)) in got.iter().zip(&want).enumerate() {
            let got = f64::from(f32::from_bits(got));
            assert!((0.0..=1.0).contains(&got), "{what}, pixel {pixel}: {got}");
            let (margin, id) = (&twin.margins[pixel], twin.median[pixel]);
            if margin.image().min(margin.median) <= NEAR {
                continue;
            }
            assert_eq!(ids[pixel], id, "{what}, pixel {pixel}");
            if id == u32::MAX {
                nothing += 1;
                assert_eq!(got, f64::from(form.empty()), "{what}, pixel {pixel}");
            } else {
                seen += 1;
                // The tolerance of depths in `verify`: a flat Gaussian's ray has few digits.
                let (want, off) = (depth(scale * z, [form.a, form.b]), 1e-3 * (form.b / (scale * z)).abs());
                assert!((got - want).abs() < off, "{what}, scale {scale}, pixel {pixel}: {got} {want}");
                for (end, count) in [form.empty(), 1.0 - form.empty()].into_iter().zip(&mut beyond) {
                    *count += usize::from(got == f64::from(end));
                }
            }
        }
        assert!(seen > 500 && nothing > 100, "{seen} {nothing}");
        beyond
    };
    check(&got, &ids, form, 1.0, "images");
    // If the scene and the camera are rotated, moved and scaled together, the view is the same at scaled
    // distances.
    let [depth_to, ids_to] = [0, 1].map(|_| Buffer::<u32>::zeroed(&gpu, "words", camera.pixels() as usize).unwrap());
    let mut drawn = |form: DepthForm, scale: f64, what: &str| {
        let transform = Transform {
            rotation: DQuat::from_axis_angle(DVec3::new(1.0, -2.0, 0.5).normalize(), 1.1),
            scale,
            translation: DVec3::new(0.4, -0.3, 0.2),
        };
        let to = |buffer: &Buffer<u32>| Pixels::Buffer(BufferRange { buffer: buffer.raw().handle(), offset: 0 });
        let view = FrameView {
            near: 0.2 * scale,
            depth_form: form,
            depth_out: Some(to(&depth_to)),
            ids: Some(to(&ids_to)),
            ..FrameView::new(gone_with(&camera, &transform))
        };
        let instances = [Instance { transform, ..Instance::of(&model) }];
        draw(&engine, &mut frames, &instances, view);
        check(&depth_to.download().unwrap(), &ids_to.download().unwrap(), form, scale, what)
    };
    for (form, projection) in FORMS {
        for scale in [0.6, 1.0, 1.7] {
            drawn(form, scale, projection);
        }
    }
    // Depths are clamped to the ends of the range: Gaussians beyond the far plane have that plane's depth,
    // and those in front of the near plane (if glint's own is nearer) the near plane's.
    let (near, far) = (1.0, 3.0);
    for form in [DepthForm::standard(near, far), DepthForm { a: -near / (far - near), b: near * far / (far - near) }] {
        let beyond = drawn(form, 1.0, "a near far plane");
        assert!(beyond.iter().all(|&count| count > 20), "{beyond:?}");
    }
}

#[test]
fn matrices_of_renderers_are_the_cameras_they_stand_for() {
    let camera = random_camera(640, 480);
    let (w, h) = (640.0, 480.0);
    // Vulkan's convention (y down, z forward) and OpenGL's view space (y up, z backward), each with its
    // projection.
    let rows = |x: DVec3, y: DVec3, z: DVec3, t: DVec3| {
        DMat4::from_cols(
            DVec4::new(x.x, y.x, z.x, 0.0),
            DVec4::new(x.y, y.y, z.y, 0.0),
            DVec4::new(x.z, y.z, z.z, 0.0),
            t.extend(1.0),
        )
    };
    let (r, t) = (camera.rotation, camera.translation);
    let near = 0.1;
    for flip in [1.0, -1.0] {
        let view = rows(r.row(0), flip * r.row(1), flip * r.row(2), DVec3::new(t.x, flip * t.y, flip * t.z));
        let projection = DMat4::from_cols(
            DVec4::new(2.0 * camera.fx / w, 0.0, 0.0, 0.0),
            DVec4::new(0.0, flip * 2.0 * camera.fy / h, 0.0, 0.0),
            DVec4::new(flip * (2.0 * camera.cx / w - 1.0), flip * (2.0 * camera.cy / h - 1.0), 0.0, flip),
            DVec4::new(0.0, 0.0, near, 0.0),
        );
        let seen = FrameView::from_matrices(view, projection, 640, 480).unwrap();
        let point = DVec3::new(0.3, -0.7, 4.0);
        let (a, b) = (seen.camera.project(point), camera.project(point));
        assert!((a.0 - b.0).abs() < 1e-9 && (a.1 - b.1).abs() < 1e-9 && (a.2 - b.2).abs() < 1e-9, "{a:?} {b:?}");
        // And the matrices put it there.
        let clip = projection * view * point.extend(1.0);
        assert!(((clip.x / clip.w + 1.0) * w / 2.0 - a.0).abs() < 1e-9);
        assert!(((clip.y / clip.w + 1.0) * h / 2.0 - a.1).abs() < 1e-9);
        assert!((clip.z / clip.w - (seen.depth_form.a + seen.depth_form.b / a.2)).abs() < 1e-12);
        assert_eq!((seen.depth_form, seen.near), (DepthForm::reversed_infinite(near), near));
        // The near plane is the projection's, for every form.
        for (form, name) in FORMS {
            let column = DVec4::new(0.0, 0.0, form.b, 0.0);
            let z_axis = DVec4::new(projection.z_axis.x, projection.z_axis.y, flip * form.a, flip);
            let seen =
                FrameView::from_matrices(view, DMat4 { z_axis, w_axis: column, ..projection }, 640, 480).unwrap();
            assert!((seen.near - 0.2).abs() < 1e-12 && seen.depth_form == form, "{name}: {seen:?}");
        }
        for nowhere in [DVec4::ZERO, DVec4::new(0.0, 0.0, -near, 0.0)] {
            let said = FrameView::from_matrices(view, DMat4 { w_axis: nowhere, ..projection }, 640, 480).unwrap_err();
            assert!(said.to_string().contains("near plane ahead"), "{said}");
        }
        let skewed = DMat4 { y_axis: DVec4::new(0.1, projection.y_axis.y, 0.0, 0.0), ..projection };
        assert!(FrameView::from_matrices(view, skewed, 640, 480).is_err());
        assert!(FrameView::from_matrices(2.0 * view, projection, 640, 480).is_err());
        // A view matrix must be rigid, with a last row of 0, 0, 0, 1.
        for last in [DVec4::new(0.0, 0.0, 0.5, 1.0), DVec4::new(0.0, 0.0, 0.0, 2.0)] {
            let mut columns = [view.x_axis, view.y_axis, view.z_axis, view.w_axis];
            columns.iter_mut().zip(last.to_array()).for_each(|(column, w)| column.w = w);
            let [x, y, z, w] = columns;
            let said = FrameView::from_matrices(DMat4::from_cols(x, y, z, w), projection, 640, 480).unwrap_err();
            assert!(said.to_string().contains("a view of rotation and translation"), "{said}");
        }
        assert!(FrameView::from_matrices(view, DMat4::IDENTITY, 640, 480).is_err());
        assert!(FrameView::from_matrices(DMat4::NAN, projection, 640, 480).is_err());
    }
    let form = DepthForm::standard(0.5, 20.0);
    assert!((form.a + form.b / 0.5).abs() < 1e-12 && (form.a + form.b / 20.0 - 1.0).abs() < 1e-12);
}

#[test]
fn a_near_plane_is_the_views_own() {
    let gpu = Gpu::with(ContextOptions::from_env());
    let (scene, camera) = (random_scene(7, 600, 0, 0), random_camera(61, 47));
    let model = Model::upload(&gpu, &scene, 0).unwrap();
    let got = drawn(&gpu, &model, FrameView { near: 2.0, ..FrameView::new(camera) }, Blend::Premultiplied);
    let want = twin(&scene, &View { near: 2.0, ..View::from_camera(&camera) }.rounded(), |_| f64::INFINITY);
    let all = twin(&scene, &View::from_camera(&camera).rounded(), |_| f64::INFINITY);
    let calm = want.iter().zip(got).filter(|((_, margin), _)| *margin > NEAR);
    assert!(calm.clone().all(|((w, _), g)| (0..3).all(|c| (w[c] - f64::from(g[c])).abs() < 1e-5)));
    assert!(calm.count() > 2000 && all.iter().zip(&want).filter(|(a, b)| (a.0[3] - b.0[3]).abs() > 0.05).count() > 300);
}
