//! A scene file's contents: the scene, the base for other viewers, training settings and notes.

use std::path::{Path, PathBuf};

use super::trained_with::TrainedWith;
use crate::scene::{Gaussians, Scene};

/// Files one of which a folder with an SOG scene contains: a scene's description, and one with levels of detail.
pub(super) const SOG_META: [&str; 2] = ["meta.json", "lod-meta.json"];

/// The description in a folder with a scene.
pub(super) fn description_in(folder: &Path) -> Option<PathBuf> {
    SOG_META.iter().map(|name| folder.join(name)).find(|path| path.is_file())
}

/// Whether `path` is a folder with a scene.
pub fn is_scene_folder(path: &Path) -> bool {
    description_in(path).is_some()
}

/// A scene, and the base that other viewers show.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SceneFile {
    /// The scene; its base was trained together with the supplement.
    pub scene: Scene,
    /// The base for other viewers, if it differs from the scene's.
    pub shown: Option<Gaussians>,
    /// Training settings, as far as the file has them.
    pub trained_with: TrainedWith,
    /// Notes on data that was interpreted differently than it looks, or ignored although it changes the
    /// picture; one sentence each.
    pub notes: Vec<String>,
}

impl From<Scene> for SceneFile {
    fn from(scene: Scene) -> Self {
        SceneFile { scene, shown: None, trained_with: TrainedWith::default(), notes: Vec::new() }
    }
}

impl SceneFile {
    /// Drops the supplement: keeps the base that other viewers show.
    pub fn into_base(self) -> SceneFile {
        let origin = self.scene.origin;
        let scene = Scene { base: self.shown.unwrap_or(self.scene.base), origin, ..Scene::default() };
        SceneFile { trained_with: self.trained_with, ..scene.into() }
    }
}
