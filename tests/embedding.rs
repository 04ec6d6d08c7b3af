//! glint inside another renderer: on the caller's device, and only recording into the caller's command
//! buffer.

mod common;
#[path = "common/counting.rs"]
mod counting;
#[allow(dead_code, reason = "no images are drawn here")]
#[path = "common/engine.rs"]
mod engine;

use std::{
    collections::BTreeSet,
    env,
    ffi::{CStr, c_void},
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, AtomicU64, Ordering::Relaxed},
    },
    thread,
    time::{Duration, Instant},
};

use ash::{ext, khr, vk};
use common::{Gpu, Turn};
use counting::Told;
use engine::Engine;
use glam::DVec3;
use glint::{
    Error,
    gpu::{
        BorrowedDevice, Buffer, BufferRange, Context, ContextOptions, FeatureChain, GpuError, Kept, Location, Pixels,
        QueueLock, Recorder,
    },
    pipelines::{
        enhance::{EnhanceOptions, Enhancer, Event},
        frames::{Frame, FrameView, Frames, Instance, Limits, Target, Texel},
        model::{Model, Room, Upload},
        render::{Needs, RenderOptions, Renderer, Show},
        session::Session,
        train::{BaseOptions, base_trainer, train_base},
        views::Views,
    },
    reference::{random_camera, random_scene},
    scene::Scene,
    stages::{self, status, step_done},
};

/// An application's own device, made with the demands of `Context::requirements`; with validation layers if
/// `GLINT_VALIDATION` is set. After the device is destroyed, the test fails if they have reported anything,
/// including leaked handles.
struct Application {
    entry: ash::Entry,
    instance: ash::Instance,
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    messages: Box<Mutex<Vec<String>>>,
    physical_device: vk::PhysicalDevice,
    device: ash::Device,
    queue_family: u32,
    _turn: Turn,
}

impl Application {
    fn new() -> Self {
        Self::with(&Context::requirements().extensions)
    }

    /// Whether the driver has this function, whatever the instance's version.
    fn has(&self, function: &CStr) -> bool {
        unsafe { self.instance.get_device_proc_addr(self.device.handle(), function.as_ptr()) }.is_some()
    }

    /// With these extensions instead of the required ones.
    fn with(extensions: &[&CStr]) -> Self {
        Self::of(vk::API_VERSION_1_2, extensions)
    }

