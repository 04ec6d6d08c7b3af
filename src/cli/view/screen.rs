//! A window's images on a device that is made here and lent to glint, as any renderer would lend its own: the one file of the
//! program that calls Vulkan itself.

use std::{
    ffi::CStr,
    rc::Rc,
    sync::{Arc, Mutex},
    time::{Duration, Instant},
};

use ash::{ext, khr, vk};
use winit::{
    raw_window_handle::{HasDisplayHandle, HasWindowHandle},
    window::Window,
};

use crate::{
    Result,
    gpu::{
        BorrowedDevice, Buffer, BufferRange, Context, ContextOptions, Feature, FeatureChain, GpuError, ImageRegion,
        Kept, Location, Pixels, Recorder, StageTime, create_instance, create_messenger,
    },
    pipelines::frames::{Blend, DepthForm, Frame, FrameView, Frames, Instance, Target, Texel},
    scene::Camera,
};

/// Frames in flight: one is drawn while the next is recorded.
pub(super) const IN_FLIGHT: u32 = 2;
/// How long to wait for an image of the window: a compositor may keep them all while nobody looks.
pub(super) const PATIENCE: Duration = Duration::from_secs(1);
/// Times that a picture is drawn again with more room for intersections.
const TRIES: u32 = 4;

/// What a frame shows.
pub(super) enum Shown<'a> {
    /// Drawn by the device straight into the window's image.
    Scene(Box<Scene<'a>>),
    /// Pixels of the window's size, 3 bytes each.
    Picture(&'a [u8]),
}

/// A scene from a camera.
pub(super) struct Scene<'a> {
    pub(super) frames: &'a mut Frames,
    pub(super) instance: Instance<'a>,
    pub(super) camera: Camera,
    /// sRGB.
    pub(super) background: [f32; 3],
}

/// How a frame went.
pub(super) struct Drawn {
    /// False where the window had no image to draw on, because it is hidden or changes its size.
    pub(super) shown: bool,
    /// The pixels that the window shows, 3 bytes each, where they were asked for.
    pub(super) pixels: Option<Vec<u8>>,
}

/// What pixels are asked for as numbers.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Wanted {
    /// sRGB values, three a pixel.
    Color,
    /// Camera z, one a pixel, 0 where there is none.
    Depth,
}

/// What must outlive device and surface.
struct Instanced {
    entry: ash::Entry,
    instance: ash::Instance,
    debug: bool,
    messages: Arc<Mutex<Vec<String>>>,
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
}

/// What of a window a device draws on.
struct Surface {
    surfaces: khr::surface::Instance,
    surface: vk::SurfaceKHR,
    // The surface is this window's.
    window: Arc<Window>,
    // After the surface.
    instanced: Rc<Instanced>,
}

/// A device that is lent to glint. It may outlive the window that it was chosen for; all that is made on it must be dropped before.
pub(super) struct Lender {
    context: Option<Context>,
    device: ash::Device,
    // After the device.
    instanced: Rc<Instanced>,
}

/// A frame in flight.
struct Slot {
    commands: vk::CommandBuffer,
    fence: vk::Fence,
    acquired: vk::Semaphore,
    /// Submitted, and not waited for since.
    pending: bool,
    /// It draws a scene, and not only copies a picture.
    draws: bool,
    /// What copies hold on to.
    kept: Kept,
}

/// The window's images.
#[derive(Default)]
struct Chain {
    handle: vk::SwapchainKHR,
    images: Vec<vk::Image>,
    /// Of each image, signalled when it is drawn.
    drawn: Vec<vk::Semaphore>,
    /// Pixels; 0 where the window is hidden.
    size: [u32; 2],
    readable: bool,
    /// The window has changed.
    stale: bool,
}

