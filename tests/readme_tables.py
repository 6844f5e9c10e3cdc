#!/usr/bin/env python3
"""Makes the tables of the READMEs of what was measured: nobody types a figure.

    tests/readme_tables.py [--check]

In any Markdown file of the repository, what stands between a line like one of these and `<!-- end -->` is made anew:

    <!-- study: NAME -->          results of configs/studies/NAME.toml and their picture
    <!-- costs: NAME NAME ... --> cheapest settings below 5, 2, 1 and 0.3 % of some studies, one line each; none below the smallest
                                  of a study's own `limits`, where its reference is not known that well
    <!-- maps: NAME NAME ... -->  what the runs of some maps of stability came to, one line each
    <!-- scenes: FOLDER -->       every check of the scenes of configs/FOLDER
    <!-- checks -->               how many checks of each folder hold, and those that do not
    <!-- gallery -->              the scenes of configs/gallery.toml with their pictures

The figures are those of configs/studies/evidence/*.csv, which tests/evidence.py refreshes. --check changes nothing and
fails when a file is not up to date.
"""
import csv
import math
import os
import pathlib
import re
import subprocess
import sys
import tomllib

ROOT = pathlib.Path(__file__).resolve().parents[1]
STUDIES = ROOT / "configs" / "studies"
EVIDENCE = STUDIES / "evidence"
BLOCK = re.compile(r"(<!-- (study|costs|maps|scenes|checks|gallery)(?:: ([\w \-]+?))? -->\n)(.*?)(<!-- end -->)", re.DOTALL)
LIMITS = (0.05, 0.02, 0.01, 0.003)
MUCH_SCATTER = 0.25  # of repeats, relative to their median


def number(text):
    try:
        return float(text)
    except ValueError:
        return math.nan


def seconds(value):
    if not math.isfinite(value):
        return "-"
    return f"{value:.0f} s" if value >= 100 else f"{value:.2g} s" if value < 10 else f"{value:.3g} s"


def percent(share, sign=""):
    if not math.isfinite(share):
        return "-"
    value = 100 * share
    digits = f"{abs(value):.2g}" if abs(value) < 100 else f"{abs(value):.0f}"
    if "e" in digits:
        digits = f"{abs(value):.0e}"
    return f"{'-' if value < 0 else sign}{digits} %"


def row(entries):
    return "| " + " | ".join(str(entry).replace("|", "/").replace("\n", " ") for entry in entries) + " |\n"


def heading(names):
    return row(names) + "|" + "---|" * len(names) + "\n"


def flat_keys(table, prefix=""):
    for key, value in table.items():
        if isinstance(value, dict):
            yield from flat_keys(value, f"{prefix}{key}.")
        else:
            yield prefix + key


def was_run(name):
    if not (STUDIES / f"{name}.toml").exists():
        sys.exit(f"there is no configs/studies/{name}.toml")
    return (EVIDENCE / f"{name}.csv").exists()


def waited(entry):
    """Whether a run waited for its processors so long that the clock says little (as the study itself judges)."""
    return number(entry["wall_s"]) > 2 * number(entry["processor_s"]) + 0.5


class Study:
    """A study's file and the rows of its CSV."""

    def __init__(self, name):
        self.name = name
        with open(STUDIES / f"{name}.toml", "rb") as file:
            self.scene = tomllib.load(file)
        self.title = self.scene.get("title", name)
        own = {"name", "labels", "size"}
        self.axes = [axis.get("name") or next(key for key in flat_keys(axis) if key not in own)
                     for axis in self.scene.get("vary", [])]
        with open(EVIDENCE / f"{name}.csv", newline="", encoding="utf-8") as file:
            reader = csv.DictReader(file)
            self.rows = list(reader)
            self.columns = reader.fieldnames
        self.quantities = [name[:-len(" error")] for name in self.columns if name.endswith(" error")]

    def signed_error(self, entry, quantity):
        error = number(entry[quantity + " error"])
        below = number(entry[quantity]) < number(entry[quantity + " reference"])
        below ^= number(entry[quantity + " reference"]) < 0  # larger in size is +
        return -error if below else error

    def finished(self, entry):
        return entry["status"] in ("done", "check failed")

    def scattered(self, entry):
        wall = number(entry["wall_s"])
        return number(entry["wall_max_s"]) - number(entry["wall_min_s"]) > MUCH_SCATTER * wall

    def busy(self):
        return any(waited(entry) for entry in self.rows)

    def series(self):
        """Rows that differ in the ladder's step only, coarse to fine."""
        lines = {}
        for entry in self.rows:
            lines.setdefault(tuple(entry[axis] for axis in self.axes[1:]), []).append(entry)
        return lines

    def label(self, entry):
        return ", ".join(entry[axis] for axis in self.axes)

    def cheapest(self, limit):
        """The cheapest row that stays below, as all finer ones of its line do."""
        cost = "processor_s" if self.busy() else "wall_s"
        best = None
        for line in self.series().values():
            for entry in reversed(line):
                if not number(entry["error"]) <= limit:
                    break
                if best is None or number(entry[cost]) < number(best[cost]):
                    best = entry
        return best


