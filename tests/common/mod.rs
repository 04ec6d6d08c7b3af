//! What the tests that need a device share.

use glint::{
    gpu::{Context, ContextOptions},
    pipelines::session::{Policy, Reduction, Session},
};

/// On a device, with sums in a fixed order and whatever else is usual.
#[allow(dead_code, reason = "not every test runs pipelines")]
pub fn session(context: &Context) -> Session {
    let policy = Policy { reduction: Reduction::Deterministic, ..Default::default() };
    Session { policy, ..Session::new(context) }
}

/// A device with the validation layers on where `GLINT_VALIDATION` is set (`tools/test` sets it). On drop the test fails if
/// the layers said anything.
pub struct Gpu(pub Context);

impl Gpu {
    pub fn new() -> Self {
        Self::with(ContextOptions::from_env())
    }

    pub fn with(options: ContextOptions) -> Self {
        Gpu(Context::new(&options).expect("a Vulkan device, see tools/setup"))
    }
}

impl std::ops::Deref for Gpu {
    type Target = Context;
    fn deref(&self) -> &Context {
        &self.0
    }
}

impl Drop for Gpu {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            let messages = self.0.validation_messages();
            assert!(messages.is_empty(), "validation layers: {messages:#?}");
        }
    }
}

/// The most memory that the process has held, bytes; a CPU device's buffers are in it. 0 where the system does not say.
#[allow(dead_code, reason = "not every test measures")]
pub fn peak_memory() -> u64 {
    let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let kib =
        text.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB")?.parse::<u64>().ok());
    1024 * kib.unwrap_or(0)
}
