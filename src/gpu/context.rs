//! A Vulkan device, glint's own or the caller's.

use std::{
    ffi::{CStr, c_void},
    sync::{
        Arc, Mutex,
        atomic::{AtomicU64, Ordering},
    },
};

use ash::{ext, khr, vk};
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};

use super::{
    Check, GpuError, Recorder,
    recorder::{CommandSlot, destroy_slot},
};

/// How to open a device of our own.
#[derive(Debug, Clone, Default)]
pub struct ContextOptions {
    /// Index in [`Context::devices`] or a part of a device's name; `None` takes the first discrete GPU, else any device.
    pub device: Option<String>,
    /// Turn the Khronos validation layer on, with synchronisation validation. Messages are kept in
    /// [`Context::validation_messages`] and printed on stderr.
    pub validation: bool,
}

/// The caller's device. glint destroys none of it and submits to `queue` only through [`Recorder::submit`];
/// while glint uses the queue the caller must not (Vulkan's external synchronisation).
pub struct BorrowedDevice {
    pub entry: ash::Entry,
    pub instance: ash::Instance,
    pub physical_device: vk::PhysicalDevice,
    /// Made with the features and extensions that [`Context::requirements`] names.
    pub device: ash::Device,
    pub queue_family: u32,
    pub queue: vk::Queue,
    /// The device was made with `VK_EXT_shader_atomic_float` and its feature `shaderBufferFloat32AtomicAdd`. Not required.
    pub float_atomics: bool,
}

/// What is known of a physical device.
#[derive(Debug, Clone, serde::Serialize)]
pub struct DeviceInfo {
    pub name: String,
    pub kind: &'static str,
    pub subgroup_size: u32,
    /// Largest storage buffer that a kernel can be given, bytes.
    pub max_storage_bytes: u64,
    /// Nanoseconds per timestamp tick; 0 where the device has no timestamps.
    pub timestamp_period: f32,
    /// llvmpipe and other CPU implementations: every cost is ALU and dispatch, none is bandwidth.
    pub is_cpu: bool,
    pub driver: String,
    /// Float atomics can be used (`shaderBufferFloat32AtomicAdd`); of a borrowed device, if its owner says so.
    pub float_atomics: bool,
}

/// How often the host talked to the device since the context was made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Counters {
    /// Queue submissions.
    pub submissions: u64,
    /// Times the CPU blocked for the device.
    pub waits: u64,
}

pub(super) struct Inner {
    pub device: ash::Device,
    pub push_descriptor: khr::push_descriptor::Device,
    pub debug: Option<ext::debug_utils::Device>,
    pub queue: Mutex<vk::Queue>,
    pub queue_family: u32,
    pub info: DeviceInfo,
    pub allocator: Mutex<Option<Allocator>>,
    pub free_slots: Mutex<Vec<CommandSlot>>,
    pub submissions: AtomicU64,
    pub waits: AtomicU64,
    messages: Arc<Mutex<Vec<String>>>,
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    instance: ash::Instance,
    physical: vk::PhysicalDevice,
    owned: bool,
    // Keeps the Vulkan library loaded for as long as its functions are called.
    _entry: ash::Entry,
}

/// A device, its queue and its memory. Cheap to clone; everything made from it keeps it alive.
#[derive(Clone)]
pub struct Context(pub(super) Arc<Inner>);

/// Extensions that glint enables, and that a borrowed device must have enabled.
const EXTENSIONS: [&CStr; 1] = [khr::push_descriptor::NAME];

const SUBGROUP_OPERATIONS: [(vk::SubgroupFeatureFlags, &str); 5] = [
    (vk::SubgroupFeatureFlags::BASIC, "subgroup basic"),
    (vk::SubgroupFeatureFlags::VOTE, "subgroup vote"),
    (vk::SubgroupFeatureFlags::ARITHMETIC, "subgroup arithmetic"),
    (vk::SubgroupFeatureFlags::BALLOT, "subgroup ballot"),
    (vk::SubgroupFeatureFlags::SHUFFLE, "subgroup shuffle"),
];

