//! Verifies the model's own kernels: counts of Gaussians, and their rearrangement.

use glam::DVec3;

use super::{Bench, sort::noise};
use crate::{
    error::Result,
    gpu::{Buffer, Location},
    pipelines::model::{Model, Planes, Rearrange, Room, Segment, Sources},
    reference::{NONE, random_scene},
    scene::layout,
    stages::status,
};

pub(super) fn cases(bench: &Bench<'_>, quick: bool) -> Result<()> {
    let (base, supplement) = if quick { (900, 300) } else { (300_000, 100_000) };
    let scene = random_scene(31, base, supplement, 1);
    // Three pages of the base and two of the supplement; the last page of each has spare room.
    let room = Room { base: 70, supplement: base as u32 / 7, page: Some(base as u32 / 3 + 7), ..Room::default() };
    let model = Model::upload_around(&bench.shadowed, DVec3::ZERO, &scene, room)?;
    rearranged(bench, &model)?;
    // Append supplementary Gaussians that fit, then too many.
    let added = Buffer::from_slice(&bench.shadowed, "added", &[0u32, 5, model.capacity()])?;
    let status = Buffer::<u32>::zeroed(&bench.shadowed, "status", status::WORDS)?;
    for which in [1, 2] {
        let recount = Some((Segment::Supplement, &added, which));
        bench.run(|recorder| model.record_recount(recorder, recount, &status))?;
    }
    Ok(())
}

/// Rearranges the base: other order, some Gaussians twice, some left out, some new. The supplement stays.
fn rearranged(bench: &Bench<'_>, model: &Model) -> Result<()> {
    let context = &bench.shadowed;
    let old = model.count_of(Segment::Base);
    let new = model.part(Segment::Base).capacity() - 9;
    let sources: Vec<u32> = (0..new).map(|t| if t % 50 == 13 { NONE } else { noise(t) % old }).collect();
    let pages = &model.part(Segment::Base).pages;
    let moments = Planes::zeroed(context, "moments", 3, Location::Device, pages)?;
    for (k, page) in pages.iter().enumerate() {
        let capacity = page.capacity as usize;
        let value = |p, place| (page.first as usize + p * capacity + place) as f32;
        moments.page(k).upload(0, &layout::page(3, capacity, capacity, value))?;
    }
    let sources = Buffer::from_slice(context, "sources", &sources)?;
    let count = Buffer::from_slice(context, "count", &[new])?;
    let from = Sources { sources: &sources, count: &count, index: 0 };
    let status = Buffer::<u32>::zeroed(context, "status", status::WORDS)?;
    let stage = Rearrange::new(context, new)?;
    bench.run(|recorder| stage.record(recorder, model, Segment::Base, from, &[&moments], &status))
}