    /// With an older Vulkan and without the layers: the features of 1.2 do not exist.
    fn of(version: u32, extensions: &[&CStr]) -> Self {
        let turn = Turn::alone();
        unsafe {
            let entry = ash::Entry::load().unwrap();
            let app = vk::ApplicationInfo::default().api_version(version);
            let layers = env::var("GLINT_VALIDATION").is_ok_and(|value| !value.is_empty());
            let layers: &[_] = match layers && version >= vk::API_VERSION_1_2 {
                true => &[c"VK_LAYER_KHRONOS_validation".as_ptr()],
                false => &[],
            };
            let utils = [ext::debug_utils::NAME.as_ptr()];
            let info = vk::InstanceCreateInfo::default()
                .application_info(&app)
                .enabled_layer_names(layers)
                .enabled_extension_names(&utils);
            let enabled = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
            let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enabled);
            let info = if layers.is_empty() { info } else { info.push_next(&mut features) };
            let instance = entry.create_instance(&info, None).unwrap();
            let messages = Box::new(Mutex::new(Vec::new()));
            let messenger = (!layers.is_empty()).then(|| {
                let utils = ext::debug_utils::Instance::new(&entry, &instance);
                let severity =
                    vk::DebugUtilsMessageSeverityFlagsEXT::WARNING | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR;
                let info = vk::DebugUtilsMessengerCreateInfoEXT::default()
                    .message_severity(severity)
                    .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION)
                    .pfn_user_callback(Some(said))
                    .user_data((&raw const *messages).cast_mut().cast());
                let messenger = utils.create_debug_utils_messenger(&info, None).unwrap();
                (utils, messenger)
            });
            let physical_device = instance.enumerate_physical_devices().unwrap()[0];
            let families = instance.get_physical_device_queue_family_properties(physical_device);
            let queue_family =
                families.iter().position(|f| f.queue_flags.contains(vk::QueueFlags::COMPUTE)).unwrap() as u32;
            let queues =
                [vk::DeviceQueueCreateInfo::default().queue_family_index(queue_family).queue_priorities(&[1.0])];
            let extensions: Vec<_> = extensions.iter().map(|e| e.as_ptr()).collect();
            let mut chain = FeatureChain::new(Context::requirements().features);
            let mut features = chain.link();
            let info = vk::DeviceCreateInfo::default()
                .queue_create_infos(&queues)
                .enabled_extension_names(&extensions)
                .push_next(&mut features);
            let device = instance.create_device(physical_device, &info, None).unwrap();
            Application { entry, instance, messenger, messages, physical_device, device, queue_family, _turn: turn }
        }
    }

    fn lend_with(&self, pipeline_cache: vk::PipelineCache, queue_lock: Option<QueueLock>) -> Context {
        unsafe { Context::borrow(BorrowedDevice { pipeline_cache, queue_lock, ..self.borrowed() }) }.unwrap()
    }

    fn borrowed(&self) -> BorrowedDevice {
        BorrowedDevice {
            entry: self.entry.clone(),
            instance: self.instance.clone(),
            physical_device: self.physical_device,
            device: self.device.clone(),
            queue_family: self.queue_family,
            queue: unsafe { self.device.get_device_queue(self.queue_family, 0) },
            optional: Default::default(),
            pipeline_cache: vk::PipelineCache::null(),
            queue_lock: None,
            labels: false,
            memory_budget: None,
        }
    }
}

unsafe extern "system" fn said(
    _: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    messages: *mut c_void,
) -> vk::Bool32 {
    unsafe {
        let text = (*data).message_as_c_str().unwrap_or_default().to_string_lossy().into_owned();
        (*messages.cast::<Mutex<Vec<String>>>()).lock().unwrap().push(text);
    }
    vk::FALSE
}

impl Drop for Application {
    fn drop(&mut self) {
        unsafe {
            self.device.destroy_device(None);
            if let Some((utils, messenger)) = &self.messenger {
                utils.destroy_debug_utils_messenger(*messenger, None);
            }
            self.instance.destroy_instance(None);
        }
        if !thread::panicking() {
            let messages = self.messages.lock().unwrap();
            assert!(messages.is_empty(), "validation layers: {messages:#?}");
        }
    }
}

