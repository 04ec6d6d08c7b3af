// Draws Gaussians with WebGL2 in a given order: quads into a floating-point image, which is then laid over
// the background.

const TEXTURE_WIDTH = 2048; // texels; supported by every device with WebGL2

class Painter {
    /**
     * Painter for a canvas and a scene. `wanted` limits the image's precision: float, half or bytes. Throws
     * an Error with the reason if it cannot draw.
     */
    constructor(canvas, scene, wanted) {
        const gl = canvas.getContext("webgl2", { alpha: false, antialias: false, depth: false, powerPreference: "high-performance" });
        if (!gl) {
            throw new Error("This page needs WebGL2, which this browser does not offer on this machine. Turn on " +
                "hardware acceleration in the browser's settings, or use another browser.");
        }
        this.name = "WebGL2";
        this.gl = gl;
        this.scene = scene;
        this.count = 0;
        this.chooseTarget(wanted);

        const defines = `#version 300 es\n#define TEXTURE_WIDTH ${TEXTURE_WIDTH}\n#define SH_DEGREE ${scene.degree}\n` +
            `#define SH_TEXELS ${scene.degree}\n${scene.lobes ? "#define HAS_LOBES\n" : ""}`;
        this.splats = this.program(defines, "project-vert", "blend-frag");
        this.over = this.program("#version 300 es\n", "over-vert", "over-frag");

        this.texture(0, scene.geometry, "geometry");
        if (scene.harmonics) this.texture(1, scene.harmonics, "harmonics");
        if (scene.lobes) this.texture(2, scene.lobes, "lobes");
        const u = this.splats.at;
        gl.useProgram(this.splats.program);
        gl.uniform2f(u("log_scale_range"), ...scene.log_scales);
        gl.uniform1ui(u("supplement_first"), scene.base);
        if (scene.harmonics) gl.uniform1ui(u("harmonics_end"), scene.with_harmonics);
        gl.uniform1i(u("compensate"), scene.compensate ? 1 : 0);
        gl.useProgram(this.over.program);
        gl.uniform1i(this.over.at("image"), 3);

        this.order = gl.createBuffer();
        gl.bindBuffer(gl.ARRAY_BUFFER, this.order);
        gl.bufferData(gl.ARRAY_BUFFER, Math.max(4 * scene.count, 4), gl.DYNAMIC_DRAW);
        gl.enableVertexAttribArray(0);
        gl.vertexAttribIPointer(0, 1, gl.UNSIGNED_INT, 0, 0);
        gl.vertexAttribDivisor(0, 1);

        // rgb: light over the Gaussians behind. alpha: the transmittance, a product.
        gl.blendFuncSeparate(gl.ONE, gl.ONE_MINUS_SRC_ALPHA, gl.ZERO, gl.ONE_MINUS_SRC_ALPHA);
        gl.disable(gl.DEPTH_TEST);
        gl.clearColor(0, 0, 0, 1);
        this.image = null;
        this.framebuffer = gl.createFramebuffer();
        this.sized = [0, 0];
    }

    /**
     * Selects the most precise image that supports blending. With 8 bits, hundreds of Gaussians would each
     * be rounded.
     */
    chooseTarget(wanted) {
        const gl = this.gl;
        const floats = gl.getExtension("EXT_color_buffer_float");
        const halves = floats || gl.getExtension("EXT_color_buffer_half_float");
        this.precision = "bytes";
        this.format = gl.RGBA8;
        if (halves && wanted !== "bytes") {
            this.precision = "half";
            this.format = gl.RGBA16F;
        }
        if (floats && gl.getExtension("EXT_float_blend") && wanted === "float") {
            this.precision = "float";
            this.format = gl.RGBA32F;
        }
    }

