//! The explicit Vulkan layer.

/// What the device, the driver or its memory could not do.
#[derive(Debug, thiserror::Error)]
pub enum GpuError {
    #[error("{0}")]
    Unsupported(String),
}