/// A window with the device that draws in it.
pub(super) struct Screen {
    presenter: khr::swapchain::Device,
    device: ash::Device,
    physical: vk::PhysicalDevice,
    queue: vk::Queue,
    pool: vk::CommandPool,
    /// Two timestamps a slot.
    queries: vk::QueryPool,
    slots: Vec<Slot>,
    next: usize,
    chain: Chain,
    format: vk::SurfaceFormatKHR,
    texel: Texel,
    /// The slot of the last scene that was drawn.
    last: Option<usize>,
    /// Of the device for the last scene that was waited for.
    time: Option<Duration>,
    /// How long the host has waited for the device.
    waited: Duration,
    surface: Surface,
    // Last, as it must be dropped.
    lender: Rc<Lender>,
}

fn named(call: &'static str) -> impl Fn(vk::Result) -> GpuError {
    move |result| GpuError::Vulkan { call, result }
}

impl Surface {
    fn new(window: Arc<Window>, validation: bool) -> Result<Self, GpuError> {
        let no_handle = |error| GpuError::NoDevice(format!(": the window has no handle: {error}"));
        let display_handle = window.display_handle().map_err(no_handle)?.as_raw();
        let window_handle = window.window_handle().map_err(no_handle)?.as_raw();
        let names = ash_window::enumerate_required_extensions(display_handle)
            .map_err(named("enumerate_required_extensions"))?;
        // SAFETY: the list is of static strings.
        let names: Vec<&CStr> = names.iter().map(|name| unsafe { CStr::from_ptr(*name) }).collect();
        let (entry, instance, debug) = create_instance(validation, &names)?;
        let mut instanced = Instanced { entry, instance, debug, messages: Arc::default(), messenger: None };
        if validation {
            instanced.messenger = Some(create_messenger(&instanced.entry, &instanced.instance, &instanced.messages)?);
        }
        let (entry, instance) = (&instanced.entry, &instanced.instance);
        let surfaces = khr::surface::Instance::new(entry, instance);
        // SAFETY: the handles are of the window, which this keeps; the instance has the extensions.
        let surface = unsafe { ash_window::create_surface(entry, instance, display_handle, window_handle, None) }
            .map_err(named("vkCreateSurface"))?;
        Ok(Surface { surfaces, surface, window, instanced: Rc::new(instanced) })
    }

    /// A family that computes and can show what it has drawn in the window.
    fn queue_family(&self, physical: vk::PhysicalDevice) -> Result<u32, GpuError> {
        // SAFETY: queries of live handles.
        let (families, name) = unsafe {
            let instance = &self.instanced.instance;
            let name = instance.get_physical_device_properties(physical);
            (instance.get_physical_device_queue_family_properties(physical), name)
        };
        let fits = |(i, family): &(u32, &vk::QueueFamilyProperties)| {
            // SAFETY: as above.
            family.queue_flags.contains(vk::QueueFlags::COMPUTE)
                && unsafe { self.surfaces.get_physical_device_surface_support(physical, *i, self.surface) }
                    .unwrap_or(false)
        };
        (0..).zip(&families).find(fits).map(|(i, _)| i).ok_or_else(|| GpuError::Missing {
            device: name.device_name_as_c_str().map_or(String::new(), |n| n.to_string_lossy().into_owned()),
            feature: "a queue that computes and draws in this window (--device chooses another device)".into(),
        })
    }

