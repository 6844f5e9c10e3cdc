#!/usr/bin/env python3
"""Which schemes converge, which say honestly that they do not, and whether any lies.

Runs configs/fsi/added-mass-string.toml over density ratio, stiffness and window with every scheme and compares each
run's exit status with its distance from the exact answer of the coupling. Writes stability_map.csv and, with gnuplot,
stability_map.png beside this file.

  stability_map.py COUPLER     (build/bin/coupler)
"""
import csv, itertools, json, pathlib, subprocess, sys, tempfile, time

here = pathlib.Path(__file__).resolve().parent
scene = here.parents[1] / "configs/fsi/added-mass-string.toml"
density_ratios = [1000, 100, 10, 1, 0.2, 0.05]
stiffnesses = [1e-2, 1e0, 1e2, 1e4, 1e6]
windows = [1e-3, 1e-2, 1e-1, 1e0]
schemes = [("serial-explicit", "none"), ("serial-implicit", "none"), ("serial-implicit", "constant"),
           ("serial-implicit", "aitken"), ("serial-implicit", "iqn-ils"), ("serial-implicit", "iqn-imvj"),
           ("parallel-implicit", "iqn-ils"), ("parallel-implicit", "iqn-imvj")]
count = 10          # windows of a run
wrong = 1e-2        # relative distance from the exact answer that no run of tolerance 1e-6 may have
thickness, largest_added_mass = 0.1, 0.347


def run(coupler, scheme, acceleration, ratio, stiffness, window, folder):
    # About 0.01 of displacement whatever the stiffness and the window.
    load = 0.01 * (stiffness + (thickness * ratio + largest_added_mass) / (count * window) ** 2)
    settings = {"coupling.scheme": scheme, "coupling.acceleration": acceleration, "coupling.window": window,
                "coupling.end_time": count * window, "coupling.tolerance": 1e-6, "solid.density": ratio,
                "solid.stiffness": stiffness, "solid.load": load, "coupling.relaxation": 0.5}
    words = [coupler, "run", str(scene), "--out", folder]
    for key, value in settings.items():
        words += ["--set", f"{key}={value!r}" if not isinstance(value, str) else f'{key}="{value}"']
    finished = subprocess.run(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, timeout=300)
    with open(pathlib.Path(folder) / "summary.json") as file:
        summary = json.load(file)
    watch = summary["watch"].get("string", {})
    largest = watch.get("coupling_error", {}).get("max")
    return finished.returncode, summary["iterations"]["mean"], summary["windows"], largest


def verdict(scheme, status, error):
    # Statuses 0 and 1 (a check of the scene failed) both say that the run was carried to its end.
    if status not in (0, 1):
        return "said no"
    if error is not None and error < wrong:
        return "right"
    # An explicit run claims no agreement, its windows are marked `explicit`: it errs by its splitting, but a solution
    # that is off by more than its own size has blown up.
    if scheme.endswith("explicit") and error is not None and error < 1:
        return "rough"
    return "LIE"


def main():
    coupler = sys.argv[1]
    begin = time.time()
    with open(here / "stability_map.csv", "w", newline="") as file, tempfile.TemporaryDirectory() as folder:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["scheme", "acceleration", "density_ratio", "stiffness", "window", "exit_status",
                        "iterations_per_window", "windows", "largest_error", "verdict"])
        for (scheme, acceleration), window, stiffness, ratio in itertools.product(schemes, windows, stiffnesses,
                                                                                  density_ratios):
            status, mean, done, error = run(coupler, scheme, acceleration, ratio, stiffness, window, folder)
            table.writerow([scheme, acceleration, ratio, stiffness, window, status, f"{mean:.3g}", done,
                            "" if error is None else f"{error:.3e}", verdict(scheme, status, error)])
            file.flush()
    draw()
    print(f"{time.time() - begin:.0f} s")


def draw():
    with open(here / "stability_map.csv") as file:
        rows = list(csv.DictReader(file))
    script = ['set terminal pngcairo size 1100,1500 font "sans,9"', f'set output "{here / "stability_map.png"}"',
              'set multiplot layout 8,4 title "string above a fluid: iterations per window; red: explicit, off by more than 1 %; '
              'grey: said that it has no solution; black: a lie" font ",12"',
              'set palette defined (0 "#1a9850", 4 "#a6d96a", 10 "#fee08b", 30 "#f46d43", 50 "#d73027", '
              '51 "#bbbbbb", 60 "#bbbbbb", 61 "black", 70 "black")', 'set cbrange [0:70]', 'unset colorbox',
              'set tics scale 0', 'unset key']
    for (scheme, acceleration), window in itertools.product(schemes, windows):
        script += [f'set title "{scheme} {acceleration}, window {window:g}" offset 0,-0.8',
                   "set xtics (" + ",".join(f'"{r:g}" {k}' for k, r in enumerate(density_ratios)) + ")",
                   "set ytics (" + ",".join(f'"{s:.0e}" {k}' for k, s in enumerate(stiffnesses)) + ")",
                   f'set xrange [-0.5:{len(density_ratios) - 0.5}]', f'set yrange [-0.5:{len(stiffnesses) - 0.5}]',
                   'set xlabel "density ratio" offset 0,0.7' if scheme.startswith("parallel") and acceleration == "iqn-imvj" else 'unset xlabel',
                   "$cells << EOD"]
        for row in rows:
            if row["scheme"] == scheme and row["acceleration"] == acceleration and float(row["window"]) == window:
                value = {"rough": 35, "said no": 55, "LIE": 65}.get(row["verdict"], min(49, float(row["iterations_per_window"])))
                x = density_ratios.index(float(row["density_ratio"]))
                y = stiffnesses.index(float(row["stiffness"]))
                script.append(f"{x} {y} {value}")
        script += ["EOD", "plot $cells using 1:2:3 with image"]
    script.append("unset multiplot")
    subprocess.run(["gnuplot"], input="\n".join(script), text=True, check=True)


if __name__ == "__main__":
    main()
