// VK_LAYER_glint_allowed: makes a good driver as bad as Vulkan allows. tools/devices builds it and sets the variables:
//
// ALLOWED_ROUGH       a list of words. Each makes some operations of kernels as wrong as "Precision and Operation of SPIR-V
//                     Instructions" of the Vulkan specification allows; the sign of the error is a hash of the operand's bits:
//     trig            sin, cos and tan: 2^-11 absolute from -pi to pi; 2^-2 beyond, for which Vulkan promises nothing
//     atan            atan, asin and acos: 4096 ULP
//     exp             exp, exp2 and pow: 3 + 2 |x| ULP
//     log             log and log2: 2^-21 absolute from 1/2 to 2, else 3 ULP
//     div             division, sqrt and inversesqrt: 2 ULP
//     nan             exp of NaN is infinite, log of NaN is 89; min, max and clamp of NaN are NaN
// ALLOWED_TRIG        the error of trig from -pi to pi, instead of 2^-11
// ALLOWED_LEAST       any text: Vulkan's guaranteed limits only, Vulkan 1.2, no optional features, no timestamps
// ALLOWED_BUFFERS     storage buffers per stage with ALLOWED_LEAST, instead of 16; Vulkan guarantees 4
// ALLOWED_EXTENSIONS  extensions kept with ALLOWED_LEAST, instead of VK_EXT_subgroup_size_control
// ALLOWED_SUBGROUPS   a mask of the subgroup operations kept with ALLOWED_LEAST; Vulkan guarantees 1, the basic ones
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <vulkan/vk_layer.h>
#include <vulkan/vulkan.h>

static int word_of(const char *list, const char *word) {
    size_t length = strlen(word);
    for (const char *at = list; at && (at = strstr(at, word)); at += length)
        if ((at == list || at[-1] == ' ' || at[-1] == ',') && strchr(" ,", at[length])) return 1;
    return 0;
}
static int rough(const char *word) { return word_of(getenv("ALLOWED_ROUGH"), word); }
static int least(void) { return getenv("ALLOWED_LEAST") != NULL; }

// ---- SPIR-V: numbers of the specification ----
enum {
    EXT_INST_IMPORT = 11, EXT_INST = 12, TYPE_BOOL = 20, TYPE_INT = 21, TYPE_FLOAT = 22, TYPE_VECTOR = 23, CONSTANT = 43, FUNCTION = 54,
    COMPOSITE_CONSTRUCT = 80, COMPOSITE_EXTRACT = 81, COPY_OBJECT = 83, BITCAST = 124, F_ADD = 129, I_MUL = 132, F_MUL = 133, F_DIV = 136,
    IS_NAN = 156, LOGICAL_AND = 167, SELECT = 169, F_LESS_EQUAL = 188, BIT_OR = 197, BIT_AND = 199,
};
enum {  // of GLSL.std.450
    F_ABS = 4, SIN = 13, COS, TAN, ASIN, ACOS, ATAN, ATAN2 = 25, POW, EXP, LOG, EXP2, LOG2, SQRT, INVERSE_SQRT, F_MIN = 37, F_MAX = 40,
    F_CLAMP = 43,
};

typedef struct { uint32_t *word; size_t count, room; } Words;
typedef struct {
    Words head, body;  // everything before the first function, with added constants, and the functions
    uint32_t bound, glsl, f32, u32, boolean;
    uint8_t *width;  // by type: components of a float or a vector of floats, else 0
} Module;

