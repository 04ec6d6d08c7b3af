//! A recorder's commands other than kernels in a caller's command buffer: small updates, and copies between
//! glint's buffers and the caller's images and buffers.

use ash::vk;
use bytemuck::Pod;

use super::{Access, Buffer, Recorder};

/// Most bytes of one vkCmdUpdateBuffer.
const UPDATE_BYTES: usize = 65_536;

/// A rectangle of one layer of a caller's image.
#[derive(Debug, Clone, Copy)]
pub struct ImageRegion {
    /// Made with `TRANSFER_DST` if it is written, `TRANSFER_SRC` if it is read.
    pub image: vk::Image,
    /// Its layout at the time: `GENERAL`; or `TRANSFER_DST_OPTIMAL` if it is only written; or
    /// `TRANSFER_SRC_OPTIMAL` (or `SHARED_PRESENT_KHR`) if it is only read.
    pub layout: vk::ImageLayout,
    /// The format that it was made with: texels are copied unchanged. For a depth format the depths are
    /// copied, which needs a queue with graphics.
    pub format: vk::Format,
    /// Level of detail.
    pub level: u32,
    /// Array layer: an eye, a face of a cube.
    pub layer: u32,
    /// Upper left corner, pixels, 0 or more.
    pub offset: [i32; 2],
}

impl ImageRegion {
    /// The upper left of the first layer of an image.
    pub fn of(image: vk::Image, format: vk::Format, layout: vk::ImageLayout) -> Self {
        ImageRegion { image, layout, format, level: 0, layer: 0, offset: [0, 0] }
    }

    /// The aspect that is copied.
    pub fn aspect(&self) -> vk::ImageAspectFlags {
        match self.format {
            vk::Format::D16_UNORM
            | vk::Format::X8_D24_UNORM_PACK32
            | vk::Format::D32_SFLOAT
            | vk::Format::D16_UNORM_S8_UINT
            | vk::Format::D24_UNORM_S8_UINT
            | vk::Format::D32_SFLOAT_S8_UINT => vk::ImageAspectFlags::DEPTH,
            _ => vk::ImageAspectFlags::COLOR,
        }
    }

    /// The copy of buffer rows that follow each other without padding.
    fn copy(&self, [width, height]: [u32; 2]) -> vk::BufferImageCopy {
        vk::BufferImageCopy {
            image_subresource: vk::ImageSubresourceLayers {
                aspect_mask: self.aspect(),
                mip_level: self.level,
                base_array_layer: self.layer,
                layer_count: 1,
            },
            image_offset: vk::Offset3D { x: self.offset[0], y: self.offset[1], z: 0 },
            image_extent: vk::Extent3D { width, height, depth: 1 },
            ..Default::default()
        }
    }
}

/// A part of a caller's buffer.
#[derive(Debug, Clone, Copy)]
pub struct BufferRange {
    /// Made with `TRANSFER_DST` if it is written, `TRANSFER_SRC` if it is read.
    pub buffer: vk::Buffer,
    /// Bytes, a multiple of 4.
    pub offset: u64,
}

/// A caller's pixels, in an image, or in a buffer of consecutive rows.
#[derive(Debug, Clone, Copy)]
pub enum Pixels {
    /// The view's number of texels, from the region's corner on.
    Image(ImageRegion),
    /// One row after the other.
    Buffer(BufferRange),
}

impl Recorder {
    /// Writes a few elements of a buffer, from `first` on, as part of the commands: `data` is copied now.
    pub fn update<T: Pod>(&mut self, buffer: &Buffer<T>, first: usize, data: &[T]) {
        let data = &data[..data.len().min(buffer.len().saturating_sub(first))];
        if data.is_empty() {
            return;
        }
        self.access([(&**buffer.raw(), Access::Write)].into_iter());
        self.keep_buffer(buffer);
        let (bytes, start) = (bytemuck::cast_slice::<T, u8>(data), (first * size_of::<T>()) as u64);
        for (piece, offset) in bytes.chunks(UPDATE_BYTES).zip((start..).step_by(UPDATE_BYTES)) {
            // SAFETY: the piece lies within the buffer and is of whole words, as all elements are.
            unsafe { self.device().cmd_update_buffer(self.commands, buffer.raw().handle, offset, piece) };
        }
        self.close("update");
    }

    /// Copies a caller's pixels, of `words` words each, to the beginning of a buffer.
    ///
    /// # Safety
    /// The pixels lie in a live image or buffer of the context's device, an image in the given layout; nobody
    /// else uses them meanwhile.
    pub unsafe fn bring<T: Pod>(&mut self, from: &Pixels, to: &Buffer<T>, [width, height]: [u32; 2], words: u32) {
        self.access([(&**to.raw(), Access::Write)].into_iter());
        self.keep_buffer(to);
        let (device, handle) = (self.device(), to.raw().handle);
        // SAFETY: by the contract above.
        unsafe {
            match from {
                Pixels::Image(from) => {
                    let region = [from.copy([width, height])];
                    device.cmd_copy_image_to_buffer(self.commands, from.image, from.layout, handle, &region);
                }
                Pixels::Buffer(from) => {
                    let size = bytes([width, height], words);
                    let region = [vk::BufferCopy { src_offset: from.offset, dst_offset: 0, size }];
                    device.cmd_copy_buffer(self.commands, from.buffer, handle, &region);
                }
            }
        }
        self.close("copy");
    }

    /// Copies the beginning of a buffer, `words` words for each pixel, to a caller's pixels.
    ///
    /// # Safety
    /// That of [`Recorder::bring`].
    pub unsafe fn hand<T: Pod>(&mut self, from: &Buffer<T>, to: &Pixels, [width, height]: [u32; 2], words: u32) {
        self.access([(&**from.raw(), Access::Read)].into_iter());
        self.keep_buffer(from);
        let (device, handle) = (self.device(), from.raw().handle);
        // SAFETY: by the contract above.
        unsafe {
            match to {
                Pixels::Image(to) => {
                    let region = [to.copy([width, height])];
                    device.cmd_copy_buffer_to_image(self.commands, handle, to.image, to.layout, &region);
                }
                Pixels::Buffer(to) => {
                    let size = bytes([width, height], words);
                    let region = [vk::BufferCopy { src_offset: 0, dst_offset: to.offset, size }];
                    device.cmd_copy_buffer(self.commands, handle, to.buffer, &region);
                }
            }
        }
        self.close("copy");
    }

    /// Makes all writes visible to the host once the commands have run.
    pub fn host_barrier(&self) {
        let written = [vk::MemoryBarrier::default()
            .src_access_mask(vk::AccessFlags::SHADER_WRITE | vk::AccessFlags::TRANSFER_WRITE)
            .dst_access_mask(vk::AccessFlags::HOST_READ)];
        let stages = vk::PipelineStageFlags::COMPUTE_SHADER | vk::PipelineStageFlags::TRANSFER;
        let (host, none) = (vk::PipelineStageFlags::HOST, vk::DependencyFlags::empty());
        // SAFETY: the command buffer is recording.
        unsafe { self.device().cmd_pipeline_barrier(self.commands, stages, host, none, &written, &[], &[]) };
    }
}

fn bytes([width, height]: [u32; 2], words: u32) -> u64 {
    4 * u64::from(words) * u64::from(width) * u64::from(height)
}
