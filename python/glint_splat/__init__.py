"""3D Gaussian scenes on any Vulkan device: load, render, differentiate, train and augment.

Results are numpy arrays on the host; other frameworks take them by DLPack without a copy. Arguments may be arrays of any framework with
DLPack, on the host; they are only copied if their layout or type differs. Keyword arguments are the options of the `glint` command, with
underscores in place of dashes. The command's notes become warnings of the category `Note`, its errors exceptions with the same text.
"""

from __future__ import annotations

import dataclasses as _dataclasses
import inspect as _inspect
import json as _json
import os as _os
import sys as _sys
import tempfile as _tempfile
import warnings as _warnings
from typing import Any as _Any, Callable as _Callable, Iterator as _Iterator, NamedTuple as _NamedTuple, Protocol as _Protocol
from typing import Union as _Union

import numpy as _np
import numpy.typing as _npt

from . import _glint
from ._glint import Gaussians, Scene, __version__

_Path = _Union[str, "_os.PathLike[str]"]
_Array32 = _npt.NDArray[_np.float32]


class _DLPack(_Protocol):
    """An array of another framework."""

    def __dlpack__(self, *args: _Any, **options: _Any) -> _Any: ...

    def __dlpack_device__(self) -> _Any: ...


_ArrayLike = _Union[_npt.ArrayLike, _DLPack]
# DLPack's numbers of devices whose memory numpy reads: CPU, memory pinned for CUDA or ROCm, CUDA's managed memory.
_HOST = (1, 3, 11, 13)


class Error(Exception):
    """Base class of glint's exceptions."""


class InputError(Error, ValueError):
    """A file, an option or an array is invalid."""


class DeviceError(Error, RuntimeError):
    """The device, its driver, its memory or the disk failed."""


class Note(UserWarning):
    """The category of warnings about data that glint skipped, replaced or guessed."""


class Camera(_NamedTuple):
    """A pinhole camera. x points right, y down, z forward; the center of the first pixel is at (0.5, 0.5)."""

    width: int
    """Pixels."""
    height: int
    """Pixels."""
    K: _npt.NDArray[_Any]
    """(3, 3): rows fx 0 cx, 0 fy cy, 0 0 1, in pixels."""
    viewmat: _npt.NDArray[_Any]
    """(4, 4): rotation and translation from the world to the camera, scene units."""


class Rendered(_NamedTuple):
    """A view of a scene."""

    image: _Array32
    """(height, width, 3), float32: sRGB from 0 to 1, not clamped."""
    alpha: _Array32
    """(height, width), float32: the share of the background that is hidden, 0 to 1."""
    depth: _Array32 | None
    """(height, width), float32: camera z of half absorption, scene units; 0 if less light is absorbed. None without `depth=True`."""


class Gradients(_NamedTuple):
    """Gradients of the arrays that `rasterization` was given, float32 in their shapes."""

    means: _Array32
    quats: _Array32
    scales: _Array32
    opacities: _Array32
    colors: _Array32


class Step(_NamedTuple):
    """Progress of a run."""

    step: int
    """Steps done, earlier runs included."""
    steps: int
    """Steps planned, earlier runs included."""
    loss: float | None
    """Mean loss of the last pass through the training photos. None before the first step."""
    psnr: float | None
    """Mean PSNR of the last pass through the training photos, dB. None before the first step."""
    gaussians: int
    """Gaussians on the device, base and supplement. Those without effect are not written."""
    seconds: float
    """Seconds since the first step of this run."""


@_dataclasses.dataclass(frozen=True)
class Photo:
    """A photo of a dataset as training sees it: undistorted and downscaled."""

    name: str
    split: str
    """"train" or "test"."""
    camera: Camera
    _dataset: _glint.Dataset = _dataclasses.field(repr=False)
    _number: int = _dataclasses.field(repr=False)

    def image(self) -> _npt.NDArray[_np.uint8]:
        """Reads the pixels: (height, width, 3), 8-bit sRGB.

        Raises InputError if the file is not an image of the camera's size.
        """
        return self._dataset.image(self._number)[0]

    def mask(self) -> _npt.NDArray[_np.bool_] | None:
        """Reads the pixels that count: (height, width), bool. None if all do."""
        return self._dataset.image(self._number)[1]


