#!/usr/bin/env python3
"""Time of a frame from numpy beside that of `Frames`, in turns: medians of the turns, milliseconds.

    cargo bench --bench frame --no-run                                      # it prints the program's path
    target/python/bin/python bench/python.py PROGRAM SCENE DATASET          # after tools/python

Each turn times 20 frames of `Frames` (bench/frame.rs), of `glint_splat.render` and of `glint_splat.rasterization`, with the same
cameras. `Frames` keeps three frames in flight and reads none back; from numpy each image is in the host's memory before the next begins.
"""

import json
import subprocess
import sys
import time

import glint_splat as g
import numpy as np

TURNS, FRAMES, SIZE = 7, 20, (640, 480)


def each(draw):
    """Milliseconds of a call."""
    began = time.perf_counter()
    for n in range(FRAMES):
        draw(n)
    return (time.perf_counter() - began) * 1e3 / FRAMES


program, path, photos = sys.argv[1:]
scene, camera = g.load(path), g.dataset(photos).photos[0].camera
width, height = SIZE
zoom = width / camera.width
K = np.array([[camera.K[0, 0] * zoom, 0, width / 2], [0, camera.K[1, 1] * zoom, height / 2], [0, 0, 1]])
own = scene.base
arrays = own.means, own.quats, np.exp(own.log_scales), 1 / (1 + np.exp(-own.opacity_logits)), own.sh


def seen_from(n):
    c, s = np.cos(n * 1e-3), np.sin(n * 1e-3)
    return np.array([[c, 0, s, 0], [0, 1, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1]]) @ camera.viewmat


def frames():
    command = [program, path, photos, f"--size={width}x{height}", f"--frames={FRAMES}", "--json"]
    return json.loads(subprocess.run(command, check=True, capture_output=True).stdout)["wall_ms"]


def render(n):
    g.render(scene, g.Camera(width, height, K, seen_from(n)))


def rasterize(n):
    g.rasterization(*arrays, seen_from(n)[None], K[None], width, height, sh_degree=own.sh_degree)


render(0)
rasterize(0)
turns = np.array([(frames(), each(render), each(rasterize)) for _ in range(TURNS)])
of_frames, of_render, of_rasterization = np.median(turns, axis=0)
share = np.median(turns[:, 1] / turns[:, 0])
print(f"{len(own)} Gaussians, {width}x{height}: Frames {of_frames:.1f} ms, rasterization {of_rasterization:.1f} ms")
print(f"render {of_render:.1f} ms, {share:.2f} of Frames")
