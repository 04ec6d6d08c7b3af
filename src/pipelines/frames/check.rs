//! Validates a frame before anything is recorded.

use ash::vk;
use glam::DMat3;

use super::{
    Frames,
    view::{Blend, Frame, FrameView, Instance, Light, Target, Texel},
};
use crate::{
    error::{Error, Result},
    gpu::{BufferRange, ImageRegion, Pixels},
    scene::Camera,
};

/// Formats of depth images: 32-bit floats, since copies do not convert texels. For depths of 16 or 24 bits,
/// use a buffer.
pub const DEPTH_FORMATS: [vk::Format; 3] =
    [vk::Format::D32_SFLOAT, vk::Format::D32_SFLOAT_S8_UINT, vk::Format::R32_SFLOAT];

/// Formats of images that receive Gaussian numbers.
pub const ID_FORMATS: [vk::Format; 1] = [vk::Format::R32_UINT];

/// Layouts of images that glint writes, reads, or both.
const WRITTEN: [vk::ImageLayout; 3] = [BOTH[0], vk::ImageLayout::TRANSFER_DST_OPTIMAL, BOTH[1]];
const READ: [vk::ImageLayout; 3] = [BOTH[0], vk::ImageLayout::TRANSFER_SRC_OPTIMAL, BOTH[1]];
const BOTH: [vk::ImageLayout; 2] = [vk::ImageLayout::GENERAL, vk::ImageLayout::SHARED_PRESENT_KHR];

/// Tolerance of RᵀR of a camera against the identity: float32's error after a few hundred matrix products. At
/// a focal length of 1000 it moves a pixel by less than half a pixel.
const SKEW: f64 = 1e-3;

/// Checks that the image region, in one of `layouts`, or the buffer range is valid.
fn check_place(what: &str, pixels: &Pixels, layouts: &[vk::ImageLayout]) -> Result<()> {
    let wrong = match pixels {
        Pixels::Image(ImageRegion { image, .. }) if *image == vk::Image::null() => "an image that is null".into(),
        Pixels::Image(ImageRegion { layout, .. }) if !layouts.contains(layout) => {
            format!("an image in layout {layout:?}, expected one of {layouts:?}")
        }
        Pixels::Image(ImageRegion { offset, .. }) if offset.iter().any(|&o| o < 0) => {
            format!("a corner at {offset:?}, expected 0 or more")
        }
        Pixels::Buffer(BufferRange { buffer, .. }) if *buffer == vk::Buffer::null() => "a buffer that is null".into(),
        Pixels::Buffer(BufferRange { offset, .. }) if offset % 4 != 0 => {
            format!("a buffer's part begins at byte {offset}, expected a multiple of 4")
        }
        _ => return Ok(()),
    };
    Err(Error::Usage(format!("{what}: {wrong}")))
}

/// Checks a count of a frame against its limit.
fn within(what: &str, has: u64, most: u64) -> Result<()> {
    match has <= most {
        true => Ok(()),
        false => Err(Error::Usage(format!("a frame of {has} {what}, made for {most}"))),
    }
}

impl Frames {
    pub(super) fn check(&self, frame: &Frame<'_>) -> Result<()> {
        let limits = &self.limits;
        within("slots", u64::from(frame.slot) + 1, limits.in_flight.into())?;
        within("instances", frame.instances.len() as u64, limits.instances.into())?;
        within("views", frame.views.len() as u64, limits.views.into())?;
        within(
            "Gaussians",
            frame.instances.iter().map(|i| u64::from(i.model.capacity())).sum(),
            limits.gaussians.into(),
        )?;
        frame.instances.iter().try_for_each(|instance| self.check_instance(instance))?;
        frame.views.iter().try_for_each(|view| self.check_view(view))
    }

    fn check_instance(&self, instance: &Instance<'_>) -> Result<()> {
        let Instance { model, transform: t, upto, degree } = *instance;
        self.stages.check(model, upto, degree)?;
        if !model.context().is_same(&self.context) {
            return Err(Error::Usage("a model of another context".into()));
        }
        if degree > model.sh_degree {
            return Err(Error::Usage(format!("harmonics of degree {degree} of a model of {}", model.sh_degree)));
        }
        let finite = t.rotation.is_finite() && t.translation.is_finite() && t.scale.is_finite();
        // float32 keeps a unit quaternion's length within 1e-6.
        if !(finite && t.scale > 0.0 && (t.rotation.length() - 1.0).abs() < 1e-5) {
            return Err(Error::Usage(format!(
                "a transform of {t:?}, expected finite numbers, a scale above 0 and a rotation of unit length"
            )));
        }
        Ok(())
    }

