//! Frames in somebody else's renderer: images, depths, instances, slots, and what is refused.

mod common;
#[path = "common/counting.rs"]
mod counting;
#[path = "common/engine.rs"]
mod engine;
#[path = "common/shared.rs"]
mod shared;

use std::{
    alloc::{GlobalAlloc, Layout, System},
    cell::Cell,
    collections::BTreeSet,
    sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed},
};

use ash::vk::{self, Handle};
use common::Gpu;
use engine::Engine;
use glam::{DMat3, DMat4, DQuat, DVec3, DVec4};
use glint::{
    Error,
    data::{Dataset, DatasetOptions},
    gpu::{
        BorrowedDevice, Buffer, BufferRange, Context, ContextOptions, ImageRegion, Kept, Location, Pixels, Recorder,
        f16,
    },
    pipelines::{
        frames::{
            Blend, DEPTH_FORMATS, DepthForm, Frame, FrameView, Frames, Instance, Light, Limits, Room, Target, Texel,
            Transform,
        },
        model::{self, Model, Upload},
        plan::Held,
        render::{Needs, RenderOptions, Renderer},
        start::first_points,
        views::Views,
    },
    reference::{
        self, Background, Intersections, Options, Params, View,
        blend::blend_before,
        median_depth::{DepthAt, median_depth},
        project::project,
        random_camera, random_scene,
        resolve::{To, depth},
        tiles::{Tiling, for_each_tile},
    },
    scene::{
        Camera, Gaussians, Lobes, Scene, Supplement, from_points,
        layout::{self, BETAS, sh_planes},
    },
    stages::{
        self,
        constants::resolve::{OPAQUE, OVER, PREMULTIPLIED},
    },
};

/// Counts what this thread takes from the heap.
struct Counting;

thread_local! {
    static TAKEN: Cell<u64> = const { Cell::new(0) };
}

unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let _ = TAKEN.try_with(|taken| taken.set(taken.get() + 1));
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static HEAP: Counting = Counting;

const GREY: [f32; 3] = [0.5, 0.25, 0.75];

/// A target that takes a frame's float32 colours.
struct Float(Buffer<u32>);

impl Float {
    fn new(gpu: &Context, pixels: u32) -> Self {
        Float(Buffer::new(gpu, "float", 4 * pixels as usize, Location::Device).unwrap())
    }

    fn target(&self, blend: Blend) -> Target {
        let range = BufferRange { buffer: self.0.raw().handle(), offset: 0 };
        Target { blend, ..Target::new(Pixels::Buffer(range), Texel::Rgba32F) }
    }

    fn pixels(&self) -> Vec<[f32; 4]> {
        let words: Vec<f32> = self.0.download().unwrap().into_iter().map(f32::from_bits).collect();
        words.chunks_exact(4).map(|p| [p[0], p[1], p[2], p[3]]).collect()
    }
}

fn wide(limits: Limits) -> Limits {
    Limits { texel: Texel::Rgba32F, ..limits }
}

/// What the renderer of the command line makes of it: RGB over grey, and transmittance.
fn rendered(gpu: &Context, scene: &Scene, camera: &Camera) -> Vec<[f32; 4]> {
    let views = Views::upload(gpu, &[*camera], &[]).unwrap();
    let model = Model::upload(gpu, scene, 0).unwrap();
    let mut renderer = Renderer::new(gpu, Needs::of(&model), &views, RenderOptions::default()).unwrap();
    let image = renderer.render(&model, &views, 0, GREY).unwrap();
    image.color.chunks_exact(3).zip(image.transmittance).map(|(c, t)| [c[0], c[1], c[2], t]).collect()
}

fn largest_difference(a: &[[f32; 4]], b: &[[f32; 4]]) -> f32 {
    assert_eq!(a.len(), b.len());
    a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

#[test]
fn images_of_every_format_have_what_glint_renders() {
    let gpu = Gpu::new();
    let (scene, camera) = (random_scene(7, 600, 150, 3), random_camera(61, 47));
    let want = rendered(&gpu, &scene, &camera);
    let model = Model::upload(&gpu, &scene, 0).unwrap();
    let mut frames = Frames::new(&gpu, wide(Limits::of(&model, 80, 60))).unwrap();
    let mut engine = Engine::new(&gpu, 1);
    // Larger than the view: the rest must stay as it was.
    let (width, height, offset) = (80, 60, [7, 5]);
    let formats = [
        vk::Format::R32G32B32A32_SFLOAT,
        vk::Format::R16G16B16A16_SFLOAT,
        vk::Format::R8G8B8A8_UNORM,
        vk::Format::B8G8R8A8_UNORM,
        vk::Format::B8G8R8A8_SRGB,
    ];
    for format in formats {
        let texel = Texel::of(format).unwrap();
        let words = texel.words() as usize;
        let mut whole = engine.image(format, width, height);
        engine.write(&whole, [width, height], &vec![0x3C00_3C00; words * (width * height) as usize]);
        let place = ImageRegion { offset, ..whole };
        let color = Some(Target { blend: Blend::Opaque(GREY), ..Target::new(Pixels::Image(place), texel) });
        let view = FrameView { color, ..FrameView::new(camera) };
        let frame = Frame { slot: 0, instances: &[Instance::of(&model)], views: &[view] };
        engine.run(|commands| unsafe { frames.record(commands, &frame) }.unwrap());
        assert_eq!(frames.report(0).unwrap().needed, None);
        let got = engine.read(&mut whole, [width, height], texel.words());
        let mut inside = 0;
        for (at, word) in got.chunks_exact(words).enumerate() {
            let (x, y) = (at as i32 % width as i32 - offset[0], at as i32 / width as i32 - offset[1]);
            if !((0..61).contains(&x) && (0..47).contains(&y)) {
                assert!(word.iter().all(|w| *w == 0x3C00_3C00), "{format:?} {x} {y}");
                continue;
            }
            inside += 1;
            let bytes: Vec<u8> = word.iter().flat_map(|w| w.to_le_bytes()).collect();
            let want = want[(y * 61 + x) as usize];
            for c in 0..3 {
                match texel {
                    Texel::Rgba32F => assert_eq!(f32::from_bits(word[c]), want[c]),
                    // The nearest half, or where the rounding of a kernel is another's, the next.
                    Texel::Rgba16F => {
                        let got = u16::from_le_bytes([bytes[2 * c], bytes[2 * c + 1]]);
                        assert!(got.abs_diff(f16::from_f32(want[c]).to_bits()) <= 1, "{got} {}", want[c]);
                    }
                    Texel::Rgba8 | Texel::Bgra8 => {
                        let got = bytes[if texel == Texel::Bgra8 { 2 - c } else { c }];
                        // Half a step, and the rounding of 255 times a float32.
                        let off = f32::from(got) / 255.0 - want[c].clamp(0.0, 1.0);
                        assert!(off.abs() <= 0.5 / 255.0 + 1e-6, "{got} {}", want[c]);
                    }
                }
            }
        }
        assert_eq!(inside, 61 * 47);
    }
    assert_eq!(Texel::of(vk::Format::R8_UNORM), None);
}

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
    // Where there is nothing, where the copy could not be made, and where it would mean something else.
    let small = Target { exposure: 1.0, ..small };
    let to = |pixels| Some(Target { pixels, ..small });
    refused(0, &[own], FrameView { color: to(imaged(vk::Format::R8G8B8A8_UNORM)), ..view }, "an image that is null");
    let nowhere = Pixels::Buffer(BufferRange { buffer: vk::Buffer::null(), offset: 0 });
    refused(0, &[own], FrameView { color: to(nowhere), ..view }, "a buffer that is null");
    // No image's: nothing is recorded with it.
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
    // What has other texels than depths and numbers would be read as such.
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
        // What 32 bits do not count would be taken for less.
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
    // What can be counted, and no device has, is refused by the device; the plan says how much it would be.
    let most =
        Limits { gaussians: u32::MAX, instances: u32::MAX, width: u32::MAX, height: 1, texel: Texel::Rgba8, ..fits };
    let plan = most.plan(gpu.info()).unwrap();
    let of = |name| plan.0.iter().find(|buffer| buffer.name == name).unwrap();
    assert_eq!((of("views").elements, of("target").bytes()), (u32::MAX.into(), 4 * u64::from(u32::MAX)));
    assert!(matches!(Frames::new(&gpu, most), Err(Error::Gpu(_))));
    let rooms = model::Room { base: u32::MAX, supplement: u32::MAX, ..Default::default() };
    assert!(matches!(Model::upload_around(&gpu, DVec3::ZERO, &scene, rooms), Err(Error::Usage(_))));
}

