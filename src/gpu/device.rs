//! Queries a physical device, checks it against glint's requirements and decides how kernels run on it.

use std::{collections::BTreeSet, ffi::CStr};

use ash::{ext, khr, vk};

use super::{
    Check, ContextOptions, Feature, GpuError,
    features::{FeatureChain, has_extension},
    instance::{unknown_to_layers, version_text},
    memory::host_memory,
    needs,
    spirv::{MAXIMALLY_RECONVERGES, Mode, SIGNED_ZERO_INF_NAN_PRESERVE, SUBGROUP_UNIFORM_CONTROL_FLOW},
};

/// Lanes of the smallest and the largest subgroup that kernels support.
const LANES: [u32; 2] = [8, 64];

/// Lanes of software subgroups by default.
const SOFTWARE_LANES: u32 = 32;

/// Extensions that glint enables, and that a borrowed device should have enabled, in addition to those of its
/// features.
const EXTENSIONS: [&CStr; 1] = [khr::push_descriptor::NAME];

/// Requirements for a device and for its creation, and its optional features.
///
/// Two of them have a slower substitute. Without `VK_KHR_push_descriptor` glint uses ordinary descriptor
/// sets. Without the features, operations or lanes of subgroups ([`Feature::is_of_subgroups`]) it runs
/// subgroups of 32 lanes in software, through shared memory; an application then makes the device without
/// these features and extensions.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Requirements {
    /// Lowest Vulkan version.
    pub api_version: u32,
    /// To be enabled if the device has them. [`Feature::extension`] names extensions of the features; on a
    /// device of Vulkan 1.3 `VK_EXT_subgroup_size_control` is not needed.
    pub extensions: Vec<&'static CStr>,
    /// [`FeatureChain`] sets them for `vkCreateDevice`.
    pub features: Vec<Feature>,
    /// Name those that the device has in [`BorrowedDevice::optional`](super::BorrowedDevice::optional).
    pub optional: Vec<Feature>,
    /// Required in `VkPhysicalDeviceSubgroupProperties`, for compute.
    pub subgroup_operations: vk::SubgroupFeatureFlags,
    /// Smallest and largest number of lanes of a subgroup. Either a pipeline can require a size in this
    /// range, or the device's only size is in it.
    pub subgroup_lanes: [u32; 2],
    /// The largest needs of any kernel. A pipeline whose constants need more is checked when it is made.
    pub limits: Vec<Limit>,
}

/// A limit that a device must allow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limit {
    /// Its name in `VkPhysicalDeviceLimits`.
    pub name: &'static str,
    /// Smallest value that glint needs.
    pub least: u32,
}

/// Bytes of shared memory and threads of a workgroup that every Vulkan device allows. Kernels stay within the
/// first, and use larger workgroups only if the device allows them.
const SHARED_BYTES: u32 = 16_384;
const WORKGROUP: u32 = 128;

/// Reads a limit of a device.
type Said = fn(&Limits) -> u32;

/// The limits, and how to read a device's.
const LIMITS: [(Limit, Said); 7] = {
    const fn limit(name: &'static str, least: u32) -> Limit {
        Limit { name, least }
    }
    [
        (limit("maxPerStageDescriptorStorageBuffers", needs::STORAGE_BUFFERS), |l| l.stage_storage_buffers),
        (limit("maxDescriptorSetStorageBuffers", needs::STORAGE_BUFFERS), |l| l.set_storage_buffers),
        (limit("maxPerStageResources", needs::STORAGE_BUFFERS), |l| l.stage_resources),
        (limit("maxPushConstantsSize", needs::PUSH_BYTES), |l| l.push_bytes),
        (limit("maxComputeSharedMemorySize", SHARED_BYTES), |l| l.shared_bytes),
        (limit("maxComputeWorkGroupInvocations", WORKGROUP), |l| l.workgroup_invocations),
        (limit("maxComputeWorkGroupSize", WORKGROUP), |l| l.workgroup_size),
    ]
};

impl Requirements {
    /// The requirements of all kernels together.
    pub(super) fn of_kernels() -> Self {
        let features = Feature::REQUIRED.to_vec();
        let mut extensions = EXTENSIONS.to_vec();
        extensions.extend(features.iter().filter_map(|f| f.extension()));
        extensions.dedup();
        Requirements {
            api_version: vk::API_VERSION_1_2,
            extensions,
            optional: Feature::ALL.into_iter().filter(|f| !features.contains(f)).collect(),
            features,
            subgroup_operations: vk::SubgroupFeatureFlags::from_raw(needs::SUBGROUP_OPERATIONS),
            subgroup_lanes: LANES,
            limits: LIMITS.iter().map(|(limit, _)| *limit).collect(),
        }
    }
}

