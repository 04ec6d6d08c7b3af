"""Trains the parts of a plan (`glint partition`) on a Ray cluster or as a SLURM array, and merges them.

Parts need no communication, so all scheduling is left to the engine. A part is one task that holds one device. It writes its scene and its
checkpoint to `storage`; a task that is run again resumes from there, and gives the same bytes as one that was never interrupted.
"""

from __future__ import annotations

import argparse as _argparse
import json as _json
import os as _os
import pathlib as _pathlib
import shlex as _shlex
import sys as _sys
import tempfile as _tempfile
import time as _time
from typing import Any as _Any

import glint_splat as _glint_splat

# Seconds between reports of a task, and between checkpoints that it copies to a URL.
_REPORT_EVERY = 1.0
_COPY_EVERY = 60.0


class _Storage:
    """A folder, or any URL that fsspec knows, with the files of all parts."""

    def __init__(self, place: str) -> None:
        self.place = place
        self.is_remote = "://" in place
        if not self.is_remote:
            _os.makedirs(place, exist_ok=True)
            return
        try:
            import fsspec
        except ImportError as error:
            raise _glint_splat.InputError(f"{place} is a URL, which needs the package fsspec") from error
        self._files, self._root = fsspec.core.url_to_fs(place)
        self._files.makedirs(self._root, exist_ok=True)

    def fetch(self, name: str, folder: str) -> str:
        """The local path of a file; the file need not exist. Of a URL, a copy in `folder`."""
        if not self.is_remote:
            return _os.path.join(self.place, name)
        local, there = _os.path.join(folder, name), f"{self._root}/{name}"
        if self._files.exists(there):
            self._files.get_file(there, local)
        return local

    def store(self, name: str, folder: str) -> None:
        """Copies a file of `folder` to the URL: under another name first, so that it appears whole. A missing one is removed there."""
        if not self.is_remote:
            return
        local, there = _os.path.join(folder, name), f"{self._root}/{name}"
        if _os.path.exists(local):
            self._files.put_file(local, there + ".part")
            self._files.mv(there + ".part", there)
        elif self._files.exists(there):
            self._files.rm_file(there)


def _names(part: int) -> tuple[str, str]:
    """Names of a part's scene and checkpoint."""
    return f"part-{part}.ply", f"part-{part}.checkpoint.safetensors"


def _is_complete(path: str) -> bool:
    """Whether a scene is a part whose training has ended."""
    try:
        with open(path, "rb") as file:
            header = file.read(1 << 14).split(b"end_header")[0]
    except OSError:
        return False
    return any(line.startswith(b"comment glint part ") and line.endswith(b" complete") for line in header.splitlines())


def _train_part(plan: str, part: int, storage: str, options: dict[str, _Any], tell: _Any) -> None:
    """Trains a part unless its scene is there. `tell` is called with each reported step."""
    files = _Storage(storage)
    scene, checkpoint = _names(part)
    with _tempfile.TemporaryDirectory() as folder:
        output = files.fetch(scene, folder)
        if _is_complete(output):
            return
        kept = files.fetch(checkpoint, folder)
        reported = copied = _time.monotonic()
        for step in _glint_splat.train(plan, output, part=part, **options):
            now = _time.monotonic()
            if now - reported >= _REPORT_EVERY:
                reported = now
                tell(step)
            if files.is_remote and now - copied >= _COPY_EVERY and _os.path.exists(kept):
                copied = now
                files.store(checkpoint, folder)
        files.store(scene, folder)
        files.store(checkpoint, folder)


def _device(numbers: list[str]) -> dict[str, str]:
    """The option for the GPU that the engine gave this task: its number among the machine's GPUs, in the order of `glint devices`."""
    gpus = [device["index"] for device in _glint_splat.devices() if not device["is_cpu"] and device["refused"] is None]
    if not numbers or not gpus:
        return {}
    number = int(numbers[0]) if numbers[0].isdigit() else 0
    return {"device": str(gpus[number % len(gpus)])}


