//! A scene on the device: its segments, each in pages, and the number of Gaussians in each.

mod planes;
mod rearrange;
mod upload;

use std::ops::Range;

use glam::DVec3;
pub use planes::Planes;
use planes::Quads;
pub use rearrange::{Rearrange, Sources};
pub use upload::Upload;

use super::{
    plan::{Held, Plan, Planned, bind},
    views::Views,
};
use crate::{
    data::lengths,
    error::{Error, Result},
    gpu::{Buffer, Context, DeviceInfo, GpuError, Location, Recorder, Unused},
    scene::{
        Gaussians, Lobes, Scene, Supplement, color,
        layout::{self, GEOMETRY_PLANES, HALF_GEOMETRY_PLANES, LOBE_PLANES, MEAN},
    },
    stages::{
        WORKGROUP,
        blocks::items_per_group,
        constants::{constants::NONE, population},
        recount,
        status::{self, Resource},
        types::Page,
    },
};

/// The parts of a scene whose Gaussians have the same parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Segment {
    /// The Gaussians that every viewer shows; in a [mixed](Scene::mixed) scene those with a constant color.
    Base = population::BASE as isize,
    /// The Gaussians of the base whose color depends on the direction, in a [mixed](Scene::mixed) scene.
    Banded = population::BANDED as isize,
    /// Gaussians with lobes.
    Supplement = population::SUPPLEMENT as isize,
}

impl Segment {
    /// In the order of the Gaussian index.
    pub const ALL: [Segment; SEGMENTS] = [Segment::Base, Segment::Banded, Segment::Supplement];

    /// The segments up to this one, with all of the base.
    pub fn upto(self) -> impl Iterator<Item = Segment> {
        Self::ALL.into_iter().take(self.last() as usize + 1)
    }

    /// The last of [`Segment::upto`].
    pub fn last(self) -> Segment {
        if self == Segment::Base { Segment::Banded } else { self }
    }

    /// Whether its Gaussians have lobes.
    pub fn has_lobes(self) -> bool {
        self == Segment::Supplement
    }

    /// The segment's index in kernels.
    pub fn index(self) -> u32 {
        self as u32
    }

    /// The resource to report if this segment runs out of room.
    pub fn resource(self) -> Resource {
        match self {
            Segment::Base => Resource::BaseGaussians,
            Segment::Banded => Resource::BandedGaussians,
            Segment::Supplement => Resource::SupplementGaussians,
        }
    }
}

/// Number of segments.
pub const SEGMENTS: usize = population::SEGMENTS as usize;

/// The parameters of one segment.
pub struct Part {
    /// Pages in order; each starts at the end of the previous one.
    pub pages: Vec<Page>,
    /// Position, scale, rotation and opacity: the planes named in `scene::layout`.
    pub geometry: Planes,
    /// Color.
    pub sh: Planes,
    /// Lobes; only of the supplement.
    pub lobes: Planes,
    /// Degree of the harmonics, 0 to 3, or [`BETAS`](color::BETAS).
    pub sh_degree: u32,
    /// Half width, see [`layout::pack_geometry`] and [`layout::pack_halves`].
    half: bool,
}

impl Part {
    /// Number of Gaussians that fit.
    pub fn capacity(&self) -> u32 {
        self.pages.iter().map(|page| page.capacity).sum()
    }
}

/// Extra capacity of a model beyond its scene, and its format.
#[derive(Debug, Clone, Copy, Default)]
pub struct Room {
    /// Extra Gaussians of the base; in a [mixed](Scene::mixed) scene of those with a constant color.
    pub base: u32,
    /// Extra Gaussians of the base with bands, in a mixed scene.
    pub banded: u32,
    /// Extra Gaussians with lobes.
    pub supplement: u32,
    /// Maximum number of Gaussians per page; `None` for the device's limit.
    pub page: Option<u32>,
    /// Degree of the harmonics of a future supplement, if the scene has none yet; `None` for the base's
    /// degree.
    pub supplement_degree: Option<u32>,
    /// Half width: 128 bytes per Gaussian of degree 3 instead of 240. Harmonics are half floats; rotation and
    /// scales take 128 bits. For rendering only: such a model cannot learn.
    pub half: bool,
    /// Colors, lobes and, when it learns, moments lie in the host's memory, where kernels access them over the
    /// bus. Of the 544 bytes of a Gaussian of degree 3 that learns by Newton steps, 48 stay on the device.
    pub host: bool,
}

