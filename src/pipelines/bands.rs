//! Finds the Gaussians that gain by bands of harmonics, or would lose without theirs (method, section 8).
//!
//! For each page of Gaussians: (render → two passes of (density_image → blend_backward of scores → bands_look)) for each view, then
//! bands_fit for each degree. A gain counts views that were left out of the fit, so that of noise is not above 0 in the mean.

use super::{
    loss::{Batch, LossOptions, Photometric, Tiles},
    model::{Model, Room, Segment},
    plan::bind,
    raster::{Grid, Raster},
    render::{Needs, RenderOptions, Renderer, Show},
    session::Session,
    steps::{Looped, Steps},
    views::Views,
};
use crate::{
    data::band_bytes,
    error::{Error, Result},
    gpu::{Buffer, Context, GpuError, Location, Recorder},
    scene::{Gaussians, Scene, color, layout},
    stages::{
        WORKGROUP, bands_fit, bands_look,
        constants::density::{BLUE, RED_GREEN},
        density_image,
        ssim::tiles_per_frame,
        status::Resource,
        types::Page,
    },
};

/// Degrees that bands may have.
pub const DEGREES: [u32; 3] = [1, 2, 3];
/// Maximum bytes of the looks of a page.
const LOOKS_BYTES: u64 = 256 << 20;
/// Views per submission.
const STEPS_PER_SUBMISSION: u32 = 8;

/// A Gaussian that gains by bands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gain {
    /// Its number in the base.
    pub number: u32,
    /// Expected fall of the squared error, summed over pixels and channels of all views.
    pub gain: f32,
}

/// Gaussians to give bands of one degree.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Promotion {
    /// Degree of the bands; 0: none gain.
    pub degree: u32,
    /// In order of falling gain.
    pub gains: Vec<Gain>,
}

impl Promotion {
    /// Expected fall of the squared error.
    pub fn gain(&self) -> f64 {
        self.gains.iter().map(|found| f64::from(found.gain)).sum()
    }

    /// The numbers of `count` Gaussians in another order: first those without bands, then those with, each in their order.
    pub fn order(&self, count: usize) -> Vec<usize> {
        let mut chosen = vec![false; count];
        self.gains.iter().for_each(|found| chosen[found.number as usize] = true);
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by_key(|&i| chosen[i]);
        order
    }

    /// Leaves those with the greatest gains, in at most `most` bytes.
    pub(super) fn limit(&mut self, most: u64) {
        let fits = most.checked_div(band_bytes(self.degree)).unwrap_or(0);
        self.gains.truncate(usize::try_from(fits).unwrap_or(usize::MAX));
    }

    /// Size of the bands in a file.
    pub fn bytes(&self) -> u64 {
        self.gains.len() as u64 * band_bytes(self.degree)
    }
}

/// Gains and coefficients of one degree.
#[derive(Default)]
struct Fitted {
    /// Gaussians whose gain is above 0, by number.
    gains: Vec<Gain>,
    /// Their coefficients.
    fits: Vec<[f32; 3]>,
}

/// A running search.
pub struct Bands {
    rig: Rig,
    model: Model,
    renderer: Renderer,
    steps: Steps,
    /// The first view.
    first: u32,
    page: usize,
    fitted: [Fitted; DEGREES.len()],
}

/// Pipelines and buffers.
pub(crate) struct Rig {
    background: [f32; 3],
    /// One for each pass.
    image: [density_image::Stage; 2],
    look: [bands_look::Stage; 2],
    fit: [bands_fit::Stage; DEGREES.len()],
    /// By view, then by place.
    pub(crate) looks: Buffer<[f32; 4]>,
    /// By degree: gains by place, and coefficients by coefficient, then by place.
    pub(crate) gains: [Buffer<f32>; DEGREES.len()],
    pub(crate) fits: [Buffer<[f32; 3]>; DEGREES.len()],
}