    /// A device with all that glint can use, and a swapchain.
    fn device(
        &self,
        physical: vk::PhysicalDevice,
        family: u32,
        offered: impl IntoIterator<Item = Feature>,
    ) -> Result<ash::Device, GpuError> {
        let features: Vec<Feature> = offered.into_iter().collect();
        let mut names = Context::requirements().extensions;
        names.extend(features.iter().filter_map(|feature| feature.extension()));
        names.extend([khr::swapchain::NAME, khr::portability_subset::NAME]);
        names.sort_unstable();
        names.dedup();
        // SAFETY: queries and a creation on live handles, from structures that live for the call.
        unsafe {
            let there = self.instanced.instance.enumerate_device_extension_properties(physical).unwrap_or_default();
            // What became a part of Vulkan 1.3 need not be there as an extension; what is missing else, the device says.
            let has = |name: &&CStr| there.iter().any(|e| e.extension_name_as_c_str().is_ok_and(|n| n == *name));
            let extensions: Vec<_> =
                names.iter().filter(|n| has(n) || **n == khr::swapchain::NAME).map(|n| n.as_ptr()).collect();
            let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&[1.0])];
            let mut chain = FeatureChain::new(features);
            let mut features = chain.link();
            let info = vk::DeviceCreateInfo::default()
                .queue_create_infos(&queues)
                .enabled_extension_names(&extensions)
                .push_next(&mut features);
            self.instanced.instance.create_device(physical, &info, None).map_err(named("vkCreateDevice"))
        }
    }

    /// 8 bits a channel, encoded as glint's pixels are.
    fn format(&self, physical: vk::PhysicalDevice) -> Result<(vk::SurfaceFormatKHR, Texel), GpuError> {
        // SAFETY: a query of live handles.
        let formats = unsafe { self.surfaces.get_physical_device_surface_formats(physical, self.surface) }
            .map_err(named("vkGetPhysicalDeviceSurfaceFormatsKHR"))?;
        let texel = |f: &vk::SurfaceFormatKHR| {
            let usual = f.color_space == vk::ColorSpaceKHR::SRGB_NONLINEAR;
            Texel::of(f.format).filter(|texel| usual && texel.words() == 1).map(|texel| (*f, texel))
        };
        formats.iter().find_map(texel).ok_or_else(|| GpuError::Missing {
            device: "the window".into(),
            feature: format!("a format of 8 bits a channel (it has {formats:?})"),
        })
    }
}

impl Drop for Instanced {
    fn drop(&mut self) {
        // SAFETY: device and surface are gone, and with them all that used these.
        unsafe {
            if let Some((utils, messenger)) = &self.messenger {
                utils.destroy_debug_utils_messenger(*messenger, None);
            }
            self.instance.destroy_instance(None);
        }
    }
}

impl Drop for Surface {
    fn drop(&mut self) {
        // SAFETY: its swapchain is gone; the instance is there.
        unsafe { self.surfaces.destroy_surface(self.surface, None) };
    }
}

impl Drop for Lender {
    fn drop(&mut self) {
        // SAFETY: the device is done with all; what glint made on it is gone, see above, and now glint is too.
        unsafe {
            let _ = self.device.device_wait_idle();
            drop(self.context.take());
            self.device.destroy_device(None);
        }
    }
}

impl Lender {
    /// What models and frames are made on.
    pub(super) fn context(&self) -> &Context {
        // Set as soon as anybody has it, and taken by `drop` only.
        self.context.as_ref().expect("a lender has lent its device")
    }

    /// What the validation layers say, also after the device is gone.
    pub(super) fn messages(&self) -> Arc<Mutex<Vec<String>>> {
        self.instanced.messages.clone()
    }
}

impl Screen {
    /// A device that can draw in `window`, chosen as glint chooses its own.
    pub(super) fn new(window: Arc<Window>, options: &ContextOptions) -> Result<Self, GpuError> {
        let surface = Surface::new(window, options.validation)?;
        let instanced = surface.instanced.clone();
        let (physical, offered) = Context::choose(&instanced.entry, &instanced.instance, options)?;
        let family = surface.queue_family(physical)?;
        let (format, texel) = surface.format(physical)?;
        let device = surface.device(physical, family, offered.iter().copied())?;
        let mut lender = Lender { context: None, device: device.clone(), instanced: instanced.clone() };
        // SAFETY: the family and index 0 were asked for at creation.
        let queue = unsafe { device.get_device_queue(family, 0) };
        let borrowed = BorrowedDevice {
            entry: instanced.entry.clone(),
            instance: instanced.instance.clone(),
            physical_device: physical,
            device: device.clone(),
            queue_family: family,
            queue,
            optional: offered,
            pipeline_cache: vk::PipelineCache::null(),
            // One thread draws and loads.
            queue_lock: None,
            labels: instanced.debug,
            memory_budget: options.memory_budget,
        };
        // SAFETY: the handles belong together, the device has what is asked for and outlives the context: see `Lender`.
        lender.context = Some(unsafe { Context::borrow(borrowed) }?);
        let mut screen = Screen {
            presenter: khr::swapchain::Device::new(&instanced.instance, &device),
            device,
            physical,
            queue,
            pool: vk::CommandPool::null(),
            queries: vk::QueryPool::null(),
            slots: Vec::new(),
            next: 0,
            chain: Chain { stale: true, ..Default::default() },
            format,
            texel,
            last: None,
            time: None,
            waited: Duration::ZERO,
            surface,
            lender: Rc::new(lender),
        };
        screen.make_slots(family)?;
        screen.fit()?;
        Ok(screen)
    }

