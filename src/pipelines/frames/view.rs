//! The input and output of a frame: views, targets, depth conventions and instances.

use ash::vk;
use glam::{DMat3, DMat4, DQuat, DVec3, DVec4};

use super::super::{
    model::{Model, Segment},
    views::view,
};
use crate::{
    error::{Error, Result},
    gpu::Pixels,
    scene::Camera,
    stages::{
        constants::{constants::NEAR, resolve as numbers},
        types::View,
    },
};

/// Format of a target's texel. Images of an `_SRGB` format hold encoded values: use [`Light::Encoded`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Texel {
    /// 4 bytes, R first.
    Rgba8 = numbers::RGBA8 as isize,
    /// 4 bytes, B first.
    Bgra8 = numbers::BGRA8 as isize,
    /// 8 bytes.
    Rgba16F = numbers::RGBA16F as isize,
    /// 16 bytes.
    Rgba32F = numbers::RGBA32F as isize,
}

impl Texel {
    /// The texel of an image format; `None` if it is not supported.
    pub fn of(format: vk::Format) -> Option<Self> {
        Some(match format {
            vk::Format::R8G8B8A8_UNORM | vk::Format::R8G8B8A8_SRGB => Texel::Rgba8,
            vk::Format::B8G8R8A8_UNORM | vk::Format::B8G8R8A8_SRGB => Texel::Bgra8,
            vk::Format::R16G16B16A16_SFLOAT => Texel::Rgba16F,
            vk::Format::R32G32B32A32_SFLOAT => Texel::Rgba32F,
            _ => return None,
        })
    }

    /// Size in words of 4 bytes.
    pub fn words(self) -> u32 {
        match self {
            Texel::Rgba8 | Texel::Bgra8 => 1,
            Texel::Rgba16F => 2,
            Texel::Rgba32F => 4,
        }
    }
}

/// Encoding of a target's values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Light {
    /// sRGB-encoded, like photographs. Gaussians are trained and blended in this encoding.
    Encoded,
    /// Linear light, as in a renderer before tone mapping.
    Linear,
}

/// Handling of the background.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Blend {
    /// Blends over this color, sRGB-encoded, 0 or more in each channel; alpha is 1.
    Opaque([f32; 3]),
    /// No background: colors are premultiplied by alpha.
    Premultiplied,
    /// Blends over the target's content, in encoded values for either encoding of the target.
    Over,
}

/// Color output of a view.
#[derive(Debug, Clone, Copy)]
pub struct Target {
    /// The image or buffer to write.
    pub pixels: Pixels,
    /// Texel format of the image or buffer.
    pub texel: Texel,
    /// Encoding of its values.
    pub light: Light,
    /// Handling of the background.
    pub blend: Blend,
    /// Factor on the Gaussians' linear light; 1 leaves it unchanged. Not applied to the background.
    pub exposure: f32,
}

impl Target {
    /// Opaque over black, as scenes are trained.
    pub fn new(pixels: Pixels, texel: Texel) -> Self {
        Target { pixels, texel, light: Light::Encoded, blend: Blend::Opaque([0.0; 3]), exposure: 1.0 }
    }
}

/// Maps camera z to depth-buffer values: depth = a + b / z. Every perspective projection has this form,
/// reversed or not, with a far plane or without.
///
/// The planes limit depth values only. A Gaussian beyond the far plane is drawn with the far plane's depth:
/// exactly 1, or 0 if reversed. Pixels without a Gaussian have that depth too, and as an input it hides
/// nothing, as in a cleared buffer. A Gaussian in front of the near plane gets the near plane's depth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthForm {
    /// The depth at infinity.
    pub a: f64,
    /// Scene units, never 0. Below 0, depths rise with the distance; above 0, they fall.
    pub b: f64,
}

impl DepthForm {
    /// 1 at the near plane, falling to 0 at infinity.
    pub fn reversed_infinite(near: f64) -> Self {
        DepthForm { a: 0.0, b: near }
    }