impl Rig {
    /// For pages of `places` Gaussians.
    pub(crate) fn new(session: &Session, views: u32, places: u32) -> Result<Self, GpuError> {
        let Session { context, policy, background, .. } = session;
        let workgroup_size = context.info().workgroup(WORKGROUP);
        let image = |terms| density_image::Stage::new(context, &density_image::Spec { workgroup_size, terms });
        let look = |second| {
            let spec = bands_look::Spec { workgroup_size, second, packed_records: policy.packed };
            bands_look::Stage::new(context, &spec)
        };
        let fit = |sh_degree| bands_fit::Stage::new(context, &bands_fit::Spec { workgroup_size, sh_degree });
        let [first, second, third] = DEGREES;
        let device = |len: usize| Buffer::new(context, "band gains", len, Location::Device);
        let fits = |degree| {
            let len = places as usize * layout::coefficients(degree);
            Buffer::new(context, "band fits", len, Location::Device)
        };
        Ok(Rig {
            background: *background,
            image: [image(RED_GREEN)?, image(BLUE)?],
            look: [look(false)?, look(true)?],
            fit: [fit(first)?, fit(second)?, fit(third)?],
            looks: Buffer::new(context, "looks", views as usize * places as usize, Location::Device)?,
            gains: [device(places as usize)?, device(places as usize)?, device(places as usize)?],
            fits: [fits(first)?, fits(second)?, fits(third)?],
        })
    }

    /// Records what a rendered view asks of the Gaussians of page `k`, as look `number`. `targets` is the view's photograph.
    pub(crate) fn record_look(
        &self,
        recorder: &mut Recorder,
        (model, views, raster): (&Model, &Views, &Raster),
        (k, view, number): (usize, u32, u32),
        (grid, targets): (&Grid, &Buffer<u32>),
        status: &Buffer<u32>,
    ) {
        let Some((_, dispatch, page)) = model.pages(Segment::Base).nth(k) else { return };
        for (image, look) in self.image.iter().zip(&self.look) {
            image.record(
                recorder,
                &bind!(density_image { targets; views => frames; raster.buffers => image, image_grad; }),
                &density_image::Push { frame: view },
                views.cameras[view as usize].pixels(),
            );
            raster.record_scores(recorder, grid, &views.frames, &model.population);
            look.record_indirect(
                recorder,
                &bind!(bands_look {
                    status;
                    model => population;
                    raster.buffers => tile_counts, first_slot, splat_colors;
                    raster.records => record_centres, record_shapes, record_colors, record_words;
                    self => looks;
                }),
                &bands_look::Push {
                    segment: page.segment,
                    page_first: page.first,
                    stride: page.capacity,
                    by_gaussian: raster.by_gaussian().into(),
                    view: number,
                },
                &model.population_args,
                dispatch,
            );
        }
    }

    /// Records the fits of page `k` to its looks, one for each photograph. Its smaller copies have the same place.
    pub(crate) fn record_fits(&self, recorder: &mut Recorder, model: &Model, views: &Views, k: usize) {
        let Some((_, dispatch, page)) = model.pages(Segment::Base).nth(k) else { return };
        for (fit, (gains, fits)) in self.fit.iter().zip(self.gains.iter().zip(&self.fits)) {
            fit.record_indirect(
                recorder,
                &bands_fit::Buffers {
                    population: &model.population,
                    views: &views.views,
                    geometry: model.part(Segment::Base).geometry.page(k),
                    looks: &self.looks,
                    gains,
                    fits,
                },
                &bands_fit::Push {
                    segment: page.segment,
                    page_first: page.first,
                    stride: page.capacity,
                    view_count: views.photos,
                },
                &model.population_args,
                dispatch,
            );
        }
    }
}

impl Bands {
    /// Searches the base of `scene` in all photographs of `views` with their sides halved `halvings` times. For a Gaussian that has bands,
    /// the gain is what it would lose without them. Waits.
    ///
    /// # Errors
    /// [`Error::Usage`] if the scene is empty or its colors are not harmonics, or there are no views; otherwise an error of the device.
    pub fn new(session: &Session, scene: &Scene, views: &Views, halvings: u32) -> Result<Self> {
        let context = &session.context;
        let count = views.photos;
        if scene.base.is_empty() || count == 0 {
            return Err(Error::Usage("no bands to find: no Gaussians, or no views".into()));
        }
        let colors = color::of(scene.base.sh_degree);
        if colors.harmonics.is_none() {
            return Err(Error::Usage(format!("bands are found for harmonics, and the base has {}", colors.name)));
        }
        let places = places_per_page(context, count);
        let base = Scene { base: scene.base.clone(), origin: scene.origin, ..Scene::default() };
        let room = Room { page: Some(places), ..Room::default() };
        let model = Model::upload_around(context, views.origin, &base, room)?;
        let render = RenderOptions { backward: true, policy: session.policy, ..Default::default() };
        let mut renderer = Renderer::new(context, Needs::of(&model), views, render)?;
        renderer.raster.make_scores()?;
        let largest = model.part(Segment::Base).pages.iter().map(|page| page.capacity).max().unwrap_or(1);
        let mut bands = Bands {
            rig: Rig::new(session, count, largest)?,
            model,
            renderer,
            steps: Steps::new(context, STEPS_PER_SUBMISSION.min(views.views_at_once()))?,
            first: count * halvings,
            page: 0,
            fitted: Default::default(),
        };
        bands.steps.start(count + 1, false)?;
        Ok(bands)
    }

