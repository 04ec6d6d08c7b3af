"""Images and gradients of bare arrays, beside an own float64 rendering and its central differences."""

import glint_splat as g
import numpy as np
import pytest

WIDTH, HEIGHT, COUNT = 24, 20, 20
C0, C1 = 0.28209479177387814, 0.4886025119029199
K = np.array([[28.0, 0, 12.5], [0, 26.0, 9.5], [0, 0, 1]])


def pose(turn):
    c, s = np.cos(turn), np.sin(turn)
    return np.array([[c, 0, s, 0.1 * turn], [0, 1, 0, -0.05], [-s, 0, c, 3.0], [0, 0, 0, 1]])


VIEWMATS = np.stack([pose(0.2), pose(-0.3)])
BACKGROUNDS = np.array([[0.1, 0.2, 0.3], [0.6, 0.4, 0.5]])


def draw(coefficients):
    """Gaussians that are neither opaque nor so faint that a threshold is near."""
    rng = np.random.default_rng(7)
    colors = rng.uniform(0.1, 0.9, (COUNT, 3))
    if coefficients > 1:
        rest = rng.uniform(-0.1, 0.1, (COUNT, coefficients - 1, 3))
        colors = np.concatenate([(colors[:, None] - 0.5) / C0, rest], axis=1)
    return {
        "means": rng.uniform(-1, 1, (COUNT, 3)) * [1, 0.8, 0.5],
        "quats": rng.normal(size=(COUNT, 4)),
        "scales": rng.uniform(0.1, 0.4, (COUNT, 3)),
        "opacities": rng.uniform(0.2, 0.8, COUNT),
        "colors": colors,
    }


def image(means, quats, scales, opacities, colors, viewmat, background, antialiased, drawn):
    """3D Gaussian splatting (Kerbl 2023) of one view, in float64.

    drawn: (N, HEIGHT, WIDTH), the pixels that each Gaussian reaches; None to find them. Returns the image and these pixels.
    """
    reached = np.empty((len(means), HEIGHT, WIDTH), bool)
    w, x, y, z = (quats / np.linalg.norm(quats, axis=1, keepdims=True)).T
    rotations = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    ).transpose(2, 0, 1)
    turned = viewmat[:3, :3] @ rotations * scales[:, None]
    px, py, pz = (means @ viewmat[:3, :3].T + viewmat[:3, 3]).T
    jacobian = np.zeros((len(means), 2, 3))
    jacobian[:, 0, 0], jacobian[:, 0, 2] = K[0, 0] / pz, -K[0, 0] * px / pz**2
    jacobian[:, 1, 1], jacobian[:, 1, 2] = K[1, 1] / pz, -K[1, 1] * py / pz**2
    flat = jacobian @ turned
    sharp = flat @ flat.transpose(0, 2, 1)
    covariances = sharp + 0.3 * np.eye(2)
    opacities = opacities * (np.sqrt(np.linalg.det(sharp) / np.linalg.det(covariances)) if antialiased else 1)
    centres = np.stack([K[0, 0] * px / pz + K[0, 2], K[1, 1] * py / pz + K[1, 2]], axis=-1)
    if colors.ndim == 3:
        eye = -viewmat[:3, :3].T @ viewmat[:3, 3]
        dx, dy, dz = ((means - eye) / np.linalg.norm(means - eye, axis=1, keepdims=True)).T
        basis = np.stack([C0 + 0 * dx, -C1 * dy, C1 * dz, -C1 * dx], axis=-1)
        colors = np.maximum(np.einsum("nk,nkc->nc", basis, colors) + 0.5, 0)
    columns, rows = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    seen, found = np.ones((HEIGHT, WIDTH)), np.zeros((HEIGHT, WIDTH, 3))
    for i in np.argsort(pz, kind="stable"):
        offset = np.stack([columns, rows], axis=-1) - centres[i]
        power = np.einsum("hwi,ij,hwj->hw", offset, np.linalg.inv(covariances[i]), offset)
        alpha = np.minimum(opacities[i] * np.exp(-0.5 * power), 0.99)
        reached[i] = alpha >= 1 / 255 if drawn is None else drawn[i]
        alpha = np.where(reached[i], alpha, 0)
        found += (seen * alpha)[..., None] * colors[i]
        seen = seen * (1 - alpha)
    return found + seen[..., None] * background, reached


def images(arrays, mode, drawn=(None, None)):
    """Both views, and the pixels that each Gaussian reaches in them."""
    views = zip(VIEWMATS, BACKGROUNDS, drawn)
    found, reached = zip(*[image(*arrays.values(), pose, color, mode == "antialiased", d) for pose, color, d in views])
    return np.stack(found), reached


def rasterize(arrays, mode, **more):
    degree = None if arrays["colors"].ndim == 2 else 1
    ks = np.stack([K] * len(VIEWMATS))
    return g.rasterization(
        **arrays, viewmats=VIEWMATS, Ks=ks, width=WIDTH, height=HEIGHT, sh_degree=degree, backgrounds=BACKGROUNDS,
        rasterize_mode=mode, **more,
    )