impl Room {
    /// Capacities of the segments of a model that starts with these counts.
    pub(super) fn capacities(&self, [base, banded, supplement]: [u32; SEGMENTS]) -> [u32; SEGMENTS] {
        // An empty base still has a page: its first Gaussian writes the pixels without a Gaussian.
        [
            base.saturating_add(self.base).max(1),
            banded.saturating_add(self.banded),
            supplement.saturating_add(self.supplement),
        ]
    }

    /// Number of Gaussians in each segment.
    pub(super) fn counts(scene: &Scene) -> [u32; SEGMENTS] {
        let constants = if scene.mixed { scene.base.constants() } else { scene.base.len() };
        let supplement = scene.supplement.as_ref().map_or(0, |supplement| supplement.gaussians.len());
        [constants, scene.base.len() - constants, supplement].map(|count| count as u32)
    }

    /// Numbers of planes: of geometry, harmonics and lobes.
    fn planes(&self, segment: Segment, sh_degree: u32) -> [usize; 3] {
        let sh = layout::sh_planes(sh_degree);
        let lobes = if segment.has_lobes() { LOBE_PLANES } else { 0 };
        match self.half {
            true => [HALF_GEOMETRY_PLANES, sh.div_ceil(2), lobes],
            false => [GEOMETRY_PLANES, sh, lobes],
        }
    }

    /// Bytes of a Gaussian's geometry, harmonics and lobe.
    pub(crate) fn bytes(&self, segment: Segment, sh_degree: u32) -> [u64; 3] {
        self.planes(segment, sh_degree).map(layout::bytes)
    }

    /// [`Room::bytes`] in device memory.
    fn device_bytes(&self, segment: Segment, sh_degree: u32) -> [u64; 3] {
        let [geometry, sh, lobes] = self.bytes(segment, sh_degree);
        if self.host { [geometry, 0, 0] } else { [geometry, sh, lobes] }
    }

    /// Degrees of the harmonics of each segment.
    fn degrees(&self, scene: &Scene) -> [u32; SEGMENTS] {
        let banded = scene.base.sh_degree;
        let of = |supplement: &Supplement| supplement.gaussians.sh_degree;
        let supplement = scene.supplement.as_ref().map(of).or(self.supplement_degree).unwrap_or(banded);
        [if scene.mixed { 0 } else { banded }, banded, supplement]
    }

    /// The highest degree of a segment that has room.
    fn degree(&self, scene: &Scene) -> u32 {
        let room = self.degrees(scene).into_iter().zip(self.capacities(Self::counts(scene)));
        room.filter(|&(_, capacity)| capacity > 0).map(|(degree, _)| degree).max().unwrap_or(0)
    }

    /// Maximum number of Gaussians per page.
    pub(super) fn page_limit(&self, device: &DeviceInfo, sh_degree: u32) -> u32 {
        // A page's largest buffer holds two moments of every SH plane.
        let quads = 2 * layout::quads(layout::sh_planes(sh_degree).max(GEOMETRY_PLANES));
        let fits = (device.max_storage_bytes / (16 * quads as u64)).min(u64::from(u32::MAX)) as u32;
        self.page.unwrap_or(u32::MAX).min(fits / WORKGROUP * WORKGROUP).max(1)
    }
}

/// Debug names of each segment's planes.
const NAMES: [[&str; 3]; SEGMENTS] = [
    ["geometry", "sh", "lobes"],
    ["banded geometry", "banded sh", "banded lobes"],
    ["supplement geometry", "supplement sh", "supplement lobes"],
];

/// A scene's segments on the device. Their counts live on the device: stages may change them, and later
/// dispatches read them. Recorded commands keep the model's buffers (see [`Kept`](crate::gpu::Kept)), so it
/// may be dropped before they have run.
pub struct Model {
    context: Context,
    parts: [Part; SEGMENTS],
    /// The highest degree of the segments that have room, 0 to 3, or [`BETAS`](color::BETAS).
    pub sh_degree: u32,
    /// World position of the device's coordinate origin; means are relative to it.
    pub origin: DVec3,
    /// Origin of the uploaded scene's means, used again by [`Model::download`].
    pub(crate) scene_origin: DVec3,
    page_limit: u32,
    /// Last counts of each segment known to the host, see [`Model::learn_counts`].
    known: [u32; SEGMENTS],
    /// Start of each segment in the Gaussian index, and the total number of Gaussians.
    pub population: Buffer<u32>,
    /// Dispatches over each page, then over the blocks of all Gaussians up to the end of each segment.
    pub population_args: Buffer<u32>,
    /// Number of Gaussians in each segment.
    pub(super) segment_counts: Buffer<u32>,
    pages: Buffer<Page>,
    recount: recount::Stage,
    unused: Unused,
}

