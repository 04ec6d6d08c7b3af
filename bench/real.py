#!/usr/bin/env python3
"""Compares color models at equal bytes and steps, on held-out photos.

    bench/real.py DATASET... -o RUNS.jsonl [--bytes 25MB] [--max-size N] [--steps N] [--seeds N] [--holdout N|sector]
                  [--rows 3,bytes,run] [--glint PATH]

Rows of a dataset and seed:

- 0, 1, 2, 3: `glint train` with harmonics of this degree and as many Gaussians as fit the bytes;
- bytes: `glint train --bytes`, which leaves bands to some Gaussians;
- run: `glint train --bytes`, then `glint enhance --total-bytes`, as `glint run` does;
- run0: `glint train --sh-degree 0` with a share of the bytes, then `glint enhance --bytes` with the rest;
- run1, run2, run3: `glint train` with more than the bytes, then `glint enhance --total-bytes`, as `glint run --sh-degree` does.

Rows without `enhance` take 30 steps more for each training photo, like its joint phase. Each finished row is a JSON line in
RUNS.jsonl. `glint report --history` draws them; the same command continues after the last one. A table of means comes last.
"""

import argparse
import json
import pathlib
import subprocess
import sys
import tempfile
import time

GAUSSIAN_BYTES = {0: 56, 1: 104, 2: 164, 3: 248}
JOINT_STEPS = 30
# Of the bytes, for the base; as in src/cli/run.rs.
SHARES = {None: 1, 0: 0.65, 1: 1.25, 2: 1.25, 3: 1.25}
UNITS = {"GB": 1e9, "MB": 1e6, "kB": 1e3}


def parse_bytes(text):
    for unit, factor in UNITS.items():
        if text.endswith(unit):
            return int(float(text[: -len(unit)]) * factor)
    return int(text)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("datasets", nargs="+", type=pathlib.Path)
    parser.add_argument("-o", "--output", type=pathlib.Path, required=True)
    parser.add_argument("--bytes", type=parse_bytes, default=24_800_000)
    parser.add_argument("--max-size", type=int, default=1600)
    parser.add_argument("--steps", type=int, default=3000, help="steps before the joint phase")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--holdout")
    parser.add_argument("--rows", default="3,bytes,run")
    parser.add_argument("--glint", default="target/release/glint")
    args = parser.parse_args()

    settings = {"budget": args.bytes, "max_size": args.max_size, "base_steps": args.steps, "holdout": args.holdout or "default"}
    done = {}
    if args.output.exists():
        for line in args.output.read_text().splitlines():
            run = json.loads(line)
            if any(run[key] != value for key, value in settings.items()):
                sys.exit(f"real.py: {args.output} has runs with other settings than {settings}; give another file")
            done[run["dataset"], run["name"], run["seed"]] = run
    for seed in range(args.seeds):
        for dataset in args.datasets:
            for row in args.rows.split(","):
                name = row.replace("run", "run ").strip() if row.startswith("run") else row if row == "bytes" else f"degree {row}"
                if (dataset.name, name, seed) in done:
                    continue
                run = measure(args, dataset, row, seed)
                run = {"name": name, "dataset": dataset.name, "seed": seed, **settings, **run}
                done[dataset.name, name, seed] = run
                with args.output.open("a") as file:
                    file.write(json.dumps(run) + "\n")
                print(run, file=sys.stderr)
    table(list(done.values()))


def measure(args, dataset, row, seed):
    """Trains and evaluates one row. Returns its record without a name."""
    photos = [str(dataset), "--max-size", str(args.max_size)]
    selection = ["--holdout", args.holdout] if args.holdout else []
    photos += selection
    info = glint(args, "info", str(dataset), *selection, "--json")
    joint = JOINT_STEPS * info["train"]
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        base, scene = f"{folder}/base.ply", f"{folder}/scene.ply"
        degree = int(row[-1]) if row[-1].isdigit() else None
        if row.startswith("run"):
            of_base = int(SHARES[degree] * args.bytes)
            size = train(args, photos, info, base, degree, of_base, args.steps, seed)
            budget = ["--total-bytes", str(args.bytes)] if degree != 0 else ["--bytes", str(args.bytes - size)]
            added = glint(args, "enhance", *photos, "--base", base, "-o", scene, *budget, "--seed", str(seed), "--json")
            more = {key: added[key] for key in ("plain_gaussians", "supplementary_gaussians", "banded_gaussians", "demoted_gaussians")}
            more["phases"] = added["seconds"]
        else:
            train(args, photos, info, scene, degree, args.bytes, args.steps + joint, seed)
            more = {}
        seconds = time.monotonic() - began
        found = glint(args, "eval", scene, *photos, "--json")["augmented"]
        gaussians = glint(args, "info", scene, "--json")["base"]["count"] + more.get("supplementary_gaussians", 0)
        size = pathlib.Path(scene).stat().st_size
    return {"seconds": seconds, "bytes": size, "gaussians": gaussians, "steps": args.steps + joint, **found, **more}


def train(args, photos, info, output, degree, size, steps, seed):
    """Trains a base within `size` bytes and returns the bytes that it may take."""
    options = ["--bytes", str(size)]
    if degree is not None:
        gaussians = size // GAUSSIAN_BYTES[degree]
        size = gaussians * GAUSSIAN_BYTES[degree]
        options = ["--sh-degree", str(degree), "--gaussians", str(gaussians)]
        if (info["points"] or 0) > gaussians // 2:
            options += ["--points", str(max(gaussians // 2, 1))]
    steps = ["--iterations", str(steps), "--seed", str(seed)]
    glint(args, "train", *photos, "-o", output, *options, *steps, "--json")
    return size


def glint(args, *arguments):
    """Runs glint and returns the JSON that it prints."""
    done = subprocess.run([args.glint, "-q", *arguments], stdout=subprocess.PIPE, text=True)
    if done.returncode != 0:
        sys.exit(f"real.py: glint {' '.join(arguments)} failed with {done.returncode}")
    return json.loads(done.stdout) if done.stdout else None


def table(runs):
    """Prints the mean over seeds of each row and dataset."""
    names = sorted({run["name"] for run in runs})
    print("| dataset | " + " | ".join(names) + " |")
    print("|---" * (len(names) + 1) + "|")
    for dataset in sorted({run["dataset"] for run in runs}):
        cells = []
        for name in names:
            same = [run for run in runs if (run["dataset"], run["name"]) == (dataset, name)]
            mean = lambda key: sum(run[key] for run in same) / len(same)  # noqa: E731
            cells.append(f"{mean('psnr'):.2f} / {mean('ssim'):.4f}, {mean('bytes') / 1e6:.2f} MB" if same else "")
        print(f"| {dataset} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
