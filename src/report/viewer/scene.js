// Reads the data of the page: the scene's description (JSON) and its blocks (base64), see pack.rs.

/** Bytes of the element `id`, which is removed: its text is read only once and is a third larger than the bytes. */
function bytesOf(id) {
    const element = document.getElementById(id);
    const text = element ? element.textContent : "";
    if (element) element.remove();
    if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
    const padding = text.endsWith("==") ? 2 : text.endsWith("=") ? 1 : 0;
    const bytes = new Uint8Array((text.length / 4) * 3 - padding);
    // Decodes whole groups of four characters at a time, to avoid a second text of the full length.
    const piece = 1 << 20;
    for (let from = 0, at = 0; from < text.length; from += piece) {
        const part = atob(text.slice(from, from + piece));
        for (let i = 0; i < part.length; ++i) bytes[at++] = part.charCodeAt(i);
    }
    return bytes;
}

/** Encodes bytes as base64. */
function textOf(bytes) {
    let text = "";
    // A call takes only some ten thousand arguments.
    for (let from = 0; from < bytes.length; from += 8192) text += String.fromCharCode(...bytes.subarray(from, from + 8192));
    return btoa(text);
}

const WORDS_OF_GEOMETRY = 8; // for each Gaussian

/**
 * Reads the scene from the page into typed arrays of little-endian words, the byte order of every machine
 * with a browser.
 */
function readScene() {
    const scene = JSON.parse(document.getElementById("scene").textContent);
    const words = (id) => new Uint32Array(bytesOf(id).buffer);
    scene.geometry = words("geometry");
    scene.harmonics = scene.degree > 0 ? words("harmonics") : null;
    scene.lobes = scene.supplement > 0 ? words("lobes") : null;
    scene.count = scene.base + scene.supplement;
    return scene;
}

/** Positions x, y, z of all Gaussians, for the sort. */
function positionsOf(scene) {
    const words = new Float32Array(scene.geometry.buffer);
    const positions = new Float32Array(3 * scene.count);
    for (let i = 0; i < scene.count; ++i) {
        for (let axis = 0; axis < 3; ++axis) positions[3 * i + axis] = words[WORDS_OF_GEOMETRY * i + axis];
    }
    return positions;
}
