/* Draws a scene over a background color from C, on its own device:
 *
 *     frame NUMBERS SCENE.ply OUT
 *
 * NUMBERS is a text file: width, height, a view matrix, a projection matrix, column-major. OUT gets float32 RGBA, rows from the top.
 * It then gets linear premultiplied RGBA, depths and ids of a frame with two instances behind a wall 3 units away.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "glint.h"

#define FAIL(...) (fprintf(stderr, __VA_ARGS__), fputc('\n', stderr), exit(1))
#define VK(call) do { VkResult r = (call); if (r != VK_SUCCESS) FAIL("%s: %d", #call, r); } while (0)
#define GLINT(call) do { if ((call) != 0) FAIL("%s: %s", #call, glint_last_error()); } while (0)

static int locked;
static void lock_queue(void *user) { ++*(int *)user; }
static void unlock_queue(void *user) { if (*(int *)user < 1) FAIL("unlocked before it was locked"); }

static VkCommandBuffer begin(VkDevice device, VkCommandPool pool) {
    VkCommandBufferAllocateInfo info = { VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO };
    info.commandPool = pool;
    info.commandBufferCount = 1;
    VkCommandBuffer commands;
    VK(vkAllocateCommandBuffers(device, &info, &commands));
    VkCommandBufferBeginInfo start = { VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO };
    VK(vkBeginCommandBuffer(commands, &start));
    return commands;
}

static void run(VkQueue queue, VkCommandBuffer commands) {
    VK(vkEndCommandBuffer(commands));
    VkSubmitInfo submit = { VK_STRUCTURE_TYPE_SUBMIT_INFO };
    submit.commandBufferCount = 1;
    submit.pCommandBuffers = &commands;
    VK(vkQueueSubmit(queue, 1, &submit, VK_NULL_HANDLE));
    VK(vkQueueWaitIdle(queue));
}

static uint32_t memory_type(VkPhysicalDevice physical, uint32_t bits, VkMemoryPropertyFlags flags) {
    VkPhysicalDeviceMemoryProperties types;
    vkGetPhysicalDeviceMemoryProperties(physical, &types);
    for (uint32_t i = 0; i < types.memoryTypeCount; ++i)
        if (bits >> i & 1 && (types.memoryTypes[i].propertyFlags & flags) == flags) return i;
    FAIL("no memory of flags %u", flags);
    return 0;
}

static const VkFormat FORMATS[4] = { VK_FORMAT_R32G32B32A32_SFLOAT, VK_FORMAT_R32_SFLOAT, VK_FORMAT_R32_UINT, VK_FORMAT_D32_SFLOAT };

static void transition(VkCommandBuffer commands, const VkImage images[4], VkImageLayout from) {
    VkImageMemoryBarrier barriers[4];
    memset(barriers, 0, sizeof barriers);
    for (int i = 0; i < 4; ++i) {
        barriers[i].sType = VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER;
        barriers[i].srcAccessMask = GLINT_SYNC_WRITTEN_ACCESS;
        barriers[i].dstAccessMask = GLINT_SYNC_READ_ACCESS | GLINT_SYNC_WRITTEN_ACCESS;
        barriers[i].oldLayout = from;
        barriers[i].newLayout = VK_IMAGE_LAYOUT_GENERAL;
        barriers[i].image = images[i];
        barriers[i].subresourceRange = (VkImageSubresourceRange) { i == 3 ? VK_IMAGE_ASPECT_DEPTH_BIT : VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1 };
    }
    vkCmdPipelineBarrier(commands, GLINT_SYNC_WRITTEN_STAGE, GLINT_SYNC_READ_STAGE | GLINT_SYNC_WRITTEN_STAGE, 0, 0, NULL, 0, NULL, 4, barriers);
}

/* Makes a scene from arrays: a base of one Gaussian, a supplement of one. */
static void arrays(void) {
    float mean[3] = { 0, 0, 4 }, scale[3] = { -2, -2, -2 }, rotation[4] = { 1, 0, 0, 0 }, opacity = 2, color[3] = { 1, 0, 0 };
    float direction[3] = { 0, 0, -1 }, lobe[2] = { 0.5f, 1 };
    glint_gaussians base = { sizeof base, 1, 0, 0, mean, scale, rotation, &opacity, color, NULL, NULL, NULL }, supplement = base;
    supplement.lobe_directions = direction;
    supplement.lobe_widths = &lobe[0];
    supplement.lobe_sharpness = &lobe[1];
    glint_scene *scene;
    glint_scene_counts counts = { sizeof counts };
    GLINT(glint_scene_from_arrays(&base, &supplement, &scene));
    GLINT(glint_scene_info(scene, &counts));
    if (counts.base != 1 || counts.supplement != 1 || counts.sh_degree != 0) FAIL("%u + %u Gaussians", counts.base, counts.supplement);
    glint_scene_destroy(scene);
    if (glint_scene_from_arrays(&base, &base, &scene) != 2 || !strstr(glint_last_error(), "lobe_directions")) FAIL("no lobes");
    opacity = 0.0f / 0.0f;
    if (glint_scene_from_arrays(&base, NULL, &scene) != 2 || !strstr(glint_last_error(), "opacity")) FAIL("an opacity that is NaN");
    base.sh = NULL;
    if (glint_scene_from_arrays(&base, NULL, &scene) != 2 || !strstr(glint_last_error(), "sh of 1")) FAIL("no colors");
    base.sh_degree = 5;
    if (glint_scene_from_arrays(&base, NULL, &scene) != 2 || !strstr(glint_last_error(), "degree 5")) FAIL("degree 5");
}

