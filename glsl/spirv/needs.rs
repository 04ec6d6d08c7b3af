/// Bits of VkSubgroupFeatureFlagBits.
pub const SUBGROUP_OPERATIONS: u32 = 31;
/// Of the kernel that binds most.
pub const STORAGE_BUFFERS: u32 = 16;
/// Of the kernel that takes most.
pub const PUSH_BYTES: u32 = 92;
