"""3D Gaussian scenes on any Vulkan device: load, render, differentiate, train and augment.

Arrays are numpy's and live on the host; `numpy.ndarray.__dlpack__` hands them to other frameworks without a copy. Keyword arguments
are the options of the `glint` command with underscores in place of dashes. Notes that the command prints are warnings of the category
`Note`, its errors are exceptions with the same text.
"""

import dataclasses as _dataclasses
import inspect as _inspect
import json as _json
import os as _os
import sys as _sys
import tempfile as _tempfile
import warnings as _warnings
from typing import NamedTuple as _NamedTuple

import numpy as _np

from . import _glint
from ._glint import Gaussians, Scene, __version__


class Error(Exception):
    """Everything that glint reports."""


class InputError(Error, ValueError):
    """A file, an option or an array is not what it should be."""


class DeviceError(Error, RuntimeError):
    """The device, its driver, its memory or the disk failed."""


class Note(UserWarning):
    """Something that glint left out, replaced or guessed."""


class Camera(_NamedTuple):
    """A pinhole camera. x points right, y down, z forward; the centre of the first pixel is at (0.5, 0.5)."""

    width: int
    """Pixels."""
    height: int
    """Pixels."""
    K: _np.ndarray
    """(3, 3): rows fx 0 cx, 0 fy cy, 0 0 1, in pixels."""
    viewmat: _np.ndarray
    """(4, 4): from the world to the camera, scene units."""


class Rendered(_NamedTuple):
    """A view of a scene."""

    image: _np.ndarray
    """(height, width, 3): sRGB from 0 to 1, not clamped."""
    alpha: _np.ndarray
    """(height, width): the share of the background that is hidden, 0 to 1."""
    depth: "_np.ndarray | None"
    """(height, width): z in the camera at which half of the light is absorbed, scene units; 0 where it is not. None if not asked for."""


class Gradients(_NamedTuple):
    """Gradients of the arrays that `rasterization` was given, in their shapes."""

    means: _np.ndarray
    quats: _np.ndarray
    scales: _np.ndarray
    opacities: _np.ndarray
    colors: _np.ndarray


class Step(_NamedTuple):
    """How far a run is."""

    step: int
    """Steps that are done, those of earlier runs included."""
    steps: int
    """Of how many."""
    loss: "float | None"
    """Mean over the last pass through the photos, or what there is of it."""
    psnr: "float | None"
    """The same, dB, of the training photos."""
    gaussians: int
    """All of the scene."""
    seconds: float
    """Since the first step of this run."""


@_dataclasses.dataclass(frozen=True)
class Photo:
    """A photo of a dataset, as training sees it: without distortion, and downscaled."""

    name: str
    split: str
    """"train" or "test"."""
    camera: Camera
    _dataset: "_glint.Dataset" = _dataclasses.field(repr=False)
    _number: int = _dataclasses.field(repr=False)

    def image(self):
        """Reads the pixels: (height, width, 3), 8-bit sRGB."""
        return self._dataset.image(self._number)[0]

    def mask(self):
        """Reads which pixels count: (height, width), bool. None if all do."""
        return self._dataset.image(self._number)[1]


class Dataset(_NamedTuple):
    """Photos with their cameras."""

    photos: "list[Photo]"
    """Sorted by name."""
    points: "_np.ndarray | None"
    """(M, 3), float64: sparse points, scene units; None if the dataset has none."""
    colors: "_np.ndarray | None"
    """(M, 3): their 8-bit sRGB colours."""
    background: tuple
    """sRGB from 0 to 1, behind transparent pixels."""
    extent: float
    """1.1 times the largest distance of a training camera from their mean, scene units."""


