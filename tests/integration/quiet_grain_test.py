"""A free disc about as heavy as the fluid, pushed once, comes to rest in a small closed cell though next to nothing damps the sound there (relaxation
time 0.515): what the exchange delays does not feed it. With the plain exchange of forces of the window before it grows: the test would see that.

usage: quiet_grain_test.py BUILD
"""

import csv
import pathlib
import subprocess
import sys
import tempfile

build = pathlib.Path(sys.argv[1])
SCENE = """
title = "A disc comes to rest"
dimension = 2
[coupling]
mode = "transient"
scheme = "serial-explicit"
window = 5e-5
end_time = 0.1
[fluid]
size = [0.01, 0.01]
spacing = 3.125e-4
density = 1000.0
viscosity = 0.01
reference_velocity = 0.05
time_step = 5e-5
threads = 1
[fluid.sides]
left.type = "{side}"
right.type = "{side}"
bottom.type = "{side}"
top.type = "{side}"
[grains]
density = {density}
normal_stiffness = 1e4
restitution = 0.5
threads = 1
{sides}
[grains.box]
from = [0.0, 0.0]
to = [0.01, 0.01]
[grains.fluid]
density = 1000.0
{more}
[[grains.group]]
positions = [[0.005, 0.005]]
radius = 0.00125
velocity = [1e-4, 0.0]
[[watch]]
name = "disc"
participant = "grains"
grain = 0
[output]
frames = false
"""
SIDES = {"wall": 'walls = ["left", "right", "bottom", "top"]', "periodic": 'periodic = ["x", "y"]'}


def growth(folder, side, rule, density, more=""):
    """Largest change of the velocity in one window in the last quarter of the time, over that in the second."""
    (folder / "scene.toml").write_text(SCENE.format(side=side, sides=SIDES[side], density=density, more=more))
    run = subprocess.run([build / "bin" / "coupler", "run", folder / "scene.toml", "--no-report", "--out", folder / "out", "--set", f"fluid.grains={rule}"],
                         capture_output=True, text=True, timeout=100)
    rows = list(csv.DictReader((folder / "out" / "watch" / "disc.csv").open())) if run.returncode == 0 else []
    velocity = [float(row["velocity_x"]) for row in rows]
    change = [abs(after - before) for before, after in zip(velocity, velocity[1:])]
    quarter = len(change) // 4
    return max(change[3 * quarter:]) / max(change[quarter:2 * quarter]) if quarter else float("inf")


failed = False
with tempfile.TemporaryDirectory() as name:
    folder = pathlib.Path(name)
    for side in ("wall", "periodic"):
        for rule, densities in (("partially-saturated", (1000, 1250)), ("interpolated", (500, 1000, 1250))):
            for density in densities:
                found = growth(folder, side, rule, density)
                print(f"{side}, {rule}, {density} kg/m3: {found:.3f}")
                failed = failed or not found < 1
    plain = growth(folder, "periodic", "interpolated", 1000, "lead = 0\nvirtual_mass = 1")
    print(f"without carrying forces on: {plain:.3f}")
    failed = failed or not plain > 1
if failed:
    sys.exit("a disc without any drive does not come to rest (or what should grow does not)")