/// Guarantee that the lanes of a subgroup meet again after a divergent branch: subgroup operations rely on
/// it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "train", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum Reconvergence {
    /// `VK_KHR_shader_maximal_reconvergence`.
    Maximal,
    /// `VK_KHR_shader_subgroup_uniform_control_flow`.
    SubgroupUniform,
    /// The driver runs a subgroup as one stream of masked vector instructions.
    Masked,
    /// Only Vulkan's own rule, which covers whole workgroups: so a workgroup is one subgroup.
    OneSubgroup,
}

/// Driver of a physical device.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "train", derive(serde::Serialize))]
pub struct Driver {
    /// The driver's own text on its version.
    #[cfg_attr(feature = "train", serde(rename = "driver"))]
    pub version: String,
    /// Name of the driver.
    #[cfg_attr(feature = "train", serde(rename = "driver_name"))]
    pub name: String,
    /// Version of Vulkan, such as 1.3.230.
    pub vulkan: String,
    #[cfg_attr(feature = "train", serde(skip))]
    id: vk::DriverId,
}

/// Properties of a physical device, and how kernels run on it.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "train", derive(serde::Serialize))]
pub struct DeviceInfo {
    /// The driver's name for it.
    pub name: String,
    /// Discrete GPU, CPU and so on, as printed by `glint devices`.
    pub kind: &'static str,
    /// Lanes of every subgroup; for a device that glint cannot use, the device's preferred size.
    pub subgroup_size: u32,
    /// The smallest and the largest size that the device offers.
    pub subgroup_sizes: [u32; 2],
    /// Guarantee that keeps lanes together, see [`Reconvergence`].
    pub reconvergence: Reconvergence,
    /// The driver (llvmpipe) runs a subgroup as one stream of masked vector instructions: its lanes are always together, and kernels
    /// put no control barrier between them, see `glsl/shared/meet.glsl`.
    pub lockstep: bool,
    /// Kernels are run with `SignedZeroInfNanPreserve`: NaN and infinities are those of IEEE 754.
    pub preserves_nan: bool,
    /// Threads of the largest workgroup, a multiple of the subgroup size.
    pub max_workgroup: u32,
    /// Largest storage buffer of a kernel, bytes.
    pub max_storage_bytes: u64,
    /// Nanoseconds per timestamp tick; 0 if the queue has no timestamps.
    pub timestamp_period: f32,
    /// True for llvmpipe and other CPU implementations: costs are ALU and dispatch, never bandwidth.
    pub is_cpu: bool,
    /// Its driver.
    #[cfg_attr(feature = "train", serde(flatten))]
    pub driver: Driver,
    /// Bytes of its largest heap of device memory; of a CPU device the host's memory.
    pub memory_bytes: u64,
    /// Set if subgroup operations go through shared memory in software: names the missing need, or that
    /// software was requested.
    pub software_subgroups: Option<String>,
    /// Float atomics can be used (`shaderBufferFloat32AtomicAdd`); on a borrowed device, if its owner
    /// declares so.
    pub float_atomics: bool,
}

impl DeviceInfo {
    /// Threads of a workgroup whose subgroups work independently: `wanted`, unless a workgroup must be one
    /// subgroup ([`Reconvergence::OneSubgroup`]).
    pub fn workgroup(&self, wanted: u32) -> u32 {
        match self.reconvergence {
            Reconvergence::OneSubgroup => self.subgroup_size,
            _ => wanted,
        }
    }

    /// Lanes of a subgroup if kernels should be unrolled over them: a CPU broadcasts a lane with a constant
    /// index in one instruction, and any other through memory, while a GPU's code should be short. Only
    /// software subgroups on a CPU have more than 16 lanes.
    pub fn constant_lanes(&self) -> Option<u32> {
        (self.is_cpu && self.subgroup_size <= 16).then_some(self.subgroup_size)
    }
}

/// A physical device.
#[derive(Clone)]
pub(super) struct Physical {
    pub handle: vk::PhysicalDevice,
    pub extensions: Vec<vk::ExtensionProperties>,
    pub offered: BTreeSet<Feature>,
    pub limits: Limits,
    /// The first family with compute, and the number of valid bits of its timestamps.
    pub queue_family: Option<(u32, u32)>,
    pub memory: vk::PhysicalDeviceMemoryProperties,
    api_version: u32,
    name: String,
    driver: Driver,
    pub device_type: vk::PhysicalDeviceType,
    /// The device's own choice if no size is required.
    preferred_lanes: u32,
    subgroup_operations: u32,
    subgroup_sizes: [u32; 2],
    /// A pipeline can require one of them.
    requires_lanes: bool,
    preserves_nan: bool,
}

/// Limits for kernels.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    workgroup_invocations: u32,
    /// Limit in x.
    workgroup_size: u32,
    workgroup_subgroups: u32,
    stage_storage_buffers: u32,
    set_storage_buffers: u32,
    stage_resources: u32,
    push_descriptors: u32,
    pub shared_bytes: u32,
    pub push_bytes: u32,
    /// Largest buffer that can be bound at once, created and allocated.
    pub storage_bytes: u64,
    pub timestamp_period: f32,
}