class Run:
    """A run that learns: an iterator over `Step`. The run waits while nobody takes its steps.

    `phase` is what it does at the moment and how far that is: name, unit, done, total. After the last step `report` is what
    `glint ... --json` prints, or None if the run ended before it had one, and `stopped` is whether somebody asked for an end. In a
    notebook the run shows its progress.
    """

    def __init__(self, arguments):
        self.phase = None
        self.report = None
        self.stopped = False
        self._job = _glint.Job(arguments)
        self._shown = None

    def __iter__(self):
        return self

    def __next__(self):
        try:
            step = self._take()
        except KeyboardInterrupt:
            # The scene and the checkpoint are written before the interrupt goes on; another one does not wait for them.
            self.stop()
            while self._take() is not None:
                pass
            raise
        if step is None:
            raise StopIteration
        return step

    def _take(self):
        """The next step, or None at the end."""
        while True:
            event = self._job.wait()
            if event is None:
                break
            kind, *values = event
            if kind == "note":
                _warn([values[0]])
            elif kind == "phase":
                self.phase = tuple(values)
                self._show("{} {}/{} {}".format(values[0], *values[2:], values[1]))
            else:
                step = Step(*values)
                quality = "" if step.loss is None else f", loss {step.loss:.4f}, {step.psnr:.2f} dB"
                self._show(f"{self.phase[0]} {step.step}/{step.steps} steps{quality}, {step.gaussians} Gaussians")
                return step
        printed, self.stopped = self._job.result()
        self.report = _json.loads(printed) if printed else None
        return None

    def stop(self):
        """Asks for an end: the run writes its scene and its checkpoint, and the iterator ends. The same call resumes the run."""
        self._job.stop()

    def _show(self, text):
        """Shows a line in a notebook, always the same."""
        if self._shown is None:
            self._shown = _notebook()
        if self._shown:
            self._shown(text)


def _notebook():
    """Writes a line of a notebook anew, or False elsewhere."""
    try:
        from IPython import get_ipython
        from IPython.display import display
    except ImportError:
        return False
    if not hasattr(get_ipython(), "kernel"):
        return False
    handle = display({"text/plain": ""}, raw=True, display_id=True)
    return lambda text: handle.update({"text/plain": text}, raw=True)


def _warn(notes):
    """Warns at the line that called this module."""
    level, frame = 1, _sys._getframe()
    while frame and frame.f_code.co_filename == __file__:
        level, frame = level + 1, frame.f_back
    for text in notes:
        _warnings.warn(text, Note, stacklevel=level)


def _text(value):
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (tuple, list)):
        return ",".join(map(str, value))
    return _os.fspath(value) if isinstance(value, _os.PathLike) else str(value)


def _arguments(command, paths, options):
    """Arguments of a command line."""
    known = {name.replace("-", "_"): (takes_value, repeats) for name, _, takes_value, repeats, *_ in _glint.options(command)}
    arguments = []
    for key, value in options.items():
        if key not in known:
            raise TypeError(f"{command}() got an unexpected keyword argument '{key}'")
        takes_value, repeats = known[key]
        name = "--" + key.replace("_", "-")
        if value is None or (value is False and not takes_value):
            continue
        if not takes_value:
            if value is not True:
                raise TypeError(f"{key} is {value!r}, expected True or False")
            arguments.append(name)
            continue
        values = value if repeats and isinstance(value, (tuple, list)) else [value]
        arguments += [f"{name}={_text(value)}" for value in values]
    return arguments + ["--"] + [_os.fspath(path) for path in paths]


def _report(command, paths, options):
    """Runs a command to its end; what its --json prints."""
    run = Run([command, *_arguments(command, paths, {**options, "json": True})])
    for _ in run:
        pass
    return run.report


def _array(values, dimensions, dtype=_np.float32):
    values = values.detach() if hasattr(values, "detach") else values
    array = _np.ascontiguousarray(values, dtype=dtype)
    if array.ndim != dimensions:
        raise InputError(f"an array has shape {array.shape}, expected {dimensions} dimensions")
    return array


def load(path, **options):
    """Reads a scene of any format that glint knows, told by its contents.

    The arrays of the scene are read-only views of what was read; nothing is copied.

    Raises InputError if the file is not a scene.
    """
    scene, notes = _glint.load(_arguments("load", [path], options))
    _warn(notes)
    return scene