    /// 0 at the near plane, 1 at the far plane.
    pub fn standard(near: f64, far: f64) -> Self {
        DepthForm { a: far / (far - near), b: -far * near / (far - near) }
    }

    /// Camera z of the near plane: the point of depth 0, or 1 if reversed. Arbitrary if the form is not a
    /// projection's.
    pub fn near(self) -> f64 {
        if self.b < 0.0 { -self.b / self.a } else { self.b / (1.0 - self.a) }
    }

    /// The depth beyond the far plane, used to clear a depth buffer: 1, or 0 if reversed.
    pub fn empty(self) -> f32 {
        if self.b < 0.0 { 1.0 } else { 0.0 }
    }

    pub(super) fn array(self) -> [f32; 2] {
        [self.a as f32, self.b as f32]
    }
}

/// One view of a frame.
#[derive(Debug, Clone, Copy)]
pub struct FrameView {
    /// Camera in world coordinates. Its size is that of the targets; its rotation may mirror, to render a
    /// reflection.
    pub camera: Camera,
    /// Camera z in world scene units; Gaussians with a centre in front of it are left out. [`FrameView::new`]
    /// has 3DGS's 0.2, [`FrameView::from_matrices`] the projection's near plane. The smaller it is, the
    /// larger a Gaussian near the eye gets: a scene trained with 0.2 may hold some that no photograph saw
    /// from so near.
    pub near: f64,
    /// The mapping of `depth_in` and `depth_out`.
    pub depth_form: DepthForm,
    /// Color output, if wanted.
    pub color: Option<Target>,
    /// Float32 depths of the caller's meshes, to hide Gaussians behind them; [`DepthForm::empty`] hides
    /// nothing. Image formats: [`DEPTH_FORMATS`](super::DEPTH_FORMATS).
    pub depth_in: Option<Pixels>,
    /// Output of the Gaussians' float32 depths, 0 to 1: the point of a pixel with transmittance one half, or
    /// [`DepthForm::empty`] if there is none. Image formats: [`DEPTH_FORMATS`](super::DEPTH_FORMATS).
    pub depth_out: Option<Pixels>,
    /// Output of the same Gaussians' numbers (u32), counted through the capacities of all instances;
    /// `u32::MAX` if there is none. Image formats: [`ID_FORMATS`](super::ID_FORMATS).
    pub ids: Option<Pixels>,
}

impl FrameView {
    /// A view without targets, with 3DGS's near plane.
    pub fn new(camera: Camera) -> Self {
        FrameView {
            camera,
            near: NEAR.into(),
            depth_form: DepthForm::reversed_infinite(NEAR.into()),
            color: None,
            depth_in: None,
            depth_out: None,
            ids: None,
        }
    }