/// Drivers may allow larger bindings than allocations (AMD's own: 4 GiB and 2 GiB). 0 means not reported.
fn largest_buffer(storage_range: u32, allocation: u64, buffer: u64) -> u64 {
    let said = [u64::from(storage_range), allocation, buffer].into_iter().filter(|&bytes| bytes > 0);
    said.min().unwrap_or(0)
}

impl Limits {
    /// Maximum threads of a workgroup.
    pub fn workgroup(&self) -> u32 {
        self.workgroup_invocations.min(self.workgroup_size)
    }

    /// Maximum buffers of a kernel.
    pub fn storage_buffers(&self) -> u32 {
        self.stage_storage_buffers.min(self.set_storage_buffers).min(self.stage_resources)
    }

    /// True if the buffers of every kernel can be push descriptors.
    pub fn push_descriptors(&self) -> bool {
        self.push_descriptors >= needs::STORAGE_BUFFERS
    }
}

/// How the kernels of a context use subgroups.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Subgroups {
    pub lanes: u32,
    /// Each pipeline must require the size, as the device offers several.
    pub require: bool,
    pub reconvergence: Reconvergence,
    /// Subgroup operations go through shared memory, see `glsl/shared/subgroup.glsl`.
    pub software: bool,
}

impl Physical {
    /// # Safety
    /// `handle` comes from `instance`.
    pub unsafe fn query(instance: &ash::Instance, handle: vk::PhysicalDevice) -> Self {
        // SAFETY: by the contract above; all chains live for their calls and hold only structures that the device knows.
        unsafe {
            let extensions = instance.enumerate_device_extension_properties(handle).unwrap_or_default();
            let api_version = instance.get_physical_device_properties(handle).api_version;
            let known = Feature::ALL.into_iter().filter(|f| f.known(&extensions, api_version)).collect();
            let mut subgroup = vk::PhysicalDeviceSubgroupProperties::default();
            let mut sizes = vk::PhysicalDeviceSubgroupSizeControlProperties::default();
            let mut driver = vk::PhysicalDeviceDriverProperties::default();
            let mut floats = vk::PhysicalDeviceFloatControlsProperties::default();
            let mut push = vk::PhysicalDevicePushDescriptorPropertiesKHR::default();
            let mut allocations = vk::PhysicalDeviceMaintenance3Properties::default();
            let mut buffers = vk::PhysicalDeviceMaintenance4Properties::default();
            let mut properties =
                vk::PhysicalDeviceProperties2::default().push_next(&mut subgroup).push_next(&mut allocations);
            if api_version >= vk::API_VERSION_1_3 {
                properties = properties.push_next(&mut buffers);
            }
            if api_version >= vk::API_VERSION_1_2 {
                properties = properties.push_next(&mut driver).push_next(&mut floats);
            }
            if Feature::SubgroupSizeControl.known(&extensions, api_version) {
                properties = properties.push_next(&mut sizes);
            }
            if has_extension(&extensions, khr::push_descriptor::NAME) {
                properties = properties.push_next(&mut push);
            }
            instance.get_physical_device_properties2(handle, &mut properties);
            let p = properties.properties;
            let limits = p.limits;
            let families = instance.get_physical_device_queue_family_properties(handle);
            let compute = families.iter().position(|f| f.queue_flags.contains(vk::QueueFlags::COMPUTE));
            let text = |s: Result<&CStr, _>| s.map(|s: &CStr| s.to_string_lossy().into_owned()).unwrap_or_default();
            Physical {
                handle,
                offered: match api_version >= vk::API_VERSION_1_2 {
                    true => FeatureChain::offered(instance, handle, known),
                    false => BTreeSet::new(),
                },
                extensions,
                limits: Limits {
                    workgroup_invocations: limits.max_compute_work_group_invocations,
                    workgroup_size: limits.max_compute_work_group_size[0],
                    workgroup_subgroups: sizes.max_compute_workgroup_subgroups,
                    shared_bytes: limits.max_compute_shared_memory_size,
                    stage_storage_buffers: limits.max_per_stage_descriptor_storage_buffers,
                    set_storage_buffers: limits.max_descriptor_set_storage_buffers,
                    stage_resources: limits.max_per_stage_resources,
                    push_descriptors: push.max_push_descriptors,
                    push_bytes: limits.max_push_constants_size,
                    storage_bytes: largest_buffer(
                        limits.max_storage_buffer_range,
                        allocations.max_memory_allocation_size,
                        buffers.max_buffer_size,
                    ),
                    timestamp_period: limits.timestamp_period,
                },
                queue_family: compute.map(|i| (i as u32, families[i].timestamp_valid_bits)),
                memory: instance.get_physical_device_memory_properties(handle),
                api_version,
                name: text(p.device_name_as_c_str()),
                driver: Driver {
                    version: text(driver.driver_info_as_c_str()),
                    name: text(driver.driver_name_as_c_str()),
                    vulkan: version_text(api_version),
                    id: driver.driver_id,
                },
                device_type: p.device_type,
                preferred_lanes: subgroup.subgroup_size,
                subgroup_operations: subgroup.supported_operations.as_raw(),
                subgroup_sizes: [sizes.min_subgroup_size, sizes.max_subgroup_size],
                requires_lanes: sizes.required_subgroup_size_stages.contains(vk::ShaderStageFlags::COMPUTE),
                preserves_nan: floats.shader_signed_zero_inf_nan_preserve_float32 == vk::TRUE,
            }
        }
    }

