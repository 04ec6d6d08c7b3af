//! Twin of `density_plan.comp`: the new number of Gaussians.

/// State before a refinement, and the requested size; see `glsl/density/density_plan.comp`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Plan {
    /// Gaussians before.
    pub old: u32,
    /// Gaussians that stay.
    pub alive: u32,
    /// Gaussians that can be drawn.
    pub candidates: u32,
    /// Maximum number of Gaussians.
    pub capacity: u32,
    /// Smallest wanted number of Gaussians.
    pub target: u32,
    /// Wanted growth: an `nth` of `old`; 0: none.
    pub nth: u32,
    /// A Gaussian can be drawn more than once.
    pub replacement: bool,
    /// A step did not fit.
    pub failed: bool,
}

/// Returns the numbers of Gaussians that stay, of children drawn, and of Gaussians afterwards.
pub fn density_plan(plan: &Plan) -> [u32; 3] {
    let Plan { old, alive, candidates, capacity, target, nth, replacement, failed } = *plan;
    if failed || alive == 0 {
        return [old, 0, old];
    }
    let more = old.checked_div(nth).map_or(0, |part| old + part);
    let wanted = target.max(more).min(capacity).saturating_sub(alive);
    let drawable = match (replacement, candidates) {
        (true, 0) => 0,
        (true, _) => u32::MAX,
        (false, n) => n,
    };
    let children = wanted.min(drawable);
    [alive, children, alive + children]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_stay_within_the_cap_and_what_can_be_drawn() {
        let plan = Plan {
            old: 100,
            alive: 90,
            candidates: 7,
            capacity: 110,
            target: 0,
            nth: 20,
            replacement: true,
            failed: false,
        };
        assert_eq!(density_plan(&plan), [90, 15, 105]);
        assert_eq!(density_plan(&Plan { nth: 0, ..plan }), [90, 0, 90]);
        assert_eq!(density_plan(&Plan { replacement: false, ..plan }), [90, 7, 97]);
        assert_eq!(density_plan(&Plan { target: 1000, ..plan }), [90, 20, 110]);
        assert_eq!(density_plan(&Plan { candidates: 0, ..plan }), [90, 0, 90]);
        // Limit reached, nothing alive, nothing there, one alone, and a step that did not fit.
        assert_eq!(density_plan(&Plan { old: 110, alive: 110, ..plan }), [110, 0, 110]);
        assert_eq!(density_plan(&Plan { alive: 0, ..plan }), [100, 0, 100]);
        assert_eq!(density_plan(&Plan { old: 0, alive: 0, ..plan }), [0, 0, 0]);
        assert_eq!(density_plan(&Plan { old: 1, alive: 1, ..plan }), [1, 0, 1]);
        assert_eq!(density_plan(&Plan { failed: true, ..plan }), [100, 0, 100]);
    }
}
