/* Draws a scene over a colour from C, on a device of its own:
 *
 *     frame NUMBERS SCENE.ply OUT
 *
 * NUMBERS is a text file: width, height, a view matrix, a projection matrix, columns first. OUT gets float32 RGBA, rows from the top.
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

int main(int argc, char **argv) {
    if (argc != 4) FAIL("frame NUMBERS SCENE.ply OUT");
    if (glint_version() != GLINT_VERSION) FAIL("header %d, library %u", GLINT_VERSION, glint_version());
    double numbers[34];
    FILE *in = fopen(argv[1], "r");
    for (int i = 0; i < 34; ++i) if (!in || fscanf(in, "%lf", &numbers[i]) != 1) FAIL("%s: number %d is missing", argv[1], i);
    fclose(in);
    uint32_t width = (uint32_t)numbers[0], height = (uint32_t)numbers[1];

    /* A device as glint needs it. */
    VkApplicationInfo app = { VK_STRUCTURE_TYPE_APPLICATION_INFO };
    app.apiVersion = VK_API_VERSION_1_2;
    VkInstanceCreateInfo instance_info = { VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO };
    instance_info.pApplicationInfo = &app;
    VkInstance instance;
    VK(vkCreateInstance(&instance_info, NULL, &instance));
    uint32_t count = 1;
    VkPhysicalDevice physical;
    VkResult found = vkEnumeratePhysicalDevices(instance, &count, &physical);
    if ((found != VK_SUCCESS && found != VK_INCOMPLETE) || count == 0) FAIL("no Vulkan device");
    const char *extensions[16];
    uint32_t extension_count = 0;
    for (const char *name; extension_count < 16 && (name = glint_required_extension(extension_count));)
        extensions[extension_count++] = name;
    float priority = 1.0f;
    VkDeviceQueueCreateInfo queue_info = { VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO };
    queue_info.queueCount = 1; /* of family 0, which every driver has compute in */
    queue_info.pQueuePriorities = &priority;
    VkDeviceCreateInfo device_info = { VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO };
    device_info.pNext = glint_required_features();
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

    /* The buffer that the frame goes to, mapped. */
    VkDeviceSize bytes = 16ull * width * height;
    VkBufferCreateInfo buffer_info = { VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO };
    buffer_info.size = bytes;
    buffer_info.usage = VK_BUFFER_USAGE_TRANSFER_DST_BIT;
    VkBuffer buffer;
    VK(vkCreateBuffer(device, &buffer_info, NULL, &buffer));
    VkMemoryRequirements needs;
    vkGetBufferMemoryRequirements(device, buffer, &needs);
    VkPhysicalDeviceMemoryProperties types;
    vkGetPhysicalDeviceMemoryProperties(physical, &types);
    VkMemoryPropertyFlags host = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
    VkMemoryAllocateInfo memory_info = { VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO };
    memory_info.allocationSize = needs.size;
    while (!(needs.memoryTypeBits >> memory_info.memoryTypeIndex & 1 &&
             (types.memoryTypes[memory_info.memoryTypeIndex].propertyFlags & host) == host))
        if (++memory_info.memoryTypeIndex == types.memoryTypeCount) FAIL("no host memory");
    VkDeviceMemory memory;
    VK(vkAllocateMemory(device, &memory_info, NULL, &memory));
    VK(vkBindBufferMemory(device, buffer, memory, 0));

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
    glint_context *context;
    GLINT(glint_context_create(&lent, &context));

    glint_scene *scene;
    if (glint_scene_read("nowhere.ply", &scene) != 2 || !strstr(glint_last_error(), "nowhere.ply")) FAIL("a scene from nowhere");
    if (glint_scene_parse((const uint8_t *)"ply\n", 4, "four bytes", &scene) != 2) FAIL("a scene of four bytes");
    if (glint_context_create(NULL, &context) != 2) FAIL("a device that is null");
    GLINT(glint_scene_read(argv[2], &scene));
    glint_scene_counts counts;
    GLINT(glint_scene_info(scene, &counts));
    glint_upload *upload;
    GLINT(glint_upload_create(context, scene, NULL, 0, &upload));
    VkCommandBuffer commands = begin(device, pool);
    GLINT(glint_upload_record(upload, commands));
    run(queue, commands);
    glint_model *model;
    GLINT(glint_upload_finish(upload, &model));

    glint_limits limits;
    GLINT(glint_limits_of(model, width, height, &limits));
    limits.texel = GLINT_RGBA32F;
    glint_frames *frames;
    GLINT(glint_frames_create(context, &limits, &frames));

    glint_view view;
    memset(&view, 0, sizeof view);
    memcpy(view.view, numbers + 2, sizeof view.view);
    memcpy(view.projection, numbers + 18, sizeof view.projection);
    view.width = width;
    view.height = height;
    view.near_plane = 0.2;
    view.color.buffer = buffer;
    view.texel = GLINT_RGBA32F;
    view.exposure = 1.0f;
    view.background[0] = 0.5f;
    view.background[1] = 0.25f;
    view.background[2] = 0.75f;
    glint_instance instances[2] = { { model, { 0, 0, 0, 1 }, { 0, 0, 0 }, 1.0, counts.sh_degree, 0 } };
    glint_frame frame = { 0, 1, 1, 0, instances, &view };
    commands = begin(device, pool);
    /* What makes no sense is refused and records nothing. */
    frame.slot = 7;
    if (glint_frames_record(frames, commands, &frame) != 2 || !strstr(glint_last_error(), "slots")) FAIL("slot 7");
    frame.slot = 0;
    instances[0].scale = 0;
    if (glint_frames_record(frames, commands, &frame) != 2) FAIL("a scale of 0");
    instances[0].scale = 1;
    frame.instances = NULL;
    if (glint_frames_record(frames, commands, &frame) != 2) FAIL("instances that are null");
    frame.instances = instances;
    glint_report report;
    if (glint_frames_report(frames, 0, &report) != 2) FAIL("a report of nothing");
    GLINT(glint_frames_record(frames, commands, &frame));
    VkMemoryBarrier written = { VK_STRUCTURE_TYPE_MEMORY_BARRIER };
    written.srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
    written.dstAccessMask = VK_ACCESS_HOST_READ_BIT;
    vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_PIPELINE_STAGE_HOST_BIT, 0, 1, &written, 0, NULL, 0, NULL);
    run(queue, commands);
    GLINT(glint_frames_report(frames, 0, &report));
    if (report.needed != 0 || report.visible == 0) FAIL("%u needed, %u visible", report.needed, report.visible);
    if (locked != 0) FAIL("glint submitted %d times", locked);

    void *pixels;
    VK(vkMapMemory(device, memory, 0, bytes, 0, &pixels));
    FILE *out = fopen(argv[3], "wb");
    if (!out || fwrite(pixels, 1, bytes, out) != bytes || fclose(out)) FAIL("%s: not written", argv[3]);

    const char *name;
    const uint32_t *code;
    size_t length;
    uint32_t kernels = 0;
    for (; glint_kernel(kernels, &name, &code, &length) == 0; ++kernels)
        if (code[0] != 0x07230203 || strlen(name) == 0) FAIL("kernel %u is no SPIR-V", kernels);
    printf("%u + %u Gaussians, %u visible, %u intersections, %u kernels, %llu bytes\n", counts.base, counts.supplement,
           report.visible, report.intersections, kernels, (unsigned long long)glint_frames_bytes(context, &limits));

    glint_frames_destroy(frames);
    glint_model_destroy(model);
    glint_scene_destroy(scene);
    glint_context_destroy(context);
    vkDestroyBuffer(device, buffer, NULL);
    vkFreeMemory(device, memory, NULL);
    vkDestroyCommandPool(device, pool, NULL);
    vkDestroyDevice(device, NULL);
    vkDestroyInstance(instance, NULL);
    return 0;
}
