//! The device features that glint uses: their names, their extensions, and the Vulkan structures that contain
//! them.

use std::{collections::BTreeSet, ffi::CStr};

use ash::{ext, khr, vk};

/// A device feature, named as in Vulkan. glsl/generate.rs determines each kernel's features.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "train", derive(serde::Serialize), serde(rename_all = "camelCase"))]
#[allow(missing_docs, reason = "named as the Vulkan specification names them")]
pub enum Feature {
    ScalarBlockLayout,
    HostQueryReset,
    SubgroupSizeControl,
    ComputeFullSubgroups,
    SubgroupBroadcastDynamicId,
    ShaderSubgroupExtendedTypes,
    ShaderBufferFloat32AtomicAdd,
    ShaderMaximalReconvergence,
    ShaderSubgroupUniformControlFlow,
    ShaderInt8,
    ShaderInt16,
    ShaderFloat16,
    StorageBuffer8BitAccess,
    StorageBuffer16BitAccess,
}

impl Feature {
    /// Every feature known to glint, required or not.
    pub const ALL: [Self; 14] = [
        Self::ScalarBlockLayout,
        Self::HostQueryReset,
        Self::SubgroupSizeControl,
        Self::ComputeFullSubgroups,
        Self::SubgroupBroadcastDynamicId,
        Self::ShaderSubgroupExtendedTypes,
        Self::ShaderBufferFloat32AtomicAdd,
        Self::ShaderMaximalReconvergence,
        Self::ShaderSubgroupUniformControlFlow,
        Self::ShaderInt8,
        Self::ShaderInt16,
        Self::ShaderFloat16,
        Self::StorageBuffer8BitAccess,
        Self::StorageBuffer16BitAccess,
    ];

    /// A context needs these, except those of subgroups ([`Feature::is_of_subgroups`]): without them glint
    /// uses software subgroups. All others are optional: a kernel that needs one is refused if it is missing.
    pub const REQUIRED: [Self; 5] = [
        Self::ScalarBlockLayout,
        Self::HostQueryReset,
        Self::SubgroupSizeControl,
        Self::ComputeFullSubgroups,
        Self::SubgroupBroadcastDynamicId,
    ];

    /// Its name in the Vulkan specification.
    pub fn name(self) -> String {
        let mut name = format!("{self:?}");
        name[..1].make_ascii_lowercase();
        name
    }

    /// True if only the device's own subgroups need it, not software subgroups.
    pub fn is_of_subgroups(self) -> bool {
        matches!(self, Self::SubgroupSizeControl | Self::ComputeFullSubgroups | Self::SubgroupBroadcastDynamicId)
    }

    /// The extension that it comes with, unless it is part of Vulkan 1.2.
    pub fn extension(self) -> Option<&'static CStr> {
        match self {
            Self::SubgroupSizeControl | Self::ComputeFullSubgroups => Some(ext::subgroup_size_control::NAME),
            Self::ShaderBufferFloat32AtomicAdd => Some(ext::shader_atomic_float::NAME),
            Self::ShaderMaximalReconvergence => Some(khr::shader_maximal_reconvergence::NAME),
            Self::ShaderSubgroupUniformControlFlow => Some(khr::shader_subgroup_uniform_control_flow::NAME),
            _ => None,
        }
    }

    /// True if the device has the version or extension that the feature comes with, so that it can be
    /// queried.
    pub(super) fn known(self, extensions: &[vk::ExtensionProperties], api_version: u32) -> bool {
        let core = matches!(self, Self::SubgroupSizeControl | Self::ComputeFullSubgroups)
            && api_version >= vk::API_VERSION_1_3;
        core || self.extension().is_none_or(|name| has_extension(extensions, name))
    }
}

pub(super) fn has_extension(list: &[vk::ExtensionProperties], wanted: &CStr) -> bool {
    list.iter().any(|e| e.extension_name_as_c_str().is_ok_and(|name| name == wanted))
}

/// The Vulkan structures that contain [`Feature`]s, for querying a physical device or creating a device.
#[derive(Default)]
pub struct FeatureChain {
    core: vk::PhysicalDeviceFeatures,
    vulkan11: vk::PhysicalDeviceVulkan11Features<'static>,
    vulkan12: vk::PhysicalDeviceVulkan12Features<'static>,
    subgroup_size: vk::PhysicalDeviceSubgroupSizeControlFeatures<'static>,
    atomic_float: vk::PhysicalDeviceShaderAtomicFloatFeaturesEXT<'static>,
    maximal: vk::PhysicalDeviceShaderMaximalReconvergenceFeaturesKHR<'static>,
    uniform: vk::PhysicalDeviceShaderSubgroupUniformControlFlowFeaturesKHR<'static>,
    /// Structures of other features are not linked, as a device need not know them.
    features: Vec<Feature>,
}

