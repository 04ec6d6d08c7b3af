"""Training and augmentation as iterators, beside the command line's runs."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
import types

import glint_splat as g
import pytest
from conftest import ENHANCE, TRAIN, options


def python(code, **names):
    """Python that runs `code` with these names, and a glint_splat that warns of nothing."""
    given = "".join(f"{name} = {value!r}\n" for name, value in names.items())
    program = f"import warnings, glint_splat as g\nwarnings.simplefilter('ignore')\n{given}{code}"
    return subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def test_training_has_the_command_line_s_bits(folder, photos, base):
    run = g.train(photos, folder / "same.ply", **TRAIN)
    steps = list(run)
    assert (folder / "same.ply").read_bytes() == base.read_bytes()
    last = steps[-1]
    assert (last.step, last.steps, last.gaussians) == (120, 120, 400) and run.phase == ("training", "steps", 120, 120)
    assert 0 < last.loss < steps[1].loss and last.psnr > 10 and 0 < steps[0].seconds < last.seconds
    assert [step.step for step in steps] == sorted({step.step for step in steps})
    assert run.report["gaussians"] == 400 and run.report["iterations"] == 120 and not run.stopped
    assert not (folder / "same.checkpoint.safetensors").exists()


def test_augmentation_has_the_command_line_s_bits(folder, photos, base, augmented):
    run = g.enhance(photos, base, folder / "more.ply", **ENHANCE)
    steps = list(run)
    assert (folder / "more.ply").read_bytes() == augmented.read_bytes()
    assert steps[-1].step == steps[-1].steps > 0 and run.report["plan"]
    written = 400 + run.report["plain_gaussians"] + run.report["supplementary_gaussians"]
    # Gaussians that are never seen are not written.
    assert written <= steps[-1].gaussians < written + 10


def test_a_killed_run_resumes_with_the_same_bits(folder, photos, base):
    output = folder / "killed.ply"
    code = """
for step in g.train(photos, output, checkpoint_every=0, **options):
    if step.step > 50:
        print(step.step, flush=True)
"""
    killed = python(code, photos=str(photos), output=str(output), options=TRAIN)
    assert int(killed.stdout.readline()) > 50
    killed.kill()
    killed.wait()
    assert (folder / "killed.checkpoint.safetensors").exists() and not output.exists()
    run = g.train(photos, output, **TRAIN)
    with pytest.warns(g.Note, match="resuming after step"):
        first = next(run)
    assert first.step > 1
    list(run)
    assert run.report["iterations_resumed"] > 0
    assert output.read_bytes() == base.read_bytes()


def test_a_stopped_run_is_a_scene_and_resumes_on_the_command_line(glint, folder, photos, base):
    output = folder / "stopped.ply"
    run = g.train(photos, output, **TRAIN)
    for step in run:
        if step.step >= 40:
            run.stop()
    assert run.stopped and 40 <= run.report["iterations"] < 120
    assert len(g.load(output).base) > 100
    glint("train", photos, "-o", output, *options(TRAIN))
    assert output.read_bytes() == base.read_bytes()


def test_a_run_waits_for_whoever_takes_its_steps_and_ends_with_them(folder, photos):
    run = g.train(photos, folder / "left.ply", **{**TRAIN, "iterations": 100_000})
    for step in run:
        if step.step > 20:
            break
    time.sleep(1.0)
    # One step is ready and one on its way.
    assert next(run).step <= step.step + 3 * 16
    with pytest.raises(g.InputError, match="another glint process is writing here"):
        next(g.train(photos, folder / "left.ply", **TRAIN))
    del run
    assert (folder / "left.ply").exists() and (folder / "left.checkpoint.safetensors").exists()


def test_ctrl_c_keeps_what_was_learned(folder, photos):
    output = folder / "interrupted.ply"
    code = """
try:
    for step in g.train(photos, output, iterations=100_000, points=200):
        print(step.step, flush=True)
except KeyboardInterrupt:
    print("interrupted", flush=True)
    raise
