//! Host adapters of residual pursuit's twins.

use super::{Outcome, view, wide};
use crate::{
    reference::{
        self as twin, NONE, View,
        pursuit::{Candidate, Fit, Ground, Texel, sigma_of},
        pursuit_draw::Drawn,
        pursuit_score::Sums,
    },
    stages::{
        constants::pursuit::{SUMS, WIDTHS},
        kernels,
        types::{self, Lift, Plot},
    },
};

twins!(
    pursuit_attenuate,
    pursuit_blur,
    pursuit_claim,
    pursuit_draw,
    pursuit_fit,
    pursuit_gain,
    pursuit_place,
    pursuit_quanta,
    pursuit_residual,
    pursuit_score,
    pursuit_sight
);

/// A page in float64.
struct Page {
    views: Vec<View>,
    plots: Vec<Plot>,
    surface_depths: Vec<f64>,
    texels: Vec<Texel>,
    range: (u32, u32),
}

impl Page {
    fn new(
        views: &[types::View],
        plots: &[Plot],
        surface_depths: &[f32],
        texels: &[types::Texel],
        range: (u32, u32),
    ) -> Self {
        Page {
            views: views.iter().map(view).collect(),
            plots: plots.to_vec(),
            surface_depths: wide(surface_depths),
            texels: texels.iter().map(Texel::unpack).collect(),
            range,
        }
    }

    fn ground(&self) -> Ground<'_> {
        let Page { views, plots, surface_depths, texels, range } = self;
        Ground { views, plots, surface_depths, texels, range: *range }
    }
}

fn half(texels: Vec<Texel>, to: &mut [types::Texel]) {
    to.iter_mut().zip(texels).for_each(|(to, t)| *to = t.pack());
}

pub(super) fn pursuit_residual(h: kernels::pursuit_residual::Host<'_>) -> Outcome {
    let v = h.push.view as usize;
    let (frame, plot) = (&h.frames[v], &h.plots[v]);
    let pixels = (frame.width * frame.height) as usize;
    let image: Vec<[f64; 4]> =
        h.image[frame.image_first as usize..][..pixels].iter().map(|p| p.map(f64::from)).collect();
    let targets = &h.targets[frame.target_first as usize..][..pixels];
    let found = twin::pursuit_residual::pursuit_residual(&image, targets, &wide(&h.depths[..pixels]));
    half(found.texels, h.texels);
    let first = plot.pixel_first as usize;
    for p in 0..pixels {
        h.surface_depths[first + p] = found.depths[p] as f32;
        h.errors[first + p] = found.errors[p] as f32;
        h.explained[first + p] = 0;
    }
    for (b, (sum, square)) in found.sums.into_iter().zip(found.squares).enumerate() {
        h.error_sums[plot.block_first as usize + b] = sum as f32;
        h.squares[plot.block_first as usize + b] = square as f32;
    }
    Ok(())
}

pub(super) fn pursuit_blur(h: kernels::pursuit_blur::Host<'_>) -> Outcome {
    let kernels::pursuit_blur::Push { from_first, from_width, from_height, first, width, height } = h.push;
    let from = &h.from_texels[from_first as usize..][..(from_width * from_height) as usize];
    let from: Vec<Texel> = from.iter().map(Texel::unpack).collect();
    let made = twin::pursuit_blur::pursuit_blur(&from, [from_width, from_height], [width, height], h.spec.halve);
    half(made, &mut h.texels[first as usize..]);
    Ok(())
}

pub(super) fn pursuit_quanta(h: kernels::pursuit_quanta::Host<'_>) -> Outcome {
    let count = h.push.count as usize;
    h.quanta[..count].copy_from_slice(&twin::pursuit_quanta::pursuit_quanta(&wide(&h.error_sums[..count])));
    Ok(())
}

