//! Usual folders of a dataset's models, photos and masks.

use std::fs;
use std::path::{Path, PathBuf};

use super::names::Finder;
use super::{DatasetOptions, left_out::counted};
use crate::{Error, Result};

/// Usual folders of a dataset's own model, in order; below: those of models that other tools leave behind.
const OWN: [&str; 3] = ["sparse/0", "sparse", ""];
const ASIDE: [&str; 7] = [
    "colmap/sparse/0",
    "colmap/sparse",
    "colmap",
    "dense/sparse/0",
    "dense/sparse",
    // instant-ngp.
    "colmap_text",
    "colmap_sparse/0",
];
/// Folders with numbered sub-folders that are models; `true` for models of other tools.
const NUMBERED: [(&str, bool); 2] = [("sparse", false), ("colmap/sparse", true)];
/// Usual folders of photos, the best first.
const PHOTOS: [&str; 5] = ["images", "input", "images_2", "images_4", "images_8"];

/// A COLMAP model's folder.
pub(super) struct Model {
    pub(super) folder: PathBuf,
    /// Whether it is outside of the usual folders of a dataset's own model.
    pub(super) aside: bool,
    /// Other models, relative to the dataset.
    others: Vec<String>,
}

fn is_model(folder: &Path) -> bool {
    ["cameras.bin", "cameras.txt"].iter().any(|name| folder.join(name).is_file())
}

/// Every model below `root`, in order of preference: relative folders, each with a flag for `aside`.
fn models(root: &Path) -> Vec<(String, bool)> {
    let fixed = OWN.map(|place| (place.to_owned(), false)).into_iter();
    let aside = ASIDE.map(|place| (place.to_owned(), true));
    let numbered = |(place, aside): (&str, bool)| {
        let entries = fs::read_dir(root.join(place)).into_iter().flatten().flatten();
        let mut numbers: Vec<u32> =
            entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok()).filter(|&n| n > 0).collect();
        numbers.sort_unstable();
        numbers.into_iter().map(move |n| (format!("{place}/{n}"), aside)).collect::<Vec<_>>()
    };
    let [own, theirs] = NUMBERED.map(numbered);
    let all = fixed.chain(own).chain(aside).chain(theirs);
    all.filter(|(place, _)| is_model(&root.join(place))).collect()
}

/// Whether a folder has a model and photos in the usual places.
pub(super) fn is_dataset(root: &Path) -> bool {
    let photos = |base: &str| PHOTOS.iter().any(|name| root.join(base).join(name).is_dir());
    !models(root).is_empty() && ["", "dense", "colmap"].into_iter().any(photos)
}

/// The model in the options, or else the first in the usual folders.
pub(super) fn find_model(root: &Path, options: &DatasetOptions) -> Result<Option<Model>> {
    let found = models(root);
    let names = |places: &[(String, bool)]| -> Vec<String> {
        places.iter().map(|(place, _)| if place.is_empty() { ".".into() } else { place.clone() }).collect()
    };
    if let Some(asked) = &options.model {
        let here = [root.join(asked), asked.clone()].into_iter().find(|folder| is_model(folder));
        let none = || {
            let there = if found.is_empty() { "no models".into() } else { names(&found).join(", ") };
            let what = format!("holds no COLMAP model (cameras.bin or cameras.txt); {} has {there}", root.display());
            Error::input(asked, what)
        };
        return here.ok_or_else(none).map(|folder| Some(Model { folder, aside: false, others: Vec::new() }));
    }
    Ok(found.split_first().map(|((place, aside), others)| Model {
        folder: root.join(place),
        aside: *aside,
        others: names(others),
    }))
}

impl Model {
    /// A note on the choice, if there were others.
    pub(super) fn note(&self, root: &Path) -> Option<String> {
        let place = self.folder.strip_prefix(root).unwrap_or(&self.folder).display();
        let others = &self.others;
        (!others.is_empty()).then(|| {
            format!(
                "the model in {place} is read, of {}: there is also {}",
                counted(others.len() + 1, "model"),
                others.join(", ")
            )
        })
    }

    /// Folder of its photos: the one in the options, or else the first usual one in the dataset or next to
    /// the model.
    pub(super) fn photos(&self, root: &Path, options: &DatasetOptions, notes: &mut Vec<String>) -> Result<PathBuf> {
        if let Some(asked) = &options.images {
            return asked_folder(root, asked);
        }
        let bases: Vec<&Path> = std::iter::once(root)
            .chain(self.folder.ancestors().skip(1).take_while(|folder| *folder != root && folder.starts_with(root)))
            .collect();
        let all = PHOTOS.iter().flat_map(|name| bases.iter().map(move |base| base.join(name)));
        let Some(folder) = all.into_iter().find(|folder| folder.is_dir()) else {
            let what = "is not there; give the folder that holds `images` and `sparse`, or the folder of the photos (--images)";
            return Err(Error::input(root.join("images"), what));
        };
        if folder != root.join("images") {
            let place = folder.strip_prefix(root).unwrap_or(&folder).display();
            notes.push(format!("there is no folder images: the photos in {place} are taken"));
        }
        Ok(folder)
    }
}

/// The folder of photos named in the options, in the dataset or elsewhere.
pub(super) fn asked_folder(root: &Path, asked: &Path) -> Result<PathBuf> {
    let here = [root.join(asked), asked.to_owned()].into_iter().find(|folder| folder.is_dir());
    here.ok_or_else(|| Error::input(asked, format!("is no folder, neither here nor in {}", root.display())))
}

