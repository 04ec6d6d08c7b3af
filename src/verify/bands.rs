//! Verifies the search for bands: looks and fits.

use glam::{DMat3, DVec3};

use super::{Bench, sort::noise};
use crate::{
    error::Result,
    gpu::Buffer,
    pipelines::{
        bands::Rig,
        model::{Model, Room},
        render::{Needs, RenderOptions, Renderer, Show},
        session::{Policy, Session},
        views::Views,
    },
    reference::{random_camera, random_scene},
    scene::Camera,
    stages::status,
};

/// Enough for sixteen coefficients.
const VIEWS: u32 = 24;

pub(super) fn cases(bench: &Bench<'_>, quick: bool) -> Result<()> {
    let (count, size) = if quick { (600, (61, 43)) } else { (20_000, (303, 201)) };
    let camera = random_camera(size.0, size.1);
    let turned = |v: u32| {
        let turn = DMat3::from_rotation_y(0.01 * f64::from(v)) * DMat3::from_rotation_x(0.013 * f64::from(v % 5));
        let moved = DVec3::new(f64::from(v % 7) - 3.0, f64::from(v % 3) - 1.0, 0.0) * 0.4;
        Camera { rotation: turn * camera.rotation, translation: turn * camera.translation + moved, ..camera }
    };
    let cameras: Vec<Camera> = (0..VIEWS).map(turned).collect();
    let context = &bench.shadowed;
    let views = Views::upload(context, &cameras, &[&vec![0; 3 * camera.pixels() as usize][..]; VIEWS as usize])?;
    // Some pixels do not count.
    let pixel = |p: u32| noise(p / 50) & 0x00FF_FFFF | if p % 13 == 5 { 0 } else { 0xFF00_0000 };
    views.upload_photograph(0, &(0..camera.pixels()).map(pixel).collect::<Vec<_>>())?;
    let scene = random_scene(51, count, 0, 0);
    // The second page has spare room.
    let page = count as u32 * 2 / 3;
    let model =
        Model::upload_around(context, views.origin, &scene, Room { page: Some(page), base: 9, ..Room::default() })?;
    for packed in [false, true] {
        let policy = Policy { packed, ..Policy::default() };
        let rig = Rig::new(&Session { policy, ..Session::new(context) }, VIEWS, page)?;
        let options = RenderOptions { backward: true, policy, ..Default::default() };
        let mut renderer = Renderer::new(context, Needs::of(&model), &views, options)?;
        renderer.raster.make_scores()?;
        let status = Buffer::<u32>::zeroed(context, "status", status::WORDS)?;
        renderer.render_on_device(&model, &views, 0, &Show::all(&model, [0.0; 3]))?;
        let grid = renderer.raster.grid(0, 1, camera.width, camera.height);
        let of = (&model, &views, &renderer.raster);
        let targets = views.targets(0)?;
        bench.run(|recorder| rig.record_look(recorder, of, (1, 0, 0), (&grid, targets), &status))?;
        if packed {
            continue;
        }
        // Colors that vary with the view; some views do not see the Gaussian, some Gaussians have few views.
        let look = |i: u32| {
            let unit = |n: u32| (noise(5 * i + n) >> 8) as f32 / 16_777_216.0;
            let seen = unit(4) < if i % page % 7 == 3 { 0.1 } else { 0.8 };
            if seen { [unit(0), 0.5 + 0.3 * unit(1), 0.4, 0.01 + 40.0 * unit(3)] } else { [0.0; 4] }
        };
        rig.looks.upload(0, &(0..VIEWS * page).map(look).collect::<Vec<_>>())?;
        bench.run(|recorder| rig.record_fits(recorder, &model, &views, 0))?;
    }
    Ok(())
}