static void put(Words *to, uint32_t word) {
    if (to->count == to->room) to->word = realloc(to->word, 4 * (to->room = to->room ? 2 * to->room : 1 << 12));
    to->word[to->count++] = word;
}
static void put_all(Words *to, const uint32_t *from, size_t count) {
    for (size_t i = 0; i < count; i++) put(to, from[i]);
}
// Appends an instruction with a result of `type`; returns the result's id.
static uint32_t op(Module *m, uint32_t code, uint32_t type, int count, ...) {
    put(&m->body, (uint32_t)(3 + count) << 16 | code), put(&m->body, type), put(&m->body, m->bound);
    va_list list;
    va_start(list, count);
    for (int i = 0; i < count; i++) put(&m->body, va_arg(list, uint32_t));
    va_end(list);
    return m->bound++;
}
static uint32_t constant(Module *m, uint32_t type, uint32_t bits) {
    put_all(&m->head, (uint32_t[]){4 << 16 | CONSTANT, type, m->bound, bits}, 4);
    return m->bound++;
}
static uint32_t number(Module *m, float value) {
    uint32_t bits;
    memcpy(&bits, &value, 4);
    return constant(m, m->f32, bits);
}
static uint32_t function1(Module *m, uint32_t f, uint32_t x) { return op(m, EXT_INST, m->f32, 3, m->glsl, f, x); }
static uint32_t float2(Module *m, uint32_t code, uint32_t a, uint32_t b) { return op(m, code, m->f32, 2, a, b); }
static uint32_t choose(Module *m, uint32_t condition, uint32_t yes, uint32_t no) { return op(m, SELECT, m->f32, 3, condition, yes, no); }
static uint32_t if_nan(Module *m, uint32_t x, uint32_t then, uint32_t otherwise) {
    return choose(m, op(m, IS_NAN, m->boolean, 1, x), then, otherwise);
}

// `error` with a sign that depends on the bits of `of`.
static uint32_t with_sign(Module *m, uint32_t error, uint32_t of) {
    uint32_t hash = op(m, I_MUL, m->u32, 2, op(m, BITCAST, m->u32, 1, of), constant(m, m->u32, 0x9E3779B1));
    uint32_t sign = op(m, BIT_AND, m->u32, 2, hash, constant(m, m->u32, 0x80000000));
    uint32_t bits = op(m, BIT_OR, m->u32, 2, op(m, BITCAST, m->u32, 1, error), sign);
    return op(m, BITCAST, m->f32, 1, bits);
}
// `value` with a relative error of `ulp` units of 2^-24, at most that number of ULP.
static uint32_t off_by(Module *m, uint32_t value, uint32_t ulp, uint32_t of) {
    uint32_t error = with_sign(m, float2(m, F_MUL, ulp, number(m, 0x1p-24f)), of);
    return float2(m, F_MUL, value, float2(m, F_ADD, number(m, 1), error));
}

static uint32_t rough_sine(Module *m, uint32_t f, uint32_t x) {
    const char *text = getenv("ALLOWED_TRIG");
    float error = text ? strtof(text, NULL) : 0x1p-11f;
    uint32_t inside = op(m, F_LESS_EQUAL, m->boolean, 2, function1(m, F_ABS, x), number(m, 3.1415927f));
    uint32_t wrong = choose(m, inside, number(m, error), number(m, 0.25f));
    return float2(m, F_ADD, function1(m, f, x), with_sign(m, wrong, x));
}
static uint32_t rough_exp(Module *m, uint32_t f, uint32_t x) {
    uint32_t y = function1(m, f, x);
    if (rough("exp")) {
        // Beyond 128 the result is 0 or infinite.
        uint32_t size = op(m, EXT_INST, m->f32, 4, m->glsl, F_MIN, function1(m, F_ABS, x), number(m, 128));
        y = off_by(m, y, float2(m, F_ADD, number(m, 3), float2(m, F_MUL, number(m, 2), size)), x);
    }
    return rough("nan") ? if_nan(m, x, number(m, __builtin_inff()), y) : y;
}
static uint32_t rough_log(Module *m, uint32_t f, uint32_t x) {
    uint32_t y = function1(m, f, x);
    if (rough("log")) {
        uint32_t above = op(m, F_LESS_EQUAL, m->boolean, 2, number(m, 0.5f), x);
        uint32_t near = op(m, LOGICAL_AND, m->boolean, 2, above, op(m, F_LESS_EQUAL, m->boolean, 2, x, number(m, 2)));
        uint32_t absolute = float2(m, F_ADD, y, with_sign(m, number(m, 0x1p-21f), x));
        y = choose(m, near, absolute, off_by(m, y, number(m, 3), x));
    }
    return rough("nan") ? if_nan(m, x, number(m, 89), y) : y;
}

