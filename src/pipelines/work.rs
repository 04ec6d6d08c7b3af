//! What an augmentation leaves behind for inspection and to go on from: per view its 2D Gaussians and their lifts as
//! safetensors, the base's render and depth as EXR.
//!
//! Means count from where the run's coordinates begin: the world's origin unless the scene is far from it (`views::origin_for`).
//! `settings.json` holds everything that the results depend on. A folder of other settings is refused, not mixed.

use std::{
    fs,
    ops::Range,
    path::{Path, PathBuf},
};

use super::{
    lift::Lifted,
    screen::{Refiner, ScreenGaussian},
};
use crate::{
    data::{
        read_tensors,
        tensors::{Tensor, Values, ValuesRef},
        write_exr_channel, write_exr_rgb, write_tensors,
    },
    error::{Error, Result},
    scene::Camera,
    stages::types::Lift,
};

/// A folder of intermediate results.
pub struct WorkDir {
    folder: PathBuf,
    /// By view: what its files' names begin with.
    names: Vec<String>,
}

impl WorkDir {
    /// Makes the folder, or takes up one of the same `settings` (a JSON text). `names` are the views' file names without
    /// extension, each once.
    ///
    /// # Errors
    /// [`Error::Input`] where the folder holds results of other settings.
    pub fn open(folder: &Path, settings: &str, names: Vec<String>) -> Result<Self> {
        fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
        let file = folder.join("settings.json");
        match fs::read_to_string(&file) {
            Ok(found) if found == settings => {}
            Ok(_) => {
                let what = "these are the settings of another run (or base, or dataset); expected the same ones to go on \
                            from, or another --work folder";
                return Err(Error::input(&file, what));
            }
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
                crate::data::write_text(&file, settings)?;
            }
            Err(e) => return Err(Error::io(&file, e)),
        }
        Ok(WorkDir { folder: folder.to_owned(), names })
    }

    fn file(&self, view: usize, kind: &str) -> PathBuf {
        self.folder.join(format!("{}.{kind}", self.names[view]))
    }

    /// The lifts of a batch if all of its views were kept, else `None`.
    pub fn resume(&self, views: Range<usize>) -> Result<Option<Vec<Lift>>> {
        let files: Vec<PathBuf> = views.map(|v| self.file(v, "lifted.safetensors")).collect();
        if files.iter().any(|f| !f.exists()) {
            return Ok(None);
        }
        let mut lifts = Vec::new();
        for file in files {
            lifts.extend(read_lifts(&file)?);
        }
        Ok(Some(lifts))
    }

    /// Writes what the batch left. The lifts come last: a view without them is done again.
    pub fn keep(&self, cameras: &[Camera], refiner: &Refiner, lifted: &Lifted) -> Result<()> {
        let gaussians = refiner.download()?;
        for (position, view) in refiner.views().enumerate() {
            let mine = || gaussians.iter().filter(|(_, g)| g.view as usize == view);
            let n = mine().count();
            let flat = |of: &dyn Fn(&ScreenGaussian) -> Vec<f32>| mine().flat_map(|(_, g)| of(g)).collect::<Vec<f32>>();
            let (xy, color) = (flat(&|p| p.centre.to_vec()), flat(&|p| p.colour.to_vec()));
            let (opacity, log_scale) = (flat(&|p| vec![p.opacity_logit]), flat(&|p| p.log_scale.to_vec()));
            let (angle, depth) = (flat(&|p| vec![p.angle]), flat(&|p| vec![p.depth]));
            write_tensors(
                self.file(view, "plane.safetensors"),
                &[
                    ("xy", &[n, 2], &xy[..]),
                    ("color", &[n, 3], &color[..]),
                    ("opacity", &[n], &opacity[..]),
                    ("log_scale", &[n, 2], &log_scale[..]),
                    ("angle", &[n], &angle[..]),
                    ("depth", &[n], &depth[..]),
                ],
            )?;
            let camera = &cameras[view];
            let (image, depths) = refiner.base_render(position)?;
            let rgb: Vec<f32> = image.iter().flat_map(|p| [p[0], p[1], p[2]]).collect();
            write_exr_rgb(self.file(view, "base.exr"), camera.width, camera.height, &rgb)?;
            write_exr_channel(self.file(view, "depth.exr"), camera.width, camera.height, "Z", &depths)?;

            let lifts: Vec<(Lift, f32)> = mine().map(|&(place, _)| (lifted.lifts[place], lifted.taus[place])).collect();
            write_lifts(&self.file(view, "lifted.safetensors"), &lifts)?;
        }
        Ok(())
    }
}

