//! The structures of `glint.h`, in its order, and their conversions to Rust types.

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

/// Version of `glint.h`.
pub const GLINT_VERSION: u32 = 4;

/// A device, see [`Context`].
pub struct glint_context(pub(super) Context);

/// Properties of a physical device, see [`DeviceInfo`].
pub struct glint_physical(pub(super) DeviceInfo);

/// Gaussians on the host, see [`Scene`].
pub struct glint_scene(pub(super) Scene);

/// A scene during its upload, see [`Upload`].
pub struct glint_upload {
    pub(super) upload: Upload,
    pub(super) context: Context,
    pub(super) kept: Kept,
}

/// Gaussians on the device, see [`Model`].
pub struct glint_model(pub(super) Model);

/// Frames of a renderer, see [`Frames`].
pub struct glint_frames {
    pub(super) frames: Frames,
    /// Preallocated memory for the views of a frame.
    pub(super) views: Vec<FrameView>,
}

/// The caller's Vulkan device.
#[repr(C)]
pub struct glint_device {
    /// sizeof(glint_device).
    pub size: u32,
    /// Queue family of `queue`; must support compute.
    pub queue_family: u32,
    /// The loader's vkGetInstanceProcAddr.
    pub get_instance_proc_addr: Option<vk::PFN_vkGetInstanceProcAddr>,
    /// VkInstance.
    pub instance: *mut c_void,
    /// VkPhysicalDevice.
    pub physical_device: *mut c_void,
    /// VkDevice, made with everything that `glint_required_*` demand.
    pub device: *mut c_void,
    /// VkQueue.
    pub queue: *mut c_void,
    /// VkPipelineCache or 0.
    pub pipeline_cache: u64,
    /// Maximum bytes of glint's buffers; 0 for the device's memory.
    pub memory_budget: u64,
    /// Called before glint submits, from the submitting thread; null if only glint uses the queue.
    pub lock_queue: Option<unsafe extern "C" fn(*mut c_void)>,
    /// Called after glint has submitted; see `lock_queue`.
    pub unlock_queue: Option<unsafe extern "C" fn(*mut c_void)>,
    /// Argument of both lock functions.
    pub user: *mut c_void,
    /// 1: VK_EXT_debug_utils is enabled on the instance; name kernels and buffers.
    pub labels: u32,
    /// Bits of the optional features that the device was made with.
    pub optional: u32,
}

/// See [`Requirements`](crate::gpu::Requirements).
#[repr(C)]
pub struct glint_requirements {
    /// sizeof(glint_requirements).
    pub size: u32,
    /// Minimum version of Vulkan.
    pub api_version: u32,
    /// VkSubgroupFeatureFlags required in compute.
    pub subgroup_operations: u32,
    /// Minimum subgroup size.
    pub least_lanes: u32,
    /// Maximum subgroup size.
    pub most_lanes: u32,
}

/// See [`Memory`](crate::gpu::Memory).
#[repr(C)]
pub struct glint_memory {
    /// sizeof(glint_memory).
    pub size: u32,
    /// 0.
    pub reserved: u32,
    /// Bytes used by the context's buffers.
    pub used: u64,
    /// Maximum bytes of all buffers together.
    pub budget: u64,
    /// Bytes allocated from the device for the buffers.
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
    /// Null-terminated.
    pub name: [c_char; 32],
}

/// Contents of a scene.
#[repr(C)]
pub struct glint_scene_counts {
    /// sizeof(glint_scene_counts).
    pub size: u32,
    /// Plain Gaussians.
    pub base: u32,
    /// Gaussians with lobes.
    pub supplement: u32,
    /// Degree of the harmonics, 0 to 3, or [`BETAS`](color::BETAS).
    pub sh_degree: u32,
}