impl Model {
    /// Uploads `scene` around its own origin, with room for `spare` more supplementary Gaussians. Waits.
    ///
    /// # Errors
    /// If the device's memory does not suffice.
    pub fn upload(context: &Context, scene: &Scene, spare: usize) -> Result<Self> {
        let room = Room { supplement: spare as u32, ..Default::default() };
        Self::upload_around(context, scene.origin, scene, room)
    }

    /// Buffers of a model of `scene` in device memory.
    pub fn plan(device: &DeviceInfo, scene: &Scene, room: Room) -> Plan {
        let degrees = room.degrees(scene);
        let capacities = room.capacities(Room::counts(scene));
        let limit = room.page_limit(device, room.degree(scene));
        let page_count: usize = capacities.iter().map(|capacity| capacity.div_ceil(limit) as usize).sum();
        let planned = |name, elements: u64, element_bytes| Planned { name, elements, element_bytes };
        let mut plan = Plan::default();
        for (segment, capacity) in Segment::ALL.into_iter().zip(capacities) {
            let names = NAMES[segment as usize];
            let rows = names.into_iter().zip(room.device_bytes(segment, degrees[segment as usize]));
            let rows = rows.map(|(name, bytes)| planned(name, u64::from(capacity), bytes));
            plan.0.extend(rows.filter(|row| row.elements * row.element_bytes > 0));
        }
        plan.0.extend([
            planned("population", Segment::ALL.len() as u64 + 1, 4),
            planned("population_args", args_len(page_count) as u64, 4),
            planned("segment_counts", Segment::ALL.len() as u64, 4),
            planned("pages", page_count as u64, size_of::<Page>() as u64),
        ]);
        plan
    }

    /// Uploads `scene` with coordinates relative to `origin`, the origin of the views. Waits.
    pub fn upload_around(context: &Context, origin: DVec3, scene: &Scene, room: Room) -> Result<Self> {
        let mut model = Self::allocate(context, origin, scene, room)?;
        for (part, content) in model.parts.iter().zip(segments_of(scene, &Supplement::default())) {
            for k in 0..part.pages.len() {
                for (planes, values) in part.values(k, &content, origin - scene.origin) {
                    planes.upload(0, &values)?;
                }
            }
        }
        model.segment_counts.upload(0, &model.known)?;
        model.upload_pages()?;
        Ok(model)
    }

    /// Makes all buffers of a model, without contents. Submits nothing.
    fn allocate(context: &Context, origin: DVec3, scene: &Scene, room: Room) -> Result<Self> {
        lengths(scene).map_err(|what| Error::Usage(format!("a scene: {what}")))?;
        let (degrees, sh_degree) = (room.degrees(scene), room.degree(scene));
        let counts = Room::counts(scene);
        let page_limit = room.page_limit(context.info(), sh_degree);
        let part = |segment: Segment, capacity: u32| -> Result<Part, GpuError> {
            let sh_degree = degrees[segment as usize];
            let [geometry, sh, lobes] = room.planes(segment, sh_degree);
            let location = if room.host { Location::Host } else { Location::Device };
            let mut part = Part {
                pages: Vec::new(),
                geometry: Planes::none("geometry", geometry, Location::Device),
                sh: Planes::none("sh", sh, location),
                lobes: Planes::none("lobes", lobes, location),
                sh_degree,
                half: room.half,
            };
            part.reserve(context, segment, capacity, page_limit)?;
            Ok(part)
        };
        let capacities = room.capacities(counts);
        if capacities.into_iter().try_fold(0, u32::checked_add).is_none() {
            let [base, banded, supplement] = capacities;
            let base = u64::from(base) + u64::from(banded);
            let what = format!("a model with room for {base} and {supplement} Gaussians: more than can be numbered");
            return Err(Error::Usage(what));
        }
        let [base, banded, supplement] = Segment::ALL.map(|segment| part(segment, capacities[segment as usize]));
        let parts = [base?, banded?, supplement?];
        let page_count = parts.iter().map(|p| p.pages.len()).sum();
        let words = |name, len| Buffer::new(context, name, len, Location::Device);
        Ok(Model {
            parts,
            sh_degree,
            origin,
            scene_origin: scene.origin,
            page_limit,
            known: counts,
            population: words("population", Segment::ALL.len() + 1)?,
            population_args: words("population_args", args_len(page_count))?,
            segment_counts: words("segment_counts", counts.len())?,
            pages: Buffer::new(context, "pages", page_count, Location::Device)?,
            recount: recount::Stage::new(context, &recount::Spec { workgroup_size: 1 })?,
            unused: Unused::new(context)?,
            context: context.clone(),
        })
    }

