// Draws a scene with WebGPU: projects, sorts and blends on the GPU in each frame, so the order is never
// outdated.

const BYTES_OF_SPLAT = 48; // see shared.wgsl
const INVOCATIONS = 256; // of a workgroup, and digits of the sort
const SORT_BLOCK = 1024; // pairs sorted by a workgroup
const SHIFTS = [0, 8, 16, 24]; // shifts of a key's digits
const TURN_STRIDE = 256; // bytes: alignment of uniforms that works on every device
const FORMATS = { float: "rgba32float", half: "rgba16float", bytes: "rgba8unorm" };

class GpuPainter {
    /**
     * Creates a painter like Painter's constructor. With `asked`, software devices are accepted, too. The
     * canvas is used last: if this throws, another painter can still use it.
     */
    static async make(canvas, scene, wanted, asked) {
        const adapter = navigator.gpu && await navigator.gpu.requestAdapter({ powerPreference: "high-performance" });
        if (!adapter) throw new Error("this browser does not offer WebGPU on this machine.");
        if (adapter.info?.isFallbackAdapter && !asked) throw new Error("this browser's WebGPU runs without a graphics device.");
        const { maxBufferSize, maxStorageBufferBindingSize, maxTextureDimension2D } = adapter.limits;
        const most = Math.min(maxBufferSize, maxStorageBufferBindingSize);
        const largest = Math.max(BYTES_OF_SPLAT * scene.count, scene.harmonics ? scene.harmonics.byteLength : 0);
        if (largest > most) throw new Error(`the scene's ${scene.count} Gaussians need ${largest} bytes in one buffer, more than ${most}.`);
        const floats = wanted === "float" && adapter.features.has("float32-blendable");
        const device = await adapter.requestDevice({
            requiredLimits: { maxBufferSize, maxStorageBufferBindingSize, maxTextureDimension2D },
            requiredFeatures: floats ? ["float32-blendable"] : [],
        });
        try {
            for (const kind of ["validation", "out-of-memory"]) device.pushErrorScope(kind);
            const painter = new GpuPainter(device, scene, floats || wanted !== "float" ? wanted : "half");
            await painter.compile();
            for (const error of await Promise.all([device.popErrorScope(), device.popErrorScope()])) if (error) throw error;
            painter.show(canvas);
            return painter;
        } catch (error) {
            device.destroy();
            throw error;
        }
    }

    constructor(device, scene, precision) {
        this.name = "WebGPU";
        this.device = device;
        this.scene = scene;
        this.precision = precision;
        this.format = navigator.gpu.getPreferredCanvasFormat();
        this.count = 0;
        this.image = null;
        const { STORAGE, UNIFORM, INDIRECT, COPY_SRC, COPY_DST } = GPUBufferUsage;
        const blocks = Math.max(Math.ceil(scene.count / SORT_BLOCK), 1);
        this.frame = this.buffer(144, UNIFORM | COPY_DST);
        this.turns = this.buffer(TURN_STRIDE * SHIFTS.length, UNIFORM | COPY_DST);
        this.drawn = this.buffer(16, STORAGE | INDIRECT | COPY_SRC | COPY_DST);
        this.splats = this.buffer(BYTES_OF_SPLAT * scene.count, STORAGE);
        this.pairs = [0, 1].map(() => this.buffer(8 * scene.count, STORAGE));
        this.counts = this.buffer(4 * INVOCATIONS * blocks, STORAGE);
        this.totals = this.buffer(4 * INVOCATIONS, STORAGE);
        [this.geometry, this.harmonics, this.lobes] = [scene.geometry, scene.harmonics, scene.lobes].map((words) => {
            const buffer = this.buffer(words ? words.byteLength : 0, STORAGE | COPY_DST);
            if (words) device.queue.writeBuffer(buffer, 0, words);
            return buffer;
        });
    }

    /** Creates a buffer with at least the minimum size of a binding. */
    buffer(size, usage) {
        return this.device.createBuffer({ size: Math.max(size, BYTES_OF_SPLAT), usage });
    }