    /// Who lends the device: it stays when the window goes.
    pub(super) fn lender(&self) -> Rc<Lender> {
        self.lender.clone()
    }

    fn make_slots(&mut self, family: u32) -> Result<(), GpuError> {
        let device = &self.device;
        // SAFETY: creations from structures that live for their calls; `drop` destroys what there is.
        unsafe {
            let info = vk::CommandPoolCreateInfo::default()
                .queue_family_index(family)
                .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
            self.pool = device.create_command_pool(&info, None).map_err(named("vkCreateCommandPool"))?;
            let info =
                vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(2 * IN_FLIGHT);
            self.queries = device.create_query_pool(&info, None).map_err(named("vkCreateQueryPool"))?;
            let info = vk::CommandBufferAllocateInfo::default().command_pool(self.pool).command_buffer_count(IN_FLIGHT);
            for commands in device.allocate_command_buffers(&info).map_err(named("vkAllocateCommandBuffers"))? {
                let semaphore = vk::SemaphoreCreateInfo::default();
                self.slots.push(Slot {
                    commands,
                    fence: device.create_fence(&Default::default(), None).map_err(named("vkCreateFence"))?,
                    acquired: device.create_semaphore(&semaphore, None).map_err(named("vkCreateSemaphore"))?,
                    pending: false,
                    draws: false,
                    kept: Kept::default(),
                });
            }
        }
        Ok(())
    }

    /// What models and frames are made on.
    pub(super) fn context(&self) -> &Context {
        self.lender.context()
    }

    /// Of the device for drawing the last scene that was waited for.
    pub(super) fn time(&self) -> Option<Duration> {
        self.time
    }

    /// How long the host has waited for the device, all together.
    pub(super) fn waited(&self) -> Duration {
        self.waited
    }

    /// Frames that were drawn are not asked about any more.
    pub(super) fn forget(&mut self) {
        self.last = None;
    }

    /// The window's size may have changed.
    pub(super) fn resized(&mut self) {
        self.chain.stale = true;
    }

    /// Pixels of the window's images; 0 while it is hidden. Makes them anew where the window has changed.
    pub(super) fn size(&mut self) -> Result<[u32; 2], GpuError> {
        if self.chain.stale {
            self.fit()?;
        }
        Ok(self.chain.size)
    }

