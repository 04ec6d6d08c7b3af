//! The explicit Vulkan layer and the only home of `unsafe`: a device (own or borrowed), typed buffers, pipelines made from
//! reflected kernels, and a recorder that turns stages into commands with barriers, labels and timestamps.

mod context;
mod memory;
mod pipeline;
mod recorder;

pub use ash;
pub use context::{BorrowedDevice, Context, ContextOptions, Counters, DeviceInfo};
pub use memory::{Buffer, Location, RawBuffer, Unused};
pub use pipeline::{Access, Kernel, Pipeline};
pub use recorder::{Recorder, StageTime, Submission};

use ash::vk;

/// What the device, the driver or its memory could not do.
#[derive(Debug, thiserror::Error)]
pub enum GpuError {
    #[error("no Vulkan loader: {0} (on Debian and Ubuntu: apt install libvulkan1 mesa-vulkan-drivers)")]
    NoLoader(String),
    #[error("no usable Vulkan device{0}")]
    NoDevice(String),
    #[error("device {device} lacks {feature}")]
    Missing { device: String, feature: String },
    #[error(
        "buffer {name} needs {bytes} bytes, more than the {limit} that the device binds at once: \
         use fewer Gaussians or smaller images"
    )]
    BufferTooLarge { name: String, bytes: u64, limit: u64 },
    #[error("out of device memory for buffer {name} ({bytes} bytes): {source}")]
    Allocation { name: String, bytes: u64, source: gpu_allocator::AllocationError },
    #[error("{call}: {result}")]
    Vulkan { call: &'static str, result: vk::Result },
}

/// Names the call that failed.
trait Check<T> {
    fn check(self, call: &'static str) -> Result<T, GpuError>;
}

impl<T> Check<T> for Result<T, vk::Result> {
    fn check(self, call: &'static str) -> Result<T, GpuError> {
        self.map_err(|result| GpuError::Vulkan { call, result })
    }
}