    /** Compiles the pipelines; throws an Error if a shader is rejected. */
    async compile() {
        const { device, scene } = this;
        const module = async (id) => {
            const made = device.createShaderModule({ code: element(id).textContent });
            const wrong = (await made.getCompilationInfo()).messages.find(({ type }) => type === "error");
            if (wrong) throw new Error(`the shader ${id} is rejected: ${wrong.message} (line ${wrong.lineNum}).`);
            return made;
        };
        const compute = (module, entryPoint, constants, layout) =>
            device.createComputePipelineAsync({ layout, compute: { module, entryPoint, constants } });
        const render = (module, vertex, fragment, topology, target) => device.createRenderPipelineAsync({
            layout: "auto",
            vertex: { module, entryPoint: vertex },
            fragment: { module, entryPoint: fragment, targets: [target] },
            primitive: { topology },
        });

        const kinds = ["uniform", "read-only-storage", "storage", "storage", "storage"];
        const sorting = device.createBindGroupLayout({
            entries: kinds.map((type, binding) => ({ binding, visibility: GPUShaderStage.COMPUTE, buffer: { type } })),
        });
        const layout = device.createPipelineLayout({ bindGroupLayouts: [sorting] });
        const ids = ["project-wgsl", "sort-wgsl", "blend-wgsl", "over-wgsl"];
        const [one, sort, splats, over] = await Promise.all(ids.map(module));
        // rgb: light over the Gaussians behind. alpha: the transmittance, a product.
        const behind = "one-minus-src-alpha";
        const blend = { color: { srcFactor: "one", dstFactor: behind }, alpha: { srcFactor: "zero", dstFactor: behind } };
        const [project, count, scan, scatter, draw, lay] = await Promise.all([
            compute(one, "project", {
                SH_DEGREE: scene.degree, SUPPLEMENT_FIRST: scene.base, HARMONICS_END: scene.with_harmonics,
                LOG_SCALE_LOW: scene.log_scales[0], LOG_SCALE_HIGH: scene.log_scales[1], COMPENSATE: Number(scene.compensate),
            }, "auto"),
            compute(sort, "count", { BLOCK: SORT_BLOCK }, layout),
            compute(sort, "scan", { BLOCK: SORT_BLOCK }, layout),
            compute(sort, "scatter", { BLOCK: SORT_BLOCK }, layout),
            render(splats, "cover", "light", "triangle-strip", { format: FORMATS[this.precision], blend }),
            render(over, "cover", "shown", "triangle-list", { format: this.format }),
        ]);
        this.pipelines = { project, count, scan, scatter, draw, lay };

        const turn = (i) => ({ buffer: this.turns, offset: TURN_STRIDE * i, size: 16 });
        this.groups = {
            project: this.group(project.getBindGroupLayout(0), this.frame, this.geometry, this.harmonics, this.lobes, this.splats, this.pairs[0],
                this.drawn),
            sort: SHIFTS.map((_, i) => this.group(sorting, turn(i), this.pairs[i % 2], this.pairs[(i + 1) % 2], this.counts, this.totals)),
            draw: this.group(draw.getBindGroupLayout(0), this.frame, this.splats, this.pairs[SHIFTS.length % 2]),
        };
    }

    /** Binds buffers or other resources in this order. */
    group(layout, ...resources) {
        const entry = (resource, binding) => ({ binding, resource: resource instanceof GPUBuffer ? { buffer: resource } : resource });
        return this.device.createBindGroup({ layout, entries: resources.map(entry) });
    }

    /** Attaches the painter to the canvas. */
    show(canvas) {
        this.context = canvas.getContext("webgpu");
        if (!this.context) throw new Error("this browser offers WebGPU, but cannot draw on a page with it.");
        const { RENDER_ATTACHMENT, COPY_SRC } = GPUTextureUsage;
        this.device.onuncapturederror = ({ error }) => say(`The graphics device cannot draw this: ${error.message}`);
        this.context.configure({ device: this.device, format: this.format, usage: RENDER_ATTACHMENT | COPY_SRC, alphaMode: "opaque" });
    }

    /** Resizes the image to the size of the canvas. */
    resize(width, height) {
        if (this.image && this.image.width === width && this.image.height === height) return;
        if (this.image) this.image.destroy();
        const { RENDER_ATTACHMENT, TEXTURE_BINDING } = GPUTextureUsage;
        this.image = this.device.createTexture({
            size: [width, height], format: FORMATS[this.precision], usage: RENDER_ATTACHMENT | TEXTURE_BINDING,
        });
        this.groups.lay = this.group(this.pipelines.lay.getBindGroupLayout(0), this.frame, this.image.createView());
    }