/// Gaussians in arrays, see [`Gaussians`] and [`Lobes`].
#[repr(C)]
pub struct glint_gaussians {
    /// sizeof(glint_gaussians).
    pub size: u32,
    /// Number of Gaussians.
    pub count: u32,
    /// Degree of the harmonics, 0 to 3, or [`BETAS`](color::BETAS).
    pub sh_degree: u32,
    /// 0.
    pub reserved: u32,
    /// Three per Gaussian, scene units.
    pub means: *const f32,
    /// Three per Gaussian, natural logarithms.
    pub log_scales: *const f32,
    /// Four per Gaussian: w, x, y, z.
    pub rotations: *const f32,
    /// One per Gaussian, logits.
    pub opacities: *const f32,
    /// Three per coefficient.
    pub sh: *const f32,
    /// Three per Gaussian; null for a base, as are the next two.
    pub lobe_directions: *const f32,
    /// One per Gaussian.
    pub lobe_widths: *const f32,
    /// One per Gaussian.
    pub lobe_sharpness: *const f32,
}

/// Copies `count` values, each of several floats.
///
/// # Safety
/// `from` is null or has that many values.
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
    /// The arrays are null or have the stated number of values.
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
    /// The arrays are null or have the stated number of values.
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

/// Contents of a model, to map ids to Gaussians.
#[repr(C)]
pub struct glint_model_counts {
    /// sizeof(glint_model_counts).
    pub size: u32,
    /// Plain Gaussians.
    pub base: u32,
    /// Gaussians with lobes.
    pub supplement: u32,
    /// Size of its range among the ids of a frame's instances.
    pub capacity: u32,
    /// The higher degree of both segments, 0 to 3, or [`BETAS`](color::BETAS).
    pub sh_degree: u32,
    /// 1: half width.
    pub half: u32,
}

/// Maximum number of a pipeline's constants.
const CONSTANTS: usize = 16;

