"""Parts of a plan on Ray and in a SLURM script."""

import json
import os
import pathlib
import signal
import subprocess
import sys
import time

import glint_splat as g
import pytest
from conftest import TRAIN
from glint_splat import cluster

# Long enough for a worker to die in the middle of its part.
PART = {**TRAIN, "iterations": 400, "checkpoint_every": 0}


@pytest.fixture(scope="module")
def plan(folder, photos):
    sizes = g.partition(photos, folder / "plan.json", photos=4)["parts"]
    assert len(sizes) == 4 and all(0 < part["photos"] <= 4 for part in sizes)
    return str(folder / "plan.json")


@pytest.fixture(scope="module")
def one_by_one(folder, plan):
    """Parts trained one after another."""
    parts = [folder / f"{part}.ply" for part in range(4)]
    for part, output in enumerate(parts):
        list(g.train(plan, output, part=part, **PART))
    return parts


def workers(name):
    """Processes of Ray's workers that run this task."""
    found = []
    for process in pathlib.Path("/proc").iterdir():
        if process.name.isdigit():
            try:
                command = (process / "cmdline").read_bytes()
            except OSError:
                continue
            if command.startswith(b"ray::" + name.encode()):
                found.append(int(process.name))
    return found


def test_two_workers_of_which_one_is_killed_give_the_bytes_of_parts_trained_one_after_another(folder, plan, one_by_one):
    ray = pytest.importorskip("ray", reason="Ray has no wheel for this Python")
    storage, killed, lines = folder / "parts", [], []

    def kill_one(line):
        """Once there is a checkpoint of a part: then the part is not complete."""
        lines.append(line)
        if not killed and list(storage.glob("*.checkpoint.safetensors")):
            killed.append(workers("train_part")[0])
            os.kill(killed[0], signal.SIGKILL)

    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False, logging_level="error")
    try:
        report = cluster.cluster(plan, str(folder / "merged.ply"), str(storage), show=kill_one, **PART)
    finally:
        ray.shutdown()
    assert killed and lines[-1] == "4 of 4 parts done"
    g.merge(plan, one_by_one, folder / "one-by-one.ply")
    assert (folder / "merged.ply").read_bytes() == (folder / "one-by-one.ply").read_bytes()
    assert report["gaussians"] == len(g.load(folder / "merged.ply").base)


def test_the_same_command_takes_complete_parts_as_they_are(folder, plan):
    pytest.importorskip("ray", reason="Ray has no wheel for this Python")
    if not (folder / "merged.ply").exists():
        pytest.skip("the test before this one makes the parts")
    written = (folder / "parts/part-0.ply").stat().st_mtime_ns
    command = [sys.executable, "-m", "glint_splat", "cluster", plan, "-o", str(folder / "again.ply"), "--local"]
    command += ["--storage", str(folder / "parts"), *(f"--{name.replace('_', '-')}={value}" for name, value in PART.items())]
    ended = subprocess.run(command, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    assert json.loads(ended.stdout)["gaussians"] == len(g.load(folder / "merged.ply").base)
    assert (folder / "again.ply").read_bytes() == (folder / "merged.ply").read_bytes()
    assert (folder / "parts/part-0.ply").stat().st_mtime_ns == written


def test_parts_lie_at_a_url(folder, plan, one_by_one):
    pytest.importorskip("fsspec")
    url = f"file://{folder}/url"
    told = []
    cluster._train_part(plan, 0, url, PART, told.append)
    assert sorted(os.listdir(folder / "url")) == ["part-0.ply"]
    assert (folder / "url/part-0.ply").read_bytes() == one_by_one[0].read_bytes()
    # A second call finds it complete.
    started = time.monotonic()
    cluster._train_part(plan, 0, url, PART, told.append)
    assert time.monotonic() - started < 1


def test_the_slurm_script_submits_an_array_and_a_merge_after_it(folder, plan):
    text = cluster.slurm(plan, "city.ply", "/shared/a b", ["--iterations=7000"])
    assert subprocess.run(["sh", "-n"], input=text, text=True).returncode == 0
    # `sbatch` as SLURM has it: prints the job's number here, and its arguments elsewhere.
    tools = folder / "tools"
    tools.mkdir()
    (tools / "sbatch").write_text(f'#!/bin/sh\nfor one; do echo "$one" >> {folder}/submitted; done\necho 7\n')
    (tools / "sbatch").chmod(0o755)
    text = text.replace("/shared/a b", str(folder / "a b"))
    run = subprocess.run(["sh"], input=text, text=True, env={**os.environ, "PATH": f"{tools}:{os.environ['PATH']}"})
    assert run.returncode == 0
    parts, merge = (folder / "submitted").read_text().split("--wrap=")[1:]
    submitted = (folder / "submitted").read_text().splitlines()
    assert "--array=0-3" in submitted and "--requeue" in submitted and "--dependency=afterok:7" in submitted
    storage = f"'{folder}/a b'"
    assert parts.splitlines()[0] == (
        f"glint train {plan} --part $SLURM_ARRAY_TASK_ID -o {storage}/part-$SLURM_ARRAY_TASK_ID.ply --force --iterations=7000"
    )
    assert merge.splitlines()[0] == f"glint merge {plan} {storage} -o {os.path.abspath('city.ply')} --force"


def test_what_no_cluster_can_train_is_an_input_error(folder, plan, capsys):
    assert cluster.main(["cluster", plan, "-o", "city.ply", "--iterations", "7000"]) == 2
    assert "7000 is not an option" in capsys.readouterr().err
    assert cluster.main(["slurm", str(folder / "no.json"), "-o", "city.ply"]) == 2
    assert "no.json" in capsys.readouterr().err
