//! Uses folders of downscaled photos, like Mip-NeRF 360's `images_4`: if they have the requested size, full
//! decoding and another downscale are unnecessary, and others train on the same pixels.

use std::path::Path;

use super::photo::{Dataset, Photo, PixelSource};

/// Names of such folders, next to `images`.
const REDUCED: [&str; 3] = ["images_2", "images_4", "images_8"];

/// The first downscaled folder of a dataset in `root` that matches the photos of `full` after their
/// downscale. `open` reads a folder's photos at their own size. Sizes may differ by a pixel, since tools
/// round sides in either direction. `None` if photos or masks differ, if some are missing, if one lacks the
/// transparency of the other, or if nothing is downscaled.
pub(super) fn instead(full: &Dataset, root: &Path, open: impl Fn(&Path) -> crate::Result<Dataset>) -> Option<Dataset> {
    full.photos.iter().any(is_reduced).then_some(())?;
    let folders = REDUCED.iter().map(|name| (name, root.join(name))).filter(|(_, folder)| folder.is_dir());
    folders.into_iter().find_map(|(name, folder)| {
        // Faults there do not matter, since all photos exist in full size.
        let mut reduced = open(&folder).ok()?;
        let alike = reduced.photos.len() == full.photos.len()
            && reduced.photos.iter().zip(&full.photos).all(|(small, full)| is_same(small, full, &folder));
        alike.then(|| {
            // They count as sources, so they must not be overwritten.
            reduced.sources.extend(full.photo_files().into_iter().map(Path::to_owned));
            let what = "have the size asked for, to a pixel, and are taken in place of those in full";
            reduced.notes.push(format!("the photos in {name} {what} (--images chooses)"));
            reduced
        })
    })
}

fn is_reduced(photo: &Photo) -> bool {
    let PixelSource::File(file) = &photo.pixels else { return false };
    let side = file.size.into_iter().max();
    side > Some(photo.camera.width.max(photo.camera.height))
}

/// Whether `small`, from the folder, matches the downscaled `full`.
fn is_same(small: &Photo, full: &Photo, folder: &Path) -> bool {
    let (PixelSource::File(file), PixelSource::File(whole)) = (&small.pixels, &full.pixels) else { return false };
    let near = |a: u32, b: u32| a.abs_diff(b) <= 1;
    (&small.name, small.split) == (&full.name, full.split)
        && near(small.camera.width, full.camera.width)
        && near(small.camera.height, full.camera.height)
        && file.path.starts_with(folder)
        && (file.has_alpha, file.mask.is_some()) == (whole.has_alpha, whole.mask.is_some())
}
