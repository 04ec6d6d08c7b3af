// Reads two PLY or SPZ files with other programs, an augmented scene and its base alone: node readers.mjs AUGMENTED BASE. Each program
// must get the same data from both. With levels of detail, node readers.mjs lod-meta.json SCENE.rad, each must find the scene's Gaussians.
// Run by tools/readers, which installs the packages.
import { execFile, execFileSync } from "node:child_process";
import { createHash } from "node:crypto";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { createServer } from "node:http";
import { tmpdir } from "node:os";
import { extname, join } from "node:path";

// Some of these libraries check for a browser when loaded.
globalThis.self ??= globalThis;
globalThis.window ??= globalThis;
globalThis.document ??= { createElement: () => ({ style: {}, getContext: () => null, addEventListener() {} }) };
globalThis.ProgressEvent ??= class {};

// A hash of all numbers reachable from a value, and their count.
function digest(value) {
    const hash = createHash("sha256"), seen = new Set();
    let numbers = 0;
    const visit = (name, v) => {
        if (typeof v === "number") {
            numbers += 1;
            hash.update(`${name}=${v};`);
        } else if (ArrayBuffer.isView(v)) {
            numbers += v.length ?? 0;
            hash.update(`${name}:${v.length};`).update(new Uint8Array(v.buffer, v.byteOffset, v.byteLength));
        } else if (v && typeof v === "object" && !seen.has(v)) {
            seen.add(v);
            // three and gsplat give each new object a number and a name.
            const keys = Object.keys(v).filter((key) => !["uuid", "id", "_id", "__id", "version"].includes(key));
            keys.forEach((key) => visit(Array.isArray(v) ? name : `${name}.${key}`, v[key]));
        }
    };
    visit("", value);
    return { numbers, hash: hash.digest("hex") };
}

const buffer = (path) => {
    const bytes = readFileSync(path);
    return bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);
};

// Spark decodes in a worker, which needs a browser: returns the text of a Chromium page that has read the file. An open document in the
// page delays its load event until then.
async function inSpark(path) {
    const page = `<!doctype html><body><script type="importmap">{"imports": {"three": "/node_modules/three/build/three.module.js",
        "three/addons/": "/node_modules/three/examples/jsm/"}}</script><script type="module">
        const frame = document.createElement("iframe"), told = document.createElement("pre");
        document.body.append(frame, told);
        frame.contentDocument.open();
        try {
            const { PackedSplats } = await import("/node_modules/@sparkjsdev/spark/dist/spark.module.js");
            const fileBytes = new Uint8Array(await (await fetch("/scene")).arrayBuffer());
            const file = new PackedSplats({ fileBytes, fileName: "scene${extname(path)}" });
            await file.initialized;
            const splats = file.lodSplats ?? file;
            const { sh1, sh2, sh3, lodTree } = splats.extra;
            // Four words a Gaussian; the third is the number of its children.
            const leaves = lodTree?.filter((word, at) => at % 4 === 2 && word === 0).length;
            const parts = [splats.packedArray.subarray(0, 4 * splats.numSplats), sh1, sh2, sh3].filter((part) => part);
            told.textContent = "DECODED " + JSON.stringify({ count: splats.numSplats, leaves, parts: parts.map((part) => [...part]) }) + " END";
        } catch (error) {
            told.textContent = "FAILED " + error + " END";
        }
        frame.contentDocument.close();</script></body>`;
    const served = (url) => (url === "/" ? page : readFileSync(url === "/scene" ? path : `.${url}`));
    const server = createServer(({ url }, reply) => {
        if (url.includes("..") || !["/", "/scene"].includes(url) && !url.startsWith("/node_modules/")) return reply.writeHead(404).end();
        reply.setHeader("content-type", url === "/" ? "text/html" : url.endsWith("js") ? "text/javascript" : "application/octet-stream");
        reply.end(served(url));
    });
    await new Promise((ready) => server.listen(0, "127.0.0.1", ready));
    const profile = mkdtempSync(join(tmpdir(), "glint-"));
    const flags = ["--headless", "--no-sandbox", "--disable-gpu", `--user-data-dir=${profile}`, "--dump-dom"];
    const address = `http://127.0.0.1:${server.address().port}/`;
    const dom = await new Promise((done, failed) => {
        const more = { maxBuffer: 1 << 30, timeout: 120000 };
        execFile("chromium", [...flags, address], more, (error, text) => (error ? failed(error) : done(text)));
    });
    server.close();
    rmSync(profile, { recursive: true, force: true });
    const [, what, text] = dom.match(/<pre>(DECODED|FAILED) (.*) END<\/pre>/s) ?? [null, "FAILED", "the page told nothing"];
    if (what === "FAILED") throw new Error(text);
    return JSON.parse(text);
}