/// The twin's image of what is before `farthest`, and the margin of each pixel's decisions.
fn twin(scene: &Scene, view: &View, farthest: impl Fn(usize) -> f64 + Sync) -> Vec<([f64; 4], f64)> {
    twin_of(&Params::from_scene(scene).unwrap(), view, farthest)
}

fn twin_of(params: &Params, view: &View, farthest: impl Fn(usize) -> f64 + Sync) -> Vec<([f64; 4], f64)> {
    let options = Options { active_degree: params.sh_degree, ..Default::default() };
    let projected = project(params, view, &options);
    let isects = Intersections::new(&projected, Tiling::new(view.width, view.height, &options));
    let black = Background::Color([0.0; 3]);
    let blended = blend_before(&projected.splats, &isects, black, 0.5, farthest);
    blended.image.into_iter().zip(&blended.margins).map(|(p, m)| (p, m.image())).collect()
}

/// A decision within this of its threshold may fall otherwise in float32: a thousand times its rounding, as sums of a hundred terms and
/// differences of coordinates take away two or three digits.
const NEAR: f64 = 1e-4;

/// The far plane of projections that have one: nearer than a third of the Gaussians.
const FAR: f64 = 7.0;

/// Every kind of projection, of a near plane at 0.2.
const FORMS: [(DepthForm, &str); 4] = [
    (DepthForm { a: 0.0, b: 0.2 }, "reversed, infinite"),
    (DepthForm { a: -0.2 / (FAR - 0.2), b: 0.2 * FAR / (FAR - 0.2) }, "reversed"),
    (DepthForm { a: 1.0, b: -0.2 }, "infinite"),
    (DepthForm { a: FAR / (FAR - 0.2), b: -0.2 * FAR / (FAR - 0.2) }, "standard"),
];

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
    // A tilted quad from 1 to 6 units, in the left two thirds; behind the rest is nothing.
    let quad = |pixel: usize| match pixel % 53 < 35 {
        true => Some(1.0 + 5.0 * (pixel / 53) as f64 / 41.0),
        false => None,
    };
    // Gaussians beyond the far plane are drawn, where nothing is before them.
    let beyond = twin(&scene, &view, |_| FAR);
    let all = twin(&scene, &view, |_| f64::INFINITY);
    assert!(all.iter().zip(&beyond).filter(|(a, b)| (a.0[3] - b.0[3]).abs() > 0.05).count() > 100);
    for (form, projection) in FORMS {
        let depth = |pixel: usize| quad(pixel).map_or(form.empty(), |z| (form.a + form.b / z) as f32);
        let depths: Vec<u32> = (0..pixels).map(|p| depth(p).to_bits()).collect();
        // What float32 leaves of the quad.
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
            let frame = Frame { slot: 0, instances: &[Instance::of(&model)], views: &[seen] };
            engine.run(|commands| unsafe { frames.record(commands, &frame) }.unwrap());
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
    // The quad hides something, or all this would show nothing.
    let some = twin(&scene, &view, |p| quad(p).unwrap_or(1e9));
    assert!(all.iter().zip(&some).filter(|(a, b)| (a.0[3] - b.0[3]).abs() > 0.05).count() > pixels / 4);
    // Made for depths, and none are there: as if nothing hid anything.
    let seen = FrameView { color: Some(float.target(Blend::Opaque(GREY))), ..FrameView::new(camera) };
    let frame = Frame { slot: 0, instances: &[Instance::of(&model)], views: &[seen] };
    engine.run(|commands| unsafe { frames.record(commands, &frame) }.unwrap());
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
    let mut draw = |depth: ImageRegion, ids| {
        let view = FrameView {
            depth_form: form,
            depth_out: Some(Pixels::Image(depth)),
            ids: Some(ids),
            ..FrameView::new(camera)
        };
        let frame = Frame { slot: 0, instances: &[Instance::of(&model)], views: &[view] };
        engine.run(|commands| unsafe { frames.record(commands, &frame) }.unwrap());
    };
    // An image of every format has the same bits, and so has a buffer.
    let in_buffer = Pixels::Buffer(BufferRange { buffer: ids.raw().handle(), offset: 0 });
    for (depth, ids) in images.iter().zip([in_buffer, Pixels::Image(image), in_buffer]) {
        draw(*depth, ids);
    }
    let ids = ids.download().unwrap();
    assert_eq!(engine.read(&mut image, [53, 41], 1), ids);
    let [got, others @ ..] = images.each_mut().map(|image| engine.read(image, [53, 41], 1));
    assert!(others.iter().all(|other| *other == got));
    // Which Gaussian it is the twin says too, and the depth is of that one.
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
                // As for depths in `verify`: a flat Gaussian's ray has few digits.
                let (want, off) = (depth(scale * z, [form.a, form.b]), 1e-3 * (form.b / (scale * z)).abs());
                assert!((got - want).abs() < off, "{what}, scale {scale}, pixel {pixel}: {got} {want}");
                [f64::from(form.empty()), 1.0 - f64::from(form.empty())].iter().zip(&mut beyond).for_each(
                    |(end, count)| {
                        *count += usize::from(got == *end);
                    },
                );
            }
        }
        assert!(seen > 500 && nothing > 100, "{seen} {nothing}");
        beyond
    };
    check(&got, &ids, form, 1.0, "images");
    // Where the scene stands turned, moved and scaled, and the camera with it, the same is seen as many times as far away.
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
        let frame = Frame { slot: 0, instances: &instances, views: &[view] };
        engine.run(|commands| unsafe { frames.record(commands, &frame) }.unwrap());
        check(&depth_to.download().unwrap(), &ids_to.download().unwrap(), form, scale, what)
    };
    for (form, projection) in FORMS {
        for scale in [0.6, 1.0, 1.7] {
            drawn(form, scale, projection);
        }
    }
    // A buffer holds no depth beyond its ends: Gaussians beyond the far plane have that plane's, and those before the near plane, where
    // glint's own is nearer, have the near one's.
    let (near, far) = (1.0, 3.0);
    for form in [DepthForm::standard(near, far), DepthForm { a: -near / (far - near), b: near * far / (far - near) }] {
        let beyond = drawn(form, 1.0, "a near far plane");
        assert!(beyond.iter().all(|&count| count > 20), "{beyond:?}");
    }
}

/// A camera of the world that sees a model which stands in it as `camera` sees the model alone.
fn gone_with(camera: &Camera, transform: &Transform) -> Camera {
    let rotation = camera.rotation * DMat3::from_quat(transform.rotation).transpose();
    let translation = transform.scale * camera.translation - rotation * transform.translation;
    Camera { rotation, translation, ..*camera }
}

