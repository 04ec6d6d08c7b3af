//! Verifies exposure correction: the corrected image, its gradient, and the step of a map.

use super::{Bench, sort::noise};
use crate::{
    error::Result,
    gpu::Buffer,
    reference::exposure_apply::IDENTITY,
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
/// Large enough that a wrong step cannot hide in the rounding of a map.
const RATE: f32 = 0.3;

pub(super) fn cases(bench: &Bench<'_>, quick: bool) -> Result<()> {
    pixels(bench, if quick { (101, 67) } else { (1000, 701) })?;
    // More photographs and more runs than a workgroup has threads.
    let (photos, runs) = if quick { (300, 275) } else { (3000, 8100) };
    step(bench, photos, runs)
}

fn unit(i: u32) -> f32 {
    (noise(i) >> 8) as f32 / 16_777_216.0
}

/// Random maps near the identity.
fn maps(photos: u32) -> Vec<f32> {
    let entry = |i: u32| IDENTITY[(i % MAP) as usize] as f32 + 0.4 * (unit(i + 31) - 0.5);
    (0..MAP * photos).map(entry).collect()
}

fn pixels(bench: &Bench<'_>, (width, height): (u32, u32)) -> Result<()> {
    let (context, count) = (&bench.shadowed, width * height);
    // The second frame is tested; it does not start at pixel 0.
    let frames = [
        Frame { image_first: 0, target_first: 0, width: 3, height: 3 },
        Frame { image_first: 5, target_first: 9, width, height },
    ];
    // Some masked pixels are NaN.
    let counts = |p: u32| !p.is_multiple_of(7);
    let channel = |p: u32, c: u32| if !counts(p) && p.is_multiple_of(2) { f32::NAN } else { 1.2 * unit(4 * p + c) };
    let image: Vec<[f32; 4]> = (0..count + 5).map(|p| [0, 1, 2, 3].map(|c| channel(p, c))).collect();
    // Mostly of one sign, as for a brighter photograph, so that sums do not cancel.
    let of = |p: u32, c: u32| if counts(p) { unit(3 * p + c + 77) - 0.3 } else { 0.0 };
    let grads: Vec<f32> = (0..count + 5).flat_map(|p| [0, 1, 2].map(|c| of(p, c))).collect();

    let frames = Buffer::from_slice(context, "frames", &frames)?;
    let maps = Buffer::from_slice(context, "maps", &maps(PHOTO + 2))?;
    let image = Buffer::from_slice(context, "image", &image)?;
    let corrected = Buffer::from_slice(context, "corrected", &vec![[9.0f32; 4]; image.len()])?;
    let spec = exposure_apply::Spec { workgroup_size: context.info().workgroup(WORKGROUP) };
    let stage = exposure_apply::Stage::new(context, &spec)?;
    let buffers = exposure_apply::Buffers { frames: &frames, maps: &maps, image: &image, corrected: &corrected };
    let push = exposure_apply::Push { frame: 1, photo: PHOTO };
    bench.run(|recorder| stage.record(recorder, &buffers, &push, count))?;

    let runs = count.div_ceil(SUM_PIXELS);
    let spec = exposure_backward::Spec { workgroup_size: context.info().subgroup_size };
    let stage = exposure_backward::Stage::new(context, &spec)?;
    let buffers = exposure_backward::Buffers {
        frames: &frames,
        maps: &maps,
        image: &image,
        image_grad: &Buffer::from_slice(context, "image_grad", &grads)?,
        sums: &Buffer::<f32>::zeroed(context, "sums", (MAP * runs) as usize)?,
    };
    let push = exposure_backward::Push { frame: 1, photo: PHOTO };
    bench.run(|recorder| stage.record(recorder, &buffers, &push, runs))
}

fn step(bench: &Bench<'_>, photos: u32, runs: u32) -> Result<()> {
    let context = &bench.shadowed;
    let sums: Vec<f32> = (0..MAP * runs).map(|i| 1e-3 * (unit(i + 5) - 0.4)).collect();
    // Moments as after some steps on gradients of about this size.
    let size = 1e-4 * runs as f32;
    let moment = |i: u32| match (i % MOMENTS, i / MOMENTS) {
        (FIRST..SECOND, _) => size * (unit(i) - 0.5),
        (SECOND..CORRECTIONS, photo) => size * size * (unit(i) + 0.1) * (1.0 - 0.999f32.powi(photo as i32 % 9)),
        (plane, photo) => 1.0 - [0.9f32, 0.999][(plane - CORRECTIONS) as usize].powi(photo as i32 % 9),
    };
    let moments: Vec<f32> = (0..MOMENTS * photos).map(moment).collect();
    let spec = exposure_step::Spec { workgroup_size: SUM_WORKGROUP.min(context.info().max_workgroup) };
    let stage = exposure_step::Stage::new(context, &spec)?;
    let mut failed = Status::default();
    failed.fail(Resource::Intersections, 5);
    // A NaN gradient, and a step that did not fit, must move nothing.
    let mut unsound = sums.clone();
    unsound[(MAP * (runs - 1) + 7) as usize] = f32::NAN;
    for (sums, status) in [(&unsound, Status::default()), (&sums, failed), (&sums, Status::default())] {
        let sums = Buffer::from_slice(context, "sums", sums)?;
        let status = Buffer::from_slice(context, "status", &status.0[..status::WORDS])?;
        let maps = Buffer::from_slice(context, "maps", &maps(photos))?;
        let moments = Buffer::from_slice(context, "moments", &moments)?;
        let buffers = exposure_step::Buffers { status: &status, sums: &sums, maps: &maps, moments: &moments };
        let push = exposure_step::Push { photo: PHOTO, photos, runs, rate: RATE };
        bench.run(|recorder| stage.record(recorder, &buffers, &push, 1))?;
    }
    Ok(())
}
