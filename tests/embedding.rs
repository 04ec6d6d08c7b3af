//! glint inside somebody else's renderer: on the caller's device, and only recording into the caller's command buffer.

mod common;

use std::sync::{
    Arc,
    atomic::{AtomicBool, AtomicU64, Ordering::Relaxed},
};

use ash::vk;
use common::{Gpu, Turn};
use glint::{
    gpu::{BorrowedDevice, Buffer, Context, FeatureChain, GpuError, Kept, QueueLock, Recorder},
    pipelines::{
        enhance::{EnhanceOptions, Enhancer, Event},
        model::Model,
        render::{Needs, RenderOptions, Renderer, Show},
        session::Session,
        train::{BaseOptions, base_trainer, train_base},
        views::Views,
    },
    reference::{random_camera, random_scene},
    scene::Scene,
    stages::status,
};

/// An application's own device, made with what `Context::requirements` asks for.
struct Application {
    entry: ash::Entry,
    instance: ash::Instance,
    physical_device: vk::PhysicalDevice,
    device: ash::Device,
    queue_family: u32,
    _turn: Turn,
}

impl Application {
    fn new() -> Self {
        let turn = Turn::alone();
        unsafe {
            let entry = ash::Entry::load().unwrap();
            let app = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_2);
            let info = vk::InstanceCreateInfo::default().application_info(&app);
            let instance = entry.create_instance(&info, None).unwrap();
            let physical_device = instance.enumerate_physical_devices().unwrap()[0];
            let families = instance.get_physical_device_queue_family_properties(physical_device);
            let queue_family =
                families.iter().position(|f| f.queue_flags.contains(vk::QueueFlags::COMPUTE)).unwrap() as u32;
            let queues =
                [vk::DeviceQueueCreateInfo::default().queue_family_index(queue_family).queue_priorities(&[1.0])];
            let needed = Context::requirements();
            let extensions: Vec<_> = needed.extensions.iter().map(|e| e.as_ptr()).collect();
            let mut chain = FeatureChain::new(needed.features);
            let mut features = chain.link();
            let info = vk::DeviceCreateInfo::default()
                .queue_create_infos(&queues)
                .enabled_extension_names(&extensions)
                .push_next(&mut features);
            let device = instance.create_device(physical_device, &info, None).unwrap();
            Application { entry, instance, physical_device, device, queue_family, _turn: turn }
        }
    }

    fn queue(&self) -> vk::Queue {
        unsafe { self.device.get_device_queue(self.queue_family, 0) }
    }

    fn lend(&self) -> Context {
        self.lend_with(vk::PipelineCache::null(), None)
    }

    fn lend_with(&self, pipeline_cache: vk::PipelineCache, queue_lock: Option<QueueLock>) -> Context {
        let borrowed = BorrowedDevice {
            entry: self.entry.clone(),
            instance: self.instance.clone(),
            physical_device: self.physical_device,
            device: self.device.clone(),
            queue_family: self.queue_family,
            queue: self.queue(),
            optional: Default::default(),
            pipeline_cache,
            queue_lock,
            labels: false,
            memory_budget: None,
        };
        unsafe { Context::borrow(borrowed) }.unwrap()
    }
}

impl Drop for Application {
    fn drop(&mut self) {
        unsafe {
            self.device.destroy_device(None);
            self.instance.destroy_instance(None);
        }
    }
}