    /// Uploads the table of pages, and recounts. Waits.
    fn upload_pages(&mut self) -> Result<()> {
        let pages: Vec<Page> = self.parts.iter().flat_map(|part| part.pages.iter().copied()).collect();
        if pages.len() > self.pages.len() {
            self.pages = Buffer::new(&self.context, "pages", pages.len(), Location::Device)?;
            self.population_args =
                Buffer::new(&self.context, "population_args", args_len(pages.len()), Location::Device)?;
        }
        self.pages.upload(0, &pages)?;
        self.recount_now()
    }

    fn recount_now(&self) -> Result<()> {
        let status = Buffer::<u32>::zeroed(&self.context, "recount status", status::WORDS)?;
        let mut recorder = self.context.recorder("recount")?;
        self.record_recount(&mut recorder, None, &status);
        Ok(recorder.submit()?.wait().map(drop)?)
    }

    /// Updates totals and dispatches from the segments' counts on the device. With `added`, first adds word
    /// `added.1` of `added.0` to the segment's count. A count beyond the pages' room is reported in `status`.
    pub fn record_recount(
        &self,
        recorder: &mut Recorder,
        added: Option<(Segment, &Buffer<u32>, u32)>,
        status: &Buffer<u32>,
    ) {
        let nothing = self.unused.of();
        let (segment, words, added_index) = added.unwrap_or((Segment::Base, &nothing, NONE));
        self.recount.record(
            recorder,
            &bind!(recount { status, added: words; self => pages, segment_counts, population, population_args; }),
            &recount::Push {
                page_count: self.parts.iter().map(|p| p.pages.len() as u32).sum(),
                threads_per_group: self.context.info().workgroup(WORKGROUP),
                items_per_group: items_per_group(self.context.info()),
                segment: segment.index(),
                added_index,
            },
            1,
        );
    }

    /// Reads the number of Gaussians in each segment. Waits.
    pub fn counts(&self) -> Result<[u32; SEGMENTS]> {
        let counts = self.segment_counts.download()?;
        Ok(std::array::from_fn(|s| counts[s]))
    }

    /// Reads the numbers of Gaussians from the device and stores them on the host. Waits.
    pub fn learn_counts(&mut self) -> Result<[u32; SEGMENTS]> {
        self.known = self.counts()?;
        Ok(self.known)
    }

    /// Sets the number of Gaussians of a segment on the device; the values of new ones are undefined. Waits.
    ///
    /// # Errors
    /// [`Error::Usage`] if there is no room for them.
    pub fn set_count(&self, segment: Segment, count: u32) -> Result<()> {
        let capacity = self.part(segment).capacity();

        if count > capacity {
            return Err(Error::Usage(format!("there is room for {capacity} {}, not for {count}", segment.resource())));
        }
        self.segment_counts.upload(segment as usize, &[count])?;
        self.recount_now()
    }

    /// Makes room for at least `capacity` Gaussians in a segment by adding pages. Waits.
    pub fn reserve(&mut self, segment: Segment, capacity: u32) -> Result<()> {
        let limit = self.page_limit;
        self.parts[segment as usize].reserve(&self.context, segment, capacity, limit)?;
        self.upload_pages()
    }

