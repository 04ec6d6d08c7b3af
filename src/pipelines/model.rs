//! A scene on the device: base and supplement as segments of pages, and how many Gaussians each has.

use std::sync::atomic::{AtomicBool, Ordering};

use glam::DVec3;

use super::{
    plan::{Held, Plan, Planned},
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
        dispatch_args, gather, recount,
        status::{self, Resource},
        types::Page,
    },
};

/// The two parts of a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Segment {
    /// The Gaussians that every viewer shows.
    Base = population::BASE as isize,
    /// Gaussians with lobes.
    Supplement = population::SUPPLEMENT as isize,
}

impl Segment {
    /// In the order of the Gaussian index.
    pub const ALL: [Segment; population::SEGMENTS as usize] = [Segment::Base, Segment::Supplement];

    /// As kernels are given it.
    pub fn index(self) -> u32 {
        self as u32
    }

    /// What is too small when there is no room in it.
    pub fn resource(self) -> Resource {
        match self {
            Segment::Base => Resource::BaseGaussians,
            Segment::Supplement => Resource::SupplementGaussians,
        }
    }
}

/// A page of planes, four to a quad: see `glsl/shared/model.glsl`.
type Quads = Buffer<[f32; 4]>;

/// Values of a segment's Gaussians, a number of planes for each, page by page.
pub struct Planes {
    name: &'static str,
    planes: usize,
    pages: Vec<Quads>,
}

impl Planes {
    fn new(context: &Context, name: &'static str, planes: usize, pages: &[Page]) -> Result<Self, GpuError> {
        let mut all = Planes { name, planes, pages: Vec::new() };
        all.reserve(context, pages)?;
        Ok(all)
    }

    /// All 0, for the pages that a segment has.
    pub fn zeroed(context: &Context, name: &'static str, planes: usize, pages: &[Page]) -> Result<Self, GpuError> {
        let all = Self::new(context, name, planes, pages)?;
        let mut recorder = context.recorder("zero")?;
        all.record_zero(&mut recorder);
        recorder.submit()?.wait()?;
        Ok(all)
    }

    /// Sets all planes to 0.
    pub fn record_zero(&self, recorder: &mut Recorder) {
        self.pages.iter().for_each(|page| recorder.fill(page, 0));
    }

    /// Makes the pages that are missing; their contents are undefined.
    fn reserve(&mut self, context: &Context, pages: &[Page]) -> Result<(), GpuError> {
        for page in &pages[self.pages.len()..] {
            let len = layout::quads(self.planes) * page.capacity as usize;
            self.pages.push(Buffer::new(context, self.name, len, Location::Device)?);
        }
        Ok(())
    }

    /// Planes of each Gaussian.
    pub fn planes(&self) -> usize {
        self.planes
    }

    /// Of one page: plane p of a place is component p mod 4 of quad ⌊p / 4⌋ × capacity + place.
    pub fn page(&self, page: usize) -> &Quads {
        &self.pages[page]
    }

    /// The values of plane p of all places, page after page. Waits.
    pub fn download(&self) -> Result<Vec<Vec<f32>>, GpuError> {
        let mut all = vec![Vec::new(); self.planes];
        for page in &self.pages {
            let quads = page.download()?;
            let capacity = quads.len() / layout::quads(self.planes).max(1);
            for (p, plane) in all.iter_mut().enumerate() {
                plane.extend(quads[p / 4 * capacity..][..capacity].iter().map(|quad| quad[p % 4]));
            }
        }
        Ok(all)
    }

    /// The values of the first `count` places, plane after plane. Waits.
    pub fn values(&self, count: usize) -> Result<Vec<f32>, GpuError> {
        let mut values = Vec::with_capacity(self.planes * count);
        self.download()?.iter().for_each(|plane| values.extend_from_slice(&plane[..count.min(plane.len())]));
        Ok(values)
    }

