//! The model's own kernels: how many Gaussians there are, and moving them to other numbers.

use glam::DVec3;

use super::{Bench, sort::noise};
use crate::{
    error::Result,
    gpu::Buffer,
    pipelines::model::{Model, Planes, Rearrange, Room, Segment, Sources},
    reference::{NONE, gather, random_scene, recount},
    scene::layout,
    stages::{
        WORKGROUP,
        blocks::items_per_group,
        status::{self, Status},
        types::Page,
    },
};

pub(super) fn cases(bench: &mut Bench<'_>, quick: bool) -> Result<()> {
    let (base, supplement) = if quick { (900, 300) } else { (300_000, 100_000) };
    let scene = random_scene(31, base, supplement, 1);
    // Three pages of the base and two of the supplement; the last of each has room.
    let room = Room { base: 70, supplement: base as u32 / 7, page: Some(base as u32 / 3 + 7), ..Room::default() };
    let mut model = Model::upload_around(bench.context, DVec3::ZERO, &scene, room)?;
    rearranged(bench, &mut model)?;
    recounted(bench, &mut model)
}

/// Supplementary Gaussians that fit, and more that do not.
fn recounted(bench: &mut Bench<'_>, model: &mut Model) -> Result<()> {
    let context = bench.context;
    let added = Buffer::from_slice(context, "added", &[0u32, 5, model.capacity()])?;
    let status = Buffer::<u32>::zeroed(context, "status", status::WORDS)?;
    let pages: Vec<Page> = Segment::ALL.into_iter().flat_map(|s| model.pages(s).map(|(.., page)| page)).collect();
    let mut row = bench.row("recount", "");
    for which in [1, 2] {
        let mut counts = model.learn_counts()?;
        let mut recorder = context.recorder("recount")?;
        model.record_recount(&mut recorder, Some((Segment::Supplement, &added, which)), &status);
        recorder.submit()?.wait()?;
        counts[Segment::Supplement as usize] += [0, 5, model.capacity()][which as usize];
        let blocks = items_per_group(context.info());
        let want = recount::recount(counts, &pages, context.info().workgroup(WORKGROUP), blocks, Status::default());
        row.words(&model.learn_counts()?, &want.counts);
        row.words(&model.population.download()?, &want.population);
        row.words(&model.population_args.download()?, &want.args);
        row.words(&status.download()?, &want.status.0);
    }
    let times = bench.time(|recorder| model.record_recount(recorder, None, &status))?;
    row.time = times.of("recount");
    row.work.bytes = (24 * pages.len() + 48) as f64;
    bench.push(row);
    Ok(())
}

/// The base in another order, some Gaussians twice, some left out and some new; the supplement stays.
fn rearranged(bench: &mut Bench<'_>, model: &mut Model) -> Result<()> {
    let context = bench.context;
    let old = model.count_of(Segment::Base);
    let new = model.part(Segment::Base).capacity() - 9;
    let sources: Vec<u32> = (0..new).map(|t| if t % 50 == 13 { NONE } else { noise(t) % old }).collect();
    let pages = &model.part(Segment::Base).pages;
    let moments = Planes::zeroed(context, "moments", 3, pages)?;
    for (k, page) in pages.iter().enumerate() {
        let capacity = page.capacity as usize;
        let value = |p, place| (page.first as usize + p * capacity + place) as f32;
        moments.page(k).upload(0, &layout::page(3, capacity, capacity, value))?;
    }
    let there = Buffer::from_slice(context, "sources", &sources)?;
    let count = Buffer::from_slice(context, "count", &[new])?;
    let from = Sources { sources: &there, count: &count, index: 0 };
    let status = Buffer::<u32>::zeroed(context, "status", status::WORDS)?;
    let stage = Rearrange::new(context, new)?;
    let planes = |model: &Model, segment: Segment| -> Result<Vec<Vec<f32>>> {
        let part = model.part(segment);
        let mut all = [part.geometry.download()?, part.sh.download()?, part.lobes.download()?].concat();
        if segment == Segment::Base {
            all.extend(moments.download()?);
        }
        Ok(all)
    };
    let before = Segment::ALL.map(|segment| planes(model, segment));
    let mut recorder = context.recorder("rearrange")?;
    stage.record(&mut recorder, model, Segment::Base, from, &[&moments], &status);
    recorder.submit()?.wait()?;

    let mut row = bench.row("gather", "");
    let bits = |values: &[f32]| -> Vec<u32> { values.iter().map(|v| v.to_bits()).collect() };
    let [base, supplement] = before;
    let planes_moved = planes(model, Segment::Base)?;
    for (got, before) in planes_moved.iter().zip(base?) {
        row.words(&bits(&got[..new as usize]), &bits(&gather::gather(&before, &sources)));
    }
    for (got, before) in planes(model, Segment::Supplement)?.iter().zip(supplement?) {
        row.words(&bits(got), &bits(&before));
    }
    row.unequal(u64::from(model.learn_counts()?[0] != new || Status::read(&status.download()?).failed()));
    let times = bench.time(|r| stage.record(r, model, Segment::Base, from, &[&moments], &status))?;
    row.time = times.all("gather");
    row.work.bytes = f64::from(new) * (8.0 * planes_moved.len() as f64 + 4.0);
    bench.push(row);
    Ok(())
}
