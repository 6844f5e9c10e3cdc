"""A free disc of the fluid's density in a cell without sides, driven by a body force that changes with time, moves with the fluid: where the fluid's
pressure gradient acts on the disc as the force does on the fluid, both have the velocity that is the force's integral over time, and nothing else.

usage: changing_drive_test.py BUILD
"""

import csv
import math
import pathlib
import subprocess
import sys
import tempfile

build = pathlib.Path(sys.argv[1])
PEAK, RATE, TOLERANCE = 0.1, 2 * math.pi, 0.002
SCENE = f"""
title = "A disc and its fluid are shaken"
dimension = 2
[coupling]
mode = "transient"
scheme = "serial-explicit"
window = 1e-3
end_time = 1.0
[fluid]
size = [0.01, 0.01]
spacing = 3.125e-4
density = 1000.0
viscosity = 0.01
reference_velocity = 0.035
time_step = 1e-3
threads = 1
body_force = ["{PEAK}*sin(2*pi*t)", "0"]
[fluid.sides]
left.type = "periodic"
right.type = "periodic"
bottom.type = "periodic"
top.type = "periodic"
[grains]
density = 1000.0
normal_stiffness = 1e4
restitution = 0.5
periodic = ["x", "y"]
threads = 1
[grains.box]
from = [0.0, 0.0]
to = [0.01, 0.01]
[grains.fluid]
density = 1000.0
acceleration = ["{PEAK}*sin(2*pi*t)", "0"]
[[grains.group]]
positions = [[0.005, 0.005]]
radius = 0.00125
[[watch]]
name = "disc"
participant = "grains"
grain = 0
[[watch]]
name = "water"
participant = "fluid"
point = [0.001, 0.001]
[output]
frames = false
"""


def worst_of(rows):
    """Largest difference of the velocity from the exact one, over the largest velocity."""
    exact = [PEAK / RATE * (1 - math.cos(RATE * float(row["time"]))) for row in rows]
    return max(math.hypot(float(row["velocity_x"]) - velocity, float(row["velocity_y"])) for row, velocity in zip(rows, exact)) / (2 * PEAK / RATE)


failed = False
with tempfile.TemporaryDirectory() as name:
    folder = pathlib.Path(name)
    (folder / "scene.toml").write_text(SCENE)
    for rule in ("partially-saturated", "interpolated"):
        out = folder / rule
        run = subprocess.run([build / "bin" / "coupler", "run", folder / "scene.toml", "--no-report", "--out", out, "--set", f"fluid.grains={rule}"],
                             capture_output=True, text=True, timeout=100)
        if run.returncode != 0:
            sys.exit(f"{rule} ended with {run.returncode}:\n{run.stdout}{run.stderr}")
        disc, water = (list(csv.DictReader((out / "watch" / f"{watch}.csv").read_text().splitlines())) for watch in ("disc", "water"))
        if len(disc) < 1000 or len(water) < 1000:
            sys.exit(f"{rule}: {len(disc)} and {len(water)} rows watched")
        worst = worst_of(disc), worst_of(water)
        print(f"{rule}: disc within {100 * worst[0]:.3f} %, fluid within {100 * worst[1]:.3f} % of the largest velocity")
        failed = failed or max(worst) > TOLERANCE
if failed:
    sys.exit(f"more than {100 * TOLERANCE:g} % from the integral of the force")
