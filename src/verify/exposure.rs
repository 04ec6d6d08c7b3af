//! Exposure correction: the corrected image, its gradient, and the step of a map.

use super::{Bench, sort::noise};
use crate::{
    error::Result,
    gpu::Buffer,
    reference::{
        exposure_apply::{IDENTITY, Map, exposure_apply as apply_twin},
        exposure_backward::exposure_backward as backward_twin,
        exposure_step::{Moments, exposure_step as step_twin},
    },
    stages::{
        WORKGROUP,
        constants::exposure::{CORRECTIONS, FIRST, MAP, MOMENTS, SECOND, SUM_PIXELS},
        exposure_apply, exposure_backward, exposure_step,
        ssim::SUM_WORKGROUP,
        status::{self, Resource, Status},
        types::Frame,
    },
};

const PHOTO: u32 = 2;
/// Large enough that a wrong step is not a rounding of a map.
const RATE: f32 = 0.3;

pub(super) fn cases(bench: &mut Bench<'_>, quick: bool) -> Result<()> {
    pixels(bench, if quick { (101, 67) } else { (1000, 701) })?;
    // Of more photographs and more runs than a workgroup has threads.
    let (photos, runs) = if quick { (300, 275) } else { (3000, 8100) };
    step(bench, photos, runs)
}

fn unit(i: u32) -> f32 {
    (noise(i) >> 8) as f32 / 16_777_216.0
}

/// Maps near the identity.
fn maps(photos: u32) -> Vec<f32> {
    let entry = |i: u32| IDENTITY[(i % MAP) as usize] as f32 + 0.4 * (unit(i + 31) - 0.5);
    (0..MAP * photos).map(entry).collect()
}

fn wide<const N: usize>(values: &[f32]) -> Vec<[f64; N]> {
    values.as_chunks::<N>().0.iter().map(|row| row.map(f64::from)).collect()
}

fn pixels(bench: &mut Bench<'_>, (width, height): (u32, u32)) -> Result<()> {
    let (context, count) = (bench.context, width * height);
    // The second, not at the beginning of the image.
    let frames = [
        Frame { image_first: 0, target_first: 0, width: 3, height: 3 },
        Frame { image_first: 5, target_first: 9, width, height },
    ];
    // What does not count is no number here and there.
    let counts = |p: u32| !p.is_multiple_of(7);
    let channel = |p: u32, c: u32| if !counts(p) && p.is_multiple_of(2) { f32::NAN } else { 1.2 * unit(4 * p + c) };
    let image: Vec<[f32; 4]> = (0..count + 5).map(|p| [0, 1, 2, 3].map(|c| channel(p, c))).collect();
    // Of one sign more than of the other, as where a photograph is brighter: its sums do not cancel.
    let of = |p: u32, c: u32| if counts(p) { unit(3 * p + c + 77) - 0.3 } else { 0.0 };
    let grads: Vec<f32> = (0..count + 5).flat_map(|p| [0, 1, 2].map(|c| of(p, c))).collect();
    let maps = maps(PHOTO + 2);
    let map: Map = wide(&maps)[PHOTO as usize];
    let wide_image: Vec<[f64; 4]> = image[5..].iter().map(|pixel| pixel.map(f64::from)).collect();

    let frames = Buffer::from_slice(context, "frames", &frames)?;
    let maps = Buffer::from_slice(context, "maps", &maps)?;
    let image = Buffer::from_slice(context, "image", &image)?;
    let corrected = Buffer::from_slice(context, "corrected", &vec![[9.0f32; 4]; image.len()])?;
    let spec = exposure_apply::Spec { workgroup_size: context.info().workgroup(WORKGROUP) };
    let stage = exposure_apply::Stage::new(context, &spec)?;
    let buffers = exposure_apply::Buffers { frames: &frames, maps: &maps, image: &image, corrected: &corrected };
    let push = exposure_apply::Push { frame: 1, photo: PHOTO };
    let times = bench.time(|r| stage.record(r, &buffers, &push, count))?;
    let (got, want) = (corrected.download()?, apply_twin(&map, &wide_image));
    let mut row = bench.row("exposure_apply", "");
    let pairs = got[5..].iter().zip(&want).filter(|(_, want)| want.iter().all(|v| v.is_finite()));
    row.numbers(pairs.flat_map(|(got, want)| got.iter().copied().zip(want.iter().copied())));
    row.words(&got[..5], &[[9.0; 4]; 5]);
    row.time = times.of("exposure_apply");
    row.work.bytes = 32.0 * f64::from(count);
    bench.push(row);

    let image_grad = Buffer::from_slice(context, "image_grad", &grads)?;
    let runs = count.div_ceil(SUM_PIXELS);
    let sums = Buffer::<f32>::zeroed(context, "sums", (MAP * runs) as usize)?;
    let spec = exposure_backward::Spec { workgroup_size: context.info().subgroup_size };
    let stage = exposure_backward::Stage::new(context, &spec)?;
    let buffers = exposure_backward::Buffers {
        frames: &frames,
        maps: &maps,
        image: &image,
        image_grad: &image_grad,
        sums: &sums,
    };
    let push = exposure_backward::Push { frame: 1, photo: PHOTO };
    let times = bench
        .time_after(|| Ok(image_grad.upload(0, &grads)?), |recorder| stage.record(recorder, &buffers, &push, runs))?;
    let mut want = wide(&grads[15..]);
    let want_sums = backward_twin(&map, &wide_image, &mut want);
    let mut row = bench.row("exposure_backward", "");
    let got = image_grad.download()?;
    row.gradients(got[15..].iter().copied().zip(want.into_iter().flatten()));
    row.gradients(sums.download()?.into_iter().zip(want_sums.into_iter().flatten()));
    row.words(&got[..15], &grads[..15]);
    row.time = times.of("exposure_backward");
    row.work.bytes = (16.0 + 24.0) * f64::from(count);
    bench.push(row);
    Ok(())
}

