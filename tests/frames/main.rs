//! Frames in another renderer: images, depths, instances, slots, and refused frames.

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/counting.rs"]
mod counting;
#[path = "../common/engine.rs"]
mod engine;
#[path = "../common/shared.rs"]
mod shared;

mod depths;
mod instances;
mod loading;
mod outside;
mod refused;
mod room;
#[path = "../common/run.rs"]
mod run;

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
        Background, Intersections, Options, Params, View,
        blend::blend_before,
        median_depth::{DepthAt, median_depth},
        packed_splat::packed,
        project::project,
        random_camera, random_scene,
        resolve::{To, depth, pack, unpack, words},
        tiles::{Tiling, for_each_tile},
    },
    scene::{
        Camera, Gaussians, Lobes, Scene, Supplement,
        color::BETAS,
        from_points,
        layout::{self, sh_planes},
    },
    stages::{
        self,
        constants::resolve::{BGRA8, OPAQUE, OVER, PREMULTIPLIED, RGBA8, RGBA16F, RGBA32F},
    },
};

/// Counts this thread's heap allocations.
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

/// A target for a frame's float32 colors.
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

/// The result of the command line's renderer: RGB over grey, and transmittance.
fn rendered(gpu: &Context, scene: &Scene, camera: &Camera) -> Vec<[f32; 4]> {
    let views = Views::upload(gpu, &[*camera], &[]).unwrap();
    let model = Model::upload(gpu, scene, 0).unwrap();
    let mut renderer = Renderer::new(gpu, Needs::of(&model), &views, RenderOptions::default()).unwrap();
    let image = renderer.render(&model, &views, 0, GREY).unwrap();
    image.color.chunks_exact(3).zip(image.transmittance).map(|(c, t)| [c[0], c[1], c[2], t]).collect()
}

/// Records a frame of one view, runs it and waits.
fn draw(engine: &Engine<'_>, frames: &mut Frames, instances: &[Instance<'_>], view: FrameView) {
    let frame = Frame { slot: 0, instances, views: &[view] };
    engine.run(|commands| unsafe { frames.record(commands, &frame) }.unwrap());
}

/// A model's pixels in a frame made for it.
fn drawn(gpu: &Context, model: &Model, view: FrameView, blend: Blend) -> Vec<[f32; 4]> {
    let Camera { width, height, .. } = view.camera;
    let mut frames = Frames::new(gpu, wide(Limits::of(model, width, height))).unwrap();
    let float = Float::new(gpu, width * height);
    let view = FrameView { color: Some(float.target(blend)), ..view };
    draw(&Engine::new(gpu, 1), &mut frames, &[Instance::of(model)], view);
    float.pixels()
}