impl Context {
    /// What a borrowed device must offer, for people: API version, features and extensions.
    pub fn requirements() -> Vec<String> {
        let mut list =
            vec!["Vulkan 1.2".to_owned(), "feature scalarBlockLayout".to_owned(), "feature hostQueryReset".to_owned()];
        list.extend(EXTENSIONS.iter().map(|e| format!("extension {}", e.to_string_lossy())));
        list.extend(SUBGROUP_OPERATIONS.iter().map(|(_, name)| format!("{name} operations in compute")));
        list.push("subgroups of 8 to 64 lanes, full in compute workgroups".to_owned());
        list.push(
            "not required: extension VK_EXT_shader_atomic_float, feature shaderBufferFloat32AtomicAdd".to_owned(),
        );
        list
    }

    /// All physical devices, in the loader's order.
    pub fn devices() -> Result<Vec<DeviceInfo>, GpuError> {
        let (entry, instance, _) = create_instance(false)?;
        // SAFETY: the instance was just made and is destroyed only after the query.
        let list = unsafe { instance.enumerate_physical_devices() };
        let infos =
            list.check("vkEnumeratePhysicalDevices").map(|l| l.iter().map(|&p| describe(&instance, p)).collect());
        // SAFETY: nothing made from this instance is left.
        unsafe { instance.destroy_instance(None) };
        drop(entry);
        infos
    }

    /// Opens a device of our own.
    pub fn new(options: &ContextOptions) -> Result<Self, GpuError> {
        let (entry, instance, debug) = create_instance(options.validation)?;
        let messages = Arc::new(Mutex::new(Vec::new()));
        let messenger = if options.validation { Some(create_messenger(&entry, &instance, &messages)?) } else { None };
        let opened = pick(&instance, options.device.as_deref())
            .and_then(|physical| open(&instance, physical).map(|(d, f)| (physical, d, f)));
        let (physical, device, queue_family) = match opened {
            Ok(opened) => opened,
            Err(e) => {
                // SAFETY: nothing but the messenger was made from this instance.
                unsafe {
                    if let Some((utils, messenger)) = &messenger {
                        utils.destroy_debug_utils_messenger(*messenger, None);
                    }
                    instance.destroy_instance(None);
                }
                return Err(e);
            }
        };
        // SAFETY: the family and index 0 were requested at creation.
        let queue = unsafe { device.get_device_queue(queue_family, 0) };
        let float_atomics = describe(&instance, physical).float_atomics;
        let borrowed =
            BorrowedDevice { entry, instance, physical_device: physical, device, queue_family, queue, float_atomics };
        Self::assemble(borrowed, debug, messages, messenger, true)
    }

    /// Uses the caller's device.
    ///
    /// # Errors
    /// [`GpuError::Missing`] names what the physical device lacks. Features and extensions that exist but were not enabled
    /// cannot be seen from here: enable what [`Context::requirements`] lists.
    ///
    /// # Safety
    /// The handles belong together, outlive every clone of the context and all that is made from it, and nobody else
    /// uses the queue while glint submits.
    pub unsafe fn borrow(device: BorrowedDevice) -> Result<Self, GpuError> {
        check(&device.instance, device.physical_device)?;
        Self::assemble(device, false, Arc::default(), None, false)
    }

