"""Disks that are full, and what many windows leave behind."""
import os
import signal
import subprocess
import time

from driver import Run, expect, expect_same, finished, summary


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


def case_disk_full(place):
    """While tables, frames and checkpoints are written; with room again (the whole run needs a few megabytes) it goes on."""
    small = place.folder / "small"
    small.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=16m", "tmpfs", str(small)], capture_output=True).returncode:
        return "NOT TESTED: this machine lets us mount no small disk"
    try:
        scene = place.springs(end=6.0, fluid="seconds = 0.01")
        text = scene.read_text() + "[output]\\nframe_interval = 1\\n".replace("\\n", "\n")
        scene.write_text(text)
        undisturbed = place.folder / "undisturbed"
        finished(scene, undisturbed)
        out = small / "out"  # what is said goes to that disk as well
        run = Run(scene, out)
        run.wait_for_window(13)
        with open(small / "filler", "wb", buffering=0) as filler:
            try:
                while True:
                    filler.write(b"x" * 4096)
            except OSError:
                pass
        status = run.end()
        said = run.said()
        os.remove(small / "filler")
        expect(status == 4, f"exit status {status}: {said}")
        expect("full" in run.log() or "space" in run.log() or not said, f"{said}\n{run.log()[-2000:]}")
        finished(scene, out, "--resume", line="goes on after window")
        expect_same(out, undisturbed)
    finally:
        subprocess.run(["umount", "--lazy", str(small)], check=False)


def case_many_exchanges(place, windows=4000):
    """Memory and file handles do not grow with the number of windows."""
    scene = place.springs(end=windows * 0.1, coupling='scheme = "serial-explicit"\npredictor = "none"',
                          recovery="[recovery]\nevery = 500")
    scene.write_text(scene.read_text().replace("slope = 0.5", "slope = 0.0"))
    run = Run(scene, place.folder / "out", limit=600)
    seen = []
    for window in (windows // 4, windows - windows // 10):
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
        # The coupler keeps every watched value for the checks and a row for each window.
        kept = 6000 + 0.25 * windows if name == "coupler" else 0
        expect(memory_later < memory + 1500 + kept, f"{name}: {memory} kB became {memory_later} kB")
        text.append(f"{name} {memory} -> {memory_later} kB, {handles_later} handles")
    return f"{windows} windows: " + "; ".join(text)
