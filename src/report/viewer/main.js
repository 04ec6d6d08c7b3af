// The page: selects Gaussians, camera and size from the address and from user input.
//
// The part of the address after # selects the initial state, joined by &: camera=NAME (or numbers, see
// shotOf), show=both, base or supplement, and background=R,G,B (0 to 1). size=WIDTHxHEIGHT makes the page a
// still image of this size, drawn before the page has loaded, without the panel. precision=float blends
// with 32 bits (bytes: 8 bits). pixels writes the image's RGB bytes, rows from the top, in base64 as the
// text of an element with the id "pixels". renderer=webgpu or webgl2 selects the renderer. By default that
// is WebGPU if the browser runs it on a graphics device, but WebGL2 for a still image.

const SHOWS = ["both", "base", "supplement"];
const PRECISIONS = ["half", "float", "bytes"]; // if the browser supports it; otherwise the next lower one
const RENDERERS = ["webgpu", "webgl2"];
const PER_PIXEL = 0.006; // radians of a turn for each pixel dragged
const PER_NOTCH = 0.0012; // change in the logarithm of the distance for each pixel of the wheel

const LOST = "The browser has lost the graphics device; it may restore it.";

const element = (id) => document.getElementById(id);

function say(text) {
    element("message").textContent = text;
    element("message").hidden = !text;
}

/** Parses comma-separated numbers. Throws an Error that names `field` if there are not `count` of them. */
function numbers(field, text, count, expected) {
    const values = text.split(",").map((part) => (part.trim() === "" ? NaN : Number(part)));
    if (values.length !== count || !values.every(Number.isFinite)) throw new Error(`#${field}=${text}: expected ${expected}.`);
    return values;
}

/**
 * Camera named by `text`, or given as width, height, fx, fy, cx, cy, the nine numbers of the rotation by
 * rows, and three of the translation.
 */
function shotOf(scene, text) {
    const named = scene.cameras.find(({ name }) => name === text);
    if (named) return named;
    const expected = `one of ${scene.cameras.length} cameras, such as ${scene.cameras[0].name}, or 18 numbers with commas between: width, ` +
        "height, fx, fy, cx, cy, the rotation from world to camera by rows, the translation";
    const [width, height, fx, fy, cx, cy, ...pose] = numbers("camera", text, 18, expected);
    const rotation = pose.slice(0, 9), t = pose.slice(9);
    const translation = [0, 1, 2].map((i) => t[i] + dot(rotation.slice(3 * i, 3 * i + 3), scene.origin));
    return { name: "", width, height, fx, fy, cx, cy, rotation, translation };
}

/** Settings from the address. */
function wishes(scene) {
    const asked = new URLSearchParams(location.hash.slice(1));
    const show = asked.get("show") || "both";
    if (!SHOWS.includes(show)) throw new Error(`#show=${show}: expected ${SHOWS.join(", ")}.`);
    const size = asked.get("size");
    if (size !== null && !/^[1-9]\d{0,4}x[1-9]\d{0,4}$/.test(size)) {
        throw new Error(`#size=${size}: expected a size such as 640x480.`);
    }
    const precision = asked.get("precision") || "half";
    if (!PRECISIONS.includes(precision)) throw new Error(`#precision=${precision}: expected ${PRECISIONS.join(", ")}.`);
    const renderer = asked.get("renderer") || "";
    if (renderer && !RENDERERS.includes(renderer)) throw new Error(`#renderer=${renderer}: expected ${RENDERERS.join(", ")}.`);
    const background = asked.get("background");
    return {
        show,
        shot: asked.has("camera") ? shotOf(scene, asked.get("camera")) : scene.cameras[0],
        size: size && size.split("x").map(Number),
        background: background ? numbers("background", background, 3, "three numbers from 0 to 1") : scene.background,
        precision,
        renderer,
        pixels: asked.has("pixels"),
    };
}

/** First and last (exclusive) of the Gaussians to show. */
function rangeOf(scene, show) {
    return [show === "supplement" ? scene.base : 0, show === "base" ? scene.base : scene.count];
}

/** Creates the painter for `canvas` that the address selects. A WebGPU device is available only asynchronously. */
async function painterFor(canvas, scene, wish) {
    if (usesGpu(wish)) {
        try {
            return await GpuPainter.make(canvas, scene, wish.precision, wish.renderer);
        } catch (error) {
            if (wish.renderer) throw new Error(`#renderer=webgpu: ${error.message}`);
            console.info(`Drawn by WebGL2, since ${error.message}`);
        }
    }
    return new Painter(canvas, scene, wish.precision);
}