    /// Brings back what [`Planes::values`] gave of `count` places. Waits.
    pub fn restore(&self, values: &[f32], count: usize) -> Result<(), GpuError> {
        let mut first = 0;
        for page in self.pages.iter().filter(|_| self.planes > 0) {
            let capacity = page.len() / layout::quads(self.planes);
            let n = capacity.min(count.saturating_sub(first));
            page.upload(0, &layout::page(self.planes, capacity, n, |p, place| values[p * count + first + place]))?;
            first += n;
        }
        Ok(())
    }
}

/// The parameters of one segment.
pub struct Part {
    /// In order; a page begins where the one before ends.
    pub pages: Vec<Page>,
    /// Position, scale, rotation and opacity: planes as `scene::layout` names them.
    pub geometry: Planes,
    /// Colour.
    pub sh: Planes,
    /// None for the base.
    pub lobes: Planes,
    /// Of its harmonics, 0 to 3, or [`BETAS`](color::BETAS).
    pub sh_degree: u32,
    /// Of half width, see [`layout::pack_geometry`] and [`layout::pack_halves`].
    half: bool,
}

impl Part {
    /// Gaussians that it has room for.
    pub fn capacity(&self) -> u32 {
        self.pages.iter().map(|page| page.capacity).sum()
    }
}

/// Room for Gaussians beyond those of a scene.
#[derive(Debug, Clone, Copy, Default)]
pub struct Room {
    /// Gaussians.
    pub base: u32,
    /// Gaussians with lobes.
    pub supplement: u32,
    /// Gaussians of a page at most; `None` for as many as the device binds at once.
    pub page: Option<u32>,
    /// Degree of the harmonics of a supplement that the scene does not have yet; `None` for the base's.
    pub supplement_degree: Option<u32>,
    /// Half width: 128 bytes for a Gaussian of degree 3 instead of 240, harmonics as half floats, rotation and scales in 128 bits. For
    /// rendering alone; nothing can learn.
    pub half: bool,
}

impl Room {
    /// Gaussians that a model of so many in each segment has room for.
    fn capacities(&self, counts: [u32; 2]) -> [u32; 2] {
        // The base has a page even where it is empty: what a pixel without a Gaussian gets is written by its first.
        [counts[0].saturating_add(self.base).max(1), counts[1].saturating_add(self.supplement)]
    }

    /// Planes of geometry, harmonics and lobes.
    fn planes(&self, segment: Segment, sh_degree: u32) -> [usize; 3] {
        let sh = layout::sh_planes(sh_degree);
        let lobes = if segment == Segment::Base { 0 } else { LOBE_PLANES };
        match self.half {
            true => [HALF_GEOMETRY_PLANES, sh.div_ceil(2), lobes],
            false => [GEOMETRY_PLANES, sh, lobes],
        }
    }

    /// Bytes of a Gaussian's geometry, harmonics and lobe.
    pub(crate) fn bytes(&self, segment: Segment, sh_degree: u32) -> [u64; 3] {
        self.planes(segment, sh_degree).map(layout::bytes)
    }

    /// Degrees of the harmonics of each segment.
    fn degrees(&self, scene: &Scene) -> [u32; 2] {
        let base = scene.base.sh_degree;
        let of = |supplement: &Supplement| supplement.gaussians.sh_degree;
        [base, scene.supplement.as_ref().map(of).or(self.supplement_degree).unwrap_or(base)]
    }

    /// Gaussians of a page.
    pub(super) fn page_limit(&self, device: &DeviceInfo, sh_degree: u32) -> u32 {
        // A page's largest buffer holds two moments of every SH plane.
        let quads = 2 * layout::quads(layout::sh_planes(sh_degree).max(GEOMETRY_PLANES));
        let fits = (device.max_storage_bytes / (16 * quads as u64)).min(u64::from(u32::MAX)) as u32;
        self.page.unwrap_or(u32::MAX).min(fits / WORKGROUP * WORKGROUP).max(1)
    }
}

