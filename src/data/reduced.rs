//! Folders of photos that somebody has reduced already, as Mip-NeRF 360's `images_4`: what has the size that is asked for need be neither
//! decoded in full nor reduced once more, and is what others train on.

use std::path::Path;

use super::photo::{Dataset, Photo, PixelSource};

/// Such folders, beside `images`.
const REDUCED: [&str; 3] = ["images_2", "images_4", "images_8"];

/// The first reduced folder of a dataset in `root` whose photos, read by `open` at their own size, have the size that those of `full`
/// become: to a pixel, since tools round sides in either direction. None where there are others or fewer, other masks, or where one lacks
/// the transparency of the other; nor where nothing is reduced.
pub(super) fn instead(full: &Dataset, root: &Path, open: impl Fn(&Path) -> crate::Result<Dataset>) -> Option<Dataset> {
    full.photos.iter().any(is_reduced).then_some(())?;
    let folders = REDUCED.iter().map(|name| (name, root.join(name))).filter(|(_, folder)| folder.is_dir());
    folders.into_iter().find_map(|(name, folder)| {
        // What is wrong with them is no fault of a dataset whose photos are all there in full.
        let mut reduced = open(&folder).ok()?;
        let alike = reduced.photos.len() == full.photos.len()
            && reduced.photos.iter().zip(&full.photos).all(|(small, full)| is_same(small, full, &folder));
        alike.then(|| {
            // They were looked at, and are not to be written over.
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

/// Whether `small`, of a reduced folder, is the photo that `full` becomes.
fn is_same(small: &Photo, full: &Photo, folder: &Path) -> bool {
    let (PixelSource::File(file), PixelSource::File(whole)) = (&small.pixels, &full.pixels) else { return false };
    let near = |a: u32, b: u32| a.abs_diff(b) <= 1;
    (&small.name, small.split) == (&full.name, full.split)
        && near(small.camera.width, full.camera.width)
        && near(small.camera.height, full.camera.height)
        && file.path.starts_with(folder)
        && (file.has_alpha, file.mask.is_some()) == (whole.has_alpha, whole.mask.is_some())
}