def time_text(study, entry):
    """Of the clock, and of the processors where the clock says little."""
    text = seconds(number(entry["wall_s"]))
    return text + "*" if study.scattered(entry) else text


def footnotes(study):
    notes = []
    if any(study.scattered(entry) for entry in study.rows if entry["wall_s"]):
        notes.append("* repeats differ by more than a quarter.")
    if study.busy():
        notes.append("The machine had other work: the times of the processors say more.")
    return notes


def table_of_rows(study):
    iterations = any(number(entry["iterations_per_window"]) > 1.0001 for entry in study.rows)
    names = study.axes + study.quantities + ["wall time", "of the processors"]
    if iterations:
        names.append("iterations")
    text = heading(names)
    for entry in study.rows:
        cells = [entry[axis] for axis in study.axes]
        if study.finished(entry):
            cells += [f"{number(entry[q]):.5g} ({percent(study.signed_error(entry, q), '+')})" for q in study.quantities]
        else:
            cells += [entry["status"]] + [""] * (len(study.quantities) - 1)
        cells += [time_text(study, entry), seconds(number(entry["processor_s"]))]
        if iterations:
            cells.append(f"{number(entry['iterations_per_window']):.3g}" if entry["iterations_per_window"] else "-")
        text += row(cells)
    return text


def table_of_lines(study):
    """A column for each line: largest error and time of each step."""
    lines = study.series()
    text = heading([study.axes[0]] + [", ".join(name) for name in lines])
    for step in dict.fromkeys(entry[study.axes[0]] for entry in study.rows):
        cells = [step]
        for line in lines.values():
            entry = next((e for e in line if e[study.axes[0]] == step), None)
            if entry is None:
                cells.append("")
            elif study.finished(entry):
                time = seconds(number(entry["processor_s"])) if study.busy() else time_text(study, entry)
                cells.append(f"{percent(number(entry['error']))}, {time}")
            else:
                cells.append(entry["status"])
        text += row(cells)
    what = "Largest error of " + ", ".join(study.quantities) if len(study.quantities) > 1 else "Error of " + study.quantities[0]
    return text + f"\n{what}, and {'time of the processors' if study.busy() else 'wall time'}.\n"


def table_of_classes(study):
    def cell(entry):
        text = entry["class"] + (", **a lie**" if entry["lie"] == "1" else "")
        iterations = number(entry["iterations_per_window"])
        if entry["class"] == "stable" and iterations > 1.0001:
            return f"{text}, {iterations:.3g}"
        if entry["class"] == "inaccurate":
            return f"{text}, {percent(number(entry['error']))}"
        return text

    if len(study.axes) == 1:
        return heading([study.axes[0], "", "symptom"]) + "".join(
            row([entry[study.axes[0]], cell(entry), entry["symptom"]]) for entry in study.rows)
    first, second = study.axes[0], study.axes[1]
    steps = list(dict.fromkeys(entry[first] for entry in study.rows))
    text = heading([f"{second} \\ {first}"] + steps)
    for other in dict.fromkeys(entry[second] for entry in study.rows):
        found = {entry[first]: cell(entry) for entry in study.rows if entry[second] == other}
        text += row([other] + [found.get(step, "") for step in steps])
    return text


