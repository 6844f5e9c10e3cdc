"""A fluid in one process strikes a shell in another: the same bits with any number of threads on either side.

usage: seam_test.py BUILD SOURCE
"""

import csv
import pathlib
import subprocess
import sys
import tempfile

build, source = (pathlib.Path(argument) for argument in sys.argv[1:3])

# Fine enough that threads share the fluid's loops and the shell's sweeps over its particles, with viscosity in the shell. The
# shell's sums (energy, work) are shared above 4096 particles only: the solid's unit tests see to these.
SETTINGS = [
    "coupling.end_time=1e-4",
    "check.4.tolerance=1",  # the farthest deflection comes later
    "coupling.window=1e-5",
    "fluid.spacing=0.0025",
    "solid.spacing=0.0009",
    "solid.viscosity.linear=0.2",
    "solid.viscosity.shear=0.2",
    "solid.viscosity.bending=0.2",
    "output.frames=false",
]


def watches(folder, threads):
    """The text of what the run watched, by file, and the largest values of the shell's."""
    settings = SETTINGS + [f"fluid.threads={threads[0]}", f"solid.threads={threads[1]}"]
    words = [build / "bin" / "coupler", "run", source / "configs" / "impact" / "column-on-plate-coupled.toml"]
    words += ["--no-report", "--out", folder]
    for setting in settings:
        words += ["--set", setting]
    run = subprocess.run(words, capture_output=True, text=True, timeout=140)
    if run.returncode != 0:
        sys.exit(f"the run with {threads} threads ended with {run.returncode}:\n{run.stdout}{run.stderr}")
    files = {path.name: path.read_text() for path in sorted((folder / "watch").glob("*.csv"))}
    largest = {}
    for row in csv.DictReader(files["plate.csv"].splitlines()):
        for name, value in row.items():
            largest[name] = max(largest.get(name, 0.0), abs(float(value)))
    return files, largest


with tempfile.TemporaryDirectory() as name:
    place = pathlib.Path(name)
    expected, largest = watches(place / "1", (1, 1))
    for quantity in ("reaction_y", "reaction_moment", "viscous_work", "kinetic_energy"):
        if not largest[quantity] > 0:
            sys.exit(f"plate.{quantity} stays zero: nothing is tested")
    seen, _ = watches(place / "2", (3, 2))
    if seen.keys() != expected.keys():
        sys.exit(f"three and two threads watch {list(seen)}, one {list(expected)}")
    for file, text in seen.items():
        if text != expected[file]:
            sys.exit(f"{file} differs between one thread on each side and three and two")