    program(before, vertex, fragment) {
        const gl = this.gl;
        const program = gl.createProgram();
        for (const [kind, id] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
            const shader = gl.createShader(kind);
            gl.shaderSource(shader, before + "precision highp float;\nprecision highp int;\n" + document.getElementById(id).textContent);
            gl.compileShader(shader);
            gl.attachShader(program, shader);
            if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) {
                throw new Error(`This machine's driver rejects the shader ${id}: ${gl.getShaderInfoLog(shader)}`);
            }
        }
        gl.linkProgram(program);
        if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
            throw new Error(`This machine's driver rejects the shaders: ${gl.getProgramInfoLog(program)}`);
        }
        // Caches the locations of uniforms.
        const places = new Map();
        const at = (name) => {
            if (!places.has(name)) places.set(name, gl.getUniformLocation(program, name));
            return places.get(name);
        };
        return { program, at };
    }

    /** Uploads words as a texture of four words per texel, row by row, bound to `unit` and to the sampler `name`. */
    texture(unit, words, name) {
        const gl = this.gl;
        const texels = words.length / 4, rows = Math.max(Math.ceil(texels / TEXTURE_WIDTH), 1);
        const most = gl.getParameter(gl.MAX_TEXTURE_SIZE);
        if (rows > most) {
            throw new Error(`The scene has ${this.scene.count} Gaussians, more than a texture of this machine holds (${most} rows of ` +
                `${TEXTURE_WIDTH} for ${name}, ${rows} needed).`);
        }
        gl.activeTexture(gl.TEXTURE0 + unit);
        gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
        gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32UI, TEXTURE_WIDTH, rows);
        this.unfiltered();
        const whole = Math.floor(texels / TEXTURE_WIDTH), rest = texels - whole * TEXTURE_WIDTH;
        const part = (y, width, height, from) =>
            gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, y, width, height, gl.RGBA_INTEGER, gl.UNSIGNED_INT, words, from);
        if (whole > 0) part(0, TEXTURE_WIDTH, whole, 0);
        if (rest > 0) part(whole, rest, 1, 4 * whole * TEXTURE_WIDTH);
        gl.useProgram(this.splats.program);
        gl.uniform1i(this.splats.at(name), unit);
        if (gl.getError() === gl.OUT_OF_MEMORY) throw new Error(`The scene's ${this.scene.count} Gaussians do not fit this machine's memory.`);
    }

    /** Turns off filtering for the bound texture; integer textures would otherwise read as 0. */
    unfiltered() {
        const gl = this.gl;
        gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
        gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    }

    /** Sets the order of Gaussians, back to front. */
    setOrder(order) {
        const gl = this.gl;
        gl.bindBuffer(gl.ARRAY_BUFFER, this.order);
        gl.bufferSubData(gl.ARRAY_BUFFER, 0, order);
        this.count = order.length;
    }

    /** Resizes the image to the size of the canvas. */
    resize(width, height) {
        const gl = this.gl;
        if (this.sized[0] === width && this.sized[1] === height) return;
        this.sized = [width, height];
        gl.activeTexture(gl.TEXTURE3);
        if (this.image) gl.deleteTexture(this.image);
        this.image = gl.createTexture();
        gl.bindTexture(gl.TEXTURE_2D, this.image);
        gl.texStorage2D(gl.TEXTURE_2D, 1, this.format, width, height);
        this.unfiltered();
        gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer);
        gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.image, 0);
        if (gl.checkFramebufferStatus(gl.FRAMEBUFFER) !== gl.FRAMEBUFFER_COMPLETE && !gl.isContextLost()) {
            // Some devices offer an extension without supporting it.
            if (this.format === gl.RGBA8) throw new Error("This machine cannot draw to an image.");
            [this.precision, this.format] = this.precision === "float" ? ["half", gl.RGBA16F] : ["bytes", gl.RGBA8];
            this.sized = [0, 0];
            this.resize(width, height);
        }
    }

    /** Draws `view` (see Camera.view). */
    draw(view, background) {
        const gl = this.gl, u = this.splats.at, { width, height } = view;
        this.resize(width, height);
        gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer);
        gl.viewport(0, 0, width, height);
        gl.clear(gl.COLOR_BUFFER_BIT);
        gl.useProgram(this.splats.program);
        gl.uniform4fv(u("view.row_x"), view.rowX);
        gl.uniform4fv(u("view.row_y"), view.rowY);
        gl.uniform4fv(u("view.row_z"), view.rowZ);
        gl.uniform3fv(u("view.eye"), view.eye);
        gl.uniform1f(u("view.fx"), view.fx);
        gl.uniform1f(u("view.fy"), view.fy);
        gl.uniform1f(u("view.cx"), view.cx);
        gl.uniform1f(u("view.cy"), view.cy);
        const { low, high } = slopes(view, this.scene.jacobian_limit);
        gl.uniform2fv(u("view.slope_low"), low);
        gl.uniform2fv(u("view.slope_high"), high);
        gl.uniform1f(u("view.near"), this.scene.near);
        gl.uniform2f(u("image_size"), width, height);
        gl.enable(gl.BLEND);
        gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, this.count);
        gl.disable(gl.BLEND);
        gl.bindFramebuffer(gl.FRAMEBUFFER, null);
        gl.useProgram(this.over.program);
        gl.uniform3fv(this.over.at("background"), background);
        gl.drawArrays(gl.TRIANGLES, 0, 3);
    }

    /** Reads the last image as 8-bit RGB, rows from the top. Call it directly after drawing. */
    read() {
        const gl = this.gl, [width, height] = this.sized;
        const rgba = new Uint8Array(4 * width * height), rgb = new Uint8Array(3 * width * height);
        gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, rgba);
        for (let row = 0, at = 0; row < height; ++row) {
            for (let i = 4 * width * (height - 1 - row), end = i + 4 * width; i < end; i += 4, at += 3) {
                rgb.set(rgba.subarray(i, i + 3), at);
            }
        }
        return rgb;
    }
}
