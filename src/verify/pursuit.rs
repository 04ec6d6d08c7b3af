//! Residual pursuit, from a view's residual to the Gaussians that are placed.

use glam::DVec3;

use super::{Bench, judge::Work, lift::Case, sort::noise};
use crate::{
    error::Result,
    gpu::{Buffer, Context, Location, Recorder},
    pipelines::{
        pursuit::{KEPT, Placer, Pursuit, PursuitOptions, QUANTA, level_of},
        session::Session,
        views::Views,
    },
    reference::{
        self as twin, NONE, View,
        pursuit::{Candidate, Fit, Ground, REACH, Texel, WHOLE, lobe_width, sigma_of},
        pursuit_draw::Drawn,
        pursuit_fit::{best_of, certain},
        pursuit_score::Sums,
    },
    stages::{
        constants::pursuit::{LEVELS, SUMS, WIDTHS},
        status, types,
    },
};

const SEED: u64 = 5;
/// What remains of a residual differs by more only where a pixel is taken for one within a window, or for one outside of it.
const BORDER: f64 = 1e-4;

pub(super) fn cases(bench: &mut Bench<'_>, quick: bool) -> Result<()> {
    let case = Case::new(33, 1, DVec3::ZERO);
    let context = bench.context;
    // A pattern that is fixed to the surface, and photographs that have a gloss and noise besides.
    let (mut images, mut photos) = (Vec::new(), Vec::new());
    for (v, camera) in case.cameras.iter().enumerate() {
        let (mut image, mut photo) = (Vec::new(), Vec::new());
        for p in 0..camera.pixels() {
            let (x, y) = (f64::from(p % camera.width) + 0.5, f64::from(p / camera.width) + 0.5);
            let depth = f64::from(case.depths[case.pixel_firsts[v] + p as usize]);
            let world = camera.unproject(x, y, depth.max(1.0));
            let gloss = (-40.0 * (world.normalize() - (camera.eye() - world).normalize()).length_squared()).exp();
            let colour = (3.0 * world).to_array().map(|c| 0.4 + 0.3 * c.sin());
            image.push([
                colour[0] as f32,
                colour[1] as f32,
                if p % 211 == 5 { f32::NAN } else { colour[2] as f32 },
                0.0,
            ]);
            for (c, colour) in colour.into_iter().enumerate() {
                let off = f64::from(noise(7 * p + c as u32 + 1000 * v as u32) % 64) / 1024.0 - 0.03;
                photo.push((255.0 * (colour + 0.4 * gloss + off)).clamp(0.0, 255.0) as u8);
            }
        }
        images.push(image);
        photos.push(photo);
    }
    let photographs: Vec<&[u8]> = photos.iter().map(|p| &p[..]).collect();
    let views = Views::upload(context, &case.cameras, &photographs)?;
    let session = Session { seed: SEED, ..Session::new(context) };
    let options = PursuitOptions { draws: 3, sizes: 3, first_size: 0.7, size_ratio: 2.0, ..Default::default() };
    let most = if quick { 100 } else { 2000 };
    let mut pursuit = Pursuit::new(&session, &views, most, options)?;
    pursuit.charge([76, 72]);
    pursuit.start(most)?;
    let here = Here {
        context,
        placer: &pursuit.placer,
        cameras: case.cameras.iter().map(|camera| View::from_camera(camera).rounded()).collect(),
        image: Buffer::new(context, "image", views.max_pixels() as usize, Location::Device)?,
        depths: Buffer::new(context, "depths", views.max_pixels() as usize, Location::Device)?,
        views,
        options,
    };
    for (v, image) in images.iter().enumerate() {
        let depths = &case.depths[case.pixel_firsts[v]..][..image.len()];
        here.pyramid(bench, v, image, depths, v + 1 == case.cameras.len())?;
    }
    here.draw(bench)?;
    here.fit(bench)?;
    here.round(bench)?;
    here.place(bench)
}