/// Over what is there, and made linear, as the twin has it.
#[test]
fn images_of_every_format_have_what_glint_renders() {
    let gpu = Gpu::new();
    let (scene, camera) = (random_scene(7, 600, 150, 3), random_camera(61, 47));
    let want = rendered(&gpu, &scene, &camera);
    let model = Model::upload(&gpu, &scene, 0).unwrap();
    let mut frames = Frames::new(&gpu, wide(Limits::of(&model, 80, 60))).unwrap();
    let mut engine = Engine::new(&gpu, 1);
    // Larger than the view: the rest must stay unchanged.
    let (size, offset) = ([80, 60], [7, 5]);
    let is_inside = |p: usize| (7..68).contains(&(p % 80)) && (5..52).contains(&(p / 80));
    let below = |p: usize| [0.1 + 1e-4 * p as f64, 0.9 - 1e-4 * p as f64, 1.5, 0.5];
    let blends = [(Blend::Opaque(GREY), OPAQUE), (Blend::Premultiplied, PREMULTIPLIED), (Blend::Over, OVER)];
    let lights = [(Light::Encoded, 1.0), (Light::Encoded, 2.5), (Light::Linear, 1.0), (Light::Linear, 2.5)];
    for (format, number) in [
        (vk::Format::R32G32B32A32_SFLOAT, RGBA32F),
        (vk::Format::R16G16B16A16_SFLOAT, RGBA16F),
        (vk::Format::R8G8B8A8_UNORM, RGBA8),
        (vk::Format::B8G8R8A8_UNORM, BGRA8),
        (vk::Format::B8G8R8A8_SRGB, BGRA8),
    ] {
        let (texel, words) = (Texel::of(format).unwrap(), words(number));
        let mut before = vec![0; words * 80 * 60];
        before.chunks_mut(words).enumerate().for_each(|(p, texel)| pack(number, below(p), texel));
        let part = |texels: &[u32], inside: bool| -> Vec<u32> {
            let part = texels.chunks(words).enumerate().filter(|(p, _)| is_inside(*p) == inside);
            part.flat_map(|(_, texel)| texel.to_vec()).collect()
        };
        let mut whole = engine.image(format, size[0], size[1]);
        let lights = &lights[..if number == RGBA32F { 4 } else { 1 }];
        for ((blend, mode), &(light, exposure)) in blends.into_iter().flat_map(|b| lights.iter().map(move |l| (b, l))) {
            // An image that is read too would be in a layout that the layers warn of.
            let buffer = Buffer::from_slice(&gpu, "over", &part(&before, true)).unwrap();
            let pixels = match blend {
                Blend::Over => Pixels::Buffer(BufferRange { buffer: buffer.raw().handle(), offset: 0 }),
                _ => Pixels::Image(ImageRegion { offset, ..whole }),
            };
            engine.write(&whole, size, &before);
            let color = Some(Target { blend, light, exposure, ..Target::new(pixels, texel) });
            draw(&engine, &mut frames, &[Instance::of(&model)], FrameView { color, ..FrameView::new(camera) });
            assert_eq!(frames.report(0).unwrap().needed, None);
            let linear = light == Light::Linear;
            let to = To { blend: mode, linear, exposure: exposure.into(), background: GREY.map(f64::from) };
            let all = engine.read(&mut whole, size, words as u32);
            assert!(part(&all, false) == part(&before, false), "{format:?} {to:?}");
            let got = if blend == Blend::Over { buffer.download().unwrap() } else { part(&all, true) };
            assert_eq!(got.len(), words * 61 * 47);
            for ((got, was), want) in got.chunks(words).zip(part(&before, true).chunks(words)).zip(&want) {
                // Over black; exposure does not brighten an opaque target's background.
                let [r, g, b, t] = want.map(f64::from);
                let behind = GREY.map(|c| if to.whole() { 0.0 } else { t * f64::from(c) });
                let wanted = to.resolve([r - behind[0], g - behind[1], b - behind[2], t], unpack(number, was));
                for (got, want) in unpack(number, got).into_iter().zip(wanted) {
                    let (want, most) = match texel {
                        Texel::Rgba32F if to.whole() && !linear => (want, 0.0),
                        // A power in float32 is accurate to 1e-5 of its value; exposure and light raise values up to 6.
                        Texel::Rgba32F => (want, 2e-5 * want.max(1.0)),
                        // The nearest half, or the next one if a kernel rounds differently.
                        Texel::Rgba16F => (want, want.abs() / 1024.0 + 1e-6),
                        // Half a step, plus the rounding of 255 times a float32.
                        Texel::Rgba8 | Texel::Bgra8 => (want.clamp(0.0, 1.0), 0.5 / 255.0 + 1e-6),
                    };
                    assert!((got - want).abs() <= most, "{format:?} {to:?}: {got} for {want}");
                }
            }
        }
    }
    assert_eq!(Texel::of(vk::Format::R8_UNORM), None);
}

/// The twin's image of everything in front of `farthest`, with each pixel's margin of decisions.
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

/// Relative distance from a threshold within which float32 may decide differently: a thousand times its
/// rounding, as sums of a hundred terms and differences of coordinates lose two or three digits.
const NEAR: f64 = 1e-4;

/// The far plane of projections that have one: a third of the Gaussians are beyond it.
const FAR: f64 = 7.0;