/// Of the planes of each segment.
const NAMES: [[&str; 3]; 2] =
    [["geometry", "sh", "lobes"], ["supplement geometry", "supplement sh", "supplement lobes"]];

/// A scene's segments, and their counts, which are the device's: stages may change them, dispatches follow. What is recorded with a model
/// keeps its buffers (see [`Kept`](crate::gpu::Kept)), so that it may be dropped before that has run.
pub struct Model {
    context: Context,
    parts: [Part; 2],
    /// The greatest of both segments, 0 to 3, or [`BETAS`](color::BETAS).
    pub sh_degree: u32,
    /// Where the device's coordinates begin, in the world: means are relative to it.
    pub origin: DVec3,
    /// Where the means of the scene that it was made of begin, and those of [`Model::download`].
    pub(crate) scene_origin: DVec3,
    page_limit: u32,
    /// Gaussians of each segment, as the host knows them: see [`Model::learn_counts`].
    known: [u32; 2],
    /// Where each segment begins in the Gaussian index, and the number of all Gaussians.
    pub population: Buffer<u32>,
    /// Dispatches over pages, then over the blocks of all Gaussians up to the end of each segment.
    pub population_args: Buffer<u32>,
    segment_counts: Buffer<u32>,
    pages: Buffer<Page>,
    recount: recount::Stage,
    unused: Unused,
}

impl Model {
    /// Copies `scene` to the device in its own coordinates, with room for `spare` more supplementary Gaussians. Waits.
    ///
    /// # Errors
    /// Where the device's memory does not suffice.
    pub fn upload(context: &Context, scene: &Scene, spare: usize) -> Result<Self> {
        let room = Room { supplement: spare as u32, ..Default::default() };
        Self::upload_around(context, scene.origin, scene, room)
    }

