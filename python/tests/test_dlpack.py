"""Arrays of other frameworks."""

import glint_splat as g
import numpy as np
import pytest

K = np.array([[28.0, 0, 12], [0, 26, 9], [0, 0, 1]])
NAMES = ["means", "quats", "scales", "opacities", "colors"]


class Foreign:
    """An array of a framework that has nothing but DLPack. By default it is on the CPU."""

    def __init__(self, array, device=1):
        self.array, self.device = array, device

    def __dlpack__(self, **options):
        assert self.device in (1, 3), "no other device's memory is touched"
        return self.array.__dlpack__(**options)

    def __dlpack_device__(self):
        return self.device, 0


def draw():
    rng = np.random.default_rng(7)
    shapes = [(20, 3), (20, 4), (20, 3), (20,), (20, 3)]
    return [rng.uniform(0.2, 0.8, shape).astype(np.float32) for shape in shapes]


def rasterize(arrays, change=lambda array: array):
    viewmat = np.eye(4)
    viewmat[2, 3] = 3
    cameras = change(viewmat[None]), change(K[None])
    image, alpha, meta = g.rasterization(*map(change, arrays), *cameras, 24, 20, backgrounds=change(np.full((1, 3), 0.5, np.float32)))
    return image, alpha, *meta.backward(change(np.ones_like(image)))


def read_only(array):
    array = array.copy()
    array.setflags(write=False)
    return array


@pytest.mark.parametrize(
    "change",
    [
        Foreign,
        lambda array: Foreign(array, 3),
        lambda array: Foreign(np.asfortranarray(array)),
        lambda array: Foreign(array.astype(np.float64)),
        read_only,
    ],
    ids=["foreign", "pinned", "columns", "float64", "read_only"],
)
def test_arrays_of_other_frameworks_give_the_same_bits(change):
    arrays = draw()
    assert all(np.array_equal(a, b) for a, b in zip(rasterize(arrays), rasterize(arrays, change)))
    means, quats, scales, opacities, colors = arrays
    made = g.Gaussians(*map(change, (means, np.log(scales), quats, opacities, colors[:, None])))
    assert np.array_equal(made.means, means) and np.array_equal(made.sh, colors[:, None])
    camera = g.Camera(24, 20, change(K), change(np.eye(4)))
    assert np.array_equal(g.render(g.Scene(made), camera).image, g.render(g.Scene(made), camera._replace(K=K)).image)


def test_arrays_of_the_right_layout_are_not_copied():
    for array in draw():
        for given in (array, Foreign(array), read_only(array)):
            own = g._host("array", given)
            assert np.shares_memory(own, getattr(given, "array", given))


def test_arrays_on_a_device_are_named():
    arrays = draw()
    for at, name in enumerate(NAMES):
        moved = [Foreign(array, 2) if at == k else array for k, array in enumerate(arrays)]
        with pytest.raises(g.InputError, match=rf"{name} is on a device \(type 2 of DLPack\), expected an array on the host.*\.cpu\(\)"):
            rasterize(moved)
    for name in ("means", "lobe_widths"):
        given = dict.fromkeys(["means", "log_scales", "quats", "opacity_logits", "sh", "lobe_directions", "lobe_sharpness"], arrays[0])
        given.update(quats=arrays[1], opacity_logits=arrays[3], sh=arrays[0][:, None], lobe_sharpness=arrays[3], lobe_widths=arrays[3])
        with pytest.raises(g.InputError, match=f"{name} is on a device"):
            g.Gaussians(**{**given, name: Foreign(given[name], 2)})
    scene = g.Scene(g.Gaussians(arrays[0], arrays[0], arrays[1], arrays[3], arrays[0][:, None]))
    with pytest.raises(g.InputError, match="K is on a device"):
        g.render(scene, g.Camera(24, 20, Foreign(K, 2), np.eye(4)))
    with pytest.raises(g.InputError, match="means: numpy makes no float32 array of it: .*'a'"):
        rasterize([[["a", "b", "c"]], *arrays[1:]])


def test_results_go_to_other_frameworks_without_a_copy(base):
    image, *more = rasterize(draw())
    for array in (image, *more):
        assert np.shares_memory(np.from_dlpack(Foreign(array)), array)
    means = g.load(base).base.means
    if np.lib.NumpyVersion(np.__version__) >= "2.1.0":
        taken = np.from_dlpack(Foreign(means))
        assert np.shares_memory(taken, means)
        with pytest.raises(ValueError):
            taken[0] = 0


def test_torch_s_tensors_are_taken():
    torch = pytest.importorskip("torch", reason="needs torch")
    arrays = draw()
    tensors = [torch.from_numpy(array).requires_grad_() for array in arrays]
    assert all(np.array_equal(a, b) for a, b in zip(rasterize(arrays), rasterize(tensors, lambda array: array)))
    own = g._host("means", tensors[0])
    assert np.shares_memory(own, arrays[0])
    image = rasterize(arrays)[0]
    assert torch.from_dlpack(image).data_ptr() == image.ctypes.data
    with pytest.raises(g.InputError, match="means: numpy makes no float32 array of it"):
        rasterize([tensors[0].bfloat16(), *tensors[1:]])
