//! Twin of `pursuit_claim.comp`: candidates claim the cells that they would change most; the largest gain
//! wins a cell.

use super::pursuit::{CORE, Candidate, Fit, Ground, footprint_px, lobe_factor};
use crate::stages::constants::pursuit::CELL;

/// The cells of a page that a candidate claims.
pub fn cells(ground: &Ground<'_>, c: &Candidate, fit: &Fit) -> Vec<usize> {
    let mut cells = Vec::new();
    for (v, s) in ground.sights(c) {
        if !(fit.opacity * lobe_factor(s.theta, fit.width) > 0.0) {
            continue;
        }
        let view = &ground.views[v as usize];
        let [x0, y0, x1, y1] = ground.window(v, &s, CORE * footprint_px(view, s.z, fit.sigma));
        let across = view.width.div_ceil(CELL);
        for y in y0 / CELL..=y1 / CELL {
            cells.extend(
                (x0 / CELL..=x1 / CELL).map(|x| (ground.plots[v as usize].cell_first + y * across + x) as usize),
            );
        }
    }
    cells
}

/// Claims cells for a candidate of gain `gain`, whose bits order like the number.
pub fn pursuit_claim(cells: &[usize], gain: f32, claims: &mut [u32]) {
    for &cell in cells.iter().filter(|_| gain > 0.0) {
        claims[cell] = claims[cell].max(gain.to_bits());
    }
}

/// True if the candidate lost one of its cells.
pub fn beaten(cells: &[usize], gain: f32, claims: &[u32]) -> bool {
    gain > 0.0 && cells.iter().any(|&cell| claims[cell] > gain.to_bits())
}
