#!/usr/bin/env python3
"""Trains a COLMAP dataset by gsplat's MCMC, to compare with `glint train` on the same files. Prints one line of JSON.

    gsplat_mcmc.py DATASET --gaussians N [--steps S] [--max-size PIXELS] [--seed K]

The rasterizer and the strategy are those of the published package (`pip install gsplat`, 1.4 or later, and `pillow`), its constants those
of the preset `mcmc` of its example trainer: of 30,000 steps, in the same proportions where there are others. Photographs, their reduction,
points and the test photos (every 8th by name, the first too) are those of glint; the background is black. Models that are no pinholes are
refused. Seconds are those of the steps alone, and gsplat compiles its kernels when it is first called, which `warm` has done before.

It has run with gsplat 1.5.3, torch 2.11 and CUDA 13 on an H200.
"""

import argparse
import json
import math
import struct
import time
from pathlib import Path
from types import SimpleNamespace

# From gsplat's preset: steps of a full run, and initial Gaussians.
FULL_RUN = 30_000
RATES = {"means": 1.6e-4, "scales": 5e-3, "quats": 1e-3, "opacities": 5e-2, "sh0": 2.5e-3, "shN": 2.5e-3 / 20}
OPACITY, SCALE, WEIGHT, SSIM, DEGREE, NEAR = 0.5, 0.1, 0.01, 0.2, 3, 0.01
# As in glint: every 8th photo by name is for testing.
TEST_EVERY = 8
SH_C0 = 0.28209479177387814
# Parameters of COLMAP's models by number: f, cx, cy and fx, fy, cx, cy.
PINHOLES = {0: 3, 1: 4}


def records(path, read):
    """The records of a COLMAP file. `read` parses one, given a function that reads numbers from the front."""
    data, at = path.read_bytes(), 0

    def take(form):
        nonlocal at
        values = struct.unpack_from("<" + form, data, at)
        at += struct.calcsize("<" + form)
        return values

    def name():
        nonlocal at
        end = data.index(0, at)
        text, at = data[at:end].decode(), end + 1
        return text

    return [read(take, name) for _ in range(take("Q")[0])]


def read_model(folder):
    """Photos sorted by name (size and K of their camera, rotation w x y z and translation, world to camera), and points as
    (x, y, z, red, green, blue)."""

    def camera(take, _):
        number, model, width, height = take("IIQQ")
        if model not in PINHOLES:
            raise SystemExit(f"{folder}/cameras.bin: camera {number} is of model {model}; expected a pinhole, 0 or 1")
        *focal, cx, cy = take(f"{PINHOLES[model]}d")
        return number, SimpleNamespace(size=(width, height), K=(focal[0], focal[-1], cx, cy))

    def photo(take, name):
        take("I")
        pose, (number,) = take("7d"), take("I")
        found = SimpleNamespace(quat=pose[:4], translation=pose[4:], camera=number, name=name())
        take(f"{24 * take('Q')[0]}x")
        return found

    def point(take, _):
        take("Q")
        found = take("3d3B")
        take("d")
        take(f"{8 * take('Q')[0]}x")
        return found

    cameras = dict(records(folder / "cameras.bin", camera))
    photos = sorted(records(folder / "images.bin", photo), key=lambda photo: photo.name)
    for photo in photos:
        photo.camera = cameras[photo.camera]
    return photos, records(folder / "points3D.bin", point)


def rotation(w, x, y, z):
    """The matrix of a quaternion of any length."""
    s = 2 / (w * w + x * x + y * y + z * z)
    return [
        [1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)],
        [s * (x * y + w * z), 1 - s * (x * x + z * z), s * (y * z - w * x)],
        [s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y)],
    ]


def fit(width, height, limit):
    """The size with a longer side of at most `limit`, as in glint: never enlarged, and half a pixel rounds up."""
    longer = max(width, height)
    if longer <= limit:
        return width, height
    return tuple(max(1, math.floor(side * limit / longer + 0.5)) for side in (width, height))


def read_views(photos, folder, limit):
    """For each existing photo: image [height, width, 3] as bytes, viewmat [4, 4], K [3, 3], and whether it is for testing."""
    import numpy
    import torch
    from PIL import Image

    views = []
    for i, photo in enumerate(photos):
        path = folder / photo.name
        # A missing photo keeps its place in the order.
        if not path.is_file():
            continue
        image = Image.open(path)
        if "A" in image.getbands() or "transparency" in image.info:
            image = Image.alpha_composite(Image.new("RGBA", image.size, (0, 0, 0, 255)), image.convert("RGBA"))
        image = image.convert("RGB")
        size = fit(*image.size, limit)
        if size != image.size:
            image = image.resize(size, Image.Resampling.BOX)  # the mean over each pixel's area
        fx, fy, cx, cy = photo.camera.K
        sx, sy = (side / whole for side, whole in zip(size, photo.camera.size))
        viewmat = torch.eye(4)
        viewmat[:3, :3] = torch.tensor(rotation(*photo.quat))
        viewmat[:3, 3] = torch.tensor(photo.translation)
        K = torch.tensor([[fx * sx, 0, cx * sx], [0, fy * sy, cy * sy], [0, 0, 1]], dtype=torch.float32)
        pixels = torch.from_numpy(numpy.array(image))
        views.append(SimpleNamespace(name=photo.name, pixels=pixels, viewmat=viewmat, K=K, test=i % TEST_EVERY == 0))
    return views


