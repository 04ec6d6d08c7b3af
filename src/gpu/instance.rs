//! Creates the Vulkan instance, with debug labels and the validation layers on request.

use std::{
    ffi::{CStr, c_void},
    sync::{Arc, Mutex},
};

use ash::{ext, khr, vk};

use super::{Check, Feature, GpuError, features::has_extension};

const VALIDATION: &CStr = c"VK_LAYER_KHRONOS_validation";

/// Creates an instance with the `wanted` extensions, and others that are enabled if available. The flag is
/// true if debug labels and names can be used.
pub(crate) fn create_instance(
    validation: bool,
    wanted: &[&CStr],
) -> Result<(ash::Entry, ash::Instance, bool), GpuError> {
    // SAFETY: loading the system's Vulkan loader runs its initialisers, which is what every Vulkan program does.
    let entry = unsafe { ash::Entry::load() }.map_err(|e| GpuError::NoLoader(e.to_string()))?;
    // SAFETY: plain queries and a creation from structures that live for the call.
    unsafe {
        let available = entry.enumerate_instance_extension_properties(None).unwrap_or_default();
        let debug = has_extension(&available, ext::debug_utils::NAME);
        if let Some(missing) = wanted.iter().find(|wanted| !has_extension(&available, wanted)) {
            let feature = format!("extension {}", missing.to_string_lossy());
            return Err(GpuError::Missing { device: "the Vulkan loader".into(), feature });
        }
        let mut extensions: Vec<_> = wanted.iter().map(|name| name.as_ptr()).collect();
        if debug {
            extensions.push(ext::debug_utils::NAME.as_ptr());
        }
        // Without it the loader hides devices that are not fully conformant: MoltenVK on macOS.
        let portability = has_extension(&available, khr::portability_enumeration::NAME);
        if portability {
            extensions.push(khr::portability_enumeration::NAME.as_ptr());
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
        // 1.2 is enough; declaring 1.3 allows features that used to be extensions without enabling these.
        let app = vk::ApplicationInfo::default().application_name(c"glint").api_version(vk::API_VERSION_1_3);
        let mut info = vk::InstanceCreateInfo::default()
            .application_info(&app)
            .enabled_extension_names(&extensions)
            .enabled_layer_names(&layers);
        if validation {
            info = info.push_next(&mut features);
        }
        if portability {
            info = info.flags(vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR);
        }
        let instance = entry.create_instance(&info, None).check("vkCreateInstance")?;
        Ok((entry, instance, debug))
    }
}

/// Version of the system's Vulkan loader, such as 1.3.239.
///
/// # Errors
/// [`GpuError::NoLoader`] if it is not installed.
pub fn loader_version() -> Result<String, GpuError> {
    // SAFETY: as in `create_instance`.
    let entry = unsafe { ash::Entry::load() }.map_err(|e| GpuError::NoLoader(e.to_string()))?;
    // SAFETY: a plain query.
    let version = unsafe { entry.try_enumerate_instance_version() }.check("vkEnumerateInstanceVersion")?;
    Ok(version_text(version.unwrap_or(vk::API_VERSION_1_0)))
}

pub(super) fn version_text(version: u32) -> String {
    let [major, minor] = [vk::api_version_major(version), vk::api_version_minor(version)];
    format!("{major}.{minor}.{}", vk::api_version_patch(version))
}

/// Returns the feature that a device may offer but this machine's validation layers report as an error, because they are older.
pub(super) fn unknown_to_layers(entry: &ash::Entry) -> Option<Feature> {
    // SAFETY: a plain query.
    let layers = unsafe { entry.enumerate_instance_layer_properties() }.unwrap_or_default();
    let layer = layers.iter().find(|l| l.layer_name_as_c_str().is_ok_and(|n| n == VALIDATION))?;
    // Ubuntu 24.04 has layers 1.3.275 and, from its updates, Mesa 25.2.
    (layer.spec_version < vk::make_api_version(0, 1, 3, 276)).then_some(Feature::ShaderMaximalReconvergence)
}

/// `messages` must outlive the messenger.
pub(crate) fn create_messenger(
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
                // GPU-assisted layers report their own changes.
                if text.contains("Internal Warning") {
                    tracing::info!("validation: {text}");
                    return vk::FALSE;
                }
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