class Dataset(_NamedTuple):
    """Photos with their cameras."""

    photos: list[Photo]
    """Sorted by name."""
    points: _npt.NDArray[_np.float64] | None
    """(M, 3), float64: sparse points, scene units. None if the dataset has none."""
    colors: _npt.NDArray[_np.uint8] | None
    """(M, 3): 8-bit sRGB colors of the sparse points."""
    background: tuple[float, ...]
    """Three sRGB values from 0 to 1 behind transparent pixels."""
    extent: float
    """1.1 times the largest distance of a training camera from their mean, scene units."""


class Run:
    """A run of training or augmentation: an iterator over `Step`. The run pauses while no steps are taken.

    phase: the present phase of the run and its progress: name, unit, done, total. None before the first phase.
    report: the JSON of `glint ... --json`, after the last step. None if the run was stopped before it had a result.
    stopped: whether `stop()` or Ctrl-C ended the run, after the last step.

    A notebook shows the run's progress. If the iterator is deleted, the run stops as by `stop()`.
    """

    phase: tuple[str, str, int, int] | None
    report: _Any
    stopped: bool

    def __init__(self, arguments: list[str]) -> None:
        self.phase = None
        self.report = None
        self.stopped = False
        self._job = _glint.Job(arguments)
        self._shown: _Callable[[str], None] | None = None

    def __iter__(self) -> _Iterator[Step]:
        return self

    def __next__(self) -> Step:
        try:
            step = self._take()
        except KeyboardInterrupt:
            # The run writes its scene and checkpoint before the interrupt is raised. A second Ctrl-C does not wait for them.
            self.stop()
            while self._take() is not None:
                pass
            raise
        if step is None:
            raise StopIteration
        return step

    def _take(self) -> Step | None:
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
                self._show(f"step {step.step}/{step.steps}{quality}, {step.gaussians} Gaussians")
                return step
        printed, self.stopped = self._job.result()
        self.report = _json.loads(printed) if printed else None
        return None

    def stop(self) -> None:
        """Stops the run after the steps that are under way: it writes its scene and checkpoint, and the iterator ends.

        The same call of `train` or `enhance` resumes the run.
        """
        self._job.stop()

    def _show(self, text: str) -> None:
        """Replaces the line that a notebook shows."""
        if self._shown is None:
            self._shown = _notebook()
        self._shown(text)


def _notebook() -> _Callable[[str], None]:
    """A function that replaces a line below the notebook's cell. Outside notebooks it does nothing."""
    ipython = _sys.modules.get("IPython")
    if ipython is None or not hasattr(ipython.get_ipython(), "kernel"):
        return lambda text: None
    handle = ipython.display.display({"text/plain": ""}, raw=True, display_id=True)
    return lambda text: handle.update({"text/plain": text}, raw=True)


def _warn(notes: list[str]) -> None:
    """Warns at the line that called this module."""
    level, frame = 1, _inspect.currentframe()
    while frame and frame.f_code.co_filename == __file__:
        level, frame = level + 1, frame.f_back
    for text in notes:
        _warnings.warn(text, Note, stacklevel=level)


def _text(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (tuple, list)):
        return ",".join(map(str, value))
    return _os.fspath(value) if isinstance(value, _os.PathLike) else str(value)


def _arguments(command: str, paths: list[_Path], options: dict[str, _Any]) -> list[str]:
    """Command-line arguments of `options` and `paths`."""
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


def _report(command: str, paths: list[_Path], options: dict[str, _Any]) -> _Any:
    """Runs a command to its end. Returns its JSON."""
    run = Run([command, *_arguments(command, paths, {**options, "json": True})])
    for _ in run:
        pass
    return run.report


