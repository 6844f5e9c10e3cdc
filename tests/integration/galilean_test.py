"""A sphere that moves through resting fluid, and the same one at rest in fluid and plates that move the other way, feel the same mean force (the
DEM-LBM thesis, its 5.7): within 2 %, and the moving one sways by the nodes that it covers and leaves.

usage: galilean_test.py BUILD SOURCE
"""

import csv
import math
import pathlib
import subprocess
import sys
import tempfile

build, source = (pathlib.Path(argument) for argument in sys.argv[1:3])
FROM, TOLERANCE = 500.0, 0.02
HELD = ["grains.group.0.velocity=[0,0,0]", *(f"fluid.{where}.velocity=[-0.02,0,0]" for where in ("initial", "sides.back", "sides.front"))]


def force_of(name, folder, settings):
    """Mean of the force along x from FROM on, and its standard deviation over the mean."""
    words = [build / "bin" / "coupler", "run", source / "configs" / "grains" / "moving-grain-galilean.toml", "--no-report", "--out", folder / name]
    for setting in ("output.frames=false", *settings):
        words += ["--set", setting]
    run = subprocess.run(words, capture_output=True, text=True, timeout=280)
    if run.returncode != 0:
        sys.exit(f"{name} ended with {run.returncode}:\n{run.stdout}{run.stderr}")
    rows = csv.DictReader((folder / name / "watch" / "sphere.csv").read_text().splitlines())
    force = [float(row["fluid_force_x"]) for row in rows if float(row["time"]) >= FROM]
    mean = sum(force) / len(force)
    return mean, math.sqrt(sum((value / mean - 1) ** 2 for value in force) / len(force))


with tempfile.TemporaryDirectory() as name:
    moving, sways = force_of("moving", pathlib.Path(name), [])
    held, sways_held = force_of("held", pathlib.Path(name), HELD)
print(f"moving {moving:g} N, sways by {100 * sways:.2f} %; held {held:g} N, {100 * sways_held:.2f} %; {100 * (moving / held - 1):+.2f} %")
if not moving < -0.02 or abs(moving / held - 1) > TOLERANCE:
    sys.exit("the two frames do not agree")