#[test]
fn a_view_recorded_into_the_callers_command_buffer_is_the_one_that_glint_renders_itself() {
    let (scene, camera) = (random_scene(7, 500, 100, 2), random_camera(61, 47));
    let own = {
        let gpu = Gpu::new();
        let views = Views::upload(&gpu, &[camera], &[]).unwrap();
        let model = Model::upload(&gpu, &scene, 0).unwrap();
        let mut renderer = Renderer::new(&gpu, Needs::of(&model), &views, RenderOptions::default()).unwrap();
        renderer.render(&model, &views, 0, [0.5; 3]).unwrap().color
    };

    let application = Application::new();
    let context = application.lend();
    let views = Views::upload(&context, &[camera], &[]).unwrap();
    let model = Model::upload(&context, &scene, 0).unwrap();
    let renderer = Renderer::new(&context, Needs::of(&model), &views, RenderOptions::default()).unwrap();
    let status = Buffer::<u32>::zeroed(&context, "status", status::WORDS).unwrap();
    let before = context.counters();
    let device = &application.device;
    unsafe {
        let pool_info = vk::CommandPoolCreateInfo::default().queue_family_index(application.queue_family);
        let pool = device.create_command_pool(&pool_info, None).unwrap();
        let info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
        let commands = device.allocate_command_buffers(&info).unwrap()[0];
        device.begin_command_buffer(commands, &vk::CommandBufferBeginInfo::default()).unwrap();
        assert!(matches!(Recorder::borrow(&context, commands, Kept::default()).submit(), Err(GpuError::NotOurs)));
        let mut recorder = Recorder::borrow(&context, commands, Kept::default());
        renderer.record(&mut recorder, &model, &views, 0, &Show::all(&model, [0.5; 3]), &status).unwrap();
        let kept = recorder.finish();
        assert!(!kept.is_empty());
        device.end_command_buffer(commands).unwrap();
        // Recording neither submitted nor waited; that is the application's.
        assert_eq!(context.counters(), before);
        let buffers = [commands];
        let submit = [vk::SubmitInfo::default().command_buffers(&buffers)];
        device.queue_submit(application.queue(), &submit, vk::Fence::null()).unwrap();
        device.queue_wait_idle(application.queue()).unwrap();
        device.destroy_command_pool(pool, None);
    }
    let image = renderer.raster.buffers.image.download_range(0, camera.pixels() as usize).unwrap();
    let recorded: Vec<f32> = image.iter().flat_map(|p| [p[0], p[1], p[2]]).collect();
    assert_eq!(own, recorded);
    drop((renderer, model, views, status, context));
}

/// A cache that an earlier run filled is the caller's to keep; what comes out of it renders the same bits.
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
        let mut renderer = Renderer::new(&context, Needs::of(&model), &views, RenderOptions::default()).unwrap();
        let image = renderer.render(&model, &views, 0, [0.5; 3]).unwrap().color;
        drop((renderer, model, views, context));
        // glint has left it to the caller.
        let data = device.get_pipeline_cache_data(cache).unwrap();
        device.destroy_pipeline_cache(cache, None);
        (image, data)
    };
    let (cold, data) = shot(&[]);
    // The header alone where a driver keeps nothing.
    assert!(data.len() >= 32);
    let (warm, again) = shot(&data);
    assert!(cold == warm, "a warm cache changes the image");
    assert!(again.len() >= data.len());
}

#[test]
fn the_callers_lock_is_held_at_every_submission() {
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
    // A lock that lets nothing through is not taken for a fault of the driver's.
    open.store(false, Relaxed);
    assert!(matches!(buffer.download(), Err(GpuError::NotSubmitted)));
}

#[test]
fn training_neither_submits_nor_waits_for_every_step() {
    let gpu = Gpu::new();
    let camera = random_camera(32, 24);
    let photo = vec![120u8; 3 * 32 * 24];
    let views = Views::upload(&gpu, &[camera, camera], &[&photo, &photo]).unwrap();
    let base = random_scene(3, 200, 0, 1).base;
    let model = Model::upload(&gpu, &Scene { base, supplement: None }, 0).unwrap();
    let train = |iterations| {
        let before = gpu.counters();
        let options = BaseOptions { iterations, sh_degree: 1, ..Default::default() };
        train_base(&Session::new(&gpu), &model, &views, &options, false, |_| ()).unwrap();
        let after = gpu.counters();
        (after.submissions - before.submissions, after.waits - before.waits)
    };
    // What is submitted before the loop does not depend on its length; within, 16 steps share a submission.
    let (short, long) = (train(16), train(16 + 320));
    assert_eq!(long.0 - short.0, 320 / 16);
    // A submission is waited for once at most, and not at all where it is done by then: how often is the machine's affair.
    assert!(long.1 <= long.0, "{long:?} after {short:?}");
}

