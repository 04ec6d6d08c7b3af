//! Merges the trained parts of a plan into one scene, with the memory of one part and of all seeds.

use std::fs::File;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;

use super::atomic::write_whole;
use super::plan::{Owners, Plan};
use super::ply_columns::{BANDS, BASE, Place, SUPPLEMENT};
use super::ply_write::{Rows, begin};
use super::scenes::read_scene_file;
use super::trained_with::{PartOf, TrainedWith};
use crate::scene::{Gaussians, Scene, Supplement, color};
use crate::{Error, Result};

/// Maximum length of a part's header up to its comments' end.
const HEADER_BYTES: u64 = 1 << 14;

/// A part in a merged scene.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PartSummary {
    /// Gaussians of the part that belong to it.
    pub kept: usize,
    /// Gaussians with lobes among them.
    pub kept_lobes: usize,
    /// Gaussians that belong to other parts.
    pub left_out: usize,
    /// The share of the kept Gaussians that are next to another part: one of its seeds is less than twice as far as theirs.
    pub at_seams: f64,
}

/// Which Gaussians of a part are written, as numbers in its scene.
struct Kept {
    /// Those of the base before its first one with bands ([`Gaussians::constants`]).
    constants: Vec<usize>,
    /// The others of the base.
    banded: Vec<usize>,
    supplement: Vec<usize>,
    /// Number of those that are next to another part.
    at_seams: usize,
}

/// Contents of the header, known before any part is written.
#[derive(Default)]
struct Totals {
    constants: usize,
    banded: usize,
    supplement: usize,
    /// Degrees of base and supplement.
    degrees: [u32; 2],
    mixed: bool,
    origin: DVec3,
    trained_with: TrainedWith,
}

/// Reads the scene of each part of `plan` from `files`, in any order, and writes to `output` the Gaussians that belong to their part
/// ([`Owners`]). One part is in memory at a time; each file is read two to five times. After each read, `progress` gets the number of
/// reads in all, as far as it is known. A part's separate base for other viewers is left out.
///
/// # Errors
/// If a part is missing, doubled, unfinished, or of another plan, naming all of these; errors of the files.
pub fn merge(plan: &Plan, files: &[PathBuf], output: &Path, mut progress: impl FnMut(u64)) -> Result<Vec<PartSummary>> {
    let files = in_order(plan, files)?;
    let owners = Owners::of(&plan.parts);
    let (mut totals, mut summaries) = (Totals::default(), Vec::with_capacity(files.len()));
    for (part, path) in files.iter().enumerate() {
        let file = read_scene_file(path)?;
        let trained_with = TrainedWith { part: None, matte: None, ..file.trained_with };
        if part == 0 {
            (totals.origin, totals.trained_with) = (file.scene.origin, trained_with);
        }
        if trained_with != totals.trained_with {
            let what = "was trained with another background, size of photos, --compensate or --exposure than part 0";
            return Err(Error::input(path, what));
        }
        totals.add(&file.scene).map_err(|what| Error::input(path, what))?;
        let kept = Kept::of(&file.scene, part as u32, &owners);
        totals.constants += kept.constants.len();
        totals.banded += kept.banded.len();
        totals.supplement += kept.supplement.len();
        summaries.push(kept.summary(&file.scene));
        progress(files.len() as u64 * 2);
    }
    let reads = files.len() as u64 * (1 + totals.passes());
    let mut failed = None;
    let mut part = |i: usize| {
        let scene = read_scene_file(&files[i])?.scene.around(totals.origin);
        let kept = Kept::of(&scene, i as u32, &owners);
        progress(reads);
        Ok((scene, kept))
    };
    let written = write_whole(output, |file| {
        totals.write(file, files.len(), &mut part).map_err(|error| match error {
            Failed::Io(error) => error,
            Failed::Part(error) => {
                failed = Some(error);
                io::Error::other("a part cannot be read")
            }
        })
    });
    failed.map_or(written, Err)?;
    Ok(summaries)
}