/// Loads and draws a scene in the application's commands, and again in glint's own. At the end all of glint's
/// objects are destroyed; meanwhile kernels and buffers have their names.
#[test]
fn what_glint_makes_on_a_lent_device_it_names_and_destroys() {
    let (scene, camera) = (random_scene(7, 300, 80, 2), random_camera(61, 47));
    let application = Application::new();
    let (instance, device) = counting::counted(&application.entry, &application.instance, &application.device);
    let lent = BorrowedDevice { instance, device, labels: true, ..application.borrowed() };
    let context = unsafe { Context::borrow(lent) }.unwrap();
    let upload = Upload::prepare(&context, DVec3::ZERO, &scene, Room::default()).unwrap();
    let (engine, mut kept) = (Engine::new(&context, 1), Kept::default());
    engine.run(|commands| {
        let mut recorder = unsafe { Recorder::borrow(&context, commands, Kept::default()) };
        upload.record(&mut recorder).unwrap();
        kept = recorder.finish();
    });
    drop(kept);
    let model = upload.finish().unwrap();
    let limits = Limits { timings: true, depth_out: true, texel: Texel::Rgba32F, ..Limits::of(&model, 61, 47) };
    let mut frames = Frames::new(&context, limits).unwrap();
    let target = Buffer::<u32>::new(&context, "the engine's target", 4 * 61 * 47, Location::Device).unwrap();
    let range = BufferRange { buffer: target.raw().handle(), offset: 0 };
    let color = Some(Target::new(Pixels::Buffer(range), Texel::Rgba32F));
    let views = [FrameView { color, ..FrameView::new(camera) }];
    let before = counting::heard().len();
    engine.run(|commands| {
        let frame = Frame { slot: 0, instances: &[Instance::of(&model)], views: &views };
        unsafe { frames.record(commands, &frame) }.unwrap();
    });
    assert!(frames.report(0).unwrap().visible > 50);
    // Labels of a frame: each timed stage begins and ends one, without nesting.
    let labels = counting::heard().split_off(before);
    let stages: Vec<String> = labels
        .chunks(2)
        .map(|pair| match pair {
            [Told::Begin(name), Told::End] => name.clone(),
            other => panic!("{other:?}"),
        })
        .collect();
    let timed = frames.times(0).unwrap();
    if context.info().timestamp_period > 0.0 {
        let kernels = timed.iter().map(|time| time.name).filter(|name| !["fill", "copy", "update"].contains(name));
        assert!(kernels.eq(stages.iter().map(String::as_str)), "{stages:?}");
    }
    for name in ["project", "radix_upsweep", "emit", "blend", "resolve"] {
        assert!(stages.iter().any(|stage| stage == name), "{name} is not in {stages:?}");
    }
    for name in ["geometry", "isect_slots", "splats", "the engine's target"] {
        let named = Told::Name(vk::ObjectType::BUFFER, name.to_owned());
        assert!(counting::heard().contains(&named), "no buffer is called {name}");
    }
    let views = Views::upload(&context, &[camera], &[]).unwrap();
    let mut renderer = Renderer::new(&context, Needs::of(&model), &views, RenderOptions::default()).unwrap();
    renderer.render(&model, &views, 0, [0.5; 3]).unwrap();

    let held = |made: u64, gone: u64| made - gone;
    assert!(counting::counts().any(|(_, made, gone)| held(made, gone) > 10));
    drop((renderer, views, frames, target, model, engine));
    drop(context);
    for (function, made, gone) in counting::counts() {
        assert!(made > 0 && held(made, gone) == 0, "{function:?}: {made} were made, {gone} destroyed");
    }
}

