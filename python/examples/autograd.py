"""Trains a scene with torch's Adam: glint rasterizes and differentiates, torch has the parameters and the loss.

    python autograd.py DATASET scene.ply [--iterations 2000] [--points 4000] [--max-size 200]

The number of Gaussians stays that of the points, and masks are ignored. Rates and loss are those of 3D Gaussian splatting (Kerbl
2023). The last line is PSNR and SSIM of the test photos, as JSON. Needs `pip install torch`,
for the CPU or a GPU.
"""

import argparse
import json
import math

import glint_splat as g
import numpy as np
import torch
from torch.nn.functional import conv2d

SH_DC = 0.28209479177387814


class Rasterize(torch.autograd.Function):
    """`glint_splat.rasterization` as a function of means, quats, scales, opacities and colors. `options` are its other arguments."""

    @staticmethod
    def forward(ctx, means, quats, scales, opacities, colors, options):
        arrays = (array.cpu() for array in (means, quats, scales, opacities, colors))
        image, _, ctx.meta = g.rasterization(*arrays, **options)
        return torch.from_numpy(image).to(means.device)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx, image_grad):
        gradients = ctx.meta.backward(image_grad.cpu())
        return *(torch.from_numpy(gradient).to(image_grad.device) for gradient in gradients), None


def ssim(image, photo):
    """Mean structural similarity of two pictures, (height, width, 3), in windows of 11 pixels."""
    offsets = torch.arange(11, device=image.device) - 5
    window = torch.exp(-(offsets**2) / (2 * 1.5**2))
    window = torch.outer(window, window)[None, None] / window.sum() ** 2
    x, y = image.permute(2, 0, 1)[:, None], photo.permute(2, 0, 1)[:, None]
    mean_x, mean_y, xx, yy, xy = conv2d(torch.cat([x, y, x * x, y * y, x * y]), window, padding=5).split(3)
    xx, yy, xy = xx - mean_x**2, yy - mean_y**2, xy - mean_x * mean_y
    c1, c2 = 0.01**2, 0.03**2
    return ((2 * mean_x * mean_y + c1) * (2 * xy + c2) / ((mean_x**2 + mean_y**2 + c1) * (xx + yy + c2))).mean()


def begin(dataset, count, generator):
    """One Gaussian for each of `count` points, as wide as the distance to its neighbors."""
    points, colors = dataset.points, dataset.colors
    chosen = generator.permutation(len(points))[:count]
    points, colors = points[chosen], colors[chosen] / 255
    spacing = [np.sqrt(np.sort(((points - point) ** 2).sum(1))[1:4].mean()) for point in points]
    n = len(points)
    sh = np.zeros((n, 16, 3))
    sh[:, 0] = (colors - 0.5) / SH_DC
    arrays = {
        "means": points,
        "log_scales": np.log(np.maximum(spacing, 1e-7))[:, None].repeat(3, 1),
        "quats": np.tile([1.0, 0, 0, 0], (n, 1)),
        "opacity_logits": np.full(n, math.log(0.1 / 0.9)),
        "dc": sh[:, :1],
        "rest": sh[:, 1:],
    }
    return {name: torch.tensor(array, dtype=torch.float32, requires_grad=True) for name, array in arrays.items()}


def train(dataset, iterations, points, seed=0):
    """Trains a scene on the training photos of a dataset."""
    generator = np.random.default_rng(seed)
    own = begin(dataset, points, generator)
    rates = {"means": 1.6e-4 * dataset.extent, "log_scales": 5e-3, "quats": 1e-3, "opacity_logits": 0.025, "dc": 2.5e-3, "rest": 1.25e-4}
    adam = torch.optim.Adam([{"params": [own[name]], "lr": rate} for name, rate in rates.items()], eps=1e-15)
    photos = [photo for photo in dataset.photos if photo.split == "train"]
    pictures = [torch.from_numpy(photo.image()) / 255 for photo in photos]
    order = []
    for step in range(iterations):
        adam.param_groups[0]["lr"] = rates["means"] * 0.01 ** (step / iterations)
        order = order or list(generator.permutation(len(photos)))
        at = order.pop()
        camera = photos[at].camera
        options = {
            "viewmats": camera.viewmat[None],
            "Ks": camera.K[None],
            "width": camera.width,
            "height": camera.height,
            # A band more every 30th of the run.
            "sh_degree": min(30 * step // iterations, 3),
            "backgrounds": [dataset.background],
        }
        opacities = torch.sigmoid(own["opacity_logits"])
        harmonics = torch.cat([own["dc"], own["rest"]], 1)
        image = Rasterize.apply(own["means"], own["quats"], own["log_scales"].exp(), opacities, harmonics, options)[0]
        loss = 0.8 * (image - pictures[at]).abs().mean() + 0.2 * (1 - ssim(image, pictures[at]))
        adam.zero_grad()
        loss.backward()
        adam.step()
        if (step + 1) % 100 == 0:
            print(f"step {step + 1}/{iterations}, loss {loss.item():.4f}", flush=True)
    means, log_scales, quats, opacity_logits, dc, rest = (parameter.detach().numpy() for parameter in own.values())
    base = g.Gaussians(means, log_scales, quats, opacity_logits, np.concatenate([dc, rest], 1))
    return g.Scene(base, background=dataset.background, antialiased=False)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Trains a scene with torch's Adam.")
    parser.add_argument("dataset", help="folder or JSON file of the dataset, with sparse points")
    parser.add_argument("output", help="scene file to write")
    parser.add_argument("--iterations", type=int, default=2000, help="steps, one photo each [default: 2000]")
    parser.add_argument("--points", type=int, default=4000, help="Gaussians [default: 4000]")
    parser.add_argument("--max-size", type=int, default=200, help="longest side of the photos, pixels [default: 200]")
    given = parser.parse_args()
    scene = train(g.dataset(given.dataset, max_size=given.max_size), given.iterations, given.points)
    g.save(scene, given.output)
    print(json.dumps(g.evaluate(scene, given.dataset, max_size=given.max_size)["base"]))
