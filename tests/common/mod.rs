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
        let validation = std::env::var_os("GLINT_VALIDATION").is_some();
        let device = std::env::var("GLINT_DEVICE").ok();
        Gpu(Context::new(&ContextOptions { device, validation }).expect("a Vulkan device, see tools/setup"))
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