    /** Writes the uniforms of this frame. */
    tell(view, background, first, last) {
        const { device, scene } = this, { width, height } = view;
        const { low, high } = slopes(view, scene.jacobian_limit);
        const numbers = new Float32Array([
            ...view.rowX, ...view.rowY, ...view.rowZ, ...view.eye, view.fx, view.fy, view.cx, view.cy, ...low, ...high, scene.near,
            width, height, 0, 0, ...background,
        ]);
        device.queue.writeBuffer(this.frame, 0, numbers);
        device.queue.writeBuffer(this.frame, numbers.byteLength, new Uint32Array([first, last]));
        device.queue.writeBuffer(this.drawn, 0, new Uint32Array([4, 0, 0, 0])); // vertices of a quad; project counts the quads
        const turns = new Uint32Array((TURN_STRIDE / 4) * SHIFTS.length), count = last - first;
        SHIFTS.forEach((shift, i) => turns.set([shift, count, Math.ceil(count / SORT_BLOCK)], (TURN_STRIDE / 4) * i));
        device.queue.writeBuffer(this.turns, 0, turns);
    }

    /**
     * Draws `view` (see Camera.view) with the Gaussians `first` to `last` (exclusive). When done, `count`
     * is the number of visible ones.
     */
    async draw(view, background, [first, last]) {
        const { device, pipelines, groups } = this;
        this.resize(view.width, view.height);
        this.tell(view, background, first, last);
        const encoder = device.createCommandEncoder();

        const compute = encoder.beginComputePass();
        const dispatch = (pipeline, group, workgroups) => {
            compute.setPipeline(pipeline);
            compute.setBindGroup(0, group);
            compute.dispatchWorkgroups(workgroups);
        };
        const blocks = Math.ceil((last - first) / SORT_BLOCK);
        dispatch(pipelines.project, groups.project, Math.ceil((last - first) / INVOCATIONS));
        for (const group of groups.sort) {
            dispatch(pipelines.count, group, blocks);
            dispatch(pipelines.scan, group, INVOCATIONS);
            dispatch(pipelines.scatter, group, blocks);
        }
        compute.end();

        const paint = (target, pipeline, group, drawing) => {
            const clear = { view: target.createView(), loadOp: "clear", storeOp: "store", clearValue: [0, 0, 0, 1] };
            const pass = encoder.beginRenderPass({ colorAttachments: [clear] });
            pass.setPipeline(pipeline);
            pass.setBindGroup(0, group);
            drawing(pass);
            pass.end();
        };
        paint(this.image, pipelines.draw, groups.draw, (pass) => pass.drawIndirect(this.drawn, 0));
        paint(this.context.getCurrentTexture(), pipelines.lay, groups.lay, (pass) => pass.draw(3));

        const copy = device.createBuffer({ size: 4, usage: GPUBufferUsage.COPY_DST | GPUBufferUsage.MAP_READ });
        encoder.copyBufferToBuffer(this.drawn, 4, copy, 0, 4);
        device.queue.submit([encoder.finish()]);
        this.count = new Uint32Array(await this.fetch(copy))[0];
    }

    /** Reads the content of `buffer` and destroys it. */
    async fetch(buffer) {
        await buffer.mapAsync(GPUMapMode.READ);
        const bytes = buffer.getMappedRange().slice();
        buffer.destroy();
        return bytes;
    }

    /** Reads the last image as 8-bit RGB, rows from the top. Call it directly after drawing. */
    async read() {
        const { device } = this, texture = this.context.getCurrentTexture(), { width, height } = texture;
        const bytesPerRow = Math.ceil((4 * width) / 256) * 256; // alignment of copies
        const buffer = device.createBuffer({ size: bytesPerRow * height, usage: GPUBufferUsage.COPY_DST | GPUBufferUsage.MAP_READ });
        const encoder = device.createCommandEncoder();
        encoder.copyTextureToBuffer({ texture }, { buffer, bytesPerRow }, [width, height]);
        device.queue.submit([encoder.finish()]);
        const bytes = new Uint8Array(await this.fetch(buffer)), rgb = new Uint8Array(3 * width * height);
        const channels = this.format.startsWith("bgra") ? [2, 1, 0] : [0, 1, 2];
        for (let row = 0, at = 0; row < height; ++row) {
            for (let i = bytesPerRow * row, end = i + 4 * width; i < end; i += 4) {
                for (const channel of channels) rgb[at++] = bytes[i + channel];
            }
        }
        return rgb;
    }
}
