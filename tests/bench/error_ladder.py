#!/usr/bin/env python3
"""Error against run time of one scene over a grid of settings.

Runs `coupler run SCENE --set ...` for every combination of the alternatives of all --vary options, reads each
summary.json, and writes a CSV, a table of the cheapest settings in Markdown, and (with gnuplot) a picture.

    tests/bench/error_ladder.py configs/fluid/cavity.toml \\
        --vary 'fluid.spacing = 0.03125 | 0.015625 | 0.0078125' \\
        --vary 'TRT: fluid.collision = trt | BGK: fluid.collision = bgk' \\
        --repeats 3 --threads 1 --out evidence/cavity

An alternative is a list of assignments separated by ';', with an optional label before ':'. A bare value stands for
the key of the alternative before it. The first --vary is the ladder, from coarse to fine: its steps are joined in the picture,
one line for each combination of the others. A step counts as reaching an error when all finer ones do too: errors
change their sign somewhere, and look small there.

The error of a run is the largest relative error of its quantities against their references: those of the scene's
[[check]]s that have a reference, or those given by --quantity NAME[=REFERENCE]. A reference of 0 makes an error
absolute, as for a watch that is an error already. References that only hold for the scene's own settings have to be
given anew when --vary changes the case.

Times: wall is that of the whole run as the coupler reports it; processor adds up what all processes used, and is the
one to compare where other programs share the machine (use --threads 1: threads that wait also use it). Repeats go
round all combinations in turn, the median counts.
"""
import argparse
import csv
import itertools
import json
import os
import pathlib
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
FIELDS = ["run", "label", "step", "status", "error", "values", "wall_s", "wall_min_s", "wall_max_s",
          "processor_s", "updates", "iterations", "work", "repeats", "load"]


def alternatives(text):
    """[(label, [assignment, ...]), ...] of one --vary option."""
    result = []
    key = None
    for part in text.split("|"):
        part = part.strip()
        label = ""
        head, colon, tail = part.partition(":")
        if colon and "=" not in head and '"' not in head and "[" not in head:
            label, part = head.strip(), tail.strip()
        assignments = []
        for assignment in (a.strip() for a in part.split(";")):
            if not assignment:
                continue
            if "=" not in assignment:
                if key is None:
                    sys.exit(f"--vary '{text}': '{assignment}' has no key")
                assignment = f"{key}={assignment}"
            key, value = (s.strip() for s in assignment.split("=", 1))
            assignments.append(f"{key}={value}")
        result.append((label or ", ".join(a.split("=", 1)[1] for a in assignments), assignments))
    return result


def look_up(summary, name):
    """Value of watch.quantity[.last|.min|.max|.mean|...]."""
    parts = name.split(".")
    at = summary["watch"]
    for part in parts if len(parts) > 2 else parts + ["last"]:
        at = at[part]
    return at


def errors_of(summary, wanted):
    """{quantity: (value, error)} of one run."""
    found = {}
    if wanted:
        for name, reference in wanted:
            value = look_up(summary, name)
            if reference is None:
                reference = next(c["reference"] for c in summary["checks"] if c["quantity"] == name)
            found[name] = (value, abs(value - reference) / (abs(reference) or 1.0))
    else:
        for check in summary["checks"]:
            if check.get("reference") is not None:
                reference = check["reference"]
                found[check["quantity"]] = (check["value"],
                                            abs(check["value"] - reference) / (abs(reference) or 1.0))
    if not found:
        sys.exit("the scene has no check with a reference: give --quantity NAME=REFERENCE")
    return found


