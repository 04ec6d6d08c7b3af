/* glint: Gaussian scenes with view-dependent opacity, drawn into a renderer's own frames. Vulkan 1.2.
 *
 * The order of things:
 *   1. Make a VkDevice with the extensions glint_required_extension names and the features of glint_feature_chain, of a physical device
 *      that has them and what glint_required and glint_required_limit say: glint_device_choose finds one.
 *   2. glint_context_create lends it to glint.
 *   3. glint_scene_read, glint_upload_create, glint_upload_record into a command buffer of yours, glint_upload_finish when that has run:
 *      a glint_model. Any thread may do this while others draw.
 *   4. glint_limits_of (or glint_limits_for, before there is a model), glint_frames_create. What all this will take is known before there
 *      is a device: glint_describe, then glint_upload_bytes, glint_upload_staging_bytes, glint_frames_bytes.
 *   5. Each frame: glint_frames_record into a command buffer of yours, outside a render pass. It allocates, submits and waits for nothing.
 *      A slot may be recorded again when its commands have run; then glint_frames_report says how they went.
 *
 * Every function that returns int32_t gives 0, or 1 for what the machine could not do, 2 for what it was given; glint_last_error says
 * what, for the calling thread: the text stays until the next function that fails in that thread, or until the thread ends. A function
 * that fails records nothing and leaves its handles as they were. Handles may be used from any thread, glint_frames and glint_upload by
 * one at a time.
 *
 * Lifetimes. What is made of a context keeps what it needs of it, so a context may be destroyed first; instance, device and loader
 * outlive all of it. A slot keeps the buffers that its frame uses until it is recorded again, so a model may be destroyed while a frame
 * shows it; glint_frames only when all slots' commands have run, glint_upload when its commands have.
 *
 * State. What is recorded leaves another compute pipeline, descriptor set 0 of compute and push constants bound: bind yours anew.
 *
 * Queues. Frames are recorded for the queue family that was lent, and follow each other on one queue. An upload may be recorded for
 * another queue that takes compute, with a semaphore between the two; where that is of another family, release each glint_model_buffer
 * there and acquire it for the frames' family before the first frame. No function of this header submits while it records or plans.
 * lock_queue is called by the thread that submits, so that thread must not hold the lock already.
 *
 * A structure that begins with `size` may have more members in a later version. Set it to the sizeof of the structure before the call,
 * also where the library fills the rest; another header's is refused. Set what you do not use, and `reserved`, to 0. Structures without
 * `size` stay as they are.
 *
 * Barriers. glint copies from and to your images and buffers, so they must be available to GLINT_SYNC_READ_STAGE with
 * GLINT_SYNC_READ_ACCESS (depth_in; color too with GLINT_OVER) or GLINT_SYNC_WRITTEN_STAGE with GLINT_SYNC_WRITTEN_ACCESS (color,
 * depth_out, ids) before the recorded commands, in the layout that is said. Afterwards wait for GLINT_SYNC_WRITTEN_*. Layouts stay. What
 * is glint's own is glint's affair, from frame to frame on one queue. A queue without graphics copies no depth images: give buffers
 * there.
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

/* What glint does with your images and buffers, and where: see Barriers. */
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

/* Device extensions, null beyond the last; on Vulkan 1.3 VK_EXT_subgroup_size_control need not be asked for. */
const char *glint_required_extension(uint32_t index);
/* Limits that the physical device must allow: the name that Vulkan has for one, and the least value; null beyond the last. `least` may
 * be NULL. */
const char *glint_required_limit(uint32_t index, uint32_t *least);
/* Features that the device must be made with, by the names that Vulkan has for them; null beyond the last. glint_feature_chain sets them. */
const char *glint_required_feature(uint32_t index);
/* Features that glint makes use of where they are there (float atomics, reconvergence): the name that Vulkan has for one and, or NULL, the
 * extension that must be enabled with it; null beyond the last. Feature k is bit k in what follows. `extension` may be NULL. */
const char *glint_optional_feature(uint32_t index, const char **extension);
/* The required features and the optional ones of these bits: a chain that begins with VkPhysicalDeviceFeatures2, for
 * VkDeviceCreateInfo::pNext; never freed. */
const void *glint_feature_chain(uint32_t optional);