/// An engine shares the device's memory with glint: the allocated memory counts, not the sum of buffer sizes.
#[test]
fn what_is_taken_of_a_lent_device_is_counted_and_stays_within_the_budget() {
    let application = Application::new();
    let budget = 24 << 20;
    let (instance, device) = counting::counted(&application.entry, &application.instance, &application.device);
    for memory_budget in [None, Some(budget)] {
        let (instance, device) = (instance.clone(), device.clone());
        let lent = BorrowedDevice { instance, device, memory_budget, ..application.borrowed() };
        let context = unsafe { Context::borrow(lent) }.unwrap();
        // Mapped memory counts too, if there is no other memory.
        let holds =
            |taken: u64| if context.info().is_cpu { taken == counting::memory() } else { taken <= counting::memory() };
        // A small scene and its frames: allocations are only slightly larger than the buffers, with and
        // without a budget.
        let scene = random_scene(7, 3000, 800, 2);
        let model = Model::upload(&context, &scene, 0).unwrap();
        let frames = Frames::new(&context, Limits::of(&model, 320, 200)).unwrap();
        let memory = context.memory();
        println!("{memory:?}");
        assert!(holds(memory.taken), "{memory:?}, not {}", counting::memory());
        // The last of several blocks is partly used.
        assert!(memory.used <= memory.taken && memory.taken < memory.used + (8 << 20), "{memory:?}");
        // Up to the budget and not beyond it, in large and in small pieces.
        for bytes in [5 << 20, 1 << 20, 1 << 14].into_iter().filter(|_| memory_budget.is_some()) {
            let mut more = Vec::new();
            let refused = loop {
                match Buffer::<u8>::new(&context, "more", bytes, Location::Device) {
                    Ok(buffer) => more.push(buffer),
                    Err(error) => break error,
                }
                let memory = context.memory();
                assert!(holds(memory.taken) && memory.taken <= budget && memory.used <= memory.taken, "{memory:?}");
            };
            assert!(matches!(refused, GpuError::OverBudget { .. }), "{refused}");
            // The rest is smaller than a piece.
            assert!(context.memory().taken + bytes as u64 > budget, "{bytes}: {:?}", context.memory());
        }
        drop((frames, model));
        // One block is kept for the next buffers.
        let memory = context.memory();
        assert!(holds(memory.taken) && memory.used == 0 && memory.taken <= 4 << 20, "{memory:?}");
    }
    // The budget is smaller than a block: each buffer has separate memory, and nothing is kept.
    let budget = 2 << 20;
    let lent = BorrowedDevice { instance, device, memory_budget: Some(budget), ..application.borrowed() };
    let context = unsafe { Context::borrow(lent) }.unwrap();
    let mut small = Vec::new();
    while let Ok(buffer) = Buffer::<u8>::new(&context, "small", 1 << 16, Location::Device) {
        small.push(buffer);
        let memory = context.memory();
        let given = counting::memory();
        assert!(memory.taken == given && given <= budget && memory.used <= given, "{memory:?}, not {given}");
    }
    assert_eq!((small.len(), context.memory().most_used), (32, budget));
    drop(small);
    assert_eq!((context.memory().taken, counting::memory()), (0, 0));
}

/// The caller keeps a cache from an earlier run. Its pipelines render the same bits, and are made faster if
/// the driver stores anything: lavapipe of Mesa 22.3 returns only the header, compiles on the first run of a
/// kernel, and gains nothing.
#[test]
fn the_callers_pipeline_cache_may_be_warm() {
    let (scene, camera) = (random_scene(7, 300, 50, 2), random_camera(61, 47));
    let application = Application::new();
    let device = &application.device;
    let shot = |data: &[u8]| unsafe {
        let info = vk::PipelineCacheCreateInfo::default().initial_data(data);
        let cache = device.create_pipeline_cache(&info, None).unwrap();
        let context = application.lend_with(cache, None);
        let views = Views::upload(&context, &[camera], &[]).unwrap();
        let model = Model::upload(&context, &scene, 0).unwrap();
        let begin = Instant::now();
        let mut renderer = Renderer::new(&context, Needs::of(&model), &views, RenderOptions::default()).unwrap();
        let time = begin.elapsed();
        let image = renderer.render(&model, &views, 0, [0.5; 3]).unwrap().color;
        let made = context.counters().pipelines;
        drop((renderer, model, views, context));
        // glint has not destroyed it.
        let data = device.get_pipeline_cache_data(cache).unwrap();
        device.destroy_pipeline_cache(cache, None);
        (image, data, time, made)
    };
    let (cold, data, cold_time, made) = shot(&[]);
    // Only the header, if the driver stores nothing.
    const HEADER: usize = 32;
    assert!(data.len() >= HEADER);
    // Compiling takes nearly all of the time, and the cache saves it: half is far from both. A driver with
    // its own disk cache may have had the kernels already; reading one takes less than a millisecond, so
    // below five per pipeline there is nothing to save.
    let quick = Duration::from_millis(5) * made as u32;
    let saves = |warm_time| warm_time < cold_time / 2 || cold_time < quick;
    // The best of a few, since a busy machine may delay one.
    let mut warm_time = Duration::MAX;
    for _ in 0..5 {
        let (warm, again, time, _) = shot(&data);
        assert!(cold == warm, "a warm cache changes the image");
        assert!(again.len() >= data.len());
        warm_time = time.min(warm_time);
        if saves(warm_time) || data.len() == HEADER {
            break;
        }
    }
    println!("{} bytes of pipelines: {cold_time:?} cold, {warm_time:?} warm", data.len() - HEADER);
    if data.len() > HEADER {
        assert!(saves(warm_time), "{cold_time:?} cold, {warm_time:?} warm, {made} pipelines");
    } else {
        println!("the driver keeps nothing: no times to compare");
    }
}

