//! Cuts a dataset into parts: a balanced cut of the graph of what its cameras see.

use std::collections::BTreeMap;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use glam::DVec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use metis::Graph;
use metis::option::Seed;
use rayon::prelude::*;

use super::look::{Look, looks};
use super::patches::{Patch, patches};
use super::{Owners, Part, Plan, checksum};
use crate::data::{Dataset, DatasetOptions, Photo, Split};
use crate::{Error, Result};

/// Maximum sizes of parts.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Training photos of a part, not counting its ring.
    pub photos: usize,
    /// Gaussians that a part trains.
    pub gaussians: usize,
    /// Gaussians of the whole scene.
    pub total: usize,
}

/// Weight of all edges of a camera, unless [`ALL`] cameras have less each.
const CAMERA: f64 = 1000.0;
/// Weight of all edges of all cameras. METIS adds weights up in 32 bits, of which those between patches take as much again twice.
const ALL: f64 = 5e8;
/// Number of neighbours of a patch.
const NEIGHBOURS: usize = 6;
/// Weight of a patch's edges to its neighbours, relative to those to cameras.
const BETWEEN: f64 = 2.0;
/// A photo of another part belongs to a part's ring if at least this share of its rays crosses what the part owns. With rays up to the
/// surface, 5 % adds three photos on garden, and 30 % leaves out more than a third (docs/experiments/2026-11-28-parts.md).
const RING: f64 = 0.1;
/// A photo has a ray in every so many cells; 17 has no factor in common with the cells of a row, so rays spread over all columns.
const RAY_EVERY: usize = 17;
/// Length of a ray, relative to the distance of the surface that it shows: pixels also show Gaussians behind that surface, through gaps
/// between the sparse points. On bonsai a cut with rays that end at the surface loses 2.2 dB (docs/experiments/2026-11-28-parts.md).
const REACH: f64 = 2.0;
/// Places on a ray, evenly, whose owners are looked up. A part that a ray crosses for less than an eighth of its length may be missed.
const PLACES: u32 = 8;
/// Attempts to keep the limits, each with one part more, or with a share of 1/32 more.
const ATTEMPTS: usize = 32;

/// Cuts `dataset`, which was opened from `path` with `options`. Notes for the user go to `notes`.
///
/// # Errors
/// If the dataset has no sparse points or no training photos, or cannot be cut so that all parts keep `limits`.
pub fn cut(
    dataset: &Dataset,
    path: &Path,
    options: &DatasetOptions,
    limits: Limits,
    notes: &mut Vec<String>,
) -> Result<Plan> {
    let Some(points) = dataset.points.as_ref().filter(|points| !points.positions.is_empty()) else {
        let what = "has no sparse points, by which a dataset is cut; expected a COLMAP model with points3D";
        return Err(Error::input(path, what));
    };
    let patches = patches(&points.positions);
    let looks = looks(&dataset.photos, &patches);
    let of = |split: Split| dataset.split(split).map(|(i, _)| i);
    let training: Vec<usize> = of(Split::Train).filter(|&i| looks[i].shows_any()).collect();
    let all = of(Split::Train).count();
    if training.is_empty() {
        let what = "no training photo shows a sparse point; check that photos and points belong together";
        return Err(Error::input(path, what));
    }
    if training.len() < all {
        notes.push(format!("{} of {all} training photos show no sparse point: no part has them", all - training.len()));
    }
    let labels = Visibility::of(training.iter().map(|&i| &looks[i]), &patches).cut_within(limits)?;
    let number_of_parts = labels.iter().max().map_or(0, |most| most + 1);
    let (of_photos, of_patches) = labels.split_at(training.len());
    let views = training.iter().map(|&i| (&looks[i], dataset.photos[i].camera.eye()));
    let normals = normals(views, &patches);

    let mut in_parts: Vec<Vec<usize>> = vec![Vec::new(); number_of_parts];
    of_patches.iter().enumerate().for_each(|(i, &part)| in_parts[part].push(i));
    let mut parts: Vec<Part> = in_parts.iter().map(|own| seeds_of(own, &patches, &normals)).collect();
    let in_parts = in_parts.concat();
    let mut numbers = vec![0u32; patches.len()];
    in_parts.iter().enumerate().for_each(|(number, &patch)| numbers[patch] = number as u32);
    let owners = Owners::of(&parts);
    let crossed: Vec<_> =
        dataset.photos.par_iter().zip(&looks).map(|(photo, look)| crossed(photo, look, &patches, &owners)).collect();
    for (i, (photo, look)) in dataset.photos.iter().zip(&looks).enumerate() {
        let own = training.binary_search(&i).ok().map(|at| of_photos[at]);
        add_photo(&mut parts, photo, (look, &crossed[i]), own, (of_patches, &numbers));
    }
    let mut first = 0;
    for part in &mut parts {
        part.near.sort_unstable();
        part.near.dedup();
        let seeds = first..first + part.seeds.len() as u32;
        first = seeds.end;
        let starts = seeds.chain(part.near.iter().copied());
        let points = starts.map(|number| u64::from(patches[in_parts[number as usize]].points)).sum();
        part.gaussians = limits.share(points, &patches).clamp(1, limits.gaussians) as u32;
    }
    let there = |path: &Path| std::path::absolute(path).map_err(|source| Error::io(path, source));
    // A path stays what it is for runs in other folders; a name in the dataset stays a name.
    let folder = |path: &Option<PathBuf>| match path {
        Some(path) if path.exists() => there(path).map(Some),
        other => Ok(other.clone()),
    };
    let options =
        DatasetOptions { images: folder(&options.images)?, model: folder(&options.model)?, ..options.clone() };
    Ok(Plan { dataset: there(path)?, options, checksum: checksum(dataset), parts })
}