/// See [`MadePipeline`].
#[repr(C)]
pub struct glint_pipeline {
    /// sizeof(glint_pipeline).
    pub size: u32,
    /// Number of entries in `constants`.
    pub constant_count: u32,
    /// VkPipeline.
    pub pipeline: u64,
    /// VkPipelineLayout.
    pub layout: u64,
    /// VkDescriptorSetLayout.
    pub set_layout: u64,
    /// Pairs of id and value.
    pub constants: [[u32; 2]; CONSTANTS],
    /// Name of the kernel, null-terminated.
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

/// Copies a name, truncated so that the last byte stays 0.
pub(super) fn put_name(to: &mut [c_char; 32], name: &str) {
    to[..31].iter_mut().zip(name.bytes()).for_each(|(to, byte)| *to = byte as c_char);
}

/// See [`Limits`].
#[repr(C)]
#[derive(Default)]
pub struct glint_limits {
    /// sizeof(glint_limits).
    pub size: u32,
    /// Width of the largest view, pixels.
    pub width: u32,
    /// Height of the largest view, pixels.
    pub height: u32,
    /// Gaussians of all instances together.
    pub gaussians: u32,
    /// Instances of a frame, at most 64.
    pub instances: u32,
    /// Views of a frame.
    pub views: u32,
    /// Number of slots.
    pub in_flight: u32,
    /// Room for this number of intersections; 0 to use `intersection_bytes`.
    pub intersections: u32,
    /// The widest `glint_texel` of any target.
    pub texel: u32,
    /// Bit d: harmonics of degree d are rendered.
    pub degrees: u32,
    /// Bit d: supplements have or show degree d; 0: no model has a supplement.
    pub lobe_degrees: u32,
    /// 1: models have half width.
    pub half: u32,
    /// 1: depths occlude Gaussians.
    pub depth_in: u32,
    /// 1: enable outputs of depths and ids.
    pub depth_out: u32,
    /// Not 0: timestamps for every stage.
    pub timings: u32,
    /// 1: compensate opacities of small Gaussians, as in Mip-Splatting.
    pub compensate: u32,
    /// Room for the intersections that fit into this number of bytes; 0 for the default.
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
            texel: limits.texel as u32,
            degrees: bits(&limits.degrees),
            lobe_degrees: bits(&limits.lobe_degrees),
            half: limits.half.into(),
            ..Default::default()
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
    /// VkImage, or 0 to use `buffer`; if both are 0, there are no pixels.
    pub image: u64,
    /// VkBuffer.
    pub buffer: u64,
    /// Offset into the buffer, bytes.
    pub buffer_offset: u64,
    /// VkImageLayout at the time of the commands: general, or transfer source or destination.
    pub layout: i32,
    /// VkFormat of the image.
    pub format: i32,
    /// Level of detail.
    pub level: u32,
    /// Array layer.
    pub layer: u32,
    /// Upper left corner, pixels.
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
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// `glint_texel`.
    pub texel: u32,
    /// World to view, column-major.
    pub view: [f64; 16],
    /// View to Vulkan's clip space, column-major.
    pub projection: [f64; 16],
    /// Near distance along the view's axis, scene units of the world; 0 for the projection's near plane.
    pub near: f64,
    /// Color output.
    pub color: glint_pixels,
    /// Float32 depths that occlude Gaussians.
    pub depth_in: glint_pixels,
    /// Output of the Gaussians' float32 depths.
    pub depth_out: glint_pixels,
    /// Output of the Gaussians' ids, u32.
    pub ids: glint_pixels,
    /// 1: the target holds linear light.
    pub linear: u32,
    /// `glint_blend`.
    pub blend: u32,
    /// Factor on the Gaussians' linear light.
    pub exposure: f32,
    /// Background color, sRGB-encoded, for GLINT_OPAQUE.
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
    /// Bands of harmonics to show, at most the model's.
    pub sh_degree: u32,
    /// 1: without the supplement.
    pub base_only: u32,
    /// 0.
    pub reserved: u32,
    /// Several instances may share a model.
    pub model: *const glint_model,
    /// Unit quaternion x, y, z, w.
    pub rotation: [f64; 4],
    /// World position of the model's origin.
    pub translation: [f64; 3],
    /// Uniform scale of all axes.
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
    /// Slot of the frame in flight that this one replaces.
    pub slot: u32,
    /// Number of entries in `instances`.
    pub instance_count: u32,
    /// Number of entries in `views`.
    pub view_count: u32,
    /// Blended in one common order by depth.
    pub instances: *const glint_instance,
    /// Rendered one after the other.
    pub views: *const glint_view,
}

/// See [`StageTime`](crate::gpu::StageTime).
#[repr(C)]
pub struct glint_stage_time {
    /// Null-terminated.
    pub name: [c_char; 32],
    /// Seconds on the device.
    pub seconds: f64,
}

/// See [`Report`](crate::pipelines::frames::Report).
#[repr(C)]
pub struct glint_report {
    /// sizeof(glint_report).
    pub size: u32,
    /// Required number of intersections, or 0 if all fitted.
    pub needed: u32,
    /// Visible Gaussians of the last view.
    pub visible: u32,
    /// Intersections of visible Gaussians with the view's tiles.
    pub intersections: u32,
}

/// See [`Binding`].
#[repr(C)]
pub struct glint_binding {
    /// Name of the buffer's contents.
    pub name: *const c_char,
    /// 1: read, 2: written, 3: both.
    pub access: u32,
    /// Bytes per element.
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
    /// Name in the kernel.
    pub name: *const c_char,
    /// Constant id in the module.
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
    /// `glint_unit`: the unit of threads that handles one item.
    pub unit: u32,
    /// Name of the stage.
    pub name: *const c_char,
    /// SPIR-V.
    pub code: *const u32,
    /// Size of the code, bytes.
    pub code_bytes: usize,
    /// Bindings by number, in set 0.
    pub bindings: *const glint_binding,
    /// Constants; the first is the workgroup size.
    pub constants: *const glint_constant,
    /// Number of entries in `bindings`.
    pub binding_count: u32,
    /// Number of entries in `constants`.
    pub constant_count: u32,
    /// Bytes of push constants, from offset 0.
    pub push_bytes: u32,
    /// 1: uses subgroup operations.
    pub subgroups: u32,
    /// Names of the device features that its SPIR-V needs.
    pub features: *const *const c_char,
    /// Number of entries in `features`.
    pub feature_count: u32,
    /// 1: uses workgroup barriers.
    pub barriers: u32,
}