/// Every kind of projection, with a near plane at 0.2.
const FORMS: [(DepthForm, &str); 4] = [
    (DepthForm { a: 0.0, b: 0.2 }, "reversed, infinite"),
    (DepthForm { a: -0.2 / (FAR - 0.2), b: 0.2 * FAR / (FAR - 0.2) }, "reversed"),
    (DepthForm { a: 1.0, b: -0.2 }, "infinite"),
    (DepthForm { a: FAR / (FAR - 0.2), b: -0.2 * FAR / (FAR - 0.2) }, "standard"),
];

/// A world camera that sees a placed model in the same way as `camera` sees the model alone.
fn gone_with(camera: &Camera, transform: &Transform) -> Camera {
    let rotation = camera.rotation * DMat3::from_quat(transform.rotation).transpose();
    let translation = transform.scale * camera.translation - rotation * transform.translation;
    Camera { rotation, translation, ..*camera }
}

/// Base and supplement have separate degrees, and so have pipelines, bytes and images.
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
        let segments = [model::Segment::Base, model::Segment::Supplement];
        let planes = segments.map(|segment| model.part(segment).sh.planes());
        assert_eq!(planes, [base, lobed].map(words));
        // The values on the device, rounded to half if so.
        let params = Params::from_scene(&model.download().unwrap()).unwrap();
        for degree in [model.sh_degree, 1, 0] {
            let options = Options { active_degree: degree, ..Default::default() };
            let (projected, tiling) = (project(&params, &view, &options), Tiling::new(61, 47, &options));
            let projected = if half { packed(projected, &tiling) } else { projected };
            let isects = Intersections::new(&projected, tiling);
            let want = blend_before(&projected.splats, &isects, Background::Color([0.0; 3]), 0.5, |_| f64::INFINITY);
            let mut frames = Frames::new(&gpu, wide(Limits::for_needs(Needs::at(&model, [degree]), 61, 47))).unwrap();
            let (engine, float) = (Engine::new(&gpu, 1), Float::new(&gpu, camera.pixels()));
            let seen = FrameView { color: Some(float.target(Blend::Premultiplied)), ..FrameView::new(camera) };
            let instances = [Instance { degree, ..Instance::of(&model) }];
            draw(&engine, &mut frames, &instances, seen);
            let mut compared = 0;
            for ((got, want), margin) in float.pixels().iter().zip(&want.image).zip(&want.margins) {
                if margin.image() > NEAR {
                    compared += 1;
                    // float32's 6e-8 of colors up to 4, in sums of some hundred terms. A half rounded the
                    // other way is off by 2^-11; this happens to one in a few hundred, and a pixel sees a
                    // part of it.
                    let most = if half { 5e-4 } else { 1e-4 };
                    (0..3).for_each(|c| assert!((f64::from(got[c]) - want[c]).abs() < most, "{got:?} {want:?}"));
                }
            }
            assert!(compared > 2500, "{compared}");
        }
    }
}

#[test]
fn a_model_of_half_width_takes_128_bytes_and_looks_the_same() {
    let gpu = Gpu::new();
    let (scene, camera) = (random_scene(5, 800, 200, 3), random_camera(61, 47));
    let want = rendered(&gpu, &scene, &camera);
    let half = model::Room { half: true, ..Default::default() };
    let model = Model::upload_around(&gpu, DVec3::ZERO, &scene, half).unwrap();
    let bytes = |part: &model::Part| {
        let planes = [&part.geometry, &part.sh, &part.lobes].into_iter().filter(|planes| planes.planes() > 0);
        planes.map(|planes| 16 * planes.page(0).len() / part.pages[0].capacity as usize).sum::<usize>()
    };
    assert_eq!([model::Segment::Base, model::Segment::Supplement].map(|s| bytes(model.part(s))), [128, 160]);
    let got = drawn(&gpu, &model, FrameView::new(camera), Blend::Opaque(GREY));
    let pairs = got.iter().zip(&want).flat_map(|(got, want)| (0..3).map(|c| (got[c] - want[c]).abs()));
    let off = pairs.fold(0.0, f32::max);
    // A coefficient of 2 is off by at most 2^-11 of itself: a color by at most half a step of 8 bits. Most
    // errors are far smaller, and pixels are means. A splat's color is off by 2^-12 of 1, its opacity by
    // 8e-6, scales by the same relative to themselves, and an axis of 100 px by 3e-4 px. (An α within 1e-5 of
    // 1/255 may fall on the other side; that is worth up to a step, but no pixel here has one.)
    println!("off by {off:.1e}");
    assert!(off > 0.0 && off < 0.5 / 255.0, "{off}");
}

