//! Names of output files for photos.

use std::collections::{HashMap, HashSet};

use crate::data::Photo;

/// File name for each photo, without extension. They differ even if the file system ignores case.
pub(super) fn stems(photos: &[Photo]) -> Vec<String> {
    let flat = |name: &str| -> String {
        // Characters that some file systems do not allow.
        let odd = |c: char| c.is_control() || r#"/\:*?"<>|"#.contains(c);
        name.chars().map(|c| if odd(c) { '_' } else { c }).collect()
    };
    let stem = |name: &str| match name.rsplit_once('.') {
        // A dot in `r_0.5` does not begin an extension.
        Some((stem, end)) if !stem.is_empty() && is_image_extension(end) => flat(stem),
        _ => flat(name),
    };
    let mut uses: HashMap<String, usize> = HashMap::new();
    for photo in photos {
        *uses.entry(stem(&photo.name).to_lowercase()).or_default() += 1;
    }
    // Unique stems are reserved first, so that other names avoid them.
    let mut taken: HashSet<String> = uses.iter().filter(|(_, n)| **n == 1).map(|(stem, _)| stem.clone()).collect();
    let name = |photo: &Photo| {
        let stem = stem(&photo.name);
        if uses[&stem.to_lowercase()] == 1 {
            return stem;
        }
        let full = flat(&photo.name);
        let numbered = (2u32..).map(|i| format!("{full}-{i}"));
        let free = std::iter::once(full.clone()).chain(numbered).find(|name| taken.insert(name.to_lowercase()));
        free.unwrap_or(full)
    };
    photos.iter().map(name).collect()
}

fn is_image_extension(end: &str) -> bool {
    ["png", "jpg", "jpeg", "jpe", "tif", "tiff", "webp", "bmp", "exr"]
        .iter()
        .any(|known| end.eq_ignore_ascii_case(known))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::{
        data::{Image, PixelSource, Split},
        scene::Camera,
    };

    fn names(photos: &[&str]) -> Vec<String> {
        let camera = Camera::new(1, 1, 1.0);
        let pixels = PixelSource::Memory(Arc::new(Image { width: 1, height: 1, rgb: vec![0; 3], mask: None }));
        let photo = |name: &&str| Photo { name: (*name).into(), camera, split: Split::Test, pixels: pixels.clone() };
        stems(&photos.iter().map(photo).collect::<Vec<_>>())
    }

    #[test]
    fn files_are_named_after_photos() {
        assert_eq!(names(&["DSC01.JPG", "test/r_0", "r_0.5", ".jpg"]), ["DSC01", "test_r_0", "r_0.5", ".jpg"]);
        assert_eq!(names(&["a:b\n.png"]), ["a_b_"]);
    }

    #[test]
    fn no_two_photos_share_a_file() {
        let names = names(&["a.jpg", "A.png", "b/c.jpg", "b_c.jpg", "b_c.jpg-2.png", "d.png"]);
        let different: HashSet<String> = names.iter().map(|n| n.to_lowercase()).collect();
        assert_eq!(different.len(), names.len(), "{names:?}");
        assert_eq!((&names[0][..], &names[1][..], &names[5][..]), ("a.jpg", "A.png", "d"));
    }
}
