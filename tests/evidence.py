#!/usr/bin/python3
"""Runs what the READMEs say was measured, keeps its figures in configs/studies/evidence and makes the READMEs' tables anew.

    tests/evidence.py [--retime] [--scenes] [--studies] [NAME...]

A NAME is that of a study, as in configs/studies/cavity.toml, or of a scene with its folder, as in fluid/cavity-100. A study fails
when an error grew against the figures kept before, when less is stable, or when a run is wrong without a warning; its old
figures are then left as they are. A scene fails when one of its checks does not hold, and this is kept, too. --scenes and
--studies: all of them. --retime runs studies again though they are known, for the times of a machine that is free now. Scenes of
configs/gallery.toml also get their small picture. Runs are kept in results/; those of studies are not repeated while nothing changes.
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
SCENE_COLUMNS = ["scene", "check", "quantity", "value", "reference", "at_least", "at_most", "tolerance", "absolute", "holds",
                 "status", "iterations", "wall_s", "processor_s"]
NO_CHECK = {"quantity": "", "value": None, "reference": None, "tolerance": None, "absolute": False}


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


def run_scene(name):
    """Whether all checks of the scene hold. What it came to replaces its rows in scenes.csv."""
    out = RESULTS / "scenes" / name
    shutil.rmtree(out, ignore_errors=True)  # nothing of an earlier run may be taken for this one's
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    status = subprocess.run([COUPLER, "run", f"configs/{name}.toml", "--out", out], cwd=ROOT).returncode
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if not (out / "summary.json").exists():
        return False
    with open(out / "summary.json", encoding="utf-8") as file:
        summary = json.load(file)
    keep_scene(name, summary, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    for entry in gallery():
        if entry["scene"] == name:
            pictures = EVIDENCE / "gallery"
            pictures.mkdir(parents=True, exist_ok=True)
            make_small(out / "report" / entry["picture"], pictures / (pathlib.Path(name).stem + ".jpg"),
                       entry.get("part", [0, 0, 1, 1]))
    return status == 0


def gallery():
    with open(ROOT / "configs" / "gallery.toml", "rb") as file:
        return tomllib.load(file)["scene"]


def keep_scene(name, summary, processor_s):
    """Writes one row for each [[check]], in their order."""
    rows = {}
    kept = EVIDENCE / "scenes.csv"
    if kept.exists():
        with open(kept, newline="", encoding="utf-8") as file:
            for row in csv.DictReader(file):
                rows.setdefault(row["scene"], []).append(row)
    checks = summary["checks"] or [NO_CHECK | {"pass": summary["status"] == "done"}]
    rows[name] = [check_row(name, summary, number, check, processor_s) for number, check in enumerate(checks)]
    there = set(scene_names())
    with open(kept, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, SCENE_COLUMNS, lineterminator="\n")
        writer.writeheader()
        for scene in sorted(rows):
            if scene in there:
                writer.writerows(rows[scene])


def check_row(name, summary, number, check, processor_s):
    def figure(value, digits=6):
        return "" if value is None else f"{value:.{digits}g}"

    return {"scene": name, "check": number, "quantity": check["quantity"], "value": figure(check["value"]),
            "reference": figure(check["reference"]), "at_least": figure(check.get("at_least")),
            "at_most": figure(check.get("at_most")), "tolerance": figure(check["tolerance"]),
            "absolute": int(check["absolute"]), "holds": int(check["pass"]), "status": summary["status"],
            "iterations": figure(summary["iterations"]["mean"], 4), "wall_s": figure(summary["wall_s"], 4),
            "processor_s": figure(processor_s, 4)}


def scene_names():
    return sorted(f"{p.parent.name}/{p.stem}" for p in (ROOT / "configs").glob("*/*.toml") if p.parent.name != "studies")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--scenes", action="store_true")
    parser.add_argument("--studies", action="store_true")
    parser.add_argument("--retime", action="store_true")
    options = parser.parse_args()
    studies = sorted(p.stem for p in (ROOT / "configs" / "studies").glob("*.toml"))
    scenes = scene_names()
    for name in options.names:
        if name not in studies + scenes:
            known = scenes if "/" in name else studies
            parser.error(f"there is no {name} in configs; there are {', '.join(known)}")
    names = options.names + (scenes if options.scenes else []) + (studies if options.studies else [])
    if not names:
        parser.error("nothing to run: --scenes, --studies, or names of them")
    failed = [name for name in names if not (run_scene(name) if "/" in name else run_study(name, options.retime))]
    if subprocess.run([sys.executable, ROOT / "tests" / "readme_tables.py"]).returncode != 0:
        failed.append("the READMEs' tables")
    for name in failed:
        print(f"failed: {name}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
