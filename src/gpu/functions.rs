//! The Vulkan functions that glint calls. ash aborts if a missing one is called, so glint checks for each on
//! a device that is not its own.

use std::ffi::CStr;

use ash::vk;

use super::GpuError;

/// Functions of the instance.
const OF_INSTANCE: [&CStr; 10] = [
    c"vkCreateDevice",
    c"vkDestroyInstance",
    c"vkEnumerateDeviceExtensionProperties",
    c"vkEnumeratePhysicalDevices",
    c"vkGetPhysicalDeviceFeatures2",
    c"vkGetPhysicalDeviceMemoryProperties",
    c"vkGetPhysicalDeviceMemoryProperties2",
    c"vkGetPhysicalDeviceProperties",
    c"vkGetPhysicalDeviceProperties2",
    c"vkGetPhysicalDeviceQueueFamilyProperties",
];

/// Functions of the device.
const OF_DEVICE: [&CStr; 52] = [
    c"vkAllocateCommandBuffers",
    c"vkAllocateDescriptorSets",
    c"vkAllocateMemory",
    c"vkBeginCommandBuffer",
    c"vkBindBufferMemory",
    c"vkCmdBindDescriptorSets",
    c"vkCmdBindPipeline",
    c"vkCmdCopyBuffer",
    c"vkCmdCopyBufferToImage",
    c"vkCmdCopyImageToBuffer",
    c"vkCmdDispatch",
    c"vkCmdDispatchIndirect",
    c"vkCmdFillBuffer",
    c"vkCmdPipelineBarrier",
    c"vkCmdPushConstants",
    c"vkCmdUpdateBuffer",
    c"vkCmdWriteTimestamp",
    c"vkCreateBuffer",
    c"vkCreateCommandPool",
    c"vkCreateComputePipelines",
    c"vkCreateDescriptorPool",
    c"vkCreateDescriptorSetLayout",
    c"vkCreateFence",
    c"vkCreatePipelineLayout",
    c"vkCreateQueryPool",
    c"vkCreateShaderModule",
    c"vkDestroyBuffer",
    c"vkDestroyCommandPool",
    c"vkDestroyDescriptorPool",
    c"vkDestroyDescriptorSetLayout",
    c"vkDestroyDevice",
    c"vkDestroyFence",
    c"vkDestroyPipeline",
    c"vkDestroyPipelineLayout",
    c"vkDestroyQueryPool",
    c"vkDestroyShaderModule",
    c"vkDeviceWaitIdle",
    c"vkEndCommandBuffer",
    c"vkFreeMemory",
    c"vkGetBufferMemoryRequirements",
    c"vkGetDeviceQueue",
    c"vkGetFenceStatus",
    c"vkGetQueryPoolResults",
    c"vkMapMemory",
    c"vkQueueSubmit",
    c"vkResetCommandPool",
    c"vkResetDescriptorPool",
    c"vkResetFences",
    c"vkResetQueryPool",
    c"vkUnmapMemory",
    c"vkUpdateDescriptorSets",
    c"vkWaitForFences",
];

/// Functions of the device, needed if kernels and buffers have names.
const OF_LABELS: [&CStr; 3] =
    [c"vkCmdBeginDebugUtilsLabelEXT", c"vkCmdEndDebugUtilsLabelEXT", c"vkSetDebugUtilsObjectNameEXT"];

/// A function of the device, present if it was made with `VK_KHR_push_descriptor`.
const PUSH_DESCRIPTORS: &CStr = c"vkCmdPushDescriptorSetKHR";

/// Names the requirement that a missing function belongs to.
fn origin(function: &CStr) -> String {
    match function {
        _ if OF_LABELS.contains(&function) => "extension VK_EXT_debug_utils, enabled on the instance".into(),
        _ => format!("{}: the instance must be of Vulkan 1.2", function.to_string_lossy()),
    }
}

/// Checks that an instance has the functions that glint calls.
///
/// # Safety
/// The handles are live and belong together.
pub(super) unsafe fn check_instance(entry: &ash::Entry, instance: &ash::Instance) -> Result<(), GpuError> {
    // SAFETY: by the contract above.
    let has = |name: &CStr| unsafe { entry.get_instance_proc_addr(instance.handle(), name.as_ptr()) }.is_some();
    match OF_INSTANCE.into_iter().find(|name| !has(name)) {
        None => Ok(()),
        Some(name) => Err(GpuError::Missing { device: "of this instance".into(), feature: origin(name) }),
    }
}