def save(scene, path, **options):
    """Writes a scene; the ending of the path says what it becomes: .ply, .glb, .sog, .compressed.ply, .spz or .splat.

    The file appears whole or not at all.

    Raises InputError if the file is there already and `force` is not given, or if the format has no place for the scene's lobes;
    DeviceError if the disk is full.
    """
    _warn(_glint.save(_arguments("save", [path], options), scene))


def convert(input, output, **options):
    """Writes a scene file as a file of another kind, and returns what `glint convert --json` prints.

    Raises InputError and DeviceError as `load` and `save`.
    """
    return _report("convert", [input, output], options)


def dataset(path, **options):
    """Reads cameras, names and sparse points of a dataset; pixels are read when a photo is asked for them.

    Raises InputError if the folder or the file is not a dataset.
    """
    found = _glint.Dataset(_arguments("dataset", [path], options))
    _warn(found.notes)
    photos = []
    for number, (name, split, width, height, k, viewmat) in enumerate(found.photos()):
        camera = Camera(width, height, _np.reshape(k, (3, 3)), _np.reshape(viewmat, (4, 4)))
        photos.append(Photo(name, split, camera, found, number))
    points, colors = found.points() or (None, None)
    return Dataset(photos, points, colors, tuple(found.background), found.extent)


def render(scene, camera, *, background=None, compensate=None, depth=False, device=None):
    """Renders a scene from a camera. The scene stays on the device for the next time.

    background: three sRGB values from 0 to 1; by default what the scene was trained with, else black.
    compensate: fade Gaussians smaller than a pixel; by default as the scene was trained, else not.
    depth: render depths too.
    device: as the command line's --device.

    Raises InputError for a camera that is not a pinhole's; DeviceError if there is no device or no memory.
    """
    k, viewmat = _array(camera.K, 2, _np.float64), _array(camera.viewmat, 2, _np.float64)
    pictures = _glint.render(scene, camera.width, camera.height, k, viewmat, background, compensate, depth, device)
    return Rendered(*pictures)


class Meta:
    """What the gradients of a call of `rasterization` need."""

    def __init__(self, native):
        self._native = native

    def backward(self, image_grad):
        """Gradients of a loss whose gradient by the image is `image_grad`, (C, height, width, 3).

        A colour channel that is below 0 and clamped has the gradient only where that raises it. Opacities count as 2^-24 away from 0
        and 1.

        Raises InputError for another shape; DeviceError if the device's memory does not suffice.
        """
        return Gradients(*self._native.backward(_array(image_grad, 4)))


def rasterization(
    means,
    quats,
    scales,
    opacities,
    colors,
    viewmats,
    Ks,
    width,
    height,
    *,
    sh_degree=None,
    backgrounds=None,
    rasterize_mode="classic",
    device=None,
):
    """Renders N Gaussians, given as arrays, from C cameras. Arguments have gsplat's names and shapes.

    means: (N, 3), scene units.
    quats: (N, 4), w first, of any length.
    scales: (N, 3), standard deviations, scene units, above 0.
    opacities: (N,), 0 to 1.
    colors: (N, 3), sRGB, above 0; or with `sh_degree` (N, K, 3), coefficients of spherical harmonics, of which the first
        (sh_degree + 1)^2 are used.
    viewmats: (C, 4, 4), from the world to the camera. Ks: (C, 3, 3), pixels.
    width, height: pixels.
    backgrounds: (C, 3), sRGB; black by default.
    rasterize_mode: "classic", or "antialiased" to fade Gaussians smaller than a pixel.
    device: as the command line's --device.

    Returns the images (C, height, width, 3), alphas (C, height, width, 1), both float32, and an object whose `backward` makes
    gradients. Gaussians nearer than 0.2 scene units are not drawn, and every Gaussian is blurred by 0.3 px^2. Buffers on the device
    are used again by the next call of the same shapes, once the object is gone.

    Raises InputError, which names the array, for shapes and numbers that do not fit; DeviceError if there is no device or no memory.
    """
    if rasterize_mode not in ("classic", "antialiased"):
        raise InputError(f"rasterize_mode is {rasterize_mode!r}, expected 'classic' or 'antialiased'")
    colors = _array(colors, 2)[:, None] if sh_degree is None else _array(colors, 3)
    given = colors.shape[1]
    if sh_degree is not None:
        colors = _np.ascontiguousarray(colors[:, : (sh_degree + 1) ** 2])
    viewmats = _array(viewmats, 3, _np.float64)
    backgrounds = _np.zeros((len(viewmats), 3)) if backgrounds is None else backgrounds
    image, alpha, native = _glint.rasterize(
        _array(means, 2),
        _array(quats, 2),
        _array(scales, 2),
        _array(opacities, 1),
        colors,
        viewmats,
        _array(Ks, 3, _np.float64),
        width,
        height,
        sh_degree,
        _array(backgrounds, 2),
        rasterize_mode == "antialiased",
        device,
    )
    return image, alpha, Meta(native)