def _host(name: str, values: _Any, dtype: _Any = _np.float32) -> _npt.NDArray[_Any]:
    """A contiguous array on the host, a copy only if the layout or the type differs."""
    if hasattr(values, "detach"):
        # torch exports no tensor that needs a gradient.
        values = values.detach()
    if hasattr(values, "__dlpack_device__") and not isinstance(values, _np.ndarray):
        device = int(values.__dlpack_device__()[0])
        if device not in _HOST:
            raise InputError(
                f"{name} is on a device (type {device} of DLPack), expected an array on the host: copy it with .cpu() in torch, .get() in "
                "CuPy, jax.device_get in JAX"
            )
    try:
        if hasattr(values, "__dlpack__") and not hasattr(values, "__array__"):
            values = _np.from_dlpack(values)
        return _np.ascontiguousarray(values, dtype=dtype)
    except (BufferError, RuntimeError, TypeError, ValueError) as error:
        raise InputError(f"{name}: numpy makes no {_np.dtype(dtype)} array of it: {error}") from None


def _array(name: str, values: _Any, dimensions: int, dtype: _Any = _np.float32) -> _npt.NDArray[_Any]:
    """A contiguous array on the host with this number of dimensions."""
    array = _host(name, values, dtype)
    if array.ndim != dimensions:
        raise InputError(f"{name} has shape {list(array.shape)}, expected {dimensions} dimensions")
    return array


def load(path: _Path, **options: _Any) -> Scene:
    """Reads a scene of any format that glint reads, recognized by its contents.

    The scene's arrays are read-only views of glint's memory, without copies.

    Raises InputError if the file is not a scene.
    """
    scene, notes = _glint.load(_arguments("load", [path], options))
    _warn(notes)
    return scene


def save(scene: Scene, path: _Path, **options: _Any) -> None:
    """Writes a scene. The ending of the path chooses the format: .ply, .glb, .compressed.ply, .sog, FOLDER/lod-meta.json,
    .rad, .spz, .usda, .usdz or .splat.

    The file appears whole or not at all.

    Raises InputError if the file exists and `force` is not given, or if the format cannot store the scene's lobes; DeviceError if the
    disk is full.
    """
    _warn(_glint.save(_arguments("save", [path], options), scene))


def convert(input: _Path, output: _Path, **options: _Any) -> _Any:
    """Writes a scene file in another format. Returns the JSON of `glint convert --json`.

    Raises InputError and DeviceError as `load` and `save`.
    """
    return _report("convert", [input, output], options)


def dataset(path: _Path, **options: _Any) -> Dataset:
    """Reads the cameras, names and sparse points of a dataset. `Photo.image` reads pixels.

    Raises InputError if the path is not a dataset.
    """
    found = _glint.Dataset(_arguments("dataset", [path], options))
    _warn(found.notes)
    photos = []
    for number, (name, split, width, height, k, viewmat) in enumerate(found.photos()):
        camera = Camera(width, height, _np.reshape(k, (3, 3)), _np.reshape(viewmat, (4, 4)))
        photos.append(Photo(name, split, camera, found, number))
    points, colors = found.points() or (None, None)
    return Dataset(photos, points, colors, tuple(found.background), found.extent)


def render(
    scene: Scene,
    camera: Camera,
    *,
    background: tuple[float, float, float] | None = None,
    compensate: bool | None = None,
    depth: bool = False,
    device: str | None = None,
) -> Rendered:
    """Renders a scene from a camera. The scene stays on the device for the next call.

    background: three sRGB values from 0 to 1. By default the scene's own, or black if that is unknown.
    compensate: whether Gaussians smaller than a pixel fade. By default as the scene was trained, or no if that is unknown.
    depth: whether to render depths too.
    device: name or number, as the command line's --device.

    Raises InputError if the camera is not a pinhole camera; DeviceError if there is no device or not enough memory.
    """
    k, viewmat = _array("K", camera.K, 2, _np.float64), _array("viewmat", camera.viewmat, 2, _np.float64)
    pictures = _glint.render(scene, camera.width, camera.height, k, viewmat, background, compensate, depth, device)
    return Rendered(*pictures)