def normalise(views, points):
    """Moves the cameras' target to the origin and scales their median distance from it to 1, as gsplat's weights, noise and near plane
    assume. Returns 1.1 times the largest distance of a camera from their mean: the unit of the rates of positions."""
    import torch

    turns = torch.stack([view.viewmat[:3, :3] for view in views]).double()
    eyes = -(turns.transpose(1, 2) @ torch.stack([view.viewmat[:3, 3:] for view in views]).double())[..., 0]
    axes = turns[:, 2]
    across = torch.eye(3).double() - axes[:, :, None] * axes[:, None, :]
    # The point nearest to all optical axes, pulled slightly toward the cameras' middle so that it exists for parallel axes.
    little = 1e-6 * len(views) * torch.eye(3).double()
    centre = torch.linalg.solve(across.sum(0) + little, (across @ eyes[..., None]).sum(0)[..., 0] + little @ eyes.mean(0))
    scale = 1 / (eyes - centre).norm(dim=1).median()
    for view, turn, eye in zip(views, turns, eyes):
        view.viewmat[:3, 3] = (-turn @ ((eye - centre) * scale)).float()
    points[:, :3] = ((points[:, :3].double() - centre) * scale).float()
    return 1.1 * ((eyes - eyes.mean(0)) * scale).norm(dim=1).max().item()


def nearest(points):
    """Root mean square of the distances to the three nearest others. [N, 3] -> [N]"""
    import torch

    three = [torch.cdist(part, points).topk(4, largest=False).values[:, 1:] for part in points.split(1024)]
    return (torch.cat(three) ** 2).mean(1).sqrt().clamp_min(1e-7)


def first(points, extent, device):
    """Parameters and their optimisers. points [N, 6]: positions and colors from 0 to 255."""
    import torch

    count = len(points)
    points = points.to(device)
    sh0 = ((points[:, 3:] / 255 - 0.5) / SH_C0)[:, None]
    start = {
        "means": points[:, :3].clone(),
        "scales": torch.log(SCALE * nearest(points[:, :3]))[:, None].repeat(1, 3),
        "quats": torch.rand((count, 4), device=device),
        "opacities": torch.logit(torch.full((count,), OPACITY, device=device)),
        "sh0": sh0,
        "shN": torch.zeros((count, (DEGREE + 1) ** 2 - 1, 3), device=device),
    }
    params = torch.nn.ParameterDict({name: torch.nn.Parameter(value) for name, value in start.items()})
    rate = lambda name: RATES[name] * (extent if name == "means" else 1)
    adam = lambda name: torch.optim.Adam([{"params": params[name], "lr": rate(name), "name": name}], eps=1e-15)
    return params, {name: adam(name) for name in params}


def render(rasterize, params, view, degree):
    """[1, height, width, 3]"""
    import torch

    height, width = view.pixels.shape[:2]
    colors = torch.cat([params["sh0"], params["shN"]], 1)
    scales, opacities = params["scales"].exp(), params["opacities"].sigmoid()
    device = colors.device
    return rasterize(
        means=params["means"], quats=params["quats"], scales=scales, opacities=opacities, colors=colors,
        viewmats=view.viewmat[None].to(device), Ks=view.K[None].to(device), width=width, height=height,
        sh_degree=degree, near_plane=NEAR, packed=False,
    )[::2]


def ssim(a, b):
    """Mean structural similarity of images [1, 3, height, width], over the pixels whose window (11 pixels, deviation 1.5) is inside."""
    import torch

    x = torch.arange(11, device=a.device) - 5.0
    line = torch.exp(-0.5 * (x / 1.5) ** 2)
    line = (line / line.sum()).expand(3, 1, 1, 11)
    blur = lambda v: torch.conv2d(torch.conv2d(v, line, groups=3), line.transpose(2, 3), groups=3)
    mean_a, mean_b = blur(a), blur(b)
    var_a, var_b, both = blur(a * a) - mean_a**2, blur(b * b) - mean_b**2, blur(a * b) - mean_a * mean_b
    c1, c2 = 0.01**2, 0.03**2
    return ((2 * mean_a * mean_b + c1) * (2 * both + c2) / ((mean_a**2 + mean_b**2 + c1) * (var_a + var_b + c2))).mean()


