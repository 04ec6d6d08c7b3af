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
    pub color: [f32; 3],
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
pub const ALL: [KernelInfo; 61] = [
    KernelInfo::of::<bands_fit::Kernel>(),
    KernelInfo::of::<bands_look::Kernel>(),
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
    KernelInfo::of::<composite::Kernel>(),
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
    KernelInfo::of::<pursuit_sight::Kernel>(),
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
pub const NAMES: &[&str] = &["bands_fit", "bands_look", "density_apply", "density_draw", "density_image", "density_noise", "density_place", "density_plan", "density_score", "density_weigh", "exposure_apply", "exposure_backward", "exposure_step", "lift_append", "lift_count", "lift_groups", "lift_join", "lift_pca", "lift_points", "composite", "loss_probe", "loss_sum", "ssim_backward", "ssim_forward", "gather", "recount", "adam", "project_backward", "step_done", "pursuit_attenuate", "pursuit_blur", "pursuit_claim", "pursuit_draw", "pursuit_fit", "pursuit_gain", "pursuit_place", "pursuit_quanta", "pursuit_residual", "pursuit_score", "pursuit_sight", "blend", "blend_backward", "blend_backward_atomic", "emit", "median_depth", "project", "resolve", "tile_ranges", "screen_backward", "screen_draw", "screen_project", "screen_prune", "screen_tiles", "dispatch_args", "radix_downsweep", "radix_spine", "radix_upsweep", "scan_apply", "scan_reduce", "scan_spine", "fma_rate"];
kernel! {
    /// `glsl/bands/bands_fit.comp`
    bands_fit, Thread, subgroups false, barriers false, features [],
    spirv "bands_fit.spv" "bands_fit.spv",
    push { segment: u32, page_first: u32, stride: u32, view_count: u32, }
    spec { 0 workgroup_size: u32, 10 sh_degree: u32, }
    buffers {
        Read population: u32 = 0b0,
        Read views: View = 0b100011111111111111111111111,
        Read geometry: [f32; 4] = 0b1111,
        Read looks: [f32; 4] = 0b1111,
        Write gains: f32 = 0b1,
        Write fits: [f32; 3] = 0b111,
    }
}
kernel! {
    /// `glsl/bands/bands_look.comp`
    bands_look, Thread, subgroups true, barriers false, features [ComputeFullSubgroups, SubgroupSizeControl],
    spirv "bands_look.spv" "bands_look.software.spv",
    push { segment: u32, page_first: u32, stride: u32, by_gaussian: u32, view: u32, }
    spec { 0 workgroup_size: u32, 1 second: bool, 11 packed_records: bool, }
    buffers {
        Read population: u32 = 0b0,
        Read status: u32 = 0b0,
        Read tile_counts: u32 = 0b0,
        Read first_slot: u32 = 0b0,
        Read splat_colors: [f32; 3] = 0b111,
        Read record_centres: [f32; 3] = 0b111,
        Read record_shapes: [f32; 3] = 0b111,
        Read record_colors: [f32; 3] = 0b111,
        ReadWrite looks: [f32; 4] = 0b1111,
        Read record_words: [u32; 4] = 0b0,
    }
}
kernel! {
    /// `glsl/density/density_apply.comp`
    density_apply, Thread, subgroups false, barriers false, features [],
    spirv "density_apply.spv" "density_apply.spv",
    push { segment: u32, page_first: u32, stride: u32, small: f32, most: f32, step: u32, seed: u32, }
    spec { 0 workgroup_size: u32, 1 strategy: u32, 2 sh_beside: u32, 3 moments: u32, }
    buffers {
        Read population: u32 = 0b0,
        Read status: u32 = 0b0,
        Read words: u32 = 0b0,
        Read sources: u32 = 0b0,
        Read copies: u32 = 0b0,
        ReadWrite geometry: [f32; 4] = 0b1111,
        ReadWrite geometry_moments: [f32; 4] = 0b1111,
        ReadWrite sh_moments: [f32; 4] = 0b1111,
        ReadWrite lobe_moments: [f32; 4] = 0b1111,
        Write scores: [f32; 4] = 0b1111,
    }
}
kernel! {
    /// `glsl/density/density_draw.comp`
    density_draw, Thread, subgroups false, barriers false, features [],
    spirv "density_draw.spv" "density_draw.spv",
    push { step: u32, seed: u32, }
    spec { 0 workgroup_size: u32, 1 replacement: bool, }
    buffers {
        Read words: u32 = 0b0,
        Read order: u32 = 0b0,
        Write sources: u32 = 0b0,
        ReadWrite copies: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/density/density_image.comp`
    density_image, Thread, subgroups false, barriers false, features [],
    spirv "density_image.spv" "density_image.spv",
    push { frame: u32, }
    spec { 0 workgroup_size: u32, 1 terms: u32, }
    buffers {
        Read frames: Frame = 0b0,
        Read image: [f32; 4] = 0b1111,
        Read targets: u32 = 0b0,
        Write image_grad: f32 = 0b1,
    }
}
kernel! {
    /// `glsl/density/density_noise.comp`
    density_noise, Thread, subgroups false, barriers false, features [],
    spirv "density_noise.spv" "density_noise.spv",
    push { segment: u32, page_first: u32, stride: u32, rate: f32, step: u32, seed: u32, }
    spec { 0 workgroup_size: u32, }
    buffers {
        Read population: u32 = 0b0,
        Read status: u32 = 0b0,
        ReadWrite geometry: [f32; 4] = 0b1111,
    }
}
kernel! {
    /// `glsl/density/density_place.comp`
    density_place, Thread, subgroups false, barriers false, features [],
    spirv "density_place.spv" "density_place.spv",
    push { page_first: u32, stride: u32, }
    spec { 0 workgroup_size: u32, }
    buffers {
        Read words: u32 = 0b0,
        Read alive: u32 = 0b0,
        Read ranks: u32 = 0b0,
        Write sources: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/density/density_plan.comp`
    density_plan, Thread, subgroups false, barriers false, features [],
    spirv "density_plan.spv" "density_plan.spv",
    push { capacity: u32, target: u32, nth: u32, threads_per_group: u32, }
    spec { 0 workgroup_size: u32, 1 replacement: bool, }
    buffers {
        Read status: u32 = 0b0,
        ReadWrite words: u32 = 0b0,
        Write dispatch_args: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/density/density_score.comp`
    density_score, Thread, subgroups true, barriers false, features [ComputeFullSubgroups, SubgroupSizeControl],
    spirv "density_score.spv" "density_score.software.spv",
    push { segment: u32, page_first: u32, stride: u32, by_gaussian: u32, half_width: f32, half_height: f32, }
    spec { 0 workgroup_size: u32, 1 pulls: bool, 11 packed_records: bool, }
    buffers {
        Read population: u32 = 0b0,
        Read status: u32 = 0b0,
        Read tile_counts: u32 = 0b0,
        Read first_slot: u32 = 0b0,
        Read splats: Splat = 0b111111,
        Read record_centres: [f32; 3] = 0b111,
        Read record_shapes: [f32; 3] = 0b111,
        Read record_colors: [f32; 3] = 0b111,
        ReadWrite scores: [f32; 4] = 0b1111,
        Read record_words: [u32; 4] = 0b0,
    }
}
kernel! {
    /// `glsl/density/density_weigh.comp`
    density_weigh, Thread, subgroups false, barriers false, features [],
    spirv "density_weigh.spv" "density_weigh.spv",
    push { segment: u32, page_first: u32, stride: u32, capacity: u32, least_opacity: f32, least_score: f32, step: u32, seed: u32, }
    spec { 0 workgroup_size: u32, 1 strategy: u32, }
    buffers {
        Read population: u32 = 0b0,
        Read geometry: [f32; 4] = 0b1111,
        Read scores: [f32; 4] = 0b1111,
        Write alive: u32 = 0b0,
        Write keys: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/exposure/exposure_apply.comp`
    exposure_apply, Thread, subgroups false, barriers false, features [],
    spirv "exposure_apply.spv" "exposure_apply.spv",
    push { frame: u32, photo: u32, }
    spec { 0 workgroup_size: u32, }
    buffers {
        Read frames: Frame = 0b0,
        Read maps: f32 = 0b1,
        Read image: [f32; 4] = 0b1111,
        Write corrected: [f32; 4] = 0b1111,
    }
}
kernel! {
    /// `glsl/exposure/exposure_backward.comp`
    exposure_backward, Subgroup, subgroups true, barriers false, features [ComputeFullSubgroups, SubgroupSizeControl],
    spirv "exposure_backward.spv" "exposure_backward.software.spv",
    push { frame: u32, photo: u32, }
    spec { 0 workgroup_size: u32, }
    buffers {
        Read frames: Frame = 0b0,
        Read maps: f32 = 0b1,
        Read image: [f32; 4] = 0b1111,
        ReadWrite image_grad: f32 = 0b1,
        Write sums: f32 = 0b1,
    }
}
kernel! {
    /// `glsl/exposure/exposure_step.comp`
    exposure_step, Workgroup, subgroups true, barriers true, features [ComputeFullSubgroups, SubgroupSizeControl],
    spirv "exposure_step.spv" "exposure_step.software.spv",
    push { photo: u32, photos: u32, runs: u32, rate: f32, }
    spec { 0 workgroup_size: u32, }
    buffers {
        Read status: u32 = 0b0,
        Read sums: f32 = 0b1,
        ReadWrite maps: f32 = 0b1,
        ReadWrite moments: f32 = 0b1,
    }
}
kernel! {
    /// `glsl/lift/lift_append.comp`
    lift_append, Thread, subgroups false, barriers false, features [],
    spirv "lift_append.spv" "lift_append.spv",
    push { count: u32, segment: u32, page_first: u32, stride: u32, sh_coefficients: u32, }
    spec { 0 workgroup_size: u32, 1 has_lobes: bool, }
    buffers {
        Read lifts: Lift = 0b1111111111111111111,
        Read lift_ranks: u32 = 0b0,
        Read lift_flags: u32 = 0b0,
        Read population: u32 = 0b0,
        Write geometry: [f32; 4] = 0b1111,
        Write sh: [f32; 4] = 0b1111,
        Write lobes: [f32; 4] = 0b1111,
    }
}
kernel! {
    /// `glsl/lift/lift_count.comp`
    lift_count, Subgroup, subgroups true, barriers false, features [ComputeFullSubgroups, SubgroupSizeControl],
    spirv "lift_count.spv" "lift_count.software.spv",
    push { count: u32, stride: u32, view_count: u32, }
    spec { 0 workgroup_size: u32, }
    buffers {
        Read screen_planes: f32 = 0b1,
        Read screen_frames: u32 = 0b0,
        Read views: View = 0b100011111111111111111111111,
        Read depths: f32 = 0b1,
        Write point_counts: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/lift/lift_groups.comp`
    lift_groups, Subgroup, subgroups true, barriers false, features [ComputeFullSubgroups, SubgroupSizeControl],
    spirv "lift_groups.spv" "lift_groups.software.spv",
    push { count: u32, point_count: u32, round: u32, last_round: u32, }
    spec { 0 workgroup_size: u32, 1 fail_on_smallest: u32, 7 lockstep: bool, }
    buffers {
        Read point_counts: u32 = 0b0,
        Read point_firsts: u32 = 0b0,
        Read heaviest: u32 = 0b0,
        ReadWrite labels: u32 = 0b0,
        ReadWrite group_sizes: u32 = 0b0,
        ReadWrite taus: f32 = 0b1,
        Write prime_labels: u32 = 0b0,
        ReadWrite cluster_sizes: u32 = 0b0,
        ReadWrite rounds: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/lift/lift_join.comp`
    lift_join, Subgroup, subgroups true, barriers false, features [ComputeFullSubgroups, SubgroupSizeControl],
    spirv "lift_join.spv" "lift_join.software.spv",
    push { point_count: u32, }
    spec { 0 workgroup_size: u32, }
    buffers {
        Read points: [f32; 4] = 0b1111,
        Read point_sets: u32 = 0b0,
        Read point_counts: u32 = 0b0,
        Read point_firsts: u32 = 0b0,
        Read taus: f32 = 0b1,
        Read cluster_sizes: u32 = 0b0,
        ReadWrite labels: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/lift/lift_pca.comp`
    lift_pca, Subgroup, subgroups true, barriers false, features [ComputeFullSubgroups, SubgroupSizeControl],
    spirv "lift_pca.spv" "lift_pca.software.spv",
    push { count: u32, stride: u32, view_count: u32, train_count: u32, unit: f32, }
    spec { 0 workgroup_size: u32, 1 plain_weights: u32, }
    buffers {
        Read screen_planes: f32 = 0b1,
        Read screen_frames: u32 = 0b0,
        Read views: View = 0b100011111111111111111111111,
        Read train_views: u32 = 0b0,
        Read points: [f32; 4] = 0b1111,
        Read point_counts: u32 = 0b0,
        Read point_firsts: u32 = 0b0,
        Read heaviest: u32 = 0b0,
        Read labels: u32 = 0b0,
        Read prime_labels: u32 = 0b0,
        Read cluster_sizes: u32 = 0b0,
        Write lifts: Lift = 0b1111111111111111111,
        Write lift_flags: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/lift/lift_points.comp`
    lift_points, Subgroup, subgroups true, barriers false, features [ComputeFullSubgroups, SubgroupSizeControl],
    spirv "lift_points.spv" "lift_points.software.spv",
    push { count: u32, stride: u32, view_count: u32, }
    spec { 0 workgroup_size: u32, }
    buffers {
        Read screen_planes: f32 = 0b1,
        Read screen_frames: u32 = 0b0,
        Read views: View = 0b100011111111111111111111111,
        Read depths: f32 = 0b1,
        Read point_counts: u32 = 0b0,
        Read point_firsts: u32 = 0b0,
        Write points: [f32; 4] = 0b1111,
        Write heaviest: u32 = 0b0,
        Write taus: f32 = 0b1,
        Write point_sets: u32 = 0b0,
        Write labels: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/loss/composite.comp`
    composite, Thread, subgroups false, barriers false, features [],
    spirv "composite.spv" "composite.spv",
    push { first: u32, pixels: u32, change: [i32; 3], }
    spec { 0 workgroup_size: u32, }
    buffers {
        Read photographs: u32 = 0b0,
        Write targets: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/loss/loss_probe.comp`
    loss_probe, Thread, subgroups false, barriers false, features [],
    spirv "loss_probe.spv" "loss_probe.spv",
    push { frame: u32, step: u32, }
    spec { 0 workgroup_size: u32, 1 ssim_weight: f32, }
    buffers {
        Read frames: Frame = 0b0,
        Read image: [f32; 4] = 0b1111,
        Read targets: u32 = 0b0,
        Write image_grad: f32 = 0b1,
    }
}
kernel! {
    /// `glsl/loss/loss_sum.comp`
    loss_sum, Workgroup, subgroups true, barriers true, features [ComputeFullSubgroups, SubgroupSizeControl],
    spirv "loss_sum.spv" "loss_sum.software.spv",
    push { frame_first: u32, frame_count: u32, tiles_per_frame: u32, first: u32, }
    spec { 0 workgroup_size: u32, 1 ssim_weight: f32, }
    buffers {
        Read frames: Frame = 0b0,
        Read tile_sums: [f32; 3] = 0b111,
        Write losses: Loss = 0b1111,
    }
}
kernel! {
    /// `glsl/loss/ssim_backward.comp`
    ssim_backward, Workgroup, subgroups false, barriers true, features [],
    spirv "ssim_backward.spv" "ssim_backward.spv",
    push { frame_first: u32, tiles_per_frame: u32, tile_count: u32, count_index: u32, }
    spec { 0 workgroup_size: u32, 1 tile_list: bool, 2 ssim_weight: f32, 8 run: u32, 9 strip: u32, }
    buffers {
        Read count: u32 = 0b0,
        Read tile_list: u32 = 0b0,
        Read frames: Frame = 0b0,
        Read image: [f32; 4] = 0b1111,
        Read targets: u32 = 0b0,
        Read partials: [f32; 3] = 0b111,
        Write image_grad: f32 = 0b1,
    }
}
kernel! {
    /// `glsl/loss/ssim_forward.comp`
    ssim_forward, Workgroup, subgroups true, barriers true, features [ComputeFullSubgroups, SubgroupSizeControl],
    spirv "ssim_forward.spv" "ssim_forward.software.spv",
    push { frame_first: u32, tiles_per_frame: u32, tile_count: u32, count_index: u32, }
    spec { 0 workgroup_size: u32, 1 tile_list: bool, 2 ssim_weight: f32, 3 loss_map: bool, 8 run: u32, 9 strip: u32, }
    buffers {
        Read count: u32 = 0b0,
        Read tile_list: u32 = 0b0,
        Read frames: Frame = 0b0,
        Read image: [f32; 4] = 0b1111,
        Read targets: u32 = 0b0,
        Write partials: [f32; 3] = 0b111,
        Write tile_sums: [f32; 3] = 0b111,
        Write loss_map: f32 = 0b1,
    }
}
kernel! {
    /// `glsl/model/gather.comp`
    gather, Thread, subgroups false, barriers false, features [],
    spirv "gather.spv" "gather.spv",
    push { count_index: u32, targets: u32, page_first: u32, stride: u32, quad: u32, }
    spec { 0 workgroup_size: u32, }
    buffers {
        Read count: u32 = 0b0,
        Read sources: u32 = 0b0,
        Read from: [f32; 4] = 0b1111,
        Write gathered: [f32; 4] = 0b1111,
    }
}
kernel! {
    /// `glsl/model/recount.comp`
    recount, Thread, subgroups false, barriers false, features [],
    spirv "recount.spv" "recount.spv",
    push { page_count: u32, threads_per_group: u32, items_per_group: u32, segment: u32, added_index: u32, }
    spec { 0 workgroup_size: u32, }
    buffers {
        Read added: u32 = 0b0,
        Read pages: Page = 0b0,
        ReadWrite segment_counts: u32 = 0b0,
        Write population: u32 = 0b0,
        Write population_args: u32 = 0b0,
        ReadWrite status: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/optim/adam.comp`
    adam, Thread, subgroups false, barriers false, features [],
    spirv "adam.spv" "adam.spv",
    push { segment: u32, page_first: u32, stride: u32, rates: StepRates, }
    spec { 0 workgroup_size: u32, 2 has_lobes: bool, 3 opacity_only: bool, 4 sparse: bool, 6 packed: bool, 10 sh_degree: u32, }
    buffers {
        Read population: u32 = 0b0,
        Read status: u32 = 0b0,
        ReadWrite geometry: [f32; 4] = 0b1111,
        ReadWrite sh: [f32; 4] = 0b1111,
        ReadWrite lobes: [f32; 4] = 0b1111,
        ReadWrite geometry_moments: [f32; 4] = 0b1111,
        ReadWrite sh_moments: [f32; 4] = 0b1111,
        ReadWrite lobe_moments: [f32; 4] = 0b1111,
        Read geometry_grads: [f32; 4] = 0b1111,
        Read sh_grads: [f32; 4] = 0b1111,
        Read lobe_grads: [f32; 4] = 0b1111,
    }
}
kernel! {
    /// `glsl/optim/project_backward.comp`
    project_backward, Thread, subgroups true, barriers false, features [ComputeFullSubgroups, SubgroupSizeControl],
    spirv "project_backward.spv" "project_backward.software.spv",
    push { segment: u32, page_first: u32, stride: u32, view: u32, by_gaussian: u32, rates: StepRates, mean_opacity: f32, mean_scale: f32, }
    spec { 0 workgroup_size: u32, 1 compensate: bool, 2 has_lobes: bool, 3 opacity_only: bool, 4 sparse: bool, 5 accumulate: bool, 6 packed: bool, 7 newton: bool, 10 sh_degree: u32, 11 packed_records: bool, }
    buffers {
        Read population: u32 = 0b0,
        Read views: View = 0b100011111111111111111111111,
        Read status: u32 = 0b0,
        Read tile_counts: u32 = 0b0,
        Read first_slot: u32 = 0b0,
        Read record_centres: [f32; 3] = 0b111,
        Read record_shapes: [f32; 3] = 0b111,
        Read record_colors: [f32; 3] = 0b111,
        Read splat_colors: [f32; 3] = 0b111,
        ReadWrite geometry: [f32; 4] = 0b1111,
        ReadWrite sh: [f32; 4] = 0b1111,
        ReadWrite lobes: [f32; 4] = 0b1111,
        ReadWrite geometry_moments: [f32; 4] = 0b1111,
        ReadWrite sh_moments: [f32; 4] = 0b1111,
        ReadWrite lobe_moments: [f32; 4] = 0b1111,
        Read record_words: [u32; 4] = 0b0,
    }
}
kernel! {
    /// `glsl/optim/step_done.comp`
    step_done, Thread, subgroups false, barriers false, features [],
    spirv "step_done.spv" "step_done.spv",
    push { }
    spec { 0 workgroup_size: u32, }
    buffers {
        ReadWrite status: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/pursuit/pursuit_attenuate.comp`
    pursuit_attenuate, Subgroup, subgroups true, barriers false, features [ComputeFullSubgroups, SubgroupSizeControl],
    spirv "pursuit_attenuate.spv" "pursuit_attenuate.software.spv",
    push { count: u32, view_first: u32, view_end: u32, last: u32, words: u32, }
    spec { 0 workgroup_size: u32, }
    buffers {
        Read views: View = 0b100011111111111111111111111,
        Read plots: Plot = 0b0,
        Read surface_depths: f32 = 0b1,
        Read candidates: Candidate = 0b11111111,
        Read texels: Texel = 0b0,
        Read fits: Fit = 0b111111111,
        Read gains: f32 = 0b1,
        Read beaten: u32 = 0b0,
        ReadWrite explained: u32 = 0b0,
        Write gain_keys: u32 = 0b0,
        Read sights: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/pursuit/pursuit_blur.comp`
    pursuit_blur, Thread, subgroups false, barriers false, features [],
    spirv "pursuit_blur.spv" "pursuit_blur.spv",
    push { from_first: u32, from_width: u32, from_height: u32, first: u32, width: u32, height: u32, }
    spec { 0 workgroup_size: u32, 1 halve: bool, }
    buffers {
        Read from_texels: Texel = 0b0,
        Write texels: Texel = 0b0,
    }
}
kernel! {
    /// `glsl/pursuit/pursuit_claim.comp`
    pursuit_claim, Subgroup, subgroups true, barriers false, features [ComputeFullSubgroups, SubgroupSizeControl],
    spirv "pursuit_claim.spv" "pursuit_claim.software.spv",
    push { count: u32, view_first: u32, view_end: u32, begin: u32, words: u32, }
    spec { 0 workgroup_size: u32, 1 check: bool, }
    buffers {
        Read views: View = 0b100011111111111111111111111,
        Read plots: Plot = 0b0,
        Read surface_depths: f32 = 0b1,
        Read candidates: Candidate = 0b11111111,
        Read fits: Fit = 0b111111111,
        Read gains: f32 = 0b1,
        ReadWrite claims: u32 = 0b0,
        ReadWrite beaten: u32 = 0b0,
        Read sights: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/pursuit/pursuit_draw.comp`
    pursuit_draw, Thread, subgroups false, barriers false, features [],
    spirv "pursuit_draw.spv" "pursuit_draw.spv",
    push { count: u32, seed: u32, view_first: u32, view_end: u32, view_count: u32, block_first: u32, block_end: u32, total_index: u32, }
    spec { 0 workgroup_size: u32, }
    buffers {
        Read views: View = 0b100011111111111111111111111,
        Read plots: Plot = 0b0,
        Read quanta_total: u32 = 0b0,
        Read quanta_firsts: u32 = 0b0,
        Read quanta: u32 = 0b0,
        Read error_sums: f32 = 0b1,
        Read errors: f32 = 0b1,
        Read surface_depths: f32 = 0b1,
        Write candidates: Candidate = 0b11111111,
    }
}
kernel! {
    /// `glsl/pursuit/pursuit_fit.comp`
    pursuit_fit, Thread, subgroups false, barriers false, features [],
    spirv "pursuit_fit.spv" "pursuit_fit.spv",
    push { first: u32, count: u32, sizes: u32, first_size: f32, size_ratio: f32, lobe_worth: f32, plain_worth: f32, lobe_price: u32, plain_price: u32, doubt: f32, }
    spec { 0 workgroup_size: u32, }
    buffers {
        Read candidates: Candidate = 0b11111111,
        Read sums: f32 = 0b1,
        Write fits: Fit = 0b111111111,
        Write prices: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/pursuit/pursuit_gain.comp`
    pursuit_gain, Subgroup, subgroups true, barriers false, features [ComputeFullSubgroups, SubgroupSizeControl],
    spirv "pursuit_gain.spv" "pursuit_gain.software.spv",
    push { count: u32, view_first: u32, view_end: u32, begin: u32, last: u32, caution: f32, doubt: f32, words: u32, }
    spec { 0 workgroup_size: u32, }
    buffers {
        Read views: View = 0b100011111111111111111111111,
        Read plots: Plot = 0b0,
        Read surface_depths: f32 = 0b1,
        Read candidates: Candidate = 0b11111111,
        Read texels: Texel = 0b0,
        Read explained: u32 = 0b0,
        ReadWrite fits: Fit = 0b111111111,
        Read gain_keys: u32 = 0b0,
        ReadWrite gains: f32 = 0b1,
        ReadWrite gain_squares: f32 = 0b1,
        Read sights: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/pursuit/pursuit_place.comp`
    pursuit_place, Thread, subgroups false, barriers false, features [],
    spirv "pursuit_place.spv" "pursuit_place.spv",
    push { count: u32, most: u32, budget: u32, kept_index: u32, least_gain: f32, }
    spec { 0 workgroup_size: u32, }
    buffers {
        Read kept: u32 = 0b0,
        Read order: u32 = 0b0,
        Read candidates: Candidate = 0b11111111,
        Read fits: Fit = 0b111111111,
        Read gain_keys: u32 = 0b0,
        Write lifts: Lift = 0b1111111111111111111,
        Write lift_flags: u32 = 0b0,
        Write plain_flags: u32 = 0b0,
        Read prices: u32 = 0b0,
        Read spent: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/pursuit/pursuit_quanta.comp`
    pursuit_quanta, Workgroup, subgroups true, barriers true, features [ComputeFullSubgroups, SubgroupSizeControl],
    spirv "pursuit_quanta.spv" "pursuit_quanta.software.spv",
    push { count: u32, }
    spec { 0 workgroup_size: u32, }
    buffers {
        Read error_sums: f32 = 0b1,
        Write quanta: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/pursuit/pursuit_residual.comp`
    pursuit_residual, Subgroup, subgroups true, barriers false, features [ComputeFullSubgroups, SubgroupSizeControl],
    spirv "pursuit_residual.spv" "pursuit_residual.software.spv",
    push { view: u32, }
    spec { 0 workgroup_size: u32, }
    buffers {
        Read frames: Frame = 0b0,
        Read plots: Plot = 0b0,
        Read image: [f32; 4] = 0b1111,
        Read targets: u32 = 0b0,
        Read depths: f32 = 0b1,
        Write texels: Texel = 0b0,
        Write surface_depths: f32 = 0b1,
        Write errors: f32 = 0b1,
        Write error_sums: f32 = 0b1,
        Write explained: u32 = 0b0,
        Write squares: f32 = 0b1,
    }
}
kernel! {
    /// `glsl/pursuit/pursuit_score.comp`
    pursuit_score, Thread, subgroups false, barriers false, features [],
    spirv "pursuit_score.spv" "pursuit_score.spv",
    push { first: u32, count: u32, sizes: u32, first_size: f32, size_ratio: f32, view_first: u32, view_end: u32, begin: u32, }
    spec { 0 workgroup_size: u32, }
    buffers {
        Read views: View = 0b100011111111111111111111111,
        Read plots: Plot = 0b0,
        Read surface_depths: f32 = 0b1,
        Read candidates: Candidate = 0b11111111,
        Read texels: Texel = 0b0,
        ReadWrite sums: f32 = 0b1,
    }
}
kernel! {
    /// `glsl/pursuit/pursuit_sight.comp`
    pursuit_sight, Thread, subgroups false, barriers false, features [],
    spirv "pursuit_sight.spv" "pursuit_sight.spv",
    push { count: u32, words: u32, view_first: u32, view_end: u32, begin: u32, }
    spec { 0 workgroup_size: u32, }
    buffers {
        Read views: View = 0b100011111111111111111111111,
        Read plots: Plot = 0b0,
        Read surface_depths: f32 = 0b1,
        Read candidates: Candidate = 0b11111111,
        Read fits: Fit = 0b111111111,
        ReadWrite sights: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/raster/blend.comp`
    blend, Subgroup, subgroups true, barriers false, features [ComputeFullSubgroups, SubgroupBroadcastDynamicId, SubgroupSizeControl],
    spirv "blend.spv" "blend.software.spv",
    push { frame_first: u32, tiles_x: u32, tiles_per_frame: u32, tile_count: u32, background: [f32; 3], median_threshold: f32, depth_form: [f32; 2], }
    spec { 0 workgroup_size: u32, 1 tile_width: u32, 2 tile_height: u32, 3 pixels: u32, 4 unrolled: bool, 5 background_image: bool, 6 median: bool, 7 occluded: bool, 8 direct: bool, 9 packed_splats: bool, 10 listed: bool, }
    buffers {
        Read frames: Frame = 0b0,
        Read tile_ranges: [u32; 2] = 0b0,
        Read isect_slots: u32 = 0b0,
        Read rank_blocks: [u32; 2] = 0b0,
        Read global_from_rank: u32 = 0b0,
        Read splats: Splat = 0b111111,
        Read splat_colors: [f32; 3] = 0b111,
        Read backdrop: [f32; 4] = 0b1111,
        Write image: [f32; 4] = 0b1111,
        Write median_ids: u32 = 0b0,
        Read depth_keys: u32 = 0b0,
        Read scene_depths: f32 = 0b1,
        Read packed_splats: PackedSplat = 0b0,
        Read tile_list: u32 = 0b0,
        Read tile_list_count: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/raster/blend_backward.comp`
    blend_backward, Subgroup, subgroups true, barriers false, features [ComputeFullSubgroups, SubgroupBroadcastDynamicId, SubgroupSizeControl],
    spirv "blend_backward.spv" "blend_backward.software.spv",
    push { frame_first: u32, tiles_x: u32, tiles_per_frame: u32, tile_count: u32, frozen: u32, }
    spec { 0 workgroup_size: u32, 1 tile_width: u32, 2 tile_height: u32, 3 pixels: u32, 4 unrolled: bool, 5 scores: bool, 10 listed: bool, 11 packed_records: bool, }
    buffers {
        Read frames: Frame = 0b0,
        Read tile_ranges: [u32; 2] = 0b0,
        Read isect_slots: u32 = 0b0,
        Read rank_blocks: [u32; 2] = 0b0,
        Read global_from_rank: u32 = 0b0,
        Read splats: Splat = 0b111111,
        Read splat_colors: [f32; 3] = 0b111,
        Read image: [f32; 4] = 0b1111,
        Read image_grad: f32 = 0b1,
        Read population: u32 = 0b0,
        Read tile_list: u32 = 0b0,
        Read tile_list_count: u32 = 0b0,
        Write record_centres: [f32; 3] = 0b111,
        Write record_shapes: [f32; 3] = 0b111,
        Write record_colors: [f32; 3] = 0b111,
        Write record_words: [u32; 4] = 0b0,
    }
}
kernel! {
    /// `glsl/raster/blend_backward_atomic.comp`
    blend_backward_atomic, Subgroup, subgroups true, barriers false, features [ComputeFullSubgroups, ShaderBufferFloat32AtomicAdd, SubgroupBroadcastDynamicId, SubgroupSizeControl],
    spirv "blend_backward_atomic.spv" "blend_backward_atomic.software.spv",
    push { frame_first: u32, tiles_x: u32, tiles_per_frame: u32, tile_count: u32, frozen: u32, }
    spec { 0 workgroup_size: u32, 1 tile_width: u32, 2 tile_height: u32, 3 pixels: u32, 4 unrolled: bool, 5 scores: bool, 10 listed: bool, }
    buffers {
        Read frames: Frame = 0b0,
        Read tile_ranges: [u32; 2] = 0b0,
        Read isect_slots: u32 = 0b0,
        Read rank_blocks: [u32; 2] = 0b0,
        Read global_from_rank: u32 = 0b0,
        Read splats: Splat = 0b111111,
        Read splat_colors: [f32; 3] = 0b111,
        Read image: [f32; 4] = 0b1111,
        Read image_grad: f32 = 0b1,
        Read population: u32 = 0b0,
        Read tile_list: u32 = 0b0,
        Read tile_list_count: u32 = 0b0,
        ReadWrite record_centres: [f32; 3] = 0b111,
        ReadWrite record_shapes: [f32; 3] = 0b111,
        ReadWrite record_colors: [f32; 3] = 0b111,
    }
}
kernel! {
    /// `glsl/raster/emit.comp`
    emit, Thread, subgroups true, barriers false, features [ComputeFullSubgroups, SubgroupSizeControl],
    spirv "emit.spv" "emit.software.spv",
    push { frame_first: u32, tiles_x: u32, tiles_per_frame: u32, capacity: u32, count_index: u32, }
    spec { 0 workgroup_size: u32, 1 tile_width: u32, 2 tile_height: u32, 3 batch: bool, 4 direct: bool, 5 packed_splats: bool, }
    buffers {
        Read frames: Frame = 0b0,
        Read count: u32 = 0b0,
        Read global_from_rank: u32 = 0b0,
        Read rank_first_slot: u32 = 0b0,
        Read splats: Splat = 0b111111,
        Read tile_counts: u32 = 0b0,
        Read splat_frames: u32 = 0b0,
        Write isect_tiles: u32 = 0b0,
        Write isect_globals: u32 = 0b0,
        ReadWrite rank_blocks: [u32; 2] = 0b0,
        Write first_slot: u32 = 0b0,
        Read packed_splats: PackedSplat = 0b0,
    }
}
kernel! {
    /// `glsl/raster/median_depth.comp`
    median_depth, Thread, subgroups false, barriers false, features [],
    spirv "median_depth.spv" "median_depth.spv",
    push { segment: u32, page_first: u32, stride: u32, view: u32, depth_first: u32, splat_first: u32, scale: f32, }
    spec { 0 workgroup_size: u32, 1 centre: bool, 11 half_width: bool, }
    buffers {
        Read population: u32 = 0b0,
        Read views: View = 0b100011111111111111111111111,
        Read geometry: [f32; 4] = 0b1111,
        Read median_ids: u32 = 0b0,
        Write depths: f32 = 0b1,
    }
}
kernel! {
    /// `glsl/raster/project.comp`
    project, Thread, subgroups false, barriers false, features [],
    spirv "project.spv" "project.spv",
    push { segment: u32, page_first: u32, stride: u32, view: u32, splat_first: u32, }
    spec { 0 workgroup_size: u32, 1 tile_width: u32, 2 tile_height: u32, 3 compensate: bool, 4 has_lobes: bool, 10 sh_degree: u32, 11 half_width: bool, 12 packed_splats: bool, }
    buffers {
        Read population: u32 = 0b0,
        Read views: View = 0b100011111111111111111111111,
        Read geometry: [f32; 4] = 0b1111,
        Read sh: [f32; 4] = 0b1111,
        Read lobes: [f32; 4] = 0b1111,
        Write splats: Splat = 0b111111,
        Write splat_colors: [f32; 3] = 0b111,
        Write depth_keys: u32 = 0b0,
        Write tile_counts: u32 = 0b0,
        Write packed_splats: PackedSplat = 0b0,
    }
}
kernel! {
    /// `glsl/raster/resolve.comp`
    resolve, Thread, subgroups false, barriers false, features [],
    spirv "resolve.spv" "resolve.spv",
    push { pixels: u32, format: u32, blend: u32, linear: u32, depth: u32, exposure: f32, depth_form: [f32; 2], background: [f32; 3], }
    spec { 0 workgroup_size: u32, 1 curves: bool, }
    buffers {
        Read image: [f32; 4] = 0b1111,
        Read depths: f32 = 0b1,
        ReadWrite target: u32 = 0b0,
        Write depth_target: f32 = 0b1,
    }
}
kernel! {
    /// `glsl/raster/tile_ranges.comp`
    tile_ranges, Thread, subgroups false, barriers false, features [],
    spirv "tile_ranges.spv" "tile_ranges.spv",
    push { count_index: u32, tile_count: u32, }
    spec { 0 workgroup_size: u32, 1 listed: bool, }
    buffers {
        Read count: u32 = 0b0,
        Read isect_tiles: u32 = 0b0,
        Write tile_ranges: [u32; 2] = 0b0,
        ReadWrite tile_drawn: u32 = 0b0,
        Write tile_list: u32 = 0b0,
        ReadWrite tile_list_count: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/screen/screen_backward.comp`
    screen_backward, Thread, subgroups false, barriers false, features [],
    spirv "screen_backward.spv" "screen_backward.spv",
    push { count: u32, stride: u32, by_gaussian: u32, }
    spec { 0 workgroup_size: u32, 1 gradients: bool, }
    buffers {
        Read status: u32 = 0b0,
        Read frames: Frame = 0b0,
        Read screen_frames: u32 = 0b0,
        Read screen_states: ScreenState = 0b0,
        Read tile_counts: u32 = 0b0,
        Read first_slot: u32 = 0b0,
        Read record_centres: [f32; 3] = 0b111,
        Read record_shapes: [f32; 3] = 0b111,
        Read record_colors: [f32; 3] = 0b111,
        ReadWrite screen_planes: f32 = 0b1,
        ReadWrite screen_ages: u32 = 0b0,
        ReadWrite screen_moments: f32 = 0b1,
    }
}
kernel! {
    /// `glsl/screen/screen_draw.comp`
    screen_draw, Workgroup, subgroups true, barriers true, features [ComputeFullSubgroups, SubgroupSizeControl],
    spirv "screen_draw.spv" "screen_draw.software.spv",
    push { frame_count: u32, stride: u32, round: u32, seed: u32, age: u32, }
    spec { 0 workgroup_size: u32, }
    buffers {
        Read status: u32 = 0b0,
        Read frames: Frame = 0b0,
        Read quotas: Quota = 0b0,
        Read loss_map: f32 = 0b1,
        Read image: [f32; 4] = 0b1111,
        ReadWrite drawn_pixels: u32 = 0b0,
        ReadWrite screen_states: ScreenState = 0b0,
        ReadWrite screen_frames: u32 = 0b0,
        Write screen_planes: f32 = 0b1,
        Write screen_ages: u32 = 0b0,
        Write screen_moments: f32 = 0b1,
    }
}
kernel! {
    /// `glsl/screen/screen_project.comp`
    screen_project, Thread, subgroups false, barriers false, features [],
    spirv "screen_project.spv" "screen_project.spv",
    push { count: u32, stride: u32, }
    spec { 0 workgroup_size: u32, 1 tile_width: u32, 2 tile_height: u32, }
    buffers {
        Read frames: Frame = 0b0,
        Read screen_frames: u32 = 0b0,
        Read screen_states: ScreenState = 0b0,
        Read depths: f32 = 0b1,
        ReadWrite screen_planes: f32 = 0b1,
        Write splats: Splat = 0b111111,
        Write splat_colors: [f32; 3] = 0b111,
        Write depth_keys: u32 = 0b0,
        Write tile_counts: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/screen/screen_prune.comp`
    screen_prune, Subgroup, subgroups true, barriers false, features [ComputeFullSubgroups, SubgroupSizeControl],
    spirv "screen_prune.spv" "screen_prune.software.spv",
    push { count: u32, stride: u32, }
    spec { 0 workgroup_size: u32, }
    buffers {
        Read status: u32 = 0b0,
        Read frames: Frame = 0b0,
        Read screen_states: ScreenState = 0b0,
        Read screen_planes: f32 = 0b1,
        ReadWrite screen_frames: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/screen/screen_tiles.comp`
    screen_tiles, Thread, subgroups false, barriers false, features [],
    spirv "screen_tiles.spv" "screen_tiles.spv",
    push { count: u32, tiles_per_frame: u32, }
    spec { 0 workgroup_size: u32, 1 tile: u32, }
    buffers {
        Read frames: Frame = 0b0,
        Read screen_frames: u32 = 0b0,
        Read tile_counts: u32 = 0b0,
        Read splats: Splat = 0b111111,
        ReadWrite tile_marks: u32 = 0b0,
        ReadWrite count: u32 = 0b0,
        Write forward_tiles: u32 = 0b0,
        Write backward_tiles: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/sort/dispatch_args.comp`
    dispatch_args, Thread, subgroups false, barriers false, features [],
    spirv "dispatch_args.spv" "dispatch_args.spv",
    push { count_index: u32, capacity: u32, items_per_group: u32, args_index: u32, resource_index: u32, }
    spec { 0 workgroup_size: u32, }
    buffers {
        ReadWrite count: u32 = 0b0,
        Write dispatch_args: u32 = 0b0,
        ReadWrite status: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/sort/radix_downsweep.comp`
    radix_downsweep, Subgroup, subgroups true, barriers false, features [ComputeFullSubgroups, SubgroupBroadcastDynamicId, SubgroupSizeControl],
    spirv "radix_downsweep.spv" "radix_downsweep.software.spv",
    push { count_index: u32, kept_index: u32, shift: u32, }
    spec { 0 workgroup_size: u32, 1 block: u32, 2 digit_bits: u32, 3 compact: bool, 4 lanes: u32, 5 indexed: bool, 6 row_lanes: u32, 7 lockstep: bool, }
    buffers {
        ReadWrite count: u32 = 0b0,
        Read keys_in: u32 = 0b0,
        Read values_in: u32 = 0b0,
        Read block_counts: u32 = 0b0,
        Read digit_totals: u32 = 0b0,
        Write keys_out: u32 = 0b0,
        Write values_out: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/sort/radix_spine.comp`
    radix_spine, Workgroup, subgroups true, barriers true, features [ComputeFullSubgroups, SubgroupSizeControl],
    spirv "radix_spine.spv" "radix_spine.software.spv",
    push { count_index: u32, }
    spec { 0 workgroup_size: u32, 1 block: u32, 2 digit_bits: u32, }
    buffers {
        Read count: u32 = 0b0,
        ReadWrite block_counts: u32 = 0b0,
        Write digit_totals: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/sort/radix_upsweep.comp`
    radix_upsweep, Subgroup, subgroups true, barriers false, features [ComputeFullSubgroups, SubgroupSizeControl],
    spirv "radix_upsweep.spv" "radix_upsweep.software.spv",
    push { count_index: u32, shift: u32, }
    spec { 0 workgroup_size: u32, 1 block: u32, 2 digit_bits: u32, 3 compact: bool, 6 row_lanes: u32, 7 lockstep: bool, }
    buffers {
        Read count: u32 = 0b0,
        Read keys_in: u32 = 0b0,
        Write block_counts: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/sort/scan_apply.comp`
    scan_apply, Subgroup, subgroups true, barriers false, features [ComputeFullSubgroups, SubgroupBroadcastDynamicId, SubgroupSizeControl],
    spirv "scan_apply.spv" "scan_apply.software.spv",
    push { count_index: u32, }
    spec { 0 workgroup_size: u32, 1 block: u32, 2 gather: bool, }
    buffers {
        Read count: u32 = 0b0,
        Read values: u32 = 0b0,
        Read index: u32 = 0b0,
        Read block_sums: u32 = 0b0,
        Write offsets: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/sort/scan_reduce.comp`
    scan_reduce, Subgroup, subgroups true, barriers false, features [ComputeFullSubgroups, SubgroupSizeControl],
    spirv "scan_reduce.spv" "scan_reduce.software.spv",
    push { count_index: u32, }
    spec { 0 workgroup_size: u32, 1 block: u32, 2 gather: bool, }
    buffers {
        Read count: u32 = 0b0,
        Read values: u32 = 0b0,
        Read index: u32 = 0b0,
        Write block_sums: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/sort/scan_spine.comp`
    scan_spine, Workgroup, subgroups true, barriers true, features [ComputeFullSubgroups, SubgroupSizeControl],
    spirv "scan_spine.spv" "scan_spine.software.spv",
    push { count_index: u32, total_index: u32, }
    spec { 0 workgroup_size: u32, 1 block: u32, }
    buffers {
        ReadWrite count: u32 = 0b0,
        ReadWrite block_sums: u32 = 0b0,
    }
}
kernel! {
    /// `glsl/verify/fma_rate.comp`
    fma_rate, Thread, subgroups false, barriers false, features [],
    spirv "fma_rate.spv" "fma_rate.spv",
    push { count: u32, rounds: u32, factor: f32, term: f32, }
    spec { 0 workgroup_size: u32, 1 chains: u32, 2 depth: u32, }
    buffers {
        Write chain_sums: f32 = 0b1,
    }
}
/// Plain constants of `glsl/shared/`, by file.
pub mod constants {
pub mod adam {
#[doc = "bound of an unbounded parameter"] pub const FREE: f32 = 1e30;
#[doc = ""] pub const PACE: f32 = 2.0;
}
pub mod adam_one {
#[doc = ""] pub const GRADIENT_MAX: f32 = 1e17;
#[doc = ""] pub const CURVATURE_DECAY: f32 = 0.95;
#[doc = ""] pub const NEWTON_REACH: f32 = 3.0;
}
pub mod bands {
#[doc = "blend weights of a view, summed over its pixels"] pub const LEAST_WEIGHT: f32 = 1e-3;
#[doc = "of a channel"] pub const MOST_COLOR: f32 = 1e3;
#[doc = "of the coefficients of bands, relative to the weights of all views"] pub const RIDGE: f32 = 0.0016;
#[doc = "a view of more has no others to be told by, and gains nothing"] pub const MOST_LEVERAGE: f32 = 0.99;
}
pub mod betas {
#[doc = "value of SH_DEGREE that selects betas"] pub const BETAS: u32 = 4;
#[doc = "lobes of a Gaussian"] pub const BETA_LOBES: u32 = 2;
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
#[doc = "scene units (3DGS): a Gaussian is culled unless its camera z is beyond this"] pub const NEAR: f32 = 0.2;
}
pub mod density {
#[doc = "Gaussians before the refinement"] pub const OLD: u32 = 0;
#[doc = "Gaussians that stay"] pub const ALIVE: u32 = 1;
#[doc = "Gaussians that may be drawn; with replacement, the sum of their weights"] pub const CANDIDATES: u32 = 2;
#[doc = "Gaussians that are drawn"] pub const CHILDREN: u32 = 3;
#[doc = "Gaussians after the refinement"] pub const NEW: u32 = 4;
#[doc = ""] pub const WORDS: u32 = 5;
#[doc = "sum of blend weight times the pixel's error"] pub const ERROR: u32 = 0;
#[doc = "sum of blend weight"] pub const WEIGHT: u32 = 1;
#[doc = "sum of the length of the mean's gradient in the image, in halves of its sides"] pub const PULL: u32 = 2;
#[doc = "number of views that blend the Gaussian"] pub const SEEN: u32 = 3;
#[doc = "number of components"] pub const SCORES: u32 = 4;
#[doc = "mean |difference| of the channels, and 1"] pub const ERRORS: u32 = 0;
#[doc = "differences of red and green"] pub const RED_GREEN: u32 = 1;
#[doc = "difference of blue, and 1"] pub const BLUE: u32 = 2;
#[doc = ""] pub const MCMC: u32 = 0;
#[doc = ""] pub const ADC: u32 = 1;
#[doc = ""] pub const BUDGET: u32 = 2;
#[doc = ""] pub const HASH_KEY: u32 = 0;
#[doc = ""] pub const HASH_DRAW: u32 = 1;
#[doc = ""] pub const HASH_SPLIT: u32 = 2;
#[doc = ""] pub const HASH_NOISE: u32 = 3;
}
pub mod dispatch {
#[doc = "smallest maxComputeWorkGroupCount that Vulkan allows"] pub const GROUPS_PER_DIMENSION: u32 = 65535;
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
#[doc = "of the first moments only: number of the last Newton step, from 1"] pub const LAST_STEP: u32 = 11;
#[doc = "at half width, see above"] pub const HALF_GEOMETRY_PLANES: u32 = 8;
#[doc = "2^-16: 22 bits reach from -32 to 32, with an error of 8e-6 of a scale"] pub const LOG_SCALE_STEP: f32 = 1.52587890625e-5;
#[doc = "of a part's 20 bits"] pub const ROTATION_LOW_BITS: u32 = 10;
#[doc = "2^19"] pub const ROTATION_ZERO: u32 = 524288;
#[doc = "sqrt(1/2) / (2^19 - 1): only the largest component can exceed sqrt(1/2)"] pub const ROTATION_STEP: f32 = 1.3487017e-6;
#[doc = "3 planes, of any length"] pub const LOBE_DIRECTION: u32 = 0;
#[doc = "T, 0.01 to 1"] pub const LOBE_WIDTH: u32 = 3;
#[doc = "beta"] pub const LOBE_SHARPNESS: u32 = 4;
#[doc = ""] pub const LOBE_PLANES: u32 = 5;
}
pub mod packed_splat {
#[doc = "1 / 65280, which is ALPHA_MIN / 256"] pub const OPACITY_STEP: f32 = 1.53186275e-5;
#[doc = "largest half float"] pub const MOST_HALF: f32 = 65504.0;
}
pub mod population {
#[doc = "segment"] pub const BASE: u32 = 0;
#[doc = "segment: Gaussians of the base with bands, if the others have none"] pub const BANDED: u32 = 1;
#[doc = "segment"] pub const SUPPLEMENT: u32 = 2;
#[doc = ""] pub const SEGMENTS: u32 = 3;
}
pub mod pursuit {
#[doc = ""] pub const LEVELS: u32 = 3;
#[doc = "px, standard deviation"] pub const FIRST_BLUR: f32 = 0.7;
#[doc = "texels of the level below, so that variances add up to the double deviation: sqrt(3) * 0.7"] pub const NEXT_BLUR: f32 = 1.2124;
#[doc = "number of lobe widths tried; the last one means no lobe"] pub const WIDTHS: u32 = 6;
#[doc = "per size and lobe width, see pursuit_score"] pub const SUMS: u32 = 10;
#[doc = "pixels"] pub const ERROR_BLOCK: u32 = 256;
#[doc = "px"] pub const CELL: u32 = 2;
#[doc = "standard deviations within which a chosen candidate changes the residual"] pub const REACH: f32 = 2.5;
#[doc = "standard deviations within which no other candidate is chosen in the same round"] pub const CORE: f32 = 0.5;
#[doc = "px: a whole number of pixels, such as 2.5 deviations of 2 px, is not rounded up for a rounding error"] pub const WINDOW_SLACK: f32 = 1e-3;
#[doc = "unit of `explained`: all of a residual is explained"] pub const WHOLE: f32 = 65536.0;
#[doc = "px: larger footprints are scored at this size"] pub const WIDEST: f32 = 3.2;
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
#[doc = "a background color"] pub const OPAQUE: u32 = 0;
#[doc = "nothing: rgb is multiplied by alpha"] pub const PREMULTIPLIED: u32 = 1;
#[doc = "the target's content"] pub const OVER: u32 = 2;
#[doc = "largest half float"] pub const HALF_MAX: f32 = 65504.0;
}
pub mod saturate {
#[doc = ""] pub const SATURATED: u32 = 0xFFFFFFFF;
}
pub mod screen {
#[doc = "planes that have moments"] pub const LEARNED: u32 = 9;
#[doc = ""] pub const SCREEN_PLANES: u32 = 10;
#[doc = "not rendered, and unchanged"] pub const WAITING: u32 = 0;
#[doc = "rendered, stepped and pruned, and more are drawn"] pub const DRAWING: u32 = 1;
#[doc = "rendered, stepped and pruned for one more round, without a draw at its end"] pub const FILLED: u32 = 2;
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
#[doc = "and the words after it: the largest demand for each resource, see above"] pub const STATUS_NEEDED: u32 = 2;
#[doc = "of splats and tiles"] pub const INTERSECTIONS: u32 = 0;
#[doc = "the base's capacity"] pub const BASE_GAUSSIANS: u32 = 1;
#[doc = "the capacity of Gaussians with bands"] pub const BANDED_GAUSSIANS: u32 = 2;
#[doc = "the supplement's capacity"] pub const SUPPLEMENT_GAUSSIANS: u32 = 3;
#[doc = ""] pub const RESOURCES: u32 = 4;
#[doc = "for dispatch_args: the count always fits, so nothing is reported"] pub const NO_RESOURCE: u32 = 0xFFFFFFFF;
}
pub mod subgroup {
#[doc = ""] pub const LOOK: u32 = 8;
}
pub mod sums {
#[doc = "guard: sum of many slots by the whole subgroup"] pub const MANY: u32 = 256;
#[doc = "guard: sum: several slots an iteration"] pub const UNROLL: u32 = 4;
}
pub mod unit {
#[doc = "smallest normal number: devices may flush smaller ones to 0"] pub const FLOAT_MIN: f32 = 1.17549435e-38;
#[doc = ""] pub const FLOAT_MAX: f32 = 3.402823466e38;
}
}
