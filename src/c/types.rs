//! The structures of `glint.h`, in its order, and what they are in Rust.

#![allow(non_camel_case_types, reason = "the names of the header")]

use std::ffi::{c_char, c_void};

use ash::vk;
use bytemuck::Pod;
use glam::{DMat4, DQuat, DVec3};

use crate::{
    Error, Result,
    gpu::{
        Access, Binding, BufferRange, Constant, ConstantKind, Context, DeviceInfo, ImageRegion, Kept, MadePipeline,
        Pixels,
    },
    pipelines::{
        frames::{Blend, FrameView, Frames, Instance, Light, Limits, Room, Target, Texel, Transform},
        model::{Model, Segment, Upload},
        session::Policy,
    },
    scene::{
        Gaussians, Lobes, Scene,
        color::{self, MODELS},
        layout::coefficients,
    },
};

/// Of `glint.h`.
pub const GLINT_VERSION: u32 = 4;

/// A device, see [`Context`].
pub struct glint_context(pub(super) Context);

/// What is known of a physical device, see [`DeviceInfo`].
pub struct glint_physical(pub(super) DeviceInfo);

/// Gaussians on the host, see [`Scene`].
pub struct glint_scene(pub(super) Scene);

/// A scene on its way, see [`Upload`].
pub struct glint_upload {
    pub(super) upload: Upload,
    pub(super) context: Context,
    pub(super) kept: Kept,
}

/// Gaussians on the device, see [`Model`].
pub struct glint_model(pub(super) Model);

/// See [`Frames`].
pub struct glint_frames {
    pub(super) frames: Frames,
    /// Memory for the views of a frame.
    pub(super) views: Vec<FrameView>,
}

/// The caller's device.
#[repr(C)]
pub struct glint_device {
    /// sizeof(glint_device).
    pub size: u32,
    /// Of `queue`; it must take compute.
    pub queue_family: u32,
    /// The loader's.
    pub get_instance_proc_addr: Option<vk::PFN_vkGetInstanceProcAddr>,
    /// VkInstance.
    pub instance: *mut c_void,
    /// VkPhysicalDevice.
    pub physical_device: *mut c_void,
    /// VkDevice, made with what `glint_required_*` say.
    pub device: *mut c_void,
    /// VkQueue.
    pub queue: *mut c_void,
    /// VkPipelineCache or 0.
    pub pipeline_cache: u64,
    /// Bytes that glint's buffers may take; 0 for what the device has.
    pub memory_budget: u64,
    /// Called before and after glint submits, from the thread that does; null where glint alone uses the queue.
    pub lock_queue: Option<unsafe extern "C" fn(*mut c_void)>,
    /// As `lock_queue`.
    pub unlock_queue: Option<unsafe extern "C" fn(*mut c_void)>,
    /// Given to both.
    pub user: *mut c_void,
    /// 1: VK_EXT_debug_utils is enabled on the instance, and kernels and buffers are to be named.
    pub labels: u32,
    /// Bits: which of the optional features the device was made with.
    pub optional: u32,
}

/// See [`Requirements`](crate::gpu::Requirements).
#[repr(C)]
pub struct glint_requirements {
    /// sizeof(glint_requirements).
    pub size: u32,
    /// Of Vulkan, at least.
    pub api_version: u32,
    /// VkSubgroupFeatureFlags, in compute.
    pub subgroup_operations: u32,
    /// Of a subgroup, at least.
    pub least_lanes: u32,
    /// Of a subgroup, at most.
    pub most_lanes: u32,
}

/// See [`Memory`](crate::gpu::Memory).
#[repr(C)]
pub struct glint_memory {
    /// sizeof(glint_memory).
    pub size: u32,
    /// 0.
    pub reserved: u32,
    /// Bytes that the context's buffers have.
    pub used: u64,
    /// Bytes that they may have together.
    pub budget: u64,
    /// Bytes that were taken of the device for them.
    pub taken: u64,
}

/// See [`Held`](crate::pipelines::plan::Held).
#[repr(C)]
pub struct glint_buffer {
    /// sizeof(glint_buffer).
    pub size: u32,
    /// 0.
    pub reserved: u32,
    /// VkBuffer.
    pub buffer: u64,
    /// Bytes.
    pub bytes: u64,
    /// Ends with a 0.
    pub name: [c_char; 32],
}

