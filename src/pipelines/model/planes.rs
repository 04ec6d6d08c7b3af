//! Planes of values by Gaussian: parameters, moments, scores.

use crate::{
    gpu::{Buffer, Context, GpuError, Location, Recorder},
    scene::layout,
    stages::types::Page,
};

/// A page of planes, four to a quad: see `glsl/shared/model.glsl`.
pub(super) type Quads = Buffer<[f32; 4]>;

/// Values of a segment's Gaussians: a number of planes, page by page.
pub struct Planes {
    name: &'static str,
    planes: usize,
    location: Location,
    pages: Vec<Quads>,
}

impl Planes {
    /// Planes without pages.
    pub(super) fn none(name: &'static str, planes: usize, location: Location) -> Self {
        Planes { name, planes, location, pages: Vec::new() }
    }

    /// Planes full of 0, for the pages of a segment.
    pub fn zeroed(
        context: &Context,
        name: &'static str,
        planes: usize,
        location: Location,
        pages: &[Page],
    ) -> Result<Self, GpuError> {
        let mut all = Self::none(name, planes, location);
        all.reserve(context, pages)?;
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
    pub(super) fn reserve(&mut self, context: &Context, pages: &[Page]) -> Result<(), GpuError> {
        for page in &pages[self.pages.len()..] {
            let len = layout::quads(self.planes) * page.capacity as usize;
            self.pages.push(Buffer::new(context, self.name, len, self.location)?);
        }
        Ok(())
    }

    /// Number of planes per Gaussian.
    pub fn planes(&self) -> usize {
        self.planes
    }

    /// The memory in which they lie.
    pub fn location(&self) -> Location {
        self.location
    }

    /// Buffer of one page: plane p of a place is component p mod 4 of quad ⌊p / 4⌋ × capacity + place.
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

    /// Uploads values of `count` places that [`Planes::values`] returned; missing planes become 0. Waits.
    pub fn restore(&self, values: &[f32], count: usize) -> Result<(), GpuError> {
        let mut first = 0;
        for page in self.pages.iter().filter(|_| self.planes > 0) {
            let capacity = page.len() / layout::quads(self.planes);
            let n = capacity.min(count.saturating_sub(first));
            page.upload(
                0,
                &layout::page(self.planes, capacity, n, |p, place| {
                    values.get(p * count + first + place).copied().unwrap_or(0.0)
                }),
            )?;
            first += n;
        }
        Ok(())
    }
}
