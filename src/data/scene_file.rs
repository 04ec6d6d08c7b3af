//! A scene together with what else its file holds.

use std::path::Path;

use super::trained_with::TrainedWith;
use crate::scene::{Gaussians, Scene};

/// What a folder with an SOG scene has.
pub(super) const SOG_META: &str = "meta.json";

/// Whether `path` is a folder with a scene.
pub fn is_scene_folder(path: &Path) -> bool {
    path.is_dir() && path.join(SOG_META).is_file()
}

/// A scene, and what viewers show that know nothing of its supplement.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SceneFile {
    /// The base as it has learned together with the supplement.
    pub scene: Scene,
    /// The base for other viewers, where it is not that of the scene.
    pub shown: Option<Gaussians>,
    /// What it was trained with, as far as the file says.
    pub trained_with: TrainedWith,
    /// What was read in another way than it looks, or not read although it changes the picture: a sentence each.
    pub notes: Vec<String>,
}

impl From<Scene> for SceneFile {
    fn from(scene: Scene) -> Self {
        SceneFile { scene, shown: None, trained_with: TrainedWith::default(), notes: Vec::new() }
    }
}

impl SceneFile {
    /// Without the supplement: what other viewers show.
    pub fn into_base(self) -> SceneFile {
        let origin = self.scene.origin;
        let scene = Scene { base: self.shown.unwrap_or(self.scene.base), supplement: None, origin };
        SceneFile { trained_with: self.trained_with, ..scene.into() }
    }
}
