/* glint: Gaussian scenes with view-dependent opacity, drawn into a renderer's own frames. Vulkan 1.2.
 *
 * The order of things:
 *   1. Make a VkDevice with the extensions glint_required_extension names and the features of glint_required_features.
 *   2. glint_context_create lends it to glint.
 *   3. glint_scene_read, glint_upload_create, glint_upload_record into a command buffer of yours, glint_upload_finish when that has run:
 *      a glint_model. Any thread may do this while others draw.
 *   4. glint_limits_of, glint_frames_create.
 *   5. Each frame: glint_frames_record into a command buffer of yours, outside a render pass. It allocates, submits and waits for nothing.
 *      A slot may be recorded again when its commands have run; then glint_frames_report says how they went.
 *
 * Every function that returns int32_t gives 0, or 1 for what the machine could not do, 2 for what it was given; glint_last_error says
 * what, for the calling thread. A function that fails records nothing and leaves its handles as they were, but for
 * glint_upload_finish. Handles may be used from any thread, glint_frames and glint_upload by one at a time.
 *
 * Barriers. glint copies from and to your images and buffers, so they must be available to VK_PIPELINE_STAGE_TRANSFER_BIT with
 * VK_ACCESS_TRANSFER_READ_BIT (depth_in; color too with GLINT_OVER) or VK_ACCESS_TRANSFER_WRITE_BIT (color, depth_out, ids) before the
 * recorded commands, in the layout that is said. Afterwards wait for TRANSFER / TRANSFER_WRITE. Layouts stay. What is glint's own is
 * glint's affair, from frame to frame on one queue. A queue without graphics copies no depth images: give buffers there.
 */
#ifndef GLINT_H
#define GLINT_H

#include <stddef.h>
#include <stdint.h>
#include <vulkan/vulkan_core.h>

#ifdef __cplusplus
extern "C" {
#endif

#define GLINT_VERSION 1

typedef struct glint_context glint_context;
typedef struct glint_scene glint_scene;
typedef struct glint_upload glint_upload;
typedef struct glint_model glint_model;
typedef struct glint_frames glint_frames;

uint32_t glint_version(void); /* GLINT_VERSION of the library */
const char *glint_last_error(void);

/* Device extensions, null beyond the last; on Vulkan 1.3 VK_EXT_subgroup_size_control need not be asked for. */
const char *glint_required_extension(uint32_t index);
/* A chain that begins with VkPhysicalDeviceFeatures2, for VkDeviceCreateInfo::pNext; never freed. */
const void *glint_required_features(void);

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
    uint32_t reserved;
} glint_device;

int32_t glint_context_create(const glint_device *device, glint_context **context);
void glint_context_destroy(glint_context *context);

/* Scenes in PLY files, base and supplement. `name` is for errors. */
typedef struct glint_scene_counts {
    uint32_t base, supplement, sh_degree;
} glint_scene_counts;

int32_t glint_scene_read(const char *path, glint_scene **scene);
int32_t glint_scene_parse(const uint8_t *bytes, size_t len, const char *name, glint_scene **scene);
int32_t glint_scene_info(const glint_scene *scene, glint_scene_counts *counts);
void glint_scene_destroy(glint_scene *scene);

/* `origin` (3 doubles, or NULL for 0) is where the device's coordinates begin: for scenes far from the world's. `half` is 1 for harmonics
 * of half width, 140 bytes a Gaussian of degree 3 instead of 236. */
int32_t glint_upload_create(const glint_context *context, const glint_scene *scene, const double *origin, uint32_t half,
                            glint_upload **upload);
int32_t glint_upload_record(glint_upload *upload, VkCommandBuffer commands);
/* When the commands have run; the upload is gone. */
int32_t glint_upload_finish(glint_upload *upload, glint_model **model);
void glint_upload_destroy(glint_upload *upload);
void glint_model_destroy(glint_model *model);

typedef enum glint_texel { GLINT_RGBA8 = 0, GLINT_BGRA8 = 1, GLINT_RGBA16F = 2, GLINT_RGBA32F = 3 } glint_texel;
/* What lies behind the Gaussians: a background colour; nothing (colours are weighed by alpha); what the target holds. */
typedef enum glint_blend { GLINT_OPAQUE = 0, GLINT_PREMULTIPLIED = 1, GLINT_OVER = 2 } glint_blend;

typedef struct glint_limits {
    uint32_t width, height; /* pixels of the largest view */
    uint32_t gaussians;     /* of all instances of a frame together */
    uint32_t instances;     /* at most 64 */
    uint32_t views;
    uint32_t in_flight;     /* slots */
    uint32_t intersections; /* of Gaussians and tiles; 0: 4 for each Gaussian and 3 for each pixel */
    uint32_t texel;         /* the widest of any target */
    uint32_t supplement;    /* 1: some models have one */
    uint32_t degrees;       /* bit d: harmonics of degree d are asked for */
    uint32_t half;          /* 1: models are of half width */
    uint32_t depth_in;      /* 1: depths hide Gaussians */
    uint32_t depth_out;     /* 1: depths and ids are asked for */
    uint32_t timings;       /* 1: every stage has timestamps, for glint_frames_times */
    uint32_t compensate;    /* 1: opacities of small Gaussians are compensated (Mip-Splatting) */
} glint_limits;

/* For one view, one instance, two slots, all of the model. */
int32_t glint_limits_of(const glint_model *model, uint32_t width, uint32_t height, glint_limits *limits);
uint64_t glint_frames_bytes(const glint_context *context, const glint_limits *limits);
int32_t glint_frames_create(const glint_context *context, const glint_limits *limits, glint_frames **frames);
/* All slots' commands have run. */
void glint_frames_destroy(glint_frames *frames);
/* Room for at least so many intersections; safe while frames are in flight. */
int32_t glint_frames_reserve(glint_frames *frames, uint32_t intersections);

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
    double view[16];       /* world to view, columns first: rotation and translation */
    double projection[16]; /* view to Vulkan's clip space, columns first: perspective, any depth, reversed or infinite */
    uint32_t width, height;
    double near_plane;     /* Gaussians whose centre is not beyond are left out */
    glint_pixels color;
    glint_pixels depth_in;  /* float32 depths of the projection: what lies behind is hidden */
    glint_pixels depth_out; /* the same of the Gaussians, where transmittance falls below one half */
    glint_pixels ids;       /* uint32, numbers of those Gaussians through all instances; 0xFFFFFFFF: none */
    uint32_t texel;         /* glint_texel of color; images with a format of the _SRGB kind hold encoded values */
    uint32_t linear;        /* 1: color holds linear light, 0: sRGB-encoded values */
    uint32_t blend;         /* glint_blend */
    float exposure;         /* factor of the Gaussians' light, usually 1 */
    float background[3];    /* sRGB-encoded, for GLINT_OPAQUE */
    uint32_t reserved;
} glint_view;

typedef struct glint_instance {
    const glint_model *model;
    double rotation[4]; /* x, y, z, w */
    double translation[3];
    double scale;
    uint32_t sh_degree; /* at most the model's */
    uint32_t base_only; /* 1: without the supplement */
} glint_instance;

typedef struct glint_frame {
    uint32_t slot;
    uint32_t instance_count, view_count;
    uint32_t reserved;
    const glint_instance *instances; /* in one order by depth */
    const glint_view *views;         /* one after the other */
} glint_frame;

typedef struct glint_report {
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

/* Kernel `index`: its name and SPIR-V, which live as long as the library; 2 beyond the last. */
int32_t glint_kernel(uint32_t index, const char **name, const uint32_t **code, size_t *bytes);

#ifdef __cplusplus
}
#endif
#endif