/// Moves all Gaussians of a scene of degree 0: rotating harmonics is more than a test should do.
fn move_all(params: &mut Params, t: &Transform) {
    let stride = params.stride;
    for i in 0..params.count {
        let mean = t.translation + t.scale * (t.rotation * params.mean(i));
        (0..3).for_each(|c| params.geometry[(layout::MEAN + c) * stride + i] = mean[c]);
        (0..3).for_each(|c| params.geometry[(layout::LOG_SCALE + c) * stride + i] += t.scale.ln());
        let [w, x, y, z] = params.quat(i);
        let q = t.rotation * DQuat::from_xyzw(x, y, z, w).normalize();
        [q.w, q.x, q.y, q.z]
            .into_iter()
            .enumerate()
            .for_each(|(c, v)| params.geometry[(layout::QUAT + c) * stride + i] = v);
        if let Some((direction, ..)) = params.lobe(i) {
            let (direction, j) = (t.rotation * direction, i - params.lobe_first);
            (0..3).for_each(|c| params.lobes[(layout::LOBE_DIRECTION + c) * params.lobe_stride + j] = direction[c]);
        }
    }
}

/// The first or the second half of the base, and of the supplement.
fn half_of(scene: &Scene, second: bool) -> Scene {
    let pick = |n: usize| if second { n / 2..n } else { 0..n / 2 };
    let gaussians = |g: &Gaussians| {
        let (r, k) = (pick(g.len()), g.sh_coefficients());
        Gaussians {
            means: g.means[r.clone()].to_vec(),
            log_scales: g.log_scales[r.clone()].to_vec(),
            quats: g.quats[r.clone()].to_vec(),
            opacities: g.opacities[r.clone()].to_vec(),
            sh: g.sh[r.start * k..r.end * k].to_vec(),
            sh_degree: g.sh_degree,
        }
    };
    let supplement = scene.supplement.as_ref().map(|s| {
        let r = pick(s.gaussians.len());
        let lobes = Lobes {
            directions: s.lobes.directions[r.clone()].to_vec(),
            widths: s.lobes.widths[r.clone()].to_vec(),
            sharpness: s.lobes.sharpness[r].to_vec(),
        };
        Supplement { gaussians: gaussians(&s.gaussians), lobes }
    });
    Scene { base: gaussians(&scene.base), supplement }
}

#[test]
fn two_halves_of_a_scene_that_stand_where_it_stands_are_the_scene() {
    let gpu = Gpu::new();
    let camera = random_camera(61, 47);
    let scene = random_scene(12, 900, 300, 0);
    let transform = Transform {
        rotation: DQuat::from_axis_angle(DVec3::new(1.0, -2.0, 0.5).normalize(), 1.1),
        scale: 1.7,
        translation: DVec3::new(0.4, -0.3, 0.2),
    };
    // The camera goes with it, so that the same is seen.
    let moved_camera = gone_with(&camera, &transform);
    let mut world = Params::from_scene(&scene).unwrap();
    move_all(&mut world, &transform);
    let near = 0.2 * transform.scale;
    let want = twin_of(&world, &View { near, ..View::from_camera(&moved_camera) }.rounded(), |_| f64::INFINITY);
    let halves = [false, true].map(|second| {
        // Models that count from elsewhere stand where they stand all the same.
        let origin = if second { DVec3::new(3.0, 1.0, -2.0) } else { DVec3::ZERO };
        Model::upload_around(&gpu, origin, &half_of(&scene, second), model::Room::default()).unwrap()
    });
    let limits = Limits {
        instances: 2,
        gaussians: halves.iter().map(Model::capacity).sum(),
        depth_out: true,
        ..wide(Limits::of(&halves[0], 61, 47))
    };
    let mut frames = Frames::new(&gpu, limits).unwrap();
    let engine = Engine::new(&gpu, 1);
    let float = Float::new(&gpu, camera.pixels());
    let ids = Buffer::<u32>::zeroed(&gpu, "ids", camera.pixels() as usize).unwrap();
    let view = FrameView {
        near,
        color: Some(float.target(Blend::Premultiplied)),
        ids: Some(Pixels::Buffer(BufferRange { buffer: ids.raw().handle(), offset: 0 })),
        ..FrameView::new(moved_camera)
    };
    let instances = [0, 1].map(|k| Instance { transform, ..Instance::of(&halves[k]) });
    engine.run(|commands| {
        unsafe { frames.record(commands, &Frame { slot: 0, instances: &instances, views: &[view] }) }.unwrap()
    });
    let (mut calm, mut off, mut squares) = (0, 0f64, 0f64);
    for (got, (want, margin)) in float.pixels().iter().zip(&want) {
        if *margin > NEAR {
            calm += 1;
            for c in 0..3 {
                let difference = (f64::from(got[c]) - want[c]).abs();
                (off, squares) = (off.max(difference), squares + difference * difference);
            }
        }
    }
    // A coordinate of 10 units in float32 is off by 1e-6 of a pixel of 0.03 units near by, where an edge's slope is 1 for a pixel; on the
    // whole a tenth of it.
    assert!(calm > 2000 && off < 4e-5 && (squares / calm as f64).sqrt() < 4e-6, "{calm} {off:e} {squares:e}");
    // Where both count from one origin, they are the scene to the last bit.
    let (whole, parts) = (
        Model::upload(&gpu, &scene, 0).unwrap(),
        [false, true].map(|b| Model::upload(&gpu, &half_of(&scene, b), 0).unwrap()),
    );
    let mut image = |models: &[&Model]| {
        let instances: Vec<_> = models.iter().map(|model| Instance { transform, ..Instance::of(model) }).collect();
        let frame = Frame { slot: 0, instances: &instances, views: &[view] };
        engine.run(|commands| unsafe { frames.record(commands, &frame) }.unwrap());
        float.pixels()
    };
    // Equal depths would fall in another order: the supplement's halves lie between the base's.
    assert_eq!(image(&[&whole]), image(&[&parts[0], &parts[1]]));
    let ids = ids.download().unwrap();
    let of = |k: usize| ids.iter().filter(|&&id| id != u32::MAX && (id >= halves[0].capacity()) == (k == 1)).count();
    assert!(of(0) > 100 && of(1) > 100 && ids.iter().all(|&id| id == u32::MAX || id < 1200), "{} {}", of(0), of(1));
    // Without any there is the background alone.
    let empty = FrameView { color: Some(float.target(Blend::Opaque(GREY))), ..view };
    engine.run(|commands| {
        unsafe { frames.record(commands, &Frame { slot: 0, instances: &[], views: &[empty] }) }.unwrap()
    });
    assert!(float.pixels().iter().all(|p| *p == [GREY[0], GREY[1], GREY[2], 1.0]));
    assert!(ids.len() == 61 * 47);
}

