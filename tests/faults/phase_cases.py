"""Every signal in every phase of a participant's life: gone on with by itself, or an end as specified, then resumed."""
import os
import signal
import time

from driver import Run, expect, expect_same, finished

PHASES = ("configure", "start", "advance", "accept", "save", "load", "frame", "stop")


def dwell(place, role, phase):
    mark = place.folder / "mark"
    text = f'dwell = "{phase}"\ndwell_mark = "{mark}"\nat_window = 7'
    scene = place.springs(**{role: text}, recovery="[recovery]\nevery = 3")
    return scene, mark


def wait_for(run, mark):
    while not mark.exists():
        expect(time.monotonic() - run.begin < 20, f"the phase was not reached: {run.said()}")
        expect(run.process.poll() is None, f"ended before the phase was reached: {run.said()}")
        time.sleep(0.005)


def strike_in(place, phase, role, number):
    undisturbed = place.folder / "undisturbed"
    finished(place.springs(), undisturbed)
    scene, mark = dwell(place, role, phase)
    out = place.folder / "out"
    run = Run(scene, out, limit=15)
    if phase == "load":
        # Someone has to be lost for it to be reached.
        run.wait_for_window(8)
        os.kill(run.participants()["fluid" if role == "solid" else "solid"], signal.SIGKILL)
    wait_for(run, mark)
    time.sleep(0.05)
    struck = time.monotonic()
    os.kill(run.participants()[role], number)
    status = run.end()
    took = time.monotonic() - struck
    if phase == "stop":
        expect(status == 0, f"{phase} {role} {number.name}: everything was computed: {run.said()}")
    else:
        expect(status == 0 and "goes on" in run.said(), f"{phase} {role} {number.name}: {status} {run.said()}")
    expect(not run.participants(), "processes were left behind")
    expect_same(out, undisturbed, frames=False)
    return took


def case_signals_in_every_phase(place):
    times = {}
    for phase in PHASES:
        for number in (signal.SIGKILL, signal.SIGSTOP):
            role = "fluid" if number == signal.SIGKILL else "solid"
            where = type(place)(place.folder / f"{phase}-{number.name}")
            times.setdefault(number.name, []).append(strike_in(where, phase, role, number))
    return ", ".join(f"{name} to the end of the run: {sorted(values)[len(values) // 2]:.1f} s median, {max(values):.1f} s at most"
                     for name, values in times.items())


def case_interrupt_in_every_phase(place):
    """Ctrl-C and the coupler's death while a participant is in a phase that takes long."""
    undisturbed = place.folder / "undisturbed"
    finished(place.springs(), undisturbed)
    for phase in PHASES:
        for number in (signal.SIGINT, signal.SIGKILL):
            if phase in ("load", "stop"):
                continue
            where = type(place)(place.folder / f"{phase}-{number.name}")
            scene, mark = dwell(where, "fluid", phase)
            out = where.folder / "out"
            run = Run(scene, out, limit=30)
            wait_for(run, mark)
            struck = time.monotonic()
            os.kill(run.process.pid, number)
            if number == signal.SIGINT and phase == "save":
                # A checkpoint is let be completed; asked again it ends.
                time.sleep(0.3)
                os.kill(run.process.pid, number)
            status = run.end()
            expect(number == signal.SIGKILL or status == 130, f"{phase}: {status} {run.said()}")
            while run.participants():
                expect(time.monotonic() - struck < 5, f"{phase} {number.name}: processes were left behind")
                time.sleep(0.02)
            finished(scene, out, "--resume")
            expect_same(out, undisturbed, frames=False)