/// The file of each part.
fn in_order(plan: &Plan, files: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let (id, of) = (plan.id(), plan.parts.len());
    let mut found: Vec<Option<&PathBuf>> = vec![None; of];
    let mut wrong = Vec::new();
    for path in files {
        let name = path.display();
        match part_of(path)? {
            Some(part) if part.plan == id && (part.part as usize) < of => {
                let slot = &mut found[part.part as usize];
                match slot {
                    _ if !part.complete => wrong.push(format!("{name} is unfinished: run its command again")),
                    Some(other) => wrong.push(format!("{} and {name} are both part {}", other.display(), part.part)),
                    None => *slot = Some(path),
                }
            }
            Some(PartOf { part, .. }) => wrong.push(format!("{name} is part {part} of another plan")),
            None => wrong.push(format!("{name} is not a part of a plan")),
        }
    }
    if wrong.is_empty() {
        let missing: Vec<String> = (0..of).filter(|&part| found[part].is_none()).map(|part| part.to_string()).collect();
        if !missing.is_empty() {
            wrong.push(format!("of {of} parts, these are missing: {}", missing.join(", ")));
        }
    }
    match wrong[..] {
        [] => Ok(found.into_iter().flatten().cloned().collect()),
        _ => Err(Error::Usage(wrong.join("; "))),
    }
}

/// The part that the header of a PLY names.
fn part_of(path: &Path) -> Result<Option<PartOf>> {
    let mut header = Vec::new();
    let read = File::open(path).and_then(|file| file.take(HEADER_BYTES).read_to_end(&mut header));
    read.map_err(|source| Error::io(path, source))?;
    let (text, mut found) = (String::from_utf8_lossy(&header), TrainedWith::default());
    let words = text.lines().take_while(|line| *line != "end_header").map(|line| line.split_whitespace().collect());
    words.for_each(|words: Vec<&str>| {
        if let ["comment", words @ ..] = &words[..] {
            found.read_comment(words);
        }
    });
    Ok(found.part)
}

impl Kept {
    fn of(scene: &Scene, part: u32, owners: &Owners) -> Kept {
        let means: Vec<[f64; 3]> = scene.world_means().map(|at| at.to_array()).collect();
        let found: Vec<(u32, bool)> = means.into_par_iter().map(|at| owners.part_and_seam(at)).collect();
        let owned: Vec<bool> = found.iter().map(|(owner, _)| *owner == part).collect();
        let at_seams = found.iter().filter(|(owner, at_seam)| *owner == part && *at_seam).count();
        let (base, supplement) = owned.split_at(scene.base.len());
        let constants = if scene.mixed { scene.base.constants() } else { 0 };
        let of = |range: std::ops::Range<usize>| range.filter(|&i| base[i]).collect();
        Kept {
            constants: of(0..constants),
            banded: of(constants..base.len()),
            supplement: (0..supplement.len()).filter(|&i| supplement[i]).collect(),
            at_seams,
        }
    }

    fn summary(&self, scene: &Scene) -> PartSummary {
        let all = scene.base.len() + scene.supplement.as_ref().map_or(0, |supplement| supplement.gaussians.len());
        let kept_lobes = self.supplement.len();
        let kept = self.constants.len() + self.banded.len() + kept_lobes;
        let at_seams = self.at_seams as f64 / kept.max(1) as f64;
        PartSummary { kept, kept_lobes, left_out: all - kept, at_seams }
    }
}

enum Failed {
    Io(io::Error),
    Part(Error),
}

impl From<io::Error> for Failed {
    fn from(error: io::Error) -> Self {
        Failed::Io(error)
    }
}

impl Totals {
    /// Adds the color models of a part.
    fn add(&mut self, scene: &Scene) -> Result<(), String> {
        let supplement = scene.supplement.as_ref().map_or(0, |supplement| supplement.gaussians.sh_degree);
        for (all, one) in self.degrees.iter_mut().zip([scene.base.sh_degree, supplement]) {
            if one != 0 && *all != 0 && !color::of(*all).shares_with(color::of(one)) {
                return Err(format!("has {}, but another part has {}", color::of(one).name, color::of(*all).name));
            }
            *all = one.max(*all);
        }
        self.mixed |= scene.mixed;
        Ok(())
    }

