/// Bits of VkSubgroupFeatureFlagBits.
pub const SUBGROUP_OPERATIONS: u32 = 31;
/// Storage buffers of the kernel that binds most.
pub const STORAGE_BUFFERS: u32 = 16;
/// Bytes of push constants of the kernel that has most.
pub const PUSH_BYTES: u32 = 92;
