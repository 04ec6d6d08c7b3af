//! Compute pipelines made from reflected kernels, and the interface of a kernel.

use std::{
    collections::HashMap,
    ffi::CStr,
    marker::PhantomData,
    sync::{Arc, Mutex, atomic::Ordering},
};

use ash::vk;
use bytemuck::Pod;

use super::{
    Check, Context, Feature, GpuError, RawBuffer,
    spirv::{shared_bytes, with_modes, words},
};

/// How a kernel accesses a binding; the recorder derives its barriers from it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    /// Loads only.
    Read,
    /// Stores only; parts may keep their previous content.
    Write,
    /// Both, including atomics.
    ReadWrite,
}

impl Access {
    /// Anything but [`Access::Read`].
    pub fn writes(self) -> bool {
        self != Access::Read
    }
}

/// A storage buffer of a kernel, in set 0.
#[derive(Debug, Clone, Copy)]
pub struct Binding {
    /// Name of the buffer's contents.
    pub name: &'static CStr,
    /// How the kernel accesses it.
    pub access: Access,
    /// Bytes of an element.
    pub element_bytes: u32,
    /// Float words of an element, in 4-byte words: bit k for word k.
    pub floats: u32,
}

/// A specialisation constant of a kernel.
#[derive(Debug, Clone, Copy)]
pub struct Constant {
    /// Its number in the module.
    pub id: u32,
    /// Its name in [`Kernel::Spec`].
    pub name: &'static CStr,
    /// Type of its word.
    pub kind: ConstantKind,
}

/// Type of the word of a specialisation constant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs, reason = "named as Rust's types are")]
pub enum ConstantKind {
    U32,
    I32,
    F32,
    /// 0 or 1.
    Bool,
}

/// The threads that take one item of a kernel's work. glsl/generate.rs derives it from the function by which
/// a kernel gets the item's number: `thread_index`, `subgroup_index` or `group_index` of
/// `glsl/shared/common.glsl`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// One lane.
    Thread,
    /// 8 to 64 lanes.
    Subgroup,
    /// All threads that meet at a barrier.
    Workgroup,
}