fn write_lifts(path: &Path, lifts: &[(Lift, f32)]) -> Result<()> {
    let n = lifts.len();
    let flat = |of: &dyn Fn(&Lift) -> Vec<f32>| lifts.iter().flat_map(|(l, _)| of(l)).collect::<Vec<f32>>();
    let (mean, log_scale) = (flat(&|l| l.mean.to_vec()), flat(&|l| l.log_scale.to_vec()));
    let (quat, lobe_dir) = (flat(&|l| l.quat.to_vec()), flat(&|l| l.lobe_dir.to_vec()));
    let (dc, opacity) = (flat(&|l| l.dc.to_vec()), flat(&|l| vec![l.opacity]));
    let (lobe_width, theta_bar) = (flat(&|l| vec![l.lobe_width]), flat(&|l| vec![l.theta_bar]));
    let tau: Vec<f32> = lifts.iter().map(|(_, tau)| *tau).collect();
    let cluster_size: Vec<u32> = lifts.iter().map(|(l, _)| l.cluster_size).collect();
    let floats = ValuesRef::F32;
    write_tensors(
        path,
        &[
            ("mean", &[n, 3], floats(&mean)),
            ("log_scale", &[n, 3], floats(&log_scale)),
            ("quat", &[n, 4], floats(&quat)),
            ("dc", &[n, 3], floats(&dc)),
            ("opacity", &[n], floats(&opacity)),
            ("lobe_dir", &[n, 3], floats(&lobe_dir)),
            ("lobe_width", &[n], floats(&lobe_width)),
            ("theta_bar", &[n], floats(&theta_bar)),
            ("tau", &[n], floats(&tau)),
            ("cluster_size", &[n], ValuesRef::U32(&cluster_size)),
        ],
    )
}

fn read_lifts(path: &Path) -> Result<Vec<Lift>> {
    let tensors = read_tensors(path)?;
    let get = |name: &str| tensors.get(name).ok_or_else(|| Error::input(path, format!("has no tensor `{name}`")));
    let sizes = match get("cluster_size")? {
        Tensor { values: Values::U32(sizes), .. } => sizes.clone(),
        _ => return Err(Error::input(path, "tensor `cluster_size` holds no u32")),
    };
    let n = sizes.len();
    let floats = |name: &str, width: usize| match get(name)? {
        // guard: lifts of a file
        Tensor { values: Values::F32(v), .. } if v.len() == n * width && v.iter().all(|x| x.is_finite()) => {
            Ok(v.clone())
        }
        _ => Err(Error::input(path, format!("tensor `{name}` is not {n} × {width} finite f32"))),
    };
    let (mean, log_scale, quat) = (floats("mean", 3)?, floats("log_scale", 3)?, floats("quat", 4)?);
    let (dc, opacity, lobe_dir) = (floats("dc", 3)?, floats("opacity", 1)?, floats("lobe_dir", 3)?);
    let (lobe_width, theta_bar) = (floats("lobe_width", 1)?, floats("theta_bar", 1)?);
    let three = |v: &[f32], i: usize| [v[3 * i], v[3 * i + 1], v[3 * i + 2]];
    Ok((0..n)
        .map(|i| Lift {
            mean: three(&mean, i),
            log_scale: three(&log_scale, i),
            quat: [quat[4 * i], quat[4 * i + 1], quat[4 * i + 2], quat[4 * i + 3]],
            dc: three(&dc, i),
            opacity: opacity[i],
            lobe_dir: three(&lobe_dir, i),
            lobe_width: lobe_width[i],
            theta_bar: theta_bar[i],
            cluster_size: sizes[i],
        })
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lifts_that_are_nan_are_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let work = WorkDir::open(folder.path(), "{}", vec!["a".into()]).unwrap();
        let lift = Lift { mean: [1.0; 3], quat: [1.0, 0.0, 0.0, 0.0], cluster_size: 4, ..Default::default() };
        let file = folder.path().join("a.lifted.safetensors");
        write_lifts(&file, &[(lift, 0.5)]).unwrap();
        assert_eq!(work.resume(0..1).unwrap().unwrap(), [lift]);
        write_lifts(&file, &[(lift, 0.5), (Lift { dc: [0.0, f32::NAN, 0.0], ..lift }, 0.5)]).unwrap();
        let refused = work.resume(0..1).unwrap_err().to_string();
        assert!(refused.contains("a.lifted.safetensors") && refused.contains("`dc`"), "{refused}");
    }
}