/// What a scene has.
#[repr(C)]
pub struct glint_scene_counts {
    /// sizeof(glint_scene_counts).
    pub size: u32,
    /// Plain Gaussians.
    pub base: u32,
    /// Gaussians with lobes.
    pub supplement: u32,
    /// Of the harmonics, 0 to 3, or [`BETAS`](color::BETAS).
    pub sh_degree: u32,
}

/// Gaussians in arrays, see [`Gaussians`] and [`Lobes`].
#[repr(C)]
pub struct glint_gaussians {
    /// sizeof(glint_gaussians).
    pub size: u32,
    /// Gaussians.
    pub count: u32,
    /// Of the harmonics, 0 to 3, or [`BETAS`](color::BETAS).
    pub sh_degree: u32,
    /// 0.
    pub reserved: u32,
    /// Three each.
    pub means: *const f32,
    /// Three each, natural logarithms.
    pub log_scales: *const f32,
    /// Four each: w, x, y, z.
    pub rotations: *const f32,
    /// One each, logits.
    pub opacities: *const f32,
    /// Three for each coefficient.
    pub sh: *const f32,
    /// Three each; of a base null, as the two that follow.
    pub lobe_directions: *const f32,
    /// One each.
    pub lobe_widths: *const f32,
    /// One each.
    pub lobe_sharpness: *const f32,
}

/// So many values of some floats each.
///
/// # Safety
/// `from` is null or has them.
unsafe fn values<T: Pod>(from: *const f32, count: usize, what: &str) -> Result<Vec<T>> {
    match (count, from.is_null()) {
        (0, _) => Ok(Vec::new()),
        (_, true) => Err(Error::Usage(format!("{what} of {count} values are null"))),
        // SAFETY: by the contract above; `T` is floats.
        _ => Ok(unsafe { std::slice::from_raw_parts(from.cast::<T>(), count) }.to_vec()),
    }
}

impl glint_gaussians {
    /// # Safety
    /// The arrays are null or have as many values as is said.
    pub(super) unsafe fn gaussians(&self) -> Result<Gaussians> {
        let (n, sh_degree) = (self.count as usize, self.sh_degree);
        color::check(sh_degree).map_err(Error::Usage)?;
        // SAFETY: by the contract above.
        unsafe {
            Ok(Gaussians {
                sh_degree,
                means: values(self.means, n, "means")?,
                log_scales: values(self.log_scales, n, "log_scales")?,
                quats: values(self.rotations, n, "rotations")?,
                opacities: values(self.opacities, n, "opacities")?,
                sh: values(self.sh, n * coefficients(sh_degree), "sh")?,
            })
        }
    }

    /// # Safety
    /// As above.
    pub(super) unsafe fn lobes(&self) -> Result<Lobes> {
        let n = self.count as usize;
        // SAFETY: by the contract above.
        unsafe {
            Ok(Lobes {
                directions: values(self.lobe_directions, n, "lobe_directions")?,
                widths: values(self.lobe_widths, n, "lobe_widths")?,
                sharpness: values(self.lobe_sharpness, n, "lobe_sharpness")?,
            })
        }
    }
}

/// What a model has, to tell whose a number is.
#[repr(C)]
pub struct glint_model_counts {
    /// sizeof(glint_model_counts).
    pub size: u32,
    /// Plain Gaussians.
    pub base: u32,
    /// Gaussians with lobes.
    pub supplement: u32,
    /// Numbers that it takes among those of a frame's instances.
    pub capacity: u32,
    /// The greatest of both segments, 0 to 3, or [`BETAS`](color::BETAS).
    pub sh_degree: u32,
    /// 1: it is of half width.
    pub half: u32,
}

/// Constants of a pipeline at most.
const CONSTANTS: usize = 16;

/// See [`MadePipeline`].
#[repr(C)]
pub struct glint_pipeline {
    /// sizeof(glint_pipeline).
    pub size: u32,
    /// Of `constants`.
    pub constant_count: u32,
    /// VkPipeline.
    pub pipeline: u64,
    /// VkPipelineLayout.
    pub layout: u64,
    /// VkDescriptorSetLayout.
    pub set_layout: u64,
    /// Ids and values.
    pub constants: [[u32; 2]; CONSTANTS],
    /// The kernel's, ends with a 0.
    pub kernel: [c_char; 32],
}