@pytest.mark.parametrize("mode", ["classic", "antialiased"])
@pytest.mark.parametrize("coefficients", [1, 4])
def test_gradients_are_central_differences(coefficients, mode):
    arrays = draw(coefficients)
    found, alpha, meta = rasterize(arrays, mode)
    expected, drawn = images(arrays, mode)
    assert found.shape == (2, HEIGHT, WIDTH, 3) and alpha.shape == (2, HEIGHT, WIDTH, 1)
    assert abs(found - expected).max() < 1e-5
    weights = np.random.default_rng(8).uniform(-1, 1, found.shape)
    gradients = meta.backward(weights)
    step = 1e-5
    for name, array in arrays.items():
        differences = np.empty(array.shape)
        for at in np.ndindex(array.shape):
            ends = []
            for sign in (-1, 1):
                moved = {**arrays, name: array.copy()}
                moved[name][at] += sign * step
                # The threshold of 1/255 is no part of a gradient.
                ends.append((weights * images(moved, mode, drawn)[0]).sum())
            differences[at] = (ends[1] - ends[0]) / (2 * step)
        gradient = getattr(gradients, name)
        assert gradient.shape == array.shape and gradient.dtype == np.float32
        assert abs(gradient - differences).max() < 1e-4 * abs(differences).max(), name


def test_gradients_are_the_same_each_time_and_those_of_their_own_call():
    arrays = draw(4)
    weights = np.ones((2, HEIGHT, WIDTH, 3))
    *_, first = rasterize(arrays, "classic")
    one = first.backward(weights)
    other = {**arrays, "means": arrays["means"] * 0.5}
    *_, second = rasterize(other, "classic")
    two = second.backward(weights)
    for _ in range(2):
        again = first.backward(weights)
        assert all(np.array_equal(a, b) for a, b in zip(one, again))
    assert not np.array_equal(one.means, two.means)
    # In buffers that have held another scene, and more Gaussians.
    del first, second
    *_, third = rasterize(arrays, "classic")
    assert all(np.array_equal(a, b) for a, b in zip(one, third.backward(weights)))
    few = {name: array[: COUNT // 2] for name, array in arrays.items()}
    for scene in (few, arrays, few):
        found, _, third = rasterize(scene, "classic")
        assert abs(found - images(scene, "classic")[0]).max() < 1e-5
        assert len(third.backward(weights).means) == len(scene["means"])


def test_a_scene_s_arrays_render_as_the_scene(photos, base):
    scene, camera = g.load(base), g.dataset(photos).photos[0].camera
    own = scene.base
    found, alpha, _ = g.rasterization(
        own.means, own.quats, np.exp(own.log_scales), 1 / (1 + np.exp(-own.opacity_logits)), own.sh,
        camera.viewmat[None], camera.K[None], camera.width, camera.height, sh_degree=3,
    )
    rendered = g.render(scene, camera)
    assert abs(found[0] - rendered.image).max() < 1e-5 and abs(alpha[0, ..., 0] - rendered.alpha).max() < 1e-5


def test_bands_that_are_not_used_have_no_gradient():
    arrays = draw(4)
    more = {**arrays, "colors": np.concatenate([arrays["colors"], np.ones((COUNT, 12, 3))], axis=1)}
    (found, _, few), (same, _, many) = rasterize(arrays, "classic"), rasterize(more, "classic")
    assert np.array_equal(found, same)
    one, two = few.backward(np.ones_like(found)), many.backward(np.ones_like(found))
    assert two.colors.shape == (COUNT, 16, 3) and not two.colors[:, 4:].any()
    assert np.array_equal(one.colors, two.colors[:, :4]) and np.array_equal(one.means, two.means)


def test_opacities_of_0_and_1_have_finite_gradients():
    arrays = draw(1)
    arrays["opacities"][:10] = 1.0
    arrays["opacities"][10:] = 0.0
    *_, meta = rasterize(arrays, "classic")
    assert all(np.isfinite(gradient).all() for gradient in meta.backward(np.ones((2, HEIGHT, WIDTH, 3))))


def test_nothing_to_draw_is_the_background():
    none = {name: array[:0] for name, array in draw(4).items()}
    found, alpha, meta = rasterize(none, "classic")
    assert np.allclose(found, BACKGROUNDS[:, None, None], atol=1e-7) and not alpha.any()
    assert meta.backward(np.ones_like(found)).colors.shape == (0, 4, 3)


def test_wrong_arrays_are_named():
    arrays = draw(4)
    for name, value, said in [
        ("means", arrays["means"][:, :2], r"means has shape \[20, 2\], expected \[20, 3\]"),
        ("quats", arrays["quats"][:5], r"quats has shape \[5, 4\]"),
        ("scales", -arrays["scales"], "scales of Gaussian 0: found -0.*, expected a positive number"),
        ("opacities", arrays["opacities"] + 1, "opacities of Gaussian 0: found 1.*, expected 0 to 1"),
        ("colors", arrays["colors"] * np.nan, "colors of Gaussian 0: found NaN, expected a finite number"),
        ("colors", arrays["colors"][:, :3], r"colors has shape \[20, 3, 3\], expected \[20, 4, 3\]"),
        ("opacities", arrays["opacities"][:, None], r"opacities has shape \[20, 1\], expected 1 dimensions"),
    ]:
        with pytest.raises(g.InputError, match=said):
            rasterize({**arrays, name: value}, "classic")
    with pytest.raises(g.InputError, match="expected 'classic' or 'antialiased'"):
        rasterize(arrays, "mip")
    *_, meta = rasterize(arrays, "classic")
    with pytest.raises(g.InputError, match=r"image_grad has shape \[1, 20, 24, 3\], expected \[2, 20, 24, 3\]"):
        meta.backward(np.ones((1, HEIGHT, WIDTH, 3)))
