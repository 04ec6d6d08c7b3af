//! A minimal renderer to record frames for: images, command buffers, a loop.

use std::sync::{Mutex, PoisonError};

use ash::vk;
use glint::{
    gpu::{Buffer, Context, ImageRegion, Location, Pixels},
    pipelines::frames::{SYNC_READ, SYNC_WRITTEN},
};

/// Stage and access of all of glint's uses of a caller's image or buffer.
const USED: (vk::PipelineStageFlags, vk::AccessFlags) = (
    vk::PipelineStageFlags::from_raw(SYNC_READ.0.as_raw() | SYNC_WRITTEN.0.as_raw()),
    vk::AccessFlags::from_raw(SYNC_READ.1.as_raw() | SYNC_WRITTEN.1.as_raw()),
);

/// The renderer's own lock of its queue, which engines of several threads may share. glint's submissions do
/// not take it, so there must be none while another thread submits.
static QUEUE: Mutex<()> = Mutex::new(());

/// Owns images and command buffers on a context's device.
pub struct Engine<'a> {
    context: &'a Context,
    pool: vk::CommandPool,
    commands: Vec<vk::CommandBuffer>,
    fences: Vec<vk::Fence>,
    images: Vec<(vk::Image, vk::DeviceMemory)>,
}

impl<'a> Engine<'a> {
    /// With `in_flight` frames in flight.
    pub fn new(context: &'a Context, in_flight: u32) -> Self {
        let device = context.device();
        unsafe {
            let info = vk::CommandPoolCreateInfo::default()
                .queue_family_index(context.queue_family())
                .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
            let pool = device.create_command_pool(&info, None).unwrap();
            let info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(in_flight);
            let commands = device.allocate_command_buffers(&info).unwrap();
            let signaled = vk::FenceCreateInfo::default().flags(vk::FenceCreateFlags::SIGNALED);
            let fences = commands.iter().map(|_| device.create_fence(&signaled, None).unwrap()).collect();
            Engine { context, pool, commands, fences, images: vec![] }
        }
    }

    /// An image for copies.
    pub fn image(&mut self, format: vk::Format, width: u32, height: u32) -> ImageRegion {
        let device = self.context.device();
        let image = unsafe {
            let info = vk::ImageCreateInfo::default()
                .image_type(vk::ImageType::TYPE_2D)
                .format(format)
                .extent(vk::Extent3D { width, height, depth: 1 })
                .mip_levels(1)
                .array_layers(1)
                .samples(vk::SampleCountFlags::TYPE_1)
                .usage(vk::ImageUsageFlags::TRANSFER_SRC | vk::ImageUsageFlags::TRANSFER_DST);
            let image = device.create_image(&info, None).unwrap();
            let needs = device.get_image_memory_requirements(image);
            let info = vk::MemoryAllocateInfo::default()
                .allocation_size(needs.size)
                .memory_type_index(needs.memory_type_bits.trailing_zeros());
            let memory = device.allocate_memory(&info, None).unwrap();
            device.bind_image_memory(image, memory, 0).unwrap();
            self.images.push((image, memory));
            image
        };
        let mut region = ImageRegion::of(image, format, vk::ImageLayout::UNDEFINED);
        self.turn(&mut region, vk::ImageLayout::TRANSFER_DST_OPTIMAL);
        region
    }

    /// Transitions an image to another layout, for copies to or from it.
    pub fn turn(&self, region: &mut ImageRegion, layout: vk::ImageLayout) {
        let device = self.context.device();
        // An image with stencil must transition both aspects together.
        let stencil = match region.format {
            vk::Format::D32_SFLOAT_S8_UINT => vk::ImageAspectFlags::STENCIL,
            _ => vk::ImageAspectFlags::empty(),
        };
        self.run(|commands| {
            let barrier = [vk::ImageMemoryBarrier::default()
                .image(region.image)
                .old_layout(region.layout)
                .new_layout(layout)
                .src_access_mask(USED.1)
                .dst_access_mask(USED.1)
                .subresource_range(vk::ImageSubresourceRange {
                    aspect_mask: region.aspect() | stencil,
                    level_count: 1,
                    layer_count: 1,
                    ..Default::default()
                })];
            let none = vk::DependencyFlags::empty();
            unsafe { device.cmd_pipeline_barrier(commands, USED.0, USED.0, none, &[], &[], &barrier) };
        });
        region.layout = layout;
    }

