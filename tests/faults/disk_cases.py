"""Disks that are full, and what many windows leave behind."""
import contextlib
import os
import pathlib
import signal
import subprocess
import time

from driver import Failure, Run, expect, expect_same, finished, summary


def case_checkpoint_that_cannot_be_written(place):
    """It costs the checkpoint, not the run."""
    scene = place.springs(end=3.0, fluid="seconds = 0.02")
    undisturbed = place.folder / "undisturbed"
    finished(scene, undisturbed)
    out = place.folder / "out"
    run = Run(scene, out)
    run.wait_for_window(2)
    for slot in (0, 1):
        (out / "solid" / f"checkpoint-{slot}.h5.part").mkdir()
    run.expect_end(0, "no checkpoint of window")
    expect_same(out, undisturbed)
    expect(summary(out)["recovery"]["checkpoints"] == 0, run.said())


@contextlib.contextmanager
def small_disk(folder):
    """A disk of 16 MB there, with what was in the folder, to which nobody may write meanwhile; None where this machine lets us mount none."""
    folder.mkdir(parents=True, exist_ok=True)
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=16m", "tmpfs", str(folder)], capture_output=True).returncode == 0
    for name, content in before.items() if mounted else ():
        (folder / name).write_bytes(content)
    try:
        yield folder if mounted else None
    finally:
        if mounted:
            subprocess.run(["umount", "--lazy", str(folder)], check=False)


def stop_between_files(run, folder):
    """Stops the run, the coupler first, at a moment at which nobody has a file in the folder open. Who has to be continued, the coupler last."""
    for _ in range(100):
        participants = [*run.participants().values()]
        everyone = [*participants, run.process.pid]
        for number in reversed(everyone):
            os.kill(number, signal.SIGSTOP)
        time.sleep(0.01)
        handles = [os.readlink(f"/proc/{number}/fd/{handle}") for number in everyone for handle in os.listdir(f"/proc/{number}/fd")]
        if not any(pathlib.Path(handle).is_relative_to(folder) for handle in handles) and not list(folder.glob("*.part")):
            return everyone
        for number in everyone:
            os.kill(number, signal.SIGCONT)
        time.sleep(0.02)
    raise Failure("there was always a file open")


def fill(disk):
    with open(disk / "filler", "wb", buffering=0) as filler:
        try:
            while True:
                filler.write(b"x" * 4096)
        except OSError:
            pass


NO_DISK = "NOT TESTED: this machine lets us mount no small disk"


def case_disk_full(place):
    """While tables, frames and checkpoints are written; with room again (the whole run needs a few megabytes) it goes on."""
    with small_disk(place.folder / "small") as small:
        if small is None:
            return NO_DISK
        scene = place.springs(end=6.0, fluid="seconds = 0.01")
        scene.write_text(scene.read_text() + "[output]\nframe_interval = 1\n")
        undisturbed = place.folder / "undisturbed"
        finished(scene, undisturbed)
        out = small / "out"  # what is said goes to that disk as well
        run = Run(scene, out)
        run.wait_for_window(13)
        fill(small)
        status = run.end()
        said = run.said()
        os.remove(small / "filler")
        expect(status == 4, f"exit status {status}: {said}")
        expect("full" in run.log() or "space" in run.log() or not said, f"{said}\n{run.log()[-2000:]}")
        finished(scene, out, "--resume", line="goes on after window")
        expect_same(out, undisturbed)


def case_disk_full_under_one_participant(place):
    """The disk that holds the solid's folder alone: a frame that does not fit ends the run, which can be gone on with; a checkpoint that does
    not fit is said and left out, the one before it stays."""
    for what, output in (("frame", "frame_interval = 5"), ("checkpoint", "frames = false")):
        where = type(place)(place.folder / what)
        keeps = f"[recovery]\nevery = 10\n[output]\n{output}"
        undisturbed = where.folder / "undisturbed"
        finished(where.springs(end=3.0, recovery=keeps), undisturbed)
        # From window 12, when the disk is filled, it is more than a second to window 20, which would be the next to be kept.
        scene = where.springs(end=3.0, fluid="seconds = 0.15", recovery=keeps)
        out = where.folder / "out"
        run = Run(scene, out)
        run.wait_for_window(1)  # a run begins by making its folders
        stopped = stop_between_files(run, out / "solid")
        with small_disk(out / "solid") as small:
            for number in stopped:
                os.kill(number, signal.SIGCONT)
            if small is None:
                run.process.terminate()
                run.end()
                return NO_DISK
            run.wait_for_window(12)
            fill(small)
            full_at = run.window()
            expect(full_at < 19, f"the disk was full at window {full_at} only")
            if what == "frame":
                status = run.end()
                expect(status == 4 and "'solid'" in run.said() and "space" in run.said(), f"exit status {status}: {run.said()}")
            else:
                run.wait_for_window(27)
                expect("no checkpoint of window" in run.said(), run.said())
                os.kill(run.process.pid, signal.SIGKILL)
                run.end()
                while run.participants():
                    time.sleep(0.05)
            os.remove(small / "filler")
            finished(scene, out, "--resume", line="goes on after window 10")
            expect_same(out, undisturbed)


def case_many_exchanges(place, windows=int(os.environ.get("ESTUARY_WINDOWS", "4000"))):
    """Memory and file handles do not grow with the number of windows (ESTUARY_WINDOWS=500000: a million exchanges)."""
    scene = place.springs(end=windows * 0.1, coupling='scheme = "serial-explicit"\npredictor = "none"',
                          recovery="[recovery]\nevery = 500")
    scene.write_text(scene.read_text().replace("slope = 0.5", "slope = 0.0"))
    run = Run(scene, place.folder / "out", limit=600 + 0.01 * windows)
    seen = []
    # Half-way between two checkpoints: writing one takes 5 MB for a moment, the first two leave them behind.
    for window in (windows // 4 + 250, windows - windows // 10 - 150):
        run.wait_for_window(window)
        numbers = {"coupler": run.process.pid, **run.participants()}
        figures = {}
        for name, number in numbers.items():
            with open(f"/proc/{number}/status") as file:
                memory = next(int(line.split()[1]) for line in file if line.startswith("VmRSS"))
            figures[name] = (memory, len(os.listdir(f"/proc/{number}/fd")))
        seen.append(figures)
    run.expect_end(0)
    text = []
    for name in seen[0]:
        (memory, handles), (memory_later, handles_later) = seen[0][name], seen[1][name]
        expect(handles_later <= handles + 1, f"{name}: {handles} file handles became {handles_later}")
        expect(memory_later < memory + 1500, f"{name}: {memory} kB became {memory_later} kB")
        text.append(f"{name} {memory} -> {memory_later} kB, {handles_later} handles")
    return f"{windows} windows: " + "; ".join(text)
