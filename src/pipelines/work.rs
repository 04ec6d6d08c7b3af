//! What an augmentation leaves behind for inspection and to go on from: per view its 2D Gaussians and their lifts as
//! safetensors, the base's render and depth as EXR.
//!
//! Means count from where the run's coordinates begin: the world's origin unless the scene is far from it (`views::origin_for`).
//! `settings.json` holds everything that the results depend on. A folder of other settings is refused, not mixed. A file that is
//! damaged is made again. While the joint phase goes on, what it has learned is beside them.

use std::{
    fs,
    ops::Range,
    path::{Path, PathBuf},
};

use serde_json::{Value, json};

use super::{
    checkpoint::another_run,
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

const SETTINGS: &str = "settings.json";
/// What ends the names of a view's files: the base's render and depth, the 2D Gaussians.
const BASE: &str = "base.exr";
const DEPTH: &str = "depth.exr";
const PLANE: &str = "plane.safetensors";
/// The last one: a view without it is done again.
const LIFTS: &str = "lifted.safetensors";
/// What the joint phase has learned so far.
const JOINT: &str = "joint.safetensors";

/// A folder of intermediate results.
pub struct WorkDir {
    folder: PathBuf,
    /// By view: what its files' names begin with.
    names: Vec<String>,
    settings: Value,
}

impl WorkDir {
    /// Makes the folder, or takes up one of the same `settings`, a JSON object of everything that the results depend on. Their `tile` may
    /// be another; it becomes that of the folder. `names` are the views' file names without extension, each once.
    ///
    /// # Errors
    /// [`Error::Input`] where the folder holds results of other settings, whose first difference is named, or of settings that
    /// are not known.
    pub fn open(folder: &Path, settings: &mut Value, names: Vec<String>) -> Result<Self> {
        fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
        let file = Self::settings_of(folder);
        let another = "expected the same ones to go on from, or another --work folder";
        match fs::read_to_string(&file) {
            Ok(text) => {
                let found: Value = serde_json::from_str(&text).map_err(|e| {
                    Error::input(&file, format!("is damaged ({e}), so what was made is not known; {another}"))
                })?;
                if let Some(what) = another_run(&found, settings) {
                    return Err(Error::input(
                        &file,
                        format!("these are the settings of another run: {what}; {another}"),
                    ));
                }
            }
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
                let work = WorkDir { folder: folder.to_owned(), names: names.clone(), settings: Value::Null };
                let views = 0..names.len();
                let mut all = views
                    .flat_map(|view| [LIFTS, BASE, DEPTH, PLANE].map(|kind| work.file(view, kind)))
                    .chain([folder.join(JOINT)]);
                if let Some(left) = all.find(|file| file.exists()) {
                    let what = format!("was made with settings that are not known: there is no {SETTINGS}; {another}");
                    return Err(Error::input(left, what));
                }
                crate::data::write_text(&file, &format!("{settings:#}\n"))?;
            }
            Err(e) => return Err(Error::io(&file, e)),
        }
        Ok(WorkDir { folder: folder.to_owned(), names, settings: settings.clone() })
    }

    /// The file of such a folder that says what its results depend on.
    pub fn settings_of(folder: &Path) -> PathBuf {
        folder.join(SETTINGS)
    }

    fn file(&self, view: usize, kind: &str) -> PathBuf {
        self.folder.join(format!("{}.{kind}", self.names[view]))
    }

    /// The lifts of a batch if all of its views were kept, else `None`. Files that are damaged count as not kept; `damage`
    /// is called with each.
    pub fn resume(&self, views: Range<usize>, mut damage: impl FnMut(&Error)) -> Result<Option<Vec<Lift>>> {
        let files: Vec<PathBuf> = views.map(|v| self.file(v, LIFTS)).collect();
        if files.iter().any(|f| !f.exists()) {
            return Ok(None);
        }
        let mut lifts = Some(Vec::new());
        for file in files {
            match read_lifts(&file) {
                Ok(found) => lifts.iter_mut().for_each(|lifts| lifts.extend(&found)),
                Err(error @ Error::Input { .. }) => {
                    damage(&error);
                    lifts = None;
                }
                Err(error) => return Err(error),
            }
        }
        Ok(lifts)
    }

    /// Where the joint phase is kept, and all that it depends on: the folder's settings and the lifts that it began with.
    /// Lifts of all views must be there.
    pub fn joint(&self) -> Result<(PathBuf, Value)> {
        let mut hasher = crc32fast::Hasher::new();
        for view in 0..self.names.len() {
            let file = self.file(view, LIFTS);
            hasher.update(&fs::read(&file).map_err(|e| Error::io(&file, e))?);
        }
        let settings = json!({"work": self.settings, "lifts_crc32": hasher.finalize()});
        Ok((self.folder.join(JOINT), settings))
    }

    /// The same of a joint phase whose Gaussians were placed without lifts.
    pub fn joint_without_lifts(&self) -> (PathBuf, Value) {
        (self.folder.join(JOINT), json!({"work": self.settings}))
    }

    /// The joint phase is done and its result is written: nothing of it is left to go on with.
    pub fn remove_joint(&self) -> Result<()> {
        let file = self.folder.join(JOINT);
        match fs::remove_file(&file) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::io(&file, e)),
            _ => Ok(()),
        }
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
                self.file(view, PLANE),
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
            write_exr_rgb(self.file(view, BASE), camera.width, camera.height, &rgb)?;
            write_exr_channel(self.file(view, DEPTH), camera.width, camera.height, "Z", &depths)?;

            let lifts: Vec<(Lift, f32)> = mine().map(|&(place, _)| (lifted.lifts[place], lifted.taus[place])).collect();
            write_lifts(&self.file(view, LIFTS), &lifts)?;
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
    use serde_json::json;

    use super::*;

    fn work(folder: &Path) -> WorkDir {
        WorkDir::open(folder, &mut json!({}), vec!["a".into(), "b".into()]).unwrap()
    }

    const LIFT: Lift = Lift {
        mean: [1.0; 3],
        log_scale: [0.0; 3],
        quat: [1.0, 0.0, 0.0, 0.0],
        dc: [0.0; 3],
        opacity: 0.0,
        lobe_dir: [0.0; 3],
        lobe_width: 0.0,
        theta_bar: 0.0,
        cluster_size: 4,
    };

    #[test]
    fn lifts_that_are_nan_are_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let work = work(folder.path());
        let file = folder.path().join("a.lifted.safetensors");
        write_lifts(&file, &[(LIFT, 0.5)]).unwrap();
        let resume = |views| {
            let mut damage = Vec::new();
            let lifts = work.resume(views, |error| damage.push(error.to_string())).unwrap();
            (lifts, damage)
        };
        assert_eq!(resume(0..1), (Some(vec![LIFT]), vec![]));
        // The second view was not kept.
        assert_eq!(resume(0..2), (None, vec![]));
        write_lifts(&folder.path().join("b.lifted.safetensors"), &[(LIFT, 0.5), (LIFT, 0.5)]).unwrap();
        assert_eq!(resume(0..2).0.unwrap().len(), 3);
        write_lifts(&file, &[(LIFT, 0.5), (Lift { dc: [0.0, f32::NAN, 0.0], ..LIFT }, 0.5)]).unwrap();
        let (lifts, damage) = resume(0..2);
        assert!(lifts.is_none() && damage.len() == 1);
        assert!(damage[0].contains("a.lifted.safetensors") && damage[0].contains("`dc`"), "{damage:?}");
        // Half a file, as a full disk leaves it.
        let whole = fs::read(&file).unwrap();
        fs::write(&file, &whole[..whole.len() / 2]).unwrap();
        let (lifts, damage) = resume(0..1);
        assert!(lifts.is_none() && damage[0].contains("a.lifted.safetensors"), "{damage:?}");
    }

    #[test]
    fn what_differs_between_two_runs_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let open = |mut settings: Value| WorkDir::open(folder.path(), &mut settings, vec!["a".into()]).map(drop);
        let settings = json!({"version": "1", "photos": {"a.png": 7, "b.png": 8}, "options": {"seed": 0}});
        open(settings.clone()).unwrap();
        open(settings.clone()).unwrap();
        let differs = |change: &dyn Fn(&mut Value), part: &str| {
            let mut other = settings.clone();
            change(&mut other);
            let message = open(other).unwrap_err().to_string();
            assert!(message.contains(part) && message.contains("another --work"), "{message}");
        };
        differs(&|s| s["options"]["seed"] = json!(5), "`options.seed` was 0 and is 5");
        differs(&|s| s["photos"]["b.png"] = json!(9), "`photos.b.png` was 8 and is 9");
        differs(&|s| s["options"]["new"] = json!(true), "`options.new` was null and is true");
        differs(&|s| drop(s["photos"].as_object_mut().unwrap().remove("a.png")), "`photos.a.png` was 7 and is null");
        let file = folder.path().join(SETTINGS);
        fs::write(&file, "{").unwrap();
        assert!(open(settings.clone()).unwrap_err().to_string().contains("damaged"));
        // Without settings an empty folder is a new one, and lifts are nobody's.
        fs::remove_file(&file).unwrap();
        open(settings.clone()).unwrap();
        fs::remove_file(&file).unwrap();
        for name in ["a.lifted.safetensors", "a.base.exr", "a.depth.exr", "a.plane.safetensors", "joint.safetensors"] {
            fs::write(folder.path().join(name), "somebody's").unwrap();
            let message = open(settings.clone()).unwrap_err().to_string();
            assert!(message.contains(name) && message.contains("not known"), "{message}");
            fs::remove_file(folder.path().join(name)).unwrap();
        }
        assert!(!file.exists());
        open(settings).unwrap();
    }
}
