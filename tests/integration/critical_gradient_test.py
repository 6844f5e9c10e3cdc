"""The gradient at which a bed of discs boils, by the way the stress between its grains vanishes (the DEM-LBM thesis, its 5.5): under a quarter, a half and
three quarters of it the load of the floor and the stress in four slices of the bed lie on lines, whose zeros are the critical gradient, without knowing
what each slice bears. Terzaghi: i_c = (rho_s - rho_f)(1 - n) / rho_f, as a pressure the submerged weight of the discs over the width. Within 2 %, for the floor and
for the mean stress of the slices; one slice alone may err by more, where the bed lets more or less water through than elsewhere.

usage: critical_gradient_test.py BUILD SOURCE
"""

import csv
import math
import pathlib
import subprocess
import sys
import tempfile
import tomllib

build, source = (pathlib.Path(argument) for argument in sys.argv[1:3])
TOLERANCE = 0.02
SCENE = source / "configs" / "grains" / "critical-gradient.toml"
STEP = 0.25 * 94.511  # Pa
# The pressure of each stage grows within 20 ms; means over the last 20 ms of each, when the bed has come to rest.
BEGINNINGS, ENDS, LENGTH = (0.0, 0.12, 0.2), (0.12, 0.2, 0.28), 0.02
PRESSURE = "+".join(f"{STEP}*min(1,max(0,(t-{begin})/0.02))" for begin in BEGINNINGS)
SLICES = [f"slice_{number}" for number in range(1, 5)]


def rows_of(file):
    return list(csv.DictReader(line for line in file.read_text().splitlines() if not line.startswith("#")))


def stages(rows, quantity):
    """Means at the end of each stage."""
    means = []
    for end in ENDS:
        values = [float(row[quantity]) for row in rows if end - LENGTH < float(row["time"]) <= end * (1 + 1e-12)]
        means.append(sum(values) / len(values))
    return means


def zero_of_line(loads):
    """The pressure at which the least-squares line through the loads under STEP, 2 STEP and 3 STEP is zero."""
    slope = (loads[2] - loads[0]) / (2 * STEP)
    return 2 * STEP - sum(loads) / 3 / slope


with tempfile.TemporaryDirectory() as name:
    out = pathlib.Path(name) / "run"
    words = [build / "bin" / "coupler", "run", SCENE, "--no-report", "--out", out]
    for setting in ("output.frames=false", f"coupling.end_time={ENDS[-1]}", f'fluid.sides.bottom.pressure="{PRESSURE}"'):
        words += ["--set", setting]
    run = subprocess.run(words, capture_output=True, text=True, timeout=550)
    # 1: the checks of the scene are about half the gradient.
    if run.returncode not in (0, 1):
        sys.exit(f"the run ended with {run.returncode}:\n{run.stdout}{run.stderr}")
    loads = {"floor": stages(rows_of(out / "watch" / "floor.csv"), "force_y")}
    for slice_name in SLICES:
        loads[slice_name] = stages(rows_of(out / "watch" / f"{slice_name}.csv"), "stress_yy")
    radii = [float(row["radius"]) for row in rows_of(out / "grains" / "sample.csv")]

scene = tomllib.loads(SCENE.read_text())
grains = scene["grains"]
lighter = grains["density"] - scene["fluid"]["density"]
terzaghi = lighter * -grains["gravity"][1] * sum(math.pi * r * r for r in radii) / scene["fluid"]["size"][0]

loads["all slices"] = [sum(values) / len(SLICES) for values in zip(*(loads[slice_name] for slice_name in SLICES))]
failed = False
for what, values in loads.items():
    ratio = zero_of_line(values) / terzaghi
    judged = what not in SLICES
    failed = failed or (judged and not abs(ratio - 1) <= TOLERANCE)
    print(f"{what}: loads {', '.join(f'{value:.5g}' for value in values)}; zero at {ratio:.4f} of Terzaghi's {terzaghi:.3f} Pa")
if failed:
    sys.exit("the stress does not vanish at Terzaghi's gradient")
