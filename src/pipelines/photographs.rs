//! Storage of photographs: device memory, or host memory or a file, from which each step copies its photograph to the device.

use std::{
    fs::File,
    io::{self, Read, Seek, SeekFrom, Write},
    path::PathBuf,
    sync::{Arc, Mutex, MutexGuard},
};

use crate::{
    error::{Error, Result},
    gpu::{Buffer, Context, GpuError, Location, Recorder},
    scene::Camera,
    stages::{WORKGROUP, composite},
};

/// Maximum bytes that a submission copies from a file: 16 photographs of two megapixels, training's default maximum. Two submissions are in
/// flight.
const STAGED: u64 = 128 << 20;

/// Where photographs lie.
pub enum Storage {
    /// Device memory.
    Device,
    /// Host memory that the device copies from.
    Host,
    /// An empty file, and its folder for errors.
    File(File, PathBuf),
}

/// Photographs by view, as 8-bit RGBA.
pub(super) struct Photographs {
    source: Source,
    places: Vec<Place>,
    compositor: Option<Compositor>,
}

/// Composites transparent photographs over a background that each step chooses.
struct Compositor {
    stage: composite::Stage,
    /// The background that the stored colors lie over, sRGB bytes.
    background: [u8; 3],
    /// Device memory for the photograph of a step.
    targets: Buffer<u32>,
}

/// `pages` can be bound by the device; no photograph spans two. `slot` is device memory for the photograph of the view that a step works on.
enum Source {
    Device { pages: Vec<Buffer<u32>> },
    Host { pages: Vec<Buffer<u32>>, slot: Buffer<u32> },
    File { file: Mutex<PhotoFile>, slot: Buffer<u32> },
}

/// Position of a photograph, in pixels. A file is one page.
#[derive(Clone, Copy)]
struct Place {
    page: usize,
    first: usize,
    pixels: usize,
}

struct PhotoFile {
    file: File,
    folder: PathBuf,
    words: Vec<u32>,
    /// Host memory, for a photograph each: as many as submissions in flight use.
    staging: Vec<Buffer<u32>>,
}

impl Photographs {
    /// Makes room for photographs of these sizes; for placeholders without `storage`. If they are transparent, their colors are stored over
    /// `background`.
    pub fn new(
        context: &Context,
        cameras: &[Camera],
        storage: Option<Storage>,
        background: Option<[f32; 3]>,
    ) -> Result<Self> {
        let most = match storage {
            Some(Storage::File(..)) => usize::MAX,
            _ => (context.info().max_storage_bytes / size_of::<u32>() as u64).min(u64::from(u32::MAX)) as usize,
        };
        let (mut pages, mut places) = (vec![0usize], Vec::with_capacity(cameras.len()));
        for camera in cameras {
            let pixels = camera.pixels() as usize;
            if pages[pages.len() - 1] + pixels > most && pages[pages.len() - 1] > 0 {
                pages.push(0);
            }
            let page = pages.len() - 1;
            places.push(Place { page, first: pages[page], pixels });
            pages[page] += pixels;
        }
        let buffer = |pixels, location| Buffer::new(context, "targets", pixels, location);
        if storage.is_none() {
            // Placeholders.
            pages.fill(1);
        }
        let made = |location| pages.iter().map(|&pixels| buffer(pixels, location)).collect::<Result<_, GpuError>>();
        let slot = || buffer(places.iter().map(|place| place.pixels).max().unwrap_or(0), Location::Device);
        let compositor = |background: [f32; 3]| {
            let spec = composite::Spec { workgroup_size: context.info().workgroup(WORKGROUP) };
            let stage = composite::Stage::new(context, &spec)?;
            Ok::<_, GpuError>(Compositor {
                stage,
                background: background.map(|value| (255.0 * value).round() as u8),
                targets: slot()?,
            })
        };
        let compositor = background.map(compositor).transpose()?;
        let source = match storage {
            None | Some(Storage::Device) => Source::Device { pages: made(Location::Device)? },
            Some(Storage::Host) => Source::Host { pages: made(Location::Host)?, slot: slot()? },
            Some(Storage::File(file, folder)) => {
                let file = PhotoFile { file, folder, words: Vec::new(), staging: Vec::new() };
                Source::File { file: Mutex::new(file), slot: slot()? }
            }
        };
        Ok(Photographs { source, places, compositor })
    }

    /// First pixel of the photograph of view `v` in the buffer of [`Photographs::record`].
    pub fn first(&self, v: usize) -> u32 {
        if self.on_device(v).is_some() { self.places[v].first as u32 } else { 0 }
    }

    /// Number of views from `v` on, itself included, whose photographs lie in the same page.
    pub fn same_page(&self, v: usize) -> usize {
        self.places[v..].iter().take_while(|place| place.page == self.places[v].page).count()
    }