// The word that makes a function rough, and its number of operands; NULL: unchanged.
static const char *word_for(uint32_t f, uint32_t *operands) {
    *operands = f == F_CLAMP ? 3 : f == ATAN2 || f == POW || f == F_MIN || f == F_MAX ? 2 : 1;
    switch (f) {
        case SIN: case COS: case TAN: return "trig";
        case ASIN: case ACOS: case ATAN: case ATAN2: return "atan";
        case EXP: case EXP2: return rough("nan") ? "nan" : "exp";
        case LOG: case LOG2: return rough("nan") ? "nan" : "log";
        case POW: return "exp";
        case SQRT: case INVERSE_SQRT: return "div";
        case F_MIN: case F_MAX: case F_CLAMP: return "nan";
        default: return NULL;
    }
}
// f of floats, with its error.
static uint32_t rough_function(Module *m, uint32_t f, const uint32_t *x) {
    switch (f) {
        case SIN: case COS: return rough_sine(m, f, x[0]);
        case TAN: return float2(m, F_DIV, rough_sine(m, SIN, x[0]), rough_sine(m, COS, x[0]));
        case ASIN: case ACOS: case ATAN: return off_by(m, function1(m, f, x[0]), number(m, 4096), x[0]);
        case ATAN2: return off_by(m, op(m, EXT_INST, m->f32, 4, m->glsl, f, x[0], x[1]), number(m, 4096), x[0]);
        case EXP: case EXP2: return rough_exp(m, f, x[0]);
        case LOG: case LOG2: return rough_log(m, f, x[0]);
        case POW: return rough_exp(m, EXP2, float2(m, F_MUL, x[1], rough_log(m, LOG2, x[0])));
        case F_MIN: case F_MAX: return if_nan(m, x[0], x[0], if_nan(m, x[1], x[1], op(m, EXT_INST, m->f32, 4, m->glsl, f, x[0], x[1])));
        case F_CLAMP: return if_nan(m, x[0], x[0], op(m, EXT_INST, m->f32, 5, m->glsl, f, x[0], x[1], x[2]));
        default: return off_by(m, function1(m, f, x[0]), number(m, 2), x[0]);
    }
}

// Replaces the instruction `from` by a rough version, component by component; false if it stays unchanged.
static int roughen(Module *m, const uint32_t *from) {
    uint32_t code = *from & 0xFFFF, type = from[1], operands, results[4];
    uint32_t width = (code == EXT_INST && from[3] == m->glsl) || code == F_DIV ? m->width[type] : 0;
    if (!width) return 0;
    const char *word = code == F_DIV ? (operands = 2, "div") : word_for(from[4], &operands);
    if (!word || !rough(word)) return 0;
    const uint32_t *operand = from + (code == F_DIV ? 3 : 5);
    for (uint32_t k = 0; k < width; k++) {
        uint32_t x[3];
        for (uint32_t i = 0; i < operands; i++) x[i] = width == 1 ? operand[i] : op(m, COMPOSITE_EXTRACT, m->f32, 2, operand[i], k);
        if (code == F_DIV) results[k] = float2(m, F_DIV, x[0], x[1]), results[k] = off_by(m, results[k], number(m, 2), results[k]);
        else results[k] = rough_function(m, from[4], x);
    }
    put(&m->body, (3 + width) << 16 | (width == 1 ? COPY_OBJECT : COMPOSITE_CONSTRUCT)), put(&m->body, type), put(&m->body, from[2]);
    put_all(&m->body, results, width);
    return 1;
}