class Meta:
    """Inputs of the gradients of a call of `rasterization`. It holds buffers on the device until it is deleted."""

    def __init__(self, native: _glint.Meta, coefficients: int | None) -> None:
        self._native = native
        self._coefficients = coefficients

    def backward(self, image_grad: _ArrayLike) -> Gradients:
        """Gradients of a loss, given its gradient by the images: `image_grad`, (C, height, width, 3).

        Colors below 0 are clamped: they have a gradient only if it raises them. Opacities are clamped to 2^-24 from 0 and 1.

        Raises InputError for another shape; DeviceError if the device has not enough memory.
        """
        gradients = Gradients(*self._native.backward(_array("image_grad", image_grad, 4)))
        if self._coefficients is None:
            return gradients
        # Bands above sh_degree have no gradient.
        unused = self._coefficients - gradients.colors.shape[1]
        return gradients._replace(colors=_np.pad(gradients.colors, ((0, 0), (0, unused), (0, 0)))) if unused else gradients


def rasterization(
    means: _ArrayLike,
    quats: _ArrayLike,
    scales: _ArrayLike,
    opacities: _ArrayLike,
    colors: _ArrayLike,
    viewmats: _ArrayLike,
    Ks: _ArrayLike,
    width: int,
    height: int,
    *,
    sh_degree: int | None = None,
    backgrounds: _ArrayLike | None = None,
    rasterize_mode: str = "classic",
    device: str | None = None,
) -> tuple[_Array32, _Array32, Meta]:
    """Renders N Gaussians, given as arrays, from C cameras. Names and shapes of the arguments are gsplat's.

    means: (N, 3), scene units.
    quats: (N, 4), w first, of any length but 0.
    scales: (N, 3), standard deviations, scene units, above 0.
    opacities: (N,), 0 to 1.
    colors: (N, 3), sRGB; or with `sh_degree` (N, K, 3), coefficients of spherical harmonics, of which the first
        (sh_degree + 1)^2 are used. Colors below 0 are clamped.
    viewmats: (C, 4, 4), rotation and translation from the world to the camera.
    Ks: (C, 3, 3), pixels.
    width, height: pixels.
    sh_degree: degree of the harmonics, 0 to 3.
    backgrounds: (C, 3), sRGB. Black by default.
    rasterize_mode: "classic", or "antialiased" to fade Gaussians smaller than a pixel.
    device: name or number, as the command line's --device.

    Returns images (C, height, width, 3) and alphas (C, height, width, 1), both float32, and a `Meta`, whose `backward` computes
    gradients. Gaussians nearer than 0.2 scene units are not drawn, and every Gaussian is blurred by 0.3 px^2. Once the `Meta` is
    deleted, the next call with the same image size and degree uses its buffers again.

    Raises InputError with the array's name for an invalid shape or number; DeviceError if there is no device or not enough memory.
    """
    if rasterize_mode not in ("classic", "antialiased"):
        raise InputError(f"rasterize_mode is {rasterize_mode!r}, expected 'classic' or 'antialiased'")
    if sh_degree not in (None, 0, 1, 2, 3):
        raise InputError(f"sh_degree is {sh_degree!r}, expected None or 0 to 3")
    coefficients = None
    if sh_degree is None:
        harmonics = _array("colors", colors, 2)[:, None]
    else:
        harmonics = _array("colors", colors, 3)
        coefficients = harmonics.shape[1]
        harmonics = _np.ascontiguousarray(harmonics[:, : (sh_degree + 1) ** 2])
    viewmats = _array("viewmats", viewmats, 3, _np.float64)
    image, alpha, native = _glint.rasterize(
        _array("means", means, 2),
        _array("quats", quats, 2),
        _array("scales", scales, 2),
        _array("opacities", opacities, 1),
        harmonics,
        viewmats,
        _array("Ks", Ks, 3, _np.float64),
        width,
        height,
        sh_degree,
        _array("backgrounds", _np.zeros((len(viewmats), 3)) if backgrounds is None else backgrounds, 2),
        rasterize_mode == "antialiased",
        device,
    )
    return image, alpha, Meta(native, coefficients)


def train(dataset: _Path, output: _Path, **options: _Any) -> Run:
    """Trains a base scene on photos, as `glint train` does. Returns the run, an iterator over steps. It begins at once.

        for step in train("garden", "base.ply", iterations=7000):
            print(step.step, step.psnr)

    The run writes the scene to `output`, a PLY file, at its end. Every minute it writes a checkpoint next to it; the same call resumes
    from that. `run.stop()` and Ctrl-C end a run early: it writes its scene and checkpoint.

    The iterator raises InputError and DeviceError with the texts of the command line.
    """
    return Run(["train", *_arguments("train", [dataset], {**options, "output": output, "json": True})])