typedef struct glint_requirements {
    uint32_t size;
    uint32_t api_version;
    VkSubgroupFeatureFlags subgroup_operations; /* in compute */
    uint32_t least_lanes, most_lanes; /* of a subgroup: one such size can be asked for, or is the only one */
} glint_requirements;

int32_t glint_required(glint_requirements *requirements);
/* Of an instance the physical device that has all this, a discrete GPU if there is one, or that of this index or part of a name (`wanted`,
 * else NULL), and its optional features. Where there is none the error names what is missing. */
int32_t glint_device_choose(PFN_vkGetInstanceProcAddr get_instance_proc_addr, VkInstance instance, const char *wanted,
                            VkPhysicalDevice *physical_device, uint32_t *optional);

/* What a physical device is to glint, for plans: it is no context, and needs no device. */
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
    VkQueue queue; /* takes compute */
    VkPipelineCache pipeline_cache; /* or VK_NULL_HANDLE; stays yours */
    uint64_t memory_budget; /* bytes that glint's buffers may take; 0: what the device has */
    void (*lock_queue)(void *user); /* around glint's own submits (none while frames are recorded); or NULL */
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
    uint64_t used, budget; /* bytes of device memory that the context's buffers have, and that they may have together now */
    uint64_t taken;        /* what was taken of the device for them: buffers of up to 4 MiB share blocks of so much; within the budget too */
} glint_memory;

int32_t glint_context_memory(const glint_context *context, glint_memory *memory);

/* A pipeline of glint's, for commands of your own: of compute, with the kernel's bindings as push descriptors of set 0. It lives as long as
 * the context. */
typedef struct glint_pipeline {
    uint32_t size;
    uint32_t constant_count;
    VkPipeline pipeline;
    VkPipelineLayout layout;
    VkDescriptorSetLayout set_layout;
    uint32_t constants[16][2]; /* ids and values of those that it was made with */
    char kernel[32];
} glint_pipeline;

/* Pipelines that the context has made, by kernel and constants: others may come between them when more is made. 2 beyond the last. */
int32_t glint_context_pipeline(const glint_context *context, uint32_t index, glint_pipeline *pipeline);

/* A buffer of glint's, for commands of your own: usage storage, indirect and transfer both ways. It lives as long as what it was asked of;
 * what writes and reads it is ordered by barriers of yours between recordings of glint's. */
typedef struct glint_buffer {
    uint32_t size;
    uint32_t reserved;
    VkBuffer buffer;
    uint64_t bytes;
    char name[32]; /* as in docs/design-notes.md's table of buffers */
} glint_buffer;

/* Scenes in PLY files, base and supplement; in all that glint reads where the library was made with --features formats (tools/c-library). A
 * Gaussian that is not sound (NaN, no rotation) is an error. `name` is for errors. */
typedef struct glint_scene_counts {
    uint32_t size;
    uint32_t base, supplement, sh_degree; /* 0 to 3, or 4: spherical betas */
} glint_scene_counts;

int32_t glint_scene_read(const char *path, glint_scene **scene);
/* Leaves out what is not sound. `dropped`, or NULL, becomes the number of Gaussians that were; glint_last_error then says what was wrong
 * with the first. */
int32_t glint_scene_read_lenient(const char *path, glint_scene **scene, uint32_t *dropped);
int32_t glint_scene_parse(const uint8_t *bytes, size_t len, const char *name, glint_scene **scene);

/* Gaussians of your own; the arrays are copied. */
typedef struct glint_gaussians {
    uint32_t size;
    uint32_t count;
    uint32_t sh_degree; /* 0 to 3, or 4: spherical betas */
    uint32_t reserved;
    const float *means;      /* 3 each: centre, scene units */
    const float *log_scales; /* 3: natural logarithms of the standard deviations */
    const float *rotations;  /* 4: w, x, y, z, of any length but 0 */
    const float *opacities;  /* 1: logit */
    const float *sh;         /* 3 (sh_degree + 1)^2, of betas 15: red, green and blue of coefficient 0, then of coefficient 1, ... */
    const float *lobe_directions, *lobe_widths, *lobe_sharpness; /* 3, 1 (0.01 to 1), 1: of a supplement, else not looked at */
} glint_gaussians;

