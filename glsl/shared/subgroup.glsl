// Subgroup operations: the device's own, or a software version that gives tests subgroups of 32 and 64 lanes
// on a device with smaller ones.
#ifndef SOFTWARE_SUBGROUPS
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_vote : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_shuffle : require
#else
// Defines the same names with the same meanings, through shared memory and workgroup barriers. So every
// thread of the workgroup must reach each operation equally often, which `Reconvergence::OneSubgroup`
// requires of kernels too. A kernel whose subgroups work independently has one subgroup in its workgroup;
// other kernels call the operations in uniform control flow of the workgroup.
// glsl/generate.rs replaces `gl_` by `software_` in the names of subgroup built-ins, which can be neither
// defined nor declared.
//
// llvmpipe silently ends a kernel's loops after 65,535 iterations of all its loops together, after which
// lanes no longer meet at barriers. So operations called in loops over tiles contain only loops that compile
// to straight code, and scans go through LOOK lanes a round.

layout(constant_id = 100) const uint software_SubgroupSize = 32;
#define software_SubgroupID (gl_LocalInvocationIndex / software_SubgroupSize)
#define software_NumSubgroups (gl_WorkGroupSize.x / software_SubgroupSize)
#define software_SubgroupInvocationID (gl_LocalInvocationIndex % software_SubgroupSize)
#define software_SubgroupLtMask (software_mask(software_SubgroupInvocationID))
#define software_SubgroupGtMask (~software_mask(software_SubgroupInvocationID + 1))

#define subgroupBarrier software_barrier
#define subgroupMemoryBarrier memoryBarrier
#define subgroupElect software_elect
#define subgroupBallotFindLSB software_ballotFindLSB
#define subgroupBallotBitCount software_ballotBitCount
#define subgroupBallotExclusiveBitCount software_ballotExclusiveBitCount
#define subgroupBallot software_ballot
#define subgroupAny software_any
#define subgroupAll software_all
#define subgroupShuffle software_shuffle
#define subgroupBroadcast software_broadcast
#define subgroupAdd software_add
#define subgroupInclusiveAdd software_inclusiveAdd
#define subgroupExclusiveAdd software_exclusiveAdd
#define subgroupMin software_min
#define subgroupMax software_max

const uint LOOK = 8;
// Two halves used in turn: a lane that writes one half knows that all have read its previous content, since
// all met after that.
shared uvec4 software_words[2 * gl_WorkGroupSize.x];
uint software_turn = 0;

// Writes a value of each lane for the others to read.
void software_show(uvec4 value) {
    software_turn = gl_WorkGroupSize.x - software_turn;
    software_words[software_turn + gl_LocalInvocationIndex] = value;
    barrier();
}

uvec4 software_seen(uint lane) {
    return software_words[software_turn + software_SubgroupID * software_SubgroupSize + lane % software_SubgroupSize];
}

// The bits of the lanes below `lane`.
uvec4 software_mask(uint lane) {
    uvec2 bits = uvec2(lane < 32 ? (1u << lane) - 1 : 0xFFFFFFFFu, lane < 32 ? 0 : lane < 64 ? (1u << (lane - 32)) - 1 : 0xFFFFFFFFu);
    return uvec4(bits, 0, 0);
}

// Conversion to and from words.
uvec4 software_put(uvec4 x) { return x; }
uvec4 software_put(uint x) { return uvec4(x, 0, 0, 0); }
uvec4 software_put(int x) { return uvec4(uint(x), 0, 0, 0); }
uvec4 software_put(float x) { return uvec4(floatBitsToUint(x), 0, 0, 0); }
uvec4 software_put(vec2 x) { return uvec4(floatBitsToUint(x), 0, 0); }
uvec4 software_put(vec3 x) { return uvec4(floatBitsToUint(x), 0); }
uvec4 software_put(vec4 x) { return floatBitsToUint(x); }
uvec4 software_get(uvec4 like, uvec4 words) { return words; }
uint software_get(uint like, uvec4 words) { return words.x; }
int software_get(int like, uvec4 words) { return int(words.x); }
float software_get(float like, uvec4 words) { return uintBitsToFloat(words.x); }
vec2 software_get(vec2 like, uvec4 words) { return uintBitsToFloat(words.xy); }
vec3 software_get(vec3 like, uvec4 words) { return uintBitsToFloat(words.xyz); }
vec4 software_get(vec4 like, uvec4 words) { return uintBitsToFloat(words); }