#[test]
fn the_callers_lock_is_held_at_every_submission_and_null_handles_are_refused() {
    let application = Application::new();
    let (held, open) = (Arc::new(AtomicU64::new(0)), Arc::new(AtomicBool::new(true)));
    let lock = {
        let (held, open) = (held.clone(), open.clone());
        QueueLock(Arc::new(move |submit: &mut dyn FnMut()| {
            if open.load(Relaxed) {
                held.fetch_add(1, Relaxed);
                submit();
            }
        }))
    };
    let context = application.lend_with(vk::PipelineCache::null(), Some(lock));
    let buffer = Buffer::<u32>::from_slice(&context, "numbers", &[1, 2, 3]).unwrap();
    assert_eq!(buffer.download().unwrap(), [1, 2, 3]);
    let times = held.load(Relaxed);
    assert!(times > 0 && times == context.counters().submissions);
    // A lock that refuses submissions is not reported as a driver failure.
    open.store(false, Relaxed);
    assert!(matches!(buffer.download(), Err(GpuError::NotSubmitted)));
    // Handles that are null are refused.
    let borrowed = || application.borrowed();
    for (lent, words) in [
        (BorrowedDevice { physical_device: vk::PhysicalDevice::null(), ..borrowed() }, "the physical device is null"),
        (BorrowedDevice { queue: vk::Queue::null(), ..borrowed() }, "the queue is null"),
    ] {
        let error = unsafe { Context::borrow(lent) }.map_err(Error::from).err().unwrap();
        assert_eq!((error.to_string().as_str(), error.exit_code()), (words, 2));
    }
}

/// A plain scene with two grey photographs.
fn small(context: &Context) -> (Scene, Views) {
    let (camera, photo) = (random_camera(32, 24), vec![120u8; 3 * 32 * 24]);
    let views = Views::upload(context, &[camera; 2], &[&photo[..]; 2]).unwrap();
    (Scene { base: random_scene(3, 200, 0, 1).base, ..Default::default() }, views)
}

#[test]
fn training_neither_submits_nor_waits_for_every_step() {
    let gpu = Gpu::new();
    let (scene, views) = small(&gpu);
    let model = Model::upload(&gpu, &scene, 0).unwrap();
    let train = |iterations| {
        let before = gpu.counters();
        let options = BaseOptions { iterations, sh_degree: 1, ..Default::default() };
        train_base(&Session::new(&gpu), &model, &views, &options, false, |_| ()).unwrap();
        let after = gpu.counters();
        (after.submissions - before.submissions, after.waits - before.waits)
    };
    // Submissions before the loop do not depend on its length; inside, 16 steps share one.
    let (short, long) = (train(16), train(16 + 320));
    assert_eq!(long.0 - short.0, 320 / 16);
    // At most one wait per submission, and none if it is already done: the number depends on the machine.
    assert!(long.1 <= long.0, "{long:?} after {short:?}");
}

/// A stage may take longer late in a run than in its first steps.
#[test]
fn steps_are_timed_all_through_a_run() {
    let gpu = Gpu::new();
    let (scene, views) = small(&gpu);
    let model = Model::upload(&gpu, &scene, 0).unwrap();
    // 17 submissions of 16 steps; the first, the ninth and the seventeenth are timed.
    let options = BaseOptions { iterations: 17 * 16, sh_degree: 1, ..Default::default() };
    let report = train_base(&Session::new(&gpu), &model, &views, &options, true, |_| ()).unwrap();
    let steps = report.steps.stages.iter().filter(|stage| stage.name == "step_done").count();
    assert_eq!(steps, if gpu.info().timestamp_period > 0.0 { 3 * 16 } else { 0 });
    let means = report.steps.milliseconds();
    assert!(means.is_empty() == (steps == 0) && means.iter().all(|(_, mean)| mean.is_finite()));
}