/// A kernel's interface. Implemented by glsl/generate.rs from the reflection, once for each `glsl/**/*.comp`.
pub trait Kernel {
    /// The kernel's file name without extension; also its label and the name of its timestamp.
    const NAME: &'static str;
    /// [`NAME`](Self::NAME) as a C string, for debuggers.
    const LABEL: &'static CStr;
    /// The compiled module: little-endian words, SPIR-V 1.5.
    const SPIRV: &'static [u8];
    /// The module with software subgroup operations through shared memory, see `glsl/shared/subgroup.glsl`.
    const SOFTWARE_SPIRV: &'static [u8];
    /// Bindings by number.
    const BINDINGS: &'static [Binding];
    /// The first is the workgroup size, id 0.
    const CONSTANTS: &'static [Constant];
    /// The threads that take one item of its work.
    const UNIT: Unit;
    /// It uses subgroup operations, or the subgroup's size or number.
    const SUBGROUPS: bool;
    /// The threads of a workgroup meet at barriers, which all of its subgroups reach.
    const BARRIERS: bool;
    /// Device features that its SPIR-V needs.
    const FEATURES: &'static [Feature];
    /// Its push constants, in scalar layout; at most 128 bytes.
    type Push: Pod;
    /// Its specialisation constants.
    type Spec;
    /// A buffer, or an [`Unused`](super::Unused), for each binding.
    type Buffers<'a>;
    /// Constant ids and values; the first is the workgroup size, id 0.
    fn spec_words(spec: &Self::Spec) -> Vec<(u32, u32)>;
    /// Passes the buffers by binding to `with`. A callback, not a list, so that recording a frame allocates
    /// nothing from the heap.
    fn raw_buffers<R>(buffers: &Self::Buffers<'_>, with: impl FnOnce(&[&Arc<RawBuffer>]) -> R) -> R;
}

/// Bytes of a module, aligned so that words can be read.
#[repr(align(4))]
pub struct Words<const N: usize>(pub [u8; N]);

/// A kernel's constants, without its types.
#[derive(Debug, Clone, Copy)]
pub struct KernelInfo {
    /// [`Kernel::NAME`].
    pub name: &'static str,
    /// [`Kernel::LABEL`].
    pub label: &'static CStr,
    /// [`Kernel::SPIRV`].
    pub spirv: &'static [u8],
    /// [`Kernel::BINDINGS`].
    pub bindings: &'static [Binding],
    /// [`Kernel::CONSTANTS`].
    pub constants: &'static [Constant],
    /// Bytes of [`Kernel::Push`].
    pub push_bytes: u32,
    /// [`Kernel::UNIT`].
    pub unit: Unit,
    /// [`Kernel::SOFTWARE_SPIRV`].
    pub software_spirv: &'static [u8],
    /// [`Kernel::SUBGROUPS`].
    pub subgroups: bool,
    /// [`Kernel::BARRIERS`].
    pub barriers: bool,
    /// [`Kernel::FEATURES`].
    pub features: &'static [Feature],
}

impl KernelInfo {
    /// The constants of kernel `K`.
    pub const fn of<K: Kernel>() -> Self {
        KernelInfo {
            name: K::NAME,
            label: K::LABEL,
            spirv: K::SPIRV,
            bindings: K::BINDINGS,
            constants: K::CONSTANTS,
            push_bytes: size_of::<K::Push>() as u32,
            unit: K::UNIT,
            software_spirv: K::SOFTWARE_SPIRV,
            subgroups: K::SUBGROUPS,
            barriers: K::BARRIERS,
            features: K::FEATURES,
        }
    }
}

/// The pipelines of a context by kernel and constants. They live as long as the context, so that later
/// requests share them: there are few constants, and compiling a kernel takes longer than most uses of it.
pub(super) type Made = Mutex<HashMap<(&'static str, Vec<(u32, u32)>), RawPipeline>>;

#[derive(Clone, Copy, Default)]
pub(super) struct RawPipeline {
    pub handle: vk::Pipeline,
    pub layout: vk::PipelineLayout,
    pub set_layout: vk::DescriptorSetLayout,
}

impl RawPipeline {
    /// Makes layouts and pipeline from SPIR-V; keeps what it has made if one of them fails.
    fn make(
        &mut self,
        context: &Context,
        kernel: &KernelInfo,
        code: &[u32],
        spec: &[(u32, u32)],
    ) -> Result<(), GpuError> {
        let (device, subgroups) = (&context.0.device, context.0.facts.subgroups);
        let (ids, words): (Vec<u32>, Vec<u32>) = spec.iter().copied().unzip();
        let bindings: Vec<_> = (0..kernel.bindings.len() as u32)
            .map(|binding| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(binding)
                    .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                    .descriptor_count(1)
                    .stage_flags(vk::ShaderStageFlags::COMPUTE)
            })
            .collect();
        let stage_flags = vk::ShaderStageFlags::COMPUTE;
        let push = [vk::PushConstantRange { stage_flags, offset: 0, size: kernel.push_bytes }];
        let entries: Vec<_> = ids
            .iter()
            .zip((0..).step_by(4))
            .map(|(&constant_id, offset)| vk::SpecializationMapEntry { constant_id, offset, size: 4 })
            .collect();
        let flags = match context.0.push_descriptor {
            Some(_) => vk::DescriptorSetLayoutCreateFlags::PUSH_DESCRIPTOR_KHR,
            None => vk::DescriptorSetLayoutCreateFlags::empty(),
        };
        let set_info = vk::DescriptorSetLayoutCreateInfo::default().flags(flags).bindings(&bindings);
        // SAFETY: every structure lives for its call.
        unsafe {
            self.set_layout =
                device.create_descriptor_set_layout(&set_info, None).check("vkCreateDescriptorSetLayout")?;
            let sets = [self.set_layout];
            let mut layout = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets);
            if push[0].size > 0 {
                layout = layout.push_constant_ranges(&push);
            }
            self.layout = device.create_pipeline_layout(&layout, None).check("vkCreatePipelineLayout")?;
            let module_info = vk::ShaderModuleCreateInfo::default().code(code);
            let module = device.create_shader_module(&module_info, None).check("vkCreateShaderModule")?;
            let specialization =
                vk::SpecializationInfo::default().map_entries(&entries).data(bytemuck::cast_slice(words.as_slice()));
            let mut stage = vk::PipelineShaderStageCreateInfo::default()
                .stage(stage_flags)
                .module(module)
                .name(c"main")
                .specialization_info(&specialization);
            let mut size = vk::PipelineShaderStageRequiredSubgroupSizeCreateInfo::default()
                .required_subgroup_size(subgroups.lanes);
            if kernel.subgroups && !subgroups.software {
                stage = stage.flags(vk::PipelineShaderStageCreateFlags::REQUIRE_FULL_SUBGROUPS);
                if subgroups.require {
                    stage = stage.push_next(&mut size);
                }
            }
            let info = [vk::ComputePipelineCreateInfo::default().stage(stage).layout(self.layout)];
            let made = device.create_compute_pipelines(context.0.pipeline_cache, &info, None);
            device.destroy_shader_module(module, None);
            self.handle = made.map_err(|(_, e)| e).check("vkCreateComputePipelines")?[0];
        }
        Ok(())
    }