    fn assemble(
        from: BorrowedDevice,
        debug: bool,
        messages: Arc<Mutex<Vec<String>>>,
        messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
        owned: bool,
    ) -> Result<Self, GpuError> {
        let BorrowedDevice { entry, instance, physical_device, device, queue_family, queue, float_atomics } = from;
        let mut info = describe(&instance, physical_device);
        info.float_atomics &= float_atomics;
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: instance.clone(),
            device: device.clone(),
            physical_device,
            debug_settings: Default::default(),
            buffer_device_address: false,
            allocation_sizes: Default::default(),
        })
        .map_err(|source| GpuError::Allocation { name: "allocator".into(), bytes: 0, source })?;
        let context = Context(Arc::new(Inner {
            push_descriptor: khr::push_descriptor::Device::new(&instance, &device),
            debug: debug.then(|| ext::debug_utils::Device::new(&instance, &device)),
            queue: Mutex::new(queue),
            queue_family,
            info,
            allocator: Mutex::new(Some(allocator)),
            free_slots: Mutex::default(),
            submissions: AtomicU64::new(0),
            waits: AtomicU64::new(0),
            messages,
            messenger,
            device,
            instance,
            physical: physical_device,
            owned,
            _entry: entry,
        }));
        tracing::debug!(device = context.info().name, subgroup = context.info().subgroup_size, "device opened");
        Ok(context)
    }

    pub fn info(&self) -> &DeviceInfo {
        &self.0.info
    }

    pub fn physical_device(&self) -> vk::PhysicalDevice {
        self.0.physical
    }

    /// Starts a command buffer of our own.
    pub fn recorder(&self, label: &str) -> Result<Recorder, GpuError> {
        Recorder::new(self, label)
    }

    pub fn counters(&self) -> Counters {
        Counters {
            submissions: self.0.submissions.load(Ordering::Relaxed),
            waits: self.0.waits.load(Ordering::Relaxed),
        }
    }

    /// What the validation layer said so far; empty unless [`ContextOptions::validation`] is on and something is wrong.
    pub fn validation_messages(&self) -> Vec<String> {
        self.0.messages.lock().map(|m| m.clone()).unwrap_or_default()
    }
}

impl Drop for Inner {
    fn drop(&mut self) {
        // SAFETY: every buffer, pipeline and recorder holds an Arc of this, so none is left; work that a dropped
        // submission left behind is waited for first.
        unsafe {
            if self.owned {
                let _ = self.device.device_wait_idle();
            }
            if let Ok(mut slots) = self.free_slots.lock() {
                for slot in slots.drain(..) {
                    destroy_slot(&self.device, slot);
                }
            }
            if let Ok(mut allocator) = self.allocator.lock() {
                drop(allocator.take());
            }
            if self.owned {
                self.device.destroy_device(None);
                if let Some((utils, messenger)) = &self.messenger {
                    utils.destroy_debug_utils_messenger(*messenger, None);
                }
                self.instance.destroy_instance(None);
            }
        }
    }
}

const VALIDATION: &CStr = c"VK_LAYER_KHRONOS_validation";

/// The flag says whether debug labels and names can be used.
fn create_instance(validation: bool) -> Result<(ash::Entry, ash::Instance, bool), GpuError> {
    // SAFETY: loading the system's Vulkan loader runs its initialisers, which is what every Vulkan program does.
    let entry = unsafe { ash::Entry::load() }.map_err(|e| GpuError::NoLoader(e.to_string()))?;
    // SAFETY: plain queries and a creation from structures that live for the call.
    unsafe {
        let available = entry.enumerate_instance_extension_properties(None).unwrap_or_default();
        let debug = has_extension(&available, ext::debug_utils::NAME);
        let mut extensions = Vec::new();
        if debug {
            extensions.push(ext::debug_utils::NAME.as_ptr());
        }
        let mut layers = Vec::new();
        if validation {
            let known = entry.enumerate_instance_layer_properties().unwrap_or_default();
            if !known.iter().any(|l| l.layer_name_as_c_str().is_ok_and(|n| n == VALIDATION)) {
                return Err(GpuError::Missing {
                    device: "the Vulkan loader".into(),
                    feature: "the Khronos validation layer (apt install vulkan-validationlayers)".into(),
                });
            }
            layers.push(VALIDATION.as_ptr());
        }
        let enabled = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enabled);
        let app = vk::ApplicationInfo::default().application_name(c"glint").api_version(vk::API_VERSION_1_2);
        let mut info = vk::InstanceCreateInfo::default()
            .application_info(&app)
            .enabled_extension_names(&extensions)
            .enabled_layer_names(&layers);
        if validation {
            info = info.push_next(&mut features);
        }
        let instance = entry.create_instance(&info, None).check("vkCreateInstance")?;
        Ok((entry, instance, debug))
    }
}