impl Limits {
    /// Number of Gaussians for this number of all points.
    fn share(&self, points: u64, patches: &[Patch]) -> usize {
        let all: u64 = patches.iter().map(|patch| u64::from(patch.points)).sum();
        (self.total as f64 * points as f64 / all as f64).round() as usize
    }
}

/// A part with the seeds of its `own` patches and their bounds.
fn seeds_of(own: &[usize], patches: &[Patch], normals: &[DVec3]) -> Part {
    let mut part = Part::default();
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for (patch, normal) in own.iter().map(|&i| (patches[i], normals[i])) {
        (low, high) = (low.min(patch.center - patch.radius), high.max(patch.center + patch.radius));
        let ([x, y, z], [u, v, w]) = (patch.center.to_array(), normal.to_array());
        part.seeds.push([x, y, z, u, v, w]);
    }
    part.bounds = if part.seeds.is_empty() { Default::default() } else { [low.to_array(), high.to_array()] };
    part
}

/// The parts that a photo's rays cross, in order, each with the share of these rays. Gaussians that these parts own can be in front of what
/// the photo shows or appear through it, even if it shows nothing of the parts themselves.
fn crossed(photo: &Photo, look: &Look, patches: &[Patch], owners: &Owners) -> Vec<(usize, f64)> {
    if !look.shows_any() {
        return Vec::new();
    }
    let eye = photo.camera.eye();
    let ends = look.patches.iter().step_by(RAY_EVERY).map(|&patch| patches[patch as usize].center);
    let rays = ends.len() as f64;
    let mut all: Vec<usize> = ends
        .flat_map(|end| {
            let at = |place| eye.lerp(end, REACH * f64::from(place) / f64::from(PLACES)).to_array();
            let mut parts: Vec<usize> = (1..=PLACES).map(|place| owners.part(at(place)) as usize).collect();
            parts.sort_unstable();
            parts.dedup();
            parts
        })
        .collect();
    all.sort_unstable();
    all.chunk_by(|a, b| a == b).map(|same| (same[0], same.len() as f64 / rays)).collect()
}

/// Adds a photo to its `own` part and to those that it crosses, and what else it shows to their `near`. `numbers` has the
/// number of each patch in the sequence of all parts' seeds.
fn add_photo(
    parts: &mut [Part],
    photo: &Photo,
    (look, crossed): (&Look, &[(usize, f64)]),
    own: Option<usize>,
    (of_patches, numbers): (&[usize], &[u32]),
) {
    if !look.shows_any() {
        return;
    }
    let shown = look.shown();
    let enough = crossed.iter().filter(|(_, share)| *share >= RING).map(|(part, _)| *part);
    for which in enough.filter(|part| own != Some(*part)).chain(own) {
        let part = &mut parts[which];
        if photo.split == Split::Train {
            let others = shown.iter().filter(|(patch, _)| of_patches[*patch as usize] != which);
            part.near.extend(others.map(|(patch, _)| numbers[*patch as usize]));
        }
        let list = match (photo.split, own) {
            (Split::Test, _) => &mut part.test,
            (Split::Train, Some(own)) if own == which => &mut part.photos,
            (Split::Train, _) => &mut part.ring,
        };
        list.push(photo.name.clone());
    }
}

