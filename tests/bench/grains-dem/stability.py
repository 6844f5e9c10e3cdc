#!/usr/bin/env python3
"""Limits of stability of the grains, dry and in the fluid: one line of CSV per run, with the symptom.

    tests/bench/grains-dem/stability.py --build build --out grains-dem/evidence/stability.csv [--only NAME]

Every case is a ladder from harmless to hopeless, run through `coupler run` as a person would; all steps are run, also beyond
the first failure. A step holds when the run ends, no value is beyond the case's bound and the energy balances. Symptoms: the
program's own message (what diverged, where), or the bound that was passed.
"""
import argparse
import csv
import json
import pathlib
import re
import subprocess
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[3]

DRY = """
title = "stability"
dimension = 2
[coupling]
mode = "transient"
window = {window}
end_time = {end}
[grains]
density = 2500.0
normal_stiffness = {stiffness}
restitution = {restitution}
friction = {friction}
steps_per_contact = {steps}
gravity = [0.0, {gravity}]
walls = ["left", "right", "bottom", "top"]
[grains.box]
from = [0.0, 0.0]
to = [0.2, 0.2]
{groups}
[[watch]]
name = "all"
participant = "grains"
[output]
frames = false
"""

GAS = """
[[grains.group]]
count = 300
from = [0.0, 0.0]
to = [0.2, 0.2]
radius = 0.003
random_velocity = 0.5
"""
OVERLAP = """
[[grains.group]]
lattice = "triangular"
from = [0.07, 0.07]
pitch = 0.003
counts = [20, 20]
radius = 0.003
"""
SIZES = """
[[grains.group]]
count = 6
from = [0.0, 0.0]
to = [0.2, 0.1]
radius = 0.012
[[grains.group]]
count = {count}
from = [0.0, 0.1]
to = [0.2, 0.2]
radius = {small}
"""
BED = """
title = "dense bed"
dimension = 2
[coupling]
mode = "transient"
scheme = "serial-explicit"
window = {step}
end_time = {end}
[fluid]
size = [0.0048, 0.0072]
spacing = 4e-5
density = 1000.0
viscosity = 1e-3
reference_velocity = 0.05
time_step = {step}
[fluid.sides.left]
type = "periodic"
[fluid.sides.right]
type = "periodic"
[fluid.sides.bottom]
type = "wall"
[fluid.sides.top]
type = "wall"
[grains]
density = {density}
normal_stiffness = 1e4
restitution = 0.3
friction = 0.3
contact_margin = 2e-5
gravity = [0.0, -9.81]
periodic = ["x"]
walls = ["bottom"]
[grains.box]
from = [0.0, 0.0]
to = [0.0048, 0.0072]
[grains.fluid]
density = 1000.0
[[grains.group]]
count = 50
from = [0.0, 0.0]
to = [0.0048, 0.0068]
radius = 0.00025
[[watch]]
name = "all"
participant = "grains"
[output]
frames = false
"""


def dry(**changes):
    values = dict(window=0.01, end=0.1, stiffness=1e5, restitution=0.8, friction=0.3, steps=20, gravity=0, groups=GAS)
    values.update(changes)
    return DRY.format(**values)


def cases():
    """(case, value, scene text or file, --set options, bound on energy_error, bound on the largest speed)."""
    for steps in (50, 20, 10, 5, 4, 3, 2, 1.5, 1):
        yield ("steps per contact, 300 elastic discs", steps, dry(steps=steps, restitution=1, friction=0), [], 0.02, None)
    for stiffness in (1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9):
        end = 0.1 if stiffness < 1e8 else 0.01
        yield ("stiffness [N/m], 300 discs", stiffness, dry(stiffness=stiffness, end=end, window=end / 10,
                                                             groups=GAS.replace("0.5", "0.1")), [], 0.02, None)
    for steps in (50, 20, 10, 5, 4, 3, 2):
        yield ("half a diameter of overlap, 400 discs, steps per contact", steps,
               dry(steps=steps, groups=OVERLAP, end=0.02, window=0.002), [], 0.05, None)
    for ratio, count in ((2, 60), (5, 300), (10, 600), (20, 600)):
        yield ("sizes 1:N under gravity", ratio, dry(groups=SIZES.format(small=0.012 / ratio, count=count),
                                                     gravity=-9.81), [], 0.02, None)
    disc = ROOT / "configs/grains/settling-disc.toml"
    coarse = ["fluid.spacing=3.125e-4", "fluid.time_step=2e-4", "coupling.window=2e-4", "coupling.end_time=0.12"]
    for mass in ("default", "0"):
        for density in (10, 50, 100, 500, 900, 1010, 1250, 2000, 10000):
            extra = [] if mass == "default" else ["grains.fluid.virtual_mass=0"]
            yield (f"density of a disc in water [kg/m3], virtual mass {mass}", density, disc,
                   coarse + [f"grains.density={density}"] + extra, None, 0.5)
    for tau in (0.6, 0.53, 0.51, 0.505, 0.502, 0.501):
        step = float(f"{(tau - 0.5) / 3 * 4e-5 ** 2 / 1e-6:.6g}")
        for density in (2600, 1100):
            yield (f"dense bed of {density} kg/m3, relaxation time", tau,
                   BED.format(step=step, end=3000 * step, density=density), [], None, 0.1)


def run(build, scene, options, folder):
    if not isinstance(scene, pathlib.Path):
        file = folder / "scene.toml"
        file.write_text(scene)
        scene = file
    command = [build / "bin" / "coupler", "run", scene, "--out", folder / "out"]
    for option in options:
        command += ["--set", option]
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, timeout=600)
    summary = folder / "out" / "summary.json"
    return done.returncode, done.stdout + done.stderr, json.loads(summary.read_text()) if summary.exists() else {}


def judge(code, text, summary, energy_bound, speed_bound):
    """(holds, energy error, largest speed, symptom)"""
    watches = {k: v for watch in summary.get("watch", {}).values() for k, v in watch.items()}
    energy = watches.get("energy_error", {}).get("last")
    speeds = [watches[k].get("max") for k in ("maximum_speed", "speed") if k in watches]
    speed = max((s for s in speeds if s is not None), default=None)
    if code not in (0, 1):
        lines = [line.partition("field ")[2] or line for line in text.splitlines() if re.match("coupler: ", line)]
        return False, energy, speed, (lines or text.splitlines()[-1:] or ["no message"])[0].strip()[:160]
    if energy_bound is not None and (energy is None or not abs(energy) <= energy_bound):
        return False, energy, speed, f"the energy does not balance: {energy:+.1%} of the largest entry"
    if speed_bound is not None and (speed is None or not speed <= speed_bound):
        return False, energy, speed, f"faster than {speed_bound} m/s"
    return True, energy, speed, ""


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build")
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--only", default="", help="cases whose name contains this")
    arguments = parser.parse_args()
    rows = []
    for name, value, scene, options, energy_bound, speed_bound in cases():
        if arguments.only not in name:
            continue
        with tempfile.TemporaryDirectory() as folder:
            code, text, summary = run(arguments.build.resolve(), scene, options, pathlib.Path(folder))
            holds, energy, speed, symptom = judge(code, text, summary, energy_bound, speed_bound)
        rows.append([name, value, "holds" if holds else "fails", "" if energy is None else f"{energy:.3g}",
                     "" if speed is None else f"{speed:.4g}", symptom])
        print(*rows[-1], sep=", ", flush=True)
    with arguments.out.open("w", newline="") as file:
        csv.writer(file).writerows([["case", "value", "result", "energy_error", "largest_speed", "symptom"], *rows])


if __name__ == "__main__":
    main()