// The module with rough operations; the caller frees it.
static uint32_t *rewrite(const uint32_t *code, size_t *bytes) {
    Module m = {.bound = code[3], .width = calloc(code[3], 1)};
    put_all(&m.head, code, 5);
    int in_functions = 0;
    for (size_t i = 5, length; i < *bytes / 4; i += length) {
        const uint32_t *from = code + i;
        length = *from >> 16;
        switch (*from & 0xFFFF) {
            case EXT_INST_IMPORT: if (!strcmp((const char *)(from + 2), "GLSL.std.450")) m.glsl = from[1]; break;
            case TYPE_BOOL: m.boolean = from[1]; break;
            case TYPE_INT: if (from[2] == 32 && !from[3]) m.u32 = from[1]; break;
            case TYPE_FLOAT: if (from[2] == 32) m.f32 = from[1], m.width[from[1]] = 1; break;
            case TYPE_VECTOR: if (from[2] == m.f32) m.width[from[1]] = (uint8_t)from[3]; break;
            case FUNCTION:
                in_functions = 1;
                if (!m.u32) put_all(&m.head, (uint32_t[]){4 << 16 | TYPE_INT, m.u32 = m.bound++, 32, 0}, 4);
                if (!m.boolean) put_all(&m.head, (uint32_t[]){2 << 16 | TYPE_BOOL, m.boolean = m.bound++}, 2);
        }
        if (!in_functions || !roughen(&m, from)) put_all(in_functions ? &m.body : &m.head, from, length);
    }
    put_all(&m.head, m.body.word, m.body.count);
    m.head.word[3] = m.bound;
    *bytes = 4 * m.head.count;
    free(m.body.word), free(m.width);
    return m.head.word;
}

// ---- The next layer's functions. All instances of a process have the same layers, so these are common to all. ----
static PFN_vkGetInstanceProcAddr next_instance;
static PFN_vkGetDeviceProcAddr next_device;
#define INSTANCE_FUNCTIONS(X) X(EnumerateDeviceExtensionProperties) X(GetPhysicalDeviceProperties) X(GetPhysicalDeviceProperties2) \
    X(GetPhysicalDeviceFeatures) X(GetPhysicalDeviceFeatures2) X(GetPhysicalDeviceQueueFamilyProperties) \
    X(GetPhysicalDeviceQueueFamilyProperties2) X(CreateDevice)
static struct {
#define MEMBER(name) PFN_vk##name name;
    INSTANCE_FUNCTIONS(MEMBER)
} next;

// The loader's link to the next layer, in the chain of a vkCreateInstance or vkCreateDevice.
static void *link_of(const void *chain, VkStructureType type) {
    const VkLayerInstanceCreateInfo *at = chain;
    while (at && !(at->sType == type && at->function == VK_LAYER_LINK_INFO)) at = at->pNext;
    return (void *)at;
}

static VKAPI_ATTR VkResult VKAPI_CALL CreateInstance(const VkInstanceCreateInfo *info, const VkAllocationCallbacks *a, VkInstance *out) {
    VkLayerInstanceCreateInfo *link = link_of(info->pNext, VK_STRUCTURE_TYPE_LOADER_INSTANCE_CREATE_INFO);
    if (!link) return VK_ERROR_INITIALIZATION_FAILED;
    next_instance = link->u.pLayerInfo->pfnNextGetInstanceProcAddr;
    link->u.pLayerInfo = link->u.pLayerInfo->pNext;
    VkResult result = ((PFN_vkCreateInstance)next_instance(NULL, "vkCreateInstance"))(info, a, out);
    if (result) return result;
#define FIND(name) next.name = (PFN_vk##name)next_instance(*out, "vk" #name);
    INSTANCE_FUNCTIONS(FIND)
    return result;
}

static VKAPI_ATTR VkResult VKAPI_CALL CreateDevice(VkPhysicalDevice p, const VkDeviceCreateInfo *info, const VkAllocationCallbacks *a, VkDevice *out) {
    VkLayerDeviceCreateInfo *link = link_of(info->pNext, VK_STRUCTURE_TYPE_LOADER_DEVICE_CREATE_INFO);
    if (!link) return VK_ERROR_INITIALIZATION_FAILED;
    next_device = link->u.pLayerInfo->pfnNextGetDeviceProcAddr;
    link->u.pLayerInfo = link->u.pLayerInfo->pNext;
    return next.CreateDevice(p, info, a, out);
}