def table_of_limits(study):
    key = study.scene["bisect"]["key"]
    with open(EVIDENCE / f"{study.name}-limits.csv", newline="", encoding="utf-8") as file:
        limits = list(csv.DictReader(file))
    text = heading(study.axes + [f"{key}: holds", "does not", "as"])
    for entry in limits:
        text += row([entry[axis] for axis in study.axes]
                    + [f"{number(entry[name]):.3g}" if entry[name] else "-" for name in ("holds", "fails")]
                    + [f"{entry['class']}: {entry['symptom']}" if entry["symptom"] else entry["class"]])
    return text


def counts(study):
    kinds = {}
    for entry in study.rows:
        kinds[entry["class"]] = kinds.get(entry["class"], 0) + 1
    return kinds, sum(entry["lie"] == "1" for entry in study.rows)


def study_block(names, page):
    if not was_run(names[0]):
        return f"Not measured yet: `tests/evidence.py {names[0]}`\n"
    study = Study(names[0])
    notes = []
    if "class" in study.columns:
        text = table_of_limits(study) if "bisect" in study.scene else table_of_classes(study)
        kinds, lies = counts(study)
        notes.append(f"{len(study.rows)} runs: " + ", ".join(f"{count} {kind}" for kind, count in kinds.items())
                     + f"; {lies or 'none'} wrong without a warning.")
    else:
        text = table_of_rows(study) if len(study.axes) == 1 else table_of_lines(study)
        notes = footnotes(study)
    picture = EVIDENCE / f"{study.name}.png"
    notes.append(f"`coupler study configs/studies/{study.name}.toml`")
    text += "\n" + " ".join(notes) + "\n"
    if picture.exists():
        text += f"\n![{study.title}]({os.path.relpath(picture, page.parent)})\n"
    return text


def costs_block(names, page):
    text = heading(["study"] + [f"below {100 * limit:g} %" for limit in LIMITS])
    scattered = False
    for name in filter(was_run, names):
        study = Study(name)
        cells = [f"[{study.title.split(':')[0]}]({os.path.relpath(STUDIES / f'{name}.toml', page.parent)})"]
        for limit in LIMITS:
            best = study.cheapest(limit) if limit >= min(study.scene.get("limits", [0])) else None
            if best is None:
                cells.append("-")
                continue
            time = seconds(number(best["processor_s"])) + "†" if study.busy() else time_text(study, best)
            scattered |= study.busy()
            cells.append(f"{study.label(best)}: {time}")
        text += row(cells)
    if scattered:
        text += "\n† of the processors: the machine had other work.\n"
    return text


def maps_block(names, page):
    kinds = ("stable", "inaccurate", "stalled", "diverged", "lost", "refused")
    text = heading(["map", "runs"] + list(kinds) + ["wrong without a warning"])
    for name in filter(was_run, names):
        study = Study(name)
        found, lies = counts(study)
        text += row([f"[{study.title}]({os.path.relpath(STUDIES / f'{name}.toml', page.parent)})", len(study.rows)]
                    + [found.get(kind, 0) or "" for kind in kinds] + [lies])
    return text


def scene_rows():
    """The rows of scenes.csv of each scene that is still there."""
    found = {}
    with open(EVIDENCE / "scenes.csv", newline="", encoding="utf-8") as file:
        for entry in csv.DictReader(file):
            if (ROOT / "configs" / f"{entry['scene']}.toml").exists():
                found.setdefault(entry["scene"], []).append(entry)
    return found


def signed_error(entry):
    """Relative, larger in size is +; not a number where there is no reference or it is nothing."""
    value, reference = number(entry["value"]), number(entry["reference"])
    return (value - reference) / abs(reference) * (-1 if reference < 0 else 1) if reference else math.nan


def scene_time(entry):
    loaded = waited(entry)
    return seconds(number(entry["processor_s" if loaded else "wall_s"])) + ("†" if loaded else "")


def reference_text(entry):
    bounds = [f"{sign} {number(entry[name]):.5g}" for sign, name in (("at least", "at_least"), ("at most", "at_most")) if entry[name]]
    return ", ".join(([f"{number(entry['reference']):.5g}"] if entry["reference"] else []) + bounds)


def deviation_text(entry):
    value, reference, allowed = number(entry["value"]), number(entry["reference"]), number(entry["tolerance"])
    if not math.isfinite(value):
        return (entry["status"] if entry["quantity"] else "no check"), ""
    if not entry["reference"]:
        return "within" if entry["holds"] == "1" else "outside", ""
    if entry["absolute"] == "1" or reference == 0:
        return f"{value - reference:+.2g}", f"{allowed:.2g}"
    return percent(signed_error(entry), "+"), percent(allowed)