// Each reads the file at a path, and returns its data.
const readers = {
    "three, PLYLoader": async (path) => {
        const { PLYLoader } = await import("three/examples/jsm/loaders/PLYLoader.js");
        const loader = new PLYLoader();
        loader.setCustomPropertyNameMapping({ shown: ["f_dc_0", "f_dc_1", "f_dc_2", "opacity"] });
        return loader.parse(buffer(path)).attributes;
    },
    "three, GaussianSplatPLYLoader": async (path) => {
        const { GaussianSplatPLYLoader } = await import("three/examples/jsm/loaders/GaussianSplatPLYLoader.js");
        return new GaussianSplatPLYLoader().parse(buffer(path));
    },
    "@mkkellogg/gaussian-splats-3d": async (path) => {
        const { PlyParser } = await import("@mkkellogg/gaussian-splats-3d");
        return PlyParser.parseToUncompressedSplatArray(buffer(path), 2).splats;
    },
    gsplat: async (path) => {
        const { PLYLoader, Scene } = await import("gsplat");
        return PLYLoader.LoadFromArrayBuffer(buffer(path), new Scene()).data;
    },
    "@sparkjsdev/spark, in Chromium": inSpark,
    "@playcanvas/splat-transform": async (path) => {
        const csv = join(tmpdir(), `glint-${process.pid}.csv`);
        const cli = "node_modules/@playcanvas/splat-transform/bin/cli.mjs";
        execFileSync(process.execPath, [cli, "-w", path, csv], { stdio: ["ignore", "ignore", "pipe"] });
        const rows = readFileSync(csv, "utf8").trim().split("\n").slice(1);
        rmSync(csv);
        return rows.map((row) => Float64Array.from(row.split(","), Number));
    },
};

const [augmented, base] = process.argv.slice(2);
let failed = false;
if (augmented.endsWith("lod-meta.json")) {
    const [count] = JSON.parse(readFileSync(augmented)).counts;
    const { leaves } = await inSpark(base);
    const rows = await readers["@playcanvas/splat-transform"](augmented);
    failed = rows.length !== count || leaves !== count;
    console.log(`${failed ? "NOT ALL" : "all"} ${count} Gaussians: splat-transform ${rows.length}, Spark ${leaves} leaves`);
    process.exit(failed ? 1 : 0);
}
for (const [name, read] of Object.entries(readers)) {
    // splat-transform refuses a PLY with bytes behind the declared ones. The others read PLY, or SPZ up to version 3.
    if (augmented.endsWith(".spz") !== (name === "@playcanvas/splat-transform")) continue;
    try {
        const [a, b] = [digest(await read(augmented)), digest(await read(base))];
        const same = a.hash === b.hash && a.numbers === b.numbers && a.numbers > 0;
        failed ||= !same;
        console.log(`${same ? "the base" : "NOT THE BASE"}  ${name}: ${a.numbers} numbers${same ? "" : `, of the base ${b.numbers}`}`);
    } catch (error) {
        failed = true;
        console.log(`REFUSED  ${name}: ${error.stack ?? error}`);
    }
}
process.exit(failed ? 1 : 0);
