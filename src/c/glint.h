/* glint: Gaussian scenes with view-dependent opacity, drawn into a renderer's own frames. Vulkan 1.2.
 *
 * Steps:
 *   1. Find a physical device with glint_device_choose, and make a VkDevice with the extensions of glint_required_extension and the
 *      features of glint_feature_chain. (glint_required and glint_required_limit list the other requirements.)
 *   2. Lend the device to glint: glint_context_create.
 *   3. Make a glint_model: glint_scene_read, glint_upload_create, glint_upload_record into your command buffer, and glint_upload_finish
 *      after the commands have run. Any thread may do this while others draw.
 *   4. Call glint_limits_of (or glint_limits_for, before there is a model) and glint_frames_create. To know the memory of all this before
 *      there is a device, call glint_describe, then glint_upload_bytes, glint_upload_staging_bytes and glint_frames_bytes.
 *   5. In each frame, call glint_frames_record with your command buffer, outside a render pass. It does not allocate, submit or wait.
 *      After the slot's commands have run, the slot may be recorded again, and glint_frames_report returns the frame's result.
 *
 * Errors. Functions that return int32_t return 0, or 1 if the machine failed, or 2 for invalid arguments. glint_last_error returns the
 * message for the calling thread; it is valid until the next function fails in that thread, or until the thread ends. A function that
 * fails records nothing and leaves its handles unchanged. Any thread may use a handle, but only one at a time glint_frames and
 * glint_upload.
 *
 * Lifetimes. Objects made from a context keep the parts they need, so a context may be destroyed first; instance, device and loader must
 * outlive all of them. A slot keeps the buffers of its frame until it is recorded again, so a model may be destroyed while a frame shows
 * it. Destroy glint_frames only after all slots' commands have run, and glint_upload after its commands have.
 *
 * State. Recording changes the bound compute pipeline, descriptor set 0 of compute and the push constants: bind yours again afterwards.
 *
 * Queues. Frames are recorded for the queue family of the context, and follow each other on one queue. An upload may be recorded for
 * another queue that supports compute, with a semaphore between the two. If that queue is of another family, release each
 * glint_model_buffer there, and acquire it for the frames' family before the first frame. Functions that record or plan never submit.
 * The submitting thread calls lock_queue, so it must not hold the lock already.
 *
 * Sizes. A structure that begins with `size` may get more members in a later version. Set it to the sizeof of the structure before the
 * call, also if the library fills in the rest; a size from another header is an error. Set `reserved` and unused members to 0.
 * Structures without `size` will not change.
 *
 * Barriers. glint copies from and to your images and buffers. Before the recorded commands, make them available to GLINT_SYNC_READ_STAGE
 * with GLINT_SYNC_READ_ACCESS (depth_in; color too with GLINT_OVER) or GLINT_SYNC_WRITTEN_STAGE with GLINT_SYNC_WRITTEN_ACCESS (color,
 * depth_out, ids), in the stated layout. Afterwards wait for GLINT_SYNC_WRITTEN_*. Layouts do not change. glint synchronises its own
 * buffers, from frame to frame on one queue. A queue without graphics cannot copy depth images: use buffers there.
 */
#ifndef GLINT_H
#define GLINT_H

#include <stddef.h>
#include <stdint.h>
#include <vulkan/vulkan_core.h>