def train(dataset, output, **options):
    """Trains a base scene on photos, as `glint train` does, and returns the run: an iterator over steps.

        for step in train("garden", "base.ply", iterations=7000):
            print(step.step, step.psnr)

    What was learned is saved beside `output`, a PLY file, every minute; the same call resumes there. `run.stop()` and Ctrl-C end a run
    early and keep what it has learned.

    The iterator raises InputError and DeviceError with the texts of the command line.
    """
    return Run(["train", *_arguments("train", [dataset], {**options, "output": output, "json": True})])


def enhance(dataset, base, output, **options):
    """Augments a base scene, a file, from photos, as `glint enhance` does, and returns the run: an iterator over steps of its joint phase.

    Checkpoints, stopping and errors are those of `train`.
    """
    options = {**options, "base": base, "output": output, "json": True}
    return Run(["enhance", *_arguments("enhance", [dataset], options)])


def evaluate(scene, dataset, **options):
    """Compares a scene, or a scene's file, with the photos of a dataset: PSNR [dB] and SSIM of each view and their means.

    Returns what `glint eval --json` prints: {"base": {"psnr", "ssim"}, "augmented": {"psnr", "ssim"}, "views": [...]}.

    Raises InputError and DeviceError with the texts of the command line.
    """
    if not isinstance(scene, Scene):
        return _report("eval", [scene, dataset], options)
    with _tempfile.TemporaryDirectory() as folder:
        path = _os.path.join(folder, "scene.ply")
        save(scene, path)
        return _report("eval", [path, dataset], options)


def verify(dataset=None, scene=None, **options):
    """Compares every kernel on a device with its float64 twin. Returns what `glint verify --json` prints.

    Raises DeviceError if an error is beyond its bound.
    """
    return _report("verify", [path for path in (dataset, scene) if path is not None], options)


def devices():
    """Vulkan devices that `device` chooses from, as `glint devices --json` lists them; "refused" says why one cannot be used."""
    return _report("devices", [], {})


def _describe(function, command, taken):
    """Adds the options of a command to a function's signature and documentation."""
    signature = _inspect.signature(function)
    parameters = [p for p in signature.parameters.values() if p.kind is not p.VAR_KEYWORD]
    lines = []
    for name, help, takes_value, repeats, default, names in _glint.options(command):
        key = name.replace("-", "_")
        if key in taken:
            continue
        default = default if takes_value else False
        parameters.append(_inspect.Parameter(key, _inspect.Parameter.KEYWORD_ONLY, default=default))
        choices = f" ({', '.join(names)})" if names else ""
        lines.append(f"{key}: {help}{choices}.")
    function.__signature__ = signature.replace(parameters=parameters)
    function.__doc__ += "\n    Options:\n\n" + "".join(f"    {line}\n" for line in lines)


for _function, _command, _taken in (
    (load, "load", ()),
    (save, "save", ()),
    (dataset, "dataset", ()),
    (convert, "convert", ("json",)),
    (train, "train", ("output", "json", "view")),
    (enhance, "enhance", ("base", "output", "json", "view")),
    (evaluate, "eval", ("json",)),
    (verify, "verify", ("json", "explain")),
):
    _describe(_function, _command, _taken)