/* `supplement` or NULL. */
int32_t glint_scene_from_arrays(const glint_gaussians *base, const glint_gaussians *supplement, glint_scene **scene);
int32_t glint_scene_info(const glint_scene *scene, glint_scene_counts *counts);
void glint_scene_destroy(glint_scene *scene);

/* `origin` (3 doubles, or NULL for the scene's own) is where the device's coordinates begin: for scenes far from the world's. `half` is 1 for half
 * width, 128 bytes a Gaussian of degree 3 instead of 240, and 32 instead of 40 of the frames'. */
uint64_t glint_upload_bytes(const glint_physical *physical, const glint_scene *scene, uint32_t half); /* that the model will take */
/* That it takes of the host until it is loaded; on a device whose memory is the host's they are of the budget too. */
uint64_t glint_upload_staging_bytes(const glint_physical *physical, const glint_scene *scene, uint32_t half);
int32_t glint_upload_create(const glint_context *context, const glint_scene *scene, const double *origin, uint32_t half,
                            glint_upload **upload);
int32_t glint_upload_record(glint_upload *upload, VkCommandBuffer commands);
/* When the commands have run; the upload is gone then. What was not recorded is refused. */
int32_t glint_upload_finish(glint_upload *upload, glint_model **model);
void glint_upload_destroy(glint_upload *upload);
void glint_model_destroy(glint_model *model);

/* Numbers that a view gives out (`ids`) count through a frame's instances, `capacity` for each: within an instance the base comes first,
 * then the supplement, each as in its file. */
typedef struct glint_model_counts {
    uint32_t size;
    uint32_t base, supplement, capacity;
    uint32_t sh_degree;
    uint32_t half;
} glint_model_counts;

int32_t glint_model_info(const glint_model *model, glint_model_counts *counts);
/* Of the base, then of the supplement, page by page geometry, sh, lobes as far as there are any; then population, population_args,
 * segment_counts, pages. 2 beyond the last. */
int32_t glint_model_buffer(const glint_model *model, uint32_t index, glint_buffer *buffer);

typedef enum glint_texel { GLINT_RGBA8 = 0, GLINT_BGRA8 = 1, GLINT_RGBA16F = 2, GLINT_RGBA32F = 3 } glint_texel;
/* What lies behind the Gaussians: a background colour; nothing (colours are weighed by alpha); what the target holds. */
typedef enum glint_blend { GLINT_OPAQUE = 0, GLINT_PREMULTIPLIED = 1, GLINT_OVER = 2 } glint_blend;

typedef struct glint_limits {
    uint32_t size;
    uint32_t width, height; /* pixels of the largest view */
    uint32_t gaussians;     /* of all instances of a frame together */
    uint32_t instances;     /* at most 64 */
    uint32_t views;
    uint32_t in_flight;     /* slots, at most 64 */
    uint32_t intersections; /* of Gaussians and tiles; 0: as many as take `intersection_bytes` */
    uint32_t texel;         /* the widest of any target */
    uint32_t degrees;       /* bit d: harmonics of degree d are asked for; bit 4: spherical betas */
    uint32_t lobe_degrees;  /* the same of supplements; 0: no model has one */
    uint32_t half;          /* 1: models are of half width */
    uint32_t depth_in;      /* 1: depths hide Gaussians */
    uint32_t depth_out;     /* 1: depths and ids are asked for */
    uint32_t timings;       /* 1: every stage has timestamps, for glint_frames_times */
    uint32_t compensate;    /* 1: opacities of small Gaussians are compensated (Mip-Splatting) */
    uint64_t intersection_bytes; /* 0 too: 4 for each Gaussian and 3 for each pixel */
} glint_limits;

/* For one view, one instance, two slots, all of the model. */
int32_t glint_limits_of(const glint_model *model, uint32_t width, uint32_t height, glint_limits *limits);
/* The same for a scene, before it is uploaded. */
int32_t glint_limits_for(const glint_scene *scene, uint32_t half, uint32_t width, uint32_t height, glint_limits *limits);
/* 0 where there can be no such frames; glint_last_error says why. */
uint64_t glint_frames_bytes(const glint_physical *physical, const glint_limits *limits);
int32_t glint_frames_create(const glint_context *context, const glint_limits *limits, glint_frames **frames);
/* All slots' commands have run. */
void glint_frames_destroy(glint_frames *frames);
/* Room for at least so many intersections; safe while frames are in flight. */
int32_t glint_frames_reserve(glint_frames *frames, uint32_t intersections);
uint32_t glint_frames_capacity(const glint_frames *frames); /* intersections that fit */
/* The working buffers that all slots share, then the report of each slot; those of intersections are others after glint_frames_reserve. 2 beyond the last. */
int32_t glint_frames_buffer(const glint_frames *frames, uint32_t index, glint_buffer *buffer);

