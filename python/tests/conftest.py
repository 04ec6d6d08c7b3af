"""A small dataset, a base and an augmented scene, made by the command line. Tests compare the module with them."""

import json
import os
import pathlib
import shutil
import subprocess

import pytest

ROOT = pathlib.Path(__file__).parents[2]
TRAIN = {"iterations": 120, "points": 200, "gaussians": 400}
ENHANCE = {"ratio": 0.2}


def options(named):
    """The same options for the command line."""
    return [f"--{name.replace('_', '-')}={value}" for name, value in named.items()]


@pytest.fixture(scope="session")
def glint():
    """Runs the command line; its output, or the text of its error. `notes` are those of the last run."""
    program = os.environ.get("GLINT") or shutil.which(ROOT / "target/release/glint")
    assert program, "cargo build --release makes the command line, or GLINT names it"

    def run(*arguments):
        ended = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True)
        said = lambda kind: [line[len(kind) :] for line in ended.stderr.splitlines() if line.startswith(kind)]
        run.notes = said("note: ")
        return ended.stdout if ended.returncode == 0 else said("error: ")[0]

    run.program = program
    return run


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("glint")


@pytest.fixture(scope="session")
def photos(glint, folder):
    glint("synth", "mirror", "-o", folder / "photos", "--size=48", "--views=16", "--points=300")
    return folder / "photos"


@pytest.fixture(scope="session")
def base(glint, folder, photos):
    glint("train", photos, "-o", folder / "base.ply", *options(TRAIN))
    return folder / "base.ply"


@pytest.fixture(scope="session")
def augmented(glint, folder, photos, base):
    """And the command line's report on it."""
    path = folder / "augmented.ply"
    report = json.loads(glint("enhance", photos, "--base", base, "-o", path, "--json", *options(ENHANCE)))
    assert report["supplementary_gaussians"] > 0
    return path