/// Errors of rendering with a wait, and of recording only.
#[test]
fn what_a_renderer_was_not_made_for_is_an_error() {
    let gpu = Gpu::new();
    let upload = |camera| Views::upload(&gpu, &[camera], &[]).unwrap();
    let views = upload(random_camera(32, 24));
    let model =
        |count, supplement, degree| Model::upload(&gpu, &random_scene(3, count, supplement, degree), 0).unwrap();
    let plain = model(50, 0, 1);
    let status = Buffer::<u32>::zeroed(&gpu, "status", status::WORDS).unwrap();
    let depth = RenderOptions { depth: true, ..Default::default() };
    let mut renderer = Renderer::new(&gpu, Needs::of(&plain), &views, depth).unwrap();
    renderer.render(&plain, &views, 0, [0.0; 3]).unwrap();
    let mut refused = |model: &Model, views: &Views, view: u32, words: &str| {
        let show = Show::all(model, [0.0; 3]);
        let mut recorder = gpu.recorder("refused").unwrap();
        let said = [
            renderer.render(model, views, view, [0.0; 3]).err(),
            renderer.record(&mut recorder, model, views, view, &show, &status).err(),
            renderer.record_order(&mut recorder, model, views, view, &show, &status).err(),
            renderer.record_depths(&mut recorder, model, views, view, &show).err(),
        ];
        for error in said {
            match error {
                Some(Error::Usage(message)) => assert!(message.contains(words), "{message} lacks {words}"),
                other => panic!("{other:?}, expected a refusal that says {words}"),
            }
        }
        assert!(recorder.finish().is_empty(), "something was recorded");
    };
    refused(&plain, &views, 1, "there are 1 views, and number 1");
    let other = Gpu::new();
    let foreign = Model::upload(&other, &random_scene(3, 50, 0, 1), 0).unwrap();
    refused(&foreign, &views, 0, "another context than the renderer's");
    refused(&model(50, 20, 1), &views, 0, "without supplement");
    refused(&model(50, 0, 2), &views, 0, "not for 2");
    refused(&model(51, 0, 1), &views, 0, "a view of 51 Gaussians, made for 50");
    let elsewhere = DVec3::new(1e6, 0.0, 0.0);
    let far = Model::upload_around(&gpu, elsewhere, &random_scene(3, 50, 0, 1), Room::default()).unwrap();
    refused(&far, &views, 0, "the views from [0, 0, 0]");
    refused(&plain, &upload(random_camera(33, 24)), 0, "a view of 792 pixels, made for 768");
    // The same number of pixels, but more tiles.
    refused(&plain, &upload(random_camera(768, 1)), 0, "tiles, made for");
    let mut recorder = gpu.recorder("refused").unwrap();
    let short = Buffer::<u32>::zeroed(&gpu, "short", status::WORDS - 1).unwrap();
    let shown = Show::all(&plain, [0.0; 3]);
    assert!(renderer.record(&mut recorder, &plain, &views, 0, &shown, &short).is_err());
    let color = Renderer::new(&gpu, Needs::of(&plain), &views, RenderOptions::default()).unwrap();
    let said = color.record_depths(&mut recorder, &plain, &views, 0, &shown).unwrap_err().to_string();
    assert!(said.contains("made without"), "{said}");
    assert!(recorder.finish().is_empty());
}

