//! Draws a frame of a scene with `Frames`: on this program's device, in its command buffer, into its memory. Writes a PPM file.
//!
//!     cargo run --release --no-default-features --example frames -- SCENE.ply OUT.ppm
//!
//! A renderer has a device, a command buffer and an image already. `tests/outside/mesh` draws into an image, behind a mesh.

use std::{env, error::Error, fs, path::Path};

use glint::{
    data::read_scene,
    gpu::{
        BorrowedDevice, Buffer, BufferRange, Context, ContextOptions, FeatureChain, Kept, Location, Pixels, Recorder,
        ash::{self, vk},
    },
    pipelines::{
        frames::{Frame, FrameView, Frames, Instance, Limits, SYNC_WRITTEN, Target, Texel},
        model::{Room, Upload},
    },
    scene::{
        Camera,
        glam::{DMat3, DVec3},
    },
};

type Outcome<T> = Result<T, Box<dyn Error>>;

fn main() -> Outcome<()> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [scene, output] = &arguments[..] else { return Err("expected SCENE.ply OUT.ppm".into()) };
    // A camera two units before the origin, looking along z. With matrices, there is `FrameView::from_matrices`.
    let (width, height, focal, translation) = (640, 480, 500.0, DVec3::new(0.0, 0.0, 2.0));
    let [cx, cy] = [width, height].map(|side| f64::from(side) / 2.0);
    let camera = Camera { width, height, fx: focal, fy: focal, cx, cy, rotation: DMat3::IDENTITY, translation };
    unsafe { draw(scene.as_ref(), &camera, output.as_ref()) }
}

/// # Safety
/// No other thread uses Vulkan's loader.
pub unsafe fn draw(scene: &Path, camera: &Camera, output: &Path) -> Outcome<()> {
    unsafe {
        let entry = ash::Entry::load()?;
        let version = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_2);
        let instance = entry.create_instance(&vk::InstanceCreateInfo::default().application_info(&version), None)?;
        // An error names the feature or the limit that the device lacks.
        let (physical_device, offered) = Context::choose(&entry, &instance, &ContextOptions::default())?;
        let families = instance.get_physical_device_queue_family_properties(physical_device);
        let family = families.iter().position(|f| f.queue_flags.contains(vk::QueueFlags::COMPUTE));
        let queue_family = family.ok_or("no queue for compute")? as u32;
        // Requirements that the device does not offer have a slower substitute.
        let mut needed = Context::requirements();
        let known = instance.enumerate_device_extension_properties(physical_device)?;
        needed.extensions.retain(|name| known.iter().any(|e| e.extension_name_as_c_str() == Ok(*name)));
        let extensions: Vec<_> = needed.extensions.iter().map(|name| name.as_ptr()).collect();
        let mut chain = FeatureChain::new(needed.features.into_iter().filter(|feature| offered.contains(feature)));
        let mut features = chain.link();
        let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(queue_family).queue_priorities(&[1.0])];
        let info = vk::DeviceCreateInfo::default().queue_create_infos(&queues).enabled_extension_names(&extensions);
        let device = instance.create_device(physical_device, &info.push_next(&mut features), None)?;
        let info = vk::CommandPoolCreateInfo::default().queue_family_index(queue_family);
        let pool = device.create_command_pool(&info, None)?;
        let lent = BorrowedDevice {
            entry: entry.clone(), // the last one unloads Vulkan: this program's must outlive its device
            instance: instance.clone(),
            physical_device,
            device: device.clone(),
            queue_family,
            queue: device.get_device_queue(queue_family, 0),
            optional: Default::default(),
            pipeline_cache: vk::PipelineCache::null(),
            queue_lock: None,
            labels: false,
            memory_budget: None,
        };
        // glint destroys none of this, and its objects must be dropped first: they stay in `frame`, also on an error.
        let drawn = frame(lent, pool, scene, camera);
        device.destroy_command_pool(pool, None);
        device.destroy_device(None);
        instance.destroy_instance(None);
        let mut ppm = format!("P6 {} {} 255\n", camera.width, camera.height).into_bytes();
        ppm.extend(drawn?.iter().flat_map(|[r, g, b, _]| [r, g, b]));
        Ok(fs::write(output, ppm)?)
    }
}

/// The frame's pixels, RGBA.
unsafe fn frame(lent: BorrowedDevice, pool: vk::CommandPool, scene: &Path, camera: &Camera) -> Outcome<Vec<[u8; 4]>> {
    unsafe {
        let (device, queue, [width, height]) = (lent.device.clone(), lent.queue, [camera.width, camera.height]);
        let context = Context::borrow(lent)?;
        let room = Room { half: true, ..Room::default() };
        let upload = Upload::prepare(&context, DVec3::ZERO, &read_scene(scene)?, room)?;
        let info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
        let commands = device.allocate_command_buffers(&info)?[0];
        device.begin_command_buffer(commands, &vk::CommandBufferBeginInfo::default())?;
        // Once for a scene. Frames may follow on the same queue at once; another queue needs a semaphore.
        let mut recorder = Recorder::borrow(&context, commands, Kept::default());
        upload.record(&mut recorder)?;
        let loading = recorder.finish();
        let model = upload.finish()?;
        let mut frames = Frames::new(&context, Limits::of(&model, width, height))?;
        let pixels = Buffer::<[u8; 4]>::new(&context, "pixels", (width * height) as usize, Location::Host)?;
        // For every frame. An invalid frame is an error and records nothing.
        let target = Pixels::Buffer(BufferRange { buffer: pixels.raw().handle(), offset: 0 });
        let view = FrameView { color: Some(Target::new(target, Texel::Rgba8)), ..FrameView::new(*camera) };
        frames.record(commands, &Frame { slot: 0, instances: &[Instance::of(&model)], views: &[view] })?;
        // glint synchronizes its own buffers. The target is the caller's: glint writes it by a transfer, and the host waits for that.
        let (stage, access) = SYNC_WRITTEN;
        let read = vk::MemoryBarrier::default().src_access_mask(access).dst_access_mask(vk::AccessFlags::HOST_READ);
        let (host, none) = (vk::PipelineStageFlags::HOST, vk::DependencyFlags::empty());
        device.cmd_pipeline_barrier(commands, stage, host, none, &[read], &[], &[]);
        device.end_command_buffer(commands)?;
        device.queue_submit(queue, &[vk::SubmitInfo::default().command_buffers(&[commands])], vk::Fence::null())?;
        device.queue_wait_idle(queue)?;
        drop(loading); // the commands have run: staging memory may go, and slot 0 may be recorded again
        // Too many intersections are not an error: far Gaussians are missing, and `reserve` makes room for the next frame.
        if let Some(needed) = frames.report(0)?.needed {
            frames.reserve(needed)?;
        }
        Ok(pixels.mapped().to_vec())
    }
}