/// The masks of the photos in `photos`: images_4 has masks_4 or masks next to it.
pub(super) fn masks(photos: &Path) -> Option<Finder> {
    let (parent, name) = (photos.parent()?, photos.file_name()?.to_str()?);
    let suffix = name.strip_prefix("images").unwrap_or_default();
    let names = [format!("masks{suffix}"), "masks".into(), "mask".into()];
    names.iter().map(|name| parent.join(name)).find(|folder| folder.is_dir()).map(Finder::new)
}

#[cfg(test)]
mod tests {
    use super::{super::names::tests::folder, *};

    fn found(files: &[&str], model: Option<&str>) -> Result<Option<(String, bool, Vec<String>)>> {
        let folder = folder(files);
        let options = DatasetOptions { model: model.map(PathBuf::from), ..Default::default() };
        let relative = |m: Model| {
            let place = m.folder.strip_prefix(folder.path()).unwrap().to_str().unwrap().to_owned();
            (place, m.aside, m.others)
        };
        Ok(find_model(folder.path(), &options)?.map(relative))
    }

    #[test]
    fn models_are_taken_in_their_order_and_others_are_told() {
        let is = |files: &[&str], place: &str, aside, others: &[&str]| {
            let (p, a, o) = found(files, None).unwrap().unwrap();
            assert_eq!((&p[..], a, o.iter().map(String::as_str).collect::<Vec<_>>()), (place, aside, others.to_vec()));
        };
        is(&["dense/sparse/cameras.bin"], "dense/sparse", true, &[]);
        is(&["colmap_sparse/0/cameras.bin", "colmap_text/cameras.txt"], "colmap_text", true, &["colmap_sparse/0"]);
        let many = [
            "sparse/10/cameras.bin",
            "sparse/2/cameras.bin",
            "sparse/0/cameras.bin",
            "cameras.txt",
            "colmap/cameras.bin",
        ];
        is(&many, "sparse/0", false, &[".", "sparse/2", "sparse/10", "colmap"]);
        assert!(found(&["sparse/x/cameras.bin", "sparse/0/images.bin"], None).unwrap().is_none());
        let note = |others: &[&str]| {
            let others = others.iter().map(|&o| o.to_owned()).collect();
            Model { folder: "/d/sparse/0".into(), aside: false, others }.note(Path::new("/d"))
        };
        assert_eq!(note(&[]), None);
        let text = note(&["sparse/1"]).unwrap();
        assert!(text.contains("in sparse/0 is read, of 2 models") && text.contains("also sparse/1"), "{text}");
    }

    #[test]
    fn a_model_can_be_chosen() {
        let files = ["sparse/0/cameras.bin", "sparse/1/cameras.bin", "other/place/cameras.txt"];
        let message = found(&files, Some("sparse/7")).unwrap_err().to_string();
        assert!(message.contains("sparse/7") && message.contains("sparse/0, sparse/1"), "{message}");
        assert!(found(&[], Some("x")).unwrap_err().to_string().contains("no models"));
        // A folder outside of the dataset.
        let elsewhere = folder(&["cameras.bin"]);
        let options = DatasetOptions { model: Some(elsewhere.path().into()), ..Default::default() };
        let here = folder(&["sparse/0/cameras.bin"]);
        assert_eq!(find_model(here.path(), &options).unwrap().unwrap().folder, elsewhere.path());
    }

    #[test]
    fn photos_are_found_in_the_usual_folders_or_where_they_are_said_to_be() {
        let photos = |files: &[&str], model: &str, images: Option<&str>| {
            let folder = folder(files);
            let model = Model { folder: folder.path().join(model), aside: false, others: Vec::new() };
            let options = DatasetOptions { images: images.map(PathBuf::from), ..Default::default() };
            let mut notes = Vec::new();
            let found = model.photos(folder.path(), &options, &mut notes)?;
            Ok::<_, Error>((found.strip_prefix(folder.path()).unwrap().to_str().unwrap().to_owned(), notes.len()))
        };
        let is = |files: &[&str], model: &str, images, place: &str, notes| {
            assert_eq!(photos(files, model, images).unwrap(), (place.to_owned(), notes));
        };
        is(&["images/a", "input/a"], "sparse/0", None, "images", 0);
        is(&["images_4/a", "input/a"], "sparse/0", None, "input", 1);
        is(&["images_8/a", "images_2/a"], "sparse/0", None, "images_2", 1);
        is(&["dense/images/a"], "dense/sparse", None, "dense/images", 1);
        let message = photos(&["sparse/0/cameras.bin"], "sparse/0", None).unwrap_err().to_string();
        assert!(message.contains("images` and `sparse`") && message.contains("--images"), "{message}");
    }

    #[test]
    fn reduced_photos_have_reduced_masks_if_there_are_any() {
        let folder = folder(&[
            "images/a",
            "images_4/a",
            "images_8/a",
            "masks/a.png",
            "masks_4/a.png",
            "other/photos/a",
            "one/mask/a",
        ]);
        let path = |photos: &str| masks(&folder.path().join(photos)).map(|masks| masks.expected(""));
        let at = |place: &str| Some(folder.path().join(place).join(""));
        assert_eq!([path("images"), path("images_4"), path("images_8")], [at("masks"), at("masks_4"), at("masks")]);
        assert_eq!([path("other/photos"), path("one/images")], [None, at("one/mask")]);
    }
}
