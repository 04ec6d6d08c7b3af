//! Where the training photos lie during a run.

use super::{
    Args, Error, Result,
    first::{First, PIXEL_BYTES, fit},
    note,
};
use crate::{cli::output::folder_of, gpu::Context, pipelines::photographs::Storage};

/// Maximum share of the host's memory for photos.
const HOST_PART: f64 = 0.5;

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum PhotosOn {
    /// The device's memory
    Device,
    /// The host's memory
    Host,
    /// A temporary file next to the output
    Disk,
}

impl PhotosOn {
    /// The first that has room for photos of `pixels`. `host` is the memory of a host that the device does not share.
    fn choose(fits_device: bool, host: Option<u64>, pixels: u64) -> Self {
        match host {
            _ if fits_device => PhotosOn::Device,
            Some(host) if photo_bytes(pixels) as f64 <= HOST_PART * host as f64 => PhotosOn::Host,
            _ => PhotosOn::Disk,
        }
    }
}

/// Bytes of photos of `pixels`, with their smaller copies.
pub(super) fn photo_bytes(pixels: u64) -> u64 {
    (PIXEL_BYTES * pixels as f64) as u64
}

impl Args {
    /// Chooses where photos of `pixels` lie and limits a default maximum of Gaussians to the device's memory. Prints notes on both.
    pub(super) fn place_photos(&self, context: &Context, first: &mut First, pixels: u64) -> PhotosOn {
        let (bytes, host) = (self.learning_bytes(), context.staging_memory());
        let fits = fit(context.memory_at_most(), bytes, pixels) >= first.most;
        let on = self.photos_on.unwrap_or_else(|| PhotosOn::choose(fits, host, pixels));
        let place = match on {
            PhotosOn::Device => None,
            PhotosOn::Host => Some("in the host's memory"),
            PhotosOn::Disk => Some("in a temporary file next to the output"),
        };
        if let Some(place) = place {
            let why = match self.photos_on {
                Some(_) => String::new(),
                None => format!(", because the device's memory does not hold them and {} Gaussians", first.most),
            };
            let megabytes = photo_bytes(pixels) as f64 / 1e6;
            note(format!("up to {megabytes:.1} MB of photos lie {place}{why}; each step copies one to the device"));
        }
        if self.model.gaussians.is_none() {
            let on_device = on == PhotosOn::Device || on == PhotosOn::Host && host.is_none();
            first.fit(context, bytes, if on_device { pixels } else { 0 }).into_iter().for_each(note);
        }
        on
    }

    /// The storage for photos; a file has no name and is gone when the run ends.
    pub(super) fn storage(&self, on: PhotosOn) -> Result<Storage> {
        Ok(match on {
            PhotosOn::Device => Storage::Device,
            PhotosOn::Host => Storage::Host,
            PhotosOn::Disk => {
                let folder = folder_of(&self.output);
                let file = tempfile::tempfile_in(folder).map_err(|error| Error::io(folder, error))?;
                Storage::File(file, folder.into())
            }
        })
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
}