    /// Lists the buffers: for each segment and page those with planes, then the counts. [`Model::reserve`]
    /// replaces some.
    pub fn held(&self) -> Vec<Held> {
        let mut held = Vec::new();
        for (names, part) in NAMES.into_iter().zip(&self.parts) {
            for k in 0..part.pages.len() {
                let planes = [&part.geometry, &part.sh, &part.lobes];
                let some = names.into_iter().zip(planes).filter(|(_, planes)| planes.planes() > 0);
                held.extend(some.map(|(name, planes)| Held::of(name, planes.page(k))));
            }
        }
        held.extend([
            Held::of("population", &self.population),
            Held::of("population_args", &self.population_args),
            Held::of("segment_counts", &self.segment_counts),
            Held::of("pages", &self.pages),
        ]);
        held
    }

    /// The context that holds the model.
    pub fn context(&self) -> &Context {
        &self.context
    }

    /// The parameters of a segment.
    pub fn part(&self, segment: Segment) -> &Part {
        &self.parts[segment as usize]
    }

    /// The pages of a segment, each with its number in the segment, the index of its dispatch, and its
    /// description.
    pub fn pages(&self, segment: Segment) -> impl Iterator<Item = (usize, u32, Page)> + '_ {
        let before: usize = self.parts[..segment as usize].iter().map(|part| part.pages.len()).sum();
        self.part(segment).pages.iter().enumerate().map(move |(k, &page)| (k, (before + k) as u32, page))
    }

    /// Index of the dispatch over the blocks of all Gaussians up to the end of `segment`.
    pub fn blocks_dispatch(&self, segment: Segment) -> u32 {
        self.parts.iter().map(|p| p.pages.len() as u32).sum::<u32>() + segment.index()
    }

    /// Number of Gaussians in a segment, as last known to the host.
    pub fn count_of(&self, segment: Segment) -> u32 {
        self.known[segment as usize]
    }

    /// Total number of Gaussians, as last known to the host.
    pub fn count(&self) -> u32 {
        self.known.iter().sum()
    }

    /// Total number of Gaussians that fit.
    pub fn capacity(&self) -> u32 {
        self.parts.iter().map(Part::capacity).sum()
    }

    /// Whether a segment has room for Gaussians.
    pub fn has(&self, segment: Segment) -> bool {
        self.part(segment).capacity() > 0
    }

    /// Number of Gaussians of the base, with bands and without, as last known to the host.
    pub fn base_count(&self) -> u32 {
        self.count_of(Segment::Base) + self.count_of(Segment::Banded)
    }

    /// Degree that a segment is rendered with if `degree` is asked for.
    pub fn degree_of(&self, segment: Segment, degree: u32) -> u32 {
        color::of(self.part(segment).sh_degree).part(degree)
    }

    /// Whether it has half width, see [`Room::half`].
    pub fn is_half(&self) -> bool {
        self.parts[0].half
    }

    /// Fails if `views` have another origin.
    pub fn check_origin(&self, views: &Views) -> Result<()> {
        // guard: one origin for model and views
        match self.origin == views.origin {
            true => Ok(()),
            false => {
                Err(Error::Usage(format!("the model counts from {}, the views from {}", self.origin, views.origin)))
            }
        }
    }

    /// Downloads the current scene, with the origin of the uploaded one. Waits.
    pub fn download(&self) -> Result<Scene> {
        let counts = self.counts()?;
        let [constants, banded] = [Segment::Base, Segment::Banded].map(|segment| {
            self.part(segment).download(counts[segment as usize] as usize, self.origin - self.scene_origin)
        });
        let ((mut base, _), (banded, _)) = (constants?, banded?);
        if !banded.is_empty() {
            base = base.with_degree(banded.sh_degree);
            base.append(banded);
        }
        let mixed = self.has(Segment::Banded);
        Ok(Scene { base, supplement: self.supplement()?, mixed, origin: self.scene_origin })
    }

    /// Downloads the supplement, in coordinates of the uploaded scene; `None` if it is empty. Waits.
    pub fn supplement(&self) -> Result<Option<Supplement>> {
        match self.counts()?[Segment::Supplement as usize] {
            0 => Ok(None),
            m => {
                let part = self.part(Segment::Supplement);
                let (gaussians, lobes) = part.download(m as usize, self.origin - self.scene_origin)?;
                Ok(Some(Supplement { gaussians, lobes }))
            }
        }
    }
}

fn args_len(pages: usize) -> usize {
    3 * (pages + Segment::ALL.len())
}