def run_once(options, settings, wanted):
    """(status, error, values, wall seconds, processor seconds, updates, iterations per window, work)"""
    with tempfile.TemporaryDirectory(prefix="ladder-") as folder:
        command = [options.coupler, "run", options.scene, "--out", folder + "/run"]
        for assignment in settings:
            command += ["--set", assignment]
        environment = dict(os.environ, OMP_NUM_THREADS=str(options.threads))
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=options.time_limit,
                                  env=environment, check=False)
        except subprocess.TimeoutExpired:
            return "time limit", None, {}, options.time_limit, options.time_limit, 0, "", ""
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        if done.returncode == 2:
            sys.exit(f"{' '.join(command)}\n{done.stdout}{done.stderr}")
        path = pathlib.Path(folder, "run", "summary.json")
        summary = json.loads(path.read_text()) if path.exists() else {}
        wall = summary.get("wall_s", 0.0)
        iterations = summary.get("iterations", {}).get("mean", "")
        participants = summary.get("participants", {})
        work = "; ".join(f"{name}: {p.get('steps', 0)} steps, {p.get('compute_s', 0):.3g} s"
                         for name, p in participants.items())
        if done.returncode not in (0, 1):
            return (summary.get("status", f"exit {done.returncode}"), None, {}, wall, processor, 0, iterations,
                    work)
        found = errors_of(summary, wanted)
        updates = sum(p.get("updates", 0) for p in participants.values())
        return ("done", max(error for _, error in found.values()),
                {name: value for name, (value, _) in found.items()}, wall, processor, updates, iterations, work)


def write_csv(path, rows):
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, FIELDS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def read_csv(path):
    if not path.exists():
        return {}
    with open(path, newline="", encoding="utf-8") as file:
        return {row["run"]: row for row in csv.DictReader(file)}


def settled(row, good, limit):
    """Whether the error is below the limit and stays there on the further steps of the same ladder."""
    line = [r for r in good if r["label"] == row["label"]]
    return all(float(r["error"]) <= limit for r in line[line.index(row):])


def cheapest(rows, limits, clock):
    """Markdown: for each limit the setting that reaches it, for good, in the shortest time."""
    lines = ["| error below | setting | step | error | seconds |", "|---|---|---|---|---|"]
    good = [r for r in rows if r["status"] == "done"]
    for limit in limits:
        reached = [r for r in good if settled(r, good, limit)]
        if not reached:
            best = min(good, key=lambda r: float(r["error"]), default=None)
            note = f"best: {100 * float(best['error']):.2g} %, {best['label']}, {best['step']}" if best else ""
            lines.append(f"| {100 * limit:g} % | not reached; {note} | | | |")
            continue
        row = min(reached, key=lambda r: float(r[clock]))
        lines.append(f"| {100 * limit:g} % | {row['label'] or 'as in the scene'} | {row['step']} | "
                     f"{100 * float(row['error']):.2g} % | {float(row[clock]):.2g} |")
    return "\n".join(lines)


def plot(path, rows, clock, title):
    if shutil.which("gnuplot") is None:
        print("no gnuplot: no picture", file=sys.stderr)
        return
    lines = {}
    for row in rows:
        if row["status"] == "done":
            lines.setdefault(row["label"] or "as in the scene", []).append(
                (float(row[clock]), 100 * max(float(row["error"]), 1e-12)))
    if not lines:
        return
    script = ["set terminal pngcairo size 900,600 noenhanced", f"set output '{path}'", "set logscale xy",
              f"set xlabel '{clock.removesuffix('_s')} time [s]'", "set ylabel 'error [%]'",
              "set title '" + title.replace("'", "") + "'", "set grid", "set key outside right"]
    for n, points in enumerate(lines.values()):
        script.append(f"$line{n} << END\n" + "\n".join(f"{x} {y}" for x, y in points) + "\nEND")
    script.append("plot " + ", ".join(
        f"$line{n} using 1:2 with linespoints pointtype {n % 15 + 1} title '{name}'"
        for n, name in enumerate(lines)))
    subprocess.run(["gnuplot"], input="\n".join(script), text=True, check=True)