    /// Number of times that parts are read for writing.
    fn passes(&self) -> u64 {
        let bands = if self.mixed { self.banded } else { 0 };
        [self.constants, self.banded, bands, self.supplement].iter().filter(|&&rows| rows > 0).count() as u64
    }

    fn write<W: Write>(
        &self,
        file: &mut W,
        parts: usize,
        part: &mut impl FnMut(usize) -> Result<(Scene, Kept)>,
    ) -> Result<(), Failed> {
        let [degree, supplement_degree] = self.degrees;
        // In a mixed scene every Gaussian has a constant. Those at the end have bands as well, in an element of their own.
        let base_degree = if self.mixed { 0 } else { degree };
        let empty = |sh_degree: u32| Gaussians { sh_degree, ..Gaussians::default() };
        begin(file, self.origin, &self.trained_with)?;
        Rows::whole(&empty(base_degree), None).write_header(file, BASE, self.constants + self.banded)?;
        if self.mixed && self.banded > 0 {
            Rows::of(&empty(degree), None, Place::is_rest).write_header(file, BANDS, self.banded)?;
        }
        let no_lobes = Supplement::default();
        if self.supplement > 0 {
            Rows::whole(&empty(supplement_degree), Some(&no_lobes.lobes)).write_header(
                file,
                SUPPLEMENT,
                self.supplement,
            )?;
        }
        writeln!(file, "end_header")?;
        // One of [`Totals::passes`]: a pass over all parts for each section of the file that is not empty.
        let mut pass = |rows: usize, write: &mut dyn FnMut(Scene, Kept, &mut W) -> io::Result<()>| {
            (0..if rows > 0 { parts } else { 0 }).try_for_each(|i| {
                let (scene, kept) = part(i).map_err(Failed::Part)?;
                write(scene, kept, file).map_err(Failed::Io)
            })
        };
        let vertices = |base: &Gaussians, numbers: &[usize], file: &mut W| {
            Rows::whole(&base.reordered(numbers).with_degree(base_degree), None).write(file)
        };
        pass(self.constants, &mut |scene, kept, file| vertices(&scene.base, &kept.constants, file))?;
        pass(self.banded, &mut |scene, kept, file| vertices(&scene.base, &kept.banded, file))?;
        pass(if self.mixed { self.banded } else { 0 }, &mut |scene, kept, file| {
            let banded = scene.base.reordered(&kept.banded).with_degree(degree);
            Rows::of(&banded, None, Place::is_rest).write(file)
        })?;
        pass(self.supplement, &mut |scene, kept, file| {
            let Some(mut supplement) = scene.supplement else { return Ok(()) };
            supplement.retain(|i| kept.supplement.binary_search(&i).is_ok());
            let gaussians = supplement.gaussians.with_degree(supplement_degree);
            Rows::whole(&gaussians, Some(&supplement.lobes)).write(file)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::plan::Part;
    use super::super::{read_scene, write_ply};
    use super::*;
    use crate::reference::sample::random_scene;

    /// Two parts, left and right of x = 0.
    fn plan() -> Plan {
        let part =
            |x: f64| Part { seeds: vec![[x, 0.0, 0.0, 0.0, 0.0, 0.0]], photos: vec!["a".into()], ..Part::default() };
        Plan { parts: vec![part(-1.0), part(1.0)], ..Plan::default() }
    }

    fn tag(part: u32) -> PartOf {
        PartOf { plan: plan().id(), part, of: 2, complete: true }
    }

    fn write(folder: &Path, name: &str, scene: &Scene, part: Option<PartOf>) -> PathBuf {
        let path = folder.join(name);
        let trained_with = TrainedWith { background: Some([1.0; 3]), part, ..TrainedWith::default() };
        write_ply(&path, scene, None, trained_with).unwrap();
        path
    }

    /// Gaussians of `scene` on one side.
    fn side(scene: &Scene, right: bool) -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
        let means = |g: &Gaussians| g.means.iter().copied().filter(|mean| (mean[0] > 0.0) == right).collect();
        (means(&scene.base), scene.supplement.as_ref().map(|s| means(&s.gaussians)).unwrap_or_default())
    }

    #[test]
    fn each_part_keeps_what_belongs_to_it() {
        let folder = tempfile::tempdir().unwrap();
        // With lobes; without, and of a lower degree; with bands of some Gaussians only.
        let left = random_scene(1, 300, 40, 3);
        let right = random_scene(2, 200, 0, 1);
        let mut mixed = random_scene(3, 250, 30, 2);
        mixed.mixed = true;
        mixed.base.sh[..9 * 100].chunks_mut(9).for_each(|row| row[1..].fill([0.0; 3]));
        for (name, second) in [("plain", right), ("mixed", mixed)] {
            let files = [
                write(folder.path(), "1.ply", &second, Some(tag(1))),
                write(folder.path(), "0.ply", &left, Some(tag(0))),
            ];
            let output = folder.path().join(format!("{name}.ply"));
            let mut reads = Vec::new();
            let parts = merge(&plan(), &files, &output, |of| reads.push(of)).unwrap();
            let file = read_scene_file(&output).unwrap();
            assert_eq!(file.trained_with, TrainedWith { background: Some([1.0; 3]), ..TrainedWith::default() });
            let (base, lobes) = side(&left, false);
            let (more, more_lobes) = side(&second, true);
            let found = file.scene;
            let sorted = |mut means: Vec<[f32; 3]>| {
                means.sort_by(|a, b| a.partial_cmp(b).unwrap());
                means
            };
            assert_eq!(sorted(found.base.means.clone()), sorted([base.clone(), more.clone()].concat()), "{name}");
            let supplement = found.supplement.unwrap();
            assert_eq!(supplement.gaussians.means, [lobes.clone(), more_lobes.clone()].concat());
            assert_eq!((found.base.sh_degree, found.mixed), (3, name == "mixed"));
            // Every number of each Gaussian: those of the second part, by their means.
            for (i, mean) in found.base.means.iter().enumerate() {
                let (part, at) = [&left, &second]
                    .into_iter()
                    .find_map(|part| Some((part, part.base.means.iter().position(|m| m == mean)?)))
                    .unwrap();
                let one = part.base.reordered(&[at]).with_degree(3);
                assert_eq!(found.base.reordered(&[i]), one);
            }
            assert_eq!(
                parts.iter().map(|part| part.kept).sum::<usize>(),
                found.base.len() + supplement.gaussians.len()
            );
            assert_eq!(parts[0].kept_lobes, lobes.len());
            assert_eq!(parts[1].left_out, second.base.len() + 30 * usize::from(name == "mixed") - parts[1].kept);
            assert_eq!(reads.len() as u64, *reads.last().unwrap());
        }
    }

    #[test]
    fn parts_that_do_not_make_a_whole_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let scene = random_scene(1, 30, 0, 0);
        let file = |name: &str, part: Option<PartOf>| write(folder.path(), name, &scene, part);
        let error = |files: &[PathBuf]| {
            let output = folder.path().join("out.ply");
            let error = merge(&plan(), files, &output, |_| ()).unwrap_err();
            assert!(error.exit_code() == 2 && !output.exists(), "{error}");
            error.to_string()
        };
        let [zero, one] = [0, 1].map(|part| file(&format!("{part}.ply"), Some(tag(part))));
        assert!(error(std::slice::from_ref(&one)).contains("of 2 parts, these are missing: 0"));
        let unfinished = file("u.ply", Some(PartOf { complete: false, ..tag(0) }));
        let other = file("o.ply", Some(PartOf { plan: 1, ..tag(0) }));
        let none = file("n.ply", None);
        let text = error(&[zero.clone(), zero.clone(), one.clone(), unfinished, other, none]);
        for part in ["both part 0", "u.ply is unfinished", "o.ply is part 0 of another plan", "n.ply is not a part"] {
            assert!(text.contains(part), "{text}");
        }
        let differs = folder.path().join("d.ply");
        write_ply(&differs, &scene, None, TrainedWith { part: Some(tag(1)), ..TrainedWith::default() }).unwrap();
        assert!(error(&[zero, differs]).contains("d.ply: was trained with another background"));
        assert!(read_scene(&one).is_ok());
    }
}