def train(views, params, optimizers, rasterize, strategy, steps, similarity=ssim):
    """Runs all steps, each on one photo; no photo repeats before all were used."""
    import torch

    strategy.check_sanity(params, optimizers)
    state = strategy.initialize_state()
    falling = torch.optim.lr_scheduler.ExponentialLR(optimizers["means"], gamma=0.01 ** (1 / steps))
    interval, order = max(1, 1000 * steps // FULL_RUN), []
    for step in range(steps):
        order = order or torch.randperm(len(views)).tolist()
        view = views[order.pop()]
        pixels = view.pixels.to(params["means"].device)[None] / 255
        image, info = render(rasterize, params, view, min(step // interval, DEGREE))
        planes = lambda image: image.permute(0, 3, 1, 2)
        unlike = 1 - similarity(planes(image), planes(pixels))
        loss = (1 - SSIM) * (image - pixels).abs().mean() + SSIM * unlike
        loss = loss + WEIGHT * (params["opacities"].sigmoid().mean() + params["scales"].exp().mean())
        loss.backward()
        for optimizer in optimizers.values():
            optimizer.step()
            optimizer.zero_grad(set_to_none=True)
        falling.step()
        strategy.step_post_backward(params, optimizers, state, step, info, lr=falling.get_last_lr()[0])


def evaluate(views, params, rasterize):
    """The mean over photos of the PSNR of clamped renders, dB."""
    import torch

    with torch.no_grad():
        errors = [
            (render(rasterize, params, view, DEGREE)[0][0].clamp(0, 1) - view.pixels.to(params["means"].device) / 255) ** 2
            for view in views
        ]
        return sum(-10 * math.log10(max(error.double().mean().item(), 1e-15)) for error in errors) / len(errors)


def schedule(steps, gaussians):
    """Arguments of gsplat's strategy."""
    part = lambda step: max(1, step * steps // FULL_RUN)
    return {
        "cap_max": gaussians, "refine_start_iter": part(500), "refine_stop_iter": part(25_000), "refine_every": part(100),
    }


def run(dataset, gaussians, steps, limit, seed, rasterize, strategy, device, similarity=ssim, wait=lambda: None, before=None):
    """The results without the versions. `wait` returns when the device is done; `before` is called with views and parameters."""
    import torch

    torch.manual_seed(seed)
    photos, points = read_model(dataset / "sparse" / "0")
    views = read_views(photos, dataset / "images", limit)
    points = torch.tensor(points, dtype=torch.float64)
    if len(points) > gaussians:
        points = points[torch.randperm(len(points))[:gaussians]]
    training, test = ([view for view in views if view.test == wanted] for wanted in (False, True))
    if not training or not test or not len(points):
        raise SystemExit(f"{dataset}: {len(training)} training photos, {len(test)} test photos, {len(points)} points")
    points = points.double()
    extent = normalise(training + test, points)
    params, optimizers = first(points.float(), extent, device)
    for view in views:
        view.pixels = view.pixels.to(device)
    if before:
        before(training, params)
    wait()
    began = time.perf_counter()
    train(training, params, optimizers, rasterize, strategy, steps, similarity)
    wait()
    seconds = time.perf_counter() - began
    return {
        "psnr": evaluate(test, params, rasterize), "seconds": seconds, "gaussians": len(params["means"]), "steps": steps,
        "photos": len(training), "test_photos": len(test), "missing_photos": len(photos) - len(views),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--gaussians", type=int, required=True)
    parser.add_argument("--steps", type=int, default=FULL_RUN)
    parser.add_argument("--max-size", type=int, default=1600)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()

    import gsplat
    import torch

    # The SSIM of gsplat's own trainer, if it is installed.
    try:
        from fused_ssim import fused_ssim

        name, similarity = "fused_ssim", lambda a, b: fused_ssim(a, b, padding="valid")
    except ImportError:
        name, similarity = "torch", ssim

    def warm(views, params):
        render(gsplat.rasterization, params, views[0], 0)[0].sum().backward()
        params.zero_grad()

    strategy = gsplat.MCMCStrategy(**schedule(asked.steps, asked.gaussians))
    found = run(
        asked.dataset, asked.gaussians, asked.steps, asked.max_size, asked.seed, gsplat.rasterization, strategy, "cuda",
        similarity, torch.cuda.synchronize, warm,
    )
    found["device"] = torch.cuda.get_device_name()
    found["versions"] = {"gsplat": gsplat.__version__, "torch": torch.__version__, "cuda": torch.version.cuda, "ssim": name}
    print(json.dumps(found))


if __name__ == "__main__":
    main()