    /// Images of the window's size.
    fn fit(&mut self) -> Result<(), GpuError> {
        self.finish()?;
        let Surface { surfaces, surface, window, .. } = &self.surface;
        // SAFETY: nothing that the device does uses the old images, which the new swapchain takes the place of.
        unsafe {
            let began = Instant::now();
            self.device.device_wait_idle().map_err(named("vkDeviceWaitIdle"))?;
            self.waited += began.elapsed();
            let can = surfaces
                .get_physical_device_surface_capabilities(self.physical, *surface)
                .map_err(named("vkGetPhysicalDeviceSurfaceCapabilitiesKHR"))?;
            let (least, most) = (can.min_image_extent, can.max_image_extent);
            let extent = match can.current_extent {
                vk::Extent2D { width: u32::MAX, .. } => {
                    let size = window.inner_size();
                    vk::Extent2D {
                        width: size.width.clamp(least.width, most.width),
                        height: size.height.clamp(least.height, most.height),
                    }
                }
                current => current,
            };
            let old = std::mem::take(&mut self.chain);
            old.drawn.iter().for_each(|semaphore| self.device.destroy_semaphore(*semaphore, None));
            if extent.width == 0 || extent.height == 0 {
                self.presenter.destroy_swapchain(old.handle, None);
                self.chain.stale = true;
                return Ok(());
            }
            if !can.supported_usage_flags.contains(vk::ImageUsageFlags::TRANSFER_DST) {
                let feature = "images that can be copied to".into();
                return Err(GpuError::Missing { device: "the window".into(), feature });
            }
            let readable = can.supported_usage_flags & vk::ImageUsageFlags::TRANSFER_SRC;
            let opaque = vk::CompositeAlphaFlagsKHR::OPAQUE;
            let alpha = can.supported_composite_alpha;
            let info = vk::SwapchainCreateInfoKHR::default()
                .surface(*surface)
                .min_image_count((can.min_image_count + 1).min(match can.max_image_count {
                    0 => u32::MAX,
                    most => most,
                }))
                .image_format(self.format.format)
                .image_color_space(self.format.color_space)
                .image_extent(extent)
                .image_array_layers(1)
                .image_usage(vk::ImageUsageFlags::TRANSFER_DST | readable)
                .pre_transform(can.current_transform)
                .composite_alpha(if alpha.contains(opaque) { opaque } else { vk::CompositeAlphaFlagsKHR::INHERIT })
                .present_mode(vk::PresentModeKHR::FIFO)
                .clipped(true)
                .old_swapchain(old.handle);
            let made = self.presenter.create_swapchain(&info, None);
            self.presenter.destroy_swapchain(old.handle, None);
            self.chain.handle = made.map_err(named("vkCreateSwapchainKHR"))?;
            self.chain.images =
                self.presenter.get_swapchain_images(self.chain.handle).map_err(named("vkGetSwapchainImagesKHR"))?;
            for _ in 0..self.chain.images.len() {
                let made = self.device.create_semaphore(&Default::default(), None);
                self.chain.drawn.push(made.map_err(named("vkCreateSemaphore"))?);
            }
            self.chain.size = [extent.width, extent.height];
            self.chain.readable = !readable.is_empty();
        }
        Ok(())
    }

    /// Waits for a slot's frame.
    fn settle(&mut self, slot: usize) -> Result<(), GpuError> {
        let Slot { fence, pending, draws, .. } = &mut self.slots[slot];
        if !std::mem::take(pending) {
            return Ok(());
        }
        let (fence, draws) = (*fence, *draws);
        // SAFETY: the fence was submitted; of the slot's two timestamps both are written once it is signalled.
        unsafe {
            let began = Instant::now();
            self.device.wait_for_fences(&[fence], true, u64::MAX).map_err(named("vkWaitForFences"))?;
            self.waited += began.elapsed();
            let period = f64::from(self.context().info().timestamp_period);
            if period > 0.0 && draws {
                let mut stamps = [0u64; 2];
                let flags = vk::QueryResultFlags::TYPE_64;
                let read = self.device.get_query_pool_results(self.queries, 2 * slot as u32, &mut stamps, flags);
                let ticks = stamps[1].wrapping_sub(stamps[0]);
                self.time = read.ok().map(|()| Duration::from_nanos((ticks as f64 * period) as u64));
            }
        }
        Ok(())
    }

    /// Whether all that was drawn is done, without waiting.
    pub(super) fn is_done(&self) -> bool {
        // SAFETY: queries of live handles.
        self.slots.iter().all(|s| !s.pending || unsafe { self.device.get_fence_status(s.fence) }.unwrap_or(true))
    }

    /// Waits for all that is in flight.
    pub(super) fn finish(&mut self) -> Result<(), GpuError> {
        (0..self.slots.len()).try_for_each(|slot| self.settle(slot))
    }