/// By patch, the mean direction towards the eyes of the views that show it, of length 1; 0 for those that none shows.
fn normals<'a>(views: impl Iterator<Item = (&'a Look, DVec3)>, patches: &[Patch]) -> Vec<DVec3> {
    let mut normals = vec![DVec3::ZERO; patches.len()];
    for (look, eye) in views {
        for (patch, _) in look.shown() {
            normals[patch as usize] += (eye - patches[patch as usize].center).normalize_or_zero();
        }
    }
    normals.into_iter().map(DVec3::normalize_or_zero).collect()
}

/// Numbers parts by their first photo, and those without one by their first patch, so that equal cuts have equal numbers.
fn in_order(labels: Vec<usize>) -> Vec<usize> {
    let mut names = BTreeMap::new();
    let name = |label| {
        let next = names.len();
        *names.entry(label).or_insert(next)
    };
    labels.into_iter().map(name).collect()
}

/// Cameras and patches, in this order, with weighted edges between those that see and are seen, and between neighbours.
struct Visibility<'a> {
    /// By node, its edges: the other node and the weight.
    edges: Vec<Vec<(i32, i32)>>,
    /// Number of cameras.
    cameras: usize,
    patches: &'a [Patch],
}

impl<'a> Visibility<'a> {
    fn of<'b>(looks: impl ExactSizeIterator<Item = &'b Look>, patches: &'a [Patch]) -> Self {
        let cameras = looks.len();
        let of_camera = CAMERA.min(ALL / cameras as f64);
        let mut edges: Vec<Vec<(i32, i32)>> = vec![Vec::new(); cameras + patches.len()];
        let mut add = |a: usize, b: usize, weight: f64| {
            // METIS takes whole weights from 1 on.
            let weight = weight.round().max(1.0) as i32;
            edges[a].push((b as i32, weight));
            edges[b].push((a as i32, weight));
        };
        for (camera, look) in looks.enumerate() {
            for (patch, cells) in look.shown() {
                add(camera, cameras + patch as usize, of_camera * cells as f64 / look.patches.len() as f64);
            }
        }
        let between = BETWEEN * of_camera * cameras as f64 / (patches.len() * NEIGHBOURS) as f64;
        for (a, b) in neighbours(patches) {
            add(cameras + a, cameras + b, between);
        }
        Visibility { edges, cameras, patches }
    }

    /// By node, its part, with the fewest parts of all attempts that keep `limits`.
    fn cut_within(&self, limits: Limits) -> Result<Vec<usize>> {
        let fits = |labels: &Vec<usize>| {
            let mut sizes: BTreeMap<usize, (usize, u64)> = BTreeMap::new();
            labels[..self.cameras].iter().for_each(|&part| sizes.entry(part).or_default().0 += 1);
            labels[self.cameras..]
                .iter()
                .zip(self.patches)
                .for_each(|(&part, patch)| sizes.entry(part).or_default().1 += u64::from(patch.points));
            let within =
                |(photos, points)| photos <= limits.photos && limits.share(points, self.patches) <= limits.gaussians;
            sizes.into_values().all(within)
        };
        let least = self.cameras.div_ceil(limits.photos).max(limits.total.div_ceil(limits.gaussians));
        // A cut is balanced within a few percent: large numbers of parts grow in larger steps.
        let step = least.div_ceil(ATTEMPTS);
        let most = (least + ATTEMPTS * step).min(self.cameras).min(self.patches.len());
        (least..=most).step_by(step).filter_map(|parts| self.cut(parts)).find(fits).map(in_order).ok_or_else(|| {
            Error::Usage(format!(
                "{} photos and {} groups of points: no cut into {least} to {most} parts gives each at most the photos and \
                 Gaussians asked for; expected larger limits",
                self.cameras,
                self.patches.len()
            ))
        })
    }

    /// By node, its part: balanced by cameras and by points. `None` if there is no such cut.
    fn cut(&self, parts: usize) -> Option<Vec<usize>> {
        if parts == 1 {
            return Some(vec![0; self.edges.len()]);
        }
        let mut starts = vec![0];
        for edges in &self.edges {
            starts.push(i32::try_from(starts[starts.len() - 1] as usize + edges.len()).ok()?);
        }
        let (to, weights): (Vec<i32>, Vec<i32>) = self.edges.iter().flatten().copied().unzip();
        // Two weights of each node: photos and points.
        let sizes: Vec<i32> = std::iter::repeat_n([1, 0], self.cameras)
            .chain(self.patches.iter().map(|patch| [0, patch.points as i32]))
            .flatten()
            .collect();
        let mut labels = vec![0; self.edges.len()];
        let graph = Graph::new(2, parts as i32, &starts, &to).ok()?;
        graph.set_vwgt(&sizes).set_adjwgt(&weights).set_option(Seed(0)).part_recursive(&mut labels).ok()?;
        Some(labels.into_iter().map(|part| part as usize).collect())
    }
}