    /// Decides how kernels would use its subgroups with these features enabled, or returns the first missing
    /// requirement.
    pub fn check(&self, options: &ContextOptions, enabled: &BTreeSet<Feature>) -> Result<Subgroups, GpuError> {
        let missing = |feature: String| GpuError::Missing { device: self.name.clone(), feature };
        let needed = Requirements::of_kernels();
        if self.api_version < needed.api_version {
            let version = needed.api_version;
            let (major, minor) = (vk::api_version_major(version), vk::api_version_minor(version));
            return Err(missing(format!("Vulkan {major}.{minor}")));
        }
        if self.queue_family.is_none() {
            return Err(missing("a compute queue".into()));
        }
        for feature in needed.features.into_iter().filter(|f| !f.is_of_subgroups()) {
            if !self.offered.contains(&feature) {
                return Err(missing(format!("feature {}", feature.name())));
            }
        }
        for (Limit { name, least }, of) in LIMITS {
            let has = of(&self.limits);
            if least > has {
                let (device, what) = (self.name.clone(), format!("of {name}"));
                return Err(GpuError::Limit { device, what, needs: least.into(), has: has.into() });
            }
        }
        let lanes = options.subgroup_size;
        if !options.software_subgroups {
            match self.own_subgroups(lanes, enabled) {
                Ok(own) => return Ok(own),
                // Its subgroups are usable, but not at this size.
                Err(lacks) if lanes.is_some() && self.own_subgroups(None, enabled).is_ok() => {
                    return Err(missing(lacks));
                }
                Err(lacks) => tracing::debug!("{}: subgroups by software, the device lacks {lacks}", self.name),
            }
        }
        let fits = |lanes: &u32| lanes.is_power_of_two() && (LANES[0]..=LANES[1]).contains(lanes);
        let lanes = Some(lanes.unwrap_or(SOFTWARE_LANES)).filter(fits);
        let lanes =
            lanes.ok_or_else(|| missing(format!("subgroups of {} lanes", options.subgroup_size.unwrap_or(0))))?;
        // Each operation contains a workgroup barrier, so subgroups that work independently need their own
        // workgroup.
        Ok(Subgroups { lanes, require: false, reconvergence: Reconvergence::OneSubgroup, software: true })
    }

    /// Decides how kernels would use the device's own subgroups, or returns the missing requirement.
    fn own_subgroups(&self, wanted: Option<u32>, enabled: &BTreeSet<Feature>) -> Result<Subgroups, String> {
        let needed = Requirements::of_kernels();
        let name = ext::subgroup_size_control::NAME;
        if self.api_version < vk::API_VERSION_1_3 && !has_extension(&self.extensions, name) {
            return Err(format!("extension {}", name.to_string_lossy()));
        }
        if let Some(feature) = needed.features.into_iter().find(|f| f.is_of_subgroups() && !self.offered.contains(f)) {
            return Err(format!("feature {}", feature.name()));
        }
        let operations = needed.subgroup_operations & !vk::SubgroupFeatureFlags::from_raw(self.subgroup_operations);
        if !operations.is_empty() {
            return Err(format!("subgroup operations in compute: {operations:?}"));
        }
        let (lanes, require) = self.lanes(wanted).ok_or_else(|| {
            let wanted = match wanted {
                Some(lanes) => format!("subgroups of {lanes} lanes"),
                None => format!("subgroups of one known size from {} to {} lanes", LANES[0], LANES[1]),
            };
            let [least, most] = self.subgroup_sizes;
            let own = if self.requires_lanes { "" } else { ", and takes no demand" };
            format!("{wanted} (it offers {least} to {most}{own})")
        })?;
        let reconvergence = match self.driver.id {
            _ if enabled.contains(&Feature::ShaderMaximalReconvergence) => Reconvergence::Maximal,
            _ if enabled.contains(&Feature::ShaderSubgroupUniformControlFlow) => Reconvergence::SubgroupUniform,
            vk::DriverId::MESA_LLVMPIPE => Reconvergence::Masked,
            _ => Reconvergence::OneSubgroup,
        };
        Ok(Subgroups { lanes, require, reconvergence, software: false })
    }