def cluster(
    plan: str,
    output: str,
    storage: str,
    address: str | None = "auto",
    retries: int = 3,
    show: _Any = None,
    **options: _Any,
) -> _Any:
    """Trains all parts of a plan on a Ray cluster and merges them into `output`. Returns the JSON of `glint merge --json`.

    plan: a plan of `glint partition`. It and its dataset have the same paths on all machines.
    storage: a folder that all machines share, or a URL of fsspec, for scenes and checkpoints of parts.
    address: of the cluster; None starts Ray on this machine.
    retries: number of times that a part is run again if its worker dies.
    show: called with a line on the progress of all parts, once a second.
    options: of `train`.

    A part needs one GPU if the cluster has any, otherwise one CPU. Parts whose scenes are in `storage` are not trained again.

    Raises InputError and DeviceError of the parts.
    """
    import ray

    plan = _os.path.abspath(plan)
    storage = storage if "://" in storage else _os.path.abspath(storage)
    with open(plan, encoding="utf-8") as file:
        parts = len(_json.load(file)["parts"])
    started = not ray.is_initialized()
    if started:
        ray.init(address=address, log_to_driver=False, logging_level="error")
    has_gpus = ray.cluster_resources().get("GPU", 0) > 0
    resources = {"num_gpus": 1} if has_gpus else {"num_cpus": 1}

    @ray.remote(num_cpus=0)
    class Board:
        """The last step of each part."""

        def __init__(self) -> None:
            self.steps: dict[int, tuple[int, int]] = {}

        def tell(self, part: int, step: int, steps: int) -> None:
            self.steps[part] = (step, steps)

        def read(self) -> dict[int, tuple[int, int]]:
            return self.steps

    @ray.remote(max_retries=retries, **resources)
    def train_part(part: int, board: _Any) -> int:
        given = _device([str(number) for number in ray.get_gpu_ids()]) if has_gpus else {}
        tell = lambda step: board.tell.remote(part, step.step, step.steps)
        _train_part(plan, part, storage, {**options, **given}, tell)
        return part

    try:
        board = Board.remote()
        left = {train_part.remote(part, board): part for part in range(parts)}
        while left:
            done, _ = ray.wait(list(left), timeout=_REPORT_EVERY)
            ray.get(done)
            for part in done:
                del left[part]
            if show:
                steps = ray.get(board.read.remote())
                running = ", ".join(f"{part}: {step}/{of}" for part, (step, of) in sorted(steps.items()) if part in left.values())
                show(f"{parts - len(left)} of {parts} parts done" + (f"; steps of part {running}" if running else ""))
    finally:
        if started:
            ray.shutdown()
    files = _Storage(storage)
    with _tempfile.TemporaryDirectory() as folder:
        scenes = [files.fetch(_names(part)[0], folder) for part in range(parts)]
        return _glint_splat.merge(plan, scenes, output, force=True)


def slurm(plan: str, output: str, storage: str, options: list[str] | None = None) -> str:
    """A shell script that submits the parts of a plan as a SLURM array, one GPU each, and a job that merges them.

    `options` are those of `glint train`. A requeued part resumes from its checkpoint.
    """
    with open(plan, encoding="utf-8") as file:
        parts = len(_json.load(file)["parts"])
    plan, output, storage = (_shlex.quote(_os.path.abspath(path)) for path in (plan, output, storage))
    given = " ".join(_shlex.quote(option) for option in options or [])
    train = f"glint train {plan} --part $SLURM_ARRAY_TASK_ID -o {storage}/part-$SLURM_ARRAY_TASK_ID.ply --force {given}".rstrip()
    return f"""#!/bin/sh
# Submits {parts} parts and their merge: sh THIS_FILE. Options of your site, such as a partition, go to both calls of sbatch.
set -eu
mkdir -p {storage}
parts=$(sbatch --parsable --job-name=glint --array=0-{parts - 1} --gres=gpu:1 --requeue --wrap={_shlex.quote(train)})
sbatch --job-name=glint-merge --dependency=afterok:$parts --wrap={_shlex.quote(f"glint merge {plan} {storage} -o {output} --force")}
"""


def _parser() -> _argparse.ArgumentParser:
    parser = _argparse.ArgumentParser(prog="python -m glint_splat", description=__doc__, formatter_class=_argparse.RawTextHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    for name, about in (("cluster", "train the parts of a plan on a Ray cluster"), ("slurm", "print a script that submits them to SLURM")):
        command = commands.add_parser(name, help=about, epilog="Other options are those of glint train, such as --iterations=7000.")
        command.add_argument("plan", help="plan of glint partition")
        command.add_argument("-o", "--output", required=True, metavar="PLY", help="the merged scene")
        command.add_argument("--storage", metavar="DIR|URL", help="folder or fsspec URL that all machines share [default: PLAN.parts]")
        if name == "cluster":
            place = command.add_mutually_exclusive_group()
            place.add_argument("--address", default="auto", help="address of the Ray cluster [default: auto]")
            place.add_argument("--local", action="store_true", help="start Ray on this machine")
            command.add_argument("--retries", type=int, default=3, metavar="N", help="runs of a part whose worker dies [default: 3]")
    return parser


def _named(arguments: list[str]) -> dict[str, _Any]:
    """Options of `train` from --name=value and --name."""
    named: dict[str, _Any] = {}
    for argument in arguments:
        if not argument.startswith("--"):
            raise _glint_splat.InputError(f"{argument} is not an option; values follow a =, as in --iterations=7000")
        name, _, value = argument[2:].partition("=")
        named[name.replace("-", "_")] = value if value else True
    return named


def main(arguments: list[str] | None = None) -> int:
    """The command line. Returns its exit code."""
    given, rest = _parser().parse_known_args(arguments)
    storage = given.storage or str(_pathlib.Path(given.plan).with_suffix("")) + ".parts"
    try:
        if given.command == "slurm":
            print(slurm(given.plan, given.output, storage, rest), end="")
            return 0
        address = None if given.local else given.address
        show = lambda line: print(f"\r\033[K{line}" if _sys.stderr.isatty() else line, end="" if _sys.stderr.isatty() else "\n", file=_sys.stderr)
        report = cluster(given.plan, given.output, storage, address, given.retries, show, **_named(rest))
        print(_json.dumps(report, indent=2))
        return 0
    except (_glint_splat.Error, OSError, ImportError) as error:
        print(f"error: {error}", file=_sys.stderr)
        return 1 if isinstance(error, _glint_splat.DeviceError) else 2