struct Here<'a> {
    context: &'a Context,
    placer: &'a Placer,
    views: Views,
    cameras: Vec<View>,
    image: Buffer<[f32; 4]>,
    depths: Buffer<f32>,
    options: PursuitOptions,
}

fn wide(values: &[f32]) -> Vec<f64> {
    values.iter().map(|&v| f64::from(v)).collect()
}

fn values(texels: &[types::Texel]) -> Vec<[f64; 8]> {
    texels.iter().map(|t| Texel::unpack(t).values()).collect()
}

impl Here<'_> {
    fn record(&self, record: impl FnOnce(&mut Recorder)) -> Result<()> {
        let mut recorder = self.context.recorder("verify")?;
        record(&mut recorder);
        Ok(recorder.submit()?.wait().map(drop)?)
    }

    /// The rows of one view; the others' stages run only.
    fn pyramid(&self, bench: &mut Bench<'_>, v: usize, image: &[[f32; 4]], depths: &[f32], judged: bool) -> Result<()> {
        self.image.upload(0, image)?;
        self.depths.upload(0, depths)?;
        let record = |recorder: &mut Recorder| {
            let recorded = self.placer.record_pyramid(recorder, &self.views, v as u32, &self.image, &self.depths);
            debug_assert!(recorded.is_ok());
        };
        if !judged {
            return self.record(record);
        }
        let times = bench.time(record)?;
        let (w, page, plot) = (&self.placer.work, &self.placer.pages[0], &self.placer.plot_list[v]);
        let pixels = image.len();
        let raw = w.raw_texels.download_range(0, pixels)?;
        let image64: Vec<[f64; 4]> = image.iter().map(|p| p.map(f64::from)).collect();
        let targets = self.views.download_photograph(v)?;
        let want = twin::pursuit_residual::pursuit_residual(&image64, &targets, &wide(depths));
        let mut row = bench.row("pursuit_residual", "");
        row.time = times.of("pursuit_residual");
        row.work = Work { bytes: 16.0 + 4.0 + 4.0 + 16.0 + 12.0, operations: 30.0 };
        row.work.bytes *= pixels as f64;
        row.work.operations *= pixels as f64;
        let halves = |texels: &[Texel]| values(&texels.iter().map(Texel::pack).collect::<Vec<_>>());
        row.numbers(
            values(&raw)
                .as_flattened()
                .iter()
                .map(|&v| v as f32)
                .zip(halves(&want.texels).as_flattened().iter().copied()),
        );
        let first = plot.pixel_first as usize;
        for (got, want) in [(&page.errors, &want.errors), (&page.surface_depths, &want.depths)] {
            row.numbers(got.download_range(first, pixels)?.into_iter().zip(want.iter().copied()));
        }
        for (got, want) in [(&w.error_sums, &want.sums), (&w.squares, &want.squares)] {
            let got = got.download_range(plot.block_first as usize, want.len())?;
            row.numbers(got.into_iter().zip(want.iter().copied()));
        }
        row.words(&page.explained.download_range(first, pixels)?, &vec![0; pixels]);
        bench.push(row);

        // Each level of what the device has of the one below.
        let texels = page.texels.download()?;
        let (width, height) = (self.cameras[v].width, self.cameras[v].height);
        let (mut from, mut from_size) = (raw, [width, height]);
        for k in 0..LEVELS {
            let [first, width, height] = level_of(plot, width, height, k);
            let got = texels[first as usize..][..(width * height) as usize].to_vec();
            let below: Vec<Texel> = from.iter().map(Texel::unpack).collect();
            let want = twin::pursuit_blur::pursuit_blur(&below, from_size, [width, height], k > 0);
            if k < 2 {
                let mut row = bench.row("pursuit_blur", if k > 0 { "from the level below" } else { "from the view" });
                row.time = times.nth("pursuit_blur", k as usize);
                let taps = if k > 0 { 64.0 } else { 25.0 };
                row.work =
                    Work { bytes: 16.0 * (from.len() + got.len()) as f64, operations: 10.0 * taps * got.len() as f64 };
                let got = values(&got);
                row.numbers(
                    got.as_flattened().iter().map(|&v| v as f32).zip(halves(&want).as_flattened().iter().copied()),
                );
                bench.push(row);
            }
            (from, from_size) = (got, [width, height]);
        }
        Ok(())
    }

    fn ground<'b>(&'b self, surface_depths: &'b [f64], texels: &'b [Texel]) -> Ground<'b> {
        let range = (0, self.cameras.len() as u32);
        Ground { views: &self.cameras, plots: &self.placer.plot_list, surface_depths, texels, range }
    }

    fn draw(&self, bench: &mut Bench<'_>) -> Result<()> {
        let (w, page) = (&self.placer.work, &self.placer.pages[0]);
        let status = Buffer::<u32>::zeroed(bench.context, "status", status::WORDS)?;
        let times = bench.time(|recorder| self.placer.record_draw(recorder, &self.views, &status))?;
        let sums = w.error_sums.download()?;
        let quanta = w.quanta.download()?;
        let mut row = bench.row("pursuit_quanta", "");
        row.time = times.of("pursuit_quanta");
        row.work = Work { bytes: 8.0 * sums.len() as f64, operations: 3.0 * sums.len() as f64 };
        let want = twin::pursuit_quanta::pursuit_quanta(&wide(&sums));
        row.numbers(quanta.iter().map(|&q| q as f32).zip(want.into_iter().map(f64::from)));
        bench.push(row);

        let (error_sums, errors) = (wide(&sums), wide(&page.errors.download()?));
        let surface_depths = wide(&page.surface_depths.download()?);
        let from = Drawn {
            views: &self.cameras,
            plots: &self.placer.plot_list,
            quanta: &quanta,
            quanta_firsts: &w.quanta_firsts.download()?,
            total: w.counts.download()?[QUANTA as usize],
            error_sums: &error_sums,
            errors: &errors,
            surface_depths: &surface_depths,
            page_views: (0, self.cameras.len() as u32),
            page_blocks: (page.blocks.start, page.blocks.end),
        };
        let count = self.placer.candidates;
        let got = w.candidates.download()?;
        let (mut flips, mut wrong, mut same) = (0, 0, Vec::new());
        for (i, c) in got.iter().enumerate() {
            let of = |late: f64| from.pixel(i as u32, count, SEED as u32, late);
            let found = Some((c.view, c.pixel)).filter(|_| c.view != NONE);
            if found == of(0.0) {
                same.extend(found.and_then(|(v, pixel)| from.candidate(v, pixel)).map(|want| (c, want)));
            } else {
                flips += 1;
                // 256 errors are added up to within 256 roundings of 6e-8 of their sum.
                wrong += u64::from(found != of(2e-5) && found != of(-2e-5));
            }
        }
        let mut row = bench.row("pursuit_draw", "");
        row.time = times.of("pursuit_draw");
        let views = self.cameras.len() as f64;
        let draws = f64::from(count);
        row.work = Work { bytes: 4.0 * errors.len() as f64 + 40.0 * draws, operations: draws * (256.0 + 20.0 * views) };
        row.flips(flips, got.len());
        row.unequal(wrong);
        for k in 0..3 {
            row.numbers(same.iter().map(|(a, b)| (a.mean[k], b.mean[k])));
            row.numbers(same.iter().map(|(a, b)| (a.toward[k], b.toward[k])));
        }
        row.numbers(same.iter().map(|(a, b)| (a.px, b.px)));
        row.numbers(same.iter().map(|(a, b)| (a.theta_bar, b.theta_bar)));
        bench.push(row);
        Ok(())
    }

    /// Whether float32 may see a candidate otherwise than float64: near a pixel's or the image's border, the edge of the same depth, or
    /// of a level or window.
    fn unsure(&self, ground: &Ground<'_>, c: &Candidate) -> bool {
        let near = |v: f64, step: f64| ((v / step).round() - v / step).abs() < 2e-4;
        (0..self.cameras.len()).any(|v| {
            let view = &self.cameras[v];
            let [x, y, z] = [view.row_x, view.row_y, view.row_z].map(|row| row.truncate().dot(c.mean) + row.w);
            let (x, y) = (view.fx * x / z + view.cx, view.fy * y / z + view.cy);
            if v as u32 == c.view {
                return false;
            }
            let inside = |v: f64, size: u32| v > -1.0 && v < f64::from(size) + 1.0;
            if !(inside(x, view.width) && inside(y, view.height)) {
                return false;
            }
            let pixel = (x.max(0.0) as u32).min(view.width - 1) + (y.max(0.0) as u32).min(view.height - 1) * view.width;
            let own = ground.surface_depths[(ground.plots[v].pixel_first + pixel) as usize];
            near(x, 1.0) || near(y, 1.0) || ((z - own) / (0.05 * own) - 1.0).abs() < 1e-3
        })
    }

    fn fit(&self, bench: &mut Bench<'_>) -> Result<()> {
        let (w, page) = (&self.placer.work, &self.placer.pages[0]);
        let surface_depths = wide(&page.surface_depths.download()?);
        let texels: Vec<Texel> = page.texels.download()?.iter().map(Texel::unpack).collect();
        let ground = self.ground(&surface_depths, &texels);
        // What float32 may see otherwise is left out from here on, so that what follows is compared without exception.
        let mut candidates = w.candidates.download()?;
        let mut left_out = 0;
        for c in candidates.iter_mut().filter(|c| c.view != NONE) {
            if self.unsure(&ground, &Candidate::from(&*c)) {
                c.view = NONE;
                left_out += 1;
            }
        }
        w.candidates.upload(0, &candidates)?;
        let times = bench.time(|recorder| self.placer.record_fit(recorder, &self.views, 0))?;
        let PursuitOptions { sizes, first_size, size_ratio, .. } = self.options;
        let (sizes, count) = (sizes as usize, candidates.len());
        let got = w.sums.download()?;
        let items = count * sizes;
        let pixels: Vec<f64> =
            (0..sizes).map(|s| f64::from(first_size) * f64::from(size_ratio).powi(s as i32)).collect();
        let mut row = bench.row("pursuit_score", "");
        row.time = times.of("pursuit_score");
        let meetings = (items * self.cameras.len()) as f64;
        row.work = Work {
            bytes: 16.0 * texels.len() as f64 + 4.0 * got.len() as f64 + 40.0 * count as f64,
            operations: meetings * (80.0 + 25.0 * f64::from(WIDTHS)),
        };
        // One in twenty at most, so that what is compared is nearly all.
        row.unequal(u64::from(20 * left_out > count));
        let mut want: Vec<Vec<Sums>> = Vec::new();
        for c in &candidates {
            let c = Candidate::from(c);
            want.push(
                pixels
                    .iter()
                    .map(|&size| twin::pursuit_score::pursuit_score(&ground, &c, sigma_of(size, c.px)))
                    .collect(),
            );
        }
        let sum_of = |i: usize, s: usize, at: usize| got[at * items + i * sizes + s];
        for q in 0..SUMS as usize {
            let (want, sum_of) = (&want, &sum_of);
            row.numbers((0..count).flat_map(move |i| {
                (0..sizes).flat_map(move |s| {
                    (0..WIDTHS as usize).map(move |w| (sum_of(i, s, w * SUMS as usize + q), want[i][s][w][q]))
                })
            }));
        }
        bench.push(row);

        // Of the device's own sums.
        let fits = w.fits.download()?;
        let mut row = bench.row("pursuit_fit", "");
        row.time = times.of("pursuit_fit");
        row.work = Work {
            bytes: 4.0 * got.len() as f64 + 40.0 * count as f64,
            operations: items as f64 * f64::from(WIDTHS) * 100.0,
        };
        let (worth, doubt) = (self.placer.worth.map(f64::from), f64::from(self.options.doubt));
        let (mut flips, mut wrong, mut same) = (0, 0, Vec::new());
        for (i, fit) in fits.iter().enumerate() {
            let c = &candidates[i];
            let again = i > 0 && (candidates[i - 1].view, candidates[i - 1].pixel) == (c.view, c.pixel);
            if c.view == NONE || again {
                wrong += u64::from(fit.gain != 0.0);
                continue;
            }
            let mut sums = vec![Sums::default(); sizes];
            for (s, sums) in sums.iter_mut().enumerate() {
                sums.as_flattened_mut().iter_mut().enumerate().for_each(|(at, sum)| *sum = sum_of(i, s, at).into());
            }
            let best = twin::pursuit_fit::pursuit_fit(&Candidate::from(c), &sums, &pixels, worth, doubt);
            let close = |a: f32, b: f64| (f64::from(a) - b).abs() <= 1e-5 * b.abs();
            // As far as float32 knows differences of such sums, as below.
            let terms_of = |x: &[f64; SUMS as usize]| x[..9].iter().map(|x| x.abs()).sum::<f64>();
            let terms = sums.iter().map(|s| terms_of(&s[WIDTHS as usize - 1])).fold(0.0, f64::max);
            wrong += u64::from((f64::from(fit.plain) - best.plain).abs() > 1e-3 * best.plain + 2e-6 * terms);
            if close(fit.sigma, best.sigma) && close(fit.width, best.width) {
                same.push((fit, best));
            } else {
                flips += 1;
                // Another size or width that counts nearly as much, as far as float32 knows differences of such sums.
                let sums_of = |sigma: f64, width: f64| {
                    let near = |a: f64, b: f64| (a - b).abs() <= 1e-5 * b.abs();
                    let s = (0..sizes).find(|&s| near(sigma, sigma_of(pixels[s], f64::from(c.px))))?;
                    let w = (0..WIDTHS).find(|&w| near(width, lobe_width(w, f64::from(c.theta_bar))))?;
                    Some((&sums[s][w as usize], worth[usize::from(w == WIDTHS - 1)]))
                };
                let taken = sums_of(fit.sigma.into(), fit.width.into());
                let terms = taken.map_or(0.0, |(x, _)| terms_of(x));
                let counts = |of: Option<(&_, f64)>| {
                    let (x, worth) = of?;
                    best_of(x).map(|(_, _, gain)| gain * worth * certain(x, doubt))
                };
                let [gain, most] = [taken, sums_of(best.sigma, best.width)].map(|of| counts(of).unwrap_or(0.0));
                wrong += u64::from(most - gain > 1e-3 * most + 2e-6 * terms);
            }
        }
        row.flips(flips, count);
        row.unequal(wrong);
        let price = |fit: &types::Fit| self.placer.prices[usize::from(fit.width <= 0.0)];
        row.words(&w.prices.download()?, &fits.iter().map(price).collect::<Vec<_>>());
        row.numbers(same.iter().map(|(a, b)| (a.gain, b.gain)));
        row.numbers(same.iter().map(|(a, b)| (a.opacity, b.opacity)));
        row.numbers(same.iter().map(|(a, b)| (a.sigma, b.sigma)));
        row.numbers(same.iter().flat_map(|(a, b)| (0..3).map(|k| (a.colour[k], b.colour[k]))));
        bench.push(row);
        Ok(())
    }

    fn round(&self, bench: &mut Bench<'_>) -> Result<()> {
        let (w, page) = (&self.placer.work, &self.placer.pages[0]);
        let surface_depths = wide(&page.surface_depths.download()?);
        let texels: Vec<Texel> = page.texels.download()?.iter().map(Texel::unpack).collect();
        let ground = self.ground(&surface_depths, &texels);
        // A round before, so that something is explained.
        self.record(|recorder| self.placer.record_round(recorder, &self.views))?;
        let (explained, keys) = (page.explained.download()?, w.gain_keys.download()?);
        let restore = || Ok(page.explained.upload(0, &explained).and_then(|()| w.gain_keys.upload(0, &keys))?);
        let times = bench.time_after(restore, |recorder| self.placer.record_round(recorder, &self.views))?;
        let (candidates, fits) = (w.candidates.download()?, w.fits.download()?);
        let all: Vec<(Candidate, Fit)> =
            candidates.iter().map(Candidate::from).zip(fits.iter().map(Fit::from)).collect();
        let views = (all.len() * self.cameras.len()) as f64;
        let table = 16.0 * texels.len() as f64 + 68.0 * all.len() as f64;

        let gains = w.gains.download()?;
        let mut row = bench.row("pursuit_gain", "");
        row.time = times.of("pursuit_gain");
        row.work = Work { bytes: table + 8.0 * explained.len() as f64, operations: 100.0 * views };
        row.numbers(all.iter().enumerate().map(|(i, (c, fit))| {
            let live = fit.gain > 0.0 && keys[i] == NONE;
            (
                gains[i],
                if live {
                    let of = twin::pursuit_gain::pursuit_gain(&ground, &explained, c, fit, self.options.caution.into());
                    of[0] - f64::from(self.options.doubt) * of[1].sqrt()
                } else {
                    0.0
                },
            )
        }));
        bench.push(row);

        // Of the device's own gains.
        let cells: Vec<Vec<usize>> = (0..all.len())
            .map(
                |i| if gains[i] > 0.0 { twin::pursuit_claim::cells(&ground, &all[i].0, &all[i].1) } else { Vec::new() },
            )
            .collect();
        let mut claims = vec![0; page.claims.len()];
        cells
            .iter()
            .zip(&gains)
            .for_each(|(cells, &gain)| twin::pursuit_claim::pursuit_claim(cells, gain, &mut claims));
        let mut row = bench.row("pursuit_claim", "claims");
        row.time = times.nth("pursuit_claim", 0);
        row.work = Work { bytes: 40.0 * all.len() as f64 + 4.0 * claims.len() as f64, operations: 40.0 * views };
        row.words(&page.claims.download()?, &claims);
        bench.push(row);
        let lost = |(cells, &gain): (&Vec<usize>, &f32)| u32::from(twin::pursuit_claim::beaten(cells, gain, &claims));
        let beaten: Vec<u32> = cells.iter().zip(&gains).map(lost).collect();
        let mut row = bench.row("pursuit_claim", "check");
        row.time = times.nth("pursuit_claim", 1);
        row.work = Work { bytes: 40.0 * all.len() as f64 + 4.0 * claims.len() as f64, operations: 40.0 * views };
        row.words(&w.beaten.download()?, &beaten);
        bench.push(row);

        let mut want = explained.clone();
        let mut want_keys = keys.clone();
        let mut taken = 0;
        for i in (0..all.len()).filter(|&i| gains[i] > 0.0 && beaten[i] == 0) {
            twin::pursuit_attenuate::pursuit_attenuate(&ground, &all[i].0, &all[i].1, &mut want);
            want_keys[i] = !gains[i].to_bits();
            taken += 1;
        }
        let mut row = bench.row("pursuit_attenuate", "");
        row.time = times.of("pursuit_attenuate");
        row.work = Work {
            bytes: table + 8.0 * explained.len() as f64,
            operations: f64::from(taken) * self.cameras.len() as f64 * 1000.0,
        };
        // Nothing is proved where nothing is taken.
        row.unequal(u64::from(taken == 0));
        // As it is used: what remains. Where a window's reach is as near to where it is rounded up as float32 can tell, a pixel outside of
        // its border may be within; it is REACH deviations away or more.
        let left = |explained: u32| 1.0 - f64::from(explained) / WHOLE;
        let pairs: Vec<(f32, f64)> =
            page.explained.download()?.iter().zip(&want).map(|(&got, &want)| (left(got) as f32, left(want))).collect();
        let off = |&(got, want): &(f32, f64)| (f64::from(got) - want).abs();
        row.flips(pairs.iter().filter(|pair| off(pair) > BORDER).count(), pairs.len());
        row.unequal(pairs.iter().filter(|pair| off(pair) > (-0.5 * REACH * REACH).exp()).count() as u64);
        row.numbers(pairs.iter().filter(|pair| off(pair) <= BORDER).copied());
        row.words(&w.gain_keys.download()?, &want_keys);
        bench.push(row);
        Ok(())
    }

    fn place(&self, bench: &mut Bench<'_>) -> Result<()> {
        let w = &self.placer.work;
        let (candidates, fits, keys) = (w.candidates.download()?, w.fits.download()?, w.gain_keys.download()?);
        // Falling gains, the first of equals first.
        let mut order: Vec<usize> = (0..keys.len()).filter(|&i| keys[i] != NONE).collect();
        order.sort_by_key(|&i| keys[i]);
        // A budget that ends at three quarters of them, within one's price.
        let prices = w.prices.download()?;
        let budget = 3 * order.iter().map(|&i| prices[i]).sum::<u32>() / 4 + 1;
        let times = bench.time(|recorder| self.placer.record_place(recorder, budget))?;
        let lifts = w.lifts.download()?;
        let mut row = bench.row("pursuit_place", "");
        row.time = times.of("pursuit_place");
        row.work = Work { bytes: (36.0 + 40.0 + 64.0) * lifts.len() as f64, operations: 30.0 * lifts.len() as f64 };
        row.words(&[w.counts.download()?[KEPT as usize]], &[order.len() as u32]);
        let mut spent = 0;
        let within = |&&i: &&usize| {
            spent += prices[i];
            spent <= budget
        };
        let placed = order[..order.len().min(lifts.len())].iter().take_while(within).count();
        let want: Vec<_> = order[..placed]
            .iter()
            .map(|&i| twin::pursuit_place::pursuit_place(&Candidate::from(&candidates[i]), &Fit::from(&fits[i])))
            .collect();
        let flags = |lobe: bool| -> Vec<u32> {
            let flag = |k: usize| want.get(k).is_some_and(|lift| (lift.lobe_width > 0.0) == lobe);
            (0..lifts.len()).map(|k| u32::from(flag(k))).collect()
        };
        row.words(&w.lift_flags.download()?, &flags(true));
        row.words(&w.plain_flags.download()?, &flags(false));
        row.unequal(lifts[placed..].iter().filter(|lift| lift.cluster_size > 0).count() as u64);
        let pairs = || lifts.iter().zip(&want);
        for k in 0..3 {
            row.numbers(pairs().map(|(a, b)| (a.mean[k], b.mean[k])));
            row.numbers(pairs().map(|(a, b)| (a.log_scale[k], b.log_scale[k])));
            row.numbers(pairs().map(|(a, b)| (a.dc[k], b.dc[k])));
            row.numbers(pairs().map(|(a, b)| (a.lobe_dir[k], b.lobe_dir[k])));
        }
        row.numbers(pairs().map(|(a, b)| (a.opacity, b.opacity)));
        row.numbers(pairs().map(|(a, b)| (a.lobe_width, b.lobe_width)));
        row.numbers(pairs().map(|(a, b)| (a.theta_bar, b.theta_bar)));
        bench.push(row);
        Ok(())
    }
}
