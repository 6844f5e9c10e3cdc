"""Runs scenes as a person does, disturbs their processes, and compares what they leave.

Everything here works on real processes; nothing of the product is imported.
"""
import csv
import json
import os
import pathlib
import shutil
import signal
import subprocess
import time

PROGRAMS = pathlib.Path(os.environ.get("ESTUARY_PROGRAMS", "build/bin")).resolve()
ROOT = pathlib.Path(__file__).resolve().parents[2]
# Columns that hold wall time.
TIMES = {"wall_s", "fluid_s", "solid_s"}


class Failure(AssertionError):
    pass


def expect(condition, text):
    if not condition:
        raise Failure(text)


class Run:
    """One `coupler run` in the background."""

    def __init__(self, scene, out, *options, limit=60, program=PROGRAMS / "coupler", prefix=(), out_there=None):
        """`prefix`: words before the command, where it runs elsewhere; `out_there`: what the folder is called there."""
        self.out = pathlib.Path(out)
        self.text = self.out.with_suffix(".txt")
        self.limit = limit
        self.begin = time.monotonic()
        self.file = open(self.text, "a+")
        self.process = subprocess.Popen(
            [*prefix, str(program), "run", str(scene), "--out", str(out_there or out), *options],
            stdout=self.file, stderr=self.file, stdin=subprocess.DEVNULL, cwd=ROOT, start_new_session=True)

    def said(self):
        return self.text.read_text()

    def log(self):
        path = self.out / "log" / "coupler.log"
        return path.read_text() if path.exists() else ""

    def participants(self):
        """Process numbers of the solvers that were launched, by role: they write below the run's folder."""
        found = {}
        for entry in pathlib.Path("/proc").iterdir():
            if not entry.name.isdigit():
                continue
            try:
                words = (entry / "cmdline").read_bytes().split(b"\0")
                if b"--folder" in words:
                    folder = pathlib.Path(words[words.index(b"--folder") + 1].decode())
                    if folder.parent == self.out:
                        found[folder.name] = int(entry.name)
            except (OSError, ValueError, IndexError):
                continue
        return found

    def window(self):
        """Windows that are accepted so far."""
        try:
            return max(0, (self.out / "iterations.csv").read_bytes().count(b"\n") - 1)
        except OSError:
            return 0

    def wait_for_window(self, window):
        while True:
            begin = time.monotonic()
            if self.window() >= window or self.process.poll() is not None:
                return
            expect(begin - self.begin < self.limit, f"window {window} was not reached: {self.said()}")
            time.sleep(max(0.002, 20 * (time.monotonic() - begin)) if window > 1000 else 0.002)  # a long table takes long to count

    def end(self):
        """Exit status; a run that is too slow fails."""
        try:
            status = self.process.wait(max(0.1, self.limit - (time.monotonic() - self.begin)))
        except subprocess.TimeoutExpired:
            os.killpg(self.process.pid, signal.SIGKILL)
            for number in self.participants().values():
                os.kill(number, signal.SIGKILL)
            raise Failure(f"did not end within {self.limit} s:\n{self.said()}") from None
        return status

    def expect_end(self, status, line=None):
        found = self.end()
        expect(found == status, f"exit status {found} instead of {status}:\n{self.said()[-3000:]}\n{self.log()[-1500:]}")
        if line is not None:
            expect(line in self.said(), f"'{line}' was not said:\n{self.said()}")
        deadline = time.monotonic() + 2
        while self.participants() and time.monotonic() < deadline:
            time.sleep(0.02)
        expect(not self.participants(), "processes were left behind")
        return self


def finished(scene, out, *options, status=0, line=None, limit=60):
    return Run(scene, out, *options, limit=limit).expect_end(status, line)


def rows(path):
    """A table without its times."""
    with open(path) as file:
        table = list(csv.reader(file))
    keep = [k for k, name in enumerate(table[0]) if name not in TIMES]
    return [[row[k] for k in keep] for row in table]


def expect_same(disturbed, undisturbed, frames=True, elsewhere=None):
    """Bit for bit what an undisturbed run leaves: tables, watches, fields. `elsewhere`: folders of participants whose files stayed
    on other machines. Returns how many files of fields were compared."""
    for name in ("iterations.csv", "convergence.csv"):
        if (undisturbed / name).exists():
            a, b = rows(disturbed / name), rows(undisturbed / name)
            expect(len(a) == len(b), f"{name} has {len(a)} rows instead of {len(b)}")
            for left, right in zip(a, b):
                expect(left == right, f"{name} differs:\n  {left}\n  {right}")
    watches = {path.name for path in (undisturbed / "watch").iterdir()}
    expect(watches == {path.name for path in (disturbed / "watch").iterdir()}, "other watches")
    for name in watches:
        a, b = (folder / "watch" / name for folder in (disturbed, undisturbed))
        expect(a.read_bytes() == b.read_bytes(), f"watch/{name} differs")
    count = 0
    for role in ("fluid", "solid", "grains"):
        if not (undisturbed / role).exists() or not frames:
            continue
        for path in (undisturbed / role).iterdir():
            if not path.name.endswith((".hdf", ".series")):
                continue
            other = (elsewhere or {}).get(role, disturbed / role) / path.name
            expect(other.exists(), f"{role}/{path.name} is missing")
            expect(other.read_bytes() == path.read_bytes(), f"{role}/{path.name} differs")
            count += 1
    return count


def summary(out):
    return json.loads((out / "summary.json").read_text())


TUBE = """title = "tube"
dimension = 2
[coupling]
mode = "transient"
window = 0.01
end_time = {end}
tolerance = 1e-5
force_tolerance = 1e-5
velocity_tolerance = 1.0
max_iterations = 200
filter_limit = 1e-3
{coupling}
[fluid]
solver = "{programs}/elastic-tube"
[solid]
solver = "{programs}/elastic-tube"
{recovery}
[[watch]]
name = "flow"
participant = "fluid"
[[watch]]
name = "surface"
participant = "coupling"
"""

SPRINGS = """title = "two springs"
dimension = 2
[coupling]
mode = "transient"
window = 0.1
end_time = {end}
{coupling}
[fluid]
solver = "{programs}/linear-participant"
pressure = 3.0
slope = 0.5
{fluid}
[solid]
solver = "{programs}/linear-participant"
stiffness = 1.0
{solid}
{recovery}
[[watch]]
name = "tip"
participant = "solid"
"""


class Place:
    """A folder for one case."""

    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir(parents=True)

    def write(self, name, text):
        path = self.folder / name
        path.write_text(text)
        return path

    def tube(self, name="tube.toml", coupling='acceleration = "iqn-ils"\nrelaxation = 0.01', end=1.0,
             recovery="[recovery]\nevery = 10"):
        return self.write(name, TUBE.format(coupling=coupling, end=end, recovery=recovery, programs=PROGRAMS))

    def springs(self, name="springs.toml", coupling="", end=2.0, fluid="", solid="",
                recovery="[recovery]\nevery = 5"):
        return self.write(name, SPRINGS.format(coupling=coupling, end=end, fluid=fluid, solid=solid,
                                               recovery=recovery, programs=PROGRAMS))
