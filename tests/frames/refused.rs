//! Frames that are refused before anything is recorded.

use super::*;

/// A scene, its model, and a view for frames of 32 × 24 pixels.
fn small(gpu: &Gpu) -> (Scene, Model, FrameView) {
    let scene = random_scene(7, 100, 20, 1);
    let model = Model::upload(gpu, &scene, 0).unwrap();
    (scene, model, FrameView::new(random_camera(32, 24)))
}

/// Not a real image, or none if `handle` is 0: nothing is recorded with it.
fn region(handle: u64, format: vk::Format) -> ImageRegion {
    ImageRegion::of(vk::Image::from_raw(handle), format, vk::ImageLayout::GENERAL)
}

fn imaged(format: vk::Format) -> Pixels {
    Pixels::Image(region(0, format))
}

#[track_caller]
fn assert_refused<T: std::fmt::Debug>(result: glint::Result<T>, words: &str) {
    match result {
        Err(Error::Usage(message)) => assert!(message.contains(words), "{message} lacks {words}"),
        other => panic!("{other:?}, expected a refusal that says {words}"),
    }
}

#[track_caller]
fn refuse(frames: &mut Frames, commands: vk::CommandBuffer, frame: &Frame<'_>, words: &str) {
    assert_refused(unsafe { frames.record(commands, frame) }, words);
    assert!(frames.report(0).is_err());
}

/// Refuses views of one instance of `model`.
fn refusing<'a>(gpu: &'a Gpu, model: &'a Model, limits: Limits) -> impl FnMut(FrameView, &str) + 'a {
    let (mut frames, engine) = (Frames::new(gpu, limits).unwrap(), Engine::new(gpu, 1));
    move |view, words| {
        let frame = Frame { slot: 0, instances: &[Instance::of(model)], views: &[view] };
        refuse(&mut frames, engine.begin(0), &frame, words);
        engine.submit(0);
    }
}

#[test]
fn frames_beyond_their_limits_or_of_another_context_are_refused() {
    let gpu = Gpu::new();
    let (scene, model, view) = small(&gpu);
    let mut frames = Frames::new(&gpu, Limits::of(&model, 32, 24)).unwrap();
    let engine = Engine::new(&gpu, 1);
    let nothing = engine.begin(0);
    let own = Instance::of(&model);
    let mut refused = |slot, instances: &[Instance<'_>], view: FrameView, words: &str| {
        refuse(&mut frames, nothing, &Frame { slot, instances, views: &[view] }, words);
    };
    let sized = |width, height| FrameView { camera: Camera { width, height, ..view.camera }, ..view };
    refused(0, &[own], sized(2048, 2048), "2048 pixels in a row, made for 32");
    refused(0, &[own], sized(32, 25), "25 rows");
    refused(0, &[own], sized(0, 24), "above 0");
    refused(2, &[own], view, "3 slots, made for 2");
    refused(0, &[own, own], view, "2 instances");
    refused(0, &[Instance { degree: 0, ..own }], view, "degrees [1]");
    refused(0, &[Instance { degree: 2, ..own }], view, "degree 2 of a model of 1");
    let mut constant = random_scene(7, 50, 20, 1);
    constant.supplement = constant.supplement.map(|s| Supplement { gaussians: s.gaussians.with_degree(0), ..s });
    let constant = Model::upload(&gpu, &constant, 0).unwrap();
    refused(0, &[Instance::of(&constant)], view, "supplements of degrees [1]");
    let large = Model::upload(&gpu, &random_scene(7, 400, 0, 1), 0).unwrap();
    refused(0, &[Instance::of(&large)], view, "400 Gaussians, made for 120");
    let half = model::Room { half: true, ..Default::default() };
    let half = Model::upload_around(&gpu, DVec3::ZERO, &scene, half).unwrap();
    refused(0, &[Instance::of(&half)], view, "full width");
    let transform = |transform| Instance { transform, ..own };
    refused(0, &[transform(Transform { scale: 0.0, ..Transform::IDENTITY })], view, "scale above 0");
    refused(0, &[transform(Transform { scale: f64::NAN, ..Transform::IDENTITY })], view, "finite");
    let long = DQuat::from_xyzw(0.0, 0.0, 0.0, 2.0);
    refused(0, &[transform(Transform { rotation: long, ..Transform::IDENTITY })], view, "unit length");
    let other = Gpu::new();
    let foreign = Model::upload(&other, &scene, 0).unwrap();
    refused(0, &[Instance::of(&foreign)], view, "another context");
    let frame = Frame { slot: 0, instances: &[own], views: &[view] };
    refuse(&mut frames, vk::CommandBuffer::null(), &frame, "command buffer that is null");
    let mut elsewhere = other.recorder("elsewhere").unwrap();
    assert_refused(unsafe { frames.record_into(&mut elsewhere, &frame) }, "a recorder of another context");
    assert!(elsewhere.finish().is_empty());
    engine.submit(0);
}