void software_barrier() {
    memoryBarrierBuffer();
    barrier();
}

bool software_elect() { return software_SubgroupInvocationID == 0; }

uint software_ballotFindLSB(uvec4 bits) { return bits.x != 0 ? findLSB(bits.x) : 32 + findLSB(bits.y); }
uint software_ballotBitCount(uvec4 bits) { return bitCount(bits.x) + bitCount(bits.y); }
uint software_ballotExclusiveBitCount(uvec4 bits) { return software_ballotBitCount(bits & software_SubgroupLtMask); }

#define SOFTWARE_SHUFFLE(T) \
    T software_shuffle(T value, uint lane) { \
        software_show(software_put(value)); \
        return software_get(value, software_seen(lane)); \
    } \
    T software_broadcast(T value, uint lane) { return software_shuffle(value, lane); }
SOFTWARE_SHUFFLE(uint)
SOFTWARE_SHUFFLE(int)
SOFTWARE_SHUFFLE(float)
SOFTWARE_SHUFFLE(vec2)
SOFTWARE_SHUFFLE(vec3)
SOFTWARE_SHUFFLE(vec4)

// Reduces over all lanes: groups of four neighbours, then four such groups, then four of those. Every lane
// combines the same values in the same order.
#define SOFTWARE_REDUCE(NAME, T, COMBINE) \
    T NAME(T value) { \
        T sum = value; \
        [[unroll]] for (uint step = 1; step < 64; step *= 4) { \
            if (step < software_SubgroupSize) { \
                software_show(software_put(sum)); \
                uint first = software_SubgroupInvocationID & ~(3 * step); \
                sum = software_get(value, software_seen(first)); \
                [[unroll]] for (uint k = 1; k < 4; ++k) { \
                    T other = software_get(value, software_seen(first + k * step)); \
                    if (first + k * step < software_SubgroupSize) sum = COMBINE; \
                } \
            } \
        } \
        return sum; \
    }
SOFTWARE_REDUCE(software_add, uint, sum + other)
SOFTWARE_REDUCE(software_add, float, sum + other)
SOFTWARE_REDUCE(software_add, vec2, sum + other)
SOFTWARE_REDUCE(software_add, vec3, sum + other)
SOFTWARE_REDUCE(software_add, vec4, sum + other)
SOFTWARE_REDUCE(software_min, uint, min(sum, other))
SOFTWARE_REDUCE(software_min, float, min(sum, other))
SOFTWARE_REDUCE(software_min, vec3, min(sum, other))
SOFTWARE_REDUCE(software_max, uint, max(sum, other))
SOFTWARE_REDUCE(software_max, float, max(sum, other))
SOFTWARE_REDUCE(software_max, vec3, max(sum, other))
SOFTWARE_REDUCE(software_or, uvec4, sum | other)

// Sums over the lanes for which `IF` holds.
#define SOFTWARE_SCAN(NAME, IF) \
    uint NAME(uint value) { \
        software_show(software_put(value)); \
        uint sum = 0; \
        for (uint first = 0; first < software_SubgroupSize; first += LOOK) { \
            [[unroll]] for (uint k = 0; k < LOOK; ++k) { \
                uint lane = first + k; \
                uint other = software_seen(lane).x; \
                if (IF) sum += other; \
            } \
        } \
        return sum; \
    }
SOFTWARE_SCAN(software_inclusiveAdd, lane <= software_SubgroupInvocationID)
SOFTWARE_SCAN(software_exclusiveAdd, lane < software_SubgroupInvocationID)

uvec4 software_ballot(bool value) {
    uint lane = software_SubgroupInvocationID, bit = uint(value) << lane % 32;
    return software_or(lane < 32 ? uvec4(bit, 0, 0, 0) : uvec4(0, bit, 0, 0));
}

bool software_any(bool value) { return software_ballot(value).xy != uvec2(0); }
bool software_all(bool value) { return !software_any(!value); }
#endif
