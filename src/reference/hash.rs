//! Twin of `glsl/shared/hash.glsl`: random numbers from counters.

use glam::DVec3;

/// pcg4d (Jarzynski and Olano, "Hash functions for GPU rendering", 2020).
pub fn pcg4d(counter: [u32; 4]) -> [u32; 4] {
    let mut v = counter.map(|x| x.wrapping_mul(1664525).wrapping_add(1013904223));
    for k in 0..2 {
        for (to, a, b) in [(0, 1, 3), (1, 2, 0), (2, 0, 1), (3, 1, 2)] {
            v[to] = v[to].wrapping_add(v[a].wrapping_mul(v[b]));
        }
        if k == 0 {
            v = v.map(|x| x ^ x >> 16);
        }
    }
    v
}

/// Above 0 and below 1, from the upper 23 bits.
pub fn uniform(h: u32) -> f64 {
    (f64::from(h >> 9) + 0.5) / 8388608.0
}

/// Three normal deviates (Box and Muller 1958).
pub fn normal(h: [u32; 4]) -> DVec3 {
    let u = h.map(uniform);
    let (a, b) = ((-2.0 * u[0].ln()).sqrt(), (-2.0 * u[2].ln()).sqrt());
    let (p, q) = (std::f64::consts::TAU * u[1], std::f64::consts::TAU * u[3]);
    DVec3::new(a * p.cos(), a * p.sin(), b * q.cos())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deviates_have_the_moments_of_the_normal_distribution() {
        let n = 20_000;
        let all: Vec<DVec3> = (0..n).map(|i| normal(pcg4d([i, 3, 1, 7]))).collect();
        let mean = |f: &dyn Fn(&DVec3) -> DVec3| all.iter().map(f).sum::<DVec3>() / f64::from(n);
        // A mean of n squares has a deviation of √(2/n) = 0.01, of n fourth powers √(96/n) = 0.07: five of each.
        assert!(mean(&|v| *v).abs().max_element() < 0.036);
        assert!((mean(&|v| *v * *v) - 1.0).abs().max_element() < 0.05);
        assert!((mean(&|v| *v * *v * *v * *v) - 3.0).abs().max_element() < 0.35);
        assert!(mean(&|v| DVec3::new(v.x * v.y, v.y * v.z, v.z * v.x)).abs().max_element() < 0.036);
    }

    #[test]
    fn uniform_numbers_are_within_0_and_1() {
        assert_eq!((uniform(0), uniform(u32::MAX)), (0.5 / 8388608.0, 1.0 - 0.5 / 8388608.0));
    }
}