impl From<&MadePipeline> for glint_pipeline {
    fn from(made: &MadePipeline) -> Self {
        use vk::Handle;
        let (mut constants, mut kernel) = ([[0; 2]; CONSTANTS], [0; 32]);
        constants.iter_mut().zip(&made.constants).for_each(|(to, &(id, value))| *to = [id, value]);
        put_name(&mut kernel, made.kernel);
        glint_pipeline {
            size: size_of::<glint_pipeline>() as u32,
            constant_count: made.constants.len().min(CONSTANTS) as u32,
            pipeline: made.pipeline.as_raw(),
            layout: made.layout.as_raw(),
            set_layout: made.set_layout.as_raw(),
            constants,
            kernel,
        }
    }
}

/// The last stays 0.
pub(super) fn put_name(to: &mut [c_char; 32], name: &str) {
    to[..31].iter_mut().zip(name.bytes()).for_each(|(to, byte)| *to = byte as c_char);
}

/// See [`Limits`].
#[repr(C)]
pub struct glint_limits {
    /// sizeof(glint_limits).
    pub size: u32,
    /// Pixels of the largest view.
    pub width: u32,
    /// Pixels of the largest view.
    pub height: u32,
    /// Of all instances together.
    pub gaussians: u32,
    /// Of a frame, at most 64.
    pub instances: u32,
    /// Of a frame.
    pub views: u32,
    /// Slots.
    pub in_flight: u32,
    /// Room for so many; 0 for what `intersection_bytes` says.
    pub intersections: u32,
    /// The widest `glint_texel` of any target.
    pub texel: u32,
    /// Bits: degree d of harmonics is asked for.
    pub degrees: u32,
    /// Bits: some supplements have or show degree d; 0: no model has one.
    pub lobe_degrees: u32,
    /// 1: models are of half width.
    pub half: u32,
    /// 1: depths hide Gaussians.
    pub depth_in: u32,
    /// 1: depths and ids are asked for.
    pub depth_out: u32,
    /// Not 0: every stage has timestamps.
    pub timings: u32,
    /// 1: opacities of small Gaussians are compensated, as Mip-Splatting does.
    pub compensate: u32,
    /// Room for as many as take so many bytes; 0 for the usual.
    pub intersection_bytes: u64,
}

impl From<&Limits> for glint_limits {
    fn from(limits: &Limits) -> Self {
        glint_limits {
            size: size_of::<glint_limits>() as u32,
            width: limits.width,
            height: limits.height,
            gaussians: limits.gaussians,
            instances: limits.instances,
            views: limits.views,
            in_flight: limits.in_flight,
            intersections: 0,
            texel: limits.texel as u32,
            degrees: bits(&limits.degrees),
            lobe_degrees: bits(&limits.lobe_degrees),
            half: limits.half.into(),
            depth_in: 0,
            depth_out: 0,
            timings: 0,
            compensate: 0,
            intersection_bytes: 0,
        }
    }
}

impl glint_limits {
    pub(super) fn limits(&self) -> Result<Limits> {
        Ok(Limits {
            width: self.width,
            height: self.height,
            gaussians: self.gaussians,
            instances: self.instances,
            views: self.views,
            in_flight: self.in_flight,
            intersections: match (self.intersections, self.intersection_bytes) {
                (0, 0) => Room::Usual,
                (0, bytes) => Room::Bytes(bytes),
                (count, _) => Room::Intersections(count),
            },
            texel: texel(self.texel)?,
            degrees: numbers(self.degrees)?,
            lobe_degrees: numbers(self.lobe_degrees)?,
            half: self.half != 0,
            depth_in: self.depth_in != 0,
            depth_out: self.depth_out != 0,
            timings: self.timings != 0,
            policy: Policy { compensate: self.compensate != 0, ..Default::default() },
        })
    }
}

fn bits(degrees: &[u32]) -> u32 {
    degrees.iter().fold(0, |bits, degree| bits | 1 << degree)
}