    /// Lanes of its subgroups, and whether each pipeline must require them.
    fn lanes(&self, wanted: Option<u32>) -> Option<(u32, bool)> {
        let [low, high] = [self.subgroup_sizes[0].max(LANES[0]), self.subgroup_sizes[1].min(LANES[1])];
        if self.requires_lanes && low <= high {
            let fits = |lanes: &u32| lanes.is_power_of_two() && (low..=high).contains(lanes);
            // All sizes are powers of two, so the nearest one is at an end.
            return Some((Some(wanted.unwrap_or(self.preferred_lanes.clamp(low, high))).filter(fits)?, true));
        }
        // A size that cannot be required is still known if there is only one.
        let only = Some(low).filter(|_| self.subgroup_sizes == [low, high] && low == high);
        Some((only.filter(|&lanes| wanted.is_none_or(|w| w == lanes))?, false))
    }

    fn memory_bytes(&self) -> u64 {
        let heaps = &self.memory.memory_heaps[..self.memory.memory_heap_count as usize];
        let local = heaps.iter().filter(|heap| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL));
        let largest = local.map(|heap| heap.size).max().unwrap_or_default();
        let is_cpu = self.device_type == vk::PhysicalDeviceType::CPU;
        host_memory().filter(|_| is_cpu).unwrap_or(largest)
    }

    /// Valid timestamp bits of the first family with compute.
    pub fn timestamp_bits(&self) -> u32 {
        self.queue_family.map_or(0, |(_, bits)| bits)
    }

    /// `subgroups` is the result of [`Physical::check`]; none for a device that glint cannot use.
    pub fn info(&self, subgroups: Option<Subgroups>, enabled: &BTreeSet<Feature>, timestamp_bits: u32) -> DeviceInfo {
        let Limits { workgroup_subgroups, storage_bytes, timestamp_period, .. } = self.limits;
        let lanes = subgroups.map_or(self.preferred_lanes, |s| s.lanes).max(1);
        let most = if subgroups.is_some_and(|s| s.software) {
            u32::MAX
        } else {
            // Some drivers (RADV) report 2^32 - 1 for "any number".
            lanes.saturating_mul(workgroup_subgroups)
        };
        DeviceInfo {
            name: self.name.clone(),
            kind: match self.device_type {
                vk::PhysicalDeviceType::DISCRETE_GPU => "discrete GPU",
                vk::PhysicalDeviceType::INTEGRATED_GPU => "integrated GPU",
                vk::PhysicalDeviceType::VIRTUAL_GPU => "virtual GPU",
                vk::PhysicalDeviceType::CPU => "CPU",
                _ => "other",
            },
            subgroup_size: lanes,
            subgroup_sizes: self.subgroup_sizes,
            reconvergence: subgroups.map_or(Reconvergence::OneSubgroup, |s| s.reconvergence),
            lockstep: self.driver.id == vk::DriverId::MESA_LLVMPIPE && !subgroups.is_some_and(|s| s.software),
            preserves_nan: self.preserves_nan,
            max_workgroup: self.limits.workgroup().min(most) / lanes * lanes,
            max_storage_bytes: storage_bytes,
            timestamp_period: if timestamp_bits > 0 { timestamp_period } else { 0.0 },
            is_cpu: self.device_type == vk::PhysicalDeviceType::CPU,
            driver: self.driver.clone(),
            memory_bytes: self.memory_bytes(),
            software_subgroups: subgroups.filter(|s| s.software).map(|_| {
                self.own_subgroups(None, enabled).err().unwrap_or_else(|| "software subgroups were asked for".into())
            }),
            float_atomics: enabled.contains(&Feature::ShaderBufferFloat32AtomicAdd),
        }
    }

    /// Extensions that glint enables on its own device with all features on offer.
    pub fn own_extensions(&self) -> Vec<&'static CStr> {
        // A device that is not fully conformant (MoltenVK) requires VK_KHR_portability_subset to be enabled.
        // glint uses nothing that such a device may lack.
        let others = [khr::portability_subset::NAME, ext::memory_budget::NAME];
        let features = self.offered.iter().filter_map(|f| f.extension());
        let mut list: Vec<_> = EXTENSIONS.into_iter().chain(features).chain(others).collect();
        list.sort_unstable();
        list.dedup();
        // Extensions that became part of Vulkan 1.3 may be missing as extensions.
        list.retain(|name| has_extension(&self.extensions, name));
        list
    }
}

impl Subgroups {
    /// Execution modes added to a kernel's module.
    pub fn modes(&self, info: &DeviceInfo, uses_subgroups: bool) -> Vec<Mode> {
        let reconvergence = match self.reconvergence {
            Reconvergence::Maximal => Some(MAXIMALLY_RECONVERGES),
            Reconvergence::SubgroupUniform => Some(SUBGROUP_UNIFORM_CONTROL_FLOW),
            Reconvergence::Masked | Reconvergence::OneSubgroup => None,
        };
        let floats = info.preserves_nan.then_some(SIGNED_ZERO_INF_NAN_PRESERVE);
        floats.into_iter().chain(reconvergence.filter(|_| uses_subgroups)).collect()
    }
}

