#!/usr/bin/env python3
"""Error against work of schemes and accelerations: which costs least for a given accuracy.

Runs configs/fsi/added-mass-string.toml (a fluid of 17 times the string's mass) with windows of four lengths and
compares the motion at the end with the exact one in continuous time. Work is counted in steps of both solvers,
repeated windows included, so that it does not depend on the machine; the time of the whole run is given beside it.
Writes error_against_work.csv and .png beside this file.

  error_against_work.py COUPLER     (build/bin/coupler)
"""
import csv, itertools, json, pathlib, subprocess, sys, tempfile

here = pathlib.Path(__file__).resolve().parent
scene = here.parents[1] / "configs/fsi/added-mass-string.toml"
windows = [0.04, 0.02, 0.01, 0.005]
schemes = [("serial-explicit", "none"), ("serial-implicit", "none"), ("serial-implicit", "constant"),
           ("serial-implicit", "aitken"), ("serial-implicit", "iqn-ils"), ("serial-implicit", "iqn-imvj"),
           ("parallel-implicit", "iqn-ils"), ("parallel-implicit", "iqn-imvj")]


def main():
    with open(here / "error_against_work.csv", "w", newline="") as file, tempfile.TemporaryDirectory() as folder:
        table = csv.writer(file)
        table.writerow(["scheme", "acceleration", "window", "exit_status", "iterations_per_window", "solver_steps",
                        "wall_s", "error"])
        for (scheme, acceleration), window in itertools.product(schemes, windows):
            words = [sys.argv[1], "run", str(scene), "--out", folder]
            for setting in (f'coupling.scheme="{scheme}"', f'coupling.acceleration="{acceleration}"',
                            f"coupling.window={window}"):
                words += ["--set", setting]
            status = subprocess.run(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode
            with open(pathlib.Path(folder) / "summary.json") as answer:
                summary = json.load(answer)
            carried = status in (0, 1)
            error = summary["watch"]["string"]["time_error"]["last"] if carried else None
            steps = sum(participant["steps"] for participant in summary["participants"].values())
            table.writerow([scheme, acceleration, window, status, f'{summary["iterations"]["mean"]:.3g}', steps,
                            f'{summary["wall_s"]:.2f}', "" if error is None else f"{error:.3e}"])
            file.flush()
    draw()


def draw():
    with open(here / "error_against_work.csv") as file:
        rows = list(csv.DictReader(file))
    script = ['set terminal pngcairo size 800,550 font "sans,10"',
              f'set output "{here / "error_against_work.png"}"', "set logscale xy", 'set xlabel "steps of both solvers"',
              'set ylabel "relative error of the motion at t = 1"', "set grid", "set key outside right"]
    curves = []
    for number, (scheme, acceleration) in enumerate(schemes):
        points = [f'{row["solver_steps"]} {row["error"]}' for row in rows
                  if row["scheme"] == scheme and row["acceleration"] == acceleration and row["error"]]
        if points:
            script += [f"$curve{number} << EOD", *points, "EOD"]
            curves.append(f'$curve{number} with linespoints linewidth 2 title "{scheme} {acceleration}"')
    script.append("plot " + ", ".join(curves))
    subprocess.run(["gnuplot"], input="\n".join(script), text=True, check=True)


if __name__ == "__main__":
    main()