#[test]
fn views_that_no_camera_has_are_refused() {
    let gpu = Gpu::new();
    let (_, model, view) = small(&gpu);
    let mut refused = refusing(&gpu, &model, Limits::of(&model, 32, 24));
    let seen_by = |camera| FrameView { camera, ..view };
    let camera = view.camera;
    let sheared = DMat3::from_diagonal(DVec3::new(1.0, 1.01, 1.0)) * camera.rotation;
    for (view, words) in [
        (FrameView { near: 0.0, ..view }, "near plane"),
        (FrameView { near: f64::INFINITY, ..view }, "finite"),
        (seen_by(Camera { width: 0, ..camera }), "focal lengths"),
        (seen_by(Camera { height: 0, ..camera }), "focal lengths"),
        (seen_by(Camera { fx: 0.0, ..camera }), "focal lengths"),
        (seen_by(Camera { fy: 0.0, ..camera }), "focal lengths"),
        (seen_by(Camera { cx: f64::NAN, ..camera }), "focal lengths"),
        (seen_by(Camera { fx: -1.0, ..camera }), "focal"),
        (seen_by(Camera { rotation: 2.0 * DMat3::IDENTITY, ..camera }), "rotation"),
        (seen_by(Camera { rotation: sheared, ..camera }), "rotation is none"),
        (FrameView { depth_form: DepthForm { a: 1.0, b: 0.0 }, ..view }, "depths that differ"),
    ] {
        refused(view, words);
    }
}

#[test]
fn targets_that_cannot_take_the_colors_are_refused() {
    let gpu = Gpu::new();
    let (_, model, view) = small(&gpu);
    let mut refused = refusing(&gpu, &model, Limits::of(&model, 32, 24));
    let float = Float::new(&gpu, 32 * 24);
    let target = float.target(Blend::Premultiplied);
    let pixels = Some(target.pixels);
    refused(FrameView { depth_in: pixels, ..view }, "without depth_in");
    refused(FrameView { depth_out: pixels, ..view }, "without depth_out");
    refused(FrameView { ids: pixels, ..view }, "without depth_out");
    let mut refused = |target, words: &str| refused(FrameView { color: Some(target), ..view }, words);
    refused(target, "4 words for a texel, made for 2");
    let small = Target { texel: Texel::Rgba8, ..target };
    refused(Target { exposure: f32::NAN, ..small }, "exposure");
    for channel in [f32::NAN, f32::INFINITY, -0.1] {
        refused(Target { blend: Blend::Opaque([0.5, channel, 0.5]), ..small }, "a background of");
    }
    let odd = BufferRange { buffer: float.0.raw().handle(), offset: 2 };
    refused(Target { pixels: Pixels::Buffer(odd), ..small }, "multiple of 4");
    let of = |format, texel| Target::new(imaged(format), texel);
    let said = "format B8G8R8A8_UNORM, whose texels are not Rgba8";
    refused(of(vk::Format::B8G8R8A8_UNORM, Texel::Rgba8), said);
    refused(of(vk::Format::R16_UNORM, Texel::Rgba16F), "format R16_UNORM");
    // Missing targets, impossible copies, and copies with another meaning.
    let to = |pixels| Target { pixels, ..small };
    refused(to(imaged(vk::Format::R8G8B8A8_UNORM)), "an image that is null");
    let nowhere = BufferRange { buffer: vk::Buffer::null(), offset: 0 };
    refused(to(Pixels::Buffer(nowhere)), "a buffer that is null");
    let region = region(1, vk::Format::R8G8B8A8_SRGB);
    refused(Target { light: Light::Linear, ..to(Pixels::Image(region)) }, "holds encoded values");
    let placed = |layout, offset| to(Pixels::Image(ImageRegion { layout, offset, ..region }));
    let said = "in layout UNDEFINED, expected one of [GENERAL, TRANSFER_DST";
    refused(placed(vk::ImageLayout::UNDEFINED, [0; 2]), said);
    refused(placed(vk::ImageLayout::TRANSFER_SRC_OPTIMAL, [0; 2]), "layout TRANSFER_SRC_OPTIMAL");
    let over = Target { blend: Blend::Over, ..placed(vk::ImageLayout::TRANSFER_DST_OPTIMAL, [0; 2]) };
    refused(over, "expected one of [GENERAL, SHARED_PRESENT_KHR]");
    refused(placed(vk::ImageLayout::GENERAL, [3, -1]), "a corner at [3, -1]");
}

