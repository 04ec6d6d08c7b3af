//! What a frame shows, and where it goes.

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

/// A texel of a target. Images with a format of the `_SRGB` kind hold encoded values: they are [`Light::Encoded`].
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
    /// That of an image's format.
    pub fn of(format: vk::Format) -> Option<Self> {
        Some(match format {
            vk::Format::R8G8B8A8_UNORM | vk::Format::R8G8B8A8_SRGB => Texel::Rgba8,
            vk::Format::B8G8R8A8_UNORM | vk::Format::B8G8R8A8_SRGB => Texel::Bgra8,
            vk::Format::R16G16B16A16_SFLOAT => Texel::Rgba16F,
            vk::Format::R32G32B32A32_SFLOAT => Texel::Rgba32F,
            _ => return None,
        })
    }

    /// Words of 4 bytes.
    pub fn words(self) -> u32 {
        match self {
            Texel::Rgba8 | Texel::Bgra8 => 1,
            Texel::Rgba16F => 2,
            Texel::Rgba32F => 4,
        }
    }
}

/// What a target's numbers are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Light {
    /// sRGB-encoded, as photographs are: what Gaussians are trained and blended in.
    Encoded,
    /// Linear, as a renderer's light is before its tone mapping.
    Linear,
}

/// What becomes of that which Gaussians do not cover.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Blend {
    /// This colour, sRGB-encoded, 0 or more in each channel; alpha is 1.
    Opaque([f32; 3]),
    /// Nothing: colours are weighed by alpha.
    Premultiplied,
    /// What the target holds, blended in encoded values whatever the target's are.
    Over,
}

/// The colours of a view.
#[derive(Debug, Clone, Copy)]
pub struct Target {
    /// Where they go.
    pub pixels: Pixels,
    /// Of the image, or of the buffer.
    pub texel: Texel,
    /// What its numbers are.
    pub light: Light,
    /// What becomes of that which lies behind.
    pub blend: Blend,
    /// Factor of the Gaussians' linear light; 1 leaves them as they are. What lies behind them is not exposed, a background neither.
    pub exposure: f32,
}

impl Target {
    /// Opaque over black, as the scene was trained.
    pub fn new(pixels: Pixels, texel: Texel) -> Self {
        Target { pixels, texel, light: Light::Encoded, blend: Blend::Opaque([0.0; 3]), exposure: 1.0 }
    }
}

/// How camera z and a depth buffer's numbers belong together: depth = a + b / z. All perspective projections are of this form,
/// reversed or not, with a far plane or without.
///
/// Of the planes only depths know. What lies beyond the far plane is drawn, and its depth, like that of no Gaussian, is the far plane's:
/// exactly 1, of reversed projections 0. Such a depth, which a cleared buffer holds, hides nothing. A point of a Gaussian before the near
/// plane has that plane's depth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthForm {
    /// The depth at infinity.
    pub a: f64,
    /// Scene units. Below 0 depths rise with the distance, above 0 they fall; never 0.
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

    /// Camera z of the near plane: where the depth is 0, of reversed projections 1. Of numbers that are no projection's it may be
    /// anything.
    pub fn near(self) -> f64 {
        if self.b < 0.0 { -self.b / self.a } else { self.b / (1.0 - self.a) }
    }

    /// The depth of what is beyond the far plane, which a depth buffer is cleared to: 1, of reversed projections 0.
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
    /// In the world in which instances stand. Its size is that of the targets; its rotation may mirror, for what a mirror shows.
    pub camera: Camera,
    /// Camera z, scene units of the world; Gaussians whose centre is not beyond are left out. [`FrameView::new`] has 3DGS's 0.2,
    /// [`FrameView::from_matrices`] the projection's own. The nearer it is, the larger a Gaussian before the eye becomes: a scene that was
    /// trained with 0.2 may hold some that were never seen from so near.
    pub near: f64,
    /// Of `depth_in` and `depth_out`.
    pub depth_form: DepthForm,
    /// Where colours go, if they are wanted.
    pub color: Option<Target>,
    /// Float32 depths of what is there already: what lies behind is hidden, but [`DepthForm::empty`] hides nothing. An image is of
    /// [`DEPTH_FORMATS`](super::DEPTH_FORMATS).
    pub depth_in: Option<Pixels>,
    /// Float32 depths of the Gaussians, 0 to 1: of each pixel where transmittance falls below one half, else [`DepthForm::empty`]. An
    /// image is of [`DEPTH_FORMATS`](super::DEPTH_FORMATS).
    pub depth_out: Option<Pixels>,
    /// Numbers of the same Gaussians (u32), counted through the capacities of all instances; `u32::MAX` where there is none. An image is
    /// of [`ID_FORMATS`](super::ID_FORMATS).
    pub ids: Option<Pixels>,
}

impl FrameView {
    /// Without targets yet, and 3DGS's near plane.
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

    /// From a renderer's matrices: world to view, and view to Vulkan's clip space (y down, depth 0 to 1) of a viewport of
    /// `width` × `height` pixels. Depths and the near plane are those that the projection makes.
    ///
    /// # Errors
    /// [`Error::Usage`] where the projection is no perspective one, is skewed or has no near plane ahead, or the view is more than
    /// rotation and translation.
    pub fn from_matrices(view: DMat4, projection: DMat4, width: u32, height: u32) -> Result<Self> {
        let p = projection;
        let bad = |what: &str| Err(Error::Usage(format!("{what}: {:?}", p.to_cols_array())));
        let forward = p.z_axis.w;
        // How far a float32 matrix may be from what it is meant to be.
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
        // Camera axes: x right, y down in the image, z forward. A view space of another handedness or with y up is mirrored here.
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

/// Where a model stands in the world: turned, then scaled, then moved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transform {
    /// Of unit length.
    pub rotation: DQuat,
    /// Of all axes alike.
    pub scale: f64,
    /// Where the model's origin goes, scene units of the world.
    pub translation: DVec3,
}

impl Transform {
    /// The world is the model's own.
    pub const IDENTITY: Self = Transform { rotation: DQuat::IDENTITY, scale: 1.0, translation: DVec3::ZERO };
}

/// A model in a frame.
#[derive(Clone, Copy)]
pub struct Instance<'a> {
    /// Any number of instances may be of one model.
    pub model: &'a Model,
    /// Where it stands.
    pub transform: Transform,
    /// The last segment that is shown.
    pub upto: Segment,
    /// Bands of harmonics, at most the model's; of spherical betas all are shown from 1 on.
    pub degree: u32,
}

impl<'a> Instance<'a> {
    /// All of it, where it is.
    pub fn of(model: &'a Model) -> Self {
        Instance { model, transform: Transform::IDENTITY, upto: Segment::Supplement, degree: model.sh_degree }
    }
}

/// What is recorded at once.
#[derive(Clone, Copy)]
pub struct Frame<'a> {
    /// Which of the frames in flight it takes the place of; what was recorded in it before has run.
    pub slot: u32,
    /// In one common order by depth.
    pub instances: &'a [Instance<'a>],
    /// One after the other.
    pub views: &'a [FrameView],
}

/// What a camera of the world sees of a model that stands in it: camera axes of the world, in its units, from where the camera is
/// among the model's own Gaussians. So covariances, depths, harmonics and lobes all come out turned and scaled.
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
