//! Where the training photos and the Gaussians lie during a run.

use std::path::Path;

use super::{
    Args, Error, Result,
    first::{First, PIXEL_BYTES, fit},
    note,
};
use crate::{cli::output::folder_of, gpu::Context, pipelines::photographs::Storage};

/// Maximum share of the host's memory for photos and Gaussians.
const HOST_PART: f64 = 0.5;

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(in crate::cli) enum PhotosOn {
    /// The device's memory
    Device,
    /// The host's memory
    Host,
    /// A temporary file next to the output
    Disk,
}

impl PhotosOn {
    /// The first that has room for photos of `pixels`. `host` is the memory of a host that the device does not share.
    pub(in crate::cli) fn choose(fits_device: bool, host: Option<u64>, pixels: u64) -> Self {
        match host {
            _ if fits_device => PhotosOn::Device,
            Some(host) if photo_bytes(pixels) as f64 <= HOST_PART * host as f64 => PhotosOn::Host,
            _ => PhotosOn::Disk,
        }
    }

    /// Bytes of the temporary file for photos of `pixels`.
    pub(in crate::cli) fn file_bytes(self, pixels: u64) -> u64 {
        if self == PhotosOn::Disk { photo_bytes(pixels) } else { 0 }
    }

    /// The storage; a file has no name and is gone when the run ends.
    pub(in crate::cli) fn storage(self, output: &Path) -> Result<Storage> {
        Ok(match self {
            PhotosOn::Device => Storage::Device,
            PhotosOn::Host => Storage::Host,
            PhotosOn::Disk => {
                let folder = folder_of(output);
                let file = tempfile::tempfile_in(folder).map_err(|error| Error::io(folder, error))?;
                Storage::File(file, folder.into())
            }
        })
    }