/// Other texels would be misread as depths or numbers.
#[test]
fn depths_and_numbers_in_other_texels_are_refused() {
    let gpu = Gpu::new();
    let (_, model, view) = small(&gpu);
    let limits = Limits { depth_in: true, depth_out: true, ..Limits::of(&model, 32, 24) };
    let mut refused = refusing(&gpu, &model, limits);
    for format in
        [vk::Format::D16_UNORM, vk::Format::X8_D24_UNORM_PACK32, vk::Format::D24_UNORM_S8_UINT, vk::Format::R32_UINT]
    {
        let pixels = Some(imaged(format));
        refused(FrameView { depth_in: pixels, ..view }, "for depths that hide Gaussians, expected one of [D32");
        refused(FrameView { depth_out: pixels, ..view }, "for depths of Gaussians, expected one of [D32");
    }
    refused(FrameView { ids: Some(imaged(vk::Format::R32_SFLOAT)), ..view }, "expected one of [R32_UINT]");
    let nothing_in =
        |format| Some(Pixels::Image(ImageRegion { layout: vk::ImageLayout::UNDEFINED, ..region(1, format) }));
    let depths = nothing_in(vk::Format::D32_SFLOAT);
    refused(FrameView { depth_in: depths, ..view }, "depths that hide Gaussians: an image in layout UNDEFINED");
    refused(FrameView { depth_out: depths, ..view }, "depths of Gaussians: an image in layout UNDEFINED");
    refused(FrameView { ids: nothing_in(vk::Format::R32_UINT), ..view }, "numbers of Gaussians: an image in layout");
}

#[test]
fn limits_that_no_device_has_are_refused() {
    let gpu = Gpu::new();
    let (scene, model, _) = small(&gpu);
    let fits = Limits::of(&model, 32, 24);
    for (limits, words) in [
        (Limits { width: 0, ..fits.clone() }, "0 width"),
        (Limits { in_flight: 0, ..fits.clone() }, "0 in_flight"),
        (Limits { degrees: vec![], ..fits.clone() }, "0 degrees"),
        (Limits { degrees: vec![5], ..fits.clone() }, "degree 5"),
        (Limits { lobe_degrees: vec![u32::MAX], ..fits.clone() }, "degree 4294967295"),
        // Sizes beyond 32 bits would wrap around.
        (Limits { width: 1 << 16, height: 1 << 16, ..fits.clone() }, "too large"),
        (Limits { width: 1 << 16, height: 1 << 14, texel: Texel::Rgba32F, ..fits.clone() }, "too large"),
        (Limits { views: 2, instances: 1 << 31, ..fits.clone() }, "2147483648 instances are too many"),
        (Limits { views: u32::MAX, instances: u32::MAX, ..fits.clone() }, "too many"),
        (Limits { in_flight: 65, ..fits.clone() }, "65 slots"),
    ] {
        assert_refused(limits.plan(gpu.info()).map(drop), words);
        assert_refused(Frames::new(&gpu, limits).map(drop), words);
    }
    // Sizes that can be counted but exceed every device are refused by the device; the plan gives the size.
    let most =
        Limits { gaussians: u32::MAX, instances: u32::MAX, width: u32::MAX, height: 1, texel: Texel::Rgba8, ..fits };
    let plan = most.plan(gpu.info()).unwrap();
    let of = |name| plan.0.iter().find(|buffer| buffer.name == name).unwrap();
    assert_eq!((of("views").elements, of("target").bytes()), (u32::MAX.into(), 4 * u64::from(u32::MAX)));
    assert!(matches!(Frames::new(&gpu, most), Err(Error::Gpu(_))));
    let rooms = model::Room { base: u32::MAX, supplement: u32::MAX, ..Default::default() };
    assert!(matches!(Model::upload_around(&gpu, DVec3::ZERO, &scene, rooms), Err(Error::Usage(_))));
}
