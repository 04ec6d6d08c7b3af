//! A wall as a test scene.

use glint::scene::Gaussians;

/// A few wide, flat Gaussians of one color at z = 4.
pub fn wall() -> Gaussians {
    let mut base = Gaussians { sh_degree: 0, ..Default::default() };
    for (i, j) in (0..5).flat_map(|i| (0..5).map(move |j| (i, j))) {
        base.means.push([i as f32 - 2.0, j as f32 - 2.0, 4.0]);
        base.log_scales.push([-0.4, -0.4, -4.0]);
        base.quats.push([1.0, 0.0, 0.0, 0.0]);
        base.opacities.push(4.0);
        base.sh.push([0.3, -0.2, 0.5]);
    }
    base
}