    /// # Safety
    /// Neither work that uses it nor a [`Pipeline`] of it is left.
    pub unsafe fn destroy(self, device: &ash::Device) {
        // SAFETY: by the contract above; null handles are allowed.
        unsafe {
            device.destroy_pipeline(self.handle, None);
            device.destroy_pipeline_layout(self.layout, None);
            device.destroy_descriptor_set_layout(self.set_layout, None);
        }
    }
}

/// A pipeline made by a context, for applications that record their own commands next to glint's. It lives as
/// long as the context.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct MadePipeline {
    /// [`Kernel::NAME`].
    pub kernel: &'static str,
    /// Ids and values of the specialisation constants that it was made with; constant 0 is the workgroup size.
    pub constants: Vec<(u32, u32)>,
    /// The compute pipeline.
    pub pipeline: vk::Pipeline,
    /// Its layout: set 0 and the push constants, from byte 0 on.
    pub layout: vk::PipelineLayout,
    /// The layout of set 0: a storage buffer for each of [`Kernel::BINDINGS`], as push descriptors if the
    /// device was made with `VK_KHR_push_descriptor`.
    pub set_layout: vk::DescriptorSetLayout,
}

impl Context {
    /// All pipelines so far, by kernel and constants, including those of other contexts that share this one's
    /// pipelines.
    pub fn pipelines(&self) -> Vec<MadePipeline> {
        let made = self.0.own.pipelines.lock().unwrap_or_else(|e| e.into_inner());
        let all = made.iter().map(|((kernel, constants), raw)| MadePipeline {
            kernel,
            constants: constants.clone(),
            pipeline: raw.handle,
            layout: raw.layout,
            set_layout: raw.set_layout,
        });
        let mut all: Vec<_> = all.collect();
        all.sort();
        all
    }
}

/// A kernel with its specialisation constants set.
pub struct Pipeline<K: Kernel> {
    pub(super) raw: RawPipeline,
    pub(super) workgroup_size: u32,
    /// Ids and values of the constants that it was made with.
    pub(super) spec: Vec<(u32, u32)>,
    /// The owner of `raw`.
    _context: Context,
    kernel: PhantomData<K>,
}

impl<K: Kernel> Pipeline<K> {
    /// Shares the context's pipeline of the same kernel and constants, or makes it.
    ///
    /// If [`DeviceInfo::workgroup`](super::DeviceInfo::workgroup) requires it, kernels of independent
    /// subgroups get workgroups of one subgroup, regardless of `spec`.
    pub fn new(context: &Context, spec: &K::Spec) -> Result<Self, GpuError> {
        let mut spec = K::spec_words(spec);
        let raw = share(context, &KernelInfo::of::<K>(), &mut spec)?;
        Ok(Pipeline { raw, workgroup_size: spec[0].1, spec, _context: context.clone(), kernel: PhantomData })
    }

    /// Threads of a workgroup.
    pub fn workgroup_size(&self) -> u32 {
        self.workgroup_size
    }
}

/// Constant id of the software subgroups' size, see `glsl/shared/subgroup.glsl`.
const SOFTWARE_LANES: u32 = 100;

/// Returns the context's pipeline of this kernel and these constants; makes it if there is none. Adds the constants that the device
/// requires to `spec`.
fn share(context: &Context, kernel: &KernelInfo, spec: &mut Vec<(u32, u32)>) -> Result<RawPipeline, GpuError> {
    let subgroups = context.0.facts.subgroups;
    if kernel.subgroups && !kernel.barriers {
        spec[0].1 = context.info().workgroup(spec[0].1);
    }
    let bytes = if subgroups.software { kernel.software_spirv } else { kernel.spirv };
    if subgroups.software {
        spec.push((SOFTWARE_LANES, subgroups.lanes));
    }
    let key = (kernel.name, spec.clone());
    let made = || context.0.own.pipelines.lock().unwrap_or_else(|e| e.into_inner());
    if let Some(&known) = made().get(&key) {
        return Ok(known);
    }
    let in_kernel = |what| GpuError::Kernel { kernel: kernel.name, what };
    let module = words(bytes).map_err(in_kernel)?;
    check(context, kernel, spec[0].1, shared_bytes(&module, spec).map_err(in_kernel)?)?;
    let code = with_modes(&module, &subgroups.modes(context.info(), kernel.subgroups)).map_err(in_kernel)?;
    let mut raw = RawPipeline::default();
    let result = raw.make(context, kernel, &code, spec);
    let mut made = made();
    // Another thread may have made the same pipeline meanwhile.
    let known = made.get(&key).copied();
    if result.is_err() || known.is_some() {
        // SAFETY: nothing has seen it.
        unsafe { raw.destroy(&context.0.device) };
    }
    result?;
    if known.is_none() {
        context.0.counts.pipelines.fetch_add(1, Ordering::Relaxed);
        made.insert(key, raw);
    }
    Ok(known.unwrap_or(raw))
}