/** Whether to try WebGPU. */
function usesGpu({ renderer, size }) {
    return renderer ? renderer === "webgpu" : !size && !!navigator.gpu;
}

/** Delays the page's load event until the returned function is called, by an open document inside the page. */
function holdLoad() {
    const frame = document.createElement("iframe");
    frame.hidden = true;
    document.body.append(frame);
    frame.contentDocument?.open();
    return () => {
        frame.contentDocument?.close();
        frame.remove();
    };
}

/** Sorts Gaussians for `view` immediately and passes the order to `painter`. */
function orderNow(painter, scene, view, show) {
    const order = new Uint32Array(scene.count), sort = makeSorter(positionsOf(scene));
    painter.setOrder(order.subarray(0, sort([...view.rowZ, scene.near], ...rangeOf(scene, show), order)));
}

/** Draws a single image immediately. */
async function still(scene, wish) {
    const canvas = element("canvas"), [width, height] = wish.size;
    canvas.width = width;
    canvas.height = height;
    canvas.style.cssText = `width: ${width}px; height: ${height}px`;
    const painter = await painterFor(canvas, scene, wish);
    const view = new Camera(wish.shot, scene.focus, upOf(scene.cameras)).view(width, height);
    if (painter.setOrder) orderNow(painter, scene, view, wish.show);
    const drawn = painter.draw(view, wish.background, rangeOf(scene, wish.show));
    if (!wish.pixels) return drawn;
    const rgb = await painter.read();
    const text = document.createElement("pre");
    text.id = "pixels";
    text.hidden = true;
    text.textContent = textOf(rgb);
    document.body.append(text);
}

