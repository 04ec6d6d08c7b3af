//! Compute pipelines from reflected kernels.

use std::{marker::PhantomData, sync::Arc};

use ash::vk;
use bytemuck::Pod;

use super::{Check, Context, GpuError, RawBuffer};

/// What a kernel does to a binding; the recorder makes its barriers from it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    Read,
    Write,
    ReadWrite,
}

impl Access {
    pub(super) fn writes(self) -> bool {
        self != Access::Read
    }
}

/// A kernel's interface. Implemented by build.rs from the reflection, once for each `glsl/**/*.comp`.
pub trait Kernel {
    /// The kernel's file name without extension: its label and timestamp too.
    const NAME: &'static str;
    const SPIRV: &'static [u8];
    /// By binding.
    const ACCESS: &'static [Access];
    type Push: Pod;
    type Spec;
    type Buffers<'a>;
    /// Constant ids and values; the first is the workgroup size, id 0.
    fn spec_words(spec: &Self::Spec) -> Vec<(u32, u32)>;
    fn raw_buffers<'a>(buffers: &Self::Buffers<'a>) -> Vec<&'a Arc<RawBuffer>>;
}

pub(super) struct RawPipeline {
    pub handle: vk::Pipeline,
    pub layout: vk::PipelineLayout,
    set_layout: vk::DescriptorSetLayout,
    context: Context,
}

/// A kernel with its specialisation constants set.
pub struct Pipeline<K: Kernel> {
    pub(super) raw: Arc<RawPipeline>,
    pub(super) workgroup_size: u32,
    kernel: PhantomData<K>,
}

impl<K: Kernel> Pipeline<K> {
    pub fn new(context: &Context, spec: &K::Spec) -> Result<Self, GpuError> {
        let (ids, words): (Vec<u32>, Vec<u32>) = K::spec_words(spec).into_iter().unzip();
        let device = &context.0.device;
        let bindings: Vec<_> = (0..K::ACCESS.len() as u32)
            .map(|binding| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(binding)
                    .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                    .descriptor_count(1)
                    .stage_flags(vk::ShaderStageFlags::COMPUTE)
            })
            .collect();
        let push = [vk::PushConstantRange {
            stage_flags: vk::ShaderStageFlags::COMPUTE,
            offset: 0,
            size: size_of::<K::Push>() as u32,
        }];
        let entries: Vec<_> = ids
            .iter()
            .zip((0..).step_by(4))
            .map(|(&constant_id, offset)| vk::SpecializationMapEntry { constant_id, offset, size: 4 })
            .collect();
        let code = ash::util::read_spv(&mut std::io::Cursor::new(K::SPIRV))
            .map_err(|_| GpuError::Vulkan { call: "read SPIR-V", result: vk::Result::ERROR_INVALID_SHADER_NV })?;
        // SAFETY: every structure lives for its call; what was made before a failure is destroyed by RawPipeline's Drop
        // (null handles are allowed there) or right here for the module.
        unsafe {
            let set_info = vk::DescriptorSetLayoutCreateInfo::default()
                .flags(vk::DescriptorSetLayoutCreateFlags::PUSH_DESCRIPTOR_KHR)
                .bindings(&bindings);
            let mut raw = RawPipeline {
                handle: vk::Pipeline::null(),
                layout: vk::PipelineLayout::null(),
                set_layout: device
                    .create_descriptor_set_layout(&set_info, None)
                    .check("vkCreateDescriptorSetLayout")?,
                context: context.clone(),
            };
            let sets = [raw.set_layout];
            let mut layout = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets);
            if push[0].size > 0 {
                layout = layout.push_constant_ranges(&push);
            }
            raw.layout = device.create_pipeline_layout(&layout, None).check("vkCreatePipelineLayout")?;
            let module_info = vk::ShaderModuleCreateInfo::default().code(&code);
            let module = device.create_shader_module(&module_info, None).check("vkCreateShaderModule")?;
            let specialization =
                vk::SpecializationInfo::default().map_entries(&entries).data(bytemuck::cast_slice(words.as_slice()));
            let stage = vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::COMPUTE)
                .module(module)
                .name(c"main")
                .specialization_info(&specialization);
            let info = [vk::ComputePipelineCreateInfo::default().stage(stage).layout(raw.layout)];
            let made = device.create_compute_pipelines(vk::PipelineCache::null(), &info, None);
            device.destroy_shader_module(module, None);
            raw.handle = made.map_err(|(_, e)| e).check("vkCreateComputePipelines")?[0];
            Ok(Pipeline { raw: Arc::new(raw), workgroup_size: words[0], kernel: PhantomData })
        }
    }

    /// Threads of a workgroup.
    pub fn workgroup_size(&self) -> u32 {
        self.workgroup_size
    }
}

impl Drop for RawPipeline {
    fn drop(&mut self) {
        let device = &self.context.0.device;
        // SAFETY: submissions hold an Arc of every pipeline they use until they are waited for.
        unsafe {
            device.destroy_pipeline(self.handle, None);
            device.destroy_pipeline_layout(self.layout, None);
            device.destroy_descriptor_set_layout(self.set_layout, None);
        }
    }
}