    /// The command buffer of slot `slot`, open for recording; its previous commands have run.
    pub fn begin(&self, slot: u32) -> vk::CommandBuffer {
        let (device, commands) = (self.context.device(), self.commands[slot as usize]);
        unsafe {
            device.wait_for_fences(&[self.fences[slot as usize]], true, u64::MAX).unwrap();
            device.begin_command_buffer(commands, &vk::CommandBufferBeginInfo::default()).unwrap();
        }
        commands
    }

    /// Ends and submits the commands. The required barrier between two frames that write the same images is
    /// included.
    pub fn submit(&self, slot: u32) {
        let (device, fence) = (self.context.device(), self.fences[slot as usize]);
        unsafe {
            let commands = self.commands[slot as usize];
            let barrier = [vk::MemoryBarrier::default().src_access_mask(SYNC_WRITTEN.1).dst_access_mask(USED.1)];
            let none = vk::DependencyFlags::empty();
            device.cmd_pipeline_barrier(commands, SYNC_WRITTEN.0, USED.0, none, &barrier, &[], &[]);
            device.end_command_buffer(commands).unwrap();
            device.reset_fences(&[fence]).unwrap();
            let buffers = [commands];
            let info = [vk::SubmitInfo::default().command_buffers(&buffers)];
            let queue = device.get_device_queue(self.context.queue_family(), 0);
            let _locked = QUEUE.lock().unwrap_or_else(PoisonError::into_inner);
            device.queue_submit(queue, &info, fence).unwrap();
        }
    }

    /// Waits for all submissions.
    pub fn finish(&self) {
        unsafe { self.context.device().wait_for_fences(&self.fences, true, u64::MAX).unwrap() };
    }

    /// Records, submits and waits, in slot 0.
    pub fn run(&self, record: impl FnOnce(vk::CommandBuffer)) {
        record(self.begin(0));
        self.submit(0);
        self.finish();
    }

    /// Pixels of an image, `words` words each.
    pub fn read(&self, region: &mut ImageRegion, size: [u32; 2], words: u32) -> Vec<u32> {
        self.turn(region, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
        let len = (words * size[0] * size[1]) as usize;
        let buffer = Buffer::<u32>::new(self.context, "read", len, Location::Device).unwrap();
        let mut recorder = self.context.recorder("read").unwrap();
        unsafe { recorder.bring(&Pixels::Image(*region), &buffer, size, words) };
        recorder.submit().unwrap().wait().unwrap();
        self.turn(region, vk::ImageLayout::TRANSFER_DST_OPTIMAL);
        buffer.download().unwrap()
    }

    /// Uploads an image.
    pub fn write(&self, region: &ImageRegion, size: [u32; 2], pixels: &[u32]) {
        let buffer = Buffer::from_slice(self.context, "write", pixels).unwrap();
        let mut recorder = self.context.recorder("write").unwrap();
        unsafe { recorder.hand(&buffer, &Pixels::Image(*region), size, pixels.len() as u32 / (size[0] * size[1])) };
        recorder.submit().unwrap().wait().unwrap();
    }
}

impl Drop for Engine<'_> {
    fn drop(&mut self) {
        let device = self.context.device();
        unsafe {
            let _ = device.wait_for_fences(&self.fences, true, u64::MAX);
            self.fences.iter().for_each(|fence| device.destroy_fence(*fence, None));
            device.destroy_command_pool(self.pool, None);
            for (image, memory) in self.images.drain(..) {
                device.destroy_image(image, None);
                device.free_memory(memory, None);
            }
        }
    }
}
