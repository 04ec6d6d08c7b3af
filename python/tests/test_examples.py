"""Each example, on a small dataset."""

import json
import os
import pathlib
import subprocess
import sys

import glint_splat as g
import pytest

EXAMPLES = pathlib.Path(__file__).parents[1] / "examples"


def run(folder, name, *arguments):
    ended = subprocess.run(
        [sys.executable, "-W", "ignore", EXAMPLES / name, *map(str, arguments)], cwd=folder, capture_output=True, text=True, timeout=600
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stdout.splitlines()


def test_autograd_learns_as_well_as_glint_s_own_adam(folder, photos):
    pytest.importorskip("torch", reason="examples/autograd.py needs torch")
    steps, points = 600, 300
    lines = run(folder, "autograd.py", photos, "torch.ply", f"--iterations={steps}", f"--points={points}")
    for _ in g.train(photos, folder / "adam.ply", strategy="adc", iterations=steps, points=points, gaussians=points):
        pass
    own = g.evaluate(folder / "adam.ply", photos)["base"]["psnr"]
    assert json.loads(lines[-1])["psnr"] > own - 0.1
    assert len(g.load(folder / "torch.ply").base) == points


def test_fox_is_trained_logged_and_shown(tmp_path, photos):
    pytest.importorskip("viser", reason="examples/fox.py needs viser")
    pytest.importorskip("rerun", reason="examples/fox.py needs rerun-sdk")
    lines = run(tmp_path, "fox.py", photos, "--iterations=100", "--max-size=48", "--headless")
    assert lines[0].startswith("train: 100 steps") and lines[1].startswith("enhance: ")
    assert "with them" in lines[2] and any(line.startswith("viser: http://127.0.0.1:") for line in lines)
    assert os.path.getsize(tmp_path / "fox.rrd") > 10_000 and len(g.load(tmp_path / "fox.ply").supplement) > 0
