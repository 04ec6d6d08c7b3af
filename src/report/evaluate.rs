//! Evaluates a scene against photos, with and without its supplement.

use serde::Serialize;

use super::decompose::{Decomposition, PartsQuality, decompose, judge};
use super::metrics::{Pair, Quality, qualities};
use crate::{
    Error, Result,
    data::{DIFFUSE, Image, Photo, SPECULAR},
    gpu::Context,
    pipelines::{
        layers::{Layer, Layers},
        render::{RenderOptions, Rendered},
    },
    scene::Scene,
};

/// Quality of one view, or another measure of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ViewQuality<T = Quality> {
    /// Name of the photo in the dataset.
    pub name: String,
    /// Quality of the base Gaussians alone, as stored in this scene.
    pub base: T,
    /// Quality of the whole scene; equals `base` if there is no supplement.
    pub augmented: T,
}

/// Quality of all views and their means.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Evaluation<T = Quality> {
    /// Mean quality of the base Gaussians alone.
    pub base: T,
    /// Mean quality of the whole scene.
    pub augmented: T,
    /// Views in the order of the photos, without those whose masks leave out every pixel.
    pub views: Vec<ViewQuality<T>>,
}

/// Photo with the renders that are compared to it.
pub struct Compared<'a> {
    /// The photo.
    pub photo: &'a Photo,
    /// Pixels of the photo after preparation.
    pub truth: &'a Image,
    /// Render of the base Gaussians alone.
    pub base: &'a Rendered,
    /// Render of the whole scene; equals `base` if there is no supplement.
    pub whole: &'a Rendered,
    /// Quality of both renders.
    pub quality: &'a ViewQuality,
}

/// Compares renders of `scene`, clamped but not quantized, with `photos`. These and `background` belong to
/// one dataset. Only one view is in memory at a time; `each` gets it. Photos whose masks leave out every
/// pixel are skipped.
///
/// # Errors
/// [`Error::Usage`] if no photo is left; errors of files, of the device and of `each`.
pub fn evaluate(
    context: &Context,
    scene: &Scene,
    photos: &[&Photo],
    options: RenderOptions,
    background: [f32; 3],
    mut each: impl FnMut(&Compared<'_>) -> Result<()>,
) -> Result<Evaluation> {
    let augmented = scene.supplement.is_some();
    let mut layers = Layers::new(context, scene, photos.iter().map(|p| &p.camera), options)?;
    let mut views = Vec::with_capacity(photos.len());
    for photo in photos {
        let truth = photo.load(background)?;
        if !truth.any_counts() {
            continue;
        }
        let base = layers.render(Layer::Base, &photo.camera, background)?;
        let whole = if augmented { Some(layers.render(Layer::Whole, &photo.camera, background)?) } else { None };
        let (width, height, mask) = (truth.width, truth.height, truth.mask.as_deref());
        let pair = |image| Pair { image, reference: &truth.rgb, width, height, mask };
        let pairs: Vec<Pair> = [Some(&base), whole.as_ref()].into_iter().flatten().map(|r| pair(&r.color)).collect();
        let found = qualities(&pairs).map_err(|error| Error::Usage(format!("photo `{}`: {error}", photo.name)))?;
        let augmented = found.get(1).copied().unwrap_or(found[0]);
        let quality = ViewQuality { name: photo.name.clone(), base: found[0], augmented };
        let whole = whole.as_ref().unwrap_or(&base);
        each(&Compared { photo, truth: &truth, base: &base, whole, quality: &quality })?;
        views.push(quality);
    }
    let mean = |of: fn(&ViewQuality) -> Quality| Quality::mean(&views.iter().map(of).collect::<Vec<_>>());
    let none = || nothing_to_compare(photos.len());
    Ok(Evaluation {
        base: mean(|v| v.base).ok_or_else(none)?,
        augmented: mean(|v| v.augmented).ok_or_else(none)?,
        views,
    })
}

fn nothing_to_compare(photos: usize) -> Error {
    Error::Usage(match photos {
        0 => "there are no photos to compare with".into(),
        n => format!(
            "there is nothing to compare with: masks leave out every pixel of {n} photo{}",
            if n == 1 { "" } else { "s" }
        ),
    })
}

/// Quality of the parts in one view.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ViewParts {
    /// Name of the photo in the dataset.
    pub name: String,
    /// PSNR of both parts.
    #[serde(flatten)]
    pub quality: PartsQuality,
}

/// Quality of the parts in all views and their means.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PartsEvaluation {
    /// Mean over the views.
    #[serde(flatten)]
    pub mean: PartsQuality,
    /// Views in the order of the photos, without those whose masks leave out every pixel.
    pub views: Vec<ViewParts>,
}

/// Renders the diffuse and the specular part of a scene from the camera of `photo` (method, section 6).
pub fn render_parts(layers: &mut Layers, photo: &Photo, background: [f32; 3]) -> Result<Decomposition> {
    let whole = layers.render(Layer::Whole, &photo.camera, background)?;
    let constant = layers.render(Layer::Constant, &photo.camera, background)?;
    Ok(decompose(&whole.color, &constant.color))
}

/// Compares the parts of `scene` with the true ones of `photos` (see [`Photo::part`]).
///
/// # Errors
/// [`Error::Usage`] if no photo is left or a true part is missing; errors of files and of the device.
pub fn evaluate_parts(
    context: &Context,
    scene: &Scene,
    photos: &[&Photo],
    options: RenderOptions,
    background: [f32; 3],
) -> Result<PartsEvaluation> {
    let missing = |photo: &Photo, part: &str| {
        Error::Usage(format!(
            "photo `{}` has no true {part} part: expected an image of its name in a folder {part} next to the photos' \
             folder, as glint synth writes them",
            photo.name
        ))
    };
    let part = |photo: &Photo, part| photo.part(part)?.ok_or_else(|| missing(photo, part));
    // All parts are found before anything is rendered.
    let truths =
        photos.iter().map(|photo| Ok([part(photo, DIFFUSE)?, part(photo, SPECULAR)?])).collect::<Result<Vec<_>>>()?;
    let mut layers = Layers::new(context, scene, photos.iter().map(|p| &p.camera), options)?;
    let mut views = Vec::with_capacity(photos.len());
    for (photo, [diffuse, specular]) in photos.iter().zip(&truths) {
        // The photo's mask decides, so that these are the views of `evaluate`.
        if !photo.load(background)?.any_counts() {
            continue;
        }
        let (diffuse, specular) = (diffuse.load(background)?, specular.load(background)?);
        let parts = render_parts(&mut layers, photo, background)?;
        let quality = judge(&parts, &diffuse.rgb, &specular.rgb, diffuse.mask.as_deref())
            .map_err(|error| Error::Usage(format!("photo `{}`: {error}", photo.name)))?;
        views.push(ViewParts { name: photo.name.clone(), quality });
    }
    let none = || nothing_to_compare(photos.len());
    let mean = PartsQuality::mean(&views.iter().map(|v| v.quality).collect::<Vec<_>>()).ok_or_else(none)?;
    Ok(PartsEvaluation { mean, views })
}
