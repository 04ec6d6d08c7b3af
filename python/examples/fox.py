"""Trains and augments a scene, logs the run to Rerun and shows the scene in viser.

    python fox.py DATASET [--iterations 3000] [--max-size 200] [--headless]

Cells begin with `# %%`: editors that know notebooks run them one by one. Needs `pip install viser rerun-sdk`. With --headless the
program ends by itself. It writes base.ply, fox.ply and fox.rrd into the working directory.
"""

# %% Arguments
import argparse

import glint_splat as g
import numpy as np
import rerun as rr
import viser

parser = argparse.ArgumentParser(description="Trains, augments, logs and shows a scene.")
parser.add_argument("dataset", help="folder or JSON file of the dataset, such as instant-ngp's fox")
parser.add_argument("--iterations", type=int, default=3000, help="steps of training [default: 3000]")
parser.add_argument("--max-size", type=int, default=200, help="longest side of the photos, pixels [default: 200]")
parser.add_argument("--headless", action="store_true", help="open no viewer and do not wait")
given = parser.parse_args()

# %% Rerun gets cameras and photos
rr.init("glint")
rr.save("fox.rrd")
dataset = g.dataset(given.dataset, max_size=given.max_size)
for photo in dataset.photos:
    camera, path = photo.camera, f"world/{photo.split}/{photo.name}"
    pose = np.linalg.inv(camera.viewmat)
    rr.log(path, rr.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3]), static=True)
    rr.log(path, rr.Pinhole(image_from_camera=camera.K, resolution=[camera.width, camera.height]), static=True)
    rr.log(path, rr.Image(photo.image()).compress(), static=True)

# %% Training and augmentation
for name, run in [
    ("train", lambda: g.train(given.dataset, "base.ply", iterations=given.iterations, max_size=given.max_size)),
    ("enhance", lambda: g.enhance(given.dataset, "base.ply", "fox.ply")),
]:
    for step in run():
        rr.set_time("step", sequence=step.step)
        rr.log(f"{name}/gaussians", rr.Scalars(step.gaussians))
        if step.psnr is not None:
            rr.log(f"{name}/loss", rr.Scalars(step.loss))
            rr.log(f"{name}/psnr", rr.Scalars(step.psnr))
    print(f"{name}: {step.step} steps, {step.gaussians} Gaussians, {step.psnr:.2f} dB, {step.seconds:.1f} s", flush=True)

# %% Test photos
scores = g.evaluate("fox.ply", given.dataset)
print(f"test photos: {scores['base']['psnr']:.2f} dB without lobes, {scores['augmented']['psnr']:.2f} dB with them", flush=True)
scene = g.load("fox.ply")
for photo in dataset.photos:
    if photo.split == "test":
        image = np.clip(g.render(scene, photo.camera).image, 0, 1)
        rr.log(f"test/{photo.name}", rr.Image((image * 255 + 0.5).astype(np.uint8)).compress(), static=True)

# %% viser shows the base
SH_DC = 0.28209479177387814
own = scene.base
w, x, y, z = (own.quats / np.linalg.norm(own.quats, axis=1, keepdims=True)).T
rotations = np.array(
    [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
).transpose(2, 0, 1)
axes = rotations * np.exp(own.log_scales)[:, None]
server = viser.ViserServer(host="127.0.0.1", verbose=not given.headless)
server.scene.set_up_direction("-y")
server.scene.add_gaussian_splats(
    "/scene",
    centers=own.means,
    covariances=axes @ axes.transpose(0, 2, 1),
    rgbs=np.clip(0.5 + SH_DC * own.sh[:, 0], 0, 1),
    opacities=1 / (1 + np.exp(-own.opacity_logits[:, None])),
)
print(f"viser: http://127.0.0.1:{server.get_port()}, Rerun: rerun fox.rrd", flush=True)
if given.headless:
    server.stop()
else:
    server.sleep_forever()