#[test]
fn colours_are_put_over_what_is_there_and_made_linear_as_the_twin_has_it() {
    let gpu = Gpu::new();
    let (scene, camera) = (random_scene(3, 500, 100, 1), random_camera(40, 30));
    let plain = {
        // Over black, as the frames' own.
        let model = Model::upload(&gpu, &scene, 0).unwrap();
        let views = Views::upload(&gpu, &[camera], &[]).unwrap();
        let mut renderer = Renderer::new(&gpu, Needs::of(&model), &views, RenderOptions::default()).unwrap();
        renderer.render(&model, &views, 0, [0.0; 3]).unwrap()
    };
    let model = Model::upload(&gpu, &scene, 0).unwrap();
    let mut frames = Frames::new(&gpu, wide(Limits::of(&model, 40, 30))).unwrap();
    let engine = Engine::new(&gpu, 1);
    let float = Float::new(&gpu, camera.pixels());
    let below = |p: usize| [0.1 + 0.0005 * p as f32, 0.9 - 0.0005 * p as f32, 1.5, 0.5];
    for (blend, number) in [(Blend::Opaque(GREY), OPAQUE), (Blend::Premultiplied, PREMULTIPLIED), (Blend::Over, OVER)] {
        for linear in [false, true] {
            for exposure in [1.0, 2.5] {
                let words: Vec<u32> = (0..1200).flat_map(|p| below(p).map(f32::to_bits)).collect();
                float.0.upload(0, &words).unwrap();
                let light = if linear { Light::Linear } else { Light::Encoded };
                let color = Some(Target { light, exposure, ..float.target(blend) });
                let view = FrameView { color, ..FrameView::new(camera) };
                let frame = Frame { slot: 0, instances: &[Instance::of(&model)], views: &[view] };
                engine.run(|commands| unsafe { frames.record(commands, &frame) }.unwrap());
                let to = To { blend: number, linear, exposure: exposure.into(), background: GREY.map(f64::from) };
                for (p, got) in float.pixels().iter().enumerate() {
                    // Over black; an opaque target's own background does not become brighter.
                    let t = f64::from(plain.transmittance[p]);
                    let behind = |c: usize| if to.whole() { t * f64::from(GREY[c]) } else { 0.0 };
                    let colour = [0, 1, 2].map(|c| f64::from(plain.color[3 * p + c]) + behind(c));
                    let rendered = [colour[0], colour[1], colour[2], t];
                    let want = to.resolve(rendered, below(p).map(f64::from));
                    for k in 0..4 {
                        // A power in float32 is good to 1e-5 of its value, which exposure and light make up to 6.
                        let off = (f64::from(got[k]) - want[k]).abs();
                        assert!(off < 2e-5 * want[k].max(1.0), "{blend:?} {linear} {exposure} {p}: {got:?} {want:?}");
                    }
                }
            }
        }
    }
}

/// Base and supplement have degrees of their own, and pipelines, bytes and images are those of each.
#[test]
fn base_and_supplement_are_drawn_with_the_bands_that_each_has() {
    let gpu = Gpu::new();
    let camera = random_camera(61, 47);
    let view = View::from_camera(&camera).rounded();
    let betas = [false, true].map(|half| ([BETAS; 2], half));
    for ([base, lobed], half) in
        [([3, 0], false), ([3, 0], true), ([0, 2], false), ([1, 3], true)].into_iter().chain(betas)
    {
        let mut scene = random_scene(5, 400, 300, base.max(3));
        scene.base = scene.base.with_degree(base);
        scene.supplement = scene.supplement.map(|s| Supplement { gaussians: s.gaussians.with_degree(lobed), ..s });
        let model =
            Model::upload_around(&gpu, DVec3::ZERO, &scene, model::Room { half, ..Default::default() }).unwrap();
        let words = |degree: u32| if half { sh_planes(degree).div_ceil(2) } else { sh_planes(degree) };
        let planes = model::Segment::ALL.map(|segment| model.part(segment).sh.planes());
        assert_eq!(planes, [base, lobed].map(words));
        // What the device was given, halves too.
        let params = Params::from_scene(&model.download().unwrap()).unwrap();
        for degree in [model.sh_degree, 1, 0] {
            let options = Options { active_degree: degree, ..Default::default() };
            let projected = project(&params, &view, &options);
            let isects = Intersections::new(&projected, Tiling::new(61, 47, &options));
            let want = blend_before(&projected.splats, &isects, Background::Color([0.0; 3]), 0.5, |_| f64::INFINITY);
            let mut frames = Frames::new(&gpu, wide(Limits::for_needs(Needs::at(&model, [degree]), 61, 47))).unwrap();
            let (engine, float) = (Engine::new(&gpu, 1), Float::new(&gpu, camera.pixels()));
            let seen = FrameView { color: Some(float.target(Blend::Premultiplied)), ..FrameView::new(camera) };
            let instances = [Instance { degree, ..Instance::of(&model) }];
            let frame = Frame { slot: 0, instances: &instances, views: &[seen] };
            engine.run(|commands| unsafe { frames.record(commands, &frame) }.unwrap());
            let mut compared = 0;
            for ((got, want), margin) in float.pixels().iter().zip(&want.image).zip(&want.margins) {
                if margin.image() > NEAR {
                    compared += 1;
                    // float32's 6e-8 of colours up to 4, in sums of some hundred terms.
                    (0..3).for_each(|c| assert!((f64::from(got[c]) - want[c]).abs() < 1e-4, "{got:?} {want:?}"));
                }
            }
            assert!(compared > 2500, "{compared}");
        }
    }
}

#[test]
fn a_model_of_half_width_takes_144_bytes_and_looks_the_same() {
    let gpu = Gpu::new();
    let (scene, camera) = (random_scene(5, 800, 200, 3), random_camera(61, 47));
    let want = rendered(&gpu, &scene, &camera);
    let half = model::Room { half: true, ..Default::default() };
    let model = Model::upload_around(&gpu, DVec3::ZERO, &scene, half).unwrap();
    let bytes = |part: &model::Part| {
        let planes = [&part.geometry, &part.sh, &part.lobes].into_iter().filter(|planes| planes.planes() > 0);
        planes.map(|planes| 16 * planes.page(0).len() / part.pages[0].capacity as usize).sum::<usize>()
    };
    assert_eq!(bytes(model.part(model::Segment::Base)), 144);
    assert_eq!(bytes(model.part(model::Segment::Supplement)), 176);
    let mut frames = Frames::new(&gpu, wide(Limits::of(&model, 61, 47))).unwrap();
    let engine = Engine::new(&gpu, 1);
    let float = Float::new(&gpu, camera.pixels());
    let view = FrameView { color: Some(float.target(Blend::Opaque(GREY))), ..FrameView::new(camera) };
    let frame = Frame { slot: 0, instances: &[Instance::of(&model)], views: &[view] };
    engine.run(|commands| unsafe { frames.record(commands, &frame) }.unwrap());
    let got: Vec<[f32; 4]> = float.pixels().iter().zip(&want).map(|(p, w)| [p[0], p[1], p[2], w[3]]).collect();
    let off = largest_difference(&got, &want);
    // A coefficient of 2 is off by 2^-11 of itself at most: a colour by half a step of 8 bits, at most.
    assert!(off > 0.0 && off < 0.5 / 255.0, "{off}");
    // What comes back is what a half can hold.
    let back = model.download().unwrap();
    let close = |a: &[f32; 3], b: &[f32; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= b.abs() / 2048.0 + 1e-7);
    assert!(back.base.sh.iter().zip(&scene.base.sh).all(|(a, b)| close(a, b)));
    assert_eq!((&back.base.means, &back.base.opacities), (&scene.base.means, &scene.base.opacities));
}

/// The device as an engine would lend it, with counters before its functions.
fn lent(gpu: &Gpu) -> Context {
    let entry = unsafe { ash::Entry::load() }.unwrap();
    let (instance, device) = counting::counted(&entry, gpu.instance(), gpu.device());
    let lent = BorrowedDevice {
        physical_device: gpu.physical_device(),
        queue_family: gpu.queue_family(),
        queue: unsafe { device.get_device_queue(gpu.queue_family(), 0) },
        optional: gpu.features().clone(),
        pipeline_cache: vk::PipelineCache::null(),
        queue_lock: None,
        labels: false,
        memory_budget: None,
        entry,
        instance,
        device,
    };
    unsafe { Context::borrow(lent) }.unwrap()
}

