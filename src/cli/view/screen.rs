//! Window with a swapchain, on a device that is created here and lent to glint, like any renderer's. Only
//! this file of the program calls Vulkan itself.

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
/// Maximum wait for an image of the window. A compositor may hold all images while the window is hidden.
pub(super) const PATIENCE: Duration = Duration::from_secs(1);
/// Maximum number of times that a picture is drawn again with more room for intersections.
const TRIES: u32 = 4;

/// Content of a frame.
pub(super) enum Shown<'a> {
    /// Scene that the device draws directly into the window's image.
    Scene(Box<Scene<'a>>),
    /// Pixels of the window's size, 3 bytes each.
    Picture(&'a [u8]),
}

/// Scene seen by a camera.
pub(super) struct Scene<'a> {
    pub(super) frames: &'a mut Frames,
    pub(super) instance: Instance<'a>,
    pub(super) camera: Camera,
    /// Background, sRGB.
    pub(super) background: [f32; 3],
}

/// Result of a frame.
pub(super) struct Drawn {
    /// False if the window had no image to draw on, because it is hidden or changes its size.
    pub(super) shown: bool,
    /// Pixels that the window shows, 3 bytes each, if requested.
    pub(super) pixels: Option<Vec<u8>>,
}

/// Quantity to read as numbers.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Wanted {
    /// sRGB values, three per pixel.
    Color,
    /// Camera z, one per pixel, 0 if there is none.
    Depth,
}

/// Objects that must outlive device and surface.
struct Instanced {
    entry: ash::Entry,
    instance: ash::Instance,
    debug: bool,
    messages: Arc<Mutex<Vec<String>>>,
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
}

/// Surface of the window that a device draws on.
struct Surface {
    surfaces: khr::surface::Instance,
    surface: vk::SurfaceKHR,
    // Owner of the surface.
    window: Arc<Window>,
    // Dropped after the surface.
    instanced: Rc<Instanced>,
}

/// Device that is lent to glint. It may outlive its window; everything created on it must be dropped first.
pub(super) struct Lender {
    context: Option<Context>,
    device: ash::Device,
    // Dropped after the device.
    instanced: Rc<Instanced>,
}

/// Frame in flight.
struct Slot {
    commands: vk::CommandBuffer,
    fence: vk::Fence,
    acquired: vk::Semaphore,
    /// Submitted, and not yet waited for.
    pending: bool,
    /// Whether it draws a scene, instead of copying a picture.
    draws: bool,
    /// Resources held by copies.
    kept: Kept,
}

/// Images of the window.
#[derive(Default)]
struct Chain {
    handle: vk::SwapchainKHR,
    images: Vec<vk::Image>,
    /// Semaphore of each image, signaled when it is drawn.
    drawn: Vec<vk::Semaphore>,
    /// Size, pixels; 0 if the window is hidden.
    size: [u32; 2],
    readable: bool,
    /// Whether the window has changed.
    stale: bool,
}

/// Times of frames.
#[derive(Clone, Copy, Default)]
pub(super) struct Costs {
    /// Total time that the host has waited for the device.
    pub(super) waited: Duration,
    /// Device time of the last scene that was waited for, if the device has timestamps.
    pub(super) time: Option<Duration>,
}

/// Window with the device that draws in it.
pub(super) struct Screen {
    presenter: khr::swapchain::Device,
    device: ash::Device,
    physical: vk::PhysicalDevice,
    queue: vk::Queue,
    pool: vk::CommandPool,
    /// Two timestamps per slot.
    queries: vk::QueryPool,
    slots: Vec<Slot>,
    next: usize,
    chain: Chain,
    format: vk::SurfaceFormatKHR,
    texel: Texel,
    /// Slot of the last drawn scene.
    last: Option<usize>,
    costs: Costs,
    surface: Surface,
    // Last, because it must be dropped last.
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
        // SAFETY: the list holds static strings.
        let names: Vec<&CStr> = names.iter().map(|name| unsafe { CStr::from_ptr(*name) }).collect();
        let (entry, instance, debug) = create_instance(validation, &names)?;
        let mut instanced = Instanced { entry, instance, debug, messages: Arc::default(), messenger: None };
        if validation {
            instanced.messenger = Some(create_messenger(&instanced.entry, &instanced.instance, &instanced.messages)?);
        }
        let (entry, instance) = (&instanced.entry, &instanced.instance);
        let surfaces = khr::surface::Instance::new(entry, instance);
        // SAFETY: the handles belong to the window, which this struct holds; the instance has the
        // extensions.
        let surface = unsafe { ash_window::create_surface(entry, instance, display_handle, window_handle, None) }
            .map_err(named("vkCreateSurface"))?;
        Ok(Surface { surfaces, surface, window, instanced: Rc::new(instanced) })
    }

    /// Queue family that computes and can present to the window.
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

    /// Device with all features that glint can use, and with swapchains.
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
            // Parts of Vulkan 1.3 need not be present as extensions. For other missing ones, device
            // creation fails.
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

    /// Surface format with 8 bits per channel, encoded like glint's pixels.
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
        // SAFETY: device and surface are destroyed, and with them all users of these objects.
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
        // SAFETY: its swapchain is destroyed; the instance is alive.
        unsafe { self.surfaces.destroy_surface(self.surface, None) };
    }
}