fn numbers(bits: u32) -> Result<Vec<u32>> {
    let count = MODELS.len() as u32;
    match bits >> count {
        0 => Ok((0..count).filter(|degree| bits >> degree & 1 != 0).collect()),
        _ => Err(Error::Usage(format!("degrees {bits:#x}, expected bits 0 to {}", count - 1))),
    }
}

fn texel(number: u32) -> Result<Texel> {
    let all = [Texel::Rgba8, Texel::Bgra8, Texel::Rgba16F, Texel::Rgba32F];
    all.into_iter().find(|t| *t as u32 == number).ok_or_else(|| Error::Usage(format!("there is no texel {number}")))
}

/// See [`Pixels`].
#[repr(C)]
#[derive(Clone, Copy)]
pub struct glint_pixels {
    /// VkImage; where it is 0, `buffer` is meant, and where that is 0 too nothing.
    pub image: u64,
    /// VkBuffer.
    pub buffer: u64,
    /// Bytes into the buffer.
    pub buffer_offset: u64,
    /// VkImageLayout at the time: general, or transfer source or destination.
    pub layout: i32,
    /// VkFormat that the image was made with.
    pub format: i32,
    /// Level of detail.
    pub level: u32,
    /// Array layer.
    pub layer: u32,
    /// Pixels, of the upper left corner.
    pub offset: [i32; 2],
}

impl glint_pixels {
    fn pixels(&self) -> Option<Pixels> {
        use vk::Handle;
        match (self.image, self.buffer) {
            (0, 0) => None,
            (0, buffer) => {
                Some(Pixels::Buffer(BufferRange { buffer: vk::Buffer::from_raw(buffer), offset: self.buffer_offset }))
            }
            (image, _) => Some(Pixels::Image(ImageRegion {
                image: vk::Image::from_raw(image),
                layout: vk::ImageLayout::from_raw(self.layout),
                format: vk::Format::from_raw(self.format),
                level: self.level,
                layer: self.layer,
                offset: self.offset,
            })),
        }
    }
}

/// See [`FrameView`] and [`Target`].
#[repr(C)]
pub struct glint_view {
    /// sizeof(glint_view).
    pub size: u32,
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// `glint_texel`.
    pub texel: u32,
    /// World to view, columns first.
    pub view: [f64; 16],
    /// View to Vulkan's clip space, columns first.
    pub projection: [f64; 16],
    /// Distance along the view's axis, scene units of the world; 0 for the projection's own.
    pub near: f64,
    /// Where colours go.
    pub color: glint_pixels,
    /// Float32 depths, of what hides Gaussians.
    pub depth_in: glint_pixels,
    /// Float32 depths, of the Gaussians.
    pub depth_out: glint_pixels,
    /// u32, of the Gaussians.
    pub ids: glint_pixels,
    /// 1: the target holds linear light.
    pub linear: u32,
    /// `glint_blend`.
    pub blend: u32,
    /// Factor of the Gaussians' light.
    pub exposure: f32,
    /// sRGB-encoded, of opaque targets.
    pub background: [f32; 3],
}

impl TryFrom<&glint_view> for FrameView {
    type Error = Error;

    fn try_from(v: &glint_view) -> Result<Self> {
        let (view, projection) = (DMat4::from_cols_array(&v.view), DMat4::from_cols_array(&v.projection));
        let seen = FrameView::from_matrices(view, projection, v.width, v.height)?;
        let blend = match v.blend {
            0 => Blend::Opaque(v.background),
            1 => Blend::Premultiplied,
            2 => Blend::Over,
            other => return Err(Error::Usage(format!("there is no blend {other}"))),
        };
        let light = if v.linear != 0 { Light::Linear } else { Light::Encoded };
        let texel = texel(v.texel)?;
        let target = |pixels| Target { pixels, texel, light, blend, exposure: v.exposure };
        Ok(FrameView {
            near: if v.near == 0.0 { seen.near } else { v.near },
            color: v.color.pixels().map(target),
            depth_in: v.depth_in.pixels(),
            depth_out: v.depth_out.pixels(),
            ids: v.ids.pixels(),
            ..seen
        })
    }
}