pub(super) fn pursuit_draw(h: kernels::pursuit_draw::Host<'_>) -> Outcome {
    let p = &h.push;
    let views: Vec<View> = h.views[..p.view_count as usize].iter().map(view).collect();
    let (error_sums, errors, surface_depths) = (wide(h.error_sums), wide(h.errors), wide(h.surface_depths));
    let from = Drawn {
        views: &views,
        plots: h.plots,
        quanta: h.quanta,
        quanta_firsts: h.quanta_firsts,
        total: h.quanta_total[p.total_index as usize],
        error_sums: &error_sums,
        errors: &errors,
        surface_depths: &surface_depths,
        page_views: (p.view_first, p.view_end),
        page_blocks: (p.block_first, p.block_end),
    };
    for i in 0..p.count {
        if let Some(c) = twin::pursuit_draw::pursuit_draw(&from, i, p.count, p.seed) {
            h.candidates[i as usize] = types::Candidate {
                mean: c.mean.as_vec3().to_array(),
                toward: c.toward.as_vec3().to_array(),
                px: c.px as f32,
                theta_bar: c.theta_bar as f32,
                view: c.view,
                pixel: c.pixel,
            };
        }
    }
    Ok(())
}

fn size(first: f32, ratio: f32, index: u32) -> f64 {
    f64::from(first) * f64::from(ratio).powi(index as i32)
}

pub(super) fn pursuit_score(h: kernels::pursuit_score::Host<'_>) -> Outcome {
    let p = &h.push;
    let page = Page::new(h.views, h.plots, h.surface_depths, h.texels, (p.view_first, p.view_end));
    let items = (p.count * p.sizes) as usize;
    for item in 0..items {
        let c = Candidate::from(&h.candidates[p.first as usize + item / p.sizes as usize]);
        let sigma = sigma_of(size(p.first_size, p.size_ratio, item as u32 % p.sizes), c.px);
        let found = twin::pursuit_score::pursuit_score(&page.ground(), &c, sigma);
        for (at, sum) in found.as_flattened().iter().enumerate() {
            let to = &mut h.sums[at * items + item];
            let before = if p.begin != 0 { 0.0 } else { f64::from(*to) };
            *to = (before + sum) as f32;
        }
    }
    Ok(())
}

pub(super) fn pursuit_fit(h: kernels::pursuit_fit::Host<'_>) -> Outcome {
    let p = &h.push;
    let items = (p.count * p.sizes) as usize;
    let sizes: Vec<f64> = (0..p.sizes).map(|s| size(p.first_size, p.size_ratio, s)).collect();
    for k in 0..p.count as usize {
        let i = p.first as usize + k;
        let c = &h.candidates[i];
        let again = i > 0 && (h.candidates[i - 1].view, h.candidates[i - 1].pixel) == (c.view, c.pixel);
        let mut fit = twin::pursuit::Fit::default();
        if c.view != NONE && !again {
            let sums = |s: usize| -> Sums {
                let item = k * p.sizes as usize + s;
                let mut sums = Sums::default();
                for (at, sum) in sums.as_flattened_mut().iter_mut().enumerate() {
                    *sum = h.sums[at * items + item].into();
                }
                sums
            };
            let all: Vec<Sums> = (0..sizes.len()).map(sums).collect();
            let worth = [p.lobe_worth, p.plain_worth].map(f64::from);
            fit = twin::pursuit_fit::pursuit_fit(&Candidate::from(c), &all, &sizes, worth, p.doubt.into());
        }
        h.prices[i] = if fit.width > 0.0 { p.lobe_price } else { p.plain_price };
        h.fits[i] = types::Fit {
            sigma: fit.sigma as f32,
            opacity: fit.opacity as f32,
            width: fit.width as f32,
            color: fit.color.as_vec3().to_array(),
            gain: fit.gain as f32,
            support: fit.support as f32,
            plain: fit.plain as f32,
        };
    }
    debug_assert_eq!((SUMS * WIDTHS) as usize, Sums::default().as_flattened().len());
    Ok(())
}

pub(super) fn pursuit_sight(h: kernels::pursuit_sight::Host<'_>) -> Outcome {
    let p = &h.push;
    let page = Page::new(h.views, h.plots, h.surface_depths, &[], (p.view_first, p.view_end));
    for (i, words) in h.sights.chunks_exact_mut(p.words as usize).take(p.count as usize).enumerate() {
        if p.begin != 0 {
            words.fill(0);
        }
        let (c, fit) = (Candidate::from(&h.candidates[i]), Fit::from(&h.fits[i]));
        twin::pursuit_sight::pursuit_sight(&page.ground(), &c, &fit, words);
    }
    Ok(())
}

