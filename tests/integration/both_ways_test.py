"""The same impact in one process and in two, fluid and solid apart, with finite elements in a shell's place and the lattice in that of
the fluid's particles: their results agree within 3 %.

usage: both_ways_test.py BUILD SOURCE
"""

import csv
import json
import pathlib
import subprocess
import sys
import tempfile

build, source = (pathlib.Path(argument) for argument in sys.argv[1:3])

# Scenes in configs/impact, the second of each pair in two processes; what is compared, in the words of either (as in a check, or watch.quantity at the end);
# the seconds after which both end, where that is not the scene's; and what else is set in each: a plate is not at its farthest deflection
# by then, a bottom not where its check looks for it, so that these checks are made to hold (and a front in particles of 2 mm is wider than the lattice's).
PLATE, SPEED = ("centre.displacement_y", "centre.displacement_y"), ("centre.velocity_y", "centre.velocity_y")
SWING = [(f"interface.displacement_x.{statistic}",) * 2 for statistic in ("frequency", "mid_range")]
TORN = [("all.broken_links", "plate.broken_links"), ("all.broken_at", "plate.broken_at"), ("all.rupture_energy", "plate.rupture_energy"),
        ("piston.mean_force", "piston.mean_force")]
PAIRS = [
    ("tank-bottom", "tank-bottom-coupled", [PLATE, SPEED], "8.8e-5", [], []),
    ("tank-bottom", "tank-bottom-lattice", [PLATE, SPEED], "7.167169602e-5", ["solid.spacing=0.001", "coupling.window=1.592704356e-6", "check.0.tolerance=1",
     "check.1.tolerance=1"], []),
    ("tank-tear", "tank-tear-coupled", [PLATE, *TORN], None, [], []),
    ("tank-shear", "tank-shear-coupled", [("plug.displacement_y",) * 2, ("plug.velocity_y.mean",) * 2, *TORN], None, [], []),
    ("column-on-plate", "column-on-plate-coupled", [PLATE], "4e-4", ["check.2.tolerance=1"], ["check.4.tolerance=1"]),
    ("column-on-plate-plastic", "column-on-plate-plastic-coupled", [PLATE], "4e-4", ["check.2.tolerance=1"], ["check.4.tolerance=1"]),
    ("column-on-plate-plastic", "column-on-plate-plastic-coupled", [PLATE], "4e-4", ["check.2.tolerance=1"],
     ["check.4.tolerance=1", "solid.solver=plane-elements"]),
    ("column-on-block", "column-on-block-coupled", [("block.momentum_y",) * 2, ("column.momentum_y",) * 2, ("axis.pressure.max",) * 2], None, [], []),
    ("column-on-block", "column-on-block-coupled", [("block.momentum_y",) * 2], None, [], ["solid.solver=plane-elements"]),
    ("acoustic-oscillator", "acoustic-oscillator-coupled", SWING, None, [], []),
    ("acoustic-oscillator", "acoustic-oscillator-lattice", SWING, None, [], []),
    ("tank-closed", "tank-closed-lattice", [("piston.contact_force_y.mean", "piston.force_y.mean")], None, [], []),
]
TOLERANCE = 0.03


def figures_of(scene, folder, end, settings):
    """What the scene's checks found, and what it watched in its last window."""
    words = [build / "bin" / "coupler", "run", source / "configs" / "impact" / f"{scene}.toml", "--no-report"]
    words += ["--out", folder / scene]
    for setting in ([f"coupling.end_time={end}"] if end else []) + ["output.frames=false", *settings]:
        words += ["--set", setting]
    run = subprocess.run(words, capture_output=True, text=True, timeout=140)
    if run.returncode != 0:  # its checks hold at either end, too
        sys.exit(f"{scene} ended with {run.returncode}:\n{run.stdout}{run.stderr}")
    figures = {check["quantity"]: check["value"] for check in json.loads((folder / scene / "summary.json").read_text())["checks"]}
    for watch in (folder / scene / "watch").glob("*.csv"):
        rows = list(csv.DictReader(watch.read_text().splitlines()))
        figures |= {f"{watch.stem}.{name}": float(value) for name, value in rows[-1].items()}
        if "contact_force_y" in rows[0]:
            figures[f"{watch.stem}.mean_force"] = sum(float(row["contact_force_y"]) for row in rows) / len(rows)
        if "broken_links" in rows[0]:  # when the last of them broke
            figures[f"{watch.stem}.broken_at"] = next(float(row["time"]) for row in rows if row["broken_links"] == rows[-1]["broken_links"])
    return figures


with tempfile.TemporaryDirectory() as name:
    known = {}
    for one, two, quantities, end, first, second in PAIRS:
        if (one, *first) not in known:
            known[one, *first] = figures_of(one, pathlib.Path(name), end, first)
        alone, coupled = known[one, *first], figures_of(two, pathlib.Path(name), end, second)
        for here, there in quantities:
            if not abs(alone[here]) > 1e-5:
                sys.exit(f"{one}: {here} stays zero: nothing is tested")
            error = coupled[there] / alone[here] - 1
            print(f"{two} {' '.join(second[1:])}: {there} {100 * error:+.2f} % of one process")
            if abs(error) > TOLERANCE:
                sys.exit(f"{here} is {alone[here]:g} in {one}, {there} is {coupled[there]:g} in {two}")