fn step(bench: &mut Bench<'_>, photos: u32, runs: u32) -> Result<()> {
    let context = bench.context;
    let before = maps(photos);
    let sums: Vec<f32> = (0..MAP * runs).map(|i| 1e-3 * (unit(i + 5) - 0.4)).collect();
    // As after some steps on gradients of about the size of these.
    let size = 1e-4 * runs as f32;
    let moment = |i: u32| match (i % MOMENTS, i / MOMENTS) {
        (FIRST..SECOND, _) => size * (unit(i) - 0.5),
        (SECOND..CORRECTIONS, photo) => size * size * (unit(i) + 0.1) * (1.0 - 0.999f32.powi(photo as i32 % 9)),
        (plane, photo) => 1.0 - [0.9f32, 0.999][(plane - CORRECTIONS) as usize].powi(photo as i32 % 9),
    };
    let moments: Vec<f32> = (0..MOMENTS * photos).map(moment).collect();

    let mut want: Vec<Map> = wide(&before);
    let read = |m: [f64; MOMENTS as usize]| Moments {
        first: std::array::from_fn(|e| m[FIRST as usize + e]),
        second: std::array::from_fn(|e| m[SECOND as usize + e]),
        corrections: std::array::from_fn(|k| m[CORRECTIONS as usize + k]),
    };
    let mut want_moments: Vec<Moments> = wide(&moments).into_iter().map(read).collect();
    step_twin(&mut want, &mut want_moments, PHOTO as usize, &wide(&sums), RATE.into());

    let there = Buffer::from_slice(context, "maps", &before)?;
    let beside = Buffer::from_slice(context, "moments", &moments)?;
    let mut row = bench.row("exposure_step", "");
    let spec = exposure_step::Spec { workgroup_size: SUM_WORKGROUP.min(context.info().max_workgroup) };
    let stage = exposure_step::Stage::new(context, &spec)?;
    let mut failed = Status::default();
    failed.fail(Resource::Intersections, 5);
    // A gradient that is no number, and a step that did not fit, move nothing.
    let mut unsound = sums.clone();
    unsound[(MAP * (runs - 1) + 7) as usize] = f32::NAN;
    for (sums, status, moves) in
        [(&unsound, Status::default(), false), (&sums, failed, false), (&sums, Status::default(), true)]
    {
        let sums = Buffer::from_slice(context, "sums", sums)?;
        let status = Buffer::from_slice(context, "status", &status.0[..status::WORDS])?;
        let buffers = exposure_step::Buffers { status: &status, sums: &sums, maps: &there, moments: &beside };
        let push = exposure_step::Push { photo: PHOTO, photos, runs, rate: RATE };
        let prepare = || -> Result<()> {
            there.upload(0, &before)?;
            Ok(beside.upload(0, &moments)?)
        };
        let times = bench.time_after(prepare, |recorder| stage.record(recorder, &buffers, &push, 1))?;
        let (got, got_moments) = (there.download()?, beside.download()?);
        if !moves {
            row.words(&[got, got_moments].concat(), &[&before[..], &moments].concat());
            continue;
        }
        row.numbers(got.into_iter().zip(want.iter().flatten().copied()));
        let own = (MOMENTS * PHOTO) as usize..(MOMENTS * (PHOTO + 1)) as usize;
        let Moments { first, second, corrections } = want_moments[PHOTO as usize];
        let of = |plane: u32, len: usize| got_moments[own.clone()][plane as usize..][..len].iter().copied();
        row.numbers(of(FIRST, 12).zip(first));
        row.numbers(of(SECOND, 12).zip(second));
        row.numbers(of(CORRECTIONS, 2).zip(corrections));
        let others = |moments: &[f32]| [&moments[..own.start], &moments[own.end..]].concat();
        row.words(&others(&got_moments), &others(&moments));
        row.time = times.of("exposure_step");
    }
    row.work.bytes = 4.0 * f64::from(MAP) * (f64::from(runs) + 2.0 * f64::from(photos));
    bench.push(row);
    Ok(())
}