/** Draws whenever something changes, and handles user input. */
async function interactive(scene, wish) {
    const canvas = element("canvas"), up = upOf(scene.cameras);
    let painter = await painterFor(canvas, scene, wish);
    let camera = new Camera(wish.shot, scene.focus, up);
    let { show, background } = wish;
    let waiting = false, sorted = "", sortTime = 0;

    // WebGPU sorts while drawing; WebGL2 needs a worker for that.
    const order = painter.setOrder && new Order(() => positionsOf(scene), (indices, time) => {
        painter.setOrder(indices);
        sortTime = time;
        ask();
    });

    /** Draws a frame and updates the status. */
    async function frame() {
        waiting = false;
        const ratio = Math.min(window.devicePixelRatio || 1, 2);
        const width = Math.max(1, Math.round(canvas.clientWidth * ratio)), height = Math.max(1, Math.round(canvas.clientHeight * ratio));
        if (canvas.width !== width) canvas.width = width;
        if (canvas.height !== height) canvas.height = height;
        const view = camera.view(width, height);
        const wanted = `${view.rowZ} ${show}`;
        if (order && !sorted) {
            // The first order is made here; waiting for the worker to read the scene would leave the page
            // empty.
            const begin = performance.now();
            orderNow(painter, scene, view, show);
            sortTime = performance.now() - begin;
            sorted = wanted;
        }
        // The previous order is drawn until the next one arrives.
        if (order && wanted !== sorted && order.request(view.rowZ, scene.near, ...rangeOf(scene, show))) sorted = wanted;
        await painter.draw(view, background, rangeOf(scene, show));
        const which = order ? `in front of the camera, sorted in ${sortTime.toFixed(1)} ms` : "seen, sorted with each frame";
        element("status").textContent = `${painter.count} of ${scene.count} Gaussians ${which}; ` +
            `${width} x ${height} pixels, drawn by ${painter.name}, blended as ${painter.precision}`;
    }

    function ask() {
        if (!waiting) requestAnimationFrame(frame);
        waiting = true;
    }

    const list = element("cameras");
    scene.cameras.forEach(({ name }, i) => list.add(new Option(name, i)));
    list.value = String(scene.cameras.indexOf(wish.shot));
    const jump = (to) => {
        list.value = String(to);
        camera = new Camera(scene.cameras[to], scene.focus, up);
        ask();
    };
    list.onchange = () => jump(Number(list.value));

    const parts = element("panel").elements.show;
    const choose = (name) => {
        parts.value = show = name;
        ask();
    };
    parts.forEach((button) => (button.onchange = () => choose(button.value)));
    element("parts").hidden = scene.supplement === 0;
    parts.value = show;

    const color = element("background");
    color.value = "#" + background.map((c) => Math.round(255 * Math.min(Math.max(c, 0), 1)).toString(16).padStart(2, "0")).join("");
    color.oninput = () => {
        background = [1, 3, 5].map((at) => parseInt(color.value.slice(at, at + 2), 16) / 255);
        ask();
    };

    const zoom = (pixels) => {
        camera.zoom(Math.exp(Math.max(-1, Math.min(1, PER_NOTCH * pixels))));
        ask();
    };
    canvas.addEventListener("wheel", (event) => {
        event.preventDefault();
        zoom(event.deltaY * (event.deltaMode === 1 ? 16 : 1));
    }, { passive: false });
    canvas.oncontextmenu = (event) => event.preventDefault();

    // Fingers, pens and the mouse, by id.
    const pointers = new Map();
    canvas.onpointerdown = (event) => {
        canvas.setPointerCapture(event.pointerId);
        pointers.set(event.pointerId, [event.clientX, event.clientY]);
    };
    canvas.onpointerup = canvas.onpointercancel = (event) => pointers.delete(event.pointerId);
    canvas.onpointermove = (event) => {
        const before = pointers.get(event.pointerId);
        if (!before) return;
        const now = [event.clientX, event.clientY], dx = now[0] - before[0], dy = now[1] - before[1];
        if (pointers.size > 1) {
            // Each finger pans by half its movement; a change of their distance zooms.
            const other = [...pointers].find(([id]) => id !== event.pointerId)[1];
            const apart = (p) => Math.max(Math.hypot(p[0] - other[0], p[1] - other[1]), 1);
            camera.zoom(apart(before) / apart(now));
            camera.pan(dx / 2, dy / 2, canvas.clientWidth, canvas.clientHeight);
        } else if (event.shiftKey || event.buttons & 6) {
            camera.pan(dx, dy, canvas.clientWidth, canvas.clientHeight);
        } else {
            camera.orbit(-PER_PIXEL * dx, -PER_PIXEL * dy);
        }
        pointers.set(event.pointerId, now);
        ask();
    };

    document.onkeydown = (event) => {
        if (event.target.tagName === "SELECT" || event.target.type === "color" || event.ctrlKey || event.metaKey || event.altKey) return;
        const at = Number(list.value) || 0, all = scene.cameras.length;
        const key = event.key.toLowerCase();
        if ("123".includes(key) && scene.supplement > 0) choose(SHOWS[key - 1]);
        else if (key === "arrowleft") jump((at + all - 1) % all);
        else if (key === "arrowright") jump((at + 1) % all);
        else if (key === "+" || key === "=") zoom(-100);
        else if (key === "-") zoom(100);
        else if (key === "h") element("panel").hidden = !element("panel").hidden;
        else return;
        event.preventDefault();
    };

    /** Recreates a lost device once. After a second loss, the page reloads without WebGPU. */
    const watch = async (again) => {
        await painter.device.lost;
        say(LOST);
        try {
            if (!again) throw new Error("lost twice");
            painter = await GpuPainter.make(canvas, scene, wish.precision, wish.renderer);
            say("");
            ask();
            watch(false);
        } catch {
            const asked = new URLSearchParams(location.hash.slice(1));
            asked.set("renderer", "webgl2");
            location.hash = asked;
        }
    };
    if (painter.device) watch(true);

    new ResizeObserver(ask).observe(canvas);
    canvas.addEventListener("webglcontextlost", (event) => {
        event.preventDefault();
        say(LOST);
    });
    canvas.addEventListener("webglcontextrestored", () => attempt(() => {
        painter = new Painter(canvas, scene, wish.precision);
        sorted = "";
        say("");
        ask();
    }));
    onhashchange = () => location.reload();
    element("panel").hidden = false;
    await frame(); // immediately: a browser that is busy or shows another page would delay it
}

/** Does `work` and shows an error instead of throwing it. */
async function attempt(work) {
    try {
        await work();
    } catch (error) {
        say(error.message);
    }
}

attempt(async () => {
    const scene = readScene(), wish = wishes(scene);
    const release = usesGpu(wish) ? holdLoad() : () => {};
    try {
        await (wish.size ? still : interactive)(scene, wish);
    } finally {
        release();
    }
});