def scenes_block(names, page):
    text = heading(["scene", "quantity", "here", "reference", "source of the reference", "error", "allowed", "run time"])
    loaded = False
    for scene, entries in scene_rows().items():
        if scene.split("/")[0] not in names:
            continue
        with open(ROOT / "configs" / f"{scene}.toml", "rb") as file:
            checks = tomllib.load(file).get("check", [])
        for entry in entries:
            first = entry is entries[0]
            source = next((c.get("source", "") for c in checks[int(entry["check"]):][:1] if c["quantity"] == entry["quantity"]), "")
            error, allowed = deviation_text(entry)
            loaded |= first and waited(entry)
            text += row([f"[{scene.split('/')[1]}]({os.path.relpath(ROOT / 'configs' / f'{scene}.toml', page.parent)})" if first else "",
                         entry["quantity"], f"{number(entry['value']):.5g}" if entry["value"] else "", reference_text(entry), source,
                         error if entry["holds"] == "1" else f"**{error}**", allowed, scene_time(entry) if first else ""])
    return text + "\nBold: the check does not hold." + (" † of the processors: the machine had other work." if loaded else "") + "\n"


def checks_block(_, page):
    folders = {}
    for scene, entries in scene_rows().items():
        folders.setdefault(scene.split("/")[0], {})[scene] = entries
    text = heading(["configs/", "scenes", "checks", "hold", "time of the processors", "do not hold"])
    for folder, scenes in folders.items():
        checks = [entry for entries in scenes.values() for entry in entries if entry["quantity"] or entry["holds"] != "1"]
        broken = [f"{entry['scene'].split('/')[1]} `{entry['quantity']}` {deviation_text(entry)[0]}" for entry in checks if entry["holds"] != "1"]
        spent = sum(number(entries[0]["processor_s"]) for entries in scenes.values())
        text += row([f"[{folder}]({os.path.relpath(ROOT / 'configs' / 'README.md', page.parent)}#{folder})", len(scenes), len(checks),
                     len(checks) - len(broken), seconds(spent), "; ".join(broken)])
    return text


def gallery_block(_, page):
    with open(ROOT / "configs" / "gallery.toml", "rb") as file:
        entries = tomllib.load(file)["scene"]
    measured = scene_rows()
    text = heading(["", "scene", "error", "run time"])
    busy = False
    for entry in entries:
        found = next((e for e in measured.get(entry["scene"], []) if e["quantity"] == entry["quantity"]), None)
        if found is None:
            continue  # not run yet
        picture = EVIDENCE / "gallery" / (pathlib.Path(entry["scene"]).stem + ".jpg")
        error = signed_error(found)
        result = percent(error, "+")
        if not math.isfinite(error):
            result = f"{number(found['value']) * entry.get('scale', 1):.3g} {entry['unit']}"
        busy |= waited(found)
        text += row([f"![{entry['title']}]({os.path.relpath(picture, page.parent)})",
                     f"**{entry['title']}**. {entry['text']}<br>`./run configs/{entry['scene']}.toml`", f"{entry['what']}: {result}",
                     scene_time(found)])
    return text + ("\n† of the processors: the machine had other work.\n" if busy else "")


BLOCKS = {"study": study_block, "costs": costs_block, "maps": maps_block, "scenes": scenes_block, "checks": checks_block,
          "gallery": gallery_block}


def main():
    check = "--check" in sys.argv[1:]
    files = subprocess.run(["git", "ls-files", "*.md"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    stale = []
    for page in (ROOT / name for name in files.split()):
        text = page.read_text(encoding="utf-8")
        fresh = BLOCK.sub(lambda found: found[1] + BLOCKS[found[2]]((found[3] or "").split(), page) + found[5], text)
        if fresh == text:
            continue
        stale.append(page.relative_to(ROOT))
        if not check:
            page.write_text(fresh, encoding="utf-8")
    for page in stale:
        print(f"{page}: {'does not say what configs/studies/evidence says: tests/readme_tables.py' if check else 'refreshed'}")
    return 1 if check and stale else 0


if __name__ == "__main__":
    sys.exit(main())