#ifdef __cplusplus
extern "C" {
#endif

#define GLINT_VERSION 4

/* Stage and access of glint's copies from and to your images and buffers, see Barriers. */
#define GLINT_SYNC_READ_STAGE VK_PIPELINE_STAGE_TRANSFER_BIT
#define GLINT_SYNC_READ_ACCESS VK_ACCESS_TRANSFER_READ_BIT
#define GLINT_SYNC_WRITTEN_STAGE VK_PIPELINE_STAGE_TRANSFER_BIT
#define GLINT_SYNC_WRITTEN_ACCESS VK_ACCESS_TRANSFER_WRITE_BIT

typedef struct glint_physical glint_physical;
typedef struct glint_context glint_context;
typedef struct glint_scene glint_scene;
typedef struct glint_upload glint_upload;
typedef struct glint_model glint_model;
typedef struct glint_frames glint_frames;

uint32_t glint_version(void); /* GLINT_VERSION of the library */
const char *glint_last_error(void);

/* Required device extensions, null beyond the last. Vulkan 1.3 includes VK_EXT_subgroup_size_control: no need to enable it there. */
const char *glint_required_extension(uint32_t index);
/* Required limits of the physical device: Vulkan's name and the minimum value; null beyond the last. `least` may be NULL. */
const char *glint_required_limit(uint32_t index, uint32_t *least);
/* Required features by Vulkan's names; null beyond the last. glint_feature_chain enables them. */
const char *glint_required_feature(uint32_t index);
/* Optional features (float atomics, reconvergence): Vulkan's name, and the extension to enable with it or NULL; null beyond the last.
 * Feature k is bit k of `optional` below. `extension` may be NULL. */
const char *glint_optional_feature(uint32_t index, const char **extension);
/* The required features and the optional ones of these bits: a chain that starts with VkPhysicalDeviceFeatures2, for
 * VkDeviceCreateInfo::pNext. It is never freed. */
const void *glint_feature_chain(uint32_t optional);

typedef struct glint_requirements {
    uint32_t size;
    uint32_t api_version;
    VkSubgroupFeatureFlags subgroup_operations; /* in compute */
    uint32_t least_lanes, most_lanes; /* of a subgroup: one such size can be requested, or is the only one */
} glint_requirements;

int32_t glint_required(glint_requirements *requirements);
/* Chooses a physical device that meets all requirements, a discrete GPU if there is one, and returns its optional features. `wanted` is
 * an index or a part of a name, or NULL. If there is none, the error names the missing requirements. */
int32_t glint_device_choose(PFN_vkGetInstanceProcAddr get_instance_proc_addr, VkInstance instance, const char *wanted,
                            VkPhysicalDevice *physical_device, uint32_t *optional);

/* Describes a physical device for plans of memory; needs no VkDevice. */
int32_t glint_describe(PFN_vkGetInstanceProcAddr get_instance_proc_addr, VkInstance instance, VkPhysicalDevice physical_device,
                       glint_physical **physical);
void glint_physical_destroy(glint_physical *physical);

typedef struct glint_device {
    uint32_t size; /* sizeof(glint_device) */
    uint32_t queue_family;
    PFN_vkGetInstanceProcAddr get_instance_proc_addr;
    VkInstance instance;
    VkPhysicalDevice physical_device;
    VkDevice device;
    VkQueue queue; /* supports compute */
    VkPipelineCache pipeline_cache; /* or VK_NULL_HANDLE; stays yours */
    uint64_t memory_budget; /* maximum bytes of glint's buffers; 0: the device's memory */
    void (*lock_queue)(void *user); /* called around glint's own submits (never while frames are recorded); or NULL */
    void (*unlock_queue)(void *user);
    void *user;
    uint32_t labels; /* 1: VK_EXT_debug_utils is enabled on the instance; kernels and buffers get names */
    uint32_t optional; /* the optional features that the device was made with, and their extensions */
} glint_device;

int32_t glint_context_create(const glint_device *device, glint_context **context);
void glint_context_destroy(glint_context *context);

typedef struct glint_memory {
    uint32_t size;
    uint32_t reserved;
    uint64_t used, budget; /* bytes of device memory: used by the context's buffers, and the current maximum of their total */
    uint64_t taken;        /* bytes allocated from the device: buffers of up to 4 MiB share blocks of that size; limited by the budget too */
} glint_memory;

int32_t glint_context_memory(const glint_context *context, glint_memory *memory);

/* A compute pipeline of glint, for your own commands, with the kernel's bindings as push descriptors of set 0. It lives as long as the
 * context. */
typedef struct glint_pipeline {
    uint32_t size;
    uint32_t constant_count;
    VkPipeline pipeline;
    VkPipelineLayout layout;
    VkDescriptorSetLayout set_layout;
    uint32_t constants[16][2]; /* ids and values of specialization constants */
    char kernel[32];
} glint_pipeline;

/* Pipelines that the context has made, sorted by kernel and constants: indices shift when more are made. Returns 2 beyond the last. */
int32_t glint_context_pipeline(const glint_context *context, uint32_t index, glint_pipeline *pipeline);

/* A buffer of glint, for your own commands: usage storage, indirect and transfer in both directions. It lives as long as its owner. Order
 * your reads and writes by barriers between glint's recordings. */
typedef struct glint_buffer {
    uint32_t size;
    uint32_t reserved;
    VkBuffer buffer;
    uint64_t bytes;
    char name[32]; /* as in docs/design-notes.md's table of buffers */
} glint_buffer;

/* Scenes in PLY files, base and supplement. A library made with --features formats (tools/c-library) reads all other formats too. An
 * invalid Gaussian (NaN, no rotation) is an error. `name` is for errors. */
typedef struct glint_scene_counts {
    uint32_t size;
    uint32_t base, supplement, sh_degree; /* 0 to 3, or 4: spherical betas */
} glint_scene_counts;

int32_t glint_scene_read(const char *path, glint_scene **scene);
/* Leaves out invalid Gaussians. `dropped` (or NULL) receives their number; glint_last_error then describes the first one's fault. */
int32_t glint_scene_read_lenient(const char *path, glint_scene **scene, uint32_t *dropped);
int32_t glint_scene_parse(const uint8_t *bytes, size_t len, const char *name, glint_scene **scene);

/* Gaussians in your arrays; these are copied. */
typedef struct glint_gaussians {
    uint32_t size;
    uint32_t count;
    uint32_t sh_degree; /* 0 to 3, or 4: spherical betas */
    uint32_t reserved;
    const float *means;      /* 3 each: centre, scene units */
    const float *log_scales; /* 3: natural logarithms of the standard deviations */
    const float *rotations;  /* 4: w, x, y, z, of any length but 0 */
    const float *opacities;  /* 1: logit */
    const float *sh;         /* 3 (sh_degree + 1)^2, for betas 15: red, green and blue of coefficient 0, then of coefficient 1, ... */
    const float *lobe_directions, *lobe_widths, *lobe_sharpness; /* 3, 1 (0.01 to 1), 1: for a supplement, otherwise ignored */
} glint_gaussians;

/* `supplement` may be NULL. */
int32_t glint_scene_from_arrays(const glint_gaussians *base, const glint_gaussians *supplement, glint_scene **scene);
int32_t glint_scene_info(const glint_scene *scene, glint_scene_counts *counts);
void glint_scene_destroy(glint_scene *scene);

/* `origin` (3 doubles, or NULL for the scene's own) is the origin of the device's coordinates, for scenes far from the world's origin.
 * `half` is 1 for half width: 128 bytes per Gaussian of degree 3 instead of 240, and 32 instead of 40 in the frames. */
uint64_t glint_upload_bytes(const glint_physical *physical, const glint_scene *scene, uint32_t half); /* of the model on the device */
/* Host memory until it is loaded; counts against the budget if device and host share their memory. */
uint64_t glint_upload_staging_bytes(const glint_physical *physical, const glint_scene *scene, uint32_t half);
int32_t glint_upload_create(const glint_context *context, const glint_scene *scene, const double *origin, uint32_t half,
                            glint_upload **upload);
int32_t glint_upload_record(glint_upload *upload, VkCommandBuffer commands);
/* Call after the commands have run. Consumes the upload; fails if it was not recorded. */
int32_t glint_upload_finish(glint_upload *upload, glint_model **model);
void glint_upload_destroy(glint_upload *upload);
void glint_model_destroy(glint_model *model);

/* The `ids` of a view count through a frame's instances, `capacity` for each. Within an instance the base comes first, then the
 * supplement, each in the order of its file. */
typedef struct glint_model_counts {
    uint32_t size;
    uint32_t base, supplement, capacity;
    uint32_t sh_degree;
    uint32_t half;
} glint_model_counts;

int32_t glint_model_info(const glint_model *model, glint_model_counts *counts);
/* For the base, then for the supplement, page by page: geometry, sh, lobes as far as there are any; then population, population_args,
 * segment_counts, pages. Returns 2 beyond the last. */
int32_t glint_model_buffer(const glint_model *model, uint32_t index, glint_buffer *buffer);

typedef enum glint_texel { GLINT_RGBA8 = 0, GLINT_BGRA8 = 1, GLINT_RGBA16F = 2, GLINT_RGBA32F = 3 } glint_texel;
/* Background of the Gaussians: a color; none (colors are premultiplied by alpha); the target's content. */
typedef enum glint_blend { GLINT_OPAQUE = 0, GLINT_PREMULTIPLIED = 1, GLINT_OVER = 2 } glint_blend;

typedef struct glint_limits {
    uint32_t size;
    uint32_t width, height; /* pixels of the largest view */
    uint32_t gaussians;     /* of all instances of a frame together */
    uint32_t instances;     /* at most 64 */
    uint32_t views;
    uint32_t in_flight;     /* slots, at most 64 */
    uint32_t intersections; /* of Gaussians with tiles; 0: as many as fit into `intersection_bytes` */
    uint32_t texel;         /* the widest of any target */
    uint32_t degrees;       /* bit d: harmonics of degree d are rendered; bit 4: spherical betas */
    uint32_t lobe_degrees;  /* bits for supplements; 0: no model has one */
    uint32_t half;          /* 1: models have half width */
    uint32_t depth_in;      /* 1: depths occlude Gaussians */
    uint32_t depth_out;     /* 1: enable outputs of depths and ids */
    uint32_t timings;       /* 1: every stage has timestamps, for glint_frames_times */
    uint32_t compensate;    /* 1: opacities of small Gaussians are compensated (Mip-Splatting) */
    uint64_t intersection_bytes; /* both 0: 4 for each Gaussian and 3 for each pixel */
} glint_limits;

/* Limits for one view and one instance of the whole model, with two slots. */
int32_t glint_limits_of(const glint_model *model, uint32_t width, uint32_t height, glint_limits *limits);
/* Limits for one view and one instance of the whole scene, before it is uploaded. */
int32_t glint_limits_for(const glint_scene *scene, uint32_t half, uint32_t width, uint32_t height, glint_limits *limits);
/* 0 if the limits are invalid; glint_last_error says why. */
uint64_t glint_frames_bytes(const glint_physical *physical, const glint_limits *limits);
int32_t glint_frames_create(const glint_context *context, const glint_limits *limits, glint_frames **frames);
/* Call after all slots' commands have run. */
void glint_frames_destroy(glint_frames *frames);
/* Makes room for at least this number of intersections; safe while frames are in flight. */
int32_t glint_frames_reserve(glint_frames *frames, uint32_t intersections);
uint32_t glint_frames_capacity(const glint_frames *frames); /* intersections that fit */
/* The working buffers that all slots share, then the report of each slot. glint_frames_reserve replaces those of intersections. Returns 2
 * beyond the last. */
int32_t glint_frames_buffer(const glint_frames *frames, uint32_t index, glint_buffer *buffer);

/* A rectangle of an image, or a buffer with contiguous rows. All zeroes: none. */
typedef struct glint_pixels {
    VkImage image;
    VkBuffer buffer;
    uint64_t buffer_offset;
    VkImageLayout layout;
    VkFormat format; /* of the image. color: matches the texel; depths: D32_SFLOAT, D32_SFLOAT_S8_UINT or R32_SFLOAT; ids: R32_UINT */
    uint32_t level, layer;
    int32_t offset[2];
} glint_pixels;

typedef struct glint_view {
    uint32_t size;
    uint32_t width, height;
    uint32_t texel;        /* glint_texel of color; images of an _SRGB format hold encoded values */
    double view[16];       /* world to view, columns first: rotation and translation */
    double projection[16]; /* view to Vulkan's clip space, columns first: perspective, any depth, reversed or infinite */
    double near_plane;     /* Gaussians with a centre in front of it are left out; 0: the projection's near plane */
    glint_pixels color;
    glint_pixels depth_in;  /* float32 depths by the projection that occlude Gaussians; the far value (1, or 0 if reversed) hides nothing */
    glint_pixels depth_out; /* float32 depths of the Gaussians at transmittance one half; the far plane's at most, and if there is none */
    glint_pixels ids;       /* uint32, numbers of those Gaussians, counted through all instances; 0xFFFFFFFF: none */
    uint32_t linear;        /* 1: color holds linear light, 0: sRGB-encoded values */
    uint32_t blend;         /* glint_blend */
    float exposure;         /* factor on the Gaussians' linear light, usually 1 */
    float background[3];    /* sRGB-encoded, for GLINT_OPAQUE */
} glint_view;

typedef struct glint_instance {
    uint32_t size;
    uint32_t sh_degree; /* at most the model's; for spherical betas, any value from 1 on shows all */
    uint32_t base_only; /* 1: without the supplement */
    uint32_t reserved;
    const glint_model *model;
    double rotation[4]; /* x, y, z, w */
    double translation[3];
    double scale;
} glint_instance;

typedef struct glint_frame {
    uint32_t size;
    uint32_t slot;
    uint32_t instance_count, view_count;
    const glint_instance *instances; /* blended in one common order by depth */
    const glint_view *views;         /* rendered one after the other */
} glint_frame;

typedef struct glint_report {
    uint32_t size;
    uint32_t needed;        /* required number of intersections, 0 if all fitted; otherwise farther Gaussians are missing */
    uint32_t visible;
    uint32_t intersections;
} glint_report;

int32_t glint_frames_record(glint_frames *frames, VkCommandBuffer commands, const glint_frame *frame);
/* Call after the slot's commands have run. */
int32_t glint_frames_report(const glint_frames *frames, uint32_t slot, glint_report *report);

typedef struct glint_stage_time {
    char name[32];
    double seconds;
} glint_stage_time;

/* Time of each stage of the slot's frame, in order. `times` has room for `*count` entries; `*count` receives the number of stages. With
 * `times` NULL, only the number is returned. It is 0 if timings are off or the device has no timestamps. */
int32_t glint_frames_times(const glint_frames *frames, uint32_t slot, glint_stage_time *times, uint32_t *count);

/* The kernels, for callers that make and record them themselves. All buffers are storage buffers of set 0 in scalar block layout, numbered
 * from 0; push constants begin at byte 0. Constant 0 is the workgroup size in x. One workgroup handles one item per thread, per subgroup
 * or per workgroup, according to `unit`; workgroups beyond 65,535 are folded into y. Make a kernel with subgroup operations with full
 * subgroups of one size. */
typedef enum glint_unit { GLINT_THREAD = 0, GLINT_SUBGROUP = 1, GLINT_WORKGROUP = 2 } glint_unit;
typedef enum glint_access { GLINT_READ = 1, GLINT_WRITE = 2, GLINT_READ_WRITE = 3 } glint_access;
typedef enum glint_constant_kind { GLINT_U32 = 0, GLINT_I32 = 1, GLINT_F32 = 2, GLINT_BOOL = 3 } glint_constant_kind;

typedef struct glint_binding {
    const char *name;
    uint32_t access;        /* glint_access */
    uint32_t element_bytes;
} glint_binding;

typedef struct glint_constant {
    const char *name;
    uint32_t id;
    uint32_t kind; /* glint_constant_kind, of the constant's 4 bytes */
} glint_constant;

typedef struct glint_kernel_info {
    uint32_t size;
    uint32_t unit; /* glint_unit */
    const char *name;
    const uint32_t *code; /* SPIR-V 1.5 */
    size_t code_bytes;
    const glint_binding *bindings;
    const glint_constant *constants;
    uint32_t binding_count, constant_count;
    uint32_t push_bytes;
    uint32_t subgroups; /* 1: uses subgroup operations */
    const char *const *features; /* device features that its SPIR-V needs, by Vulkan's names */
    uint32_t feature_count;
    uint32_t barriers; /* 1: uses workgroup barriers; otherwise a workgroup may be one subgroup */
} glint_kernel_info;

/* Kernel `index`; its pointers stay valid as long as the library. Returns 2 beyond the last. */
int32_t glint_kernel(uint32_t index, glint_kernel_info *kernel);

#ifdef __cplusplus
}
#endif
#endif