/// Checks that a device has the functions that glint calls, including those for labels if `labels` is set.
///
/// # Safety
/// The handles are live and belong together; `physical` is the device's physical device.
pub(super) unsafe fn check_device(
    instance: &ash::Instance,
    physical: vk::PhysicalDevice,
    device: &ash::Device,
    labels: bool,
) -> Result<(), GpuError> {
    let get = instance.fp_v1_0().get_device_proc_addr;
    // SAFETY: by the contract above.
    let has = |name: &CStr| unsafe { get(device.handle(), name.as_ptr()) }.is_some();
    let all = OF_DEVICE.into_iter().chain(OF_LABELS.into_iter().filter(|_| labels));
    match all.into_iter().find(|name| !has(name)) {
        None => Ok(()),
        Some(name) => {
            // SAFETY: by the contract above.
            let properties = unsafe { instance.get_physical_device_properties(physical) };
            let device = properties.device_name_as_c_str().unwrap_or_default().to_string_lossy().into_owned();
            Err(GpuError::Missing { device, feature: origin(name) })
        }
    }
}

/// True if a device was made with `VK_KHR_push_descriptor`.
///
/// # Safety
/// The handles are live and belong together.
pub(super) unsafe fn has_push_descriptors(instance: &ash::Instance, device: &ash::Device) -> bool {
    let get = instance.fp_v1_0().get_device_proc_addr;
    // SAFETY: by the contract above.
    unsafe { get(device.handle(), PUSH_DESCRIPTORS.as_ptr()) }.is_some()
}

#[cfg(test)]
mod tests {
    use std::{collections::BTreeSet, fs, path::Path};

    use super::*;

    /// Identifiers between a dot and a bracket, on receivers of these names.
    fn called(source: &str, receivers: &[&str]) -> BTreeSet<String> {
        let mut names = BTreeSet::new();
        for (at, _) in source.match_indices('.') {
            let before = source[..at].trim_end();
            let word = |text: &str| text.chars().take_while(|c| c.is_ascii_alphanumeric() || *c == '_').count();
            let rest = &source[at + 1..];
            let name = &rest[..word(rest)];
            let of = receivers.iter().any(|receiver| before.ends_with(receiver));
            if of && rest[name.len()..].starts_with('(') {
                names.insert(name.to_owned());
            }
        }
        names
    }

    /// Vulkan's name of a function, without an extension's letters.
    fn vulkan(name: &str) -> String {
        let word = |word: &str| word[..1].to_uppercase() + &word[1..];
        let words: String = name.split('_').map(word).collect();
        format!("vk{words}")
    }

    #[test]
    fn every_function_that_is_called_is_asked_for_and_none_beside() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/gpu");
        let mut sources = String::new();
        for entry in fs::read_dir(folder).unwrap() {
            let text = fs::read_to_string(entry.unwrap().path()).unwrap();
            let code = text.split("#[cfg(test)]\nmod tests").next().unwrap();
            sources.extend(code.lines().filter(|line| !line.trim_start().starts_with("//")).map(|l| format!("{l}\n")));
        }
        // Methods of ash's structures that are not Vulkan functions, and those of the window's instance,
        // which is glint's own.
        let ours = ["clone", "handle", "fp_v1_0", "is_some", "is_none", "as_ref", "as_deref"];
        let check = |receivers: &[&str], lists: &[&[&CStr]], others: &[&str]| {
            let listed: BTreeSet<String> = lists
                .concat()
                .iter()
                .map(|name| name.to_str().unwrap().trim_end_matches(['E', 'X', 'T', 'K', 'H', 'R']).to_owned())
                .collect();
            let mut wanted: BTreeSet<String> = called(&sources, receivers)
                .iter()
                .filter(|name| !ours.contains(&name.as_str()))
                .map(|name| vulkan(name))
                .collect();
            wanted.extend(others.iter().map(|&name| name.to_owned()));
            assert_eq!(wanted, listed);
        };
        check(&["instance"], &[&OF_INSTANCE], &[]);
        // Functions that only gpu-allocator calls.
        let allocators = ["vkAllocateMemory", "vkFreeMemory", "vkMapMemory", "vkUnmapMemory"];
        check(&["device", "device()", "push", "debug"], &[&OF_DEVICE, &OF_LABELS, &[PUSH_DESCRIPTORS]], &allocators);
        assert!(origin(c"vkResetQueryPool").contains("vkResetQueryPool"));
        assert!(origin(OF_LABELS[0]).contains("VK_EXT_debug_utils"));
    }
}
