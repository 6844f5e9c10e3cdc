"""The same impact in one process and in two, fluid and shell apart: their results agree within 3 %.

usage: both_ways_test.py BUILD SOURCE
"""

import csv
import pathlib
import subprocess
import sys
import tempfile

build, source = (pathlib.Path(argument) for argument in sys.argv[1:3])

# Scenes in configs/impact, the second of each pair in two processes, with what is compared of both at its end and when that is.
PAIRS = [
    ("tank-bottom", "tank-bottom-coupled", ("displacement_y", "velocity_y"), "8.8e-5"),
    ("column-on-plate", "column-on-plate-coupled", ("displacement_y",), "4e-4"),
]
TOLERANCE = 0.03


def last_of(scene, folder, end):
    """What the scene watched of its shell's centre in its last window."""
    words = [build / "bin" / "coupler", "run", source / "configs" / "impact" / f"{scene}.toml", "--no-report"]
    words += ["--out", folder / scene, "--set", f"coupling.end_time={end}", "--set", "output.frames=false"]
    run = subprocess.run(words, capture_output=True, text=True, timeout=140)
    if run.returncode != 0:  # its checks hold at either end, too
        sys.exit(f"{scene} ended with {run.returncode}:\n{run.stdout}{run.stderr}")
    rows = list(csv.DictReader((folder / scene / "watch" / "centre.csv").read_text().splitlines()))
    return {name: float(value) for name, value in rows[-1].items()}


with tempfile.TemporaryDirectory() as name:
    for one, two, quantities, end in PAIRS:
        alone, coupled = last_of(one, pathlib.Path(name), end), last_of(two, pathlib.Path(name), end)
        for quantity in quantities:
            if not abs(alone[quantity]) > 1e-4:
                sys.exit(f"{one}: {quantity} stays zero: nothing is tested")
            error = coupled[quantity] / alone[quantity] - 1
            print(f"{two}: {quantity} {100 * error:+.2f} % of one process")
            if abs(error) > TOLERANCE:
                sys.exit(f"{quantity} is {alone[quantity]:g} in {one}, {coupled[quantity]:g} in {two}")
