//! Random scenes that exercise every branch of the renderer, for comparing kernels with their twins.

use std::f32::consts::{PI, TAU};

use glam::{DMat3, DVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::scene::{Camera, Gaussians, Lobes, Scene, Supplement, color::BETAS};

/// The camera in front of which [`random_scene`] builds its scene: horizontal field of view 60°, off-centre
/// principal point. It is turned and moved away from the world's axes, so that no transposed rotation goes
/// unnoticed.
pub fn random_camera(width: u32, height: u32) -> Camera {
    let focal = width as f64 / (2.0 * FRAC_TAN);
    let rotation = DMat3::from_rotation_z(0.3) * DMat3::from_rotation_y(-0.7) * DMat3::from_rotation_x(0.4);
    Camera {
        width,
        height,
        fx: focal,
        fy: focal * 1.05,
        cx: width as f64 * 0.51,
        cy: height as f64 * 0.48,
        rotation,
        translation: DVec3::new(0.3, -0.2, 0.5),
    }
}

/// tan 30°.
const FRAC_TAN: f64 = 0.577_350_269_189_625_8;

/// A scene in front of [`random_camera`] of any size, `supplement` of its Gaussians with lobes (no supplement
/// for 0).
///
/// Depths 0.4 to 12, 5 % behind the camera, one in seven beside a square image. Standard deviations between 0.05 % and
/// 8 % of the image's width, one in ten a needle of up to 1 : 100. Opacities from below 1/255 to 0.999.
pub fn random_scene(seed: u64, count: usize, supplement: usize, sh_degree: u32) -> Scene {
    let sh_degree = sh_degree.min(BETAS);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let base = gaussians(&mut rng, count, sh_degree);
    let supplement = (supplement > 0).then(|| {
        let gaussians = gaussians(&mut rng, supplement, sh_degree);
        let lobes = lobes(&mut rng, &gaussians.means);
        Supplement { gaussians, lobes }
    });
    Scene { base, supplement, ..Default::default() }
}

/// [`random_scene`] of `gaussians` Gaussians, a share of them with lobes. More Gaussians are smaller, so that
/// the number in a pixel stays the same. They cover the image `overlap` times as often as 2,000 of the usual
/// size do.
pub fn covering_scene(gaussians: usize, lobes: f64, overlap: f64, sh_degree: u32) -> Scene {
    let lobes = (lobes.clamp(0.0, 1.0) * gaussians as f64) as usize;
    let mut scene = random_scene(1, gaussians - lobes, lobes, sh_degree);
    let shrink = (0.5 * (overlap * 2000.0 / gaussians.max(1) as f64).ln()) as f32;
    let supplement = scene.supplement.iter_mut().flat_map(|s| &mut s.gaussians.log_scales);
    scene.base.log_scales.iter_mut().chain(supplement).flatten().for_each(|s| *s += shrink);
    scene
}

fn gaussians(rng: &mut ChaCha8Rng, count: usize, sh_degree: u32) -> Gaussians {
    // The pose is the same for every size.
    let camera = random_camera(1, 1);
    let mut out = Gaussians { sh_degree, ..Default::default() };
    for _ in 0..count {
        let depth = rng.random_range(0.4f64.ln()..12f64.ln()).exp();
        let z = if rng.random_bool(0.05) { -depth } else { depth };
        let spread = if rng.random_bool(0.2) { 2.0 } else { 1.0 };
        let tangent = FRAC_TAN * spread;
        let p = DVec3::new(rng.random_range(-tangent..tangent) * depth, rng.random_range(-tangent..tangent) * depth, z);
        let mean = camera.rotation.transpose() * (p - camera.translation);
        out.means.push([mean.x as f32, mean.y as f32, mean.z as f32]);

        // Standard deviations as a share of the image's width at that depth.
        let width = 2.0 * FRAC_TAN * depth;
        let needle = rng.random_bool(0.1);
        out.log_scales.push(std::array::from_fn(|axis| {
            let share: f64 = if needle {
                if axis == 0 { rng.random_range(0.05..0.3) } else { rng.random_range(0.003..0.005) }
            } else {
                rng.random_range(0.0005f64.ln()..0.08f64.ln()).exp()
            };
            (share * width).ln() as f32
        }));
        out.quats.push(std::array::from_fn(|_| rng.random_range(-1.0..1.0)));
        // σ(−6) = 0.0025, σ(6.9) = 0.999.
        out.opacities.push(rng.random_range(-6.0..6.9));
        // Band 0 spans colors 0.5 ± 0.5 and a little beyond, so that some channels are clamped at 0.
        out.sh.push(std::array::from_fn(|_| rng.random_range(-2.0..2.0)));
        for k in 1..out.sh_coefficients() {
            // Shapes of betas' lobes, θ, φ and b: from a cosine to some degrees.
            let ranges = match sh_degree == BETAS && k % 2 == 0 {
                true => [0.0..PI, 0.0..TAU, -1.3..3.0],
                false => [-0.2..0.2, -0.2..0.2, -0.2..0.2],
            };
            out.sh.push(ranges.map(|range| rng.random_range(range)));
        }
    }
    out
}

fn lobes(rng: &mut ChaCha8Rng, means: &[[f32; 3]]) -> Lobes {
    let eye = random_camera(1, 1).eye();
    let mut out = Lobes::default();
    for mean in means {
        // Around the direction to the eye, up to far outside the support.
        let to_eye = (eye - DVec3::from_array(mean.map(f64::from))).normalize();
        let deviation = rng.random_range(0.0..1.0);
        let random: [f64; 3] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
        let direction = (to_eye + deviation * DVec3::from_array(random)) * rng.random_range(0.5..2.0);
        out.directions.push([direction.x as f32, direction.y as f32, direction.z as f32]);
        out.widths.push(rng.random_range(0.05..1.0));
        out.sharpness.push(rng.random_range(-1.5..1.5));
    }
    out
}