#[test]
fn a_thousand_frames_submit_allocate_and_wait_for_nothing_and_leave_nothing() {
    let owner = Gpu::new();
    let gpu = lent(&owner);
    let scene = random_scene(21, 300, 80, 2);
    let model = Model::upload(&gpu, &scene, 0).unwrap();
    let limits = Limits { in_flight: 3, views: 2, timings: true, depth_in: true, ..wide(Limits::of(&model, 48, 40)) };
    let mut frames = Frames::new(&gpu, limits.clone()).unwrap();
    let mut engine = Engine::new(&gpu, 3);
    // Of each slot and eye a buffer, and an image for every second frame, in which a wall hides what is farther than 3 units.
    let buffers = [0, 1, 2].map(|_| [Float::new(&gpu, 48 * 40), Float::new(&gpu, 48 * 40)]);
    let mut images = [0, 1, 2].map(|_| [0, 1].map(|_| engine.image(vk::Format::R8G8B8A8_UNORM, 48, 40)));
    let walls = Buffer::from_slice(&gpu, "wall", &[(0.2f32 / 3.0).to_bits(); 48 * 40]).unwrap();
    let wall = BufferRange { buffer: walls.raw().handle(), offset: 0 };
    let view = |n: u32, camera: Camera, buffer: &Float, image: ImageRegion| match n % 2 {
        0 => FrameView { color: Some(buffer.target(Blend::Opaque(GREY))), ..FrameView::new(camera) },
        _ => FrameView {
            color: Some(Target { blend: Blend::Premultiplied, ..Target::new(Pixels::Image(image), Texel::Rgba8) }),
            depth_in: Some(Pixels::Buffer(wall)),
            ..FrameView::new(camera)
        },
    };
    let camera = |n: u32| {
        let mut camera = random_camera(16 + n % 33, 16 + n * 7 % 25);
        camera.translation.z += f64::from(n % 17) * 0.05;
        camera.rotation = DMat3::from_rotation_y(f64::from(n % 29) * 0.01) * camera.rotation;
        camera
    };
    // The same alone, with nothing else on its way.
    let mut calm = Frames::new(&gpu, Limits { in_flight: 1, ..limits }).unwrap();
    let mut beside = Engine::new(&gpu, 1);
    let mut alone = beside.image(vk::Format::R8G8B8A8_UNORM, 48, 40);
    let (mut checked, mut hidden) = (0, 0);
    let (mut before, mut heap) = (gpu.counters(), 0);
    for n in 0..1000 {
        let slot = n % 3;
        let commands = engine.begin(slot);
        let eyes = [camera(n), camera(n + 500)];
        // The slot's last frame has run: some of them are looked at.
        if n >= 3 && n % 167 == 4 {
            for eye in 0..2 {
                let seen = camera(n - 3 + 500 * eye as u32);
                let size = [seen.width, seen.height];
                if n % 2 == 1 {
                    let want = rendered(&gpu, &scene, &seen);
                    let got = buffers[slot as usize][eye].pixels();
                    assert!(got.iter().zip(&want).all(|(g, w)| g[..3] == w[..3]), "frame {n}, eye {eye}");
                } else {
                    let mut draw = |view| {
                        let frame = Frame { slot: 0, instances: &[Instance::of(&model)], views: &[view] };
                        beside.run(|commands| unsafe { calm.record(commands, &frame) }.unwrap());
                    };
                    draw(view(1, seen, &buffers[0][0], alone));
                    let want = beside.read(&mut alone, size, 1);
                    assert_eq!(beside.read(&mut images[slot as usize][eye], size, 1), want, "frame {n}, eye {eye}");
                    draw(FrameView { depth_in: None, ..view(1, seen, &buffers[0][0], alone) });
                    hidden += usize::from(beside.read(&mut alone, size, 1) != want);
                }
                checked += 1;
            }
            assert_eq!(frames.report(slot).unwrap().needed, None);
            let times = frames.times(slot).unwrap();
            let blends = times.iter().filter(|time| time.name == "blend").count();
            assert_eq!(blends, if gpu.info().timestamp_period > 0.0 { 2 } else { 0 });
            before = gpu.counters();
        }
        let of = |eye: usize| view(n, eyes[eye], &buffers[slot as usize][eye], images[slot as usize][eye]);
        let (instances, views) = ([Instance::of(&model)], [of(0), of(1)]);
        let taken = TAKEN.get();
        unsafe { frames.record(commands, &Frame { slot, instances: &instances, views: &views }) }.unwrap();
        heap += TAKEN.get() - taken;
        assert_eq!(gpu.counters(), before);
        engine.submit(slot);
    }
    engine.finish();
    assert_eq!((heap, checked, hidden), (0, 12, 6));
    drop((frames, calm, model, engine, beside, buffers, walls));
    drop(gpu);
    for (function, made, gone) in counting::counts() {
        assert!(made > 0 && made == gone, "{function:?}: {made} were made, {gone} destroyed");
    }
}

#[test]
fn a_list_of_instances_grows_and_takes_nothing_from_the_heap() {
    let gpu = Gpu::new();
    let models: Vec<Model> = (0..40)
        .map(|seed| Model::upload(&gpu, &random_scene(seed, 30, if seed % 2 == 0 { 10 } else { 0 }, 1), 0).unwrap())
        .collect();
    let limits = Limits {
        instances: 40,
        gaussians: models.iter().map(Model::capacity).sum(),
        depth_out: true,
        ..wide(Limits::of(&models[0], 32, 24))
    };
    let mut frames = Frames::new(&gpu, limits).unwrap();
    let (engine, float) = (Engine::new(&gpu, 1), Float::new(&gpu, 32 * 24));
    let ids = Buffer::<u32>::zeroed(&gpu, "ids", 32 * 24).unwrap();
    let view = FrameView {
        color: Some(float.target(Blend::Premultiplied)),
        ids: Some(Pixels::Buffer(BufferRange { buffer: ids.raw().handle(), offset: 0 })),
        ..FrameView::new(random_camera(32, 24))
    };
    for count in [1, 2, 7, 20, 40, 3] {
        let instances: Vec<_> = models[..count].iter().map(Instance::of).collect();
        engine.run(|commands| {
            let taken = TAKEN.get();
            unsafe { frames.record(commands, &Frame { slot: 0, instances: &instances, views: &[view] }) }.unwrap();
            assert_eq!(TAKEN.get() - taken, 0, "{count} instances");
        });
    }
}