/// All physical devices, in the loader's order.
pub(super) fn all(instance: &ash::Instance) -> Result<Vec<Physical>, GpuError> {
    // SAFETY: queries on a live instance.
    unsafe {
        let list = instance.enumerate_physical_devices().check("vkEnumeratePhysicalDevices")?;
        Ok(list.into_iter().map(|handle| Physical::query(instance, handle)).collect())
    }
}

/// The device selected by `options`. By default the first usable discrete GPU, then virtual GPU, integrated
/// GPU, any other.
pub(super) fn pick(
    entry: &ash::Entry,
    instance: &ash::Instance,
    options: &ContextOptions,
) -> Result<(Physical, Subgroups), GpuError> {
    let mut list = all(instance)?;
    let unknown = options.validation.then(|| unknown_to_layers(entry)).flatten();
    list.iter_mut().for_each(|p| p.offered.retain(|f| Some(*f) != unknown));
    let usable = |p: Physical| p.check(options, &p.offered).map(|subgroups| (p, subgroups));
    if let Some(wanted) = options.device.as_deref() {
        let found = match wanted.parse::<usize>() {
            Ok(index) => list.get(index),
            Err(_) => list.iter().find(|p| p.name.to_lowercase().contains(&wanted.to_lowercase())),
        };
        return found.cloned().map(usable).unwrap_or_else(|| {
            let names: Vec<_> = list.iter().enumerate().map(|(i, p)| format!("{i}: {}", p.name)).collect();
            Err(GpuError::NoDevice(format!(" called {wanted:?}; there are: {}", names.join(", "))))
        });
    }
    let mut sorted = list;
    sorted.sort_by_key(|p| match p.device_type {
        vk::PhysicalDeviceType::DISCRETE_GPU => 0,
        vk::PhysicalDeviceType::VIRTUAL_GPU => 1,
        vk::PhysicalDeviceType::INTEGRATED_GPU => 2,
        _ => 3,
    });
    let mut first_failure = None;
    for physical in sorted {
        match usable(physical) {
            Ok(found) => return Ok(found),
            Err(e) => first_failure = first_failure.or(Some(e)),
        }
    }
    Err(first_failure.unwrap_or_else(|| GpuError::NoDevice(" (none is installed)".into())))
}

