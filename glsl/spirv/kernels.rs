/// Structs that kernels share with the host, in scalar block layout.
pub mod types {
#[repr(C)] #[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Candidate {
    pub mean: [f32; 3],
    pub toward: [f32; 3],
    pub px: f32,
    pub theta_bar: f32,
    pub view: u32,
    pub pixel: u32,
}
#[repr(C)] #[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Fit {
    pub sigma: f32,
    pub opacity: f32,
    pub width: f32,
    pub colour: [f32; 3],
    pub gain: f32,
    pub support: f32,
    pub plain: f32,
}
#[repr(C)] #[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Frame {
    pub image_first: u32,
    pub target_first: u32,
    pub width: u32,
    pub height: u32,
}
#[repr(C)] #[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Lift {
    pub mean: [f32; 3],
    pub log_scale: [f32; 3],
    pub quat: [f32; 4],
    pub dc: [f32; 3],
    pub opacity: f32,
    pub lobe_dir: [f32; 3],
    pub lobe_width: f32,
    pub theta_bar: f32,
    pub cluster_size: u32,
}
#[repr(C)] #[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Loss {
    pub l1: f32,
    pub squared: f32,
    pub ssim: f32,
    pub total: f32,
}
#[repr(C)] #[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct PackedSplat {
    pub first: [u32; 4],
    pub rest: [u32; 3],
}
#[repr(C)] #[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Page {
    pub segment: u32,
    pub first: u32,
    pub capacity: u32,
}
#[repr(C)] #[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Plot {
    pub texel_first: u32,
    pub pixel_first: u32,
    pub cell_first: u32,
    pub block_first: u32,
}
#[repr(C)] #[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Quota {
    pub view: u32,
    pub first: u32,
    pub budget: u32,
}
#[repr(C)] #[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct ScreenState {
    pub count: u32,
    pub mode: u32,
}
#[repr(C)] #[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Splat {
    pub shape: [f32; 4],
    pub centre: [f32; 2],
}
#[repr(C)] #[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct StepRates {
    pub mean: f32,
    pub log_scale: f32,
    pub quat: f32,
    pub opacity: f32,
    pub dc: f32,
    pub sh: f32,
    pub direction: f32,
    pub width: f32,
    pub sharpness: f32,
    pub first_correction: f32,
    pub second_correction: f32,
    pub lobe_first_correction: f32,
    pub lobe_second_correction: f32,
    pub step: u32,
    pub newton: f32,
    pub probe: u32,
}
#[repr(C)] #[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Texel {
    pub difference_rg: u32,
    pub difference_b_render_r: u32,
    pub render_gb: u32,
    pub texture: u32,
}
#[repr(C)] #[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct View {
    pub row_x: [f32; 4],
    pub row_y: [f32; 4],
    pub row_z: [f32; 4],
    pub eye: [f32; 3],
    pub fx: f32,
    pub fy: f32,
    pub cx: f32,
    pub cy: f32,
    pub slope_low: [f32; 2],
    pub slope_high: [f32; 2],
    pub width: u32,
    pub height: u32,
    pub pixel_first: u32,
    pub near: f32,
}
}
use crate::gpu::KernelInfo;
/// Every kernel, by name.
pub const ALL: [KernelInfo; 57] = [
    KernelInfo::of::<density_apply::Kernel>(),
    KernelInfo::of::<density_draw::Kernel>(),
    KernelInfo::of::<density_image::Kernel>(),
    KernelInfo::of::<density_noise::Kernel>(),
    KernelInfo::of::<density_place::Kernel>(),
    KernelInfo::of::<density_plan::Kernel>(),
    KernelInfo::of::<density_score::Kernel>(),
    KernelInfo::of::<density_weigh::Kernel>(),
    KernelInfo::of::<exposure_apply::Kernel>(),
    KernelInfo::of::<exposure_backward::Kernel>(),
    KernelInfo::of::<exposure_step::Kernel>(),
    KernelInfo::of::<lift_append::Kernel>(),
    KernelInfo::of::<lift_count::Kernel>(),
    KernelInfo::of::<lift_groups::Kernel>(),
    KernelInfo::of::<lift_join::Kernel>(),
    KernelInfo::of::<lift_pca::Kernel>(),
    KernelInfo::of::<lift_points::Kernel>(),
    KernelInfo::of::<loss_probe::Kernel>(),
    KernelInfo::of::<loss_sum::Kernel>(),
    KernelInfo::of::<ssim_backward::Kernel>(),
    KernelInfo::of::<ssim_forward::Kernel>(),
    KernelInfo::of::<gather::Kernel>(),
    KernelInfo::of::<recount::Kernel>(),
    KernelInfo::of::<adam::Kernel>(),
    KernelInfo::of::<project_backward::Kernel>(),
    KernelInfo::of::<step_done::Kernel>(),
    KernelInfo::of::<pursuit_attenuate::Kernel>(),
    KernelInfo::of::<pursuit_blur::Kernel>(),
    KernelInfo::of::<pursuit_claim::Kernel>(),
    KernelInfo::of::<pursuit_draw::Kernel>(),
    KernelInfo::of::<pursuit_fit::Kernel>(),
    KernelInfo::of::<pursuit_gain::Kernel>(),
    KernelInfo::of::<pursuit_place::Kernel>(),
    KernelInfo::of::<pursuit_quanta::Kernel>(),
    KernelInfo::of::<pursuit_residual::Kernel>(),
    KernelInfo::of::<pursuit_score::Kernel>(),
    KernelInfo::of::<blend::Kernel>(),
    KernelInfo::of::<blend_backward::Kernel>(),
    KernelInfo::of::<blend_backward_atomic::Kernel>(),
    KernelInfo::of::<emit::Kernel>(),
    KernelInfo::of::<median_depth::Kernel>(),
    KernelInfo::of::<project::Kernel>(),
    KernelInfo::of::<resolve::Kernel>(),
    KernelInfo::of::<tile_ranges::Kernel>(),
    KernelInfo::of::<screen_backward::Kernel>(),
    KernelInfo::of::<screen_draw::Kernel>(),
    KernelInfo::of::<screen_project::Kernel>(),
    KernelInfo::of::<screen_prune::Kernel>(),
    KernelInfo::of::<screen_tiles::Kernel>(),
    KernelInfo::of::<dispatch_args::Kernel>(),
    KernelInfo::of::<radix_downsweep::Kernel>(),
    KernelInfo::of::<radix_spine::Kernel>(),
    KernelInfo::of::<radix_upsweep::Kernel>(),
    KernelInfo::of::<scan_apply::Kernel>(),
    KernelInfo::of::<scan_reduce::Kernel>(),
    KernelInfo::of::<scan_spine::Kernel>(),
    KernelInfo::of::<fma_rate::Kernel>(),
];
/// The names of all stages.
pub const NAMES: &[&str] = &["density_apply", "density_draw", "density_image", "density_noise", "density_place", "density_plan", "density_score", "density_weigh", "exposure_apply", "exposure_backward", "exposure_step", "lift_append", "lift_count", "lift_groups", "lift_join", "lift_pca", "lift_points", "loss_probe", "loss_sum", "ssim_backward", "ssim_forward", "gather", "recount", "adam", "project_backward", "step_done", "pursuit_attenuate", "pursuit_blur", "pursuit_claim", "pursuit_draw", "pursuit_fit", "pursuit_gain", "pursuit_place", "pursuit_quanta", "pursuit_residual", "pursuit_score", "blend", "blend_backward", "blend_backward_atomic", "emit", "median_depth", "project", "resolve", "tile_ranges", "screen_backward", "screen_draw", "screen_project", "screen_prune", "screen_tiles", "dispatch_args", "radix_downsweep", "radix_spine", "radix_upsweep", "scan_apply", "scan_reduce", "scan_spine", "fma_rate"];
/// `glsl/density/density_apply.comp`
pub mod density_apply {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub segment: u32,
    pub page_first: u32,
    pub stride: u32,
    pub small: f32,
    pub most: f32,
    pub step: u32,
    pub seed: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub strategy: u32,
    pub sh_beside: u32,
    pub moments: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub population: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub status: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub words: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub sources: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub copies: &'a crate::gpu::Buffer<u32>,
    /// ReadWrite
    pub geometry: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadWrite
    pub geometry_moments: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadWrite
    pub sh_moments: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadWrite
    pub lobe_moments: &'a crate::gpu::Buffer<[f32; 4]>,
    /// WriteOnly
    pub scores: &'a crate::gpu::Buffer<[f32; 4]>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub population: &'a [u32],
    /// ReadOnly
    pub status: &'a [u32],
    /// ReadOnly
    pub words: &'a [u32],
    /// ReadOnly
    pub sources: &'a [u32],
    /// ReadOnly
    pub copies: &'a [u32],
    /// ReadWrite
    pub geometry: &'a mut [[f32; 4]],
    /// ReadWrite
    pub geometry_moments: &'a mut [[f32; 4]],
    /// ReadWrite
    pub sh_moments: &'a mut [[f32; 4]],
    /// ReadWrite
    pub lobe_moments: &'a mut [[f32; 4]],
    /// WriteOnly
    pub scores: &'a mut [[f32; 4]],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, strategy: call.constant(1) as u32, sh_beside: call.constant(2) as u32, moments: call.constant(3) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, population: crate::gpu::next_binding(&mut bindings), status: crate::gpu::next_binding(&mut bindings), words: crate::gpu::next_binding(&mut bindings), sources: crate::gpu::next_binding(&mut bindings), copies: crate::gpu::next_binding(&mut bindings), geometry: crate::gpu::next_binding(&mut bindings), geometry_moments: crate::gpu::next_binding(&mut bindings), sh_moments: crate::gpu::next_binding(&mut bindings), lobe_moments: crate::gpu::next_binding(&mut bindings), scores: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "density_apply";
    const LABEL: &'static std::ffi::CStr = c"density_apply";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/density_apply.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/density_apply.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"population", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"status", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"words", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"sources", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"copies", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"geometry", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"geometry_moments", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"sh_moments", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"lobe_moments", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"scores", access: crate::gpu::Access::Write, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"strategy", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 2, name: c"sh_beside", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 3, name: c"moments", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.strategy as u32), (2, spec.sh_beside as u32), (3, spec.moments as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.population.raw(), b.status.raw(), b.words.raw(), b.sources.raw(), b.copies.raw(), b.geometry.raw(), b.geometry_moments.raw(), b.sh_moments.raw(), b.lobe_moments.raw(), b.scores.raw()])
    }
}
}
/// `glsl/density/density_draw.comp`
pub mod density_draw {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub step: u32,
    pub seed: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub replacement: bool,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub words: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub order: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub sources: &'a crate::gpu::Buffer<u32>,
    /// ReadWrite
    pub copies: &'a crate::gpu::Buffer<u32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub words: &'a [u32],
    /// ReadOnly
    pub order: &'a [u32],
    /// WriteOnly
    pub sources: &'a mut [u32],
    /// ReadWrite
    pub copies: &'a mut [u32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, replacement: call.constant(1) != 0, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, words: crate::gpu::next_binding(&mut bindings), order: crate::gpu::next_binding(&mut bindings), sources: crate::gpu::next_binding(&mut bindings), copies: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "density_draw";
    const LABEL: &'static std::ffi::CStr = c"density_draw";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/density_draw.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/density_draw.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"words", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"order", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"sources", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"copies", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"replacement", kind: crate::gpu::ConstantKind::Bool },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.replacement as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.words.raw(), b.order.raw(), b.sources.raw(), b.copies.raw()])
    }
}
}
/// `glsl/density/density_image.comp`
pub mod density_image {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub frame: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub frames: &'a crate::gpu::Buffer<Frame>,
    /// ReadOnly
    pub image: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadOnly
    pub targets: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub image_grad: &'a crate::gpu::Buffer<f32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub frames: &'a [Frame],
    /// ReadOnly
    pub image: &'a [[f32; 4]],
    /// ReadOnly
    pub targets: &'a [u32],
    /// WriteOnly
    pub image_grad: &'a mut [f32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, frames: crate::gpu::next_binding(&mut bindings), image: crate::gpu::next_binding(&mut bindings), targets: crate::gpu::next_binding(&mut bindings), image_grad: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "density_image";
    const LABEL: &'static std::ffi::CStr = c"density_image";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/density_image.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/density_image.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"frames", access: crate::gpu::Access::Read, element_bytes: size_of::<Frame>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"image", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"targets", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"image_grad", access: crate::gpu::Access::Write, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.frames.raw(), b.image.raw(), b.targets.raw(), b.image_grad.raw()])
    }
}
}
/// `glsl/density/density_noise.comp`
pub mod density_noise {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub segment: u32,
    pub page_first: u32,
    pub stride: u32,
    pub rate: f32,
    pub step: u32,
    pub seed: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub population: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub status: &'a crate::gpu::Buffer<u32>,
    /// ReadWrite
    pub geometry: &'a crate::gpu::Buffer<[f32; 4]>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub population: &'a [u32],
    /// ReadOnly
    pub status: &'a [u32],
    /// ReadWrite
    pub geometry: &'a mut [[f32; 4]],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, population: crate::gpu::next_binding(&mut bindings), status: crate::gpu::next_binding(&mut bindings), geometry: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "density_noise";
    const LABEL: &'static std::ffi::CStr = c"density_noise";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/density_noise.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/density_noise.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"population", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"status", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"geometry", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.population.raw(), b.status.raw(), b.geometry.raw()])
    }
}
}
/// `glsl/density/density_place.comp`
pub mod density_place {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub page_first: u32,
    pub stride: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub words: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub alive: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub ranks: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub sources: &'a crate::gpu::Buffer<u32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub words: &'a [u32],
    /// ReadOnly
    pub alive: &'a [u32],
    /// ReadOnly
    pub ranks: &'a [u32],
    /// WriteOnly
    pub sources: &'a mut [u32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, words: crate::gpu::next_binding(&mut bindings), alive: crate::gpu::next_binding(&mut bindings), ranks: crate::gpu::next_binding(&mut bindings), sources: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "density_place";
    const LABEL: &'static std::ffi::CStr = c"density_place";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/density_place.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/density_place.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"words", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"alive", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"ranks", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"sources", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.words.raw(), b.alive.raw(), b.ranks.raw(), b.sources.raw()])
    }
}
}
/// `glsl/density/density_plan.comp`
pub mod density_plan {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub capacity: u32,
    pub target: u32,
    pub nth: u32,
    pub threads_per_group: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub replacement: bool,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub status: &'a crate::gpu::Buffer<u32>,
    /// ReadWrite
    pub words: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub dispatch_args: &'a crate::gpu::Buffer<u32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub status: &'a [u32],
    /// ReadWrite
    pub words: &'a mut [u32],
    /// WriteOnly
    pub dispatch_args: &'a mut [u32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, replacement: call.constant(1) != 0, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, status: crate::gpu::next_binding(&mut bindings), words: crate::gpu::next_binding(&mut bindings), dispatch_args: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "density_plan";
    const LABEL: &'static std::ffi::CStr = c"density_plan";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/density_plan.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/density_plan.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"status", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"words", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"dispatch_args", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"replacement", kind: crate::gpu::ConstantKind::Bool },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.replacement as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.status.raw(), b.words.raw(), b.dispatch_args.raw()])
    }
}
}
/// `glsl/density/density_score.comp`
pub mod density_score {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub segment: u32,
    pub page_first: u32,
    pub stride: u32,
    pub by_gaussian: u32,
    pub half_width: f32,
    pub half_height: f32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub pulls: bool,
    pub packed_records: bool,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub population: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub status: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub tile_counts: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub first_slot: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub splats: &'a crate::gpu::Buffer<Splat>,
    /// ReadOnly
    pub record_centres: &'a crate::gpu::Buffer<[f32; 3]>,
    /// ReadOnly
    pub record_shapes: &'a crate::gpu::Buffer<[f32; 3]>,
    /// ReadOnly
    pub record_colours: &'a crate::gpu::Buffer<[f32; 3]>,
    /// ReadWrite
    pub scores: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadOnly
    pub record_words: &'a crate::gpu::Buffer<[u32; 4]>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub population: &'a [u32],
    /// ReadOnly
    pub status: &'a [u32],
    /// ReadOnly
    pub tile_counts: &'a [u32],
    /// ReadOnly
    pub first_slot: &'a [u32],
    /// ReadOnly
    pub splats: &'a [Splat],
    /// ReadOnly
    pub record_centres: &'a [[f32; 3]],
    /// ReadOnly
    pub record_shapes: &'a [[f32; 3]],
    /// ReadOnly
    pub record_colours: &'a [[f32; 3]],
    /// ReadWrite
    pub scores: &'a mut [[f32; 4]],
    /// ReadOnly
    pub record_words: &'a [[u32; 4]],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, pulls: call.constant(1) != 0, packed_records: call.constant(11) != 0, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, population: crate::gpu::next_binding(&mut bindings), status: crate::gpu::next_binding(&mut bindings), tile_counts: crate::gpu::next_binding(&mut bindings), first_slot: crate::gpu::next_binding(&mut bindings), splats: crate::gpu::next_binding(&mut bindings), record_centres: crate::gpu::next_binding(&mut bindings), record_shapes: crate::gpu::next_binding(&mut bindings), record_colours: crate::gpu::next_binding(&mut bindings), scores: crate::gpu::next_binding(&mut bindings), record_words: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "density_score";
    const LABEL: &'static std::ffi::CStr = c"density_score";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/density_score.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/density_score.software.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"population", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"status", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"tile_counts", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"first_slot", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"splats", access: crate::gpu::Access::Read, element_bytes: size_of::<Splat>() as u32, floats: 0b111111 },
        crate::gpu::Binding { name: c"record_centres", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 3]>() as u32, floats: 0b111 },
        crate::gpu::Binding { name: c"record_shapes", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 3]>() as u32, floats: 0b111 },
        crate::gpu::Binding { name: c"record_colours", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 3]>() as u32, floats: 0b111 },
        crate::gpu::Binding { name: c"scores", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"record_words", access: crate::gpu::Access::Read, element_bytes: size_of::<[u32; 4]>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"pulls", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 11, name: c"packed_records", kind: crate::gpu::ConstantKind::Bool },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = true;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[crate::gpu::Feature::ComputeFullSubgroups, crate::gpu::Feature::SubgroupSizeControl];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.pulls as u32), (11, spec.packed_records as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.population.raw(), b.status.raw(), b.tile_counts.raw(), b.first_slot.raw(), b.splats.raw(), b.record_centres.raw(), b.record_shapes.raw(), b.record_colours.raw(), b.scores.raw(), b.record_words.raw()])
    }
}
}
/// `glsl/density/density_weigh.comp`
pub mod density_weigh {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub segment: u32,
    pub page_first: u32,
    pub stride: u32,
    pub capacity: u32,
    pub least_opacity: f32,
    pub least_score: f32,
    pub step: u32,
    pub seed: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub strategy: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub population: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub geometry: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadOnly
    pub scores: &'a crate::gpu::Buffer<[f32; 4]>,
    /// WriteOnly
    pub alive: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub keys: &'a crate::gpu::Buffer<u32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub population: &'a [u32],
    /// ReadOnly
    pub geometry: &'a [[f32; 4]],
    /// ReadOnly
    pub scores: &'a [[f32; 4]],
    /// WriteOnly
    pub alive: &'a mut [u32],
    /// WriteOnly
    pub keys: &'a mut [u32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, strategy: call.constant(1) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, population: crate::gpu::next_binding(&mut bindings), geometry: crate::gpu::next_binding(&mut bindings), scores: crate::gpu::next_binding(&mut bindings), alive: crate::gpu::next_binding(&mut bindings), keys: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "density_weigh";
    const LABEL: &'static std::ffi::CStr = c"density_weigh";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/density_weigh.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/density_weigh.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"population", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"geometry", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"scores", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"alive", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"keys", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"strategy", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.strategy as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.population.raw(), b.geometry.raw(), b.scores.raw(), b.alive.raw(), b.keys.raw()])
    }
}
}
/// `glsl/exposure/exposure_apply.comp`
pub mod exposure_apply {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub frame: u32,
    pub photo: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub frames: &'a crate::gpu::Buffer<Frame>,
    /// ReadOnly
    pub maps: &'a crate::gpu::Buffer<f32>,
    /// ReadOnly
    pub image: &'a crate::gpu::Buffer<[f32; 4]>,
    /// WriteOnly
    pub corrected: &'a crate::gpu::Buffer<[f32; 4]>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub frames: &'a [Frame],
    /// ReadOnly
    pub maps: &'a [f32],
    /// ReadOnly
    pub image: &'a [[f32; 4]],
    /// WriteOnly
    pub corrected: &'a mut [[f32; 4]],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, frames: crate::gpu::next_binding(&mut bindings), maps: crate::gpu::next_binding(&mut bindings), image: crate::gpu::next_binding(&mut bindings), corrected: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "exposure_apply";
    const LABEL: &'static std::ffi::CStr = c"exposure_apply";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/exposure_apply.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/exposure_apply.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"frames", access: crate::gpu::Access::Read, element_bytes: size_of::<Frame>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"maps", access: crate::gpu::Access::Read, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"image", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"corrected", access: crate::gpu::Access::Write, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.frames.raw(), b.maps.raw(), b.image.raw(), b.corrected.raw()])
    }
}
}
/// `glsl/exposure/exposure_backward.comp`
pub mod exposure_backward {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub frame: u32,
    pub photo: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub frames: &'a crate::gpu::Buffer<Frame>,
    /// ReadOnly
    pub maps: &'a crate::gpu::Buffer<f32>,
    /// ReadOnly
    pub image: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadWrite
    pub image_grad: &'a crate::gpu::Buffer<f32>,
    /// WriteOnly
    pub sums: &'a crate::gpu::Buffer<f32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub frames: &'a [Frame],
    /// ReadOnly
    pub maps: &'a [f32],
    /// ReadOnly
    pub image: &'a [[f32; 4]],
    /// ReadWrite
    pub image_grad: &'a mut [f32],
    /// WriteOnly
    pub sums: &'a mut [f32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, frames: crate::gpu::next_binding(&mut bindings), maps: crate::gpu::next_binding(&mut bindings), image: crate::gpu::next_binding(&mut bindings), image_grad: crate::gpu::next_binding(&mut bindings), sums: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "exposure_backward";
    const LABEL: &'static std::ffi::CStr = c"exposure_backward";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/exposure_backward.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/exposure_backward.software.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"frames", access: crate::gpu::Access::Read, element_bytes: size_of::<Frame>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"maps", access: crate::gpu::Access::Read, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"image", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"image_grad", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"sums", access: crate::gpu::Access::Write, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Subgroup;
    const SUBGROUPS: bool = true;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[crate::gpu::Feature::ComputeFullSubgroups, crate::gpu::Feature::SubgroupSizeControl];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.frames.raw(), b.maps.raw(), b.image.raw(), b.image_grad.raw(), b.sums.raw()])
    }
}
}
/// `glsl/exposure/exposure_step.comp`
pub mod exposure_step {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub photo: u32,
    pub photos: u32,
    pub runs: u32,
    pub rate: f32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub status: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub sums: &'a crate::gpu::Buffer<f32>,
    /// ReadWrite
    pub maps: &'a crate::gpu::Buffer<f32>,
    /// ReadWrite
    pub moments: &'a crate::gpu::Buffer<f32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub status: &'a [u32],
    /// ReadOnly
    pub sums: &'a [f32],
    /// ReadWrite
    pub maps: &'a mut [f32],
    /// ReadWrite
    pub moments: &'a mut [f32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, status: crate::gpu::next_binding(&mut bindings), sums: crate::gpu::next_binding(&mut bindings), maps: crate::gpu::next_binding(&mut bindings), moments: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "exposure_step";
    const LABEL: &'static std::ffi::CStr = c"exposure_step";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/exposure_step.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/exposure_step.software.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"status", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"sums", access: crate::gpu::Access::Read, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"maps", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"moments", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Workgroup;
    const SUBGROUPS: bool = true;
    const BARRIERS: bool = true;
    const FEATURES: &'static [crate::gpu::Feature] = &[crate::gpu::Feature::ComputeFullSubgroups, crate::gpu::Feature::SubgroupSizeControl];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.status.raw(), b.sums.raw(), b.maps.raw(), b.moments.raw()])
    }
}
}
/// `glsl/lift/lift_append.comp`
pub mod lift_append {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub count: u32,
    pub segment: u32,
    pub page_first: u32,
    pub stride: u32,
    pub sh_coefficients: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub has_lobes: bool,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub lifts: &'a crate::gpu::Buffer<Lift>,
    /// ReadOnly
    pub lift_ranks: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub lift_flags: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub population: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub geometry: &'a crate::gpu::Buffer<[f32; 4]>,
    /// WriteOnly
    pub sh: &'a crate::gpu::Buffer<[f32; 4]>,
    /// WriteOnly
    pub lobes: &'a crate::gpu::Buffer<[f32; 4]>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub lifts: &'a [Lift],
    /// ReadOnly
    pub lift_ranks: &'a [u32],
    /// ReadOnly
    pub lift_flags: &'a [u32],
    /// ReadOnly
    pub population: &'a [u32],
    /// WriteOnly
    pub geometry: &'a mut [[f32; 4]],
    /// WriteOnly
    pub sh: &'a mut [[f32; 4]],
    /// WriteOnly
    pub lobes: &'a mut [[f32; 4]],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, has_lobes: call.constant(1) != 0, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, lifts: crate::gpu::next_binding(&mut bindings), lift_ranks: crate::gpu::next_binding(&mut bindings), lift_flags: crate::gpu::next_binding(&mut bindings), population: crate::gpu::next_binding(&mut bindings), geometry: crate::gpu::next_binding(&mut bindings), sh: crate::gpu::next_binding(&mut bindings), lobes: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "lift_append";
    const LABEL: &'static std::ffi::CStr = c"lift_append";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/lift_append.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/lift_append.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"lifts", access: crate::gpu::Access::Read, element_bytes: size_of::<Lift>() as u32, floats: 0b1111111111111111111 },
        crate::gpu::Binding { name: c"lift_ranks", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"lift_flags", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"population", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"geometry", access: crate::gpu::Access::Write, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"sh", access: crate::gpu::Access::Write, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"lobes", access: crate::gpu::Access::Write, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"has_lobes", kind: crate::gpu::ConstantKind::Bool },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.has_lobes as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.lifts.raw(), b.lift_ranks.raw(), b.lift_flags.raw(), b.population.raw(), b.geometry.raw(), b.sh.raw(), b.lobes.raw()])
    }
}
}
/// `glsl/lift/lift_count.comp`
pub mod lift_count {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub count: u32,
    pub stride: u32,
    pub view_count: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub screen_planes: &'a crate::gpu::Buffer<f32>,
    /// ReadOnly
    pub screen_frames: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub views: &'a crate::gpu::Buffer<View>,
    /// ReadOnly
    pub depths: &'a crate::gpu::Buffer<f32>,
    /// WriteOnly
    pub point_counts: &'a crate::gpu::Buffer<u32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub screen_planes: &'a [f32],
    /// ReadOnly
    pub screen_frames: &'a [u32],
    /// ReadOnly
    pub views: &'a [View],
    /// ReadOnly
    pub depths: &'a [f32],
    /// WriteOnly
    pub point_counts: &'a mut [u32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, screen_planes: crate::gpu::next_binding(&mut bindings), screen_frames: crate::gpu::next_binding(&mut bindings), views: crate::gpu::next_binding(&mut bindings), depths: crate::gpu::next_binding(&mut bindings), point_counts: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "lift_count";
    const LABEL: &'static std::ffi::CStr = c"lift_count";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/lift_count.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/lift_count.software.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"screen_planes", access: crate::gpu::Access::Read, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"screen_frames", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"views", access: crate::gpu::Access::Read, element_bytes: size_of::<View>() as u32, floats: 0b100011111111111111111111111 },
        crate::gpu::Binding { name: c"depths", access: crate::gpu::Access::Read, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"point_counts", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Subgroup;
    const SUBGROUPS: bool = true;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[crate::gpu::Feature::ComputeFullSubgroups, crate::gpu::Feature::SubgroupSizeControl];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.screen_planes.raw(), b.screen_frames.raw(), b.views.raw(), b.depths.raw(), b.point_counts.raw()])
    }
}
}
/// `glsl/lift/lift_groups.comp`
pub mod lift_groups {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub count: u32,
    pub point_count: u32,
    pub round: u32,
    pub last_round: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub fail_on_smallest: u32,
    pub lockstep: bool,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub point_counts: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub point_firsts: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub heaviest: &'a crate::gpu::Buffer<u32>,
    /// ReadWrite
    pub labels: &'a crate::gpu::Buffer<u32>,
    /// ReadWrite
    pub group_sizes: &'a crate::gpu::Buffer<u32>,
    /// ReadWrite
    pub taus: &'a crate::gpu::Buffer<f32>,
    /// WriteOnly
    pub prime_labels: &'a crate::gpu::Buffer<u32>,
    /// ReadWrite
    pub cluster_sizes: &'a crate::gpu::Buffer<u32>,
    /// ReadWrite
    pub rounds: &'a crate::gpu::Buffer<u32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub point_counts: &'a [u32],
    /// ReadOnly
    pub point_firsts: &'a [u32],
    /// ReadOnly
    pub heaviest: &'a [u32],
    /// ReadWrite
    pub labels: &'a mut [u32],
    /// ReadWrite
    pub group_sizes: &'a mut [u32],
    /// ReadWrite
    pub taus: &'a mut [f32],
    /// WriteOnly
    pub prime_labels: &'a mut [u32],
    /// ReadWrite
    pub cluster_sizes: &'a mut [u32],
    /// ReadWrite
    pub rounds: &'a mut [u32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, fail_on_smallest: call.constant(1) as u32, lockstep: call.constant(7) != 0, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, point_counts: crate::gpu::next_binding(&mut bindings), point_firsts: crate::gpu::next_binding(&mut bindings), heaviest: crate::gpu::next_binding(&mut bindings), labels: crate::gpu::next_binding(&mut bindings), group_sizes: crate::gpu::next_binding(&mut bindings), taus: crate::gpu::next_binding(&mut bindings), prime_labels: crate::gpu::next_binding(&mut bindings), cluster_sizes: crate::gpu::next_binding(&mut bindings), rounds: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "lift_groups";
    const LABEL: &'static std::ffi::CStr = c"lift_groups";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/lift_groups.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/lift_groups.software.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"point_counts", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"point_firsts", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"heaviest", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"labels", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"group_sizes", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"taus", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"prime_labels", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"cluster_sizes", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"rounds", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"fail_on_smallest", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 7, name: c"lockstep", kind: crate::gpu::ConstantKind::Bool },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Subgroup;
    const SUBGROUPS: bool = true;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[crate::gpu::Feature::ComputeFullSubgroups, crate::gpu::Feature::SubgroupSizeControl];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.fail_on_smallest as u32), (7, spec.lockstep as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.point_counts.raw(), b.point_firsts.raw(), b.heaviest.raw(), b.labels.raw(), b.group_sizes.raw(), b.taus.raw(), b.prime_labels.raw(), b.cluster_sizes.raw(), b.rounds.raw()])
    }
}
}
/// `glsl/lift/lift_join.comp`
pub mod lift_join {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub point_count: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub points: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadOnly
    pub point_sets: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub point_counts: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub point_firsts: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub taus: &'a crate::gpu::Buffer<f32>,
    /// ReadOnly
    pub cluster_sizes: &'a crate::gpu::Buffer<u32>,
    /// ReadWrite
    pub labels: &'a crate::gpu::Buffer<u32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub points: &'a [[f32; 4]],
    /// ReadOnly
    pub point_sets: &'a [u32],
    /// ReadOnly
    pub point_counts: &'a [u32],
    /// ReadOnly
    pub point_firsts: &'a [u32],
    /// ReadOnly
    pub taus: &'a [f32],
    /// ReadOnly
    pub cluster_sizes: &'a [u32],
    /// ReadWrite
    pub labels: &'a mut [u32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, points: crate::gpu::next_binding(&mut bindings), point_sets: crate::gpu::next_binding(&mut bindings), point_counts: crate::gpu::next_binding(&mut bindings), point_firsts: crate::gpu::next_binding(&mut bindings), taus: crate::gpu::next_binding(&mut bindings), cluster_sizes: crate::gpu::next_binding(&mut bindings), labels: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "lift_join";
    const LABEL: &'static std::ffi::CStr = c"lift_join";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/lift_join.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/lift_join.software.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"points", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"point_sets", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"point_counts", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"point_firsts", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"taus", access: crate::gpu::Access::Read, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"cluster_sizes", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"labels", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Subgroup;
    const SUBGROUPS: bool = true;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[crate::gpu::Feature::ComputeFullSubgroups, crate::gpu::Feature::SubgroupSizeControl];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.points.raw(), b.point_sets.raw(), b.point_counts.raw(), b.point_firsts.raw(), b.taus.raw(), b.cluster_sizes.raw(), b.labels.raw()])
    }
}
}
/// `glsl/lift/lift_pca.comp`
pub mod lift_pca {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub count: u32,
    pub stride: u32,
    pub view_count: u32,
    pub train_count: u32,
    pub unit: f32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub plain_weights: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub screen_planes: &'a crate::gpu::Buffer<f32>,
    /// ReadOnly
    pub screen_frames: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub views: &'a crate::gpu::Buffer<View>,
    /// ReadOnly
    pub train_views: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub points: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadOnly
    pub point_counts: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub point_firsts: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub heaviest: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub labels: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub prime_labels: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub cluster_sizes: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub lifts: &'a crate::gpu::Buffer<Lift>,
    /// WriteOnly
    pub lift_flags: &'a crate::gpu::Buffer<u32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub screen_planes: &'a [f32],
    /// ReadOnly
    pub screen_frames: &'a [u32],
    /// ReadOnly
    pub views: &'a [View],
    /// ReadOnly
    pub train_views: &'a [u32],
    /// ReadOnly
    pub points: &'a [[f32; 4]],
    /// ReadOnly
    pub point_counts: &'a [u32],
    /// ReadOnly
    pub point_firsts: &'a [u32],
    /// ReadOnly
    pub heaviest: &'a [u32],
    /// ReadOnly
    pub labels: &'a [u32],
    /// ReadOnly
    pub prime_labels: &'a [u32],
    /// ReadOnly
    pub cluster_sizes: &'a [u32],
    /// WriteOnly
    pub lifts: &'a mut [Lift],
    /// WriteOnly
    pub lift_flags: &'a mut [u32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, plain_weights: call.constant(1) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, screen_planes: crate::gpu::next_binding(&mut bindings), screen_frames: crate::gpu::next_binding(&mut bindings), views: crate::gpu::next_binding(&mut bindings), train_views: crate::gpu::next_binding(&mut bindings), points: crate::gpu::next_binding(&mut bindings), point_counts: crate::gpu::next_binding(&mut bindings), point_firsts: crate::gpu::next_binding(&mut bindings), heaviest: crate::gpu::next_binding(&mut bindings), labels: crate::gpu::next_binding(&mut bindings), prime_labels: crate::gpu::next_binding(&mut bindings), cluster_sizes: crate::gpu::next_binding(&mut bindings), lifts: crate::gpu::next_binding(&mut bindings), lift_flags: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "lift_pca";
    const LABEL: &'static std::ffi::CStr = c"lift_pca";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/lift_pca.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/lift_pca.software.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"screen_planes", access: crate::gpu::Access::Read, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"screen_frames", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"views", access: crate::gpu::Access::Read, element_bytes: size_of::<View>() as u32, floats: 0b100011111111111111111111111 },
        crate::gpu::Binding { name: c"train_views", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"points", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"point_counts", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"point_firsts", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"heaviest", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"labels", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"prime_labels", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"cluster_sizes", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"lifts", access: crate::gpu::Access::Write, element_bytes: size_of::<Lift>() as u32, floats: 0b1111111111111111111 },
        crate::gpu::Binding { name: c"lift_flags", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"plain_weights", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Subgroup;
    const SUBGROUPS: bool = true;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[crate::gpu::Feature::ComputeFullSubgroups, crate::gpu::Feature::SubgroupSizeControl];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.plain_weights as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.screen_planes.raw(), b.screen_frames.raw(), b.views.raw(), b.train_views.raw(), b.points.raw(), b.point_counts.raw(), b.point_firsts.raw(), b.heaviest.raw(), b.labels.raw(), b.prime_labels.raw(), b.cluster_sizes.raw(), b.lifts.raw(), b.lift_flags.raw()])
    }
}
}
/// `glsl/lift/lift_points.comp`
pub mod lift_points {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub count: u32,
    pub stride: u32,
    pub view_count: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub screen_planes: &'a crate::gpu::Buffer<f32>,
    /// ReadOnly
    pub screen_frames: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub views: &'a crate::gpu::Buffer<View>,
    /// ReadOnly
    pub depths: &'a crate::gpu::Buffer<f32>,
    /// ReadOnly
    pub point_counts: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub point_firsts: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub points: &'a crate::gpu::Buffer<[f32; 4]>,
    /// WriteOnly
    pub heaviest: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub taus: &'a crate::gpu::Buffer<f32>,
    /// WriteOnly
    pub point_sets: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub labels: &'a crate::gpu::Buffer<u32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub screen_planes: &'a [f32],
    /// ReadOnly
    pub screen_frames: &'a [u32],
    /// ReadOnly
    pub views: &'a [View],
    /// ReadOnly
    pub depths: &'a [f32],
    /// ReadOnly
    pub point_counts: &'a [u32],
    /// ReadOnly
    pub point_firsts: &'a [u32],
    /// WriteOnly
    pub points: &'a mut [[f32; 4]],
    /// WriteOnly
    pub heaviest: &'a mut [u32],
    /// WriteOnly
    pub taus: &'a mut [f32],
    /// WriteOnly
    pub point_sets: &'a mut [u32],
    /// WriteOnly
    pub labels: &'a mut [u32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, screen_planes: crate::gpu::next_binding(&mut bindings), screen_frames: crate::gpu::next_binding(&mut bindings), views: crate::gpu::next_binding(&mut bindings), depths: crate::gpu::next_binding(&mut bindings), point_counts: crate::gpu::next_binding(&mut bindings), point_firsts: crate::gpu::next_binding(&mut bindings), points: crate::gpu::next_binding(&mut bindings), heaviest: crate::gpu::next_binding(&mut bindings), taus: crate::gpu::next_binding(&mut bindings), point_sets: crate::gpu::next_binding(&mut bindings), labels: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "lift_points";
    const LABEL: &'static std::ffi::CStr = c"lift_points";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/lift_points.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/lift_points.software.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"screen_planes", access: crate::gpu::Access::Read, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"screen_frames", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"views", access: crate::gpu::Access::Read, element_bytes: size_of::<View>() as u32, floats: 0b100011111111111111111111111 },
        crate::gpu::Binding { name: c"depths", access: crate::gpu::Access::Read, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"point_counts", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"point_firsts", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"points", access: crate::gpu::Access::Write, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"heaviest", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"taus", access: crate::gpu::Access::Write, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"point_sets", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"labels", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Subgroup;
    const SUBGROUPS: bool = true;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[crate::gpu::Feature::ComputeFullSubgroups, crate::gpu::Feature::SubgroupSizeControl];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.screen_planes.raw(), b.screen_frames.raw(), b.views.raw(), b.depths.raw(), b.point_counts.raw(), b.point_firsts.raw(), b.points.raw(), b.heaviest.raw(), b.taus.raw(), b.point_sets.raw(), b.labels.raw()])
    }
}
}
/// `glsl/loss/loss_probe.comp`
pub mod loss_probe {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub frame: u32,
    pub step: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub ssim_weight: f32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub frames: &'a crate::gpu::Buffer<Frame>,
    /// ReadOnly
    pub image: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadOnly
    pub targets: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub image_grad: &'a crate::gpu::Buffer<f32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub frames: &'a [Frame],
    /// ReadOnly
    pub image: &'a [[f32; 4]],
    /// ReadOnly
    pub targets: &'a [u32],
    /// WriteOnly
    pub image_grad: &'a mut [f32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, ssim_weight: f32::from_bits(call.constant(1)), }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, frames: crate::gpu::next_binding(&mut bindings), image: crate::gpu::next_binding(&mut bindings), targets: crate::gpu::next_binding(&mut bindings), image_grad: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "loss_probe";
    const LABEL: &'static std::ffi::CStr = c"loss_probe";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/loss_probe.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/loss_probe.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"frames", access: crate::gpu::Access::Read, element_bytes: size_of::<Frame>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"image", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"targets", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"image_grad", access: crate::gpu::Access::Write, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"ssim_weight", kind: crate::gpu::ConstantKind::F32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.ssim_weight.to_bits())] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.frames.raw(), b.image.raw(), b.targets.raw(), b.image_grad.raw()])
    }
}
}
/// `glsl/loss/loss_sum.comp`
pub mod loss_sum {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub frame_first: u32,
    pub frame_count: u32,
    pub tiles_per_frame: u32,
    pub first: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub ssim_weight: f32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub frames: &'a crate::gpu::Buffer<Frame>,
    /// ReadOnly
    pub tile_sums: &'a crate::gpu::Buffer<[f32; 3]>,
    /// WriteOnly
    pub losses: &'a crate::gpu::Buffer<Loss>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub frames: &'a [Frame],
    /// ReadOnly
    pub tile_sums: &'a [[f32; 3]],
    /// WriteOnly
    pub losses: &'a mut [Loss],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, ssim_weight: f32::from_bits(call.constant(1)), }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, frames: crate::gpu::next_binding(&mut bindings), tile_sums: crate::gpu::next_binding(&mut bindings), losses: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "loss_sum";
    const LABEL: &'static std::ffi::CStr = c"loss_sum";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/loss_sum.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/loss_sum.software.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"frames", access: crate::gpu::Access::Read, element_bytes: size_of::<Frame>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"tile_sums", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 3]>() as u32, floats: 0b111 },
        crate::gpu::Binding { name: c"losses", access: crate::gpu::Access::Write, element_bytes: size_of::<Loss>() as u32, floats: 0b1111 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"ssim_weight", kind: crate::gpu::ConstantKind::F32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Workgroup;
    const SUBGROUPS: bool = true;
    const BARRIERS: bool = true;
    const FEATURES: &'static [crate::gpu::Feature] = &[crate::gpu::Feature::ComputeFullSubgroups, crate::gpu::Feature::SubgroupSizeControl];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.ssim_weight.to_bits())] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.frames.raw(), b.tile_sums.raw(), b.losses.raw()])
    }
}
}
/// `glsl/loss/ssim_backward.comp`
pub mod ssim_backward {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub frame_first: u32,
    pub tiles_per_frame: u32,
    pub tile_count: u32,
    pub count_index: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub tile_list: bool,
    pub ssim_weight: f32,
    pub run: u32,
    pub strip: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub count: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub tile_list: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub frames: &'a crate::gpu::Buffer<Frame>,
    /// ReadOnly
    pub image: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadOnly
    pub targets: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub partials: &'a crate::gpu::Buffer<[f32; 3]>,
    /// WriteOnly
    pub image_grad: &'a crate::gpu::Buffer<f32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub count: &'a [u32],
    /// ReadOnly
    pub tile_list: &'a [u32],
    /// ReadOnly
    pub frames: &'a [Frame],
    /// ReadOnly
    pub image: &'a [[f32; 4]],
    /// ReadOnly
    pub targets: &'a [u32],
    /// ReadOnly
    pub partials: &'a [[f32; 3]],
    /// WriteOnly
    pub image_grad: &'a mut [f32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, tile_list: call.constant(1) != 0, ssim_weight: f32::from_bits(call.constant(2)), run: call.constant(8) as u32, strip: call.constant(9) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, count: crate::gpu::next_binding(&mut bindings), tile_list: crate::gpu::next_binding(&mut bindings), frames: crate::gpu::next_binding(&mut bindings), image: crate::gpu::next_binding(&mut bindings), targets: crate::gpu::next_binding(&mut bindings), partials: crate::gpu::next_binding(&mut bindings), image_grad: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "ssim_backward";
    const LABEL: &'static std::ffi::CStr = c"ssim_backward";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/ssim_backward.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/ssim_backward.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"count", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"tile_list", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"frames", access: crate::gpu::Access::Read, element_bytes: size_of::<Frame>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"image", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"targets", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"partials", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 3]>() as u32, floats: 0b111 },
        crate::gpu::Binding { name: c"image_grad", access: crate::gpu::Access::Write, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"tile_list", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 2, name: c"ssim_weight", kind: crate::gpu::ConstantKind::F32 },
        crate::gpu::Constant { id: 8, name: c"run", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 9, name: c"strip", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Workgroup;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = true;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.tile_list as u32), (2, spec.ssim_weight.to_bits()), (8, spec.run as u32), (9, spec.strip as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.count.raw(), b.tile_list.raw(), b.frames.raw(), b.image.raw(), b.targets.raw(), b.partials.raw(), b.image_grad.raw()])
    }
}
}
/// `glsl/loss/ssim_forward.comp`
pub mod ssim_forward {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub frame_first: u32,
    pub tiles_per_frame: u32,
    pub tile_count: u32,
    pub count_index: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub tile_list: bool,
    pub ssim_weight: f32,
    pub loss_map: bool,
    pub run: u32,
    pub strip: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub count: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub tile_list: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub frames: &'a crate::gpu::Buffer<Frame>,
    /// ReadOnly
    pub image: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadOnly
    pub targets: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub partials: &'a crate::gpu::Buffer<[f32; 3]>,
    /// WriteOnly
    pub tile_sums: &'a crate::gpu::Buffer<[f32; 3]>,
    /// WriteOnly
    pub loss_map: &'a crate::gpu::Buffer<f32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub count: &'a [u32],
    /// ReadOnly
    pub tile_list: &'a [u32],
    /// ReadOnly
    pub frames: &'a [Frame],
    /// ReadOnly
    pub image: &'a [[f32; 4]],
    /// ReadOnly
    pub targets: &'a [u32],
    /// WriteOnly
    pub partials: &'a mut [[f32; 3]],
    /// WriteOnly
    pub tile_sums: &'a mut [[f32; 3]],
    /// WriteOnly
    pub loss_map: &'a mut [f32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, tile_list: call.constant(1) != 0, ssim_weight: f32::from_bits(call.constant(2)), loss_map: call.constant(3) != 0, run: call.constant(8) as u32, strip: call.constant(9) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, count: crate::gpu::next_binding(&mut bindings), tile_list: crate::gpu::next_binding(&mut bindings), frames: crate::gpu::next_binding(&mut bindings), image: crate::gpu::next_binding(&mut bindings), targets: crate::gpu::next_binding(&mut bindings), partials: crate::gpu::next_binding(&mut bindings), tile_sums: crate::gpu::next_binding(&mut bindings), loss_map: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "ssim_forward";
    const LABEL: &'static std::ffi::CStr = c"ssim_forward";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/ssim_forward.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/ssim_forward.software.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"count", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"tile_list", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"frames", access: crate::gpu::Access::Read, element_bytes: size_of::<Frame>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"image", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"targets", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"partials", access: crate::gpu::Access::Write, element_bytes: size_of::<[f32; 3]>() as u32, floats: 0b111 },
        crate::gpu::Binding { name: c"tile_sums", access: crate::gpu::Access::Write, element_bytes: size_of::<[f32; 3]>() as u32, floats: 0b111 },
        crate::gpu::Binding { name: c"loss_map", access: crate::gpu::Access::Write, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"tile_list", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 2, name: c"ssim_weight", kind: crate::gpu::ConstantKind::F32 },
        crate::gpu::Constant { id: 3, name: c"loss_map", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 8, name: c"run", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 9, name: c"strip", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Workgroup;
    const SUBGROUPS: bool = true;
    const BARRIERS: bool = true;
    const FEATURES: &'static [crate::gpu::Feature] = &[crate::gpu::Feature::ComputeFullSubgroups, crate::gpu::Feature::SubgroupSizeControl];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.tile_list as u32), (2, spec.ssim_weight.to_bits()), (3, spec.loss_map as u32), (8, spec.run as u32), (9, spec.strip as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.count.raw(), b.tile_list.raw(), b.frames.raw(), b.image.raw(), b.targets.raw(), b.partials.raw(), b.tile_sums.raw(), b.loss_map.raw()])
    }
}
}
/// `glsl/model/gather.comp`
pub mod gather {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub count_index: u32,
    pub targets: u32,
    pub page_first: u32,
    pub stride: u32,
    pub quad: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub count: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub sources: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub from: &'a crate::gpu::Buffer<[f32; 4]>,
    /// WriteOnly
    pub gathered: &'a crate::gpu::Buffer<[f32; 4]>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub count: &'a [u32],
    /// ReadOnly
    pub sources: &'a [u32],
    /// ReadOnly
    pub from: &'a [[f32; 4]],
    /// WriteOnly
    pub gathered: &'a mut [[f32; 4]],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, count: crate::gpu::next_binding(&mut bindings), sources: crate::gpu::next_binding(&mut bindings), from: crate::gpu::next_binding(&mut bindings), gathered: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "gather";
    const LABEL: &'static std::ffi::CStr = c"gather";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/gather.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/gather.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"count", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"sources", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"from", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"gathered", access: crate::gpu::Access::Write, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.count.raw(), b.sources.raw(), b.from.raw(), b.gathered.raw()])
    }
}
}
/// `glsl/model/recount.comp`
pub mod recount {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub page_count: u32,
    pub threads_per_group: u32,
    pub items_per_group: u32,
    pub segment: u32,
    pub added_index: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub added: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub pages: &'a crate::gpu::Buffer<Page>,
    /// ReadWrite
    pub segment_counts: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub population: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub population_args: &'a crate::gpu::Buffer<u32>,
    /// ReadWrite
    pub status: &'a crate::gpu::Buffer<u32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub added: &'a [u32],
    /// ReadOnly
    pub pages: &'a [Page],
    /// ReadWrite
    pub segment_counts: &'a mut [u32],
    /// WriteOnly
    pub population: &'a mut [u32],
    /// WriteOnly
    pub population_args: &'a mut [u32],
    /// ReadWrite
    pub status: &'a mut [u32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, added: crate::gpu::next_binding(&mut bindings), pages: crate::gpu::next_binding(&mut bindings), segment_counts: crate::gpu::next_binding(&mut bindings), population: crate::gpu::next_binding(&mut bindings), population_args: crate::gpu::next_binding(&mut bindings), status: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "recount";
    const LABEL: &'static std::ffi::CStr = c"recount";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/recount.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/recount.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"added", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"pages", access: crate::gpu::Access::Read, element_bytes: size_of::<Page>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"segment_counts", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"population", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"population_args", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"status", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.added.raw(), b.pages.raw(), b.segment_counts.raw(), b.population.raw(), b.population_args.raw(), b.status.raw()])
    }
}
}
/// `glsl/optim/adam.comp`
pub mod adam {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub segment: u32,
    pub page_first: u32,
    pub stride: u32,
    pub rates: StepRates,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub has_lobes: bool,
    pub opacity_only: bool,
    pub sparse: bool,
    pub packed: bool,
    pub sh_degree: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub population: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub status: &'a crate::gpu::Buffer<u32>,
    /// ReadWrite
    pub geometry: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadWrite
    pub sh: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadWrite
    pub lobes: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadWrite
    pub geometry_moments: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadWrite
    pub sh_moments: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadWrite
    pub lobe_moments: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadOnly
    pub geometry_grads: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadOnly
    pub sh_grads: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadOnly
    pub lobe_grads: &'a crate::gpu::Buffer<[f32; 4]>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub population: &'a [u32],
    /// ReadOnly
    pub status: &'a [u32],
    /// ReadWrite
    pub geometry: &'a mut [[f32; 4]],
    /// ReadWrite
    pub sh: &'a mut [[f32; 4]],
    /// ReadWrite
    pub lobes: &'a mut [[f32; 4]],
    /// ReadWrite
    pub geometry_moments: &'a mut [[f32; 4]],
    /// ReadWrite
    pub sh_moments: &'a mut [[f32; 4]],
    /// ReadWrite
    pub lobe_moments: &'a mut [[f32; 4]],
    /// ReadOnly
    pub geometry_grads: &'a [[f32; 4]],
    /// ReadOnly
    pub sh_grads: &'a [[f32; 4]],
    /// ReadOnly
    pub lobe_grads: &'a [[f32; 4]],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, has_lobes: call.constant(2) != 0, opacity_only: call.constant(3) != 0, sparse: call.constant(4) != 0, packed: call.constant(6) != 0, sh_degree: call.constant(10) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, population: crate::gpu::next_binding(&mut bindings), status: crate::gpu::next_binding(&mut bindings), geometry: crate::gpu::next_binding(&mut bindings), sh: crate::gpu::next_binding(&mut bindings), lobes: crate::gpu::next_binding(&mut bindings), geometry_moments: crate::gpu::next_binding(&mut bindings), sh_moments: crate::gpu::next_binding(&mut bindings), lobe_moments: crate::gpu::next_binding(&mut bindings), geometry_grads: crate::gpu::next_binding(&mut bindings), sh_grads: crate::gpu::next_binding(&mut bindings), lobe_grads: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "adam";
    const LABEL: &'static std::ffi::CStr = c"adam";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/adam.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/adam.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"population", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"status", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"geometry", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"sh", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"lobes", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"geometry_moments", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"sh_moments", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"lobe_moments", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"geometry_grads", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"sh_grads", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"lobe_grads", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 2, name: c"has_lobes", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 3, name: c"opacity_only", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 4, name: c"sparse", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 6, name: c"packed", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 10, name: c"sh_degree", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (2, spec.has_lobes as u32), (3, spec.opacity_only as u32), (4, spec.sparse as u32), (6, spec.packed as u32), (10, spec.sh_degree as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.population.raw(), b.status.raw(), b.geometry.raw(), b.sh.raw(), b.lobes.raw(), b.geometry_moments.raw(), b.sh_moments.raw(), b.lobe_moments.raw(), b.geometry_grads.raw(), b.sh_grads.raw(), b.lobe_grads.raw()])
    }
}
}
/// `glsl/optim/project_backward.comp`
pub mod project_backward {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub segment: u32,
    pub page_first: u32,
    pub stride: u32,
    pub view: u32,
    pub by_gaussian: u32,
    pub rates: StepRates,
    pub mean_opacity: f32,
    pub mean_scale: f32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub compensate: bool,
    pub has_lobes: bool,
    pub opacity_only: bool,
    pub sparse: bool,
    pub accumulate: bool,
    pub packed: bool,
    pub newton: bool,
    pub sh_degree: u32,
    pub packed_records: bool,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub population: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub views: &'a crate::gpu::Buffer<View>,
    /// ReadOnly
    pub status: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub tile_counts: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub first_slot: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub record_centres: &'a crate::gpu::Buffer<[f32; 3]>,
    /// ReadOnly
    pub record_shapes: &'a crate::gpu::Buffer<[f32; 3]>,
    /// ReadOnly
    pub record_colours: &'a crate::gpu::Buffer<[f32; 3]>,
    /// ReadOnly
    pub splat_colours: &'a crate::gpu::Buffer<[f32; 3]>,
    /// ReadWrite
    pub geometry: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadWrite
    pub sh: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadWrite
    pub lobes: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadWrite
    pub geometry_moments: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadWrite
    pub sh_moments: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadWrite
    pub lobe_moments: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadOnly
    pub record_words: &'a crate::gpu::Buffer<[u32; 4]>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub population: &'a [u32],
    /// ReadOnly
    pub views: &'a [View],
    /// ReadOnly
    pub status: &'a [u32],
    /// ReadOnly
    pub tile_counts: &'a [u32],
    /// ReadOnly
    pub first_slot: &'a [u32],
    /// ReadOnly
    pub record_centres: &'a [[f32; 3]],
    /// ReadOnly
    pub record_shapes: &'a [[f32; 3]],
    /// ReadOnly
    pub record_colours: &'a [[f32; 3]],
    /// ReadOnly
    pub splat_colours: &'a [[f32; 3]],
    /// ReadWrite
    pub geometry: &'a mut [[f32; 4]],
    /// ReadWrite
    pub sh: &'a mut [[f32; 4]],
    /// ReadWrite
    pub lobes: &'a mut [[f32; 4]],
    /// ReadWrite
    pub geometry_moments: &'a mut [[f32; 4]],
    /// ReadWrite
    pub sh_moments: &'a mut [[f32; 4]],
    /// ReadWrite
    pub lobe_moments: &'a mut [[f32; 4]],
    /// ReadOnly
    pub record_words: &'a [[u32; 4]],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, compensate: call.constant(1) != 0, has_lobes: call.constant(2) != 0, opacity_only: call.constant(3) != 0, sparse: call.constant(4) != 0, accumulate: call.constant(5) != 0, packed: call.constant(6) != 0, newton: call.constant(7) != 0, sh_degree: call.constant(10) as u32, packed_records: call.constant(11) != 0, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, population: crate::gpu::next_binding(&mut bindings), views: crate::gpu::next_binding(&mut bindings), status: crate::gpu::next_binding(&mut bindings), tile_counts: crate::gpu::next_binding(&mut bindings), first_slot: crate::gpu::next_binding(&mut bindings), record_centres: crate::gpu::next_binding(&mut bindings), record_shapes: crate::gpu::next_binding(&mut bindings), record_colours: crate::gpu::next_binding(&mut bindings), splat_colours: crate::gpu::next_binding(&mut bindings), geometry: crate::gpu::next_binding(&mut bindings), sh: crate::gpu::next_binding(&mut bindings), lobes: crate::gpu::next_binding(&mut bindings), geometry_moments: crate::gpu::next_binding(&mut bindings), sh_moments: crate::gpu::next_binding(&mut bindings), lobe_moments: crate::gpu::next_binding(&mut bindings), record_words: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "project_backward";
    const LABEL: &'static std::ffi::CStr = c"project_backward";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/project_backward.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/project_backward.software.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"population", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"views", access: crate::gpu::Access::Read, element_bytes: size_of::<View>() as u32, floats: 0b100011111111111111111111111 },
        crate::gpu::Binding { name: c"status", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"tile_counts", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"first_slot", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"record_centres", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 3]>() as u32, floats: 0b111 },
        crate::gpu::Binding { name: c"record_shapes", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 3]>() as u32, floats: 0b111 },
        crate::gpu::Binding { name: c"record_colours", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 3]>() as u32, floats: 0b111 },
        crate::gpu::Binding { name: c"splat_colours", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 3]>() as u32, floats: 0b111 },
        crate::gpu::Binding { name: c"geometry", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"sh", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"lobes", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"geometry_moments", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"sh_moments", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"lobe_moments", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"record_words", access: crate::gpu::Access::Read, element_bytes: size_of::<[u32; 4]>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"compensate", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 2, name: c"has_lobes", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 3, name: c"opacity_only", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 4, name: c"sparse", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 5, name: c"accumulate", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 6, name: c"packed", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 7, name: c"newton", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 10, name: c"sh_degree", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 11, name: c"packed_records", kind: crate::gpu::ConstantKind::Bool },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = true;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[crate::gpu::Feature::ComputeFullSubgroups, crate::gpu::Feature::SubgroupSizeControl];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.compensate as u32), (2, spec.has_lobes as u32), (3, spec.opacity_only as u32), (4, spec.sparse as u32), (5, spec.accumulate as u32), (6, spec.packed as u32), (7, spec.newton as u32), (10, spec.sh_degree as u32), (11, spec.packed_records as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.population.raw(), b.views.raw(), b.status.raw(), b.tile_counts.raw(), b.first_slot.raw(), b.record_centres.raw(), b.record_shapes.raw(), b.record_colours.raw(), b.splat_colours.raw(), b.geometry.raw(), b.sh.raw(), b.lobes.raw(), b.geometry_moments.raw(), b.sh_moments.raw(), b.lobe_moments.raw(), b.record_words.raw()])
    }
}
}
/// `glsl/optim/step_done.comp`
pub mod step_done {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadWrite
    pub status: &'a crate::gpu::Buffer<u32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadWrite
    pub status: &'a mut [u32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, status: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "step_done";
    const LABEL: &'static std::ffi::CStr = c"step_done";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/step_done.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/step_done.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"status", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.status.raw()])
    }
}
}
/// `glsl/pursuit/pursuit_attenuate.comp`
pub mod pursuit_attenuate {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub count: u32,
    pub view_first: u32,
    pub view_end: u32,
    pub last: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub views: &'a crate::gpu::Buffer<View>,
    /// ReadOnly
    pub plots: &'a crate::gpu::Buffer<Plot>,
    /// ReadOnly
    pub surface_depths: &'a crate::gpu::Buffer<f32>,
    /// ReadOnly
    pub candidates: &'a crate::gpu::Buffer<Candidate>,
    /// ReadOnly
    pub texels: &'a crate::gpu::Buffer<Texel>,
    /// ReadOnly
    pub fits: &'a crate::gpu::Buffer<Fit>,
    /// ReadOnly
    pub gains: &'a crate::gpu::Buffer<f32>,
    /// ReadOnly
    pub beaten: &'a crate::gpu::Buffer<u32>,
    /// ReadWrite
    pub explained: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub gain_keys: &'a crate::gpu::Buffer<u32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub views: &'a [View],
    /// ReadOnly
    pub plots: &'a [Plot],
    /// ReadOnly
    pub surface_depths: &'a [f32],
    /// ReadOnly
    pub candidates: &'a [Candidate],
    /// ReadOnly
    pub texels: &'a [Texel],
    /// ReadOnly
    pub fits: &'a [Fit],
    /// ReadOnly
    pub gains: &'a [f32],
    /// ReadOnly
    pub beaten: &'a [u32],
    /// ReadWrite
    pub explained: &'a mut [u32],
    /// WriteOnly
    pub gain_keys: &'a mut [u32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, views: crate::gpu::next_binding(&mut bindings), plots: crate::gpu::next_binding(&mut bindings), surface_depths: crate::gpu::next_binding(&mut bindings), candidates: crate::gpu::next_binding(&mut bindings), texels: crate::gpu::next_binding(&mut bindings), fits: crate::gpu::next_binding(&mut bindings), gains: crate::gpu::next_binding(&mut bindings), beaten: crate::gpu::next_binding(&mut bindings), explained: crate::gpu::next_binding(&mut bindings), gain_keys: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "pursuit_attenuate";
    const LABEL: &'static std::ffi::CStr = c"pursuit_attenuate";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/pursuit_attenuate.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/pursuit_attenuate.software.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"views", access: crate::gpu::Access::Read, element_bytes: size_of::<View>() as u32, floats: 0b100011111111111111111111111 },
        crate::gpu::Binding { name: c"plots", access: crate::gpu::Access::Read, element_bytes: size_of::<Plot>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"surface_depths", access: crate::gpu::Access::Read, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"candidates", access: crate::gpu::Access::Read, element_bytes: size_of::<Candidate>() as u32, floats: 0b11111111 },
        crate::gpu::Binding { name: c"texels", access: crate::gpu::Access::Read, element_bytes: size_of::<Texel>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"fits", access: crate::gpu::Access::Read, element_bytes: size_of::<Fit>() as u32, floats: 0b111111111 },
        crate::gpu::Binding { name: c"gains", access: crate::gpu::Access::Read, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"beaten", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"explained", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"gain_keys", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Subgroup;
    const SUBGROUPS: bool = true;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[crate::gpu::Feature::ComputeFullSubgroups, crate::gpu::Feature::SubgroupSizeControl];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.views.raw(), b.plots.raw(), b.surface_depths.raw(), b.candidates.raw(), b.texels.raw(), b.fits.raw(), b.gains.raw(), b.beaten.raw(), b.explained.raw(), b.gain_keys.raw()])
    }
}
}
/// `glsl/pursuit/pursuit_blur.comp`
pub mod pursuit_blur {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub from_first: u32,
    pub from_width: u32,
    pub from_height: u32,
    pub first: u32,
    pub width: u32,
    pub height: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub halve: bool,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub from_texels: &'a crate::gpu::Buffer<Texel>,
    /// WriteOnly
    pub texels: &'a crate::gpu::Buffer<Texel>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub from_texels: &'a [Texel],
    /// WriteOnly
    pub texels: &'a mut [Texel],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, halve: call.constant(1) != 0, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, from_texels: crate::gpu::next_binding(&mut bindings), texels: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "pursuit_blur";
    const LABEL: &'static std::ffi::CStr = c"pursuit_blur";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/pursuit_blur.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/pursuit_blur.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"from_texels", access: crate::gpu::Access::Read, element_bytes: size_of::<Texel>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"texels", access: crate::gpu::Access::Write, element_bytes: size_of::<Texel>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"halve", kind: crate::gpu::ConstantKind::Bool },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.halve as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.from_texels.raw(), b.texels.raw()])
    }
}
}
/// `glsl/pursuit/pursuit_claim.comp`
pub mod pursuit_claim {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub count: u32,
    pub view_first: u32,
    pub view_end: u32,
    pub begin: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub check: bool,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub views: &'a crate::gpu::Buffer<View>,
    /// ReadOnly
    pub plots: &'a crate::gpu::Buffer<Plot>,
    /// ReadOnly
    pub surface_depths: &'a crate::gpu::Buffer<f32>,
    /// ReadOnly
    pub candidates: &'a crate::gpu::Buffer<Candidate>,
    /// ReadOnly
    pub fits: &'a crate::gpu::Buffer<Fit>,
    /// ReadOnly
    pub gains: &'a crate::gpu::Buffer<f32>,
    /// ReadWrite
    pub claims: &'a crate::gpu::Buffer<u32>,
    /// ReadWrite
    pub beaten: &'a crate::gpu::Buffer<u32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub views: &'a [View],
    /// ReadOnly
    pub plots: &'a [Plot],
    /// ReadOnly
    pub surface_depths: &'a [f32],
    /// ReadOnly
    pub candidates: &'a [Candidate],
    /// ReadOnly
    pub fits: &'a [Fit],
    /// ReadOnly
    pub gains: &'a [f32],
    /// ReadWrite
    pub claims: &'a mut [u32],
    /// ReadWrite
    pub beaten: &'a mut [u32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, check: call.constant(1) != 0, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, views: crate::gpu::next_binding(&mut bindings), plots: crate::gpu::next_binding(&mut bindings), surface_depths: crate::gpu::next_binding(&mut bindings), candidates: crate::gpu::next_binding(&mut bindings), fits: crate::gpu::next_binding(&mut bindings), gains: crate::gpu::next_binding(&mut bindings), claims: crate::gpu::next_binding(&mut bindings), beaten: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "pursuit_claim";
    const LABEL: &'static std::ffi::CStr = c"pursuit_claim";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/pursuit_claim.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/pursuit_claim.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"views", access: crate::gpu::Access::Read, element_bytes: size_of::<View>() as u32, floats: 0b100011111111111111111111111 },
        crate::gpu::Binding { name: c"plots", access: crate::gpu::Access::Read, element_bytes: size_of::<Plot>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"surface_depths", access: crate::gpu::Access::Read, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"candidates", access: crate::gpu::Access::Read, element_bytes: size_of::<Candidate>() as u32, floats: 0b11111111 },
        crate::gpu::Binding { name: c"fits", access: crate::gpu::Access::Read, element_bytes: size_of::<Fit>() as u32, floats: 0b111111111 },
        crate::gpu::Binding { name: c"gains", access: crate::gpu::Access::Read, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"claims", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"beaten", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"check", kind: crate::gpu::ConstantKind::Bool },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.check as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.views.raw(), b.plots.raw(), b.surface_depths.raw(), b.candidates.raw(), b.fits.raw(), b.gains.raw(), b.claims.raw(), b.beaten.raw()])
    }
}
}
/// `glsl/pursuit/pursuit_draw.comp`
pub mod pursuit_draw {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub count: u32,
    pub seed: u32,
    pub view_first: u32,
    pub view_end: u32,
    pub view_count: u32,
    pub block_first: u32,
    pub block_end: u32,
    pub total_index: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub views: &'a crate::gpu::Buffer<View>,
    /// ReadOnly
    pub plots: &'a crate::gpu::Buffer<Plot>,
    /// ReadOnly
    pub quanta_total: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub quanta_firsts: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub quanta: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub error_sums: &'a crate::gpu::Buffer<f32>,
    /// ReadOnly
    pub errors: &'a crate::gpu::Buffer<f32>,
    /// ReadOnly
    pub surface_depths: &'a crate::gpu::Buffer<f32>,
    /// WriteOnly
    pub candidates: &'a crate::gpu::Buffer<Candidate>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub views: &'a [View],
    /// ReadOnly
    pub plots: &'a [Plot],
    /// ReadOnly
    pub quanta_total: &'a [u32],
    /// ReadOnly
    pub quanta_firsts: &'a [u32],
    /// ReadOnly
    pub quanta: &'a [u32],
    /// ReadOnly
    pub error_sums: &'a [f32],
    /// ReadOnly
    pub errors: &'a [f32],
    /// ReadOnly
    pub surface_depths: &'a [f32],
    /// WriteOnly
    pub candidates: &'a mut [Candidate],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, views: crate::gpu::next_binding(&mut bindings), plots: crate::gpu::next_binding(&mut bindings), quanta_total: crate::gpu::next_binding(&mut bindings), quanta_firsts: crate::gpu::next_binding(&mut bindings), quanta: crate::gpu::next_binding(&mut bindings), error_sums: crate::gpu::next_binding(&mut bindings), errors: crate::gpu::next_binding(&mut bindings), surface_depths: crate::gpu::next_binding(&mut bindings), candidates: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "pursuit_draw";
    const LABEL: &'static std::ffi::CStr = c"pursuit_draw";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/pursuit_draw.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/pursuit_draw.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"views", access: crate::gpu::Access::Read, element_bytes: size_of::<View>() as u32, floats: 0b100011111111111111111111111 },
        crate::gpu::Binding { name: c"plots", access: crate::gpu::Access::Read, element_bytes: size_of::<Plot>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"quanta_total", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"quanta_firsts", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"quanta", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"error_sums", access: crate::gpu::Access::Read, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"errors", access: crate::gpu::Access::Read, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"surface_depths", access: crate::gpu::Access::Read, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"candidates", access: crate::gpu::Access::Write, element_bytes: size_of::<Candidate>() as u32, floats: 0b11111111 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.views.raw(), b.plots.raw(), b.quanta_total.raw(), b.quanta_firsts.raw(), b.quanta.raw(), b.error_sums.raw(), b.errors.raw(), b.surface_depths.raw(), b.candidates.raw()])
    }
}
}
/// `glsl/pursuit/pursuit_fit.comp`
pub mod pursuit_fit {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub first: u32,
    pub count: u32,
    pub sizes: u32,
    pub first_size: f32,
    pub size_ratio: f32,
    pub lobe_worth: f32,
    pub plain_worth: f32,
    pub lobe_price: u32,
    pub plain_price: u32,
    pub doubt: f32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub candidates: &'a crate::gpu::Buffer<Candidate>,
    /// ReadOnly
    pub sums: &'a crate::gpu::Buffer<f32>,
    /// WriteOnly
    pub fits: &'a crate::gpu::Buffer<Fit>,
    /// WriteOnly
    pub prices: &'a crate::gpu::Buffer<u32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub candidates: &'a [Candidate],
    /// ReadOnly
    pub sums: &'a [f32],
    /// WriteOnly
    pub fits: &'a mut [Fit],
    /// WriteOnly
    pub prices: &'a mut [u32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, candidates: crate::gpu::next_binding(&mut bindings), sums: crate::gpu::next_binding(&mut bindings), fits: crate::gpu::next_binding(&mut bindings), prices: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "pursuit_fit";
    const LABEL: &'static std::ffi::CStr = c"pursuit_fit";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/pursuit_fit.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/pursuit_fit.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"candidates", access: crate::gpu::Access::Read, element_bytes: size_of::<Candidate>() as u32, floats: 0b11111111 },
        crate::gpu::Binding { name: c"sums", access: crate::gpu::Access::Read, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"fits", access: crate::gpu::Access::Write, element_bytes: size_of::<Fit>() as u32, floats: 0b111111111 },
        crate::gpu::Binding { name: c"prices", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.candidates.raw(), b.sums.raw(), b.fits.raw(), b.prices.raw()])
    }
}
}
/// `glsl/pursuit/pursuit_gain.comp`
pub mod pursuit_gain {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub count: u32,
    pub view_first: u32,
    pub view_end: u32,
    pub begin: u32,
    pub last: u32,
    pub caution: f32,
    pub doubt: f32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub views: &'a crate::gpu::Buffer<View>,
    /// ReadOnly
    pub plots: &'a crate::gpu::Buffer<Plot>,
    /// ReadOnly
    pub surface_depths: &'a crate::gpu::Buffer<f32>,
    /// ReadOnly
    pub candidates: &'a crate::gpu::Buffer<Candidate>,
    /// ReadOnly
    pub texels: &'a crate::gpu::Buffer<Texel>,
    /// ReadOnly
    pub explained: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub fits: &'a crate::gpu::Buffer<Fit>,
    /// ReadOnly
    pub gain_keys: &'a crate::gpu::Buffer<u32>,
    /// ReadWrite
    pub gains: &'a crate::gpu::Buffer<f32>,
    /// ReadWrite
    pub gain_squares: &'a crate::gpu::Buffer<f32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub views: &'a [View],
    /// ReadOnly
    pub plots: &'a [Plot],
    /// ReadOnly
    pub surface_depths: &'a [f32],
    /// ReadOnly
    pub candidates: &'a [Candidate],
    /// ReadOnly
    pub texels: &'a [Texel],
    /// ReadOnly
    pub explained: &'a [u32],
    /// ReadOnly
    pub fits: &'a [Fit],
    /// ReadOnly
    pub gain_keys: &'a [u32],
    /// ReadWrite
    pub gains: &'a mut [f32],
    /// ReadWrite
    pub gain_squares: &'a mut [f32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, views: crate::gpu::next_binding(&mut bindings), plots: crate::gpu::next_binding(&mut bindings), surface_depths: crate::gpu::next_binding(&mut bindings), candidates: crate::gpu::next_binding(&mut bindings), texels: crate::gpu::next_binding(&mut bindings), explained: crate::gpu::next_binding(&mut bindings), fits: crate::gpu::next_binding(&mut bindings), gain_keys: crate::gpu::next_binding(&mut bindings), gains: crate::gpu::next_binding(&mut bindings), gain_squares: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "pursuit_gain";
    const LABEL: &'static std::ffi::CStr = c"pursuit_gain";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/pursuit_gain.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/pursuit_gain.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"views", access: crate::gpu::Access::Read, element_bytes: size_of::<View>() as u32, floats: 0b100011111111111111111111111 },
        crate::gpu::Binding { name: c"plots", access: crate::gpu::Access::Read, element_bytes: size_of::<Plot>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"surface_depths", access: crate::gpu::Access::Read, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"candidates", access: crate::gpu::Access::Read, element_bytes: size_of::<Candidate>() as u32, floats: 0b11111111 },
        crate::gpu::Binding { name: c"texels", access: crate::gpu::Access::Read, element_bytes: size_of::<Texel>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"explained", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"fits", access: crate::gpu::Access::Read, element_bytes: size_of::<Fit>() as u32, floats: 0b111111111 },
        crate::gpu::Binding { name: c"gain_keys", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"gains", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"gain_squares", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.views.raw(), b.plots.raw(), b.surface_depths.raw(), b.candidates.raw(), b.texels.raw(), b.explained.raw(), b.fits.raw(), b.gain_keys.raw(), b.gains.raw(), b.gain_squares.raw()])
    }
}
}
/// `glsl/pursuit/pursuit_place.comp`
pub mod pursuit_place {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub count: u32,
    pub most: u32,
    pub budget: u32,
    pub kept_index: u32,
    pub least_gain: f32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub kept: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub order: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub candidates: &'a crate::gpu::Buffer<Candidate>,
    /// ReadOnly
    pub fits: &'a crate::gpu::Buffer<Fit>,
    /// ReadOnly
    pub gain_keys: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub lifts: &'a crate::gpu::Buffer<Lift>,
    /// WriteOnly
    pub lift_flags: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub plain_flags: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub prices: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub spent: &'a crate::gpu::Buffer<u32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub kept: &'a [u32],
    /// ReadOnly
    pub order: &'a [u32],
    /// ReadOnly
    pub candidates: &'a [Candidate],
    /// ReadOnly
    pub fits: &'a [Fit],
    /// ReadOnly
    pub gain_keys: &'a [u32],
    /// WriteOnly
    pub lifts: &'a mut [Lift],
    /// WriteOnly
    pub lift_flags: &'a mut [u32],
    /// WriteOnly
    pub plain_flags: &'a mut [u32],
    /// ReadOnly
    pub prices: &'a [u32],
    /// ReadOnly
    pub spent: &'a [u32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, kept: crate::gpu::next_binding(&mut bindings), order: crate::gpu::next_binding(&mut bindings), candidates: crate::gpu::next_binding(&mut bindings), fits: crate::gpu::next_binding(&mut bindings), gain_keys: crate::gpu::next_binding(&mut bindings), lifts: crate::gpu::next_binding(&mut bindings), lift_flags: crate::gpu::next_binding(&mut bindings), plain_flags: crate::gpu::next_binding(&mut bindings), prices: crate::gpu::next_binding(&mut bindings), spent: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "pursuit_place";
    const LABEL: &'static std::ffi::CStr = c"pursuit_place";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/pursuit_place.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/pursuit_place.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"kept", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"order", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"candidates", access: crate::gpu::Access::Read, element_bytes: size_of::<Candidate>() as u32, floats: 0b11111111 },
        crate::gpu::Binding { name: c"fits", access: crate::gpu::Access::Read, element_bytes: size_of::<Fit>() as u32, floats: 0b111111111 },
        crate::gpu::Binding { name: c"gain_keys", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"lifts", access: crate::gpu::Access::Write, element_bytes: size_of::<Lift>() as u32, floats: 0b1111111111111111111 },
        crate::gpu::Binding { name: c"lift_flags", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"plain_flags", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"prices", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"spent", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.kept.raw(), b.order.raw(), b.candidates.raw(), b.fits.raw(), b.gain_keys.raw(), b.lifts.raw(), b.lift_flags.raw(), b.plain_flags.raw(), b.prices.raw(), b.spent.raw()])
    }
}
}
/// `glsl/pursuit/pursuit_quanta.comp`
pub mod pursuit_quanta {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub count: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub error_sums: &'a crate::gpu::Buffer<f32>,
    /// WriteOnly
    pub quanta: &'a crate::gpu::Buffer<u32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub error_sums: &'a [f32],
    /// WriteOnly
    pub quanta: &'a mut [u32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, error_sums: crate::gpu::next_binding(&mut bindings), quanta: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "pursuit_quanta";
    const LABEL: &'static std::ffi::CStr = c"pursuit_quanta";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/pursuit_quanta.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/pursuit_quanta.software.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"error_sums", access: crate::gpu::Access::Read, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"quanta", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Workgroup;
    const SUBGROUPS: bool = true;
    const BARRIERS: bool = true;
    const FEATURES: &'static [crate::gpu::Feature] = &[crate::gpu::Feature::ComputeFullSubgroups, crate::gpu::Feature::SubgroupSizeControl];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.error_sums.raw(), b.quanta.raw()])
    }
}
}
/// `glsl/pursuit/pursuit_residual.comp`
pub mod pursuit_residual {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub view: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub frames: &'a crate::gpu::Buffer<Frame>,
    /// ReadOnly
    pub plots: &'a crate::gpu::Buffer<Plot>,
    /// ReadOnly
    pub image: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadOnly
    pub targets: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub depths: &'a crate::gpu::Buffer<f32>,
    /// WriteOnly
    pub texels: &'a crate::gpu::Buffer<Texel>,
    /// WriteOnly
    pub surface_depths: &'a crate::gpu::Buffer<f32>,
    /// WriteOnly
    pub errors: &'a crate::gpu::Buffer<f32>,
    /// WriteOnly
    pub error_sums: &'a crate::gpu::Buffer<f32>,
    /// WriteOnly
    pub explained: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub squares: &'a crate::gpu::Buffer<f32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub frames: &'a [Frame],
    /// ReadOnly
    pub plots: &'a [Plot],
    /// ReadOnly
    pub image: &'a [[f32; 4]],
    /// ReadOnly
    pub targets: &'a [u32],
    /// ReadOnly
    pub depths: &'a [f32],
    /// WriteOnly
    pub texels: &'a mut [Texel],
    /// WriteOnly
    pub surface_depths: &'a mut [f32],
    /// WriteOnly
    pub errors: &'a mut [f32],
    /// WriteOnly
    pub error_sums: &'a mut [f32],
    /// WriteOnly
    pub explained: &'a mut [u32],
    /// WriteOnly
    pub squares: &'a mut [f32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, frames: crate::gpu::next_binding(&mut bindings), plots: crate::gpu::next_binding(&mut bindings), image: crate::gpu::next_binding(&mut bindings), targets: crate::gpu::next_binding(&mut bindings), depths: crate::gpu::next_binding(&mut bindings), texels: crate::gpu::next_binding(&mut bindings), surface_depths: crate::gpu::next_binding(&mut bindings), errors: crate::gpu::next_binding(&mut bindings), error_sums: crate::gpu::next_binding(&mut bindings), explained: crate::gpu::next_binding(&mut bindings), squares: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "pursuit_residual";
    const LABEL: &'static std::ffi::CStr = c"pursuit_residual";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/pursuit_residual.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/pursuit_residual.software.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"frames", access: crate::gpu::Access::Read, element_bytes: size_of::<Frame>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"plots", access: crate::gpu::Access::Read, element_bytes: size_of::<Plot>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"image", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"targets", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"depths", access: crate::gpu::Access::Read, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"texels", access: crate::gpu::Access::Write, element_bytes: size_of::<Texel>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"surface_depths", access: crate::gpu::Access::Write, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"errors", access: crate::gpu::Access::Write, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"error_sums", access: crate::gpu::Access::Write, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"explained", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"squares", access: crate::gpu::Access::Write, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Subgroup;
    const SUBGROUPS: bool = true;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[crate::gpu::Feature::ComputeFullSubgroups, crate::gpu::Feature::SubgroupSizeControl];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.frames.raw(), b.plots.raw(), b.image.raw(), b.targets.raw(), b.depths.raw(), b.texels.raw(), b.surface_depths.raw(), b.errors.raw(), b.error_sums.raw(), b.explained.raw(), b.squares.raw()])
    }
}
}
/// `glsl/pursuit/pursuit_score.comp`
pub mod pursuit_score {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub first: u32,
    pub count: u32,
    pub sizes: u32,
    pub first_size: f32,
    pub size_ratio: f32,
    pub view_first: u32,
    pub view_end: u32,
    pub begin: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub views: &'a crate::gpu::Buffer<View>,
    /// ReadOnly
    pub plots: &'a crate::gpu::Buffer<Plot>,
    /// ReadOnly
    pub surface_depths: &'a crate::gpu::Buffer<f32>,
    /// ReadOnly
    pub candidates: &'a crate::gpu::Buffer<Candidate>,
    /// ReadOnly
    pub texels: &'a crate::gpu::Buffer<Texel>,
    /// ReadWrite
    pub sums: &'a crate::gpu::Buffer<f32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub views: &'a [View],
    /// ReadOnly
    pub plots: &'a [Plot],
    /// ReadOnly
    pub surface_depths: &'a [f32],
    /// ReadOnly
    pub candidates: &'a [Candidate],
    /// ReadOnly
    pub texels: &'a [Texel],
    /// ReadWrite
    pub sums: &'a mut [f32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, views: crate::gpu::next_binding(&mut bindings), plots: crate::gpu::next_binding(&mut bindings), surface_depths: crate::gpu::next_binding(&mut bindings), candidates: crate::gpu::next_binding(&mut bindings), texels: crate::gpu::next_binding(&mut bindings), sums: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "pursuit_score";
    const LABEL: &'static std::ffi::CStr = c"pursuit_score";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/pursuit_score.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/pursuit_score.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"views", access: crate::gpu::Access::Read, element_bytes: size_of::<View>() as u32, floats: 0b100011111111111111111111111 },
        crate::gpu::Binding { name: c"plots", access: crate::gpu::Access::Read, element_bytes: size_of::<Plot>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"surface_depths", access: crate::gpu::Access::Read, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"candidates", access: crate::gpu::Access::Read, element_bytes: size_of::<Candidate>() as u32, floats: 0b11111111 },
        crate::gpu::Binding { name: c"texels", access: crate::gpu::Access::Read, element_bytes: size_of::<Texel>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"sums", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.views.raw(), b.plots.raw(), b.surface_depths.raw(), b.candidates.raw(), b.texels.raw(), b.sums.raw()])
    }
}
}
/// `glsl/raster/blend.comp`
pub mod blend {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub frame_first: u32,
    pub tiles_x: u32,
    pub tiles_per_frame: u32,
    pub tile_count: u32,
    pub background: [f32; 3],
    pub median_threshold: f32,
    pub depth_form: [f32; 2],
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub tile_width: u32,
    pub tile_height: u32,
    pub pixels: u32,
    pub unrolled: bool,
    pub background_image: bool,
    pub median: bool,
    pub occluded: bool,
    pub direct: bool,
    pub packed_splats: bool,
    pub listed: bool,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub frames: &'a crate::gpu::Buffer<Frame>,
    /// ReadOnly
    pub tile_ranges: &'a crate::gpu::Buffer<[u32; 2]>,
    /// ReadOnly
    pub isect_slots: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub rank_blocks: &'a crate::gpu::Buffer<[u32; 2]>,
    /// ReadOnly
    pub global_from_rank: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub splats: &'a crate::gpu::Buffer<Splat>,
    /// ReadOnly
    pub splat_colours: &'a crate::gpu::Buffer<[f32; 3]>,
    /// ReadOnly
    pub backdrop: &'a crate::gpu::Buffer<[f32; 4]>,
    /// WriteOnly
    pub image: &'a crate::gpu::Buffer<[f32; 4]>,
    /// WriteOnly
    pub median_ids: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub depth_keys: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub scene_depths: &'a crate::gpu::Buffer<f32>,
    /// ReadOnly
    pub packed_splats: &'a crate::gpu::Buffer<PackedSplat>,
    /// ReadOnly
    pub tile_list: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub tile_list_count: &'a crate::gpu::Buffer<u32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub frames: &'a [Frame],
    /// ReadOnly
    pub tile_ranges: &'a [[u32; 2]],
    /// ReadOnly
    pub isect_slots: &'a [u32],
    /// ReadOnly
    pub rank_blocks: &'a [[u32; 2]],
    /// ReadOnly
    pub global_from_rank: &'a [u32],
    /// ReadOnly
    pub splats: &'a [Splat],
    /// ReadOnly
    pub splat_colours: &'a [[f32; 3]],
    /// ReadOnly
    pub backdrop: &'a [[f32; 4]],
    /// WriteOnly
    pub image: &'a mut [[f32; 4]],
    /// WriteOnly
    pub median_ids: &'a mut [u32],
    /// ReadOnly
    pub depth_keys: &'a [u32],
    /// ReadOnly
    pub scene_depths: &'a [f32],
    /// ReadOnly
    pub packed_splats: &'a [PackedSplat],
    /// ReadOnly
    pub tile_list: &'a [u32],
    /// ReadOnly
    pub tile_list_count: &'a [u32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, tile_width: call.constant(1) as u32, tile_height: call.constant(2) as u32, pixels: call.constant(3) as u32, unrolled: call.constant(4) != 0, background_image: call.constant(5) != 0, median: call.constant(6) != 0, occluded: call.constant(7) != 0, direct: call.constant(8) != 0, packed_splats: call.constant(9) != 0, listed: call.constant(10) != 0, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, frames: crate::gpu::next_binding(&mut bindings), tile_ranges: crate::gpu::next_binding(&mut bindings), isect_slots: crate::gpu::next_binding(&mut bindings), rank_blocks: crate::gpu::next_binding(&mut bindings), global_from_rank: crate::gpu::next_binding(&mut bindings), splats: crate::gpu::next_binding(&mut bindings), splat_colours: crate::gpu::next_binding(&mut bindings), backdrop: crate::gpu::next_binding(&mut bindings), image: crate::gpu::next_binding(&mut bindings), median_ids: crate::gpu::next_binding(&mut bindings), depth_keys: crate::gpu::next_binding(&mut bindings), scene_depths: crate::gpu::next_binding(&mut bindings), packed_splats: crate::gpu::next_binding(&mut bindings), tile_list: crate::gpu::next_binding(&mut bindings), tile_list_count: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "blend";
    const LABEL: &'static std::ffi::CStr = c"blend";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/blend.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/blend.software.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"frames", access: crate::gpu::Access::Read, element_bytes: size_of::<Frame>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"tile_ranges", access: crate::gpu::Access::Read, element_bytes: size_of::<[u32; 2]>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"isect_slots", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"rank_blocks", access: crate::gpu::Access::Read, element_bytes: size_of::<[u32; 2]>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"global_from_rank", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"splats", access: crate::gpu::Access::Read, element_bytes: size_of::<Splat>() as u32, floats: 0b111111 },
        crate::gpu::Binding { name: c"splat_colours", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 3]>() as u32, floats: 0b111 },
        crate::gpu::Binding { name: c"backdrop", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"image", access: crate::gpu::Access::Write, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"median_ids", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"depth_keys", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"scene_depths", access: crate::gpu::Access::Read, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"packed_splats", access: crate::gpu::Access::Read, element_bytes: size_of::<PackedSplat>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"tile_list", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"tile_list_count", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"tile_width", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 2, name: c"tile_height", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 3, name: c"pixels", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 4, name: c"unrolled", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 5, name: c"background_image", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 6, name: c"median", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 7, name: c"occluded", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 8, name: c"direct", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 9, name: c"packed_splats", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 10, name: c"listed", kind: crate::gpu::ConstantKind::Bool },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Subgroup;
    const SUBGROUPS: bool = true;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[crate::gpu::Feature::ComputeFullSubgroups, crate::gpu::Feature::SubgroupBroadcastDynamicId, crate::gpu::Feature::SubgroupSizeControl];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.tile_width as u32), (2, spec.tile_height as u32), (3, spec.pixels as u32), (4, spec.unrolled as u32), (5, spec.background_image as u32), (6, spec.median as u32), (7, spec.occluded as u32), (8, spec.direct as u32), (9, spec.packed_splats as u32), (10, spec.listed as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.frames.raw(), b.tile_ranges.raw(), b.isect_slots.raw(), b.rank_blocks.raw(), b.global_from_rank.raw(), b.splats.raw(), b.splat_colours.raw(), b.backdrop.raw(), b.image.raw(), b.median_ids.raw(), b.depth_keys.raw(), b.scene_depths.raw(), b.packed_splats.raw(), b.tile_list.raw(), b.tile_list_count.raw()])
    }
}
}
/// `glsl/raster/blend_backward.comp`
pub mod blend_backward {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub frame_first: u32,
    pub tiles_x: u32,
    pub tiles_per_frame: u32,
    pub tile_count: u32,
    pub frozen: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub tile_width: u32,
    pub tile_height: u32,
    pub pixels: u32,
    pub unrolled: bool,
    pub scores: bool,
    pub listed: bool,
    pub packed_records: bool,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub frames: &'a crate::gpu::Buffer<Frame>,
    /// ReadOnly
    pub tile_ranges: &'a crate::gpu::Buffer<[u32; 2]>,
    /// ReadOnly
    pub isect_slots: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub rank_blocks: &'a crate::gpu::Buffer<[u32; 2]>,
    /// ReadOnly
    pub global_from_rank: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub splats: &'a crate::gpu::Buffer<Splat>,
    /// ReadOnly
    pub splat_colours: &'a crate::gpu::Buffer<[f32; 3]>,
    /// ReadOnly
    pub image: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadOnly
    pub image_grad: &'a crate::gpu::Buffer<f32>,
    /// ReadOnly
    pub population: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub tile_list: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub tile_list_count: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub record_centres: &'a crate::gpu::Buffer<[f32; 3]>,
    /// WriteOnly
    pub record_shapes: &'a crate::gpu::Buffer<[f32; 3]>,
    /// WriteOnly
    pub record_colours: &'a crate::gpu::Buffer<[f32; 3]>,
    /// WriteOnly
    pub record_words: &'a crate::gpu::Buffer<[u32; 4]>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub frames: &'a [Frame],
    /// ReadOnly
    pub tile_ranges: &'a [[u32; 2]],
    /// ReadOnly
    pub isect_slots: &'a [u32],
    /// ReadOnly
    pub rank_blocks: &'a [[u32; 2]],
    /// ReadOnly
    pub global_from_rank: &'a [u32],
    /// ReadOnly
    pub splats: &'a [Splat],
    /// ReadOnly
    pub splat_colours: &'a [[f32; 3]],
    /// ReadOnly
    pub image: &'a [[f32; 4]],
    /// ReadOnly
    pub image_grad: &'a [f32],
    /// ReadOnly
    pub population: &'a [u32],
    /// ReadOnly
    pub tile_list: &'a [u32],
    /// ReadOnly
    pub tile_list_count: &'a [u32],
    /// WriteOnly
    pub record_centres: &'a mut [[f32; 3]],
    /// WriteOnly
    pub record_shapes: &'a mut [[f32; 3]],
    /// WriteOnly
    pub record_colours: &'a mut [[f32; 3]],
    /// WriteOnly
    pub record_words: &'a mut [[u32; 4]],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, tile_width: call.constant(1) as u32, tile_height: call.constant(2) as u32, pixels: call.constant(3) as u32, unrolled: call.constant(4) != 0, scores: call.constant(5) != 0, listed: call.constant(10) != 0, packed_records: call.constant(11) != 0, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, frames: crate::gpu::next_binding(&mut bindings), tile_ranges: crate::gpu::next_binding(&mut bindings), isect_slots: crate::gpu::next_binding(&mut bindings), rank_blocks: crate::gpu::next_binding(&mut bindings), global_from_rank: crate::gpu::next_binding(&mut bindings), splats: crate::gpu::next_binding(&mut bindings), splat_colours: crate::gpu::next_binding(&mut bindings), image: crate::gpu::next_binding(&mut bindings), image_grad: crate::gpu::next_binding(&mut bindings), population: crate::gpu::next_binding(&mut bindings), tile_list: crate::gpu::next_binding(&mut bindings), tile_list_count: crate::gpu::next_binding(&mut bindings), record_centres: crate::gpu::next_binding(&mut bindings), record_shapes: crate::gpu::next_binding(&mut bindings), record_colours: crate::gpu::next_binding(&mut bindings), record_words: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "blend_backward";
    const LABEL: &'static std::ffi::CStr = c"blend_backward";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/blend_backward.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/blend_backward.software.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"frames", access: crate::gpu::Access::Read, element_bytes: size_of::<Frame>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"tile_ranges", access: crate::gpu::Access::Read, element_bytes: size_of::<[u32; 2]>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"isect_slots", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"rank_blocks", access: crate::gpu::Access::Read, element_bytes: size_of::<[u32; 2]>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"global_from_rank", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"splats", access: crate::gpu::Access::Read, element_bytes: size_of::<Splat>() as u32, floats: 0b111111 },
        crate::gpu::Binding { name: c"splat_colours", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 3]>() as u32, floats: 0b111 },
        crate::gpu::Binding { name: c"image", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"image_grad", access: crate::gpu::Access::Read, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"population", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"tile_list", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"tile_list_count", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"record_centres", access: crate::gpu::Access::Write, element_bytes: size_of::<[f32; 3]>() as u32, floats: 0b111 },
        crate::gpu::Binding { name: c"record_shapes", access: crate::gpu::Access::Write, element_bytes: size_of::<[f32; 3]>() as u32, floats: 0b111 },
        crate::gpu::Binding { name: c"record_colours", access: crate::gpu::Access::Write, element_bytes: size_of::<[f32; 3]>() as u32, floats: 0b111 },
        crate::gpu::Binding { name: c"record_words", access: crate::gpu::Access::Write, element_bytes: size_of::<[u32; 4]>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"tile_width", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 2, name: c"tile_height", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 3, name: c"pixels", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 4, name: c"unrolled", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 5, name: c"scores", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 10, name: c"listed", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 11, name: c"packed_records", kind: crate::gpu::ConstantKind::Bool },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Subgroup;
    const SUBGROUPS: bool = true;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[crate::gpu::Feature::ComputeFullSubgroups, crate::gpu::Feature::SubgroupBroadcastDynamicId, crate::gpu::Feature::SubgroupSizeControl];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.tile_width as u32), (2, spec.tile_height as u32), (3, spec.pixels as u32), (4, spec.unrolled as u32), (5, spec.scores as u32), (10, spec.listed as u32), (11, spec.packed_records as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.frames.raw(), b.tile_ranges.raw(), b.isect_slots.raw(), b.rank_blocks.raw(), b.global_from_rank.raw(), b.splats.raw(), b.splat_colours.raw(), b.image.raw(), b.image_grad.raw(), b.population.raw(), b.tile_list.raw(), b.tile_list_count.raw(), b.record_centres.raw(), b.record_shapes.raw(), b.record_colours.raw(), b.record_words.raw()])
    }
}
}
/// `glsl/raster/blend_backward_atomic.comp`
pub mod blend_backward_atomic {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub frame_first: u32,
    pub tiles_x: u32,
    pub tiles_per_frame: u32,
    pub tile_count: u32,
    pub frozen: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub tile_width: u32,
    pub tile_height: u32,
    pub pixels: u32,
    pub unrolled: bool,
    pub scores: bool,
    pub listed: bool,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub frames: &'a crate::gpu::Buffer<Frame>,
    /// ReadOnly
    pub tile_ranges: &'a crate::gpu::Buffer<[u32; 2]>,
    /// ReadOnly
    pub isect_slots: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub rank_blocks: &'a crate::gpu::Buffer<[u32; 2]>,
    /// ReadOnly
    pub global_from_rank: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub splats: &'a crate::gpu::Buffer<Splat>,
    /// ReadOnly
    pub splat_colours: &'a crate::gpu::Buffer<[f32; 3]>,
    /// ReadOnly
    pub image: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadOnly
    pub image_grad: &'a crate::gpu::Buffer<f32>,
    /// ReadOnly
    pub population: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub tile_list: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub tile_list_count: &'a crate::gpu::Buffer<u32>,
    /// ReadWrite
    pub record_centres: &'a crate::gpu::Buffer<[f32; 3]>,
    /// ReadWrite
    pub record_shapes: &'a crate::gpu::Buffer<[f32; 3]>,
    /// ReadWrite
    pub record_colours: &'a crate::gpu::Buffer<[f32; 3]>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub frames: &'a [Frame],
    /// ReadOnly
    pub tile_ranges: &'a [[u32; 2]],
    /// ReadOnly
    pub isect_slots: &'a [u32],
    /// ReadOnly
    pub rank_blocks: &'a [[u32; 2]],
    /// ReadOnly
    pub global_from_rank: &'a [u32],
    /// ReadOnly
    pub splats: &'a [Splat],
    /// ReadOnly
    pub splat_colours: &'a [[f32; 3]],
    /// ReadOnly
    pub image: &'a [[f32; 4]],
    /// ReadOnly
    pub image_grad: &'a [f32],
    /// ReadOnly
    pub population: &'a [u32],
    /// ReadOnly
    pub tile_list: &'a [u32],
    /// ReadOnly
    pub tile_list_count: &'a [u32],
    /// ReadWrite
    pub record_centres: &'a mut [[f32; 3]],
    /// ReadWrite
    pub record_shapes: &'a mut [[f32; 3]],
    /// ReadWrite
    pub record_colours: &'a mut [[f32; 3]],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, tile_width: call.constant(1) as u32, tile_height: call.constant(2) as u32, pixels: call.constant(3) as u32, unrolled: call.constant(4) != 0, scores: call.constant(5) != 0, listed: call.constant(10) != 0, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, frames: crate::gpu::next_binding(&mut bindings), tile_ranges: crate::gpu::next_binding(&mut bindings), isect_slots: crate::gpu::next_binding(&mut bindings), rank_blocks: crate::gpu::next_binding(&mut bindings), global_from_rank: crate::gpu::next_binding(&mut bindings), splats: crate::gpu::next_binding(&mut bindings), splat_colours: crate::gpu::next_binding(&mut bindings), image: crate::gpu::next_binding(&mut bindings), image_grad: crate::gpu::next_binding(&mut bindings), population: crate::gpu::next_binding(&mut bindings), tile_list: crate::gpu::next_binding(&mut bindings), tile_list_count: crate::gpu::next_binding(&mut bindings), record_centres: crate::gpu::next_binding(&mut bindings), record_shapes: crate::gpu::next_binding(&mut bindings), record_colours: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "blend_backward_atomic";
    const LABEL: &'static std::ffi::CStr = c"blend_backward_atomic";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/blend_backward_atomic.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/blend_backward_atomic.software.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"frames", access: crate::gpu::Access::Read, element_bytes: size_of::<Frame>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"tile_ranges", access: crate::gpu::Access::Read, element_bytes: size_of::<[u32; 2]>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"isect_slots", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"rank_blocks", access: crate::gpu::Access::Read, element_bytes: size_of::<[u32; 2]>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"global_from_rank", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"splats", access: crate::gpu::Access::Read, element_bytes: size_of::<Splat>() as u32, floats: 0b111111 },
        crate::gpu::Binding { name: c"splat_colours", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 3]>() as u32, floats: 0b111 },
        crate::gpu::Binding { name: c"image", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"image_grad", access: crate::gpu::Access::Read, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"population", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"tile_list", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"tile_list_count", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"record_centres", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<[f32; 3]>() as u32, floats: 0b111 },
        crate::gpu::Binding { name: c"record_shapes", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<[f32; 3]>() as u32, floats: 0b111 },
        crate::gpu::Binding { name: c"record_colours", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<[f32; 3]>() as u32, floats: 0b111 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"tile_width", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 2, name: c"tile_height", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 3, name: c"pixels", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 4, name: c"unrolled", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 5, name: c"scores", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 10, name: c"listed", kind: crate::gpu::ConstantKind::Bool },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Subgroup;
    const SUBGROUPS: bool = true;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[crate::gpu::Feature::ComputeFullSubgroups, crate::gpu::Feature::ShaderBufferFloat32AtomicAdd, crate::gpu::Feature::SubgroupBroadcastDynamicId, crate::gpu::Feature::SubgroupSizeControl];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.tile_width as u32), (2, spec.tile_height as u32), (3, spec.pixels as u32), (4, spec.unrolled as u32), (5, spec.scores as u32), (10, spec.listed as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.frames.raw(), b.tile_ranges.raw(), b.isect_slots.raw(), b.rank_blocks.raw(), b.global_from_rank.raw(), b.splats.raw(), b.splat_colours.raw(), b.image.raw(), b.image_grad.raw(), b.population.raw(), b.tile_list.raw(), b.tile_list_count.raw(), b.record_centres.raw(), b.record_shapes.raw(), b.record_colours.raw()])
    }
}
}
/// `glsl/raster/emit.comp`
pub mod emit {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub frame_first: u32,
    pub tiles_x: u32,
    pub tiles_per_frame: u32,
    pub capacity: u32,
    pub count_index: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub tile_width: u32,
    pub tile_height: u32,
    pub batch: bool,
    pub direct: bool,
    pub packed_splats: bool,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub frames: &'a crate::gpu::Buffer<Frame>,
    /// ReadOnly
    pub count: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub global_from_rank: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub rank_first_slot: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub splats: &'a crate::gpu::Buffer<Splat>,
    /// ReadOnly
    pub tile_counts: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub splat_frames: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub isect_tiles: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub isect_globals: &'a crate::gpu::Buffer<u32>,
    /// ReadWrite
    pub rank_blocks: &'a crate::gpu::Buffer<[u32; 2]>,
    /// WriteOnly
    pub first_slot: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub packed_splats: &'a crate::gpu::Buffer<PackedSplat>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub frames: &'a [Frame],
    /// ReadOnly
    pub count: &'a [u32],
    /// ReadOnly
    pub global_from_rank: &'a [u32],
    /// ReadOnly
    pub rank_first_slot: &'a [u32],
    /// ReadOnly
    pub splats: &'a [Splat],
    /// ReadOnly
    pub tile_counts: &'a [u32],
    /// ReadOnly
    pub splat_frames: &'a [u32],
    /// WriteOnly
    pub isect_tiles: &'a mut [u32],
    /// WriteOnly
    pub isect_globals: &'a mut [u32],
    /// ReadWrite
    pub rank_blocks: &'a mut [[u32; 2]],
    /// WriteOnly
    pub first_slot: &'a mut [u32],
    /// ReadOnly
    pub packed_splats: &'a [PackedSplat],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, tile_width: call.constant(1) as u32, tile_height: call.constant(2) as u32, batch: call.constant(3) != 0, direct: call.constant(4) != 0, packed_splats: call.constant(5) != 0, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, frames: crate::gpu::next_binding(&mut bindings), count: crate::gpu::next_binding(&mut bindings), global_from_rank: crate::gpu::next_binding(&mut bindings), rank_first_slot: crate::gpu::next_binding(&mut bindings), splats: crate::gpu::next_binding(&mut bindings), tile_counts: crate::gpu::next_binding(&mut bindings), splat_frames: crate::gpu::next_binding(&mut bindings), isect_tiles: crate::gpu::next_binding(&mut bindings), isect_globals: crate::gpu::next_binding(&mut bindings), rank_blocks: crate::gpu::next_binding(&mut bindings), first_slot: crate::gpu::next_binding(&mut bindings), packed_splats: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "emit";
    const LABEL: &'static std::ffi::CStr = c"emit";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/emit.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/emit.software.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"frames", access: crate::gpu::Access::Read, element_bytes: size_of::<Frame>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"count", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"global_from_rank", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"rank_first_slot", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"splats", access: crate::gpu::Access::Read, element_bytes: size_of::<Splat>() as u32, floats: 0b111111 },
        crate::gpu::Binding { name: c"tile_counts", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"splat_frames", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"isect_tiles", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"isect_globals", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"rank_blocks", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<[u32; 2]>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"first_slot", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"packed_splats", access: crate::gpu::Access::Read, element_bytes: size_of::<PackedSplat>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"tile_width", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 2, name: c"tile_height", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 3, name: c"batch", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 4, name: c"direct", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 5, name: c"packed_splats", kind: crate::gpu::ConstantKind::Bool },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = true;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[crate::gpu::Feature::ComputeFullSubgroups, crate::gpu::Feature::SubgroupSizeControl];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.tile_width as u32), (2, spec.tile_height as u32), (3, spec.batch as u32), (4, spec.direct as u32), (5, spec.packed_splats as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.frames.raw(), b.count.raw(), b.global_from_rank.raw(), b.rank_first_slot.raw(), b.splats.raw(), b.tile_counts.raw(), b.splat_frames.raw(), b.isect_tiles.raw(), b.isect_globals.raw(), b.rank_blocks.raw(), b.first_slot.raw(), b.packed_splats.raw()])
    }
}
}
/// `glsl/raster/median_depth.comp`
pub mod median_depth {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub segment: u32,
    pub page_first: u32,
    pub stride: u32,
    pub view: u32,
    pub depth_first: u32,
    pub splat_first: u32,
    pub scale: f32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub centre: bool,
    pub half_width: bool,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub population: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub views: &'a crate::gpu::Buffer<View>,
    /// ReadOnly
    pub geometry: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadOnly
    pub median_ids: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub depths: &'a crate::gpu::Buffer<f32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub population: &'a [u32],
    /// ReadOnly
    pub views: &'a [View],
    /// ReadOnly
    pub geometry: &'a [[f32; 4]],
    /// ReadOnly
    pub median_ids: &'a [u32],
    /// WriteOnly
    pub depths: &'a mut [f32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, centre: call.constant(1) != 0, half_width: call.constant(11) != 0, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, population: crate::gpu::next_binding(&mut bindings), views: crate::gpu::next_binding(&mut bindings), geometry: crate::gpu::next_binding(&mut bindings), median_ids: crate::gpu::next_binding(&mut bindings), depths: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "median_depth";
    const LABEL: &'static std::ffi::CStr = c"median_depth";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/median_depth.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/median_depth.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"population", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"views", access: crate::gpu::Access::Read, element_bytes: size_of::<View>() as u32, floats: 0b100011111111111111111111111 },
        crate::gpu::Binding { name: c"geometry", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"median_ids", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"depths", access: crate::gpu::Access::Write, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"centre", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 11, name: c"half_width", kind: crate::gpu::ConstantKind::Bool },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.centre as u32), (11, spec.half_width as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.population.raw(), b.views.raw(), b.geometry.raw(), b.median_ids.raw(), b.depths.raw()])
    }
}
}
/// `glsl/raster/project.comp`
pub mod project {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub segment: u32,
    pub page_first: u32,
    pub stride: u32,
    pub view: u32,
    pub splat_first: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub tile_width: u32,
    pub tile_height: u32,
    pub compensate: bool,
    pub has_lobes: bool,
    pub sh_degree: u32,
    pub half_width: bool,
    pub packed_splats: bool,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub population: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub views: &'a crate::gpu::Buffer<View>,
    /// ReadOnly
    pub geometry: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadOnly
    pub sh: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadOnly
    pub lobes: &'a crate::gpu::Buffer<[f32; 4]>,
    /// WriteOnly
    pub splats: &'a crate::gpu::Buffer<Splat>,
    /// WriteOnly
    pub splat_colours: &'a crate::gpu::Buffer<[f32; 3]>,
    /// WriteOnly
    pub depth_keys: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub tile_counts: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub packed_splats: &'a crate::gpu::Buffer<PackedSplat>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub population: &'a [u32],
    /// ReadOnly
    pub views: &'a [View],
    /// ReadOnly
    pub geometry: &'a [[f32; 4]],
    /// ReadOnly
    pub sh: &'a [[f32; 4]],
    /// ReadOnly
    pub lobes: &'a [[f32; 4]],
    /// WriteOnly
    pub splats: &'a mut [Splat],
    /// WriteOnly
    pub splat_colours: &'a mut [[f32; 3]],
    /// WriteOnly
    pub depth_keys: &'a mut [u32],
    /// WriteOnly
    pub tile_counts: &'a mut [u32],
    /// WriteOnly
    pub packed_splats: &'a mut [PackedSplat],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, tile_width: call.constant(1) as u32, tile_height: call.constant(2) as u32, compensate: call.constant(3) != 0, has_lobes: call.constant(4) != 0, sh_degree: call.constant(10) as u32, half_width: call.constant(11) != 0, packed_splats: call.constant(12) != 0, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, population: crate::gpu::next_binding(&mut bindings), views: crate::gpu::next_binding(&mut bindings), geometry: crate::gpu::next_binding(&mut bindings), sh: crate::gpu::next_binding(&mut bindings), lobes: crate::gpu::next_binding(&mut bindings), splats: crate::gpu::next_binding(&mut bindings), splat_colours: crate::gpu::next_binding(&mut bindings), depth_keys: crate::gpu::next_binding(&mut bindings), tile_counts: crate::gpu::next_binding(&mut bindings), packed_splats: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "project";
    const LABEL: &'static std::ffi::CStr = c"project";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/project.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/project.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"population", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"views", access: crate::gpu::Access::Read, element_bytes: size_of::<View>() as u32, floats: 0b100011111111111111111111111 },
        crate::gpu::Binding { name: c"geometry", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"sh", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"lobes", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"splats", access: crate::gpu::Access::Write, element_bytes: size_of::<Splat>() as u32, floats: 0b111111 },
        crate::gpu::Binding { name: c"splat_colours", access: crate::gpu::Access::Write, element_bytes: size_of::<[f32; 3]>() as u32, floats: 0b111 },
        crate::gpu::Binding { name: c"depth_keys", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"tile_counts", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"packed_splats", access: crate::gpu::Access::Write, element_bytes: size_of::<PackedSplat>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"tile_width", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 2, name: c"tile_height", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 3, name: c"compensate", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 4, name: c"has_lobes", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 10, name: c"sh_degree", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 11, name: c"half_width", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 12, name: c"packed_splats", kind: crate::gpu::ConstantKind::Bool },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.tile_width as u32), (2, spec.tile_height as u32), (3, spec.compensate as u32), (4, spec.has_lobes as u32), (10, spec.sh_degree as u32), (11, spec.half_width as u32), (12, spec.packed_splats as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.population.raw(), b.views.raw(), b.geometry.raw(), b.sh.raw(), b.lobes.raw(), b.splats.raw(), b.splat_colours.raw(), b.depth_keys.raw(), b.tile_counts.raw(), b.packed_splats.raw()])
    }
}
}
/// `glsl/raster/resolve.comp`
pub mod resolve {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub pixels: u32,
    pub format: u32,
    pub blend: u32,
    pub linear: u32,
    pub depth: u32,
    pub exposure: f32,
    pub depth_form: [f32; 2],
    pub background: [f32; 3],
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub curves: bool,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub image: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadOnly
    pub depths: &'a crate::gpu::Buffer<f32>,
    /// ReadWrite
    pub target: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub depth_target: &'a crate::gpu::Buffer<f32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub image: &'a [[f32; 4]],
    /// ReadOnly
    pub depths: &'a [f32],
    /// ReadWrite
    pub target: &'a mut [u32],
    /// WriteOnly
    pub depth_target: &'a mut [f32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, curves: call.constant(1) != 0, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, image: crate::gpu::next_binding(&mut bindings), depths: crate::gpu::next_binding(&mut bindings), target: crate::gpu::next_binding(&mut bindings), depth_target: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "resolve";
    const LABEL: &'static std::ffi::CStr = c"resolve";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/resolve.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/resolve.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"image", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"depths", access: crate::gpu::Access::Read, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"target", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"depth_target", access: crate::gpu::Access::Write, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"curves", kind: crate::gpu::ConstantKind::Bool },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.curves as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.image.raw(), b.depths.raw(), b.target.raw(), b.depth_target.raw()])
    }
}
}
/// `glsl/raster/tile_ranges.comp`
pub mod tile_ranges {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub count_index: u32,
    pub tile_count: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub listed: bool,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub count: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub isect_tiles: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub tile_ranges: &'a crate::gpu::Buffer<[u32; 2]>,
    /// ReadWrite
    pub tile_drawn: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub tile_list: &'a crate::gpu::Buffer<u32>,
    /// ReadWrite
    pub tile_list_count: &'a crate::gpu::Buffer<u32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub count: &'a [u32],
    /// ReadOnly
    pub isect_tiles: &'a [u32],
    /// WriteOnly
    pub tile_ranges: &'a mut [[u32; 2]],
    /// ReadWrite
    pub tile_drawn: &'a mut [u32],
    /// WriteOnly
    pub tile_list: &'a mut [u32],
    /// ReadWrite
    pub tile_list_count: &'a mut [u32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, listed: call.constant(1) != 0, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, count: crate::gpu::next_binding(&mut bindings), isect_tiles: crate::gpu::next_binding(&mut bindings), tile_ranges: crate::gpu::next_binding(&mut bindings), tile_drawn: crate::gpu::next_binding(&mut bindings), tile_list: crate::gpu::next_binding(&mut bindings), tile_list_count: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "tile_ranges";
    const LABEL: &'static std::ffi::CStr = c"tile_ranges";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/tile_ranges.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/tile_ranges.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"count", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"isect_tiles", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"tile_ranges", access: crate::gpu::Access::Write, element_bytes: size_of::<[u32; 2]>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"tile_drawn", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"tile_list", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"tile_list_count", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"listed", kind: crate::gpu::ConstantKind::Bool },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.listed as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.count.raw(), b.isect_tiles.raw(), b.tile_ranges.raw(), b.tile_drawn.raw(), b.tile_list.raw(), b.tile_list_count.raw()])
    }
}
}
/// `glsl/screen/screen_backward.comp`
pub mod screen_backward {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub count: u32,
    pub stride: u32,
    pub by_gaussian: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub gradients: bool,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub status: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub frames: &'a crate::gpu::Buffer<Frame>,
    /// ReadOnly
    pub screen_frames: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub screen_states: &'a crate::gpu::Buffer<ScreenState>,
    /// ReadOnly
    pub tile_counts: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub first_slot: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub record_centres: &'a crate::gpu::Buffer<[f32; 3]>,
    /// ReadOnly
    pub record_shapes: &'a crate::gpu::Buffer<[f32; 3]>,
    /// ReadOnly
    pub record_colours: &'a crate::gpu::Buffer<[f32; 3]>,
    /// ReadWrite
    pub screen_planes: &'a crate::gpu::Buffer<f32>,
    /// ReadWrite
    pub screen_ages: &'a crate::gpu::Buffer<u32>,
    /// ReadWrite
    pub screen_moments: &'a crate::gpu::Buffer<f32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub status: &'a [u32],
    /// ReadOnly
    pub frames: &'a [Frame],
    /// ReadOnly
    pub screen_frames: &'a [u32],
    /// ReadOnly
    pub screen_states: &'a [ScreenState],
    /// ReadOnly
    pub tile_counts: &'a [u32],
    /// ReadOnly
    pub first_slot: &'a [u32],
    /// ReadOnly
    pub record_centres: &'a [[f32; 3]],
    /// ReadOnly
    pub record_shapes: &'a [[f32; 3]],
    /// ReadOnly
    pub record_colours: &'a [[f32; 3]],
    /// ReadWrite
    pub screen_planes: &'a mut [f32],
    /// ReadWrite
    pub screen_ages: &'a mut [u32],
    /// ReadWrite
    pub screen_moments: &'a mut [f32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, gradients: call.constant(1) != 0, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, status: crate::gpu::next_binding(&mut bindings), frames: crate::gpu::next_binding(&mut bindings), screen_frames: crate::gpu::next_binding(&mut bindings), screen_states: crate::gpu::next_binding(&mut bindings), tile_counts: crate::gpu::next_binding(&mut bindings), first_slot: crate::gpu::next_binding(&mut bindings), record_centres: crate::gpu::next_binding(&mut bindings), record_shapes: crate::gpu::next_binding(&mut bindings), record_colours: crate::gpu::next_binding(&mut bindings), screen_planes: crate::gpu::next_binding(&mut bindings), screen_ages: crate::gpu::next_binding(&mut bindings), screen_moments: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "screen_backward";
    const LABEL: &'static std::ffi::CStr = c"screen_backward";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/screen_backward.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/screen_backward.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"status", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"frames", access: crate::gpu::Access::Read, element_bytes: size_of::<Frame>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"screen_frames", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"screen_states", access: crate::gpu::Access::Read, element_bytes: size_of::<ScreenState>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"tile_counts", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"first_slot", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"record_centres", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 3]>() as u32, floats: 0b111 },
        crate::gpu::Binding { name: c"record_shapes", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 3]>() as u32, floats: 0b111 },
        crate::gpu::Binding { name: c"record_colours", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 3]>() as u32, floats: 0b111 },
        crate::gpu::Binding { name: c"screen_planes", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"screen_ages", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"screen_moments", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"gradients", kind: crate::gpu::ConstantKind::Bool },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.gradients as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.status.raw(), b.frames.raw(), b.screen_frames.raw(), b.screen_states.raw(), b.tile_counts.raw(), b.first_slot.raw(), b.record_centres.raw(), b.record_shapes.raw(), b.record_colours.raw(), b.screen_planes.raw(), b.screen_ages.raw(), b.screen_moments.raw()])
    }
}
}
/// `glsl/screen/screen_draw.comp`
pub mod screen_draw {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub frame_count: u32,
    pub stride: u32,
    pub round: u32,
    pub seed: u32,
    pub age: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub status: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub frames: &'a crate::gpu::Buffer<Frame>,
    /// ReadOnly
    pub quotas: &'a crate::gpu::Buffer<Quota>,
    /// ReadOnly
    pub loss_map: &'a crate::gpu::Buffer<f32>,
    /// ReadOnly
    pub image: &'a crate::gpu::Buffer<[f32; 4]>,
    /// ReadWrite
    pub drawn_pixels: &'a crate::gpu::Buffer<u32>,
    /// ReadWrite
    pub screen_states: &'a crate::gpu::Buffer<ScreenState>,
    /// ReadWrite
    pub screen_frames: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub screen_planes: &'a crate::gpu::Buffer<f32>,
    /// WriteOnly
    pub screen_ages: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub screen_moments: &'a crate::gpu::Buffer<f32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub status: &'a [u32],
    /// ReadOnly
    pub frames: &'a [Frame],
    /// ReadOnly
    pub quotas: &'a [Quota],
    /// ReadOnly
    pub loss_map: &'a [f32],
    /// ReadOnly
    pub image: &'a [[f32; 4]],
    /// ReadWrite
    pub drawn_pixels: &'a mut [u32],
    /// ReadWrite
    pub screen_states: &'a mut [ScreenState],
    /// ReadWrite
    pub screen_frames: &'a mut [u32],
    /// WriteOnly
    pub screen_planes: &'a mut [f32],
    /// WriteOnly
    pub screen_ages: &'a mut [u32],
    /// WriteOnly
    pub screen_moments: &'a mut [f32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, status: crate::gpu::next_binding(&mut bindings), frames: crate::gpu::next_binding(&mut bindings), quotas: crate::gpu::next_binding(&mut bindings), loss_map: crate::gpu::next_binding(&mut bindings), image: crate::gpu::next_binding(&mut bindings), drawn_pixels: crate::gpu::next_binding(&mut bindings), screen_states: crate::gpu::next_binding(&mut bindings), screen_frames: crate::gpu::next_binding(&mut bindings), screen_planes: crate::gpu::next_binding(&mut bindings), screen_ages: crate::gpu::next_binding(&mut bindings), screen_moments: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "screen_draw";
    const LABEL: &'static std::ffi::CStr = c"screen_draw";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/screen_draw.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/screen_draw.software.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"status", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"frames", access: crate::gpu::Access::Read, element_bytes: size_of::<Frame>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"quotas", access: crate::gpu::Access::Read, element_bytes: size_of::<Quota>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"loss_map", access: crate::gpu::Access::Read, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"image", access: crate::gpu::Access::Read, element_bytes: size_of::<[f32; 4]>() as u32, floats: 0b1111 },
        crate::gpu::Binding { name: c"drawn_pixels", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"screen_states", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<ScreenState>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"screen_frames", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"screen_planes", access: crate::gpu::Access::Write, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"screen_ages", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"screen_moments", access: crate::gpu::Access::Write, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Workgroup;
    const SUBGROUPS: bool = true;
    const BARRIERS: bool = true;
    const FEATURES: &'static [crate::gpu::Feature] = &[crate::gpu::Feature::ComputeFullSubgroups, crate::gpu::Feature::SubgroupSizeControl];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.status.raw(), b.frames.raw(), b.quotas.raw(), b.loss_map.raw(), b.image.raw(), b.drawn_pixels.raw(), b.screen_states.raw(), b.screen_frames.raw(), b.screen_planes.raw(), b.screen_ages.raw(), b.screen_moments.raw()])
    }
}
}
/// `glsl/screen/screen_project.comp`
pub mod screen_project {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub count: u32,
    pub stride: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub tile_width: u32,
    pub tile_height: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub frames: &'a crate::gpu::Buffer<Frame>,
    /// ReadOnly
    pub screen_frames: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub screen_states: &'a crate::gpu::Buffer<ScreenState>,
    /// ReadOnly
    pub depths: &'a crate::gpu::Buffer<f32>,
    /// ReadWrite
    pub screen_planes: &'a crate::gpu::Buffer<f32>,
    /// WriteOnly
    pub splats: &'a crate::gpu::Buffer<Splat>,
    /// WriteOnly
    pub splat_colours: &'a crate::gpu::Buffer<[f32; 3]>,
    /// WriteOnly
    pub depth_keys: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub tile_counts: &'a crate::gpu::Buffer<u32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub frames: &'a [Frame],
    /// ReadOnly
    pub screen_frames: &'a [u32],
    /// ReadOnly
    pub screen_states: &'a [ScreenState],
    /// ReadOnly
    pub depths: &'a [f32],
    /// ReadWrite
    pub screen_planes: &'a mut [f32],
    /// WriteOnly
    pub splats: &'a mut [Splat],
    /// WriteOnly
    pub splat_colours: &'a mut [[f32; 3]],
    /// WriteOnly
    pub depth_keys: &'a mut [u32],
    /// WriteOnly
    pub tile_counts: &'a mut [u32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, tile_width: call.constant(1) as u32, tile_height: call.constant(2) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, frames: crate::gpu::next_binding(&mut bindings), screen_frames: crate::gpu::next_binding(&mut bindings), screen_states: crate::gpu::next_binding(&mut bindings), depths: crate::gpu::next_binding(&mut bindings), screen_planes: crate::gpu::next_binding(&mut bindings), splats: crate::gpu::next_binding(&mut bindings), splat_colours: crate::gpu::next_binding(&mut bindings), depth_keys: crate::gpu::next_binding(&mut bindings), tile_counts: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "screen_project";
    const LABEL: &'static std::ffi::CStr = c"screen_project";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/screen_project.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/screen_project.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"frames", access: crate::gpu::Access::Read, element_bytes: size_of::<Frame>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"screen_frames", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"screen_states", access: crate::gpu::Access::Read, element_bytes: size_of::<ScreenState>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"depths", access: crate::gpu::Access::Read, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"screen_planes", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"splats", access: crate::gpu::Access::Write, element_bytes: size_of::<Splat>() as u32, floats: 0b111111 },
        crate::gpu::Binding { name: c"splat_colours", access: crate::gpu::Access::Write, element_bytes: size_of::<[f32; 3]>() as u32, floats: 0b111 },
        crate::gpu::Binding { name: c"depth_keys", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"tile_counts", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"tile_width", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 2, name: c"tile_height", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.tile_width as u32), (2, spec.tile_height as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.frames.raw(), b.screen_frames.raw(), b.screen_states.raw(), b.depths.raw(), b.screen_planes.raw(), b.splats.raw(), b.splat_colours.raw(), b.depth_keys.raw(), b.tile_counts.raw()])
    }
}
}
/// `glsl/screen/screen_prune.comp`
pub mod screen_prune {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub count: u32,
    pub stride: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub status: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub frames: &'a crate::gpu::Buffer<Frame>,
    /// ReadOnly
    pub screen_states: &'a crate::gpu::Buffer<ScreenState>,
    /// ReadOnly
    pub screen_planes: &'a crate::gpu::Buffer<f32>,
    /// ReadWrite
    pub screen_frames: &'a crate::gpu::Buffer<u32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub status: &'a [u32],
    /// ReadOnly
    pub frames: &'a [Frame],
    /// ReadOnly
    pub screen_states: &'a [ScreenState],
    /// ReadOnly
    pub screen_planes: &'a [f32],
    /// ReadWrite
    pub screen_frames: &'a mut [u32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, status: crate::gpu::next_binding(&mut bindings), frames: crate::gpu::next_binding(&mut bindings), screen_states: crate::gpu::next_binding(&mut bindings), screen_planes: crate::gpu::next_binding(&mut bindings), screen_frames: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "screen_prune";
    const LABEL: &'static std::ffi::CStr = c"screen_prune";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/screen_prune.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/screen_prune.software.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"status", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"frames", access: crate::gpu::Access::Read, element_bytes: size_of::<Frame>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"screen_states", access: crate::gpu::Access::Read, element_bytes: size_of::<ScreenState>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"screen_planes", access: crate::gpu::Access::Read, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
        crate::gpu::Binding { name: c"screen_frames", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Subgroup;
    const SUBGROUPS: bool = true;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[crate::gpu::Feature::ComputeFullSubgroups, crate::gpu::Feature::SubgroupSizeControl];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.status.raw(), b.frames.raw(), b.screen_states.raw(), b.screen_planes.raw(), b.screen_frames.raw()])
    }
}
}
/// `glsl/screen/screen_tiles.comp`
pub mod screen_tiles {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub count: u32,
    pub tiles_per_frame: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub tile: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub frames: &'a crate::gpu::Buffer<Frame>,
    /// ReadOnly
    pub screen_frames: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub tile_counts: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub splats: &'a crate::gpu::Buffer<Splat>,
    /// ReadWrite
    pub tile_marks: &'a crate::gpu::Buffer<u32>,
    /// ReadWrite
    pub count: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub forward_tiles: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub backward_tiles: &'a crate::gpu::Buffer<u32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub frames: &'a [Frame],
    /// ReadOnly
    pub screen_frames: &'a [u32],
    /// ReadOnly
    pub tile_counts: &'a [u32],
    /// ReadOnly
    pub splats: &'a [Splat],
    /// ReadWrite
    pub tile_marks: &'a mut [u32],
    /// ReadWrite
    pub count: &'a mut [u32],
    /// WriteOnly
    pub forward_tiles: &'a mut [u32],
    /// WriteOnly
    pub backward_tiles: &'a mut [u32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, tile: call.constant(1) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, frames: crate::gpu::next_binding(&mut bindings), screen_frames: crate::gpu::next_binding(&mut bindings), tile_counts: crate::gpu::next_binding(&mut bindings), splats: crate::gpu::next_binding(&mut bindings), tile_marks: crate::gpu::next_binding(&mut bindings), count: crate::gpu::next_binding(&mut bindings), forward_tiles: crate::gpu::next_binding(&mut bindings), backward_tiles: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "screen_tiles";
    const LABEL: &'static std::ffi::CStr = c"screen_tiles";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/screen_tiles.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/screen_tiles.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"frames", access: crate::gpu::Access::Read, element_bytes: size_of::<Frame>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"screen_frames", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"tile_counts", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"splats", access: crate::gpu::Access::Read, element_bytes: size_of::<Splat>() as u32, floats: 0b111111 },
        crate::gpu::Binding { name: c"tile_marks", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"count", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"forward_tiles", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"backward_tiles", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"tile", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.tile as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.frames.raw(), b.screen_frames.raw(), b.tile_counts.raw(), b.splats.raw(), b.tile_marks.raw(), b.count.raw(), b.forward_tiles.raw(), b.backward_tiles.raw()])
    }
}
}
/// `glsl/sort/dispatch_args.comp`
pub mod dispatch_args {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub count_index: u32,
    pub capacity: u32,
    pub items_per_group: u32,
    pub args_index: u32,
    pub resource_index: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadWrite
    pub count: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub dispatch_args: &'a crate::gpu::Buffer<u32>,
    /// ReadWrite
    pub status: &'a crate::gpu::Buffer<u32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadWrite
    pub count: &'a mut [u32],
    /// WriteOnly
    pub dispatch_args: &'a mut [u32],
    /// ReadWrite
    pub status: &'a mut [u32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, count: crate::gpu::next_binding(&mut bindings), dispatch_args: crate::gpu::next_binding(&mut bindings), status: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "dispatch_args";
    const LABEL: &'static std::ffi::CStr = c"dispatch_args";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/dispatch_args.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/dispatch_args.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"count", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"dispatch_args", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"status", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.count.raw(), b.dispatch_args.raw(), b.status.raw()])
    }
}
}
/// `glsl/sort/radix_downsweep.comp`
pub mod radix_downsweep {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub count_index: u32,
    pub kept_index: u32,
    pub shift: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub block: u32,
    pub digit_bits: u32,
    pub compact: bool,
    pub lanes: u32,
    pub indexed: bool,
    pub row_lanes: u32,
    pub lockstep: bool,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadWrite
    pub count: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub keys_in: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub values_in: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub block_counts: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub digit_totals: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub keys_out: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub values_out: &'a crate::gpu::Buffer<u32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadWrite
    pub count: &'a mut [u32],
    /// ReadOnly
    pub keys_in: &'a [u32],
    /// ReadOnly
    pub values_in: &'a [u32],
    /// ReadOnly
    pub block_counts: &'a [u32],
    /// ReadOnly
    pub digit_totals: &'a [u32],
    /// WriteOnly
    pub keys_out: &'a mut [u32],
    /// WriteOnly
    pub values_out: &'a mut [u32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, block: call.constant(1) as u32, digit_bits: call.constant(2) as u32, compact: call.constant(3) != 0, lanes: call.constant(4) as u32, indexed: call.constant(5) != 0, row_lanes: call.constant(6) as u32, lockstep: call.constant(7) != 0, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, count: crate::gpu::next_binding(&mut bindings), keys_in: crate::gpu::next_binding(&mut bindings), values_in: crate::gpu::next_binding(&mut bindings), block_counts: crate::gpu::next_binding(&mut bindings), digit_totals: crate::gpu::next_binding(&mut bindings), keys_out: crate::gpu::next_binding(&mut bindings), values_out: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "radix_downsweep";
    const LABEL: &'static std::ffi::CStr = c"radix_downsweep";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/radix_downsweep.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/radix_downsweep.software.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"count", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"keys_in", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"values_in", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"block_counts", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"digit_totals", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"keys_out", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"values_out", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"block", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 2, name: c"digit_bits", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 3, name: c"compact", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 4, name: c"lanes", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 5, name: c"indexed", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 6, name: c"row_lanes", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 7, name: c"lockstep", kind: crate::gpu::ConstantKind::Bool },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Subgroup;
    const SUBGROUPS: bool = true;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[crate::gpu::Feature::ComputeFullSubgroups, crate::gpu::Feature::SubgroupBroadcastDynamicId, crate::gpu::Feature::SubgroupSizeControl];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.block as u32), (2, spec.digit_bits as u32), (3, spec.compact as u32), (4, spec.lanes as u32), (5, spec.indexed as u32), (6, spec.row_lanes as u32), (7, spec.lockstep as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.count.raw(), b.keys_in.raw(), b.values_in.raw(), b.block_counts.raw(), b.digit_totals.raw(), b.keys_out.raw(), b.values_out.raw()])
    }
}
}
/// `glsl/sort/radix_spine.comp`
pub mod radix_spine {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub count_index: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub block: u32,
    pub digit_bits: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub count: &'a crate::gpu::Buffer<u32>,
    /// ReadWrite
    pub block_counts: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub digit_totals: &'a crate::gpu::Buffer<u32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub count: &'a [u32],
    /// ReadWrite
    pub block_counts: &'a mut [u32],
    /// WriteOnly
    pub digit_totals: &'a mut [u32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, block: call.constant(1) as u32, digit_bits: call.constant(2) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, count: crate::gpu::next_binding(&mut bindings), block_counts: crate::gpu::next_binding(&mut bindings), digit_totals: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "radix_spine";
    const LABEL: &'static std::ffi::CStr = c"radix_spine";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/radix_spine.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/radix_spine.software.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"count", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"block_counts", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"digit_totals", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"block", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 2, name: c"digit_bits", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Workgroup;
    const SUBGROUPS: bool = true;
    const BARRIERS: bool = true;
    const FEATURES: &'static [crate::gpu::Feature] = &[crate::gpu::Feature::ComputeFullSubgroups, crate::gpu::Feature::SubgroupSizeControl];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.block as u32), (2, spec.digit_bits as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.count.raw(), b.block_counts.raw(), b.digit_totals.raw()])
    }
}
}
/// `glsl/sort/radix_upsweep.comp`
pub mod radix_upsweep {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub count_index: u32,
    pub shift: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub block: u32,
    pub digit_bits: u32,
    pub compact: bool,
    pub row_lanes: u32,
    pub lockstep: bool,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub count: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub keys_in: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub block_counts: &'a crate::gpu::Buffer<u32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub count: &'a [u32],
    /// ReadOnly
    pub keys_in: &'a [u32],
    /// WriteOnly
    pub block_counts: &'a mut [u32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, block: call.constant(1) as u32, digit_bits: call.constant(2) as u32, compact: call.constant(3) != 0, row_lanes: call.constant(6) as u32, lockstep: call.constant(7) != 0, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, count: crate::gpu::next_binding(&mut bindings), keys_in: crate::gpu::next_binding(&mut bindings), block_counts: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "radix_upsweep";
    const LABEL: &'static std::ffi::CStr = c"radix_upsweep";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/radix_upsweep.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/radix_upsweep.software.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"count", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"keys_in", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"block_counts", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"block", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 2, name: c"digit_bits", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 3, name: c"compact", kind: crate::gpu::ConstantKind::Bool },
        crate::gpu::Constant { id: 6, name: c"row_lanes", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 7, name: c"lockstep", kind: crate::gpu::ConstantKind::Bool },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Subgroup;
    const SUBGROUPS: bool = true;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[crate::gpu::Feature::ComputeFullSubgroups, crate::gpu::Feature::SubgroupSizeControl];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.block as u32), (2, spec.digit_bits as u32), (3, spec.compact as u32), (6, spec.row_lanes as u32), (7, spec.lockstep as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.count.raw(), b.keys_in.raw(), b.block_counts.raw()])
    }
}
}
/// `glsl/sort/scan_apply.comp`
pub mod scan_apply {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub count_index: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub block: u32,
    pub gather: bool,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub count: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub values: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub index: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub block_sums: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub offsets: &'a crate::gpu::Buffer<u32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub count: &'a [u32],
    /// ReadOnly
    pub values: &'a [u32],
    /// ReadOnly
    pub index: &'a [u32],
    /// ReadOnly
    pub block_sums: &'a [u32],
    /// WriteOnly
    pub offsets: &'a mut [u32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, block: call.constant(1) as u32, gather: call.constant(2) != 0, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, count: crate::gpu::next_binding(&mut bindings), values: crate::gpu::next_binding(&mut bindings), index: crate::gpu::next_binding(&mut bindings), block_sums: crate::gpu::next_binding(&mut bindings), offsets: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "scan_apply";
    const LABEL: &'static std::ffi::CStr = c"scan_apply";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/scan_apply.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/scan_apply.software.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"count", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"values", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"index", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"block_sums", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"offsets", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"block", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 2, name: c"gather", kind: crate::gpu::ConstantKind::Bool },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Subgroup;
    const SUBGROUPS: bool = true;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[crate::gpu::Feature::ComputeFullSubgroups, crate::gpu::Feature::SubgroupBroadcastDynamicId, crate::gpu::Feature::SubgroupSizeControl];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.block as u32), (2, spec.gather as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.count.raw(), b.values.raw(), b.index.raw(), b.block_sums.raw(), b.offsets.raw()])
    }
}
}
/// `glsl/sort/scan_reduce.comp`
pub mod scan_reduce {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub count_index: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub block: u32,
    pub gather: bool,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadOnly
    pub count: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub values: &'a crate::gpu::Buffer<u32>,
    /// ReadOnly
    pub index: &'a crate::gpu::Buffer<u32>,
    /// WriteOnly
    pub block_sums: &'a crate::gpu::Buffer<u32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadOnly
    pub count: &'a [u32],
    /// ReadOnly
    pub values: &'a [u32],
    /// ReadOnly
    pub index: &'a [u32],
    /// WriteOnly
    pub block_sums: &'a mut [u32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, block: call.constant(1) as u32, gather: call.constant(2) != 0, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, count: crate::gpu::next_binding(&mut bindings), values: crate::gpu::next_binding(&mut bindings), index: crate::gpu::next_binding(&mut bindings), block_sums: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "scan_reduce";
    const LABEL: &'static std::ffi::CStr = c"scan_reduce";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/scan_reduce.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/scan_reduce.software.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"count", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"values", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"index", access: crate::gpu::Access::Read, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"block_sums", access: crate::gpu::Access::Write, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"block", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 2, name: c"gather", kind: crate::gpu::ConstantKind::Bool },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Subgroup;
    const SUBGROUPS: bool = true;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[crate::gpu::Feature::ComputeFullSubgroups, crate::gpu::Feature::SubgroupSizeControl];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.block as u32), (2, spec.gather as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.count.raw(), b.values.raw(), b.index.raw(), b.block_sums.raw()])
    }
}
}
/// `glsl/sort/scan_spine.comp`
pub mod scan_spine {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub count_index: u32,
    pub total_index: u32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub block: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// ReadWrite
    pub count: &'a crate::gpu::Buffer<u32>,
    /// ReadWrite
    pub block_sums: &'a crate::gpu::Buffer<u32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// ReadWrite
    pub count: &'a mut [u32],
    /// ReadWrite
    pub block_sums: &'a mut [u32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, block: call.constant(1) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, count: crate::gpu::next_binding(&mut bindings), block_sums: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "scan_spine";
    const LABEL: &'static std::ffi::CStr = c"scan_spine";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/scan_spine.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/scan_spine.software.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"count", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
        crate::gpu::Binding { name: c"block_sums", access: crate::gpu::Access::ReadWrite, element_bytes: size_of::<u32>() as u32, floats: 0b0 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"block", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Workgroup;
    const SUBGROUPS: bool = true;
    const BARRIERS: bool = true;
    const FEATURES: &'static [crate::gpu::Feature] = &[crate::gpu::Feature::ComputeFullSubgroups, crate::gpu::Feature::SubgroupSizeControl];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.block as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.count.raw(), b.block_sums.raw()])
    }
}
}
/// `glsl/verify/fma_rate.comp`
pub mod fma_rate {
#[allow(unused_imports)] use super::types::*;
#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Push {
    pub count: u32,
    pub rounds: u32,
    pub factor: f32,
    pub term: f32,
}
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    pub workgroup_size: u32,
    pub chains: u32,
    pub depth: u32,
}
#[derive(Clone, Copy)]
pub struct Buffers<'a> {
    /// WriteOnly
    pub chain_sums: &'a crate::gpu::Buffer<f32>,
}
/// What a twin of the kernel is given; see [`crate::gpu::Twin`].
pub struct Host<'a> {
    pub workgroups: crate::gpu::Workgroups,
    pub spec: Spec,
    pub push: Push,
    /// WriteOnly
    pub chain_sums: &'a mut [f32],
}
impl<'a> Host<'a> {
    pub fn new(call: &'a mut crate::gpu::TwinCall) -> Self {
        let (spec, push) = (Spec { workgroup_size: call.constant(0) as u32, chains: call.constant(1) as u32, depth: call.constant(2) as u32, }, bytemuck::pod_read_unaligned(&call.push));
        let (workgroups, mut bindings) = (call.workgroups, call.bindings.iter_mut());
        Host { workgroups, spec, push, chain_sums: crate::gpu::next_binding(&mut bindings), }
    }
}
pub struct Kernel;
pub type Stage = crate::gpu::Pipeline<Kernel>;
impl crate::gpu::Kernel for Kernel {
    const NAME: &'static str = "fma_rate";
    const LABEL: &'static std::ffi::CStr = c"fma_rate";
    const SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/fma_rate.spv"))).0;
    const SOFTWARE_SPIRV: &'static [u8] = &crate::gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/fma_rate.spv"))).0;
    const BINDINGS: &'static [crate::gpu::Binding] = &[
        crate::gpu::Binding { name: c"chain_sums", access: crate::gpu::Access::Write, element_bytes: size_of::<f32>() as u32, floats: 0b1 },
    ];
    const CONSTANTS: &'static [crate::gpu::Constant] = &[
        crate::gpu::Constant { id: 0, name: c"workgroup_size", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 1, name: c"chains", kind: crate::gpu::ConstantKind::U32 },
        crate::gpu::Constant { id: 2, name: c"depth", kind: crate::gpu::ConstantKind::U32 },
    ];
    const UNIT: crate::gpu::Unit = crate::gpu::Unit::Thread;
    const SUBGROUPS: bool = false;
    const BARRIERS: bool = false;
    const FEATURES: &'static [crate::gpu::Feature] = &[];
    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;
    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> { vec![(0, spec.workgroup_size as u32), (1, spec.chains as u32), (2, spec.depth as u32)] }
    fn raw_buffers<R>(b: &Self::Buffers<'_>, with: impl FnOnce(&[&std::sync::Arc<crate::gpu::RawBuffer>]) -> R) -> R {
        with(&[b.chain_sums.raw()])
    }
}
}
/// Plain constants of `glsl/shared/`, by file.
pub mod constants {
pub mod adam {
#[doc = "bound of a parameter that has none"] pub const FREE: f32 = 1e30;
}
pub mod adam_one {
#[doc = ""] pub const GRADIENT_MAX: f32 = 1e17;
#[doc = ""] pub const CURVATURE_DECAY: f32 = 0.95;
#[doc = ""] pub const NEWTON_REACH: f32 = 3.0;
}
pub mod betas {
#[doc = "what stands where a degree of harmonics would"] pub const BETAS: u32 = 4;
#[doc = "of a Gaussian"] pub const BETA_LOBES: u32 = 2;
#[doc = ""] pub const BETA_MIN: f32 = -1.3862944;
#[doc = ""] pub const BETA_MAX: f32 = 7.0;
}
pub mod cluster {
#[doc = "points: PCA needs three"] pub const GROUP_MIN: u32 = 3;
#[doc = ""] pub const MAX_GROWTHS: u32 = 32;
}
pub mod constants {
#[doc = "no Gaussian, no view; as a depth key: not in this view"] pub const NONE: u32 = 0xFFFFFFFF;
#[doc = ""] pub const PI: f32 = 3.14159265358979;
#[doc = "1 / (2 sqrt(pi)), the constant band"] pub const SH_C0: f32 = 0.28209479177387814;
#[doc = "px^2, added to the diagonal of every 2D covariance (3DGS)"] pub const DILATION: f32 = 0.3;
#[doc = "scene units (3DGS): what is not beyond it is not seen"] pub const NEAR: f32 = 0.2;
}
pub mod density {
#[doc = "Gaussians before"] pub const OLD: u32 = 0;
#[doc = "those that stay"] pub const ALIVE: u32 = 1;
#[doc = "those that may be drawn; with replacement the sum of their weights"] pub const CANDIDATES: u32 = 2;
#[doc = "that are drawn"] pub const CHILDREN: u32 = 3;
#[doc = "Gaussians after"] pub const NEW: u32 = 4;
#[doc = ""] pub const WORDS: u32 = 5;
#[doc = "of blend weight times error of the pixel"] pub const ERROR: u32 = 0;
#[doc = "of blend weight"] pub const WEIGHT: u32 = 1;
#[doc = "of the length of the mean's gradient in the image, in halves of its sides"] pub const PULL: u32 = 2;
#[doc = "views that blend the Gaussian"] pub const SEEN: u32 = 3;
#[doc = "components"] pub const SCORES: u32 = 4;
#[doc = ""] pub const MCMC: u32 = 0;
#[doc = ""] pub const ADC: u32 = 1;
#[doc = ""] pub const BUDGET: u32 = 2;
#[doc = ""] pub const HASH_KEY: u32 = 0;
#[doc = ""] pub const HASH_DRAW: u32 = 1;
#[doc = ""] pub const HASH_SPLIT: u32 = 2;
#[doc = ""] pub const HASH_NOISE: u32 = 3;
}
pub mod dispatch {
#[doc = "the least maxComputeWorkGroupCount that Vulkan allows"] pub const GROUPS_PER_DIMENSION: u32 = 65535;
}
pub mod exposure {
#[doc = ""] pub const MAP: u32 = 12;
#[doc = ""] pub const FIRST: u32 = 0;
#[doc = ""] pub const SECOND: u32 = 12;
#[doc = ""] pub const CORRECTIONS: u32 = 24;
#[doc = ""] pub const MOMENTS: u32 = 26;
#[doc = ""] pub const SUM_PIXELS: u32 = 1024;
}
pub mod model {
#[doc = "3 planes: x, y, z, scene units from the model's origin"] pub const MEAN: u32 = 0;
#[doc = "logit"] pub const OPACITY: u32 = 3;
#[doc = "4 planes: w, x, y, z, of any length"] pub const QUAT: u32 = 4;
#[doc = "3 planes: natural logarithms of the standard deviations"] pub const LOG_SCALE: u32 = 8;
#[doc = ""] pub const GEOMETRY_PLANES: u32 = 11;
#[doc = "of half width, see above"] pub const HALF_GEOMETRY_PLANES: u32 = 8;
#[doc = "2^-16: 22 bits reach from -32 to 32, and err by 8e-6 of a scale"] pub const LOG_SCALE_STEP: f32 = 1.52587890625e-5;
#[doc = "of the 20 of a part"] pub const ROTATION_LOW_BITS: u32 = 10;
#[doc = "2^19"] pub const ROTATION_ZERO: u32 = 524288;
#[doc = "sqrt(1/2) / (2^19 - 1): no component but the largest is beyond sqrt(1/2)"] pub const ROTATION_STEP: f32 = 1.3487017e-6;
#[doc = "3 planes, of any length"] pub const LOBE_DIRECTION: u32 = 0;
#[doc = "T, 0.01 to 1"] pub const LOBE_WIDTH: u32 = 3;
#[doc = "beta"] pub const LOBE_SHARPNESS: u32 = 4;
#[doc = ""] pub const LOBE_PLANES: u32 = 5;
}
pub mod packed_splat {
#[doc = "1 / 65280, which is ALPHA_MIN / 256"] pub const OPACITY_STEP: f32 = 1.53186275e-5;
#[doc = "the largest that a half holds"] pub const MOST_HALF: f32 = 65504.0;
}
pub mod population {
#[doc = "segment"] pub const BASE: u32 = 0;
#[doc = "segment"] pub const SUPPLEMENT: u32 = 1;
#[doc = ""] pub const SEGMENTS: u32 = 2;
}
pub mod pursuit {
#[doc = ""] pub const LEVELS: u32 = 3;
#[doc = "px, standard deviation"] pub const FIRST_BLUR: f32 = 0.7;
#[doc = "texels of the level below, so that variances add up to the double deviation: sqrt(3) * 0.7"] pub const NEXT_BLUR: f32 = 1.2124;
#[doc = "of lobes that are tried; the last stands for none"] pub const WIDTHS: u32 = 6;
#[doc = "of a size and a width, see pursuit_score"] pub const SUMS: u32 = 10;
#[doc = "pixels"] pub const ERROR_BLOCK: u32 = 256;
#[doc = "px"] pub const CELL: u32 = 2;
#[doc = "standard deviations within which a choice changes what is left"] pub const REACH: f32 = 2.5;
#[doc = "standard deviations that a candidate has for itself in its round"] pub const CORE: f32 = 0.5;
#[doc = "px: whole numbers of pixels, as 2.5 deviations of 2 px, are not rounded up for a rounding"] pub const WINDOW_SLACK: f32 = 1e-3;
#[doc = "of `explained`: all of a residual is explained"] pub const WHOLE: f32 = 65536.0;
#[doc = "px: footprints beyond are scored as this one"] pub const WIDEST: f32 = 3.2;
#[doc = ""] pub const SAME_DEPTH: f32 = 0.05;
}
pub mod records {
#[doc = "floats: sum g w_u, g w_v, d/d opacity; g w_u^2, g w_u w_v, g w_v^2; d/d rgb"] pub const RECORD: u32 = 9;
}
pub mod resolve {
#[doc = "a word, R in the low byte"] pub const RGBA8: u32 = 0;
#[doc = "a word, B in the low byte"] pub const BGRA8: u32 = 1;
#[doc = "two words"] pub const RGBA16F: u32 = 2;
#[doc = "four words"] pub const RGBA32F: u32 = 3;
#[doc = "a background colour"] pub const OPAQUE: u32 = 0;
#[doc = "nothing: rgb is weighed by alpha"] pub const PREMULTIPLIED: u32 = 1;
#[doc = "what the target holds"] pub const OVER: u32 = 2;
#[doc = "of a half"] pub const HALF_MAX: f32 = 65504.0;
}
pub mod saturate {
#[doc = ""] pub const SATURATED: u32 = 0xFFFFFFFF;
}
pub mod screen {
#[doc = "planes that have moments"] pub const LEARNED: u32 = 9;
#[doc = ""] pub const SCREEN_PLANES: u32 = 10;
#[doc = "nothing: they are as they are, and are not rendered"] pub const WAITING: u32 = 0;
#[doc = "rendered, stepped and pruned, and more are drawn"] pub const DRAWING: u32 = 1;
#[doc = "the same for one more round, without a draw at its end"] pub const FILLED: u32 = 2;
#[doc = ""] pub const FIRST_SCALE_MIN: f32 = 0.6;
}
pub mod slots {
#[doc = ""] pub const SLOTS_PER_BLOCK: u32 = 32;
}
pub mod splat {
#[doc = "3DGS"] pub const ALPHA_MAX: f32 = 0.99;
#[doc = "transmittance at which a pixel is finished (3DGS)"] pub const T_MIN: f32 = 1e-4;
}
pub mod ssim {
#[doc = ""] pub const WORKGROUP: u32 = 128;
#[doc = ""] pub const TILE: u32 = 32;
#[doc = ""] pub const MIDDLE: f32 = 0.5;
}
pub mod status {
#[doc = "bit r: resource r was too small"] pub const STATUS_FAILED: u32 = 0;
#[doc = "steps completed"] pub const STATUS_STEPS: u32 = 1;
#[doc = "and the words after it: the most that each resource was asked for, see above"] pub const STATUS_NEEDED: u32 = 2;
#[doc = "of splats and tiles"] pub const INTERSECTIONS: u32 = 0;
#[doc = "the base's capacity"] pub const BASE_GAUSSIANS: u32 = 1;
#[doc = "the supplement's capacity"] pub const SUPPLEMENT_GAUSSIANS: u32 = 2;
#[doc = ""] pub const RESOURCES: u32 = 3;
#[doc = "for dispatch_args: of what always fits nothing is told"] pub const NO_RESOURCE: u32 = 0xFFFFFFFF;
}
pub mod subgroup {
#[doc = ""] pub const LOOK: u32 = 8;
}
pub mod sums {
#[doc = "guard: sum of many slots by the whole subgroup"] pub const MANY: u32 = 256;
#[doc = "guard: sum: several slots an iteration"] pub const UNROLL: u32 = 4;
}
pub mod unit {
#[doc = "smallest that is not denormal: devices may flush what is below"] pub const FLOAT_MIN: f32 = 1.17549435e-38;
#[doc = ""] pub const FLOAT_MAX: f32 = 3.402823466e38;
}
}