#[test]
fn what_overflows_says_so_shows_what_is_near_and_finds_room_in_flight() {
    let gpu = Gpu::new();
    let (scene, camera) = (random_scene(4, 800, 0, 0), random_camera(64, 48));
    let want = rendered(&gpu, &scene, &camera);
    let model = Model::upload(&gpu, &scene, 0).unwrap();
    let limits = Limits { intersections: Room::Intersections(300), in_flight: 2, ..wide(Limits::of(&model, 64, 48)) };
    let mut frames = Frames::new(&gpu, limits.clone()).unwrap();
    assert_eq!(frames.capacity(), 300);
    let engine = Engine::new(&gpu, 2);
    let targets = [0, 1].map(|_| Float::new(&gpu, 64 * 48));
    let record = |frames: &mut Frames, slot: u32| {
        let color = Some(targets[slot as usize].target(Blend::Opaque(GREY)));
        let view = FrameView { color, ..FrameView::new(camera) };
        let commands = engine.begin(slot);
        let frame = Frame { slot, instances: &[Instance::of(&model)], views: &[view] };
        unsafe { frames.record(commands, &frame) }.unwrap();
        engine.submit(slot);
    };
    record(&mut frames, 0);
    engine.finish();
    let report = frames.report(0).unwrap();
    let needed = report.needed.expect("300 intersections are too few");
    assert!(needed > 1000 && report.intersections == 300 && report.visible > 100, "{report:?}");
    // In the order of depth Gaussians take as many places as they touch tiles. The last that finds room may find it for some of its
    // tiles only; of what comes before, every pixel is the twin's of these alone, and of what comes after there is nothing.
    let tile = limits.policy.tile(gpu.info());
    let options = Options { tile_width: tile.width, tile_height: tile.height, ..Default::default() };
    let view = View::from_camera(&camera).rounded();
    let mut near = project(&Params::from_scene(&scene).unwrap(), &view, &options);
    let mut order: Vec<usize> = (0..near.depths.len()).filter(|&i| near.tile_counts[i] > 0).collect();
    order.sort_by(|&a, &b| near.depths[a].total_cmp(&near.depths[b]));
    let tiling = Tiling::new(64, 48, &options);
    let (mut room, mut in_part, mut missing) = (300, vec![false; tiling.count()], 0);
    for i in order {
        let takes = near.tile_counts[i];
        if takes <= room {
            room -= takes;
            continue;
        }
        if room > 0 {
            for_each_tile(&near.splats[i], &tiling, |tile| in_part[tile as usize] = true);
        }
        (room, missing) = (0, missing + 1);
        (near.splats[i], near.depths[i], near.tile_counts[i]) = (Default::default(), f64::INFINITY, 0);
    }
    let grey = Background::Color(GREY.map(f64::from));
    let prefix = blend_before(&near.splats, &Intersections::new(&near, tiling), grey, 0.5, |_| f64::INFINITY);
    let (mut calm, mut changed) = (0, 0);
    for (pixel, got) in targets[0].pixels().iter().enumerate() {
        let tile = tiling.tile_of(pixel as u32 % 64, pixel as u32 / 64);
        if !in_part[tile as usize] && prefix.margins[pixel].image() > NEAR {
            calm += 1;
            let far = (0..3).any(|c| (f64::from(want[pixel][c]) - prefix.image[pixel][c]).abs() > 0.01);
            changed += usize::from(far);
            for c in 0..3 {
                let off = (f64::from(got[c]) - prefix.image[pixel][c]).abs();
                assert!(off < 1e-5, "{pixel}: {got:?} {:?}", prefix.image[pixel]);
            }
        }
    }
    assert!(missing > 100 && calm > 2000 && changed > 500, "{missing} {calm} {changed}");
    // The frame in slot 0 is still on its way when room is made for that in slot 1.
    record(&mut frames, 0);
    frames.reserve(needed).unwrap();
    assert!(frames.capacity() >= needed);
    record(&mut frames, 1);
    engine.finish();
    assert_eq!((frames.report(0).unwrap().needed, frames.report(1).unwrap().needed), (Some(needed), None));
    assert!(targets[1].pixels().iter().zip(&want).all(|(g, w)| g[..3] == w[..3]));
    let plan = limits.plan(gpu.info()).unwrap().bytes();
    let more = Limits { intersections: Room::Bytes(1 << 20), ..limits }.plan(gpu.info()).unwrap().bytes();
    assert!(more > plan + (900 << 10) && more < plan + (1200 << 10), "{plan} {more}");
}

/// A quarter more is made room for, so that it seldom is: not where only what is needed fits.
#[test]
fn room_that_fits_is_made_where_a_quarter_more_would_not_fit() {
    let scene = random_scene(4, 100, 0, 0);
    let made = |budget: Option<u64>, intersections| {
        let gpu = Gpu::with(ContextOptions { memory_budget: budget, ..ContextOptions::from_env() });
        let model = Model::upload(&gpu, &scene, 0).unwrap();
        let frames = Frames::new(&gpu, Limits { intersections, ..Limits::of(&model, 16, 16) }).unwrap();
        (gpu, model, frames)
    };
    // Of four lists of 5 MB each becomes one of 10 MB, and with a quarter more 12.5 MB: while the last is made there are 35 MB and that, or
    // 42.5 MB and that.
    let (gpu, _model, mut frames) = made(None, Room::Intersections(1_250_000));
    let before = gpu.memory().taken;
    frames.reserve(2_500_000).unwrap();
    assert_eq!(frames.capacity(), 3_125_000);
    drop(frames);
    let (gpu, _model, mut frames) = made(Some(before + 26_000_000), Room::Intersections(1_250_000));
    frames.reserve(2_500_000).unwrap();
    assert_eq!((frames.capacity(), gpu.memory().taken <= gpu.memory().budget), (2_500_000, true));
    assert!(frames.reserve(3_500_000).is_err());
    // An error leaves what there was.
    assert_eq!(frames.capacity(), 2_500_000);
    drop((frames, _model, gpu));
    // What a device binds at once ends it too. On a CPU device pages that nobody touches take no memory.
    let (gpu, _model, mut frames) = made(None, Room::Intersections(1000));
    if gpu.info().is_cpu && gpu.info().max_storage_bytes <= 128 << 20 {
        let most = (gpu.info().max_storage_bytes / 4) as u32;
        frames.reserve(most / 10 * 9).unwrap();
        assert_eq!(frames.capacity(), most);
        assert!(frames.reserve(most + 1).is_err());
        // The usual room for 2.5 million Gaussians at 3840 × 2160 would be 35 million.
        let large = Limits { gaussians: 2_500_000, width: 3840, height: 2160, ..frames.limits().clone() };
        for intersections in [Room::Usual, Room::Bytes(1 << 40)] {
            let plan = Limits { intersections, ..large.clone() }.plan(gpu.info()).unwrap();
            let lists = plan.0.iter().filter(|buffer| buffer.name.starts_with("isect"));
            assert!(
                lists.clone().count() > 3 && lists.map(|list| list.bytes()).all(|b| b <= gpu.info().max_storage_bytes)
            );
        }
    }
}

#[test]
fn plans_made_before_there_is_a_model_say_what_is_held() {
    let gpu = Gpu::new();
    let entry = unsafe { ash::Entry::load() }.unwrap();
    for (supplement, degree, half) in [(0, 0, false), (700, 3, false), (700, 2, true)] {
        let scene = random_scene(9, 9000, supplement, degree);
        let room = model::Room { half, ..Default::default() };
        let before = gpu.memory().used;
        let model = Model::upload_around(&gpu, DVec3::ZERO, &scene, room).unwrap();
        let (planned, held) = (Model::plan(gpu.info(), &scene, room).bytes(), gpu.memory().used - before);
        // A buffer for bindings that nobody uses, and the rounding of small ones.
        assert!(held.abs_diff(planned) < 4096, "{held} bytes held, {planned} planned");
        // To bring it there takes as much again, on a device whose memory is the host's.
        drop(model);
        for room in [room, model::Room { page: Some(1000), base: 2500, ..room }] {
            let before = gpu.memory().used;
            let upload = Upload::prepare(&gpu, DVec3::ZERO, &scene, room).unwrap();
            let staged = Upload::plan(gpu.info(), &scene, room).bytes();
            let held = gpu.memory().used - before - Model::plan(gpu.info(), &scene, room).bytes();
            if gpu.info().is_cpu {
                // Lists of lobes that are none, one for each page.
                assert!(held.abs_diff(staged) < 4096, "{held} bytes held, {staged} planned");
            }
            drop(upload);
        }
        let model = Model::upload_around(&gpu, DVec3::ZERO, &scene, room).unwrap();
        // Every one of them can be had by name.
        let named = |held: Vec<Held>| {
            assert!(held.iter().all(|held| held.buffer != vk::Buffer::null()));
            (
                held.iter().map(|held| held.name).collect::<BTreeSet<_>>(),
                held.iter().map(|held| held.bytes).sum::<u64>(),
            )
        };
        let (names, bytes) = named(model.held());
        assert!(
            bytes == planned && names.contains("supplement lobes") == (supplement > 0),
            "{names:?} of {bytes} bytes"
        );
        let needs = Needs::of_scene(&scene, half);
        assert_eq!(needs, Needs::of(&model));
        let limits = Limits::for_needs(needs, 320, 200);
        // Nor need there be a device: what is known of a physical one says the same.
        let physical = unsafe { Context::describe(&entry, gpu.instance(), gpu.physical_device()) }.unwrap();
        assert_eq!(Model::plan(&physical, &scene, room), Model::plan(gpu.info(), &scene, room));
        assert_eq!(limits.plan(&physical).unwrap(), limits.plan(gpu.info()).unwrap());
        let before = gpu.memory().used;
        let frames = Frames::new(&gpu, limits.clone()).unwrap();
        let (planned, held) = (limits.plan(gpu.info()).unwrap().bytes(), gpu.memory().used - before);
        assert!(held.abs_diff(planned) < 4096, "{held} bytes held, {planned} planned");
        // But for an element each of the three kinds of gradient records, and beside what the host reads of each slot.
        let (reports, held): (Vec<_>, Vec<_>) = frames.held().into_iter().partition(|held| held.name == "report");
        assert!(reports.len() == 2 && reports[0].buffer != reports[1].buffer && reports[0].bytes == 36, "{reports:?}");
        let (names, bytes) = named(held);
        assert!(bytes + 3 * 12 == planned && names.contains("image") && names.contains("target"), "{names:?}: {bytes}");
        drop(frames);
    }
}