    fn check_view(&self, view: &FrameView) -> Result<()> {
        let limits = &self.limits;
        let Camera { width, height, fx, fy, cx, cy, rotation, translation } = view.camera;
        within("pixels in a row", width.into(), limits.width.into())?;
        within("rows", height.into(), limits.height.into())?;
        let numbers = [fx, fy, cx, cy, view.near, view.depth_form.a, view.depth_form.b];
        let finite = numbers.iter().all(|v| v.is_finite()) && rotation.is_finite() && translation.is_finite();
        let depths = view.depth_form.b != 0.0;
        if !(finite && width > 0 && height > 0 && fx > 0.0 && fy > 0.0 && view.near > 0.0 && depths) {
            return Err(Error::Usage(format!(
                "a view of {:?}, near plane {}, depths {:?}: expected finite numbers, sizes, focal lengths and near plane above 0, and depths that differ",
                view.camera, view.near, view.depth_form
            )));
        }
        let off = rotation.transpose() * rotation - DMat3::IDENTITY;
        if !off.to_cols_array().iter().all(|v| v.abs() < SKEW) {
            return Err(Error::Usage(format!("a camera whose rotation is none: {rotation:?}")));
        }
        if let Some(target) = view.color {
            within("words for a texel", target.texel.words().into(), limits.texel.words().into())?;
            if !(target.exposure >= 0.0 && target.exposure.is_finite()) {
                return Err(Error::Usage(format!("an exposure of {}, expected 0 or more", target.exposure)));
            }
            if let Blend::Opaque(color) = target.blend
                && !color.iter().all(|channel| (0.0..f32::INFINITY).contains(channel))
            {
                return Err(Error::Usage(format!("a background of {color:?}, expected finite numbers from 0 on")));
            }
        }
        if view.depth_in.is_some() && !limits.depth_in {
            return Err(Error::Usage("depths hide Gaussians in a view, frames were made without depth_in".into()));
        }
        if (view.depth_out.is_some() || view.ids.is_some()) && !limits.depth_out {
            return Err(Error::Usage("a view asks for depths or ids, frames were made without depth_out".into()));
        }
        let format = |pixels: Option<Pixels>| match pixels {
            Some(Pixels::Image(region)) => Some(region.format),
            _ => None,
        };
        if let (Some(target), Some(has)) = (view.color, format(view.color.map(|c| c.pixels)))
            && Texel::of(has) != Some(target.texel)
        {
            return Err(Error::Usage(format!("a target of format {has:?}, whose texels are not {:?}", target.texel)));
        }
        if let (Some(Target { light: Light::Linear, .. }), Some(has)) =
            (view.color, format(view.color.map(|c| c.pixels)))
            && [vk::Format::R8G8B8A8_SRGB, vk::Format::B8G8R8A8_SRGB].contains(&has)
        {
            return Err(Error::Usage(format!("a target of format {has:?} holds encoded values, not linear light")));
        }
        let depths = [("depths that hide Gaussians", view.depth_in), ("depths of Gaussians", view.depth_out)];
        let depths = depths.map(|(what, pixels)| (what, pixels, &DEPTH_FORMATS[..]));
        for (what, pixels, formats) in depths.into_iter().chain([("numbers of Gaussians", view.ids, &ID_FORMATS[..])]) {
            if let Some(has) = format(pixels).filter(|has| !formats.contains(has)) {
                return Err(Error::Usage(format!(
                    "an image of format {has:?} for {what}, expected one of {formats:?}"
                )));
            }
        }
        let both = matches!(view.color, Some(Target { blend: Blend::Over, .. }));
        for (what, pixels, layouts) in [
            ("a target", view.color.map(|c| c.pixels), if both { &BOTH[..] } else { &WRITTEN }),
            ("depths that hide Gaussians", view.depth_in, &READ),
            ("depths of Gaussians", view.depth_out, &WRITTEN),
            ("numbers of Gaussians", view.ids, &WRITTEN),
        ] {
            if let Some(pixels) = pixels {
                check_place(what, &pixels, layouts)?;
            }
        }
        Ok(())
    }
}