// ---- Vulkan's minimum guarantees: "Required Limits" and "Feature Requirements" of its specification ----
static VKAPI_ATTR VkResult VKAPI_CALL EnumerateDeviceExtensionProperties(VkPhysicalDevice p, const char *layer, uint32_t *count, VkExtensionProperties *out) {
    const char *kept = getenv("ALLOWED_EXTENSIONS");
    if (!least() || layer) return next.EnumerateDeviceExtensionProperties(p, layer, count, out);
    uint32_t all_count = 0, found = 0;
    VkResult result = next.EnumerateDeviceExtensionProperties(p, NULL, &all_count, NULL);
    VkExtensionProperties *all = calloc(all_count + 1, sizeof *all);
    if (!result) result = next.EnumerateDeviceExtensionProperties(p, NULL, &all_count, all);
    for (uint32_t k = 0; k < all_count; k++)
        if (word_of(kept ? kept : VK_EXT_SUBGROUP_SIZE_CONTROL_EXTENSION_NAME, all[k].extensionName)) all[found++] = all[k];
    if (out) {
        if (*count < found) result = VK_INCOMPLETE, found = *count;
        memcpy(out, all, found * sizeof *all);
    }
    *count = found;
    free(all);
    return result;
}

static void least_limits(VkPhysicalDeviceProperties *p) {
    if (!least()) return;
    const char *text = getenv("ALLOWED_BUFFERS");
    uint32_t buffers = text ? (uint32_t)atoi(text) : 16;
    VkPhysicalDeviceLimits *l = &p->limits;
    p->apiVersion = VK_API_VERSION_1_2;
    l->maxComputeSharedMemorySize = 16384;
    l->maxComputeWorkGroupInvocations = l->maxComputeWorkGroupSize[0] = l->maxComputeWorkGroupSize[1] = 128;
    l->maxComputeWorkGroupSize[2] = 64;
    for (int k = 0; k < 3; k++) l->maxComputeWorkGroupCount[k] = 65535;
    l->maxPushConstantsSize = 128;
    l->maxPerStageDescriptorStorageBuffers = buffers;
    l->maxDescriptorSetStorageBuffers = buffers < 24 ? 24 : buffers;
    l->maxPerStageResources = 128;
    l->maxBoundDescriptorSets = 4;
    l->maxStorageBufferRange = 1 << 27;
    l->maxMemoryAllocationCount = 4096;
    l->minStorageBufferOffsetAlignment = l->minUniformBufferOffsetAlignment = l->nonCoherentAtomSize = 256;
    l->minMemoryMapAlignment = 64;
    l->timestampComputeAndGraphics = VK_FALSE, l->timestampPeriod = 0;
}
static VKAPI_ATTR void VKAPI_CALL GetPhysicalDeviceProperties(VkPhysicalDevice p, VkPhysicalDeviceProperties *out) {
    next.GetPhysicalDeviceProperties(p, out);
    least_limits(out);
}
static VKAPI_ATTR void VKAPI_CALL GetPhysicalDeviceProperties2(VkPhysicalDevice p, VkPhysicalDeviceProperties2 *out) {
    next.GetPhysicalDeviceProperties2(p, out);
    least_limits(&out->properties);
    const char *text = getenv("ALLOWED_SUBGROUPS");
    for (VkBaseOutStructure *s = out->pNext; s && least(); s = s->pNext) {
        if (s->sType == VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FLOAT_CONTROLS_PROPERTIES)
            ((VkPhysicalDeviceFloatControlsProperties *)s)->shaderSignedZeroInfNanPreserveFloat32 = VK_FALSE;
        if (s->sType == VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_MAINTENANCE_3_PROPERTIES)
            ((VkPhysicalDeviceMaintenance3Properties *)s)->maxMemoryAllocationSize = 1 << 30;
        if (s->sType == VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_PROPERTIES && text)
            ((VkPhysicalDeviceSubgroupProperties *)s)->supportedOperations &= (uint32_t)atoi(text);
    }
}