/// Opens a device with everything that `physical` offers and a queue of `family`.
pub(super) fn open(instance: &ash::Instance, physical: &Physical, family: u32) -> Result<ash::Device, GpuError> {
    let priorities = [1.0];
    let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&priorities)];
    let extensions: Vec<_> = physical.own_extensions().iter().map(|e| e.as_ptr()).collect();
    let mut chain = FeatureChain::new(physical.offered.iter().copied());
    let mut features = chain.link();
    let info = vk::DeviceCreateInfo::default()
        .queue_create_infos(&queues)
        .enabled_extension_names(&extensions)
        .push_next(&mut features);
    // SAFETY: `physical` belongs to the instance and offers all that is asked for; the structures live for the call.
    unsafe { instance.create_device(physical.handle, &info, None) }.check("vkCreateDevice")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn extension(name: &CStr) -> vk::ExtensionProperties {
        let mut extension = vk::ExtensionProperties::default();
        for (to, from) in extension.extension_name.iter_mut().zip(name.to_bytes()) {
            *to = *from as std::ffi::c_char;
        }
        extension
    }

    /// A device that meets all requirements and offers one subgroup size.
    fn physical() -> Physical {
        Physical {
            handle: vk::PhysicalDevice::null(),
            extensions: Requirements::of_kernels().extensions.into_iter().map(extension).collect(),
            offered: Feature::REQUIRED.into(),
            limits: Limits {
                workgroup_invocations: 1024,
                workgroup_size: 1024,
                workgroup_subgroups: 16,
                stage_storage_buffers: needs::STORAGE_BUFFERS,
                set_storage_buffers: needs::STORAGE_BUFFERS,
                stage_resources: needs::STORAGE_BUFFERS,
                push_descriptors: needs::STORAGE_BUFFERS,
                shared_bytes: SHARED_BYTES,
                push_bytes: 128,
                storage_bytes: 1 << 27,
                timestamp_period: 1.0,
            },
            queue_family: Some((0, 64)),
            memory: Default::default(),
            api_version: vk::API_VERSION_1_2,
            name: "a device".into(),
            driver: Driver::default(),
            device_type: vk::PhysicalDeviceType::DISCRETE_GPU,
            preferred_lanes: 32,
            subgroup_operations: needs::SUBGROUP_OPERATIONS,
            subgroup_sizes: [32, 32],
            requires_lanes: true,
            preserves_nan: true,
        }
    }

    fn wants(subgroup_size: Option<u32>) -> ContextOptions {
        ContextOptions { subgroup_size, ..Default::default() }
    }

    /// Lanes, and whether each pipeline must require them.
    fn lanes(p: &Physical, wanted: Option<u32>) -> Option<(u32, bool)> {
        p.check(&wants(wanted), &p.offered).ok().map(|s| (s.lanes, s.require))
    }

    #[test]
    fn a_workgroup_may_have_any_number_of_subgroups() {
        let limits = Limits { workgroup_subgroups: u32::MAX, ..physical().limits };
        let p = Physical { limits, subgroup_sizes: [64, 64], preferred_lanes: 64, ..physical() };
        let subgroups = p.check(&wants(None), &p.offered).ok();
        assert_eq!(p.info(subgroups, &p.offered, 64).max_workgroup, 1024);
    }

    #[test]
    fn a_buffer_is_no_larger_than_what_can_be_bound_made_and_allocated() {
        assert_eq!(largest_buffer(1 << 27, 1 << 31, u64::MAX), 1 << 27);
        assert_eq!(largest_buffer(u32::MAX, 1 << 31, 1 << 40), 1 << 31);
        assert_eq!(largest_buffer(u32::MAX, 1 << 40, 1 << 30), 1 << 30);
        // Vulkan 1.2 does not report the last.
        assert_eq!(largest_buffer(u32::MAX, 1 << 40, 0), u64::from(u32::MAX));
    }

    #[test]
    fn one_size_of_subgroups_is_taken_that_the_device_offers_and_kernels_know() {
        let with = |subgroup_sizes, preferred_lanes, requires_lanes| Physical {
            subgroup_sizes,
            preferred_lanes,
            requires_lanes,
            ..physical()
        };
        // NVIDIA, Intel, RDNA, Adreno, and one whose preferred size is small.
        assert_eq!(lanes(&with([32, 32], 32, true), None), Some((32, true)));
        assert_eq!(lanes(&with([8, 32], 32, true), None), Some((32, true)));
        assert_eq!(lanes(&with([32, 64], 64, true), None), Some((64, true)));
        assert_eq!(lanes(&with([64, 128], 128, true), None), Some((64, true)));
        assert_eq!(lanes(&with([4, 16], 4, true), None), Some((8, true)));
        // The caller's size, if it is offered.
        assert_eq!([8, 16, 32].map(|n| lanes(&with([8, 32], 32, true), Some(n))), [8, 16, 32].map(|n| Some((n, true))));
        assert_eq!([0, 4, 24, 64, 128].map(|n| lanes(&with([4, 32], 32, true), Some(n))), [None; 5]);
        // MoltenVK cannot require a size, and has only one.
        assert_eq!(lanes(&with([32, 32], 32, false), None), Some((32, false)));
        assert_eq!(lanes(&with([32, 32], 32, false), Some(32)), Some((32, false)));
        assert_eq!(lanes(&with([32, 32], 32, false), Some(16)), None);
        // Unavailable or unknown: software subgroups, at any size that kernels support.
        let others =
            [([8, 32], 32, false), ([4, 4], 4, true), ([4, 4], 4, false), ([128, 128], 128, true), ([0, 0], 32, false)];
        for (sizes, preferred, required) in others {
            let p = with(sizes, preferred, required);
            let lacks = p.own_subgroups(None, &p.offered).unwrap_err();
            assert!(lacks.contains("from 8 to 64 lanes") && lacks.contains(&format!("{} to {}", sizes[0], sizes[1])));
            let software = |wanted| p.check(&wants(wanted), &p.offered).ok().filter(|s| s.software).map(|s| s.lanes);
            assert_eq!([None, Some(8), Some(64), Some(4)].map(software), [Some(32), Some(8), Some(64), None]);
        }
        // Also if they are requested.
        let p = with([32, 32], 32, true);
        let forced = p.check(&ContextOptions { software_subgroups: true, ..wants(None) }, &p.offered).unwrap();
        assert!(forced.software && forced.reconvergence == Reconvergence::OneSubgroup && !forced.require);
    }

    #[test]
    fn what_a_device_lacks_is_named() {
        let says = |change: fn(&mut Physical)| {
            let mut p = physical();
            change(&mut p);
            p.check(&wants(None), &p.offered).unwrap_err().to_string()
        };
        assert!(physical().check(&wants(None), &BTreeSet::new()).is_ok());
        assert_eq!(says(|p| p.api_version = vk::API_VERSION_1_1), "device a device lacks Vulkan 1.2");
        assert_eq!(says(|p| p.queue_family = None), "device a device lacks a compute queue");
        for feature in Feature::REQUIRED {
            let mut p = physical();
            p.offered.remove(&feature);
            let lacks = format!("feature {}", feature.name());
            match p.check(&wants(None), &p.offered) {
                Ok(s) => assert!(s.software && p.own_subgroups(None, &p.offered).unwrap_err() == lacks),
                Err(e) => assert_eq!(e.to_string(), format!("device a device lacks {lacks}")),
            }
        }
        let operations = needs::SUBGROUP_OPERATIONS & !vk::SubgroupFeatureFlags::BALLOT.as_raw();
        let p = Physical { subgroup_operations: operations, ..physical() };
        assert_eq!(p.own_subgroups(None, &p.offered).unwrap_err(), "subgroup operations in compute: BALLOT");
        // Each limit of the list, by its name; a device that exactly meets the requirements is accepted.
        let set = |limits: &mut Limits, name: &str, value: u32| match name {
            "maxPerStageDescriptorStorageBuffers" => limits.stage_storage_buffers = value,
            "maxDescriptorSetStorageBuffers" => limits.set_storage_buffers = value,
            "maxPerStageResources" => limits.stage_resources = value,
            "maxPushConstantsSize" => limits.push_bytes = value,
            "maxComputeSharedMemorySize" => limits.shared_bytes = value,
            "maxComputeWorkGroupInvocations" => limits.workgroup_invocations = value,
            "maxComputeWorkGroupSize" => limits.workgroup_size = value,
            other => panic!("{other}"),
        };
        let mut least = physical();
        for Limit { name, least: needed } in Requirements::of_kernels().limits {
            let mut p = physical();
            set(&mut p.limits, name, needed - 1);
            let error = p.check(&wants(None), &p.offered).unwrap_err().to_string();
            assert_eq!(error, format!("device a device allows {} of {name}, {needed} are needed", needed - 1));
            set(&mut least.limits, name, needed);
        }
        assert!(least.check(&wants(None), &least.offered).is_ok());
        // An extension that became part of Vulkan 1.3.
        let lone = |api_version| Physical { extensions: vec![], api_version, ..physical() };
        let [old, new] =
            [vk::API_VERSION_1_2, vk::API_VERSION_1_3].map(|v| lone(v).own_subgroups(None, &BTreeSet::new()));
        assert!(new.is_ok() && old.unwrap_err() == "extension VK_EXT_subgroup_size_control");
    }

    #[test]
    fn lanes_are_kept_together_by_what_the_device_offers_best() {
        let how = |id, features: &[Feature]| {
            let p = Physical { driver: Driver { id, ..Driver::default() }, ..physical() };
            let enabled = features.iter().copied().collect();
            let subgroups = p.check(&wants(None), &enabled).unwrap();
            let info = p.info(Some(subgroups), &enabled, 64);
            let modes = subgroups.modes(&info, true).iter().map(|m| m.mode).collect::<Vec<_>>();
            // Kernels without subgroup operations get no mode for them.
            assert_eq!(subgroups.modes(&info, false), [SIGNED_ZERO_INF_NAN_PRESERVE]);
            (subgroups.reconvergence, info.workgroup(128), modes)
        };
        let (maximal, uniform) = (Feature::ShaderMaximalReconvergence, Feature::ShaderSubgroupUniformControlFlow);
        let (any, llvmpipe) = (vk::DriverId::MESA_RADV, vk::DriverId::MESA_LLVMPIPE);
        assert_eq!(how(any, &[maximal, uniform]), (Reconvergence::Maximal, 128, vec![4461, 6023]));
        assert_eq!(how(any, &[uniform]), (Reconvergence::SubgroupUniform, 128, vec![4461, 4421]));
        assert_eq!(how(llvmpipe, &[]), (Reconvergence::Masked, 128, vec![4461]));
        assert_eq!(how(any, &[]), (Reconvergence::OneSubgroup, 32, vec![4461]));
    }

    #[test]
    fn workgroups_and_timestamps_are_what_the_limits_allow() {
        let info = |change: fn(&mut Physical), bits| {
            let mut p = physical();
            change(&mut p);
            p.info(p.check(&wants(None), &p.offered).ok(), &p.offered, bits)
        };
        assert_eq!(info(|_| (), 64).max_workgroup, 512);
        assert_eq!(info(|p| p.limits.workgroup_size = 200, 64).max_workgroup, 192);
        assert_eq!((info(|_| (), 36).timestamp_period, info(|_| (), 0).timestamp_period), (1.0, 0.0));
        // A device that cannot be used is described too.
        assert_eq!(info(|p| p.subgroup_sizes = [4, 4], 64).subgroup_size, 32);
    }

    #[test]
    fn a_device_that_is_not_all_of_vulkan_is_told_that_we_know() {
        let mut p = physical();
        assert_eq!(p.own_extensions(), [ext::subgroup_size_control::NAME, khr::push_descriptor::NAME]);
        p.extensions.push(extension(khr::portability_subset::NAME));
        assert!(p.own_extensions().contains(&khr::portability_subset::NAME));
    }
}
