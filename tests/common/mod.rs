//! Shared helpers of tests that need a device.

use std::{
    sync::{Condvar, Mutex, MutexGuard, PoisonError},
    thread::{self, ThreadId},
};

use glint::{
    gpu::{Context, ContextOptions},
    pipelines::session::{Policy, Reduction, Session},
};

/// A session with the deterministic reduction and default options.
#[allow(dead_code, reason = "not every test runs pipelines")]
pub fn session(context: &Context) -> Session {
    let policy = Policy { reduction: Reduction::Deterministic, ..Default::default() };
    Session { policy, ..Session::new(context) }
}

/// The devices of this test program, one per thread. The validation layers look up the device of every call
/// in a map without locking (issue 4391 of KhronosGroup/Vulkan-ValidationLayers): if a device is created or
/// destroyed while another thread uses its own, the process can crash. So all devices are made while none is
/// used, and destroyed when all are returned.
struct Devices {
    idle: Vec<Context>,
    /// Devices in use, by thread; several entries if a thread has several contexts. `None` is a device made
    /// by the test itself.
    taken: Vec<(ThreadId, Option<Context>)>,
    /// One thread has exclusive use.
    alone: bool,
}

static DEVICES: Mutex<Devices> = Mutex::new(Devices { idle: Vec::new(), taken: Vec::new(), alone: false });
static RETURNED: Condvar = Condvar::new();

fn devices() -> MutexGuard<'static, Devices> {
    DEVICES.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Held as long as the thread has its device.
pub struct Turn {
    thread: ThreadId,
    has_device: bool,
}

impl Turn {
    /// Exclusive use: no other thread has a device meanwhile, so that this one may make its own.
    #[allow(dead_code, reason = "few tests make devices")]
    pub fn alone() -> Self {
        let me = thread::current().id();
        let mut devices = devices();
        assert!(devices.alone || devices.taken.iter().all(|(holder, _)| *holder != me), "ask to be alone first");
        while devices.taken.iter().any(|(holder, _)| *holder != me) {
            devices = RETURNED.wait(devices).unwrap_or_else(PoisonError::into_inner);
        }
        devices.alone = true;
        devices.taken.push((me, None));
        Turn { thread: me, has_device: false }
    }

    /// The thread's device.
    fn take() -> (Context, Self) {
        let make = || Context::new(&ContextOptions::from_env()).expect("a Vulkan device, see tools/setup");
        let me = thread::current().id();
        let mut devices = devices();
        let device = loop {
            if let Some(mine) =
                devices.taken.iter().find_map(|(holder, device)| device.as_ref().filter(|_| *holder == me))
            {
                break mine.clone();
            }
            let others = devices.taken.iter().any(|(holder, _)| *holder != me);
            if !(devices.alone && others)
                && let Some(device) = devices.idle.pop()
            {
                break device;
            }
            if others {
                devices = RETURNED.wait(devices).unwrap_or_else(PoisonError::into_inner);
            } else {
                devices.idle = (0..thread::available_parallelism().map_or(1, usize::from)).map(|_| make()).collect();
            }
        };
        devices.taken.push((me, Some(device.clone())));
        (device, Turn { thread: me, has_device: true })
    }
}

impl Drop for Turn {
    fn drop(&mut self) {
        let mut devices = devices();
        let is_mine = |(holder, device): &(ThreadId, Option<Context>)| {
            *holder == self.thread && device.is_some() == self.has_device
        };
        if let Some(held) = devices.taken.iter().position(is_mine) {
            let (_, device) = devices.taken.swap_remove(held);
            if !devices.taken.iter().any(is_mine) {
                devices.idle.extend(device);
            }
        }
        if devices.taken.is_empty() {
            devices.alone = false;
            devices.idle.clear();
        }
        RETURNED.notify_all();
    }
}

/// A separate context, with validation layers if `GLINT_VALIDATION` is set (`tools/test` sets it). On drop
/// the test fails if the layers have reported anything.
pub struct Gpu {
    context: Context,
    // Dropped after the context.
    _turn: Turn,
}

impl Gpu {
    #[allow(dead_code, reason = "not every test has the usual options")]
    pub fn new() -> Self {
        Self::with(ContextOptions::from_env())
    }

    pub fn with(options: ContextOptions) -> Self {
        let (device, turn) = Turn::take();
        Gpu { context: device.again(&options).unwrap(), _turn: turn }
    }
}

impl std::ops::Deref for Gpu {
    type Target = Context;
    fn deref(&self) -> &Context {
        &self.context
    }
}

impl Drop for Gpu {
    fn drop(&mut self) {
        if !thread::panicking() {
            let messages = self.context.validation_messages();
            assert!(messages.is_empty(), "validation layers: {messages:#?}");
        }
    }
}

/// Fails if a dispatch of `work` breaks its twin's bound, or if more than one decision in a hundred differs: pixels of a footprint's rim
/// lie on either side of float32's rounding.
#[allow(dead_code, reason = "few tests judge their own inputs")]
pub fn assert_no_breach(context: &Context, work: impl Fn(&Context)) {
    let rows = glint::verify::judged(context, |context| {
        work(context);
        Ok(())
    });
    let rows = rows.unwrap();
    assert!(!rows.is_empty(), "nothing ran");
    for row in rows {
        assert!(row.breaches.is_empty() && row.errors.flips.unwrap_or(0.0) <= 1e-2, "{row:#?}");
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