int main(int argc, char **argv) {
    if (argc != 4) FAIL("frame NUMBERS SCENE.ply OUT");
    if (glint_version() != GLINT_VERSION) FAIL("header %d, library %u", GLINT_VERSION, glint_version());
    double numbers[34];
    FILE *in = fopen(argv[1], "r");
    for (int i = 0; i < 34; ++i) if (!in || fscanf(in, "%lf", &numbers[i]) != 1) FAIL("%s: number %d is missing", argv[1], i);
    fclose(in);
    uint32_t width = (uint32_t)numbers[0], height = (uint32_t)numbers[1];

    /* A device that meets glint's requirements. */
    VkApplicationInfo app = { VK_STRUCTURE_TYPE_APPLICATION_INFO };
    app.apiVersion = VK_API_VERSION_1_2;
    VkInstanceCreateInfo instance_info = { VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO };
    instance_info.pApplicationInfo = &app;
    VkInstance instance;
    VK(vkCreateInstance(&instance_info, NULL, &instance));
    VkPhysicalDevice physical;
    uint32_t optional;
    if (glint_device_choose(vkGetInstanceProcAddr, instance, "a device of no such name", &physical, &optional) != 1) FAIL("no such device");
    GLINT(glint_device_choose(vkGetInstanceProcAddr, instance, NULL, &physical, &optional));
    glint_requirements required = { sizeof required };
    GLINT(glint_required(&required));
    VkPhysicalDeviceProperties properties;
    vkGetPhysicalDeviceProperties(physical, &properties);
    if (properties.apiVersion < required.api_version || required.least_lanes != 8 || required.most_lanes != 64) FAIL("requirements");
    uint32_t features_seen = 0;
    for (const char *name; (name = glint_required_feature(features_seen)); ++features_seen)
        if (!name[0]) FAIL("feature %u has no name", features_seen);
    if (features_seen < 4 || strcmp(glint_required_feature(0), "scalarBlockLayout")) FAIL("%u features", features_seen);
    uint32_t limits_seen = 0, least;
    for (const char *name; (name = glint_required_limit(limits_seen, &least)); ++limits_seen)
        if (!strcmp(name, "maxPerStageDescriptorStorageBuffers") &&
            (least == 0 || least > properties.limits.maxPerStageDescriptorStorageBuffers)) FAIL("%s: %u", name, least);
    if (limits_seen < 4) FAIL("%u limits", limits_seen);
    const char *extensions[16];
    uint32_t extension_count = 0;
    for (const char *name; extension_count < 16 && (name = glint_required_extension(extension_count));)
        extensions[extension_count++] = name;
    const char *extension;
    for (uint32_t k = 0; glint_optional_feature(k, &extension); ++k)
        if (optional >> k & 1 && extension && extension_count < 16) extensions[extension_count++] = extension;
    /* Plans need no device. */
    glint_physical *told;
    if (glint_describe(vkGetInstanceProcAddr, instance, NULL, &told) != 2) FAIL("a physical device that is null");
    GLINT(glint_describe(vkGetInstanceProcAddr, instance, physical, &told));
    float priority = 1.0f;
    VkDeviceQueueCreateInfo queue_info = { VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO };
    queue_info.queueCount = 1; /* of family 0, which supports compute on every driver */
    queue_info.pQueuePriorities = &priority;
    VkDeviceCreateInfo device_info = { VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO };
    device_info.pNext = glint_feature_chain(optional);
    device_info.queueCreateInfoCount = 1;
    device_info.pQueueCreateInfos = &queue_info;
    device_info.enabledExtensionCount = extension_count;
    device_info.ppEnabledExtensionNames = extensions;
    VkDevice device;
    VK(vkCreateDevice(physical, &device_info, NULL, &device));
    VkQueue queue;
    vkGetDeviceQueue(device, 0, 0, &queue);
    VkCommandPoolCreateInfo pool_info = { VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO };
    VkCommandPool pool;
    VK(vkCreateCommandPool(device, &pool_info, NULL, &pool));

    /* The frame's target: a mapped buffer. */
    VkDeviceSize pixel_count = (VkDeviceSize)width * height, bytes = (16 + 16 + 4 + 4) * pixel_count;
    VkBufferCreateInfo buffer_info = { VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO };
    buffer_info.size = bytes;
    buffer_info.usage = VK_BUFFER_USAGE_TRANSFER_DST_BIT;
    VkBuffer buffer;
    VK(vkCreateBuffer(device, &buffer_info, NULL, &buffer));
    VkMemoryRequirements needs;
    vkGetBufferMemoryRequirements(device, buffer, &needs);
    VkMemoryAllocateInfo memory_info = { VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO };
    memory_info.allocationSize = needs.size;
    memory_info.memoryTypeIndex = memory_type(physical, needs.memoryTypeBits,
                                              VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT);
    VkDeviceMemory memory;
    VK(vkAllocateMemory(device, &memory_info, NULL, &memory));
    VK(vkBindBufferMemory(device, buffer, memory, 0));
    /* Images for colors, depths and ids, and for the depths of a wall. */
    VkImage images[4];
    VkDeviceMemory image_memory[4];
    for (int i = 0; i < 4; ++i) {
        VkImageCreateInfo image_info = { VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO };
        image_info.imageType = VK_IMAGE_TYPE_2D;
        image_info.format = FORMATS[i];
        image_info.extent = (VkExtent3D) { width, height, 1 };
        image_info.mipLevels = image_info.arrayLayers = 1;
        image_info.samples = VK_SAMPLE_COUNT_1_BIT;
        image_info.usage = VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT;
        VK(vkCreateImage(device, &image_info, NULL, &images[i]));
        vkGetImageMemoryRequirements(device, images[i], &needs);
        memory_info.allocationSize = needs.size;
        memory_info.memoryTypeIndex = memory_type(physical, needs.memoryTypeBits, 0);
        VK(vkAllocateMemory(device, &memory_info, NULL, &image_memory[i]));
        VK(vkBindImageMemory(device, images[i], image_memory[i], 0));
    }

    /* glint */
    glint_device lent = { sizeof lent };
    lent.get_instance_proc_addr = vkGetInstanceProcAddr;
    lent.instance = instance;
    lent.physical_device = physical;
    lent.device = device;
    lent.queue = queue;
    lent.lock_queue = lock_queue;
    lent.unlock_queue = unlock_queue;
    lent.user = &locked;
    lent.optional = optional;
    glint_context *context;
    GLINT(glint_context_create(&lent, &context));

    glint_scene *scene;
    if (glint_scene_read("nowhere.ply", &scene) != 2 || !strstr(glint_last_error(), "nowhere.ply")) FAIL("a scene from nowhere");
    if (glint_scene_parse((const uint8_t *)"ply\n", 4, "four bytes", &scene) != 2) FAIL("a scene of four bytes");
    if (glint_context_create(NULL, &context) != 2) FAIL("a device that is null");
    glint_device nothing[3] = { lent, lent, lent };
    nothing[0].physical_device = NULL;
    nothing[1].device = NULL;
    nothing[2].queue = NULL;
    glint_context *none = NULL;
    for (int i = 0; i < 3; ++i)
        if (glint_context_create(&nothing[i], &none) != 2 || none || !strstr(glint_last_error(), "is null")) FAIL("null handle %d", i);
    GLINT(glint_scene_read(argv[2], &scene));
    glint_scene_counts counts = { sizeof counts };
    GLINT(glint_scene_info(scene, &counts));
    uint32_t dropped = 7;
    glint_scene *same;
    glint_scene_counts twice = { sizeof twice };
    GLINT(glint_scene_read_lenient(argv[2], &same, &dropped));
    GLINT(glint_scene_info(same, &twice));
    if (dropped != 0 || memcmp(&counts, &twice, sizeof counts)) FAIL("%u Gaussians dropped of a scene that is sound", dropped);
    glint_scene_destroy(same);
    arrays();
    /* Its memory is known before it is made. */
    glint_limits limits = { sizeof limits }, early = { sizeof early };
    GLINT(glint_limits_for(scene, 0, width, height, &early));
    uint64_t planned = glint_upload_bytes(told, scene, 0), staged = glint_upload_staging_bytes(told, scene, 0);
    if (staged < planned / 2 || staged > planned + 4096) FAIL("%llu bytes are staged", (unsigned long long)staged);
    early.views = early.instances = 1u << 31;
    if (glint_frames_bytes(told, &early) != 0 || !strstr(glint_last_error(), "too many")) FAIL("limits that cannot be counted");
    early.views = early.instances = 1;
    early.degrees |= 1 << 9;
    if (glint_frames_bytes(told, &early) != 0 || !strstr(glint_last_error(), "degrees")) FAIL("harmonics of degree 9");
    early.degrees &= ~(1u << 9);
    glint_memory before = { sizeof before }, memory_used = { sizeof memory_used };
    GLINT(glint_context_memory(context, &before));
    glint_upload *upload;
    GLINT(glint_upload_create(context, scene, NULL, 0, &upload));
    glint_model *model;
    if (glint_upload_finish(upload, &model) != 2 || !strstr(glint_last_error(), "not recorded")) FAIL("an upload that was not recorded");
    VkCommandBuffer commands = begin(device, pool);
    if (glint_upload_record(upload, NULL) != 2 || !strstr(glint_last_error(), "null")) FAIL("no command buffer");
    GLINT(glint_upload_record(upload, commands));
    run(queue, commands);
    GLINT(glint_upload_finish(upload, &model));

    GLINT(glint_context_memory(context, &memory_used));
    uint64_t taken = memory_used.used - before.used;
    if (taken < planned || taken > planned + 4096 || memory_used.used > memory_used.budget || memory_used.taken < memory_used.used)
        FAIL("%llu bytes", (unsigned long long)taken);
    glint_model_counts here = { sizeof here };
    GLINT(glint_model_info(model, &here));
    if (here.base != counts.base || here.supplement != counts.supplement || here.capacity != counts.base + counts.supplement || here.half)
        FAIL("the model has %u + %u Gaussians", here.base, here.supplement);
    GLINT(glint_limits_of(model, width, height, &limits));
    if (memcmp(&limits, &early, sizeof limits)) FAIL("limits of the model are not those of its scene");
    limits.size = 4;
    if (glint_limits_of(model, width, height, &limits) != 2 || !strstr(glint_last_error(), "size")) FAIL("limits of 4 bytes");
    limits.size = sizeof limits;
    limits.intersection_bytes = 2 << 20;
    limits.texel = GLINT_RGBA32F;
    limits.timings = 1;
    glint_frames *frames;
    GLINT(glint_frames_create(context, &limits, &frames));
    if (glint_frames_capacity(frames) < 50000 || glint_frames_capacity(frames) > 200000) FAIL("%u intersections", glint_frames_capacity(frames));

    glint_view view;
    memset(&view, 0, sizeof view);
    view.size = sizeof view;
    memcpy(view.view, numbers + 2, sizeof view.view);
    memcpy(view.projection, numbers + 18, sizeof view.projection);
    view.width = width;
    view.height = height;
    view.near_plane = 0; /* the projection's */
    view.color.buffer = buffer;
    view.texel = GLINT_RGBA32F;
    view.exposure = 1.0f;
    view.background[0] = 0.5f;
    view.background[1] = 0.25f;
    view.background[2] = 0.75f;
    glint_instance instances[2] = { { sizeof instances[0], counts.sh_degree, 0, 0, model, { 0, 0, 0, 1 }, { 0, 0, 0 }, 1.0 } };
    glint_frame frame = { sizeof frame, 0, 1, 1, instances, &view };
    commands = begin(device, pool);
    /* An invalid frame is refused and records nothing. */
    frame.slot = 7;
    if (glint_frames_record(frames, commands, &frame) != 2 || !strstr(glint_last_error(), "slots")) FAIL("slot 7");
    frame.slot = 0;
    instances[0].scale = 0;
    if (glint_frames_record(frames, commands, &frame) != 2) FAIL("a scale of 0");
    instances[0].scale = 1;
    frame.instances = NULL;
    if (glint_frames_record(frames, commands, &frame) != 2) FAIL("instances that are null");
    frame.instances = instances;
    view.size = 0;
    if (glint_frames_record(frames, commands, &frame) != 2) FAIL("a view of no size");
    view.size = sizeof view;
    if (glint_frames_record(frames, NULL, &frame) != 2 || !strstr(glint_last_error(), "null")) FAIL("no command buffer");
    glint_report report = { sizeof report };
    if (glint_frames_report(frames, 0, &report) != 2) FAIL("a report of nothing");
    GLINT(glint_frames_record(frames, commands, &frame));
    VkMemoryBarrier written = { VK_STRUCTURE_TYPE_MEMORY_BARRIER };
    written.srcAccessMask = GLINT_SYNC_WRITTEN_ACCESS;
    written.dstAccessMask = VK_ACCESS_HOST_READ_BIT;
    vkCmdPipelineBarrier(commands, GLINT_SYNC_WRITTEN_STAGE, VK_PIPELINE_STAGE_HOST_BIT, 0, 1, &written, 0, NULL, 0, NULL);
    run(queue, commands);
    GLINT(glint_frames_report(frames, 0, &report));
    if (report.needed != 0 || report.visible == 0) FAIL("%u needed, %u visible", report.needed, report.visible);
    glint_stage_time times[64];
    uint32_t stages = 64, all = 0;
    GLINT(glint_frames_times(frames, 0, NULL, &all));
    GLINT(glint_frames_times(frames, 0, times, &stages));
    if (stages != all || stages > 64) FAIL("%u stages of %u", stages, all);
    for (uint32_t i = 0; i < stages; ++i)
        if (strlen(times[i].name) == 0 || !(times[i].seconds >= 0)) FAIL("stage %u has no time", i);
    if (locked != 0) FAIL("glint submitted %d times", locked);

    /* Two instances in images, behind a wall: the first try has too little room. */
    glint_limits both_limits = limits;
    both_limits.gaussians *= 2;
    both_limits.instances = 2;
    both_limits.depth_in = both_limits.depth_out = 1;
    both_limits.intersections = 500;
    both_limits.intersection_bytes = 0;
    glint_frames *both;
    GLINT(glint_frames_create(context, &both_limits, &both));
    instances[1] = instances[0];
    instances[1].translation[0] = 1.0;
    instances[1].scale = 0.5;
    memset(&view.color, 0, sizeof view.color);
    glint_pixels *pixels_of[4] = { &view.color, &view.depth_out, &view.ids, &view.depth_in };
    for (int i = 0; i < 4; ++i) {
        pixels_of[i]->image = images[i];
        pixels_of[i]->layout = VK_IMAGE_LAYOUT_GENERAL;
        pixels_of[i]->format = FORMATS[i];
    }
    view.linear = 1;
    view.blend = GLINT_PREMULTIPLIED;
    frame.instance_count = 2;
    commands = begin(device, pool);
    transition(commands, images, VK_IMAGE_LAYOUT_UNDEFINED);
    VkClearDepthStencilValue wall = { 0.2f / 3.0f, 0 };
    VkImageSubresourceRange whole = { VK_IMAGE_ASPECT_DEPTH_BIT, 0, 1, 0, 1 };
    vkCmdClearDepthStencilImage(commands, images[3], VK_IMAGE_LAYOUT_GENERAL, &wall, 1, &whole);
    transition(commands, images, VK_IMAGE_LAYOUT_GENERAL);
    GLINT(glint_frames_record(both, commands, &frame));
    run(queue, commands);
    GLINT(glint_frames_report(both, 0, &report));
    if (report.needed <= 500 || report.intersections > 500) FAIL("%u needed, %u found room", report.needed, report.intersections);
    GLINT(glint_frames_reserve(both, report.needed));
    if (glint_frames_capacity(both) < report.needed) FAIL("%u intersections", glint_frames_capacity(both));
    commands = begin(device, pool);
    transition(commands, images, VK_IMAGE_LAYOUT_GENERAL);
    GLINT(glint_frames_record(both, commands, &frame));
    transition(commands, images, VK_IMAGE_LAYOUT_GENERAL);
    VkBufferImageCopy copy;
    memset(&copy, 0, sizeof copy);
    copy.imageExtent = (VkExtent3D) { width, height, 1 };
    copy.imageSubresource = (VkImageSubresourceLayers) { VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1 };
    copy.bufferOffset = 16 * pixel_count;
    for (int i = 0; i < 3; copy.bufferOffset += (i == 0 ? 16 : 4) * pixel_count, ++i)
        vkCmdCopyImageToBuffer(commands, images[i], VK_IMAGE_LAYOUT_GENERAL, buffer, 1, &copy);
    vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_PIPELINE_STAGE_HOST_BIT, 0, 1, &written, 0, NULL, 0, NULL);
    run(queue, commands);
    GLINT(glint_frames_report(both, 0, &report));
    if (report.needed != 0) FAIL("%u needed of what was reserved", report.needed);

    void *pixels;
    VK(vkMapMemory(device, memory, 0, bytes, 0, &pixels));
    FILE *out = fopen(argv[3], "wb");
    if (!out || fwrite(pixels, 1, bytes, out) != bytes || fclose(out)) FAIL("%s: not written", argv[3]);

    /* The kernels' interfaces, and the buffers to bind. */
    glint_kernel_info kernel = { sizeof kernel };
    uint32_t kernels = 0, blends = 0, features = 0, barriers = 0;
    for (; glint_kernel(kernels, &kernel) == 0; ++kernels) {
        if (kernel.code[0] != 0x07230203 || kernel.code_bytes % 4 || kernel.binding_count == 0 || kernel.constant_count == 0)
            FAIL("kernel %u is no SPIR-V with an interface", kernels);
        if (kernel.constants[0].id != 0 || strcmp(kernel.constants[0].name, "workgroup_size")) FAIL("%s: constant 0", kernel.name);
        for (uint32_t f = 0; f < kernel.feature_count; ++f) features += !strcmp(kernel.features[f], "computeFullSubgroups");
        barriers += kernel.barriers;
        if (strcmp(kernel.name, "blend")) continue;
        for (uint32_t b = 0; b < kernel.binding_count; ++b)
            if (!strcmp(kernel.bindings[b].name, "image"))
                blends += kernel.bindings[b].access == GLINT_WRITE && kernel.bindings[b].element_bytes == 16 && kernel.push_bytes == 40 &&
                          kernel.unit == GLINT_SUBGROUP && kernel.subgroups;
    }
    if (blends != 1 || features < 10 || barriers == 0 || barriers == kernels) FAIL("the kernels are not as they were");
    glint_pipeline pipeline = { sizeof pipeline };
    uint32_t pipelines = 0, seen = 0;
    for (; glint_context_pipeline(context, pipelines, &pipeline) == 0; ++pipelines) {
        if (!pipeline.pipeline || !pipeline.layout || !pipeline.set_layout || !pipeline.constant_count) FAIL("pipeline %u", pipelines);
        seen += !strcmp(pipeline.kernel, "blend") && pipeline.constants[0][0] == 0 && pipeline.constants[0][1] > 0;
    }
    if (pipelines < 10 || seen == 0) FAIL("%u pipelines, %u that blend", pipelines, seen);
    glint_buffer held = { sizeof held };
    uint32_t buffers = 0, blended = 0;
    for (; glint_model_buffer(model, buffers, &held) == 0; ++buffers)
        if (!held.buffer || !held.bytes || !held.name[0]) FAIL("buffer %u of the model", buffers);
    for (uint32_t k = 0; glint_frames_buffer(frames, k, &held) == 0; ++k)
        blended += !strcmp(held.name, "image") && held.buffer && held.bytes == 16ull * width * height;
    if (buffers < (counts.supplement ? 9u : 6u) || blended != 1) FAIL("%u buffers, %u images", buffers, blended);
    printf("%u + %u Gaussians, %u visible, %u intersections, %u kernels, %llu bytes\n", counts.base, counts.supplement,
           report.visible, report.intersections, kernels, (unsigned long long)glint_frames_bytes(told, &limits));
    glint_physical_destroy(told);

    glint_frames_destroy(both);
    glint_frames_destroy(frames);
    glint_model_destroy(model);
    glint_scene_destroy(scene);
    glint_context_destroy(context);
    for (int i = 0; i < 4; ++i) {
        vkDestroyImage(device, images[i], NULL);
        vkFreeMemory(device, image_memory[i], NULL);
    }
    vkDestroyBuffer(device, buffer, NULL);
    vkFreeMemory(device, memory, NULL);
    vkDestroyCommandPool(device, pool, NULL);
    vkDestroyDevice(device, NULL);
    vkDestroyInstance(instance, NULL);
    return 0;
}