/// Checks the device's limits and features for a kernel.
fn check(context: &Context, kernel: &KernelInfo, workgroup: u32, shared: u64) -> Result<(), GpuError> {
    let (info, limits) = (context.info(), context.0.facts.limits);
    let device = || info.name.clone();
    for feature in kernel.features {
        let software = context.0.facts.subgroups.software && feature.is_of_subgroups();
        if !software && !context.features().contains(feature) {
            return Err(GpuError::Missing {
                device: device(),
                feature: format!("{}, for {}", feature.name(), kernel.name),
            });
        }
    }
    let most = if kernel.subgroups { info.max_workgroup } else { limits.workgroup() };
    for (what, needs, has) in [
        ("threads of a workgroup", workgroup.into(), most),
        ("bytes of shared memory", shared, limits.shared_bytes),
        ("storage buffers", kernel.bindings.len() as u64, limits.storage_buffers()),
        ("bytes of push constants", kernel.push_bytes.into(), limits.push_bytes),
    ] {
        if needs > u64::from(has) {
            let what = format!("{what} ({})", kernel.name);
            return Err(GpuError::Limit { device: device(), what, needs, has: has.into() });
        }
    }
    if workgroup == 0 || (kernel.subgroups && !workgroup.is_multiple_of(info.subgroup_size)) {
        let what = format!("a workgroup of {workgroup} threads is not of whole subgroups of {}", info.subgroup_size);
        return Err(GpuError::Kernel { kernel: kernel.name, what });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{gpu::ContextOptions, stages::radix_upsweep};

    /// llvmpipe from Mesa 24 on ends subgroups at subgroup control barriers. glint is right there only
    /// because it omits these barriers, and if they come back the check of a device detects it.
    #[cfg(feature = "train")]
    #[test]
    fn control_barriers_between_lanes_in_lockstep_are_seen_where_they_are_wrong() {
        let mut context = Context::new(&ContextOptions::from_env()).unwrap();
        assert!(crate::verify::check(&context).unwrap().is_empty());
        let inner = Arc::get_mut(&mut context.0).unwrap();
        if !std::mem::take(&mut inner.facts.info.lockstep) {
            return println!("needs llvmpipe");
        }
        let driver = &context.info().driver.version;
        let version = driver.strip_prefix("Mesa ").and_then(|v| v.split('.').next()?.parse::<u32>().ok());
        let broken = crate::verify::check(&context).unwrap();
        assert_eq!(!broken.is_empty(), version.unwrap() >= 24, "{driver}: {broken:?}");
    }

    /// If a device offers several sizes, kernels must require their size, and full subgroups. No CPU device
    /// offers several: the demand shows in the validation layers' messages about one that no device could
    /// meet.
    #[test]
    fn a_pipeline_demands_full_subgroups_of_the_contexts_size() {
        let env = ContextOptions::from_env();
        if !env.validation {
            return println!("needs the validation layers, as tools/test has them");
        }
        // Software subgroups require no size.
        let options = ContextOptions { validation: true, device: env.device, ..Default::default() };
        let mut context = Context::new(&options).unwrap();
        let spec = radix_upsweep::Spec {
            workgroup_size: 64,
            block: 1024,
            digit_bits: 8,
            compact: false,
            row_lanes: 8,
            lockstep: false,
        };
        radix_upsweep::Stage::new(&context, &spec).unwrap();
        assert_eq!(context.validation_messages(), [""; 0]);
        let subgroups = &mut Arc::get_mut(&mut context.0).unwrap().facts.subgroups;
        (subgroups.lanes, subgroups.require) = (256, true);
        // The driver may do anything with it. Another block size, as the context shares pipelines that it
        // made before.
        let spec = radix_upsweep::Spec { block: 512, ..spec };
        let _ = radix_upsweep::Stage::new(&context, &spec);
        let said = context.validation_messages().concat();
        // Above the largest size, and not a whole number of subgroups, which matters if they must be full.
        assert!(said.contains("requiredSubgroupSize-02762") && said.contains("StageCreateInfo-pNext-02757"), "{said}");
    }
}