def table_rows(cases, known):
    """Rows of the CSV: medians of what has been run, or what is known from before."""
    rows = []
    for case in cases:
        runs = case["runs"]
        if case["name"] in known:
            rows.append(known[case["name"]])
        elif runs:
            walls = [r[3] for r in runs]
            rows.append({"run": case["name"], "label": case["label"], "step": case["step"], "status": runs[0][0],
                         "error": "" if runs[0][1] is None else f"{runs[0][1]:.6g}",
                         "values": " ".join(f"{name}={value:.8g}" for name, value in runs[0][2].items()),
                         "wall_s": f"{statistics.median(walls):.4g}", "wall_min_s": f"{min(walls):.4g}",
                         "wall_max_s": f"{max(walls):.4g}",
                         "processor_s": f"{statistics.median(r[4] for r in runs):.4g}",
                         "updates": f"{runs[0][5]:.6g}", "iterations": runs[0][6], "work": runs[0][7],
                         "repeats": len(runs),
                         "load": f"{os.getloadavg()[0]:.1f}"})
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("--vary", action="append", default=[], metavar="ALTERNATIVES", required=True)
    parser.add_argument("--set", action="append", default=[], dest="fixed", help="for every run, as of `coupler run`")
    parser.add_argument("--quantity", action="append", default=[], metavar="NAME[=REFERENCE]")
    parser.add_argument("--repeats", type=int, default=1)
    parser.add_argument("--threads", type=int, default=1, help="per participant (default 1)")
    parser.add_argument("--clock", choices=["wall", "processor"], default="processor",
                        help="of the table and the picture")
    parser.add_argument("--limits", default="0.05,0.01,0.003", help="errors of the table")
    parser.add_argument("--time-limit", type=float, default=600, help="of one run [s]")
    parser.add_argument("--resume", action="store_true", help="keep the runs that the CSV has already")
    parser.add_argument("--coupler", default=str(ROOT / "build" / "bin" / "coupler"))
    parser.add_argument("--out", required=True, help="path of the results without ending: .csv, .png, .md are added")
    options = parser.parse_args()

    wanted = []
    for text in options.quantity:
        name, equals, reference = text.partition("=")
        wanted.append((name.strip(), float(reference) if equals else None))
    cases = []
    for combination in itertools.product(*(alternatives(text) for text in options.vary)):
        cases.append({"step": combination[0][0], "label": ", ".join(label for label, _ in combination[1:]),
                      "settings": options.fixed + [a for _, assignments in combination for a in assignments]})
    # Lines of the picture follow the ladder.
    order = {case["label"]: n for n, case in reversed(list(enumerate(cases)))}
    cases.sort(key=lambda case: order[case["label"]])

    out = pathlib.Path(options.out)
    out.parent.mkdir(parents=True, exist_ok=True)
    target = out.with_name(out.name + ".csv")
    known = read_csv(target) if options.resume else {}
    for case in cases:
        case["name"] = " ".join(case["settings"])
        case["runs"] = []
    for _ in range(options.repeats):
        for case in cases:
            if case["name"] in known:
                continue
            if case["runs"] and case["runs"][0][0] != "done":
                continue  # it will not do better the next time
            case["runs"].append(run_once(options, case["settings"], wanted))
            status, error, values, wall, processor, _, iterations, _ = case["runs"][-1]
            shown = " ".join(f"{name} {value:.6g}" for name, value in values.items())
            print(f"{case['name']}: {status}, "
                  + (f"error {100 * error:.3g} %, {shown}, " if error is not None else "")
                  + f"{iterations} iterations per window, {wall:.3g} s wall, {processor:.3g} s processor", flush=True)
            write_csv(target, table_rows(cases, known))
    rows = table_rows(cases, known)
    write_csv(target, rows)
    clock = f"{options.clock}_s"
    table = cheapest(rows, [float(limit) for limit in options.limits.split(",")], clock)
    out.with_name(out.name + ".md").write_text(table + "\n", encoding="utf-8")
    print(table)
    plot(out.with_name(out.name + ".png"), rows, clock, pathlib.Path(options.scene).stem)


if __name__ == "__main__":
    main()
