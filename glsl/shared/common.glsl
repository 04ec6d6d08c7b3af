// The common start of every kernel: workgroup size and linear indices.
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_memory_scope_semantics : require

layout(local_size_x_id = 0) in;

#include "subgroup.glsl"
#include "constants.glsl"

// Dispatches of more than 65,535 groups are folded into two dimensions: linear group and thread index.
// guard: index of a folded group
uint group_index() { return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x; }
uint thread_index() { return group_index() * gl_WorkGroupSize.x + gl_LocalInvocationIndex; }
// Linear index of this subgroup over the whole dispatch, for kernels whose unit of work is a subgroup.
uint subgroup_index() { return group_index() * gl_NumSubgroups + gl_SubgroupID; }
