"""Renders from numpy, beside the command line's files."""

import gc
import json
import os
import subprocess
import sys

import glint_splat as g
import numpy as np
import pytest

exr = pytest.importorskip("OpenEXR")


def channels(path):
    return {name: channel.pixels for name, channel in exr.File(str(path)).channels().items()}


@pytest.mark.parametrize("what", ["color", "depth", "transmittance"])
def test_renders_are_the_command_line_s_bit_for_bit(glint, folder, photos, augmented, what):
    written = json.loads(
        glint("render", augmented, photos, "-o", folder / what, "--format=exr", f"--what={what}", "--split=all", "--json")
    )
    scene, dataset = g.load(augmented), g.dataset(photos)
    assert [photo.name for photo in dataset.photos] == [view["name"] for view in written]
    for photo, view in zip(dataset.photos, written):
        rendered, file = g.render(scene, photo.camera, depth=what == "depth"), channels(view["file"])
        if what == "color":
            assert rendered.image.tobytes() == file["RGB"].tobytes()
        elif what == "depth":
            assert rendered.depth.tobytes() == file["Z"].tobytes()
        else:
            assert np.array_equal(rendered.alpha, 1 - file["Y"])
            assert rendered.depth is None


def test_photos_are_what_training_sees(photos):
    photo = g.dataset(photos, max_size=24, holdout=4).photos[0]
    assert (photo.split, photo.camera.width, photo.image().shape, photo.mask()) == ("test", 24, (24, 24, 3), None)
    assert photo.image().dtype == np.uint8 and photo.image().std() > 10
    points = g.dataset(photos).points
    assert points.shape == (300, 3) and points.dtype == np.float64


def test_backgrounds_and_sizes_change_from_call_to_call(photos, base):
    scene, camera = g.load(base), g.dataset(photos).photos[0].camera
    black = g.render(scene, camera)
    white = g.render(scene, camera, background=(1.0, 1.0, 1.0))
    assert np.allclose(white.image - black.image, 1 - black.alpha[..., None], atol=1e-6)
    small = camera._replace(width=20, height=30)
    assert g.render(scene, small).image.shape == (30, 20, 3)
    assert np.array_equal(g.render(scene, camera).image, black.image)
    assert not np.array_equal(g.render(scene, camera, compensate=True).image, black.image)


def test_bad_cameras_are_refused(base):
    scene, k = g.load(base), np.array([[30.0, 0, 12], [0, 30, 8], [0, 0, 1]])
    skewed, moved = k.copy(), np.eye(4)
    skewed[0, 1], moved[3, 0] = 1, 1
    for camera, said in [
        (g.Camera(24, 0, k, np.eye(4)), "24 × 0 pixels"),
        (g.Camera(24, 16, skewed, np.eye(4)), "expected rows fx 0 cx"),
        (g.Camera(24, 16, k, moved), "a last row of 0 0 0 1"),
        (g.Camera(24, 16, k, np.eye(4) * np.nan), "a camera"),
        (g.Camera(24, 16, k[0], np.eye(4)), r"K has shape \[3\], expected 2 dimensions"),
        (g.Camera(24, 16, k, np.diag([2.0, 2, 2, 1])), "expected a rotation"),
    ]:
        with pytest.raises(g.InputError, match=said):
            g.render(scene, camera)
    with pytest.raises(g.InputError, match="--device"):
        g.render(scene, g.Camera(24, 16, k, np.eye(4)), device="no such device")


def test_a_forked_process_is_refused(photos, base):
    """Its parent's device would never answer."""
    code = f"""
import os, numpy as np, glint_splat as g
scene, camera = g.load({str(base)!r}), g.dataset({str(photos)!r}).photos[0].camera
arrays = np.zeros((1, 3)), np.ones((1, 4)), np.ones((1, 3)), np.ones(1), np.ones((1, 3)), np.eye(4)[None], np.eye(3)[None], 8, 8
g.render(scene, camera)
*_, meta = g.rasterization(*arrays)
calls = lambda: g.render(scene, camera), lambda: g.rasterization(*arrays), lambda: meta.backward(np.ones((1, 8, 8, 3)))
if os.fork() == 0:
    for call in calls:
        try:
            call()
        except g.InputError as error:
            print(error, flush=True)
    os._exit(0)
os.wait()
for call in calls:
    call()
"""
    ended = subprocess.run([sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True, timeout=60)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert ended.stdout.count("cannot use the device that its parent has opened") == 3


def resident():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def test_a_thousand_renders_leak_nothing(photos, base):
    """A leak of one image of 48 × 48 pixels in each render would be 37 MB."""
    scene, camera = g.load(base), g.dataset(photos).photos[0].camera
    own = scene.base
    arrays = own.means, own.quats, np.exp(own.log_scales), 1 / (1 + np.exp(-own.opacity_logits)), own.sh

    def render(times):
        for turn in range(times):
            g.render(scene, camera)
            if turn % 5 == 0:
                *_, meta = g.rasterization(*arrays, camera.viewmat[None], camera.K[None], 48, 48, sh_degree=3)
                meta.backward(np.ones((1, 48, 48, 3)))
        gc.collect()

    render(100)
    before = resident()
    render(1000)
    assert resident() - before < 4e6
