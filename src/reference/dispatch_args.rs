//! Twin of `dispatch_args.comp`: turns a count into an indirect dispatch.

/// Workgroups in one dimension that every Vulkan device supports.
const GROUPS_PER_DIMENSION: u32 = 65535;

/// Returns the count clamped to `capacity`, the number needed if that was more, and the workgroups (x, y, z)
/// to dispatch.
pub fn dispatch_args(count: u32, capacity: u32, items_per_group: u32) -> (u32, Option<u32>, [u32; 3]) {
    let overflow = (count > capacity).then_some(count);
    let count = count.min(capacity);
    let groups = count.div_ceil(items_per_group.max(1)).max(1);
    let rows = groups.div_ceil(GROUPS_PER_DIMENSION);
    (count, overflow, [groups.div_ceil(rows), rows, 1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dispatch_covers_the_items_within_the_limits() {
        for (count, items) in
            [(0, 64), (1, 64), (64, 64), (65, 64), (65535 * 64, 64), (65535 * 64 + 1, 64), (1 << 30, 32)]
        {
            let (_, overflow, [x, y, z]) = dispatch_args(count, u32::MAX, items);
            assert_eq!((overflow, z), (None, 1));
            assert!(x <= GROUPS_PER_DIMENSION && y <= GROUPS_PER_DIMENSION);
            let covered = u64::from(x) * u64::from(y) * u64::from(items);
            assert!(covered >= u64::from(count) && covered < u64::from(count) + u64::from(items * (y + 1)));
        }
    }

    #[test]
    fn a_count_beyond_the_capacity_is_cut_and_told() {
        assert_eq!(dispatch_args(1000, 256, 64), (256, Some(1000), [4, 1, 1]));
        assert_eq!(dispatch_args(256, 256, 64), (256, None, [4, 1, 1]));
    }
}