    /// Builds a view from a renderer's matrices: world to view, and view to Vulkan's clip space (y down,
    /// depth 0 to 1) of a viewport of `width` × `height` pixels. Depth form and near plane follow from the
    /// projection.
    ///
    /// # Errors
    /// [`Error::Usage`] if the projection is not perspective, is skewed or has no near plane ahead, or if the
    /// view matrix is not rigid.
    pub fn from_matrices(view: DMat4, projection: DMat4, width: u32, height: u32) -> Result<Self> {
        let p = projection;
        let bad = |what: &str| Err(Error::Usage(format!("{what}: {:?}", p.to_cols_array())));
        let forward = p.z_axis.w;
        // Tolerance for float32 rounding in the matrices.
        let off = 1e-5;
        if !(forward.abs() - 1.0).abs().lt(&off) || p.x_axis.w != 0.0 || p.y_axis.w != 0.0 || p.w_axis.w != 0.0 {
            return bad("expected a perspective projection, whose w is the distance along the view's axis");
        }
        if p.y_axis.x != 0.0 || p.x_axis.y != 0.0 || p.w_axis.x != 0.0 || p.w_axis.y != 0.0 {
            return bad("expected a projection without skew");
        }
        let rotation = DMat3::from_mat4(view);
        let unit = rotation.transpose() * rotation;
        let last = view.row(3) - DVec4::W;
        if !((0..3).all(|c| (unit.col(c) - DMat3::IDENTITY.col(c)).length() < off) && last.length() < off) {
            return Err(Error::Usage(format!(
                "expected a view of rotation and translation: {:?}",
                view.to_cols_array()
            )));
        }
        // Camera axes: x right, y down in the image, z forward. Mirror a view space of another handedness or
        // with y up.
        let signs = DVec3::new(p.x_axis.x.signum(), p.y_axis.y.signum(), forward.signum());
        let axes = DMat3::from_diagonal(signs);
        let (w, h) = (f64::from(width), f64::from(height));
        let camera = Camera {
            width,
            height,
            fx: p.x_axis.x.abs() * w / 2.0,
            fy: p.y_axis.y.abs() * h / 2.0,
            cx: (signs.z * p.z_axis.x + 1.0) * w / 2.0,
            cy: (signs.z * p.z_axis.y + 1.0) * h / 2.0,
            rotation: axes * rotation,
            translation: axes * view.w_axis.truncate(),
        };
        let depth_form = DepthForm { a: signs.z * p.z_axis.z, b: p.w_axis.z };
        let near = depth_form.near();
        if !(near > 0.0 && near.is_finite()) {
            return bad("expected a projection with a near plane ahead of the eye, and depths from 0 to 1");
        }
        Ok(FrameView { near, depth_form, ..FrameView::new(camera) })
    }
}

/// Pose of a model in the world: rotated, then scaled, then moved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transform {
    /// Unit quaternion.
    pub rotation: DQuat,
    /// Uniform scale of all axes.
    pub scale: f64,
    /// World position of the model's origin, scene units of the world.
    pub translation: DVec3,
}

impl Transform {
    /// The model's own coordinates are the world's.
    pub const IDENTITY: Self = Transform { rotation: DQuat::IDENTITY, scale: 1.0, translation: DVec3::ZERO };
}

/// A model in a frame.
#[derive(Clone, Copy)]
pub struct Instance<'a> {
    /// Several instances may share a model.
    pub model: &'a Model,
    /// Pose in the world.
    pub transform: Transform,
    /// The last segment to show.
    pub upto: Segment,
    /// Bands of harmonics to show, at most the model's; for spherical betas, any value from 1 on shows all.
    pub degree: u32,
}

impl<'a> Instance<'a> {
    /// The whole model, in its own coordinates.
    pub fn of(model: &'a Model) -> Self {
        Instance { model, transform: Transform::IDENTITY, upto: Segment::Supplement, degree: model.sh_degree }
    }
}

/// The content of one recording.
#[derive(Clone, Copy)]
pub struct Frame<'a> {
    /// Slot of the frame in flight that this one replaces; its commands must have run.
    pub slot: u32,
    /// Blended in one common order by depth.
    pub instances: &'a [Instance<'a>],
    /// Rendered one after the other.
    pub views: &'a [FrameView],
}

/// Converts a world camera to a model's own coordinates: axes and units stay those of the world, the position
/// is relative to the model's Gaussians. Covariances, depths, harmonics and lobes then come out rotated and
/// scaled.
pub(super) fn instance_view(camera: &Camera, transform: &Transform, origin: DVec3, near: f64) -> View {
    let Transform { rotation, scale, translation } = *transform;
    let turned = camera.rotation * DMat3::from_quat(rotation);
    // guard: instances around their origin
    let moved = camera.translation + camera.rotation * (translation + scale * (rotation * origin));
    let eye = -(turned.transpose() * moved) / scale;
    let row = |i: usize| {
        let r = scale * turned.row(i);
        [r.x, r.y, r.z, moved[i]].map(|x| x as f32)
    };
    View {
        row_x: row(0),
        row_y: row(1),
        row_z: row(2),
        eye: eye.as_vec3().to_array(),
        near: near as f32,
        ..view(camera, 0)
    }
}