    /// Runs until some steps are done; returns their number and that of all, or `None` at the end.
    pub fn advance(&mut self, views: &Views) -> Result<Option<[u32; 2]>> {
        let (each, pages) = (views.photos + 1, self.model.part(Segment::Base).pages.len());
        loop {
            if self.page == pages {
                return Ok(None);
            }
            let before = self.page as u32 * each;
            let Bands { rig, model, renderer, page, first, .. } = self;
            let mut looking = Looking { rig, model, renderer, views, first: *first, page: *page };
            if let Some(done) = self.steps.advance(&mut looking)? {
                return Ok(Some([before + done, pages as u32 * each]));
            }
            self.take()?;
            self.page += 1;
            if self.page < pages {
                self.steps.start(each, false)?;
            }
        }
    }

    /// Reads the gains of the page that was fitted.
    fn take(&mut self) -> Result<()> {
        let Page { first, capacity, .. } = self.model.part(Segment::Base).pages[self.page];
        let here = capacity.min(self.model.count_of(Segment::Base) - first) as usize;
        for (d, degree) in DEGREES.into_iter().enumerate() {
            let (gains, fits) = (self.rig.gains[d].download_range(0, here)?, self.rig.fits[d].download()?);
            for (place, gain) in gains.into_iter().enumerate().filter(|(_, gain)| *gain > 0.0) {
                self.fitted[d].gains.push(Gain { number: first + place as u32, gain });
                let fit = (0..layout::coefficients(degree)).map(|k| fits[k * capacity as usize + place]);
                self.fitted[d].fits.extend(fit);
            }
        }
        Ok(())
    }

    /// [`squared_error`] of the base that is searched.
    pub fn squared_error(&mut self, session: &Session, views: &Views) -> Result<f64> {
        squared_error(session, &mut self.renderer, &self.model, views, self.first / views.photos)
    }

    /// The Gaussians to promote, for at most `most` bytes. Each gains at least `least` per byte. Of all degrees it is the one that gains
    /// most, less the price of its bytes.
    pub fn choose(&self, most: u64, least: f64) -> Promotion {
        let of = |degree| self.choose_of(degree, most, least);
        let all = DEGREES.into_iter().map(of).filter(|promotion| !promotion.gains.is_empty());
        let net = |promotion: &Promotion| promotion.gain() - least * promotion.bytes() as f64;
        all.max_by(|a, b| net(a).total_cmp(&net(b))).unwrap_or_default()
    }

    /// [`Bands::choose`] for one degree, 1 to 3; for another nobody is promoted.
    pub fn choose_of(&self, degree: u32, most: u64, least: f64) -> Promotion {
        let Some(d) = DEGREES.iter().position(|&known| known == degree) else { return Promotion::default() };
        let each = band_bytes(degree);
        let mut gains = self.fitted[d].gains.clone();
        gains.retain(|found| f64::from(found.gain) > least * each as f64);
        gains.sort_by(|a, b| b.gain.total_cmp(&a.gain).then(a.number.cmp(&b.number)));
        let mut promotion = Promotion { degree, gains };
        promotion.limit(most);
        promotion
    }

