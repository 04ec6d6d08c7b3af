// Indirect dispatches made on the device: VkDispatchIndirectCommand, three words each.
const uint GROUPS_PER_DIMENSION = 65535; // smallest maxComputeWorkGroupCount that Vulkan allows

// Workgroups for `items`, folded into two dimensions. At least one: a kernel that also writes a total must do
// so for a count of 0. Spread over the rows evenly: fewer than `rows` workgroups are beyond the end.
uvec3 groups_for(uint items, uint per_group) {
    per_group = max(1u, per_group);
    uint groups = max(1u, items / per_group + uint(items % per_group != 0)); // guard: one workgroup for nothing
    uint rows = (groups - 1) / GROUPS_PER_DIMENSION + 1; // guard: folded dispatches
    return uvec3((groups - 1) / rows + 1, rows, 1);
}