impl FeatureChain {
    /// A chain with `features` set.
    pub fn new(features: impl IntoIterator<Item = Feature>) -> Self {
        let mut chain = FeatureChain { features: features.into_iter().collect(), ..Default::default() };
        for feature in chain.features.clone() {
            *chain.flag(feature) = vk::TRUE;
        }
        chain
    }

    /// The chain, for [`vk::DeviceCreateInfo`] or for a query.
    pub fn link(&mut self) -> vk::PhysicalDeviceFeatures2<'_> {
        let has = |features: &[Feature], wanted: &[Feature]| features.iter().any(|f| wanted.contains(f));
        // Clears the links of an earlier call.
        self.vulkan11.p_next = std::ptr::null_mut();
        self.vulkan12.p_next = std::ptr::null_mut();
        self.subgroup_size.p_next = std::ptr::null_mut();
        self.atomic_float.p_next = std::ptr::null_mut();
        self.maximal.p_next = std::ptr::null_mut();
        self.uniform.p_next = std::ptr::null_mut();
        let mut first = vk::PhysicalDeviceFeatures2::default()
            .features(self.core)
            .push_next(&mut self.vulkan11)
            .push_next(&mut self.vulkan12);
        if has(&self.features, &[Feature::SubgroupSizeControl, Feature::ComputeFullSubgroups]) {
            first = first.push_next(&mut self.subgroup_size);
        }
        if has(&self.features, &[Feature::ShaderBufferFloat32AtomicAdd]) {
            first = first.push_next(&mut self.atomic_float);
        }
        if has(&self.features, &[Feature::ShaderMaximalReconvergence]) {
            first = first.push_next(&mut self.maximal);
        }
        if has(&self.features, &[Feature::ShaderSubgroupUniformControlFlow]) {
            first = first.push_next(&mut self.uniform);
        }
        first
    }

    /// The features of `features` that a physical device offers.
    ///
    /// # Safety
    /// `physical` comes from `instance`, and knows the extensions that `features` come with.
    pub(super) unsafe fn offered(
        instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        features: Vec<Feature>,
    ) -> BTreeSet<Feature> {
        let mut chain = FeatureChain { features, ..Default::default() };
        let mut linked = chain.link();
        // SAFETY: by the contract above; the chain lives for the call.
        unsafe { instance.get_physical_device_features2(physical, &mut linked) };
        let core = linked.features;
        chain.core = core;
        let features = chain.features.clone();
        features.into_iter().filter(|&f| *chain.flag(f) == vk::TRUE).collect()
    }

    fn flag(&mut self, feature: Feature) -> &mut vk::Bool32 {
        match feature {
            Feature::ScalarBlockLayout => &mut self.vulkan12.scalar_block_layout,
            Feature::HostQueryReset => &mut self.vulkan12.host_query_reset,
            Feature::SubgroupSizeControl => &mut self.subgroup_size.subgroup_size_control,
            Feature::ComputeFullSubgroups => &mut self.subgroup_size.compute_full_subgroups,
            Feature::SubgroupBroadcastDynamicId => &mut self.vulkan12.subgroup_broadcast_dynamic_id,
            Feature::ShaderSubgroupExtendedTypes => &mut self.vulkan12.shader_subgroup_extended_types,
            Feature::ShaderBufferFloat32AtomicAdd => &mut self.atomic_float.shader_buffer_float32_atomic_add,
            Feature::ShaderMaximalReconvergence => &mut self.maximal.shader_maximal_reconvergence,
            Feature::ShaderSubgroupUniformControlFlow => &mut self.uniform.shader_subgroup_uniform_control_flow,
            Feature::ShaderInt8 => &mut self.vulkan12.shader_int8,
            Feature::ShaderInt16 => &mut self.core.shader_int16,
            Feature::ShaderFloat16 => &mut self.vulkan12.shader_float16,
            Feature::StorageBuffer8BitAccess => &mut self.vulkan12.storage_buffer8_bit_access,
            Feature::StorageBuffer16BitAccess => &mut self.vulkan11.storage_buffer16_bit_access,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_feature_has_a_flag_of_its_own_in_the_chain() {
        for feature in Feature::ALL {
            let mut chain = FeatureChain::new([feature]);
            let set: Vec<Feature> = Feature::ALL.into_iter().filter(|&f| *chain.flag(f) == vk::TRUE).collect();
            assert_eq!(set, [feature]);
            assert!(feature.name().starts_with(|c: char| c.is_ascii_lowercase()));
        }
    }
}