/// Not before its first frame is drawn could an engine learn how much room a scene takes: what there is without asking must do for a
/// capture at the size of a screen, from where its photographs were taken, opaque and with gaps between points filled.
#[test]
fn a_first_frame_of_a_capture_finds_room_at_the_size_of_a_screen() {
    let Some(path) = shared::shared("small/garden") else { return };
    let gpu = Gpu::new();
    let dataset = Dataset::open(path, &DatasetOptions::default()).unwrap();
    let cloud = first_points(&dataset, Some(30_000), 0).cloud;
    let mut base = from_points(&cloud.positions, &cloud.colors, 0);
    base.opacities.fill(3.0);
    let model = Model::upload(&gpu, &Scene { base, supplement: None }, 0).unwrap();
    let (width, height) = (1920, 1080);
    let mut frames = Frames::new(&gpu, Limits { texel: Texel::Rgba8, ..Limits::of(&model, width, height) }).unwrap();
    let engine = Engine::new(&gpu, 1);
    let target = Buffer::<u32>::new(&gpu, "target", (width * height) as usize, Location::Device).unwrap();
    let range = BufferRange { buffer: target.raw().handle(), offset: 0 };
    let color = Some(Target::new(Pixels::Buffer(range), Texel::Rgba8));
    for photo in dataset.photos.iter().step_by(dataset.photos.len().div_ceil(4)) {
        let view = FrameView { color, ..FrameView::new(photo.camera.fitted(width, height)) };
        let frame = Frame { slot: 0, instances: &[Instance::of(&model)], views: &[view] };
        engine.run(|commands| unsafe { frames.record(commands, &frame) }.unwrap());
        let report = frames.report(0).unwrap();
        println!("{}: {} intersections, room for {}", photo.name, report.intersections, frames.capacity());
        assert!(report.needed.is_none() && report.intersections > 100_000, "{report:?}");
    }
}

#[test]
fn room_that_is_not_filled_shows_nothing() {
    let gpu = Gpu::new();
    let (scene, camera) = (random_scene(7, 600, 0, 1), random_camera(61, 47));
    let few = half_of(&scene, false);
    let (all, roomy) = (Model::upload(&gpu, &scene, 0).unwrap(), {
        let room = model::Room { base: 300, ..Default::default() };
        Model::upload_around(&gpu, DVec3::ZERO, &few, room).unwrap()
    });
    let mut frames = Frames::new(&gpu, wide(Limits::of(&all, 61, 47))).unwrap();
    let engine = Engine::new(&gpu, 1);
    let float = Float::new(&gpu, camera.pixels());
    let mut image = |model| {
        let view = FrameView { color: Some(float.target(Blend::Opaque(GREY))), ..FrameView::new(camera) };
        let frame = Frame { slot: 0, instances: &[Instance::of(model)], views: &[view] };
        engine.run(|commands| unsafe { frames.record(commands, &frame) }.unwrap());
        float.pixels()
    };
    let (whole, half) = (image(&all), image(&roomy));
    assert!(half.iter().zip(rendered(&gpu, &few, &camera)).all(|(g, w)| g[..3] == w[..3]));
    assert_ne!(whole, half);
}

#[test]
fn a_second_renderer_makes_no_pipelines() {
    // A device of its own: other tests make the same.
    let gpu = Context::new(&ContextOptions::from_env()).unwrap();
    let model = Model::upload(&gpu, &random_scene(1, 50, 10, 1), 0).unwrap();
    let limits = Limits::of(&model, 32, 24);
    let first = Frames::new(&gpu, limits.clone()).unwrap();
    let made = gpu.counters().pipelines;
    assert!(made > 10);
    let second = std::thread::scope(|s| s.spawn(|| Frames::new(&gpu, limits.clone()).unwrap()).join().unwrap());
    assert_eq!(gpu.counters().pipelines, made);
    // Their handles can be had, each with what it was made of.
    let handles = gpu.pipelines();
    assert_eq!(handles.len() as u64, made);
    for pipeline in &handles {
        let nothing = pipeline.pipeline == vk::Pipeline::null()
            || pipeline.layout == vk::PipelineLayout::null()
            || pipeline.set_layout == vk::DescriptorSetLayout::null();
        let kernel = stages::ALL.iter().find(|kernel| kernel.name == pipeline.kernel).unwrap();
        let known = pipeline.constants.iter().filter(|(id, _)| kernel.constants.iter().any(|known| known.id == *id));
        assert!(!nothing && known.count() == kernel.constants.len(), "{pipeline:?}");
    }
    assert!(handles.windows(2).all(|pair| pair[0] < pair[1]) && handles.iter().any(|p| p.kernel == "blend"));
    // Of other degrees there is one more for each segment.
    let third = Frames::new(&gpu, Limits { degrees: vec![0], lobe_degrees: vec![0], ..limits.clone() }).unwrap();
    assert_eq!(gpu.counters().pipelines, made + 2);
    // What is dropped leaves its pipelines to the next.
    drop((first, second, third));
    let _fourth = Frames::new(&gpu, limits).unwrap();
    assert_eq!(gpu.counters().pipelines, made + 2);
    // Nor does another context of the device.
    let again = gpu.again(&ContextOptions::from_env()).unwrap();
    let model = Model::upload(&again, &random_scene(1, 50, 10, 1), 0).unwrap();
    let _fifth = Frames::new(&again, Limits::of(&model, 32, 24)).unwrap();
    assert_eq!(again.counters().pipelines, 0);
    assert_eq!(gpu.validation_messages(), [""; 0]);
}

#[test]
fn a_scene_loads_in_the_callers_commands_and_submits_nothing() {
    let gpu = Gpu::new();
    let (scene, camera) = (random_scene(7, 600, 150, 3), random_camera(61, 47));
    let want = rendered(&gpu, &scene, &camera);
    let engine = Engine::new(&gpu, 1);
    let before = gpu.counters().submissions;
    // Prepared on another thread.
    let upload = std::thread::scope(|s| {
        let prepare =
            || Upload::prepare(&gpu, DVec3::ZERO, &scene, model::Room { page: Some(97), ..Default::default() });
        s.spawn(prepare).join().unwrap().unwrap()
    });
    let mut kept = Kept::default();
    engine.run(|commands| {
        let mut recorder = unsafe { Recorder::borrow(&gpu, commands, Kept::default()) };
        upload.record(&mut recorder).unwrap();
        kept = recorder.finish();
    });
    assert!(!kept.is_empty());
    assert_eq!(gpu.counters().submissions, before);
    let model = upload.finish().unwrap();
    let mut frames = Frames::new(&gpu, wide(Limits::of(&model, 61, 47))).unwrap();
    let float = Float::new(&gpu, camera.pixels());
    let view = FrameView { color: Some(float.target(Blend::Opaque(GREY))), ..FrameView::new(camera) };
    let frame = Frame { slot: 0, instances: &[Instance::of(&model)], views: &[view] };
    engine.run(|commands| unsafe { frames.record(commands, &frame) }.unwrap());
    assert!(float.pixels().iter().zip(&want).all(|(g, w)| g[..3] == w[..3]));
    let back = model.download().unwrap();
    assert_eq!((back.base.means, back.base.sh), (scene.base.means, scene.base.sh));
}

