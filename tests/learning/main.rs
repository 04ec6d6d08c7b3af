//! Tests training and augmentation as a whole: gains, numbers of the method, invariants of each phase.

mod bands;
#[path = "../common/mod.rs"]
mod common;
mod density;
mod determinism;
mod exposure;
mod floors;
mod method;
mod photographs;
mod pursuit;
mod pursuit_edges;
mod screen;

use glint::{reference::Params, scene::Scene};

/// Every float as its bits: distinguishes 0 from −0, and NaN equals itself.
fn bits(scene: &Scene) -> Vec<u64> {
    let p = Params::from_scene(scene).unwrap();
    [p.geometry, p.sh, p.lobes].concat().into_iter().map(f64::to_bits).collect()
}
