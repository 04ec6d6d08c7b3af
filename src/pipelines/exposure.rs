//! Exposure correction (method, section 2): learns an affine map of colors for each training photograph. The
//! blended image goes through it before the comparison with the photograph. The mean of the maps stays the
//! identity, so that the scene takes on no cast common to all photographs. Only training uses the maps.

use super::{checkpoint::Checkpoint, plan::bind, raster::RasterBuffers, views::Views};
use crate::{
    error::Result,
    gpu::{Buffer, Context, Location, Recorder},
    stages::{
        WORKGROUP,
        constants::exposure::{MAP, MOMENTS, SUM_PIXELS},
        exposure_apply, exposure_backward, exposure_step,
        ssim::SUM_WORKGROUP,
        types::Frame,
    },
};

/// Learning rate of a map's entries per step of its photograph, at the first and last step of the run;
/// log-linear in between. A third of 3DGS's (`exposure_lr_init` and `exposure_lr_final` of its
/// `arguments/__init__.py`): faster maps absorb view-dependent color, which belongs to the scene.
pub const RATES: [f64; 2] = [0.003, 0.0003];

/// The identity map, rows of (M | b).
pub const IDENTITY: [f32; MAP as usize] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];

/// Names in a checkpoint.
const KEPT: [&str; 2] = ["exposure.maps", "exposure.moments"];

/// The maps of all photographs, their learning state, and the corrected image.
pub struct Exposure {
    photos: u32,
    /// 12 entries per photograph, rows of (M | b).
    maps: Buffer<f32>,
    /// See `glsl/shared/exposure.glsl`.
    moments: Buffer<f32>,
    /// Gradients of a map over parts of an image.
    sums: Buffer<f32>,
    /// The blended image of the current view after its photograph's map.
    pub corrected: Buffer<[f32; 4]>,
    apply: exposure_apply::Stage,
    backward: exposure_backward::Stage,
    step: exposure_step::Stage,
}

impl Exposure {
    /// For the photographs of `views`, with identity maps. A photograph has one map for all its sizes.
    pub fn new(context: &Context, views: &Views) -> Result<Self> {
        let info = context.info();
        let (photos, pixels) = (views.photos as usize, views.max_pixels());
        let runs = pixels.div_ceil(SUM_PIXELS) as usize;
        // Each subgroup works alone, and an image has few of them.
        let (alone, together) = (info.subgroup_size, SUM_WORKGROUP.min(info.max_workgroup));
        Ok(Exposure {
            photos: photos as u32,
            maps: Buffer::from_slice(context, "exposure_maps", &IDENTITY.repeat(photos))?,
            moments: Buffer::zeroed(context, "exposure_moments", MOMENTS as usize * photos)?,
            sums: Buffer::new(context, "exposure_sums", MAP as usize * runs, Location::Device)?,
            corrected: Buffer::new(context, "corrected", pixels as usize, Location::Device)?,
            apply: exposure_apply::Stage::new(
                context,
                &exposure_apply::Spec { workgroup_size: info.workgroup(WORKGROUP) },
            )?,
            backward: exposure_backward::Stage::new(context, &exposure_backward::Spec { workgroup_size: alone })?,
            step: exposure_step::Stage::new(context, &exposure_step::Spec { workgroup_size: together })?,
        })
    }

    /// Writes [`Exposure::corrected`] from the blended image of view `view`.
    pub(super) fn record_apply(&self, recorder: &mut Recorder, views: &Views, view: u32, raster: &RasterBuffers) {
        self.apply.record(
            recorder,
            &bind!(exposure_apply { views => frames; self => maps, corrected; raster => image; }),
            &exposure_apply::Push { frame: view, photo: view % self.photos },
            pixels(&views.frame_list[view as usize]),
        );
    }

    /// Turns the gradient by the corrected image into that by the blended one, in place, and computes the
    /// gradient of the view's map.
    pub(super) fn record_backward(&self, recorder: &mut Recorder, views: &Views, view: u32, raster: &RasterBuffers) {
        self.backward.record(
            recorder,
            &bind!(exposure_backward { views => frames; self => maps, sums; raster => image, image_grad; }),
            &exposure_backward::Push { frame: view, photo: view % self.photos },
            runs(&views.frame_list[view as usize]),
        );
    }

    /// Steps the view's map at the fraction `part` (0 to 1) of the run, then resets the mean of all maps to the
    /// identity.
    pub(super) fn record_step(
        &self,
        recorder: &mut Recorder,
        views: &Views,
        view: u32,
        part: f64,
        status: &Buffer<u32>,
    ) {
        self.step.record(
            recorder,
            &exposure_step::Buffers { status, sums: &self.sums, maps: &self.maps, moments: &self.moments },
            &exposure_step::Push {
                photo: view % self.photos,
                photos: self.photos,
                runs: runs(&views.frame_list[view as usize]),
                rate: rate(part),
            },
            1,
        );
    }

    /// The map of each photograph: rows of (M | b). Waits.
    pub fn download(&self) -> Result<Vec<[f32; MAP as usize]>> {
        Ok(self.maps.download()?.as_chunks().0.to_vec())
    }

    /// Adds everything that the remaining steps need to the checkpoint. Waits.
    pub(super) fn keep(&self, checkpoint: &mut Checkpoint) -> Result<()> {
        for (name, buffer, numbers) in self.kept() {
            checkpoint.put(name.into(), [self.photos as usize, numbers as usize], buffer.download()?);
        }
        Ok(())
    }

    /// Finds the data that [`Exposure::keep`] added, for [`Exposure::restore`].
    ///
    /// # Errors
    /// [`Error::Usage`](crate::Error::Usage) if it is missing, or has another number of photographs.
    pub(super) fn find<'a>(&self, checkpoint: &'a Checkpoint) -> Result<[&'a [f32]; 2]> {
        let [maps, moments] = self.kept().map(|(name, buffer, _)| checkpoint.floats(name, buffer.len()));
        Ok([maps?, moments?])
    }

    /// Uploads the data that [`Exposure::find`] returned. Waits.
    pub(super) fn restore(&self, found: [&[f32]; 2]) -> Result<()> {
        for ((_, buffer, _), values) in self.kept().into_iter().zip(found) {
            buffer.upload(0, values)?;
        }
        Ok(())
    }

    fn kept(&self) -> [(&'static str, &Buffer<f32>, u32); 2] {
        let [maps, moments] = KEPT;
        [(maps, &self.maps, MAP), (moments, &self.moments, MOMENTS)]
    }
}

fn pixels(frame: &Frame) -> u32 {
    frame.width * frame.height
}

/// Number of runs of [`SUM_PIXELS`] pixels in a frame.
fn runs(frame: &Frame) -> u32 {
    pixels(frame).div_ceil(SUM_PIXELS)
}

/// Learning rate at the fraction `part` of the run, see [`RATES`].
pub fn rate(part: f64) -> f32 {
    let [first, last] = RATES.map(f64::ln);
    (first * (1.0 - part) + last * part).exp() as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_falls_in_equal_ratios() {
        for (part, want) in [(0.0, 0.003), (0.5, 0.003 / 10f64.sqrt()), (1.0, 0.0003)] {
            assert!((f64::from(rate(part)) / want - 1.0).abs() < 1e-6);
        }
    }
}