    /// Opens a slot's commands.
    fn begin(&mut self, slot: usize) -> Result<vk::CommandBuffer, GpuError> {
        self.settle(slot)?;
        let commands = self.slots[slot].commands;
        let info = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the slot's commands have run.
        unsafe {
            self.device.begin_command_buffer(commands, &info).map_err(named("vkBeginCommandBuffer"))?;
            self.device.cmd_reset_query_pool(commands, self.queries, 2 * slot as u32, 2);
        }
        self.stamp(slot, 0);
        Ok(commands)
    }

    fn stamp(&self, slot: usize, which: u32) {
        if self.context().info().timestamp_period > 0.0 {
            let (commands, stage) = (self.slots[slot].commands, vk::PipelineStageFlags::BOTTOM_OF_PIPE);
            // SAFETY: the commands are recording, and have reset the query.
            unsafe { self.device.cmd_write_timestamp(commands, stage, self.queries, 2 * slot as u32 + which) };
        }
    }

    /// Ends a slot's commands and hands them to the queue, to run between two semaphores.
    fn submit(&mut self, slot: usize, between: Option<[vk::Semaphore; 2]>) -> Result<(), GpuError> {
        self.stamp(slot, 1);
        let Slot { commands, fence, .. } = self.slots[slot];
        let buffers = [commands];
        let stages = [vk::PipelineStageFlags::TRANSFER];
        let mut info = vk::SubmitInfo::default().command_buffers(&buffers);
        if let Some([wait, signal]) = &between {
            info = info
                .wait_semaphores(std::slice::from_ref(wait))
                .wait_dst_stage_mask(&stages)
                .signal_semaphores(std::slice::from_ref(signal));
        }
        // SAFETY: the commands are recording; this thread alone uses the queue.
        unsafe {
            self.device.end_command_buffer(commands).map_err(named("vkEndCommandBuffer"))?;
            self.device.reset_fences(&[fence]).map_err(named("vkResetFences"))?;
            self.device.queue_submit(self.queue, &[info], fence).map_err(named("vkQueueSubmit"))?;
        }
        self.slots[slot].pending = true;
        Ok(())
    }

    /// Brings an image of the window into another layout, between copies.
    fn turn(&self, commands: vk::CommandBuffer, image: vk::Image, from: vk::ImageLayout, to: vk::ImageLayout) {
        let transfer = vk::PipelineStageFlags::TRANSFER;
        let access = |layout| match layout {
            vk::ImageLayout::TRANSFER_DST_OPTIMAL => vk::AccessFlags::TRANSFER_WRITE,
            vk::ImageLayout::TRANSFER_SRC_OPTIMAL => vk::AccessFlags::TRANSFER_READ,
            // Semaphores stand between.
            _ => vk::AccessFlags::empty(),
        };
        let all = vk::ImageSubresourceRange {
            aspect_mask: vk::ImageAspectFlags::COLOR,
            level_count: 1,
            layer_count: 1,
            ..Default::default()
        };
        let barrier = vk::ImageMemoryBarrier::default()
            .image(image)
            .old_layout(from)
            .new_layout(to)
            .src_access_mask(access(from))
            .dst_access_mask(access(to))
            .subresource_range(all);
        let none = vk::DependencyFlags::empty();
        // SAFETY: the commands are recording; the image is the window's.
        unsafe { self.device.cmd_pipeline_barrier(commands, transfer, transfer, none, &[], &[], &[barrier]) };
    }