    /// `base` with the bands of a promotion, see [`Promotion::order`].
    pub fn promoted(&self, base: &Gaussians, promotion: &Promotion) -> Gaussians {
        let Some(d) = DEGREES.iter().position(|&degree| degree == promotion.degree) else { return base.clone() };
        let k = layout::coefficients(promotion.degree);
        let mut fit_of = vec![None; base.len()];
        for (at, found) in self.fitted[d].gains.iter().enumerate() {
            fit_of[found.number as usize] = Some(at);
        }
        let mut all = base.clone().with_degree(promotion.degree);
        for i in promotion.gains.iter().map(|found| found.number as usize) {
            if let Some(at) = fit_of[i] {
                all.sh[i * k..][..k].copy_from_slice(&self.fitted[d].fits[at * k..][..k]);
            }
        }
        all.reordered(&promotion.order(base.len()))
    }
}

/// Gaussians whose looks fit the device's bindings and [`LOOKS_BYTES`].
fn places_per_page(context: &Context, views: u32) -> u32 {
    let fits = context.info().max_storage_bytes.min(LOOKS_BYTES) / (16 * u64::from(views));
    (u32::try_from(fits).unwrap_or(u32::MAX) / WORKGROUP * WORKGROUP).max(WORKGROUP)
}

/// Squared error of `model`, summed over pixels and channels of all photographs of `views` with their sides halved `halvings` times. Waits.
///
/// # Errors
/// An error of the device.
pub fn squared_error(
    session: &Session,
    renderer: &mut Renderer,
    model: &Model,
    views: &Views,
    halvings: u32,
) -> Result<f64> {
    let context = &session.context;
    let first = views.photos * halvings;
    let tiles = tiles_per_frame(&views.frame_list);
    let loss = Photometric::new(context, &LossOptions { tiles, losses: views.photos, ..Default::default() })?;
    let mut steps = Steps::new(context, STEPS_PER_SUBMISSION.min(views.views_at_once()))?;
    let mut judging = Judging { loss: &loss, renderer, model, views, background: session.background, first };
    steps.run(views.photos, false, &mut judging, |_| ())?;
    let pixels = views.cameras[first as usize..].iter().map(|camera| f64::from(camera.pixels()));
    Ok(3.0
        * loss.losses.mapped().iter().zip(pixels).map(|(loss, pixels)| f64::from(loss.squared) * pixels).sum::<f64>())
}

struct Judging<'a> {
    loss: &'a Photometric,
    renderer: &'a mut Renderer,
    model: &'a Model,
    views: &'a Views,
    background: [f32; 3],
    first: u32,
}

impl Looped for Judging<'_> {
    fn record(&mut self, recorder: &mut Recorder, step: u32, status: &Buffer<u32>) -> Result<()> {
        let Judging { loss, renderer, model, views, background, first } = self;
        let view = *first + step;
        let targets = views.record_photograph(recorder, view, None)?;
        renderer.record(recorder, model, views, view, &Show::all(model, *background), status)?;
        let batch = Batch {
            frames: &views.frames,
            frame_first: view,
            frame_count: 1,
            tiles_per_frame: tiles_per_frame(&views.frame_list[view as usize..=view as usize]),
            image: &renderer.raster.buffers.image,
            targets,
        };
        loss.record_forward(recorder, &batch, Tiles::All, None);
        loss.record_sum(recorder, &batch, step);
        Ok(())
    }

    fn grow(&mut self, _: Resource, needed: u32) -> Result<()> {
        Ok(self.renderer.raster.grow(needed)?)
    }
}

struct Looking<'a> {
    rig: &'a Rig,
    model: &'a Model,
    renderer: &'a mut Renderer,
    views: &'a Views,
    first: u32,
    page: usize,
}

impl Looped for Looking<'_> {
    fn record(&mut self, recorder: &mut Recorder, step: u32, status: &Buffer<u32>) -> Result<()> {
        let Looking { rig, model, renderer, views, first, page } = self;
        if step == views.photos {
            rig.record_fits(recorder, model, views, *page);
            return Ok(());
        }
        let (show, view) = (Show::all(model, rig.background), *first + step);
        let targets = views.record_photograph(recorder, view, None)?;
        let grid = renderer.record(recorder, model, views, view, &show, status)?;
        rig.record_look(recorder, (model, views, &renderer.raster), (*page, view, step), (&grid, targets), status);
        Ok(())
    }

    fn grow(&mut self, _: Resource, needed: u32) -> Result<()> {
        Ok(self.renderer.raster.grow(needed)?)
    }
}
