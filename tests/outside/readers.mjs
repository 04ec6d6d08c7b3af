// Asks programs of others for two PLY files, an augmented scene and its base alone: node readers.mjs AUGMENTED BASE. To every one of them
// both must be the same. Run by tools/readers, where the packages are installed.
import { execFileSync } from "node:child_process";
import { createHash } from "node:crypto";
import { readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

// Some of these libraries look for a browser when they are loaded.
globalThis.self ??= globalThis;
globalThis.window ??= globalThis;
globalThis.document ??= { createElement: () => ({ style: {}, getContext: () => null, addEventListener() {} }) };
globalThis.ProgressEvent ??= class {};

// A hash of all numbers that can be reached from a value, and how many there are.
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
            // Objects of three and gsplat are numbered and named as they are made.
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

// Each gives what it made of the file at a path.
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
for (const [name, read] of Object.entries(readers)) {
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