/// Ordinary descriptor sets give the same bits, in glint's and in the application's command buffers,
/// repeatedly; and what is recorded there is what glint renders itself.
#[test]
fn a_device_without_push_descriptors_computes_the_same() {
    let all = Context::requirements().extensions;
    let others: Vec<&CStr> = all.iter().copied().filter(|name| *name != khr::push_descriptor::NAME).collect();
    assert_eq!(others.len() + 1, all.len());
    let (scene, camera) = (random_scene(7, 300, 60, 1), random_camera(60, 50));
    let computed = [all, others].map(|extensions| {
        let application = Application::with(&extensions);
        let gpu = unsafe { Context::borrow(application.borrowed()) }.unwrap();
        let (model, views) = (Model::upload(&gpu, &scene, 0).unwrap(), Views::upload(&gpu, &[camera], &[]).unwrap());
        let mut renderer = Renderer::new(&gpu, Needs::of(&model), &views, RenderOptions::default()).unwrap();
        let own = renderer.render(&model, &views, 0, [0.1, 0.2, 0.3]).unwrap().color;
        let limits = Limits { texel: Texel::Rgba32F, ..Limits::of(&model, 60, 50) };
        let mut frames = Frames::new(&gpu, limits).unwrap();
        let target = Buffer::<u32>::new(&gpu, "target", 4 * 60 * 50, Location::Device).unwrap();
        let range = BufferRange { buffer: target.raw().handle(), offset: 0 };
        let color = Some(Target::new(Pixels::Buffer(range), Texel::Rgba32F));
        let seen = [FrameView { color, ..FrameView::new(camera) }];
        let step = step_done::Stage::new(&gpu, &step_done::Spec { workgroup_size: 1 }).unwrap();
        let [status, reports] = ["status", "reports"].map(|name| Buffer::zeroed(&gpu, name, status::WORDS).unwrap());
        let show = Show::all(&model, [0.1, 0.2, 0.3]);
        for _ in 0..2 {
            renderer.raster.buffers.image.upload(0, &[[0.0; 4]; 60 * 50]).unwrap();
            let (before, mut kept) = (gpu.counters(), Kept::default());
            Engine::new(&gpu, 1).run(|commands| unsafe {
                let frame = Frame { slot: 0, instances: &[Instance::of(&model)], views: &seen };
                frames.record(commands, &frame).unwrap();
                assert!(matches!(Recorder::borrow(&gpu, commands, Kept::default()).submit(), Err(GpuError::NotOurs)));
                let mut recorder = Recorder::borrow(&gpu, commands, Kept::default());
                renderer.record(&mut recorder, &model, &views, 0, &show, &reports).unwrap();
                kept = recorder.finish();
                // The application submits and waits.
                assert_eq!(gpu.counters(), before);
            });
            assert!(!kept.is_empty());
            let image = renderer.raster.buffers.image.download_range(0, 60 * 50).unwrap();
            assert!(image.iter().flat_map(|p| [p[0], p[1], p[2]]).eq(own.iter().copied()));
            // More dispatches than a pool has sets.
            let mut recorder = gpu.recorder("many").unwrap();
            for _ in 0..300 {
                step.record(&mut recorder, &step_done::Buffers { status: &status }, &step_done::Push {}, 1);
            }
            recorder.submit().unwrap().wait().unwrap();
        }
        (own, target.download().unwrap(), status.download().unwrap())
    });
    assert_eq!(computed[0].2.iter().max(), Some(&600));
    assert!(computed[0] == computed[1]);
}