impl Part {
    fn reserve(&mut self, context: &Context, segment: Segment, capacity: u32, limit: u32) -> Result<(), GpuError> {
        let mut first = self.capacity();
        let mut pages = self.pages.clone();
        while first < capacity {
            let page = Page { segment: segment.index(), first, capacity: (capacity - first).min(limit) };
            first += page.capacity;
            pages.push(page);
        }
        self.geometry.reserve(context, &pages)?;
        self.sh.reserve(context, &pages)?;
        self.lobes.reserve(context, &pages)?;
        self.pages = pages;
        Ok(())
    }

    /// The buffers of page `k` with the values of these Gaussians.
    fn values(
        &self,
        k: usize,
        &Content { gaussians, ref numbers, lobes }: &Content<'_>,
        origin: DVec3,
    ) -> impl Iterator<Item = (&Quads, Vec<[f32; 4]>)> {
        let page = self.pages[k];
        let capacity = page.capacity as usize;
        let first = numbers.end.min(numbers.start + page.first as usize);
        let count = capacity.min(numbers.end - first);
        let own = |p: usize, place: usize| {
            let value = layout::geometry(gaussians, first + place)[p];
            // guard: model around the origin
            if (MEAN..MEAN + 3).contains(&p) { moved(value, -origin[p - MEAN]) } else { value }
        };
        let geometry = match self.half {
            true => layout::pack_geometry_page(capacity, count, own),
            false => layout::page(GEOMETRY_PLANES, capacity, count, own),
        };
        let sh = layout::page(self.sh.planes(), capacity, count, |p, place| match self.half {
            true => {
                let half = |p| layout::sh(gaussians, first + place, p);
                layout::pack_halves(half(2 * p), half(2 * p + 1))
            }
            false => layout::sh(gaussians, first + place, p),
        });
        let lobes = lobes.map(|lobes| {
            let values = layout::page(LOBE_PLANES, capacity, count, |p, place| layout::lobe(lobes, first + place)[p]);
            (self.lobes.page(k), values)
        });
        let filled = count > 0;
        [(self.geometry.page(k), geometry), (self.sh.page(k), sh)].into_iter().chain(lobes).filter(move |_| filled)
    }

    fn download(&self, count: usize, origin: DVec3) -> Result<(Gaussians, Lobes), GpuError> {
        let (geometry, sh, lobes) = (self.geometry.download()?, self.sh.download()?, self.lobes.download()?);
        let mut gaussians = Gaussians { sh_degree: self.sh_degree, ..Default::default() };
        let mut out = Lobes::default();
        for i in 0..count {
            let own = match self.half {
                true => layout::unpack_geometry(std::array::from_fn(|p| geometry[p][i])),
                false => std::array::from_fn(|p| geometry[p][i]),
            };
            let value = |p: usize| match p {
                // guard: download around the origin
                MEAN..3 => moved(own[p], origin[p - MEAN]),
                _ => own[p],
            };
            let harmonic = |p: usize| match self.half {
                true => layout::halves(sh[p / 2][i])[p % 2],
                false => sh[p][i],
            };
            layout::push(&mut gaussians, value, harmonic);
            if !lobes.is_empty() {
                layout::push_lobe(&mut out, |p| lobes[p][i]);
            }
        }
        Ok((gaussians, out))
    }
}

/// Base and supplement of a scene; without a supplement, `none` stands in.
fn segments_of<'a>(scene: &'a Scene, none: &'a Supplement) -> [Content<'a>; SEGMENTS] {
    let [constants, ..] = Room::counts(scene).map(|count| count as usize);
    let supplement = scene.supplement.as_ref().unwrap_or(none);
    [
        Content { gaussians: &scene.base, numbers: 0..constants, lobes: None },
        Content { gaussians: &scene.base, numbers: constants..scene.base.len(), lobes: None },
        Content {
            gaussians: &supplement.gaussians,
            numbers: 0..supplement.gaussians.len(),
            lobes: Some(&supplement.lobes),
        },
    ]
}

/// The Gaussians of a segment.
struct Content<'a> {
    gaussians: &'a Gaussians,
    numbers: Range<usize>,
    lobes: Option<&'a Lobes>,
}

/// Shifts a coordinate, rounding once; with no shift the bits stay, including −0 and NaN.
fn moved(coordinate: f32, by: f64) -> f32 {
    // guard: bits at the world's origin
    if by == 0.0 { coordinate } else { (f64::from(coordinate) + by) as f32 }
}