pub(super) fn pursuit_gain(h: kernels::pursuit_gain::Host<'_>) -> Outcome {
    let p = &h.push;
    let page = Page::new(h.views, h.plots, h.surface_depths, h.texels, (p.view_first, p.view_end));
    for i in 0..p.count as usize {
        let is_open = h.gain_keys[i] == NONE;
        if is_open && p.begin != 0 && h.gains[i] <= 0.0 {
            h.fits[i].gain = 0.0;
        }
        let mut sums = if p.begin != 0 { [0.0; 2] } else { [h.gains[i], h.gain_squares[i]].map(f64::from) };
        if h.fits[i].gain > 0.0 && is_open {
            let (c, fit) = (Candidate::from(&h.candidates[i]), Fit::from(&h.fits[i]));
            let more = twin::pursuit_gain::pursuit_gain(&page.ground(), h.explained, &c, &fit, p.caution.into());
            sums = [sums[0] + more[0], sums[1] + more[1]];
        }
        let less = if p.last != 0 { f64::from(p.doubt) * sums[1].sqrt() } else { 0.0 };
        h.gains[i] = (sums[0] - less) as f32;
        h.gain_squares[i] = sums[1] as f32;
    }
    Ok(())
}

pub(super) fn pursuit_claim(h: kernels::pursuit_claim::Host<'_>) -> Outcome {
    use twin::pursuit_claim::{beaten, cells, pursuit_claim};
    let p = &h.push;
    let page = Page::new(h.views, h.plots, h.surface_depths, &[], (p.view_first, p.view_end));
    for i in 0..p.count as usize {
        let gain = h.gains[i];
        let asks = |page: &Page| cells(&page.ground(), &Candidate::from(&h.candidates[i]), &Fit::from(&h.fits[i]));
        let cells = if gain > 0.0 { asks(&page) } else { Vec::new() };
        if h.spec.check {
            let before = p.begin == 0 && h.beaten[i] != 0;
            h.beaten[i] = u32::from(before || beaten(&cells, gain, h.claims));
        } else {
            pursuit_claim(&cells, gain, h.claims);
        }
    }
    Ok(())
}

pub(super) fn pursuit_attenuate(h: kernels::pursuit_attenuate::Host<'_>) -> Outcome {
    let p = &h.push;
    let page = Page::new(h.views, h.plots, h.surface_depths, h.texels, (p.view_first, p.view_end));
    for i in 0..p.count as usize {
        if !(h.gains[i] > 0.0) || h.beaten[i] != 0 {
            continue;
        }
        let (c, fit) = (Candidate::from(&h.candidates[i]), Fit::from(&h.fits[i]));
        twin::pursuit_attenuate::pursuit_attenuate(&page.ground(), &c, &fit, h.explained);
        if p.last != 0 {
            h.gain_keys[i] = !h.gains[i].to_bits();
        }
    }
    Ok(())
}

pub(super) fn pursuit_place(h: kernels::pursuit_place::Host<'_>) -> Outcome {
    let p = &h.push;
    let kept = h.kept[p.kept_index as usize].min(p.most);
    for rank in 0..p.count {
        let i = if rank < kept { h.order[rank as usize] as usize } else { 0 };
        let within =
            || p.budget == NONE || u64::from(h.spent[rank as usize]) + u64::from(h.prices[i]) <= u64::from(p.budget);
        let some = rank < kept && f32::from_bits(!h.gain_keys[i]) >= p.least_gain && within();
        let mut lift = Lift::default();
        if some {
            let placed = twin::pursuit_place::pursuit_place(&Candidate::from(&h.candidates[i]), &Fit::from(&h.fits[i]));
            lift = super::lift::narrow(&placed);
        }
        h.lift_flags[rank as usize] = u32::from(some && lift.lobe_width > 0.0);
        h.plain_flags[rank as usize] = u32::from(some && !(lift.lobe_width > 0.0));
        h.lifts[rank as usize] = lift;
    }
    Ok(())
}