/// See [`Instance`].
#[repr(C)]
pub struct glint_instance {
    /// sizeof(glint_instance).
    pub size: u32,
    /// Bands of harmonics, at most the model's.
    pub sh_degree: u32,
    /// 1: without the supplement.
    pub base_only: u32,
    /// 0.
    pub reserved: u32,
    /// Any number of instances may be of one model.
    pub model: *const glint_model,
    /// x, y, z, w, of unit length.
    pub rotation: [f64; 4],
    /// Where the model's origin goes.
    pub translation: [f64; 3],
    /// Of all axes alike.
    pub scale: f64,
}

impl glint_instance {
    pub(super) fn instance<'a>(&self, model: &'a Model) -> Result<Instance<'a>> {
        Ok(Instance {
            model,
            transform: Transform {
                rotation: DQuat::from_array(self.rotation),
                scale: self.scale,
                translation: DVec3::from_array(self.translation),
            },
            upto: if self.base_only != 0 { Segment::Base } else { Segment::Supplement },
            degree: self.sh_degree,
        })
    }
}

/// See [`Frame`](crate::pipelines::frames::Frame).
#[repr(C)]
pub struct glint_frame {
    /// sizeof(glint_frame).
    pub size: u32,
    /// Which of the frames in flight it takes the place of.
    pub slot: u32,
    /// Of `instances`.
    pub instance_count: u32,
    /// Of `views`.
    pub view_count: u32,
    /// In one common order.
    pub instances: *const glint_instance,
    /// One after the other.
    pub views: *const glint_view,
}

/// See [`StageTime`](crate::gpu::StageTime).
#[repr(C)]
pub struct glint_stage_time {
    /// Ends with a 0.
    pub name: [c_char; 32],
    /// On the device.
    pub seconds: f64,
}

/// See [`Report`](crate::pipelines::frames::Report).
#[repr(C)]
pub struct glint_report {
    /// sizeof(glint_report).
    pub size: u32,
    /// 0 where all found room.
    pub needed: u32,
    /// Gaussians that the last view saw.
    pub visible: u32,
    /// Of those with its tiles.
    pub intersections: u32,
}

/// See [`Binding`].
#[repr(C)]
pub struct glint_binding {
    /// Of the buffer's contents.
    pub name: *const c_char,
    /// 1: read, 2: written, 3: both.
    pub access: u32,
    /// Of an element.
    pub element_bytes: u32,
}

impl From<&Binding> for glint_binding {
    fn from(binding: &Binding) -> Self {
        let access = match binding.access {
            Access::Read => 1,
            Access::Write => 2,
            Access::ReadWrite => 3,
        };
        glint_binding { name: binding.name.as_ptr(), access, element_bytes: binding.element_bytes }
    }
}

/// See [`Constant`].
#[repr(C)]
pub struct glint_constant {
    /// As the kernel has it.
    pub name: *const c_char,
    /// Its number in the module.
    pub id: u32,
    /// `glint_constant_kind`.
    pub kind: u32,
}

impl From<&Constant> for glint_constant {
    fn from(constant: &Constant) -> Self {
        let kind = match constant.kind {
            ConstantKind::U32 => 0,
            ConstantKind::I32 => 1,
            ConstantKind::F32 => 2,
            ConstantKind::Bool => 3,
        };
        glint_constant { name: constant.name.as_ptr(), id: constant.id, kind }
    }
}

/// See [`KernelInfo`](crate::gpu::KernelInfo).
#[repr(C)]
pub struct glint_kernel_info {
    /// sizeof(glint_kernel_info).
    pub size: u32,
    /// `glint_unit`: what takes one item.
    pub unit: u32,
    /// As the stage is called.
    pub name: *const c_char,
    /// SPIR-V.
    pub code: *const u32,
    /// Of the code.
    pub code_bytes: usize,
    /// By number, in set 0.
    pub bindings: *const glint_binding,
    /// The first is the workgroup size.
    pub constants: *const glint_constant,
    /// Of `bindings`.
    pub binding_count: u32,
    /// Of `constants`.
    pub constant_count: u32,
    /// Of push constants, from 0 on.
    pub push_bytes: u32,
    /// 1: it has subgroup operations.
    pub subgroups: u32,
    /// Names of what its SPIR-V needs of the device.
    pub features: *const *const c_char,
    /// Of `features`.
    pub feature_count: u32,
    /// 1: the threads of a workgroup meet at barriers.
    pub barriers: u32,
}
