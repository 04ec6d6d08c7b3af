//! Verifies residual pursuit, from a view's residual to the placed Gaussians.

use glam::DVec3;

use super::{Bench, lift::Case, sort::noise};
use crate::{
    error::Result,
    gpu::{Buffer, Location},
    pipelines::{
        pursuit::{Pursuit, PursuitOptions},
        session::Session,
        views::Views,
    },
    reference::NONE,
    stages::status,
};

const SEED: u64 = 5;

pub(super) fn cases(bench: &Bench<'_>, quick: bool) -> Result<()> {
    let case = Case::new(33, 1, DVec3::ZERO);
    let context = &bench.shadowed;
    // A pattern fixed to the surface; the photographs also have gloss and noise.
    let (mut images, mut photos) = (Vec::new(), Vec::new());
    for (v, camera) in case.cameras.iter().enumerate() {
        let (mut image, mut photo) = (Vec::new(), Vec::new());
        for p in 0..camera.pixels() {
            let (x, y) = (f64::from(p % camera.width) + 0.5, f64::from(p / camera.width) + 0.5);
            let depth = f64::from(case.depths[case.pixel_firsts[v] + p as usize]);
            let world = camera.unproject(x, y, depth.max(1.0));
            let gloss = (-40.0 * (world.normalize() - (camera.eye() - world).normalize()).length_squared()).exp();
            let color = (3.0 * world).to_array().map(|c| 0.4 + 0.3 * c.sin());
            image.push([color[0] as f32, color[1] as f32, if p % 211 == 5 { f32::NAN } else { color[2] as f32 }, 0.0]);
            for (c, color) in color.into_iter().enumerate() {
                let off = f64::from(noise(7 * p + c as u32 + 1000 * v as u32) % 64) / 1024.0 - 0.03;
                photo.push((255.0 * (color + 0.4 * gloss + off)).clamp(0.0, 255.0) as u8);
            }
        }
        images.push(image);
        photos.push(photo);
    }
    let photographs: Vec<&[u8]> = photos.iter().map(|p| &p[..]).collect();
    let views = Views::upload(context, &case.cameras, &photographs)?;
    let session = Session { seed: SEED, ..Session::new(context) };
    let options = PursuitOptions { sizes: 3, first_size: 0.7, size_ratio: 2.0, ..Default::default() };
    let most = if quick { 100 } else { 2000 };
    let mut pursuit = Pursuit::new(&session, &views, most, options)?;
    pursuit.charge([76, 72]);
    pursuit.start(most)?;
    let placer = &pursuit.placer;
    let image = Buffer::new(context, "image", views.max_pixels() as usize, Location::Device)?;
    let depths = Buffer::new(context, "depths", views.max_pixels() as usize, Location::Device)?;
    for (v, of_view) in images.iter().enumerate() {
        image.upload(0, of_view)?;
        depths.upload(0, &case.depths[case.pixel_firsts[v]..][..of_view.len()])?;
        bench.run(|recorder| {
            let recorded = placer.record_pyramid(recorder, &views, v as u32, &image, &depths);
            debug_assert!(recorded.is_ok());
        })?;
    }
    let status = Buffer::<u32>::zeroed(context, "status", status::WORDS)?;
    bench.run(|recorder| placer.record_draw(recorder, &status))?;
    bench.run(|recorder| placer.record_fit(recorder, 0))?;
    bench.run(|recorder| placer.record_sights(recorder))?;
    // In the second round a part of the residual is already explained.
    for _ in 0..2 {
        bench.run(|recorder| placer.record_round(recorder))?;
    }
    // A budget that ends at three quarters of the candidates, in the middle of one's price.
    let (keys, prices) = (placer.work.gain_keys.download()?, placer.work.prices.download()?);
    let all: u32 = keys.iter().zip(prices).filter(|(key, _)| **key != NONE).map(|(_, price)| price).sum();
    bench.run(|recorder| placer.record_place(recorder, 3 * all / 4 + 1))
}