    /// Prints a note if photos of `pixels` lie elsewhere than on the device. `why` begins with a comma.
    pub(in crate::cli) fn tell(self, pixels: u64, why: &str) {
        let place = match self {
            PhotosOn::Device => return,
            PhotosOn::Host => "in the host's memory",
            PhotosOn::Disk => "in a temporary file next to the output",
        };
        let megabytes = photo_bytes(pixels) as f64 / 1e6;
        note(format!("up to {megabytes:.1} MB of photos lie {place}{why}; each step copies one to the device"));
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum GaussiansOn {
    /// The device's memory
    Device,
    /// The device's memory for positions, shapes and opacities, the host's for colors and moments
    Host,
}

/// Where photos and Gaussians are to lie.
#[derive(Debug, clap::Args)]
pub(super) struct PlaceArgs {
    /// Place of the training photos: the device's memory, the host's, or a temporary file next to the output,
    /// for datasets larger than both. From host and disk each step copies its photo to the device. The scene
    /// does not depend on it [default: device; if the photos and the Gaussians do not fit there, host; if the
    /// photos fill more than half of that or the device shares it, disk]
    #[arg(long, value_name = "PLACE", value_enum)]
    photos_on: Option<PhotosOn>,
    /// Place of the Gaussians: the device's memory, or the device's for positions, shapes and opacities and the
    /// host's for colors and moments, for scenes larger than the device. Each step then accesses these over the
    /// bus. The scene does not depend on it [default: device; host if --gaussians do not fit there and the
    /// device does not share the host's memory]
    #[arg(long, value_name = "PLACE", value_enum)]
    gaussians_on: Option<GaussiansOn>,
}

impl GaussiansOn {
    /// The first that has room. `whole` and `geometry`: whether the device has room for all of the Gaussians, and for their geometry alone.
    /// `others` are the bytes that would lie in the memory of a host that the device does not share, of which `host` are free.
    fn choose(whole: bool, geometry: bool, host: Option<u64>, others: u64) -> Self {
        match host {
            Some(host) if !whole && geometry && others <= host => GaussiansOn::Host,
            _ => GaussiansOn::Device,
        }
    }
}

/// Bytes of photos of `pixels`, with their smaller copies.
pub(super) fn photo_bytes(pixels: u64) -> u64 {
    (PIXEL_BYTES * pixels as f64) as u64
}

impl Args {
    /// Chooses where photos of `pixels` and the Gaussians lie, and limits a default maximum of Gaussians to the device's memory. Prints
    /// notes on all of these.
    pub(super) fn choose_places(&self, context: &Context, first: &mut First, pixels: u64) -> (PhotosOn, GaussiansOn) {
        let ([geometry, others], host) = (self.learning_bytes(), context.staging_memory());
        let fits = |bytes, pixels| fit(context.memory_at_most(), bytes, pixels) >= first.most;
        let on =
            self.place.photos_on.unwrap_or_else(|| PhotosOn::choose(fits(geometry + others, pixels), host, pixels));
        let in_host = if on == PhotosOn::Host { photo_bytes(pixels) } else { 0 };
        let why = |asked: bool, what: &str| match asked {
            true => String::new(),
            false => format!(", because the device's memory does not hold {what}{} Gaussians", first.most),
        };
        on.tell(pixels, &why(self.place.photos_on.is_some(), "them and "));
        let on_device = if on == PhotosOn::Device || on == PhotosOn::Host && host.is_none() { pixels } else { 0 };
        // A default number of Gaussians stays within the device's memory, where steps are fast.
        let host = host.map(|host| ((HOST_PART * host as f64) as u64).saturating_sub(in_host));
        let whole = self.model.gaussians.is_none() || fits(geometry + others, on_device);
        let others_of_all = others.saturating_mul(first.most as u64);
        let gaussians = self
            .place
            .gaussians_on
            .unwrap_or_else(|| GaussiansOn::choose(whole, fits(geometry, on_device), host, others_of_all));
        if gaussians == GaussiansOn::Host {
            let why = why(self.place.gaussians_on.is_some(), "");
            let megabytes = others_of_all as f64 / 1e6;
            note(format!(
                "up to {megabytes:.1} MB of the Gaussians' colors and moments lie in the host's memory{why}; each step accesses them over the bus"
            ));
        }
        if self.model.gaussians.is_none() {
            let apart = gaussians == GaussiansOn::Host && host.is_some();
            let bytes = if apart { geometry } else { geometry + others };
            first.fit(context, bytes, on_device).into_iter().for_each(note);
        }
        (on, gaussians)
    }

    /// Number of Gaussians that fit in the memory of the device, or in those of device and host together.
    pub(super) fn gaussians_at_most(&self, context: &Context) -> u64 {
        let ([geometry, others], memory) = (self.learning_bytes(), context.memory_at_most());
        let whole = memory / (geometry + others);
        let of_host = |host: u64| (HOST_PART * host as f64) as u64 / others;
        let apart = context.staging_memory().map(|host| of_host(host).min(memory / geometry));
        match (self.place.gaussians_on, apart) {
            (Some(GaussiansOn::Device), _) | (_, None) => whole,
            (Some(GaussiansOn::Host), Some(apart)) => apart,
            (None, Some(apart)) => whole.max(apart),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn photos_lie_where_they_fit() {
        // 600 MB of photos.
        let choose = |fits, host| PhotosOn::choose(fits, host, 100_000_000);
        assert_eq!([choose(true, None), choose(true, Some(1))], [PhotosOn::Device; 2]);
        assert_eq!(
            [choose(false, Some(1_200_000_000)), choose(false, Some(1_199_999_999))],
            [PhotosOn::Host, PhotosOn::Disk]
        );
        // The host's memory is the device's.
        assert_eq!(choose(false, None), PhotosOn::Disk);
    }

    #[test]
    fn gaussians_lie_where_they_fit() {
        // 500 bytes of colors and moments.
        let choose = |whole, geometry, host| GaussiansOn::choose(whole, geometry, host, 500);
        assert_eq!(choose(false, true, Some(500)), GaussiansOn::Host);
        // Room on the device; not even for positions; too small a host; a host that the device shares.
        let device =
            [(true, true, Some(500)), (false, false, Some(500)), (false, true, Some(499)), (false, true, None)];
        assert!(device.into_iter().all(|(whole, geometry, host)| choose(whole, geometry, host) == GaussiansOn::Device));
    }
}