    /// What a model of `scene` will hold on a device.
    pub fn plan(device: &DeviceInfo, scene: &Scene, room: Room) -> Plan {
        let degrees = room.degrees(scene);
        let capacities = room.capacities(counts_of(scene));
        let limit = room.page_limit(device, degrees[0].max(degrees[1]));
        let page_count: usize = capacities.iter().map(|capacity| capacity.div_ceil(limit) as usize).sum();
        let planned = |name, elements: u64, element_bytes| Planned { name, elements, element_bytes };
        let mut plan = Plan::default();
        for (segment, capacity) in Segment::ALL.into_iter().zip(capacities) {
            let names = NAMES[segment as usize];
            let rows = names.into_iter().zip(room.bytes(segment, degrees[segment as usize]));
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

    /// In coordinates that count from `origin`, the views' own.
    pub fn upload_around(context: &Context, origin: DVec3, scene: &Scene, room: Room) -> Result<Self> {
        let mut model = Self::allocate(context, origin, scene, room)?;
        for (part, (gaussians, lobes)) in model.parts.iter().zip(segments_of(scene, &Supplement::default())) {
            for k in 0..part.pages.len() {
                for (planes, values) in part.values(k, gaussians, lobes, origin - scene.origin) {
                    planes.upload(0, &values)?;
                }
            }
        }
        model.segment_counts.upload(0, &model.known)?;
        model.upload_pages()?;
        Ok(model)
    }

    /// All that a scene needs on the device, without contents. Submits nothing.
    fn allocate(context: &Context, origin: DVec3, scene: &Scene, room: Room) -> Result<Self> {
        lengths(scene).map_err(|what| Error::Usage(format!("a scene: {what}")))?;
        let degrees = room.degrees(scene);
        let sh_degree = degrees[0].max(degrees[1]);
        let counts = counts_of(scene);
        let page_limit = room.page_limit(context.info(), sh_degree);
        let part = |segment: Segment, capacity: u32| -> Result<Part, GpuError> {
            let sh_degree = degrees[segment as usize];
            let [geometry, sh, lobes] = room.planes(segment, sh_degree);
            let mut part = Part {
                pages: Vec::new(),
                geometry: Planes::new(context, "geometry", geometry, &[])?,
                sh: Planes::new(context, "sh", sh, &[])?,
                lobes: Planes::new(context, "lobes", lobes, &[])?,
                sh_degree,
                half: room.half,
            };
            part.reserve(context, segment, capacity, page_limit)?;
            Ok(part)
        };
        let [base, supplement] = room.capacities(counts);
        if base.checked_add(supplement).is_none() {
            let what = format!("a model with room for {base} and {supplement} Gaussians: more than can be numbered");
            return Err(Error::Usage(what));
        }
        let parts = [part(Segment::Base, base)?, part(Segment::Supplement, supplement)?];
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

    /// The table of pages and what follows from it. Waits.
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

    /// Makes everything follow the segments' counts on the device. With `added` word `added.1` of `added.0` is first added to
    /// the segment's; what the pages have no room for is reported in `status`.
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
            &recount::Buffers {
                added: words,
                pages: &self.pages,
                segment_counts: &self.segment_counts,
                population: &self.population,
                population_args: &self.population_args,
                status,
            },
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

    /// How many Gaussians the device has of each segment. Waits.
    pub fn counts(&self) -> Result<[u32; 2]> {
        let counts = self.segment_counts.download()?;
        Ok([counts[0], counts[1]])
    }

    /// Asks the device how many Gaussians there are. Waits.
    pub fn learn_counts(&mut self) -> Result<[u32; 2]> {
        self.known = self.counts()?;
        Ok(self.known)
    }

    /// Tells the device how many Gaussians a segment has; what new ones are is undefined. Waits.
    ///
    /// # Errors
    /// [`Error::Usage`] where there is no room for them.
    pub fn set_count(&self, segment: Segment, count: u32) -> Result<()> {
        let capacity = self.part(segment).capacity();

        if count > capacity {
            return Err(Error::Usage(format!("there is room for {capacity} {}, not for {count}", segment.resource())));
        }
        self.segment_counts.upload(segment as usize, &[count])?;
        self.recount_now()
    }

    /// Room for at least so many Gaussians in a segment: more pages, beside those that there are. Waits.
    pub fn reserve(&mut self, segment: Segment, capacity: u32) -> Result<()> {
        let limit = self.page_limit;
        self.parts[segment as usize].reserve(&self.context, segment, capacity, limit)?;
        self.upload_pages()
    }

    /// Its buffers: of each segment page by page those with planes, then the counts. They are others after [`Model::reserve`].
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

    /// The context that it was uploaded to.
    pub fn context(&self) -> &Context {
        &self.context
    }

    /// The pages of a segment.
    pub fn part(&self, segment: Segment) -> &Part {
        &self.parts[segment as usize]
    }

    /// The pages of a segment, each with its number in the segment, that of its dispatch, and what it is.
    pub fn pages(&self, segment: Segment) -> impl Iterator<Item = (usize, u32, Page)> + '_ {
        let before = if segment == Segment::Base { 0 } else { self.parts[0].pages.len() };
        self.part(segment).pages.iter().enumerate().map(move |(k, &page)| (k, (before + k) as u32, page))
    }

    /// The dispatch over the blocks of all Gaussians up to the end of `segment`.
    pub fn blocks_dispatch(&self, segment: Segment) -> u32 {
        self.parts.iter().map(|p| p.pages.len() as u32).sum::<u32>() + segment.index()
    }

    /// Gaussians of a segment, as the host knows them.
    pub fn count_of(&self, segment: Segment) -> u32 {
        self.known[segment as usize]
    }

    /// Gaussians in all, as the host knows them.
    pub fn count(&self) -> u32 {
        self.known.iter().sum()
    }

    /// Gaussians that there is room for.
    pub fn capacity(&self) -> u32 {
        self.parts.iter().map(Part::capacity).sum()
    }

    /// Whether there are supplementary Gaussians, as far as the host knows.
    pub fn has_supplement(&self) -> bool {
        self.parts[1].capacity() > 0
    }

    /// What the Gaussians of a segment show where `degree` is asked for.
    pub fn degree_of(&self, segment: Segment, degree: u32) -> u32 {
        color::of(self.part(segment).sh_degree).part(degree)
    }

    /// It is of half width, see [`Room::half`].
    pub fn is_half(&self) -> bool {
        self.parts[0].half
    }

    /// Fails where `views` count from another origin.
    pub fn check_origin(&self, views: &Views) -> Result<()> {
        // guard: one origin for model and views
        match self.origin == views.origin {
            true => Ok(()),
            false => {
                Err(Error::Usage(format!("the model counts from {}, the views from {}", self.origin, views.origin)))
            }
        }
    }

    /// Copies the scene back to the host, as the device has it by now, with the origin of the scene that was uploaded. Waits.
    pub fn download(&self) -> Result<Scene> {
        let counts = self.segment_counts.download()?;
        let (base, _) = self.parts[0].download(counts[0] as usize, self.origin - self.scene_origin)?;
        Ok(Scene { base, supplement: self.supplement()?, origin: self.scene_origin })
    }

    /// The supplement as it is on the device, in coordinates of the scene that was uploaded; `None` where it is empty. Waits.
    pub fn supplement(&self) -> Result<Option<Supplement>> {
        match self.segment_counts.download()?[1] {
            0 => Ok(None),
            m => {
                let (gaussians, lobes) = self.parts[1].download(m as usize, self.origin - self.scene_origin)?;
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

    /// The buffers of page `k` and what they hold of these Gaussians.
    fn values(
        &self,
        k: usize,
        gaussians: &Gaussians,
        lobes: Option<&Lobes>,
        origin: DVec3,
    ) -> impl Iterator<Item = (&Quads, Vec<[f32; 4]>)> {
        let page = self.pages[k];
        let (first, capacity) = (page.first as usize, page.capacity as usize);
        let numbers = first.min(gaussians.len())..gaussians.len().min(first + capacity);
        let count = numbers.len();
        let own = |p: usize, place: usize| {
            let value = layout::geometry(gaussians, first + place)[p];
            // guard: model around the origin
            if (MEAN..MEAN + 3).contains(&p) { moved(value, -origin[p - MEAN]) } else { value }
        };
        let geometry = match self.half {
            true => layout::pack_geometry_page(capacity, count, own),
            false => layout::page(GEOMETRY_PLANES, capacity, count, own),
        };
        let sh = layout::page(self.sh.planes, capacity, count, |p, place| match self.half {
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
        let filled = !numbers.is_empty();
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

/// Gaussians of each segment.
fn counts_of(scene: &Scene) -> [u32; 2] {
    segments_of(scene, &Supplement::default()).map(|(gaussians, _)| gaussians.len() as u32)
}

/// Base and supplement; of a scene without the latter, `none`.
fn segments_of<'a>(scene: &'a Scene, none: &'a Supplement) -> [(&'a Gaussians, Option<&'a Lobes>); 2] {
    let supplement = scene.supplement.as_ref().unwrap_or(none);
    [(&scene.base, None), (&supplement.gaussians, Some(&supplement.lobes))]
}

/// A scene on its way to the device, in the caller's own command buffer: nothing is submitted, nothing waited for. Any thread may
/// prepare it while others draw.
///
/// The command buffer may be of another queue than the frames' if that takes compute; then a semaphore stands between the two. Buffers
/// belong to one queue family: from a queue of another family each of [`Model::held`] is released there, and acquired by the frames' before
/// the first of them. As with a frame, the compute pipeline, descriptor set 0 and push constants are others afterwards. What
/// [`Recorder::finish`](crate::gpu::Recorder::finish) gives is kept until the commands have run.
pub struct Upload {
    model: Model,
    /// Host memory, and what it goes to.
    staged: Vec<(Quads, Quads)>,
    status: Buffer<u32>,
    /// Until then there is nothing on the device, nor a number of Gaussians.
    recorded: AtomicBool,
}

impl Upload {
    /// What an upload of `scene` takes beside its model until it is recorded and its commands have run: host memory, of which a
    /// context's budget knows where device and host share theirs. It is as much again as the pages that are filled;
    /// [`Model::upload_around`], which waits, stages 64 MiB at most.
    pub fn plan(device: &DeviceInfo, scene: &Scene, room: Room) -> Plan {
        let (degrees, counts) = (room.degrees(scene), counts_of(scene));
        let limit = room.page_limit(device, degrees[0].max(degrees[1]));
        let mut plan = Plan::default();
        for (segment, capacity) in Segment::ALL.into_iter().zip(room.capacities(counts)) {
            let s = segment as usize;
            // Whole pages.
            let elements = capacity.min(counts[s].div_ceil(limit).saturating_mul(limit)).into();
            let rows = NAMES[s].into_iter().zip(room.bytes(segment, degrees[s]));
            let rows = rows.map(|(name, element_bytes)| Planned { name, elements, element_bytes });
            plan.0.extend(rows.filter(|row| row.elements * row.element_bytes > 0));
        }
        plan.0.push(Planned { name: "recount status", elements: status::WORDS as u64, element_bytes: 4 });
        plan
    }

    /// Takes memory on both sides for `scene` in coordinates that count from `origin`, and fills the host's: see [`Model::plan`] and
    /// [`Upload::plan`].
    ///
    /// # Errors
    /// Where memory does not suffice.
    pub fn prepare(context: &Context, origin: DVec3, scene: &Scene, room: Room) -> Result<Self> {
        let model = Model::allocate(context, origin, scene, room)?;
        let mut staged = Vec::new();
        for (part, (gaussians, lobes)) in model.parts.iter().zip(segments_of(scene, &Supplement::default())) {
            for k in 0..part.pages.len() {
                for (planes, values) in part.values(k, gaussians, lobes, origin - scene.origin) {
                    let staging = Buffer::new(context, "staging", values.len(), Location::Upload)?;
                    staging.write_mapped(&values);
                    staged.push((staging, planes.clone()));
                }
            }
        }
        let status = Buffer::new(context, "recount status", status::WORDS, Location::Device)?;
        Ok(Upload { model, staged, status, recorded: AtomicBool::new(false) })
    }

    /// Records the copies, and the kernel that makes dispatches of the counts. The command buffer's queue takes compute.
    ///
    /// # Errors
    /// [`Error::Usage`] where the recorder is of another context; nothing is recorded then.
    pub fn record(&self, recorder: &mut Recorder) -> Result<()> {
        if !recorder.context().is_same(&self.model.context) {
            return Err(Error::Usage("a recorder of another context than the upload's".into()));
        }
        for (staging, planes) in &self.staged {
            recorder.copy(staging, 0, planes, 0, staging.len());
        }
        let pages: Vec<Page> = self.model.parts.iter().flat_map(|part| part.pages.iter().copied()).collect();
        recorder.update(&self.model.pages, 0, &pages);
        recorder.update(&self.model.segment_counts, 0, &self.model.known);
        recorder.fill(&self.status, 0);
        self.model.record_recount(recorder, None, &self.status);
        // Whatever comes next on the queue may read it.
        recorder.barrier();
        self.recorded.store(true, Ordering::Release);
        Ok(())
    }

    /// Whether [`Upload::record`] has recorded it.
    pub fn is_recorded(&self) -> bool {
        self.recorded.load(Ordering::Acquire)
    }

    /// The model, once the commands have run, or before: what reads it must only come later on the same queue, or wait. What was
    /// recorded keeps the host memory until then (see [`Kept`](crate::gpu::Kept)).
    ///
    /// # Errors
    /// [`Error::Usage`] where it was not recorded: what a frame then drew would be whatever the memory holds, in whatever number.
    pub fn finish(self) -> Result<Model> {
        match self.is_recorded() {
            true => Ok(self.model),
            false => Err(Error::Usage("an upload that was not recorded has nothing on the device".into())),
        }
    }
}

/// The coordinate seen from elsewhere, rounded once; from the same place it keeps its bits, −0 and NaN too.
fn moved(coordinate: f32, by: f64) -> f32 {
    // guard: bits at the world's origin
    if by == 0.0 { coordinate } else { (f64::from(coordinate) + by) as f32 }
}

/// Moves the Gaussians of a segment to new numbers: to fewer, in another order, some of them several times.
pub struct Rearrange {
    gather: gather::Stage,
    dispatch_args: dispatch_args::Stage,
    args: Buffer<u32>,
    gathered: Quads,
    targets: u32,
}

/// What a segment's Gaussians become.
#[derive(Clone, Copy)]
pub struct Sources<'a> {
    /// By new number the old one; [`NONE`] where all planes become 0.
    pub sources: &'a Buffer<u32>,
    /// Word `index` of `count` is the segment's new count.
    pub count: &'a Buffer<u32>,
    /// See `count`.
    pub index: u32,
}

impl Rearrange {
    /// For up to `targets` Gaussians.
    pub fn new(context: &Context, targets: u32) -> Result<Self, GpuError> {
        Self::with(context, targets, Buffer::new(context, "gathered", targets as usize, Location::Device)?)
    }

    /// The same, which puts what it moves into `gathered` for a moment, a quad for each Gaussian.
    pub(super) fn with(context: &Context, targets: u32, gathered: Quads) -> Result<Self, GpuError> {
        Ok(Rearrange {
            gather: gather::Stage::new(context, &gather::Spec { workgroup_size: context.info().workgroup(WORKGROUP) })?,
            dispatch_args: dispatch_args::Stage::new(context, &dispatch_args::Spec { workgroup_size: 1 })?,
            args: Buffer::new(context, "rearrange_args", 3, Location::Device)?,
            gathered,
            targets,
        })
    }

    /// Gives the Gaussians of `segment` new numbers, and their planes in `others` (moments) with them. What does not fit is
    /// reported in `status`, and the count kept within the room that there is.
    pub fn record(
        &self,
        recorder: &mut Recorder,
        model: &Model,
        segment: Segment,
        from: Sources<'_>,
        others: &[&Planes],
        status: &Buffer<u32>,
    ) {
        let part = model.part(segment);
        let Sources { sources, count: words, index: count_index } = from;
        self.dispatch_args.record(
            recorder,
            &dispatch_args::Buffers { count: words, dispatch_args: &self.args, status },
            &dispatch_args::Push {
                count_index,
                capacity: self.targets.min(part.capacity()),
                items_per_group: self.gather.workgroup_size(),
                args_index: 0,
                resource_index: segment.resource().index(),
            },
            1,
        );
        for planes in [&part.geometry, &part.sh, &part.lobes].into_iter().chain(others.iter().copied()) {
            for quad in 0..layout::quads(planes.planes) {
                for (k, page) in part.pages.iter().enumerate() {
                    let push = gather::Push {
                        count_index,
                        targets: self.targets,
                        page_first: page.first,
                        stride: page.capacity,
                        quad: quad as u32,
                    };
                    let buffers =
                        gather::Buffers { count: words, sources, from: planes.page(k), gathered: &self.gathered };
                    self.gather.record_indirect(recorder, &buffers, &push, &self.args, 0);
                }
                for (k, page) in part.pages.iter().enumerate().filter(|(_, page)| page.first < self.targets) {
                    let n = page.capacity.min(self.targets - page.first) as usize;
                    let to = quad * page.capacity as usize;
                    recorder.copy(&self.gathered, page.first as usize, planes.page(k), to, n);
                }
            }
        }
        recorder.copy(words, count_index as usize, &model.segment_counts, segment as usize, 1);
        model.record_recount(recorder, None, status);
    }
}
