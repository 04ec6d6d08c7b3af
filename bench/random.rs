//! Random Gaussians for benches: the more, the smaller, so that a pixel always has as many.

use glint::{reference::random_scene, scene::Scene};

/// Of so many Gaussians, of which a share has lobes. They cover the image `overlap` times as often as 2,000 of the usual size do.
pub fn scene(gaussians: usize, lobes: f64, overlap: f64, sh_degree: u32) -> Scene {
    let lobes = (lobes.clamp(0.0, 1.0) * gaussians as f64) as usize;
    let mut scene = random_scene(1, gaussians - lobes, lobes, sh_degree);
    let shrink = (0.5 * (overlap * 2000.0 / gaussians.max(1) as f64).ln()) as f32;
    let supplement = scene.supplement.iter_mut().flat_map(|s| &mut s.gaussians.log_scales);
    scene.base.log_scales.iter_mut().chain(supplement).flatten().for_each(|s| *s += shrink);
    scene
}

/// `WxH` in pixels.
pub fn size(text: &str) -> Result<[u32; 2], String> {
    let numbers = text.split_once('x').and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    numbers.filter(|n| !n.contains(&0)).ok_or_else(|| format!("`{text}`, expected WxH in pixels"))
}