/* A rectangle of an image, or a buffer with rows that follow each other. Zeroes are nothing. */
typedef struct glint_pixels {
    VkImage image;
    VkBuffer buffer;
    uint64_t buffer_offset;
    VkImageLayout layout;
    VkFormat format; /* of the image: that of the texel, for depths D32_SFLOAT, D32_SFLOAT_S8_UINT or R32_SFLOAT, for ids R32_UINT */
    uint32_t level, layer;
    int32_t offset[2];
} glint_pixels;

typedef struct glint_view {
    uint32_t size;
    uint32_t width, height;
    uint32_t texel;        /* glint_texel of color; images with a format of the _SRGB kind hold encoded values */
    double view[16];       /* world to view, columns first: rotation and translation */
    double projection[16]; /* view to Vulkan's clip space, columns first: perspective, any depth, reversed or infinite */
    double near_plane;     /* Gaussians whose centre is not beyond are left out; 0: the projection's own */
    glint_pixels color;
    glint_pixels depth_in;  /* float32 depths of the projection: what lies behind is hidden; 1, or 0 where they are reversed, hides nothing */
    glint_pixels depth_out; /* the same of the Gaussians, where transmittance falls below one half, at most the far plane's, as where there is none */
    glint_pixels ids;       /* uint32, numbers of those Gaussians through all instances; 0xFFFFFFFF: none */
    uint32_t linear;        /* 1: color holds linear light, 0: sRGB-encoded values */
    uint32_t blend;         /* glint_blend */
    float exposure;         /* factor of the Gaussians' light, usually 1 */
    float background[3];    /* sRGB-encoded, for GLINT_OPAQUE */
} glint_view;

typedef struct glint_instance {
    uint32_t size;
    uint32_t sh_degree; /* at most the model's; of spherical betas all are shown from 1 on */
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
    const glint_instance *instances; /* in one order by depth */
    const glint_view *views;         /* one after the other */
} glint_frame;

typedef struct glint_report {
    uint32_t size;
    uint32_t needed;        /* intersections that it would have taken, 0 where all found room; else only near Gaussians are shown */
    uint32_t visible;
    uint32_t intersections;
} glint_report;

int32_t glint_frames_record(glint_frames *frames, VkCommandBuffer commands, const glint_frame *frame);
/* When the slot's commands have run. */
int32_t glint_frames_report(const glint_frames *frames, uint32_t slot, glint_report *report);

typedef struct glint_stage_time {
    char name[32];
    double seconds;
} glint_stage_time;

/* What each stage of the slot's frame took, in order. `times` has room for `*count`, which becomes the number of stages; with NULL only
 * that is told. Where timings are off or the device has no timestamps there are none. */
int32_t glint_frames_times(const glint_frames *frames, uint32_t slot, glint_stage_time *times, uint32_t *count);

/* The kernels, for whoever makes and records them on their own. All buffers are storage buffers of set 0 in scalar block layout, numbered
 * from 0; push constants begin at byte 0. Constant 0 is the threads of a workgroup, in x. One workgroup takes as many items as it has
 * threads, or subgroups, or one, as `unit` says; items beyond 65,535 workgroups are folded into y. A kernel with subgroup operations is made
 * with full subgroups of one size. */
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
    uint32_t subgroups; /* 1: it has subgroup operations */
    const char *const *features; /* that its SPIR-V needs of the device, by Vulkan's names */
    uint32_t feature_count;
    uint32_t barriers; /* 1: the threads of a workgroup meet at barriers; else a workgroup may be one subgroup */
} glint_kernel_info;

/* Kernel `index`; what it points to lives as long as the library. 2 beyond the last. */
int32_t glint_kernel(uint32_t index, glint_kernel_info *kernel);

#ifdef __cplusplus
}
#endif
#endif