/// A stage may take longer late in a run than in its first steps.
#[test]
fn steps_are_timed_all_through_a_run() {
    let gpu = Gpu::new();
    let camera = random_camera(32, 24);
    let photo = vec![120u8; 3 * 32 * 24];
    let views = Views::upload(&gpu, &[camera], &[&photo]).unwrap();
    let scene = Scene { base: random_scene(3, 200, 0, 1).base, supplement: None };
    let model = Model::upload(&gpu, &scene, 0).unwrap();
    // 17 submissions of 16 steps, of which the first, the ninth and the seventeenth are timed.
    let options = BaseOptions { iterations: 17 * 16, sh_degree: 1, ..Default::default() };
    let report = train_base(&Session::new(&gpu), &model, &views, &options, true, |_| ()).unwrap();
    let steps = report.steps.stages.iter().filter(|stage| stage.name == "step_done").count();
    assert_eq!(steps, if gpu.info().timestamp_period > 0.0 { 3 * 16 } else { 0 });
    let means = report.steps.milliseconds();
    assert!(means.is_empty() == (steps == 0) && means.iter().all(|(_, mean)| mean.is_finite()));
}

#[test]
fn what_a_renderer_was_not_made_for_is_an_error() {
    let gpu = Gpu::new();
    let views = Views::upload(&gpu, &[random_camera(32, 24)], &[]).unwrap();
    let [plain, augmented] = [0, 20].map(|m| Model::upload(&gpu, &random_scene(3, 50, m, 1), 0).unwrap());
    let mut renderer = Renderer::new(&gpu, Needs::of(&plain), &views, RenderOptions::default()).unwrap();
    let mut says =
        |model: &Model, view: u32| renderer.render(model, &views, view, [0.0; 3]).err().map(|e| e.to_string());
    assert_eq!(says(&plain, 0), None);
    assert!(says(&plain, 1).unwrap().contains("there are 1 views, and number 1"));
    assert!(says(&augmented, 0).unwrap().contains("without supplement"));
}

#[test]
fn a_loop_that_is_ended_early_has_done_what_it_says() {
    let gpu = Gpu::new();
    let camera = random_camera(32, 24);
    let photo = vec![120u8; 3 * 32 * 24];
    let views = Views::upload(&gpu, &[camera, camera], &[&photo, &photo]).unwrap();
    let scene = Scene { base: random_scene(3, 200, 0, 1).base, supplement: None };
    let session = Session::new(&gpu);
    let options = BaseOptions { iterations: 320, sh_degree: 1, ..Default::default() };
    let whole = Model::upload(&gpu, &scene, 0).unwrap();
    let all = train_base(&session, &whole, &views, &options, false, |_| ()).unwrap().losses;

    let model = Model::upload(&gpu, &scene, 0).unwrap();
    let mut trainer = base_trainer(&session, &model, &views, &options).unwrap();
    trainer.start(false).unwrap();
    let seen = trainer.advance(&model, &views).unwrap().unwrap() as usize;
    let losses = trainer.stop().unwrap().losses;
    // What was on its way is done as well.
    assert!(losses.len() >= seen && losses.len() < 320, "{} steps, {seen} seen", losses.len());
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
            // The first steps may have found no room, and are done again.
            if step > 0 {
                enhancer.stop(&views).unwrap();
            }
        }
    }
    let enhanced = enhancer.finish(&views).unwrap();
    let steps = enhanced.join.unwrap().losses.len();
    assert!(enhanced.lifted > 0 && (1..60).contains(&steps), "{steps} joint steps");
}