def enhance(dataset: _Path, base: _Path, output: _Path, **options: _Any) -> Run:
    """Augments a base scene, a file, from photos, as `glint enhance` does. Returns the run, an iterator over steps of the joint phase.

    Checkpoints, stopping and errors are those of `train`.
    """
    options = {**options, "base": base, "output": output, "json": True}
    return Run(["enhance", *_arguments("enhance", [dataset], options)])


def evaluate(scene: Scene | _Path, dataset: _Path, **options: _Any) -> _Any:
    """Compares a scene, or a scene's file, with the photos of a dataset: PSNR [dB] and SSIM of each view, and their means.

    Returns the JSON of `glint eval --json`: {"base": {"psnr", "ssim"}, "augmented": {"psnr", "ssim"}, "views": [...]}.

    Raises InputError and DeviceError with the texts of the command line.
    """
    if not isinstance(scene, Scene):
        return _report("eval", [scene, dataset], options)
    with _tempfile.TemporaryDirectory() as folder:
        path = _os.path.join(folder, "scene.ply")
        save(scene, path)
        return _report("eval", [path, dataset], options)


def partition(dataset: _Path, output: _Path, **options: _Any) -> _Any:
    """Cuts a dataset into parts that train by themselves, as `glint partition` does, and writes the plan to `output`, a JSON file.

    Returns the JSON of `glint partition --json`. `train` and `enhance` take the plan as their dataset, with `part`. `glint_splat.cluster`
    trains all parts on a Ray cluster.

    Raises InputError if the dataset has no sparse points, or no cut keeps the limits.
    """
    return _report("partition", [dataset], {**options, "output": output})


def merge(plan: _Path, parts: list[_Path], output: _Path, **options: _Any) -> _Any:
    """Merges the trained parts of a plan into `output`, a PLY file, as `glint merge` does. Returns the JSON of `glint merge --json`.

    Raises InputError if a part is missing, unfinished or of another plan.
    """
    return _report("merge", [plan, *parts], {**options, "output": output})


def verify(dataset: _Path | None = None, scene: _Path | None = None, **options: _Any) -> _Any:
    """Compares every kernel on a device with its float64 twin. Returns the JSON of `glint verify --json`.

    Raises DeviceError if an error exceeds its bound.
    """
    return _report("verify", [path for path in (dataset, scene) if path is not None], options)


def devices() -> _Any:
    """Vulkan devices for `device`, as `glint devices --json` lists them. "refused" is the reason why glint cannot use one."""
    return _report("devices", [], {})


def _describe(function: _Any, command: str, taken: tuple[str, ...]) -> None:
    """Adds the options of a command to a function's signature and documentation."""
    signature = _inspect.signature(function)
    parameters = [p for p in signature.parameters.values() if p.kind is not p.VAR_KEYWORD]
    lines = []
    for name, help, takes_value, repeats, default, names in _glint.options(command):
        key = name.replace("-", "_")
        if key in taken:
            continue
        begins = default if takes_value else False
        parameters.append(_inspect.Parameter(key, _inspect.Parameter.KEYWORD_ONLY, default=begins))
        choices = f" ({', '.join(names)})" if names and takes_value else ""
        lines.append(f"{key}: {help}{choices}.")
    function.__signature__ = signature.replace(parameters=parameters)
    function.__doc__ = (function.__doc__ or "") + "\n    Options:\n\n" + "".join(f"    {line}\n" for line in lines)


for _function, _command, _taken in (
    (load, "load", ()),
    (save, "save", ()),
    (dataset, "dataset", ()),
    (convert, "convert", ("json",)),
    (train, "train", ("output", "json", "view")),
    (enhance, "enhance", ("base", "output", "json", "view")),
    (evaluate, "eval", ("json",)),
    (partition, "partition", ("output", "json")),
    (merge, "merge", ("output", "json")),
    (verify, "verify", ("json", "explain")),
):
    _describe(_function, _command, _taken)
