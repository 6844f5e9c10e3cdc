#!/usr/bin/python3
"""Runs what the READMEs say was measured, keeps its figures in configs/studies/evidence and makes the READMEs' tables anew.

    tests/evidence.py [--gallery] [--retime] [--all | STUDY...]

A STUDY is the name of a file of configs/studies. It fails when an error grew against the figures kept before, when less
is stable, or when a run is wrong and yet ended as done; its old figures are then left as they are. --retime runs again what
is known, for the times of a machine that is free now. --gallery runs the scenes of configs/gallery.toml, makes their small
pictures and fails when one of them fails its checks. Runs are kept in results/ and not repeated while nothing changes.
Package: python3-vtk9, for the small pictures.
"""
import argparse
import csv
import json
import os
import pathlib
import resource
import shutil
import subprocess
import sys
import tomllib

ROOT = pathlib.Path(__file__).resolve().parents[1]
EVIDENCE = ROOT / "configs" / "studies" / "evidence"
COUPLER = pathlib.Path(os.environ.get("ESTUARY_PROGRAMS", ROOT / "build" / "bin")) / "coupler"
RESULTS = pathlib.Path(os.environ.get("ESTUARY_RESULTS", ROOT / "results"))
PICTURE_WIDTH = 360


def run_study(name, retime):
    study = ROOT / "configs" / "studies" / f"{name}.toml"
    out = RESULTS / "studies" / name
    command = [COUPLER, "study", study.relative_to(ROOT), "--out", out]
    with open(study, "rb") as file:
        scene = tomllib.load(file)
    limits = "bisect" in scene
    before = EVIDENCE / (f"{name}-limits.csv" if limits else f"{name}.csv")
    if before.exists():
        command += ["--against", before]
    if retime and scene.get("mode") != "stability":
        command.append("--retime")
    if subprocess.run(command, cwd=ROOT).returncode != 0:
        return False
    keep_study(name, out)
    return True


def keep_study(name, out):
    EVIDENCE.mkdir(exist_ok=True)
    shutil.copy(out / "study.csv", EVIDENCE / f"{name}.csv")
    if (out / "limits.csv").exists():
        shutil.copy(out / "limits.csv", EVIDENCE / f"{name}-limits.csv")
    if (out / "study.png").exists():
        shutil.copy(out / "study.png", EVIDENCE / f"{name}.png")


def make_small(picture, small, part):
    """Writes the share `part` (left, top, right, bottom, from 0 to 1) of a PNG as a small JPEG."""
    import vtk
    reader = vtk.vtkPNGReader()
    reader.SetFileName(str(picture))
    reader.Update()
    width, height, _ = reader.GetOutput().GetDimensions()
    clip = vtk.vtkExtractVOI()
    clip.SetInputConnection(reader.GetOutputPort())
    left, top, right, bottom = part
    clip.SetVOI(int(left * width), int(right * width) - 1, int((1 - bottom) * height), int((1 - top) * height) - 1, 0, 0)
    clip.Update()
    first, last, low, high, _, _ = clip.GetOutput().GetExtent()
    shrink = vtk.vtkImageResize()
    shrink.SetInputConnection(clip.GetOutputPort())
    shrink.SetOutputDimensions(PICTURE_WIDTH, max(1, round(PICTURE_WIDTH * (high - low + 1) / (last - first + 1))), 1)
    colours = vtk.vtkImageExtractComponents()
    colours.SetInputConnection(shrink.GetOutputPort())
    colours.SetComponents(0, 1, 2)
    writer = vtk.vtkJPEGWriter()
    writer.SetInputConnection(colours.GetOutputPort())
    writer.SetQuality(88)
    writer.SetFileName(str(small))
    writer.Write()


def run_scene(entry):
    """The row of gallery.csv, or nothing when the scene failed."""
    out = RESULTS / "gallery" / pathlib.Path(entry["scene"]).stem
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    status = subprocess.run([COUPLER, "run", f"configs/{entry['scene']}.toml", "--out", out], cwd=ROOT).returncode
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if status != 0:
        return None
    return scene_row(entry, out, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)


def scene_row(entry, out, processor_s):
    with open(out / "summary.json", encoding="utf-8") as file:
        summary = json.load(file)
    check = next(c for c in summary["checks"] if c["quantity"] == entry["quantity"])
    value, reference = check["value"], check.get("reference")
    error = (value - reference) / abs(reference) if reference else ""
    if error and reference < 0:
        error = -error  # larger in size is +
    pictures = EVIDENCE / "gallery"
    pictures.mkdir(parents=True, exist_ok=True)
    make_small(out / "report" / entry["picture"], pictures / (pathlib.Path(entry["scene"]).stem + ".jpg"),
               entry.get("part", [0, 0, 1, 1]))
    return {"scene": entry["scene"], "quantity": entry["quantity"], "value": f"{value:.6g}",
            "reference": "" if reference is None else f"{reference:.6g}", "error": f"{error:.6g}" if error != "" else "",
            "wall_s": f"{summary['wall_s']:.4g}", "processor_s": f"{processor_s:.4g}"}


def run_gallery():
    with open(ROOT / "configs" / "gallery.toml", "rb") as file:
        entries = tomllib.load(file)["scene"]
    rows = {}
    kept = EVIDENCE / "gallery.csv"
    if kept.exists():
        with open(kept, newline="", encoding="utf-8") as file:
            rows = {row["scene"]: row for row in csv.DictReader(file)}
    failed = []
    for entry in entries:
        row = run_scene(entry)
        if row is None:
            failed.append(entry["scene"])
        else:
            rows[entry["scene"]] = row
    write_gallery([rows[entry["scene"]] for entry in entries if entry["scene"] in rows])
    return failed


def write_gallery(rows):
    with open(EVIDENCE / "gallery.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, rows[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("studies", nargs="*", metavar="STUDY")
    parser.add_argument("--all", action="store_true")
    parser.add_argument("--gallery", action="store_true")
    parser.add_argument("--retime", action="store_true")
    options = parser.parse_args()
    names = sorted(p.stem for p in (ROOT / "configs" / "studies").glob("*.toml"))
    for name in options.studies:
        if name not in names:
            parser.error(f"there is no configs/studies/{name}.toml; there are {', '.join(names)}")
    if options.studies and options.all:
        parser.error("--all, or some by name")
    if not (options.studies or options.all or options.gallery):
        parser.error("nothing to run: --all, --gallery or the names of studies")
    failed = [name for name in (names if options.all else options.studies) if not run_study(name, options.retime)]
    if options.gallery:
        failed += run_gallery()
    if subprocess.run([sys.executable, ROOT / "tests" / "readme_tables.py"]).returncode != 0:
        failed.append("the READMEs' tables")
    for name in failed:
        print(f"failed: {name}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