    /// Maximum number of views per submission.
    pub fn views_at_once(&self) -> u32 {
        match &self.source {
            Source::File { slot, .. } => (STAGED / slot.raw().bytes_len()).clamp(1, u32::MAX.into()) as u32,
            _ => u32::MAX,
        }
    }

    /// The page of the photograph of view `v`, if it lies in device memory as steps need it.
    pub fn on_device(&self, v: usize) -> Option<&Buffer<u32>> {
        match &self.source {
            Source::Device { pages } if self.compositor.is_none() => Some(&pages[self.places[v].page]),
            _ => None,
        }
    }

    /// Whether the photographs are transparent.
    pub fn are_transparent(&self) -> bool {
        self.compositor.is_some()
    }

    /// Ends compositing; returns whether there was any.
    pub fn drop_opacities(&mut self) -> bool {
        self.compositor.take().is_some()
    }

    /// Stores a photograph. Waits.
    pub fn write(&self, v: usize, packed: &[u32]) -> Result<()> {
        let Place { page, first, pixels } = self.places[v];
        match &self.source {
            Source::Device { pages } | Source::Host { pages, .. } => Ok(pages[page].upload(first, packed)?),
            Source::File { file, .. } => lock(file).write(first, &packed[..pixels.min(packed.len())]),
        }
    }

    /// Reads a photograph back. Waits.
    pub fn read(&self, v: usize) -> Result<Vec<u32>> {
        let Place { page, first, pixels } = self.places[v];
        match &self.source {
            Source::Device { pages } | Source::Host { pages, .. } => Ok(pages[page].download_range(first, pixels)?),
            Source::File { file, .. } => Ok(lock(file).read(first, pixels)?.to_vec()),
        }
    }

    /// The buffer from which the next commands can read the photograph of view `v`; if it is transparent, over `background` or else its own.
    /// If it lies elsewhere, records a copy, which replaces the photograph of the view before.
    pub fn record(&self, recorder: &mut Recorder, v: usize, background: Option<[u8; 3]>) -> Result<&Buffer<u32>> {
        let stored = self.record_stored(recorder, v)?;
        let Some(Compositor { stage, background: own, targets }) = &self.compositor else { return Ok(stored) };
        let first = if matches!(self.source, Source::Device { .. }) { self.places[v].first as u32 } else { 0 };
        let change = background.map_or([0; 3], |new| std::array::from_fn(|c| i32::from(new[c]) - i32::from(own[c])));
        let pixels = self.places[v].pixels as u32;
        let buffers = composite::Buffers { photographs: stored, targets };
        stage.record(recorder, &buffers, &composite::Push { first, pixels, change }, pixels);
        Ok(targets)
    }

    /// The buffer of the photograph of view `v` as it is stored, after a copy if it lies elsewhere.
    fn record_stored(&self, recorder: &mut Recorder, v: usize) -> Result<&Buffer<u32>> {
        let Place { page, first, pixels } = self.places[v];
        match &self.source {
            Source::Device { pages } => Ok(&pages[page]),
            Source::Host { pages, slot } => {
                recorder.copy(&pages[page], first, slot, 0, pixels);
                Ok(slot)
            }
            Source::File { file, slot } => {
                let mut file = lock(file);
                recorder.copy(file.stage(recorder.context(), first, pixels, slot.len())?, 0, slot, 0, pixels);
                Ok(slot)
            }
        }
    }
}

impl PhotoFile {
    fn go_to(&mut self, first: usize) -> io::Result<()> {
        self.file.seek(SeekFrom::Start(first as u64 * size_of::<u32>() as u64)).map(drop)
    }

    fn write(&mut self, first: usize, words: &[u32]) -> Result<()> {
        let written = self.go_to(first).and_then(|()| self.file.write_all(bytemuck::cast_slice(words)));
        written.map_err(|error| Error::io(&self.folder, error))
    }

    fn read(&mut self, first: usize, pixels: usize) -> Result<&[u32]> {
        self.words.resize(pixels, 0);
        let read = self.go_to(first).and_then(|()| self.file.read_exact(bytemuck::cast_slice_mut(&mut self.words)));
        read.map_err(|error| Error::io(&self.folder, error))?;
        Ok(&self.words)
    }

    /// Reads a photograph into host memory that no submission uses. `most` are the pixels of the largest.
    fn stage(&mut self, context: &Context, first: usize, pixels: usize, most: usize) -> Result<&Buffer<u32>> {
        self.read(first, pixels)?;
        // Recorders and submissions share the buffers that they use until the device is done with them.
        let i = match self.staging.iter().position(|buffer| Arc::strong_count(buffer.raw()) == 1) {
            Some(free) => free,
            None => {
                self.staging.push(Buffer::new(context, "photo_staging", most, Location::Host)?);
                self.staging.len() - 1
            }
        };
        self.staging[i].write_mapped(&self.words);
        Ok(&self.staging[i])
    }
}

fn lock(file: &Mutex<PhotoFile>) -> MutexGuard<'_, PhotoFile> {
    file.lock().unwrap_or_else(|e| e.into_inner())
}