"""
    run = python(code, photos=str(photos), output=str(output))
    while int(run.stdout.readline()) < 20:
        pass
    run.send_signal(signal.SIGINT)
    printed, errors = run.communicate(timeout=60)
    assert printed.splitlines()[-1] == "interrupted" and errors.endswith("KeyboardInterrupt\n")
    assert run.returncode == -signal.SIGINT
    assert output.exists() and (folder / "interrupted.checkpoint.safetensors").exists()


def test_a_program_s_end_is_a_run_s_end(folder, photos):
    output = folder / "ended.ply"
    code = "run = g.train(photos, output, iterations=100_000, points=200)\nwhile next(run).step < 20: pass"
    ended = python(code, photos=str(photos), output=str(output))
    assert ended.communicate(timeout=60) == ("", "") and ended.returncode == 0
    assert output.exists() and (folder / "ended.checkpoint.safetensors").exists()


def test_notebooks_show_progress(folder, photos, monkeypatch):
    lines, kernel = [], types.SimpleNamespace(kernel=True)

    def display(data, raw, display_id):
        lines.append(data["text/plain"])
        return types.SimpleNamespace(update=lambda data, raw: lines.append(data["text/plain"]))

    notebook = types.SimpleNamespace(get_ipython=lambda: kernel, display=types.SimpleNamespace(display=display))
    monkeypatch.setitem(sys.modules, "IPython", notebook)
    for _ in g.train(photos, folder / "shown.ply", **TRAIN):
        pass
    assert lines[0] == "" and any(line.startswith("step 120/120, loss 0.") for line in lines)


def test_ctrl_c_ends_an_evaluation(photos, base):
    code = """
print("begins", flush=True)
while True:
    g.evaluate(scene, photos, split="all")
"""
    run = python(code, photos=str(photos), scene=str(base))
    run.stdout.readline()
    time.sleep(1.0)
    run.send_signal(signal.SIGINT)
    assert run.communicate(timeout=60)[1].endswith("KeyboardInterrupt\n") and run.returncode == -signal.SIGINT


def test_other_threads_go_on_meanwhile(folder, photos):
    turns, ends = [0], threading.Event()

    def count():
        while not ends.wait(0.001):
            turns[0] += 1

    thread = threading.Thread(target=count)
    thread.start()
    began = time.monotonic()
    for _ in g.train(photos, folder / "threads.ply", **TRAIN):
        pass
    took = time.monotonic() - began
    ends.set()
    thread.join()
    assert turns[0] > 20 * took


def test_bad_runs_have_the_command_line_s_errors(glint, folder, photos, base):
    output = folder / "never.ply"
    for call, arguments in [
        (lambda: g.train(folder / "nothing", output), ["train", folder / "nothing", "-o", output]),
        (lambda: g.train(photos, base), ["train", photos, "-o", base]),
        (lambda: g.train(photos, output, iterations=0), ["train", photos, "-o", output, "--iterations=0"]),
        (lambda: g.train(photos, output, color="sb"), ["train", photos, "-o", output, "--color=sb"]),
        (lambda: g.enhance(photos, photos, output), ["enhance", photos, "--base", photos, "-o", output]),
        (lambda: g.evaluate(photos, base), ["eval", photos, base]),
    ]:
        with pytest.raises(g.InputError) as found:
            list(call())
        assert str(found.value) == glint(*arguments)
    assert not output.exists()


def test_evaluation_is_the_command_line_s(glint, photos, augmented):
    theirs = json.loads(glint("eval", augmented, photos, "--json"))
    assert g.evaluate(augmented, photos) == theirs
    assert g.evaluate(g.load(augmented), photos, split="test") == theirs


def test_devices_and_verify_are_the_command_line_s(glint):
    assert g.devices() == json.loads(glint("devices", "--json"))
    report = g.verify(quick=True)
    assert report["device"] and len(report["rows"]) > 50
    # No bound notices so small an error.
    with pytest.raises(g.DeviceError, match="out of bounds"):
        g.verify(quick=True, perturb=1e-9)
