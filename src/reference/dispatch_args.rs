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
