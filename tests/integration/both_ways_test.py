"""The same impact in one process and in two, fluid and shell apart, and with finite elements in the shell's place: their results agree within 3 %.

usage: both_ways_test.py BUILD SOURCE
"""

import csv
import pathlib
import subprocess
import sys
import tempfile

build, source = (pathlib.Path(argument) for argument in sys.argv[1:3])

# Scenes in configs/impact, the second of each pair in two processes, with what is compared of both at the end of so many seconds, and what is set in each:
# a plate is not at its farthest deflection by then, so that this one check is made to hold.
PAIRS = [
    ("tank-bottom", "tank-bottom-coupled", ("displacement_y", "velocity_y"), "8.8e-5", [], []),
    ("column-on-plate", "column-on-plate-coupled", ("displacement_y",), "4e-4", ["check.2.tolerance=1"], ["check.4.tolerance=1"]),
    ("column-on-plate-plastic", "column-on-plate-plastic-coupled", ("displacement_y",), "4e-4", ["check.2.tolerance=1"], ["check.4.tolerance=1"]),
    ("column-on-plate-plastic", "column-on-plate-plastic-coupled", ("displacement_y",), "4e-4", ["check.2.tolerance=1"],
     ["check.4.tolerance=1", "solid.solver=plane-elements"]),
]
TOLERANCE = 0.03


def last_of(scene, folder, end, settings):
    """What the scene watched of its shell's centre in its last window."""
    words = [build / "bin" / "coupler", "run", source / "configs" / "impact" / f"{scene}.toml", "--no-report"]
    words += ["--out", folder / scene]
    for setting in (f"coupling.end_time={end}", "output.frames=false", *settings):
        words += ["--set", setting]
    run = subprocess.run(words, capture_output=True, text=True, timeout=140)
    if run.returncode != 0:  # its checks hold at either end, too
        sys.exit(f"{scene} ended with {run.returncode}:\n{run.stdout}{run.stderr}")
    rows = list(csv.DictReader((folder / scene / "watch" / "centre.csv").read_text().splitlines()))
    return {name: float(value) for name, value in rows[-1].items()}


with tempfile.TemporaryDirectory() as name:
    known = {}
    for one, two, quantities, end, first, second in PAIRS:
        if one not in known:
            known[one] = last_of(one, pathlib.Path(name), end, first)
        alone, coupled = known[one], last_of(two, pathlib.Path(name), end, second)
        for quantity in quantities:
            if not abs(alone[quantity]) > 1e-4:
                sys.exit(f"{one}: {quantity} stays zero: nothing is tested")
            error = coupled[quantity] / alone[quantity] - 1
            print(f"{two} {' '.join(second[1:])}: {quantity} {100 * error:+.2f} % of one process")
            if abs(error) > TOLERANCE:
                sys.exit(f"{quantity} is {alone[quantity]:g} in {one}, {coupled[quantity]:g} in {two}")