fn create_messenger(
    entry: &ash::Entry,
    instance: &ash::Instance,
    messages: &Arc<Mutex<Vec<String>>>,
) -> Result<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT), GpuError> {
    unsafe extern "system" fn receive(
        _severity: vk::DebugUtilsMessageSeverityFlagsEXT,
        _kind: vk::DebugUtilsMessageTypeFlagsEXT,
        data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
        user: *mut c_void,
    ) -> vk::Bool32 {
        // SAFETY: the layer passes a valid structure; `user` is the Mutex that the context's Inner keeps alive.
        unsafe {
            if let Some(text) = data.as_ref().and_then(|d| d.message_as_c_str()) {
                let text = text.to_string_lossy().into_owned();
                eprintln!("validation: {text}");
                if let Ok(mut list) = (*user.cast::<Mutex<Vec<String>>>()).lock() {
                    list.push(text);
                }
            }
        }
        vk::FALSE
    }
    let utils = ext::debug_utils::Instance::new(entry, instance);
    let info = vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(vk::DebugUtilsMessageSeverityFlagsEXT::WARNING | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR)
        .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE)
        .pfn_user_callback(Some(receive))
        .user_data(Arc::as_ptr(messages) as *mut c_void);
    // SAFETY: the callback and its data outlive the messenger, which Inner destroys before it drops `messages`.
    let messenger = unsafe { utils.create_debug_utils_messenger(&info, None) }.check("vkCreateDebugUtilsMessenger")?;
    Ok((utils, messenger))
}

fn describe(instance: &ash::Instance, physical: vk::PhysicalDevice) -> DeviceInfo {
    let mut subgroup = vk::PhysicalDeviceSubgroupProperties::default();
    let mut driver = vk::PhysicalDeviceDriverProperties::default();
    let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut subgroup).push_next(&mut driver);
    // SAFETY: `physical` comes from this instance, the chain lives for the call.
    unsafe { instance.get_physical_device_properties2(physical, &mut properties) };
    let p = properties.properties;
    let mut atomics = vk::PhysicalDeviceShaderAtomicFloatFeaturesEXT::default();
    // SAFETY: as above; the structure is asked for only where the extension is there.
    unsafe {
        let known = instance.enumerate_device_extension_properties(physical).unwrap_or_default();
        if has_extension(&known, ext::shader_atomic_float::NAME) {
            let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut atomics);
            instance.get_physical_device_features2(physical, &mut features);
        }
    }
    let text = |s: Result<&CStr, _>| s.map(|s: &CStr| s.to_string_lossy().into_owned()).unwrap_or_default();
    DeviceInfo {
        name: text(p.device_name_as_c_str()),
        kind: match p.device_type {
            vk::PhysicalDeviceType::DISCRETE_GPU => "discrete GPU",
            vk::PhysicalDeviceType::INTEGRATED_GPU => "integrated GPU",
            vk::PhysicalDeviceType::VIRTUAL_GPU => "virtual GPU",
            vk::PhysicalDeviceType::CPU => "CPU",
            _ => "other",
        },
        subgroup_size: subgroup.subgroup_size,
        max_storage_bytes: p.limits.max_storage_buffer_range as u64,
        timestamp_period: if p.limits.timestamp_compute_and_graphics == vk::TRUE {
            p.limits.timestamp_period
        } else {
            0.0
        },
        is_cpu: p.device_type == vk::PhysicalDeviceType::CPU,
        driver: text(driver.driver_info_as_c_str()),
        float_atomics: atomics.shader_buffer_float32_atomic_add == vk::TRUE,
    }
}

fn has_extension(list: &[vk::ExtensionProperties], wanted: &CStr) -> bool {
    list.iter().any(|e| e.extension_name_as_c_str().is_ok_and(|name| name == wanted))
}