static void least_features(VkPhysicalDeviceFeatures *f) {
    if (least()) *f = (VkPhysicalDeviceFeatures){.robustBufferAccess = f->robustBufferAccess};
}
static VKAPI_ATTR void VKAPI_CALL GetPhysicalDeviceFeatures(VkPhysicalDevice p, VkPhysicalDeviceFeatures *out) {
    next.GetPhysicalDeviceFeatures(p, out);
    least_features(out);
}
// glint's required features stay: scalarBlockLayout, hostQueryReset, subgroupBroadcastDynamicId, and subgroupSizeControl.
static VKAPI_ATTR void VKAPI_CALL GetPhysicalDeviceFeatures2(VkPhysicalDevice p, VkPhysicalDeviceFeatures2 *out) {
    next.GetPhysicalDeviceFeatures2(p, out);
    least_features(&out->features);
    for (VkBaseOutStructure *s = out->pNext; s && least(); s = s->pNext) {
        VkPhysicalDeviceVulkan11Features *v11 = (void *)s;
        VkPhysicalDeviceVulkan12Features *v12 = (void *)s;
        if (s->sType == VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_FEATURES)
            *v11 = (VkPhysicalDeviceVulkan11Features){.sType = s->sType, .pNext = s->pNext, .multiview = v11->multiview};
        if (s->sType == VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES)
            *v12 = (VkPhysicalDeviceVulkan12Features){
                .sType = s->sType, .pNext = s->pNext, .scalarBlockLayout = v12->scalarBlockLayout, .hostQueryReset = v12->hostQueryReset,
                .subgroupBroadcastDynamicId = v12->subgroupBroadcastDynamicId, .timelineSemaphore = v12->timelineSemaphore,
            };
    }
}

static VKAPI_ATTR void VKAPI_CALL GetPhysicalDeviceQueueFamilyProperties(VkPhysicalDevice p, uint32_t *count, VkQueueFamilyProperties *out) {
    next.GetPhysicalDeviceQueueFamilyProperties(p, count, out);
    for (uint32_t k = 0; out && least() && k < *count; k++) out[k].timestampValidBits = 0;
}
static VKAPI_ATTR void VKAPI_CALL GetPhysicalDeviceQueueFamilyProperties2(VkPhysicalDevice p, uint32_t *count, VkQueueFamilyProperties2 *out) {
    next.GetPhysicalDeviceQueueFamilyProperties2(p, count, out);
    for (uint32_t k = 0; out && least() && k < *count; k++) out[k].queueFamilyProperties.timestampValidBits = 0;
}

static VKAPI_ATTR VkResult VKAPI_CALL CreateShaderModule(VkDevice d, const VkShaderModuleCreateInfo *info, const VkAllocationCallbacks *a, VkShaderModule *out) {
    VkShaderModuleCreateInfo mine = *info;
    uint32_t *code = getenv("ALLOWED_ROUGH") ? rewrite(info->pCode, &mine.codeSize) : NULL;
    if (code) mine.pCode = code;
    VkResult result = ((PFN_vkCreateShaderModule)next_device(d, "vkCreateShaderModule"))(d, &mine, a, out);
    free(code);
    return result;
}

// ---- Entry points for the loader ----
static VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL GetDeviceProcAddr(VkDevice d, const char *name) {
    if (!strcmp(name, "vkGetDeviceProcAddr")) return (PFN_vkVoidFunction)GetDeviceProcAddr;
    if (!strcmp(name, "vkCreateShaderModule")) return (PFN_vkVoidFunction)CreateShaderModule;
    return next_device(d, name);
}
static VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL GetInstanceProcAddr(VkInstance i, const char *name) {
#define OURS(function) if (!strcmp(name, "vk" #function)) return (PFN_vkVoidFunction)function;
    INSTANCE_FUNCTIONS(OURS)
    OURS(GetInstanceProcAddr) OURS(GetDeviceProcAddr) OURS(CreateInstance) OURS(CreateShaderModule)
    return i ? next_instance(i, name) : NULL;
}
__attribute__((visibility("default"))) VKAPI_ATTR VkResult VKAPI_CALL vkNegotiateLoaderLayerInterfaceVersion(VkNegotiateLayerInterface *v) {
    if (v->loaderLayerInterfaceVersion > 2) v->loaderLayerInterfaceVersion = 2;
    v->pfnGetInstanceProcAddr = GetInstanceProcAddr, v->pfnGetDeviceProcAddr = GetDeviceProcAddr, v->pfnGetPhysicalDeviceProcAddr = NULL;
    return VK_SUCCESS;
}