    /// Draws the next frame, where the window has an image for it within `patience`. With `save` waits for it and gives the pixels
    /// that the window shows.
    pub(super) fn show(&mut self, shown: Shown<'_>, save: bool, patience: Duration) -> Result<Drawn> {
        let nothing = Drawn { shown: false, pixels: None };
        let size = self.size()?;
        let fits = match &shown {
            Shown::Scene(scene) => [scene.camera.width, scene.camera.height] == size,
            Shown::Picture(rgb) => rgb.len() == 3 * (size[0] as usize) * (size[1] as usize),
        };
        // Hidden, or of another size since the picture was made.
        if size == [0, 0] || !fits {
            return Ok(nothing);
        }
        let slot = self.next;
        self.settle(slot)?;
        let acquired = self.slots[slot].acquired;
        // SAFETY: the semaphore was waited for by the slot's last commands, which have run.
        let got = unsafe {
            let patience = patience.as_nanos() as u64;
            self.presenter.acquire_next_image(self.chain.handle, patience, acquired, vk::Fence::null())
        };
        let index = match got {
            Ok((index, suboptimal)) => {
                self.chain.stale |= suboptimal;
                index
            }
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => {
                self.chain.stale = true;
                return Ok(nothing);
            }
            Err(vk::Result::TIMEOUT | vk::Result::NOT_READY) => return Ok(nothing),
            Err(error) => return Err(named("vkAcquireNextImageKHR")(error).into()),
        };
        let (image, drawn) = (self.chain.images[index as usize], self.chain.drawn[index as usize]);
        let save = save && self.chain.readable;
        let commands = self.begin(slot)?;
        self.turn(commands, image, vk::ImageLayout::UNDEFINED, vk::ImageLayout::TRANSFER_DST_OPTIMAL);
        let target = Pixels::Image(ImageRegion::of(image, self.format.format, vk::ImageLayout::TRANSFER_DST_OPTIMAL));
        let mut kept = std::mem::take(&mut self.slots[slot].kept);
        let draws = matches!(shown, Shown::Scene(_));
        match shown {
            Shown::Scene(scene) => {
                let Scene { frames, instance, camera, background } = *scene;
                let color = Target { blend: Blend::Opaque(background), ..Target::new(target, self.texel) };
                let views = [FrameView { color: Some(color), ..FrameView::new(camera) }];
                let frame = Frame { slot: slot as u32, instances: &[instance], views: &views };
                // SAFETY: the image is of the window's size and in the layout that is said, the slot's commands have run.
                unsafe { frames.record(commands, &frame) }?;
                self.last = Some(slot);
            }
            Shown::Picture(rgb) => {
                let words: Vec<u32> = rgb.chunks_exact(3).map(|p| self.word([p[0], p[1], p[2]])).collect();
                let staging = Buffer::new(self.context(), "picture", words.len(), Location::Upload)?;
                staging.write_mapped(&words);
                // SAFETY: as above; the picture is of the window's size.
                kept = unsafe {
                    let mut recorder = Recorder::borrow(self.context(), commands, kept);
                    recorder.hand(&staging, &target, size, 1);
                    recorder.finish()
                };
            }
        }
        let mut from = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
        let mut saved = None;
        if save {
            let to = vk::ImageLayout::TRANSFER_SRC_OPTIMAL;
            self.turn(commands, image, from, to);
            from = to;
            let pixels = (size[0] * size[1]) as usize;
            let buffer = Buffer::<u32>::new(self.context(), "screenshot", pixels, Location::Readback)?;
            // SAFETY: the image is in that layout. What the recorder keeps besides is kept by the frames or below.
            unsafe {
                let mut recorder = Recorder::borrow(self.context(), commands, Kept::default());
                recorder.bring(&Pixels::Image(ImageRegion::of(image, self.format.format, to)), &buffer, size, 1);
                recorder.host_barrier();
                recorder.finish();
            }
            saved = Some(buffer);
        }
        self.turn(commands, image, from, vk::ImageLayout::PRESENT_SRC_KHR);
        self.slots[slot].kept = kept;
        self.slots[slot].draws = draws;
        self.submit(slot, Some([acquired, drawn]))?;
        self.next = (slot + 1) % self.slots.len();
        let (waits, chains, indices) = ([drawn], [self.chain.handle], [index]);
        let info = vk::PresentInfoKHR::default().wait_semaphores(&waits).swapchains(&chains).image_indices(&indices);
        // SAFETY: the image was acquired, and its semaphore is signalled by what was submitted.
        match unsafe { self.presenter.queue_present(self.queue, &info) } {
            Ok(suboptimal) => self.chain.stale |= suboptimal,
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => self.chain.stale = true,
            Err(error) => return Err(named("vkQueuePresentKHR")(error).into()),
        }
        let pixels = match saved {
            Some(buffer) => {
                self.settle(slot)?;
                Some(buffer.mapped().iter().flat_map(|&word| self.rgb(word)).collect())
            }
            None => None,
        };
        Ok(Drawn { shown: true, pixels })
    }