/// ash aborts if a function is called that the instance's Vulkan lacks: glint checks all of them first. NVIDIA's driver has them all.
#[test]
fn an_instance_of_an_older_vulkan_is_refused() {
    // For an instance of 1.0 the loader does not query features of later versions, so none are found.
    let refused =
        [(vk::API_VERSION_1_0, "lacks"), (vk::API_VERSION_1_1, "vkResetQueryPool: the instance must be of Vulkan 1.2")];
    for (version, words) in refused {
        let application = Application::of(version, &Context::requirements().extensions);
        for labels in [false, true] {
            let borrowed = BorrowedDevice { labels, ..application.borrowed() };
            match unsafe { Context::borrow(borrowed) } {
                Err(e) => assert!(e.to_string().contains(words), "{e}"),
                Ok(_) => assert!(application.has(c"vkResetQueryPool"), "{version:#x}"),
            }
        }
        let Application { entry, instance, physical_device, .. } = &application;
        let chosen = Context::choose(entry, instance, &ContextOptions::default()).map(drop);
        let described = unsafe { Context::describe(entry, instance, *physical_device) }.map(drop);
        assert_eq!([chosen.is_err(), described.is_err()], [version == vk::API_VERSION_1_0; 2]);
    }
}

/// A run that begins in the middle of a schedule uses all bands from its first step.
#[test]
fn pipelines_are_made_for_the_bands_that_a_run_uses() {
    let application = Application::new();
    let gpu = application.lend_with(vk::PipelineCache::null(), None);
    let (scene, views) = small(&gpu);
    let model = Model::upload(&gpu, &scene, 0).unwrap();
    let kernel = stages::ALL.iter().find(|kernel| kernel.name == "project_backward").unwrap();
    let degree = kernel.constants.iter().find(|constant| constant.name == c"sh_degree").unwrap().id;
    for (begins, degrees) in [(0.5, &[1][..]), (0.0, &[0, 1])] {
        let options = BaseOptions { iterations: 64, sh_degree: 1, begins };
        base_trainer(&Session::new(&gpu), &model, &views, &options).unwrap();
        let made = gpu.pipelines().into_iter().filter(|made| made.kernel == kernel.name);
        let made: BTreeSet<u32> = made
            .flat_map(|made| made.constants.into_iter().find(|(id, _)| *id == degree))
            .map(|(_, value)| value)
            .collect();
        assert!(made.iter().eq(degrees), "{made:?}");
    }
}

#[test]
fn a_loop_that_is_ended_early_has_done_what_it_says() {
    let gpu = Gpu::new();
    let (scene, views) = small(&gpu);
    let session = Session::new(&gpu);
    let options = BaseOptions { iterations: 128, sh_degree: 1, ..Default::default() };
    let whole = Model::upload(&gpu, &scene, 0).unwrap();
    let all = train_base(&session, &whole, &views, &options, false, |_| ()).unwrap().losses;

    let model = Model::upload(&gpu, &scene, 0).unwrap();
    let mut trainer = base_trainer(&session, &model, &views, &options).unwrap();
    trainer.start(false).unwrap();
    let seen = trainer.advance(&model, &views).unwrap().unwrap() as usize;
    let losses = trainer.stop().unwrap().losses;
    // Work in flight is done as well.
    assert!(losses.len() >= seen && losses.len() < 128, "{} steps, {seen} seen", losses.len());
    assert_eq!(losses, all[..losses.len()]);
    assert_eq!(trainer.advance(&model, &views).unwrap(), None);
    let (after, end) = (model.download().unwrap(), whole.download().unwrap());
    assert!(after.base.means != scene.base.means && after.base.means != end.base.means);

    let options = EnhanceOptions { ratio: 0.5, ..EnhanceOptions::quick() };
    let mut enhancer = Enhancer::new(&session, &scene, &views, &options).unwrap();
    assert!(enhancer.stop(&views).is_err());
    while let Some(event) = enhancer.next(&views).unwrap() {
        if let Event::Join { step, steps } = event {
            assert!(step < steps);
            // The first steps may have run out of room, and are repeated.
            if step > 0 {
                enhancer.stop(&views).unwrap();
            }
        }
    }
    let enhanced = enhancer.finish(&views).unwrap();
    let steps = enhanced.join.unwrap().losses.len();
    assert!(enhanced.lifted > 0 && (1..60).contains(&steps), "{steps} joint steps");
}
