"""Scenes as arrays, and files."""

import gc
import subprocess
import sys
import warnings

import glint_splat as g
import numpy as np
import pytest


def vertices(path):
    """The rows of a binary PLY file's first element, by name."""
    data = path.read_bytes()
    header, rows = data.split(b"end_header\n", 1)
    words = [line.split() for line in header.decode().splitlines()]
    count = next(int(line[2]) for line in words if line[0] == "element")
    names = [line[2] for line in words if line[0] == "property"]
    return np.frombuffer(rows, dtype=[(name, "<f4") for name in names], count=count)


def test_arrays_are_the_file_s_bit_for_bit(base):
    rows, scene = vertices(base), g.load(base)
    columns = lambda *names: np.stack([rows[name] for name in names], axis=-1)
    own, k = scene.base, 16
    assert len(own) == len(rows) and own.sh_degree == 3
    assert own.means.tobytes() == columns("x", "y", "z").tobytes()
    assert own.log_scales.tobytes() == columns("scale_0", "scale_1", "scale_2").tobytes()
    assert own.quats.tobytes() == columns("rot_0", "rot_1", "rot_2", "rot_3").tobytes()
    assert own.opacity_logits.tobytes() == rows["opacity"].tobytes()
    assert own.sh[:, 0].tobytes() == columns("f_dc_0", "f_dc_1", "f_dc_2").tobytes()
    rest = columns(*[f"f_rest_{i}" for i in range(3 * (k - 1))]).reshape(-1, 3, k - 1)
    assert np.array_equal(own.sh[:, 1:], rest.transpose(0, 2, 1))
    assert (scene.background, scene.antialiased, scene.supplement) == ([0.0] * 3, False, None)


def test_arrays_are_read_only_views_that_outlive_the_scene(base):
    scene = g.load(base)
    means = scene.base.means
    assert np.shares_memory(means, scene.base.means)
    kept = means.copy()
    del scene
    gc.collect()
    assert np.array_equal(means, kept)
    with pytest.raises(ValueError):
        means[0] = 0
    with pytest.raises(ValueError):
        means.setflags(write=True)


@pytest.mark.parametrize("ending", ["ply", "glb", "sog", "compressed.ply", "spz", "usda", "usdz", "splat"])
def test_saved_files_are_the_command_line_s(glint, folder, base, ending):
    ours, theirs = folder / f"ours.{ending}", folder / f"theirs.{ending}"
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        g.save(g.load(base), ours)
    glint("convert", base, theirs)
    assert ours.read_bytes() == theirs.read_bytes()
    assert [str(warning.message).replace("ours", "theirs") for warning in warned] == glint.notes
    assert all(warning.category is g.Note and warning.filename == __file__ for warning in warned)
    assert len(g.load(ours).base) == len(g.load(base).base)


def test_lenient_loading_drops_and_tells(folder, base):
    rows = bytearray(base.read_bytes())
    rows[-4:] = np.float32("nan").tobytes()
    (folder / "nan.ply").write_bytes(rows)
    with pytest.raises(g.InputError, match="--lenient drops such Gaussians"):
        g.load(folder / "nan.ply")
    with pytest.warns(g.Note, match="1 of 400 Gaussians dropped"):
        assert len(g.load(folder / "nan.ply", lenient=True).base) == 399


def test_an_augmented_scene_comes_back(folder, augmented):
    scene, again = g.load(augmented), folder / "augmented_again.ply"
    g.save(scene, again)
    assert again.read_bytes() == augmented.read_bytes()
    lobes = scene.supplement
    assert len(lobes) > 0 and lobes.lobe_directions.shape == (len(lobes), 3)
    assert lobes.lobe_widths.shape == lobes.lobe_sharpness.shape == (len(lobes),)


def test_a_scene_is_made_of_arrays(folder, augmented):
    names = ["means", "log_scales", "quats", "opacity_logits", "sh"]
    loaded = g.load(augmented)
    parts = [(loaded.base, names), (loaded.supplement, names + ["lobe_directions", "lobe_widths", "lobe_sharpness"])]
    base, supplement = (g.Gaussians(**{name: getattr(part, name) for name in own}) for part, own in parts)
    scene = g.Scene(base, supplement, background=loaded.background, antialiased=False)
    assert np.array_equal(scene.base.means, loaded.base.means)
    assert not np.shares_memory(scene.base.means, loaded.base.means)
    camera = g.Camera(24, 16, np.array([[30.0, 0, 12], [0, 30, 8], [0, 0, 1]]), np.eye(4))
    assert np.array_equal(g.render(scene, camera).image, g.render(loaded, camera).image)
    with pytest.raises(g.InputError, match="expected a base without lobes"):
        g.Scene(supplement)


def test_gaussians_are_made_of_what_numpy_makes_arrays_of(base):
    own = g.load(base).base
    names = ["means", "log_scales", "quats", "opacity_logits", "sh"]
    given = {name: getattr(own, name) for name in names}
    for change in (lambda a: a.astype(np.float64), np.asfortranarray, lambda a: a[::-1][::-1], lambda a: a.tolist()):
        made = g.Gaussians(**{name: change(array) for name, array in given.items()})
        assert all(np.array_equal(getattr(made, name), array) for name, array in given.items())
    for name, value, said in [
        ("quats", own.means, r"quats has shape \[400, 3\], expected \[400, 4\]"),
        ("opacity_logits", own.means, r"opacity_logits has shape \[400, 3\], expected \[400\]"),
        ("sh", own.sh[:, :3], r"sh has shape \[400, 3, 3\], expected \[400, K, 3\]"),
        ("means", own.means * np.float32("nan"), "means of Gaussian 0: found NaN, expected a finite number"),
        ("quats", own.quats * 0, "rot"),
        ("lobe_widths", own.opacity_logits, "expected all three or none"),
    ]:
        with pytest.raises(g.InputError, match=said):
            g.Gaussians(**{**given, name: value})


def test_errors_are_the_command_line_s(glint, folder, base, augmented):
    broken = folder / "broken.ply"
    broken.write_bytes(base.read_bytes()[:2000])
    out = folder / "out.sog"
    for call, arguments in [
        (lambda: g.load(broken), ["convert", broken, out]),
        (lambda: g.load(folder / "nothing.ply"), ["convert", folder / "nothing.ply", out]),
        (lambda: g.save(g.load(augmented), out), ["convert", augmented, out]),
        (lambda: g.save(g.load(augmented), base), ["convert", augmented, base]),
        (lambda: g.save(g.load(base), folder / "a.obj"), ["convert", base, folder / "a.obj"]),
        (lambda: g.convert(base, folder / "a.ply", spz_version=3), ["convert", base, folder / "a.ply", "--spz-version=3"]),
    ]:
        with pytest.raises(g.InputError) as found:
            call()
        assert str(found.value) == glint(*arguments)
        assert isinstance(found.value, ValueError) and isinstance(found.value, g.Error)


def test_unknown_options_are_python_s_error(base):
    with pytest.raises(TypeError, match="load.. got an unexpected keyword argument 'colour'"):
        g.load(base, colour=True)
    with pytest.raises(TypeError, match="lenient is 'yes', expected True or False"):
        g.load(base, lenient="yes")


def test_nothing_goes_to_stdout_or_stderr(folder, base, photos):
    code = f"""
import warnings, glint_splat as g
warnings.simplefilter("ignore")
scene = g.load({str(base)!r})
g.evaluate(scene, {str(photos)!r})
list(g.train({str(photos)!r}, {str(folder / "quiet.ply")!r}, iterations=20, points=100))
"""
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "", "")