impl Drop for Lender {
    fn drop(&mut self) {
        // SAFETY: the device is idle; glint's objects on it are destroyed (see the type), and the context
        // is dropped first.
        unsafe {
            let _ = self.device.device_wait_idle();
            drop(self.context.take());
            self.device.destroy_device(None);
        }
    }
}

impl Lender {
    /// Context on which models and frames are created.
    pub(super) fn context(&self) -> &Context {
        // Set before the lender is handed out, and taken only by `drop`.
        self.context.as_ref().expect("a lender has lent its device")
    }

    /// Messages of the validation layers, also after the device is destroyed.
    pub(super) fn messages(&self) -> Arc<Mutex<Vec<String>>> {
        self.instanced.messages.clone()
    }
}

impl Screen {
    /// Creates a device that can draw in `window`, chosen like glint's own.
    pub(super) fn new(window: Arc<Window>, options: &ContextOptions) -> Result<Self, GpuError> {
        let surface = Surface::new(window, options.validation)?;
        let instanced = surface.instanced.clone();
        let (physical, offered) = Context::choose(&instanced.entry, &instanced.instance, options)?;
        let family = surface.queue_family(physical)?;
        let (format, texel) = surface.format(physical)?;
        let device = surface.device(physical, family, offered.iter().copied())?;
        let mut lender = Lender { context: None, device: device.clone(), instanced: instanced.clone() };
        // SAFETY: the device was created with this family and index 0.
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
            // A single thread draws and loads.
            queue_lock: None,
            labels: instanced.debug,
            memory_budget: options.memory_budget,
        };
        // SAFETY: the handles belong together; the device has the required features and outlives the
        // context (see `Lender`).
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
            costs: Costs::default(),
            surface,
            lender: Rc::new(lender),
        };
        screen.make_slots(family)?;
        screen.fit()?;
        Ok(screen)
    }

    /// Lender of the device, which may outlive the window.
    pub(super) fn lender(&self) -> Rc<Lender> {
        self.lender.clone()
    }

    fn make_slots(&mut self, family: u32) -> Result<(), GpuError> {
        let device = &self.device;
        // SAFETY: creations from structures that live for their calls; `drop` destroys the objects.
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

    /// Context on which models and frames are created.
    pub(super) fn context(&self) -> &Context {
        self.lender.context()
    }

    pub(super) fn costs(&self) -> Costs {
        self.costs
    }

    /// Forgets the last scene, so that its times are not read.
    pub(super) fn forget(&mut self) {
        self.last = None;
    }

    /// Marks that the window's size may have changed.
    pub(super) fn resized(&mut self) {
        self.chain.stale = true;
    }

    /// Size of the window's images, pixels; 0 while it is hidden. Recreates them if the window has changed.
    pub(super) fn size(&mut self) -> Result<[u32; 2], GpuError> {
        if self.chain.stale {
            self.fit()?;
        }
        Ok(self.chain.size)
    }

    /// Creates images of the window's size.
    fn fit(&mut self) -> Result<(), GpuError> {
        self.finish()?;
        let Surface { surfaces, surface, window, .. } = &self.surface;
        // SAFETY: the device is idle, so the old images, which the new swapchain replaces, are not in use.
        unsafe {
            let began = Instant::now();
            self.device.device_wait_idle().map_err(named("vkDeviceWaitIdle"))?;
            self.costs.waited += began.elapsed();
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
        // SAFETY: the fence was submitted; both timestamps of the slot are written when it is signaled.
        unsafe {
            let began = Instant::now();
            self.device.wait_for_fences(&[fence], true, u64::MAX).map_err(named("vkWaitForFences"))?;
            self.costs.waited += began.elapsed();
            let period = f64::from(self.context().info().timestamp_period);
            if period > 0.0 && draws {
                let mut stamps = [0u64; 2];
                let flags = vk::QueryResultFlags::TYPE_64;
                let read = self.device.get_query_pool_results(self.queries, 2 * slot as u32, &mut stamps, flags);
                let ticks = stamps[1].wrapping_sub(stamps[0]);
                self.costs.time = read.ok().map(|()| Duration::from_nanos((ticks as f64 * period) as u64));
            }
        }
        Ok(())
    }

    /// Whether all frames are done, without waiting.
    pub(super) fn is_done(&self) -> bool {
        // SAFETY: queries of live handles.
        self.slots.iter().all(|s| !s.pending || unsafe { self.device.get_fence_status(s.fence) }.unwrap_or(true))
    }

    /// Waits for all frames in flight.
    pub(super) fn finish(&mut self) -> Result<(), GpuError> {
        (0..self.slots.len()).try_for_each(|slot| self.settle(slot))
    }

    /// Begins a slot's commands.
    fn begin(&mut self, slot: usize) -> Result<vk::CommandBuffer, GpuError> {
        self.settle(slot)?;
        let commands = self.slots[slot].commands;
        let info = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the slot's commands have finished.
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

    /// Ends a slot's commands and submits them, between two semaphores.
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
        // SAFETY: the commands are recording; only this thread uses the queue.
        unsafe {
            self.device.end_command_buffer(commands).map_err(named("vkEndCommandBuffer"))?;
            self.device.reset_fences(&[fence]).map_err(named("vkResetFences"))?;
            self.device.queue_submit(self.queue, &[info], fence).map_err(named("vkQueueSubmit"))?;
        }
        self.slots[slot].pending = true;
        Ok(())
    }

    /// Changes the layout of a window's image, between copies.
    fn turn(&self, commands: vk::CommandBuffer, image: vk::Image, from: vk::ImageLayout, to: vk::ImageLayout) {
        let transfer = vk::PipelineStageFlags::TRANSFER;
        let access = |layout| match layout {
            vk::ImageLayout::TRANSFER_DST_OPTIMAL => vk::AccessFlags::TRANSFER_WRITE,
            vk::ImageLayout::TRANSFER_SRC_OPTIMAL => vk::AccessFlags::TRANSFER_READ,
            // Semaphores order the accesses.
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
        // SAFETY: the commands are recording; the image belongs to the window.
        unsafe { self.device.cmd_pipeline_barrier(commands, transfer, transfer, none, &[], &[], &[barrier]) };
    }

    /// The index of the window's next image; none within `patience`, or if the window has changed.
    fn acquire(&mut self, slot: usize, patience: Duration) -> Result<Option<u32>> {
        let (acquired, patience) = (self.slots[slot].acquired, patience.as_nanos() as u64);
        // SAFETY: the slot's last commands waited for the semaphore, and have finished.
        let got =
            unsafe { self.presenter.acquire_next_image(self.chain.handle, patience, acquired, vk::Fence::null()) };
        match got {
            Ok((index, suboptimal)) => {
                self.chain.stale |= suboptimal;
                Ok(Some(index))
            }
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => {
                self.chain.stale = true;
                Ok(None)
            }
            Err(vk::Result::TIMEOUT | vk::Result::NOT_READY) => Ok(None),
            Err(error) => Err(named("vkAcquireNextImageKHR")(error).into()),
        }
    }

    /// Draws the next frame, if the window has an image for it within `patience`. With `save`, waits for it
    /// and returns the pixels that the window shows.
    pub(super) fn show(&mut self, shown: Shown<'_>, save: bool, patience: Duration) -> Result<Drawn> {
        let nothing = Drawn { shown: false, pixels: None };
        let size = self.size()?;
        let fits = match &shown {
            Shown::Scene(scene) => [scene.camera.width, scene.camera.height] == size,
            Shown::Picture(rgb) => rgb.len() == 3 * (size[0] as usize) * (size[1] as usize),
        };
        // The window is hidden, or has another size than the picture.
        if size == [0, 0] || !fits {
            return Ok(nothing);
        }
        let slot = self.next;
        self.settle(slot)?;
        let Some(index) = self.acquire(slot, patience)? else { return Ok(nothing) };
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
                // SAFETY: the image has the window's size and the given layout; the slot's commands have
                // finished.
                unsafe { frames.record(commands, &frame) }?;
                self.last = Some(slot);
            }
            Shown::Picture(rgb) => {
                let words: Vec<u32> = rgb.chunks_exact(3).map(|p| self.word([p[0], p[1], p[2]])).collect();
                let staging = Buffer::new(self.context(), "picture", words.len(), Location::Host)?;
                staging.write_mapped(&words);
                // SAFETY: as above; the picture has the window's size.
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
            let buffer = Buffer::<u32>::new(self.context(), "screenshot", pixels, Location::Host)?;
            // SAFETY: the image has that layout. The frames hold the other resources of the recorder, or
            // they are held below.
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
        self.submit(slot, Some([self.slots[slot].acquired, drawn]))?;
        self.next = (slot + 1) % self.slots.len();
        let (waits, chains, indices) = ([drawn], [self.chain.handle], [index]);
        let info = vk::PresentInfoKHR::default().wait_semaphores(&waits).swapchains(&chains).image_indices(&indices);
        // SAFETY: the image was acquired, and the submission signals its semaphore.
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

    /// Pixel in the window's format.
    fn word(&self, [r, g, b]: [u8; 3]) -> u32 {
        u32::from_le_bytes(if self.texel == Texel::Bgra8 { [b, g, r, 255] } else { [r, g, b, 255] })
    }

    fn rgb(&self, word: u32) -> [u8; 3] {
        let [a, b, c, _] = word.to_le_bytes();
        if self.texel == Texel::Bgra8 { [c, b, a] } else { [a, b, c] }
    }

    /// Grows the buffer if intersections overflowed in recent frames. Returns whether to draw again. Waits.
    pub(super) fn make_room(&mut self, frames: &mut Frames) -> Result<bool> {
        self.finish()?;
        let reports = (0..IN_FLIGHT).filter_map(|slot| frames.report(slot).ok());
        let Some(needed) = reports.filter_map(|report| report.needed).max() else { return Ok(false) };
        let more = needed > frames.capacity();
        frames.reserve(needed)?;
        Ok(more)
    }

    /// Renders `scene` to numbers, not to the window. Waits.
    pub(super) fn numbers(&mut self, scene: &mut Scene<'_>, wanted: Wanted) -> Result<Vec<f32>> {
        self.finish()?;
        let pixels = scene.camera.pixels() as usize;
        let words = if wanted == Wanted::Color { 4 } else { 1 };
        let buffer = Buffer::<f32>::new(self.context(), "numbers", words * pixels, Location::Host)?;
        let target = Pixels::Buffer(BufferRange { buffer: buffer.raw().handle(), offset: 0 });
        let mut view = FrameView::new(scene.camera);
        match wanted {
            Wanted::Color => {
                let blend = Blend::Opaque(scene.background);
                view.color = Some(Target { blend, ..Target::new(target, Texel::Rgba32F) });
            }
            // Reciprocal of z, 0 at infinity.
            Wanted::Depth => {
                view.depth_out = Some(target);
                view.depth_form = DepthForm { a: 0.0, b: 1.0 };
            }
        }
        for _ in 0..TRIES {
            let commands = self.begin(0)?;
            let frame = Frame { slot: 0, instances: &[scene.instance], views: &[view] };
            // SAFETY: the buffer has the picture's size and no other user; the slot's commands have
            // finished.
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

    /// Duration of each stage of the last scene, drawn by `frames`, in their order; empty if they are not
    /// timed. The scene must be done.
    pub(super) fn stages(&self, frames: &Frames) -> Result<Vec<StageTime>> {
        self.last.map_or(Ok(Vec::new()), |slot| frames.times(slot as u32))
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        // SAFETY: the device is idle, so it no longer uses these objects.
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