/// Pairs of patches of which one is among the nearest of the other, each once.
fn neighbours(patches: &[Patch]) -> Vec<(usize, usize)> {
    let at: Vec<[f64; 3]> = patches.iter().map(|patch| patch.center.to_array()).collect();
    let Ok(tree) = ImmutableKdTree::<f64, 3>::new_from_slice(&at) else { return Vec::new() };
    let most = NonZeroUsize::new((NEIGHBOURS + 1).min(at.len())).unwrap_or(NonZeroUsize::MIN);
    let mut pairs: Vec<(usize, usize)> = Vec::with_capacity(NEIGHBOURS * at.len());
    for (a, at) in at.iter().enumerate() {
        let found = tree.query(at).nearest_n::<SquaredEuclidean<f64>>(most).execute();
        let others = found.into_iter().map(|found| found.item as usize).filter(|&b| b != a).take(NEIGHBOURS);
        pairs.extend(others.map(|b| (a.min(b), a.max(b))));
    }
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::data::{Image, PixelSource, PointCloud};
    use crate::scene::Camera;

    /// Two walls 40 units apart, each of 600 points, in front of 8 cameras that see nothing else; the first photo of each is for
    /// testing.
    fn two_walls() -> Dataset {
        let camera = |x: f64| Camera { translation: DVec3::new(-x, 0.0, 0.0), ..Camera::new(64, 48, 40.0) };
        let image = Arc::new(Image { width: 64, height: 48, rgb: vec![0; 3 * 64 * 48], mask: None });
        // Names alternate between the walls.
        let photos = (0..16).map(|i| Photo {
            name: format!("{i:02}.png"),
            camera: camera(f64::from(i % 2) * 40.0 + f64::from(i / 2) * 0.5),
            split: if i < 2 { Split::Test } else { Split::Train },
            pixels: PixelSource::Memory(image.clone()),
        });
        let positions: Vec<[f64; 3]> = (0..1200)
            .map(|i| [f64::from(i % 2) * 40.0 + f64::from(i / 2 % 30) * 0.25, f64::from(i / 60) * 0.3 - 3.0, 5.0])
            .collect();
        Dataset {
            photos: photos.collect(),
            points: Some(PointCloud { colors: vec![[9; 3]; positions.len()], positions }),
            ..Dataset::default()
        }
    }

    const LIMITS: Limits = Limits { photos: 7, gaussians: usize::MAX, total: 2400 };

    fn plan(dataset: &Dataset, limits: Limits) -> Result<Plan> {
        cut(dataset, Path::new("walls"), &DatasetOptions::default(), limits, &mut Vec::new())
    }

    #[test]
    fn what_is_seen_together_stays_together() {
        let dataset = two_walls();
        let plan = plan(&dataset, LIMITS).unwrap();
        assert_eq!(plan.parts.len(), 2);
        let names = |of: &[u32]| of.iter().map(|i| format!("{i:02}.png")).collect::<Vec<_>>();
        for (which, part) in plan.parts.iter().enumerate() {
            let first = which as u32;
            let own: Vec<u32> = (1..8).map(|i| 2 * i + first).collect();
            assert_eq!((&part.photos, &part.test), (&names(&own), &names(&[first])));
            // No camera sees the other wall: all Gaussians are the part's own.
            assert!(part.ring.is_empty() && part.near.is_empty() && part.gaussians == 1200);
            assert!(part.seeds.iter().all(|seed| (seed[0] - 40.0 * which as f64).abs() < 8.0));
            // Cameras look at the walls along z: normals point back, with the cameras' spread to the sides.
            assert!(part.seeds.iter().all(|seed| seed[5] < -0.6), "{:?}", part.seeds);
            let [low, high] = part.bounds;
            assert!((low[0] - 40.0 * which as f64).abs() < 1.0 && high[0] - low[0] < 9.0);
        }
        let owners = Owners::of(&plan.parts);
        assert_eq!([owners.part([3.0, 0.0, 5.1]), owners.part([44.0, 1.0, 4.9])], [0, 1]);
        assert_eq!(owners.part_and_seam([3.0, 0.0, 5.1]), (0, false));
    }

    #[test]
    fn one_wall_is_cut_where_fewest_photos_see_both_sides() {
        // Photos and points of the first wall alone.
        let mut dataset = two_walls();
        dataset.photos = dataset.photos.into_iter().step_by(2).collect();
        let points = dataset.points.as_mut().unwrap();
        points.positions = points.positions.iter().copied().step_by(2).collect();
        points.colors.truncate(600);
        let plan = plan(&dataset, Limits { photos: 4, ..LIMITS }).unwrap();
        let [a, b] = &plan.parts[..] else { panic!("{} parts", plan.parts.len()) };
        // Photos near the border show both sides, that at the end less than a tenth of the other.
        assert_eq!(a.photos.len() + b.photos.len(), 7);
        for (part, other) in [(a, b), (b, a)] {
            assert!(!part.ring.is_empty() && part.ring.iter().all(|name| other.photos.contains(name)));
        }
        assert!(!a.near.is_empty() && !b.near.is_empty());
        let first_of_b = a.seeds.len() as u32;
        assert!(a.near.iter().all(|&n| n >= first_of_b) && b.near.iter().all(|&n| n < first_of_b));
        // A part starts from all points that its photos show, and has room for them.
        assert!(a.gaussians + b.gaussians > 2400);
        let owners = Owners::of(&plan.parts);
        assert!(a.seeds.iter().all(|&[x, y, z, ..]| owners.part([x, y, z]) == 0));
    }

    #[test]
    fn a_ray_crosses_the_parts_in_front_of_what_it_shows_and_behind_it() {
        // Walls at these depths belong to parts 0 to 3. A place behind a wall counts as nearer to the next one.
        let depths = [4.0, 8.0, 24.0, 100.0];
        let seed = |z: f64| Part { seeds: vec![[0.0, 0.0, z, 0.0, 0.0, -1.0]], ..Part::default() };
        let patch = |z: f64| Patch { center: DVec3::new(0.0, 0.0, z), radius: 0.1, points: 1 };
        let (owners, patches) = (Owners::of(&depths.map(seed)), depths.map(patch));
        let photo = &two_walls().photos[0];
        let found = |patch: u32| crossed(photo, &Look { patches: vec![patch; 100] }, &patches, &owners);
        assert_eq!([found(0), found(1)], [vec![(0, 1.0), (1, 1.0)], vec![(0, 1.0), (1, 1.0), (2, 1.0)]]);
        // Every second ray ends at part 0.
        let look = Look { patches: (0..RAY_EVERY as u32 * 4).map(|cell| cell / RAY_EVERY as u32 % 2).collect() };
        assert_eq!(crossed(photo, &look, &patches, &owners), [(0, 1.0), (1, 1.0), (2, 0.5)]);
    }

    #[test]
    fn limits_are_kept_or_refused_and_what_cannot_be_cut_is_named() {
        let dataset = two_walls();
        let plan = |limits| plan(&dataset, limits);
        let more = plan(Limits { gaussians: 700, ..LIMITS }).unwrap();
        assert!(more.parts.len() >= 4 && more.parts.iter().all(|part| part.photos.len() <= 7 && part.gaussians <= 700));
        assert_eq!(plan(LIMITS).unwrap(), plan(LIMITS).unwrap());
        assert_eq!(plan(Limits { photos: 100, ..LIMITS }).unwrap().parts.len(), 1);
        let error = plan(Limits { gaussians: 1, ..LIMITS }).unwrap_err();
        assert!(error.exit_code() == 2 && error.to_string().contains("larger limits"), "{error}");
        let error = |dataset: Dataset| super::tests::plan(&dataset, LIMITS).unwrap_err().to_string();
        assert!(error(Dataset { points: None, ..two_walls() }).contains("walls: has no sparse points"));
        let mut away = two_walls();
        away.points.as_mut().unwrap().positions.iter_mut().for_each(|p| p[2] = -5.0);
        assert!(error(away).contains("no training photo shows a sparse point"));
        // A photo that shows nothing is in no part, with a note.
        let mut one = two_walls();
        one.photos[5].camera.translation = DVec3::new(0.0, 0.0, -50.0);
        let mut notes = Vec::new();
        let plan = cut(&one, Path::new("walls"), &DatasetOptions::default(), LIMITS, &mut notes).unwrap();
        assert_eq!(notes, ["1 of 14 training photos show no sparse point: no part has them"]);
        assert!(plan.parts.iter().all(|part| !part.photos.contains(&"05.png".into())));
    }
}
