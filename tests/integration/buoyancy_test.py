"""A disc settles alike whether its weight is reduced by that of the fluid displaced or the fluid's own pressure carries it: in speed and way, the closer
the finer the fluid (the pressure's force errs with the nodes that make up the disc, here by four times its share of the submerged weight).

usage: buoyancy_test.py BUILD SOURCE
"""

import csv
import pathlib
import subprocess
import sys
import tempfile

build, source = (pathlib.Path(argument) for argument in sys.argv[1:3])
BY_PRESSURE = ["fluid.body_force=[0,-9.81]", "fluid.initial.pressure=9810*(0.03-y)", "grains.fluid.buoyancy=pressure"]
START = 0.04


def fall(folder, settings):
    """Fastest fall and way down over 0.3 s."""
    words = [build / "bin" / "coupler", "run", source / "configs" / "grains" / "settling-disc.toml", "--no-report", "--out", folder]
    for setting in ("output.frames=false", "coupling.end_time=0.3", *settings):
        words += ["--set", setting]
    run = subprocess.run(words, capture_output=True, text=True, timeout=250)
    if run.returncode not in (0, 1):   # 1: the scene's checks ask for the end of a longer run
        sys.exit(f"ended with {run.returncode}:\n{run.stdout}{run.stderr}")
    rows = list(csv.DictReader((folder / "watch" / "disc.csv").read_text().splitlines()))
    return max(-float(row["velocity_y"]) for row in rows), START - float(rows[-1]["position_y"])


failed = False
with tempfile.TemporaryDirectory() as name:
    for per_diameter, step, tolerance in ((16, 1e-4, 0.012), (24, 5e-5, 0.006)):
        grid = [f"fluid.spacing={0.0025 / per_diameter:.12g}", f"fluid.time_step={step}", f"coupling.window={step}"]
        reduced = fall(pathlib.Path(name) / f"reduced-{per_diameter}", grid)
        carried = fall(pathlib.Path(name) / f"carried-{per_diameter}", grid + BY_PRESSURE)
        error = [with_pressure / without - 1 for with_pressure, without in zip(carried, reduced)]
        print(f"{per_diameter} spacings: {reduced[0]:.5f} m/s with reduced gravity, by pressure {100 * error[0]:+.2f} %; way {100 * error[1]:+.2f} %")
        failed = failed or not 0.05 < reduced[0] < 0.06 or max(map(abs, error)) > tolerance
if failed:
    sys.exit("the two ways to carry a disc do not agree")
