//! Frames that are refused before anything is recorded.

use super::*;

#[test]
fn what_cannot_be_is_refused_and_records_nothing() {
    let gpu = Gpu::new();
    let (scene, camera) = (random_scene(7, 100, 20, 1), random_camera(32, 24));
    let model = Model::upload(&gpu, &scene, 0).unwrap();
    let mut frames = Frames::new(&gpu, Limits::of(&model, 32, 24)).unwrap();
    let engine = Engine::new(&gpu, 1);
    let float = Float::new(&gpu, 32 * 24);
    let view = FrameView::new(camera);
    let own = Instance::of(&model);
    let nothing = engine.begin(0);
    let mut refused = |slot, instances: &[Instance<'_>], view: FrameView, words: &str| {
        let frame = Frame { slot, instances, views: &[view] };
        match unsafe { frames.record(nothing, &frame) } {
            Err(Error::Usage(message)) => assert!(message.contains(words), "{message} lacks {words}"),
            other => panic!("{other:?}, expected a refusal that says {words}"),
        }
        assert!(frames.report(0).is_err());
    };
    let sized = |width, height| FrameView { camera: Camera { width, height, ..camera }, ..view };
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
    refused(0, &[own], FrameView { near: 0.0, ..view }, "near plane");
    for camera in [
        Camera { width: 0, ..view.camera },
        Camera { height: 0, ..view.camera },
        Camera { fx: 0.0, ..view.camera },
        Camera { fy: 0.0, ..view.camera },
        Camera { cx: f64::NAN, ..view.camera },
    ] {
        refused(0, &[own], FrameView { camera, ..view }, "focal lengths");
    }
    refused(0, &[own], FrameView { near: f64::INFINITY, ..view }, "finite");
    refused(0, &[own], FrameView { camera: Camera { fx: -1.0, ..camera }, ..view }, "focal");
    let target = float.target(Blend::Premultiplied);
    refused(0, &[own], FrameView { color: Some(target), ..view }, "4 words for a texel, made for 2");
    let pixels = Some(target.pixels);
    refused(0, &[own], FrameView { depth_in: pixels, ..view }, "without depth_in");
    refused(0, &[own], FrameView { depth_out: pixels, ..view }, "without depth_out");
    refused(0, &[own], FrameView { ids: pixels, ..view }, "without depth_out");
    let small = Target { texel: Texel::Rgba8, exposure: f32::NAN, ..target };
    refused(0, &[own], FrameView { color: Some(small), ..view }, "exposure");
    for channel in [f32::NAN, f32::INFINITY, -0.1] {
        let blend = Blend::Opaque([0.5, channel, 0.5]);
        let color = Some(Target { blend, exposure: 1.0, ..small });
        refused(0, &[own], FrameView { color, ..view }, "a background of");
    }
    refused(0, &[own], FrameView { camera: Camera { rotation: 2.0 * DMat3::IDENTITY, ..camera }, ..view }, "rotation");
    let sheared = DMat3::from_diagonal(DVec3::new(1.0, 1.01, 1.0)) * camera.rotation;
    refused(0, &[own], FrameView { camera: Camera { rotation: sheared, ..camera }, ..view }, "rotation is none");
    refused(0, &[own], FrameView { depth_form: DepthForm { a: 1.0, b: 0.0 }, ..view }, "depths that differ");
    let odd = BufferRange { buffer: float.0.raw().handle(), offset: 2 };
    let odd = Target { pixels: Pixels::Buffer(odd), exposure: 1.0, ..small };
    refused(0, &[own], FrameView { color: Some(odd), ..view }, "multiple of 4");
    let imaged = |format| Pixels::Image(ImageRegion::of(vk::Image::null(), format, vk::ImageLayout::GENERAL));
    let of = |format, texel| Some(Target::new(imaged(format), texel));
    let color = of(vk::Format::B8G8R8A8_UNORM, Texel::Rgba8);
    refused(0, &[own], FrameView { color, ..view }, "format B8G8R8A8_UNORM, whose texels are not Rgba8");
    let color = of(vk::Format::R16_UNORM, Texel::Rgba16F);
    refused(0, &[own], FrameView { color, ..view }, "format R16_UNORM");
    // Missing targets, impossible copies, and copies with another meaning.
    let small = Target { exposure: 1.0, ..small };
    let to = |pixels| Some(Target { pixels, ..small });
    refused(0, &[own], FrameView { color: to(imaged(vk::Format::R8G8B8A8_UNORM)), ..view }, "an image that is null");
    let nowhere = Pixels::Buffer(BufferRange { buffer: vk::Buffer::null(), offset: 0 });
    refused(0, &[own], FrameView { color: to(nowhere), ..view }, "a buffer that is null");
    // Not a real image: nothing is recorded with it.
    let some = vk::Image::from_raw(1);
    let region = ImageRegion::of(some, vk::Format::R8G8B8A8_SRGB, vk::ImageLayout::GENERAL);
    let srgb = |light, blend| Some(Target { pixels: Pixels::Image(region), light, blend, ..small });
    refused(0, &[own], FrameView { color: srgb(Light::Linear, small.blend), ..view }, "holds encoded values");
    let placed = |layout, offset| Pixels::Image(ImageRegion { layout, offset, ..region });
    let undefined = placed(vk::ImageLayout::UNDEFINED, [0; 2]);
    refused(
        0,
        &[own],
        FrameView { color: to(undefined), ..view },
        "in layout UNDEFINED, expected one of [GENERAL, TRANSFER_DST",
    );
    let read = placed(vk::ImageLayout::TRANSFER_SRC_OPTIMAL, [0; 2]);
    refused(0, &[own], FrameView { color: to(read), ..view }, "layout TRANSFER_SRC_OPTIMAL");
    let written = placed(vk::ImageLayout::TRANSFER_DST_OPTIMAL, [0; 2]);
    let over = Some(Target { pixels: written, blend: Blend::Over, ..small });
    refused(0, &[own], FrameView { color: over, ..view }, "expected one of [GENERAL, SHARED_PRESENT_KHR]");
    let outside = placed(vk::ImageLayout::GENERAL, [3, -1]);
    refused(0, &[own], FrameView { color: to(outside), ..view }, "a corner at [3, -1]");
    let other = Gpu::new();
    let foreign = Model::upload(&other, &scene, 0).unwrap();
    refused(0, &[Instance::of(&foreign)], view, "another context");
    let null = Frame { slot: 0, instances: &[own], views: &[view] };
    let said = unsafe { frames.record(vk::CommandBuffer::null(), &null) }.unwrap_err().to_string();
    assert!(said.contains("command buffer that is null"), "{said}");
    let mut elsewhere = other.recorder("elsewhere").unwrap();
    let said = unsafe { frames.record_into(&mut elsewhere, &null) }.unwrap_err().to_string();
    assert!(said.contains("a recorder of another context") && elsewhere.finish().is_empty(), "{said}");
    // Other texels would be misread as depths or numbers.
    let limits = Limits { depth_in: true, depth_out: true, ..Limits::of(&model, 32, 24) };
    let mut deep = Frames::new(&gpu, limits).unwrap();
    let mut refused = |view: FrameView, words: &str| {
        let frame = Frame { slot: 0, instances: &[own], views: &[view] };
        let said = unsafe { deep.record(nothing, &frame) }.unwrap_err().to_string();
        assert!(said.contains(words) && deep.report(0).is_err(), "{said} lacks {words}");
    };
    for format in
        [vk::Format::D16_UNORM, vk::Format::X8_D24_UNORM_PACK32, vk::Format::D24_UNORM_S8_UINT, vk::Format::R32_UINT]
    {
        refused(
            FrameView { depth_in: Some(imaged(format)), ..view },
            "for depths that hide Gaussians, expected one of [D32",
        );
        refused(FrameView { depth_out: Some(imaged(format)), ..view }, "for depths of Gaussians, expected one of [D32");
    }
    refused(FrameView { ids: Some(imaged(vk::Format::R32_SFLOAT)), ..view }, "expected one of [R32_UINT]");
    let nothing_in = |format| {
        Some(Pixels::Image(ImageRegion {
            layout: vk::ImageLayout::UNDEFINED,
            ..ImageRegion::of(some, format, vk::ImageLayout::GENERAL)
        }))
    };
    let depths = nothing_in(vk::Format::D32_SFLOAT);
    refused(FrameView { depth_in: depths, ..view }, "depths that hide Gaussians: an image in layout UNDEFINED");
    refused(FrameView { depth_out: depths, ..view }, "depths of Gaussians: an image in layout UNDEFINED");
    refused(FrameView { ids: nothing_in(vk::Format::R32_UINT), ..view }, "numbers of Gaussians: an image in layout");
    engine.submit(0);
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
        let refusals = [limits.plan(gpu.info()).map(drop), Frames::new(&gpu, limits.clone()).map(drop)];
        for refusal in refusals {
            match refusal {
                Err(Error::Usage(message)) => assert!(message.contains(words), "{message} lacks {words}"),
                other => panic!("{other:?}, expected a refusal that says {words}"),
            }
        }
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