/// The device as lent by an engine, with counted functions.
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
fn hundreds_of_frames_submit_allocate_and_wait_for_nothing_and_leave_nothing() {
    let owner = Gpu::new();
    let gpu = lent(&owner);
    let scene = random_scene(21, 300, 80, 2);
    let model = Model::upload(&gpu, &scene, 0).unwrap();
    let limits = Limits { in_flight: 3, views: 2, timings: true, depth_in: true, ..wide(Limits::of(&model, 48, 40)) };
    let mut frames = Frames::new(&gpu, limits.clone()).unwrap();
    let mut engine = Engine::new(&gpu, 3);
    // A buffer per slot and eye, and an image for every second frame; in that a wall hides everything beyond
    // 3 units.
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
    // The same frame alone, with nothing else in flight.
    let mut calm = Frames::new(&gpu, Limits { in_flight: 1, ..limits }).unwrap();
    let mut beside = Engine::new(&gpu, 1);
    let mut alone = beside.image(vk::Format::R8G8B8A8_UNORM, 48, 40);
    let (mut checked, mut hidden) = (0, 0);
    let (mut before, mut heap) = (gpu.counters(), 0);
    for n in 0..340 {
        let slot = n % 3;
        let commands = engine.begin(slot);
        let eyes = [camera(n), camera(n + 500)];
        // The slot's last frame has run; sample some of them.
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
    assert_eq!((heap, checked, hidden), (0, 6, 4));
    drop((frames, calm, model, engine, beside, buffers, walls));
    drop(gpu);
    for (function, made, gone) in counting::counts() {
        assert!(made > 0 && made == gone, "{function:?}: {made} were made, {gone} destroyed");
    }
}

#[test]
fn a_second_renderer_makes_no_pipelines() {
    // A separate device: other tests make the same pipelines.
    let gpu = Context::new(&ContextOptions::from_env()).unwrap();
    let model = Model::upload(&gpu, &random_scene(1, 50, 10, 1), 0).unwrap();
    let limits = Limits::of(&model, 32, 24);
    let first = Frames::new(&gpu, limits.clone()).unwrap();
    let made = gpu.counters().pipelines;
    assert!(made > 10);
    let second = std::thread::scope(|s| s.spawn(|| Frames::new(&gpu, limits.clone()).unwrap()).join().unwrap());
    assert_eq!(gpu.counters().pipelines, made);
    // The context lists their handles, each with its constants.
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
    // Other degrees add one pipeline per segment.
    let third = Frames::new(&gpu, Limits { degrees: vec![0], lobe_degrees: vec![0], ..limits.clone() }).unwrap();
    assert_eq!(gpu.counters().pipelines, made + 2);
    // Dropped frames leave their pipelines to the next.
    drop((first, second, third));
    let _fourth = Frames::new(&gpu, limits).unwrap();
    assert_eq!(gpu.counters().pipelines, made + 2);
    // Another context of the device makes none either.
    let again = gpu.again(&ContextOptions::from_env()).unwrap();
    let model = Model::upload(&again, &random_scene(1, 50, 10, 1), 0).unwrap();
    let _fifth = Frames::new(&again, Limits::of(&model, 32, 24)).unwrap();
    assert_eq!(again.counters().pipelines, 0);
    assert_eq!(gpu.validation_messages(), [""; 0]);
}