/// Names the first thing that the physical device lacks.
fn check(instance: &ash::Instance, physical: vk::PhysicalDevice) -> Result<(), GpuError> {
    let info = describe(instance, physical);
    let missing = |feature: String| Err(GpuError::Missing { device: info.name.clone(), feature });
    let mut subgroup = vk::PhysicalDeviceSubgroupProperties::default();
    let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut subgroup);
    let mut vulkan12 = vk::PhysicalDeviceVulkan12Features::default();
    // SAFETY: `physical` comes from this instance, the chains live for the calls.
    let extensions = unsafe {
        instance.get_physical_device_properties2(physical, &mut properties);
        if properties.properties.api_version < vk::API_VERSION_1_2 {
            return missing("Vulkan 1.2".into());
        }
        let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut vulkan12);
        instance.get_physical_device_features2(physical, &mut features);
        instance.enumerate_device_extension_properties(physical).check("vkEnumerateDeviceExtensionProperties")?
    };
    if vulkan12.scalar_block_layout == vk::FALSE {
        return missing("feature scalarBlockLayout".into());
    }
    if vulkan12.host_query_reset == vk::FALSE {
        return missing("feature hostQueryReset".into());
    }
    for wanted in EXTENSIONS {
        if !has_extension(&extensions, wanted) {
            return missing(format!("extension {}", wanted.to_string_lossy()));
        }
    }
    for (flag, name) in SUBGROUP_OPERATIONS {
        if !subgroup.supported_operations.contains(flag) {
            return missing(format!("{name} operations"));
        }
    }
    if !(8..=64).contains(&subgroup.subgroup_size) {
        return missing(format!("subgroups of 8 to 64 lanes (it has {})", subgroup.subgroup_size));
    }
    Ok(())
}

fn pick(instance: &ash::Instance, wanted: Option<&str>) -> Result<vk::PhysicalDevice, GpuError> {
    // SAFETY: a query on a live instance.
    let list = unsafe { instance.enumerate_physical_devices() }.check("vkEnumeratePhysicalDevices")?;
    let names = || {
        let each = |(i, &p)| format!("{i}: {}", describe(instance, p).name);
        list.iter().enumerate().map(each).collect::<Vec<_>>().join(", ")
    };
    if let Some(wanted) = wanted {
        let found = match wanted.parse::<usize>() {
            Ok(index) => list.get(index).copied(),
            Err(_) => {
                let lower = wanted.to_lowercase();
                list.iter().copied().find(|&p| describe(instance, p).name.to_lowercase().contains(&lower))
            }
        };
        let found = found.ok_or_else(|| GpuError::NoDevice(format!(" called {wanted:?}; there are: {}", names())))?;
        return check(instance, found).map(|()| found);
    }
    let order = |p: &vk::PhysicalDevice| match describe(instance, *p).kind {
        "discrete GPU" => 0,
        "virtual GPU" => 1,
        "integrated GPU" => 2,
        _ => 3,
    };
    let mut sorted = list.clone();
    sorted.sort_by_key(order);
    let mut first_failure = None;
    for physical in sorted {
        match check(instance, physical) {
            Ok(()) => return Ok(physical),
            Err(e) => first_failure = first_failure.or(Some(e)),
        }
    }
    Err(first_failure.unwrap_or_else(|| GpuError::NoDevice(" (none is installed)".into())))
}

fn open(instance: &ash::Instance, physical: vk::PhysicalDevice) -> Result<(ash::Device, u32), GpuError> {
    // SAFETY: `physical` belongs to the instance; all structures live for the calls.
    unsafe {
        let families = instance.get_physical_device_queue_family_properties(physical);
        let family = families
            .iter()
            .position(|f| f.queue_flags.contains(vk::QueueFlags::COMPUTE))
            .ok_or_else(|| GpuError::NoDevice(" with a compute queue".into()))? as u32;
        let priorities = [1.0];
        let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&priorities)];
        let mut extensions: Vec<_> = EXTENSIONS.iter().map(|e| e.as_ptr()).collect();
        let mut atomics =
            vk::PhysicalDeviceShaderAtomicFloatFeaturesEXT::default().shader_buffer_float32_atomic_add(true);
        let float_atomics = describe(instance, physical).float_atomics;
        let mut vulkan12 =
            vk::PhysicalDeviceVulkan12Features::default().scalar_block_layout(true).host_query_reset(true);
        let mut info = vk::DeviceCreateInfo::default().queue_create_infos(&queues).push_next(&mut vulkan12);
        if float_atomics {
            extensions.push(ext::shader_atomic_float::NAME.as_ptr());
            info = info.push_next(&mut atomics);
        }
        let info = info.enabled_extension_names(&extensions);
        let device = instance.create_device(physical, &info, None).check("vkCreateDevice")?;
        Ok((device, family))
    }
}