    /// A pixel as the window has it.
    fn word(&self, [r, g, b]: [u8; 3]) -> u32 {
        u32::from_le_bytes(if self.texel == Texel::Bgra8 { [b, g, r, 255] } else { [r, g, b, 255] })
    }

    fn rgb(&self, word: u32) -> [u8; 3] {
        let [a, b, c, _] = word.to_le_bytes();
        if self.texel == Texel::Bgra8 { [c, b, a] } else { [a, b, c] }
    }

    /// The last frame's intersections beyond those that there was room for: makes room, and says whether the frame should be drawn
    /// again. Waits.
    pub(super) fn make_room(&mut self, frames: &mut Frames) -> Result<bool> {
        self.finish()?;
        let reports = (0..IN_FLIGHT).filter_map(|slot| frames.report(slot).ok());
        let Some(needed) = reports.filter_map(|report| report.needed).max() else { return Ok(false) };
        let more = needed > frames.capacity();
        frames.reserve(needed)?;
        Ok(more)
    }

    /// What `scene` shows as numbers, not in the window. Waits.
    pub(super) fn numbers(&mut self, scene: &mut Scene<'_>, wanted: Wanted) -> Result<Vec<f32>> {
        self.finish()?;
        let pixels = scene.camera.pixels() as usize;
        let words = if wanted == Wanted::Color { 4 } else { 1 };
        let buffer = Buffer::<f32>::new(self.context(), "numbers", words * pixels, Location::Readback)?;
        let target = Pixels::Buffer(BufferRange { buffer: buffer.raw().handle(), offset: 0 });
        let mut view = FrameView::new(scene.camera);
        match wanted {
            Wanted::Color => {
                let blend = Blend::Opaque(scene.background);
                view.color = Some(Target { blend, ..Target::new(target, Texel::Rgba32F) });
            }
            // The reciprocal of z, 0 at infinity.
            Wanted::Depth => {
                view.depth_out = Some(target);
                view.depth_form = DepthForm { a: 0.0, b: 1.0 };
            }
        }
        for _ in 0..TRIES {
            let commands = self.begin(0)?;
            let frame = Frame { slot: 0, instances: &[scene.instance], views: &[view] };
            // SAFETY: the buffer is as large as the picture and nobody else's, the slot's commands have run.
            unsafe { scene.frames.record(commands, &frame) }?;
            self.slots[0].draws = true;
            self.last = Some(0);
            self.submit(0, None)?;
            self.settle(0)?;
            match scene.frames.report(0)?.needed {
                Some(needed) => scene.frames.reserve(needed)?,
                None => break,
            }
        }
        let values = buffer.mapped();
        Ok(match wanted {
            Wanted::Color => values.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect(),
            Wanted::Depth => values.iter().map(|&v| if v > 0.0 { 1.0 / v } else { 0.0 }).collect(),
        })
    }

    /// How long each stage of the last scene took, which was drawn by `frames` and waited for, in their order; nothing where they are
    /// not timed.
    pub(super) fn stages(&self, frames: &Frames) -> Result<Vec<StageTime>> {
        self.last.map_or(Ok(Vec::new()), |slot| frames.times(slot as u32))
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        // SAFETY: the device is done with all that these are used by.
        unsafe {
            let _ = self.device.device_wait_idle();
            self.slots.iter_mut().for_each(|slot| slot.kept.clear());
            self.chain.drawn.iter().for_each(|semaphore| self.device.destroy_semaphore(*semaphore, None));
            self.presenter.destroy_swapchain(self.chain.handle, None);
            for slot in &self.slots {
                self.device.destroy_fence(slot.fence, None);
                self.device.destroy_semaphore(slot.acquired, None);
            }
            self.device.destroy_query_pool(self.queries, None);
            self.device.destroy_command_pool(self.pool, None);
        }
    }
}