/// Its counts and dispatches would be what the memory holds: a frame could take for ever.
#[test]
fn an_upload_that_was_not_recorded_is_no_model() {
    let (gpu, other) = (Gpu::new(), Gpu::new());
    let prepare = || Upload::prepare(&gpu, DVec3::ZERO, &random_scene(7, 60, 20, 1), model::Room::default()).unwrap();
    let refused = |result: Result<(), Error>, words: &str| match result {
        Err(Error::Usage(message)) => assert!(message.contains(words), "{message}"),
        other => panic!("{other:?}"),
    };
    refused(prepare().finish().map(drop), "not recorded");
    // Nor is it recorded where the recorder is of another device.
    let upload = prepare();
    refused(upload.record(&mut other.recorder("elsewhere").unwrap()), "another context");
    assert!(!upload.is_recorded());
    let mut recorder = gpu.recorder("here").unwrap();
    upload.record(&mut recorder).unwrap();
    recorder.submit().unwrap().wait().unwrap();
    assert_eq!(upload.finish().unwrap().counts().unwrap(), [60, 20]);
}

/// One thread draws without a pause while another loads, three scenes one after the other: each is prepared, recorded, run and finished
/// while frames come and go, and drawn from the next frame on. Both submit to one queue, as the engine's own lock lets them.
#[test]
fn scenes_load_in_one_thread_while_another_draws() {
    let gpu = Gpu::new();
    let camera = random_camera(48, 40);
    let scenes: Vec<Scene> = (0..4).map(|seed| random_scene(30 + seed, 250, 60, 1)).collect();
    let first = Model::upload(&gpu, &scenes[0], 0).unwrap();
    let mut frames = Frames::new(&gpu, Limits { in_flight: 3, ..wide(Limits::of(&first, 48, 40)) }).unwrap();
    // Slot k shows the scene that was there when it was recorded last.
    let targets = [0, 1, 2].map(|_| Float::new(&gpu, 48 * 40));
    let submitted = gpu.counters().submissions;
    let (drawn, done) = (AtomicU32::new(0), AtomicBool::new(false));
    let (send, receive) = std::sync::mpsc::channel::<Model>();
    let (models, shown, during) = std::thread::scope(|s| {
        let loading = s.spawn(|| {
            let engine = Engine::new(&gpu, 1);
            // Frames that were drawn between the begin and the end of a load.
            let mut during = Vec::new();
            for scene in &scenes[1..] {
                let before = drawn.load(Relaxed);
                let next_frame = || {
                    let now = drawn.load(Relaxed);
                    while drawn.load(Relaxed) == now && !done.load(Relaxed) {
                        std::thread::yield_now();
                    }
                };
                next_frame();
                let upload = Upload::prepare(&gpu, DVec3::ZERO, scene, model::Room::default()).unwrap();
                next_frame();
                let mut kept = Kept::default();
                engine.run(|commands| {
                    let mut recorder = unsafe { Recorder::borrow(&gpu, commands, Kept::default()) };
                    upload.record(&mut recorder).unwrap();
                    kept = recorder.finish();
                });
                send.send(upload.finish().unwrap()).unwrap();
                during.push(drawn.load(Relaxed) - before);
            }
            drop(send);
            during
        });
        let engine = Engine::new(&gpu, 3);
        let (mut models, mut shown) = (vec![first], [0; 3]);
        let mut last = None;
        for n in 0.. {
            models.extend(receive.try_recv());
            // Until each slot shows the last scene.
            if models.len() == scenes.len() && last.is_none() {
                last = Some(n + 3);
            }
            if last == Some(n) || loading.is_finished() && models.len() < scenes.len() {
                break;
            }
            let slot = n % 3;
            let commands = engine.begin(slot);
            let color = Some(targets[slot as usize].target(Blend::Opaque(GREY)));
            let views = [FrameView { color, ..FrameView::new(camera) }];
            let model = models.last().unwrap();
            let frame = Frame { slot, instances: &[Instance::of(model)], views: &views };
            unsafe { frames.record(commands, &frame) }.unwrap();
            engine.submit(slot);
            shown[slot as usize] = models.len() - 1;
            drawn.fetch_add(1, Relaxed);
        }
        done.store(true, Relaxed);
        engine.finish();
        (models, shown, loading.join().unwrap())
    });
    assert_eq!((models.len(), shown), (4, [3; 3]));
    // Of every load at least two frames were drawn meanwhile, and glint itself submitted nothing.
    assert!(during.len() == 3 && during.iter().all(|&frames| frames >= 2), "{during:?}");
    assert_eq!(gpu.counters().submissions, submitted);
    let want = rendered(&gpu, &scenes[3], &camera);
    for target in &targets {
        assert!(target.pixels().iter().zip(&want).all(|(g, w)| g[..3] == w[..3]));
    }
    // What was loaded is whole: each scene as it would have been uploaded alone.
    for (model, scene) in models.iter().zip(&scenes) {
        let back = model.download().unwrap();
        assert_eq!((back.base.means, back.base.sh), (scene.base.means.clone(), scene.base.sh.clone()));
    }
}

#[test]
fn matrices_of_renderers_are_the_cameras_they_stand_for() {
    let camera = random_camera(640, 480);
    let (w, h) = (640.0, 480.0);
    // Vulkan's own way (y down, z forward) and OpenGL's view space (y up, z backward), each with its projection.
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
        // And it is where the matrices put it.
        let clip = projection * view * point.extend(1.0);
        assert!(((clip.x / clip.w + 1.0) * w / 2.0 - a.0).abs() < 1e-9);
        assert!(((clip.y / clip.w + 1.0) * h / 2.0 - a.1).abs() < 1e-9);
        assert!((clip.z / clip.w - (seen.depth_form.a + seen.depth_form.b / a.2)).abs() < 1e-12);
        assert_eq!((seen.depth_form, seen.near), (DepthForm::reversed_infinite(near), near));
        // The near plane is the projection's own, of whatever form.
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
        // A rotation and a translation are divided by nothing.
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
    let mut frames = Frames::new(&gpu, wide(Limits::of(&model, 61, 47))).unwrap();
    let engine = Engine::new(&gpu, 1);
    let float = Float::new(&gpu, camera.pixels());
    let view = FrameView { near: 2.0, color: Some(float.target(Blend::Premultiplied)), ..FrameView::new(camera) };
    let frame = Frame { slot: 0, instances: &[Instance::of(&model)], views: &[view] };
    engine.run(|commands| unsafe { frames.record(commands, &frame) }.unwrap());
    let want = twin(&scene, &View { near: 2.0, ..View::from_camera(&camera) }.rounded(), |_| f64::INFINITY);
    let all = twin(&scene, &View::from_camera(&camera).rounded(), |_| f64::INFINITY);
    let calm = want.iter().zip(float.pixels()).filter(|((_, margin), _)| *margin > NEAR);
    assert!(calm.clone().all(|((w, _), g)| (0..3).all(|c| (w[c] - f64::from(g[c])).abs() < 1e-5)));
    assert!(calm.count() > 2000 && all.iter().zip(&want).filter(|(a, b)| (a.0[3] - b.0[3]).abs() > 0.05).count() > 300);
    let _ = reference::NEAR;
}
