"""Every signal in every phase of a participant's life: gone on with by itself, or an end as specified, then resumed."""
import os
import signal
import time

from driver import Run, expect, expect_same, finished, summary

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


def words_of_losses(run):
    """The lines in which the coupler says that it has noticed a loss or an interrupt, whole ones."""
    lines = run.said().splitlines(keepends=True)
    return [line for line in lines if line.endswith("\n") and ("was lost" in line or "interrupted" in line or "did not answer" in line)]


def struck(place, phase, number, victim, role):
    """One signal to one process in one phase: (what came of it, time until the coupler said so, time until the end). Who has nothing
    to say, a killed coupler and one that only stops participants, is noticed by its end."""
    if phase in ("connect", "exchange"):
        scene = place.springs(recovery="[recovery]\nevery = 3", solid="seconds = 0.01", fluid="seconds = 0.01")
        mark = None
    else:
        scene, mark = dwell(place, role, phase)
    out = place.folder / "out"
    run = Run(scene, out, limit=40)
    if phase == "connect":
        while role not in run.participants():
            expect(run.process.poll() is None and time.monotonic() - run.begin < 20, run.said())
    elif phase == "exchange":
        run.wait_for_window(7)
    else:
        if phase == "load":
            run.wait_for_window(8)
            os.kill(run.participants()["solid" if role == "fluid" else "fluid"], signal.SIGKILL)
        wait_for(run, mark)
    before = len(words_of_losses(run))
    target = run.process.pid if victim == "coupler" else run.participants().get(role)
    if target is None or run.process.poll() is not None:
        run.end()
        expect(phase == "stop", f"{phase} {number.name} {victim}: had ended before the signal was sent: {run.said()}")
        return "had ended already", 0.0, 0.0
    moment = time.monotonic()
    os.kill(target, number)
    if victim == "coupler" and number == signal.SIGSTOP:
        time.sleep(1)
        os.kill(target, signal.SIGCONT)
    if victim == "coupler" and number in (signal.SIGINT, signal.SIGTERM) and phase == "save":
        time.sleep(0.3)  # a checkpoint is let be completed; asked again it ends
        os.kill(target, number)
    noticed = None
    while run.process.poll() is None:
        expect(time.monotonic() - moment < 40, f"{phase} {number.name} {victim}: does not end: {run.said()}")
        if noticed is None and len(words_of_losses(run)) > before:
            noticed = time.monotonic() - moment
        time.sleep(0.002)
    took = time.monotonic() - moment
    status = run.end()
    expect(victim == "coupler" or phase == "stop" or len(words_of_losses(run)) > before,
           f"{phase} {number.name} {victim}: the loss was not said: {run.said()}")
    while run.participants():
        expect(time.monotonic() - moment - took < 5, f"{phase} {number.name} {victim}: processes were left behind")
        time.sleep(0.02)
    what = {0: "goes on" if "goes on after" in run.said() or "goes on from" in run.said() else "done"}.get(status, f"exit {status}")
    if status != 0:
        finished(scene, out, "--resume")
        what += ", resumed"
    return what, noticed if noticed is not None else took, took


def case_table_of_signals(place):
    """Four signals in nine phases to every process; whatever becomes of it, the bits in the end are the same."""
    reference = place.folder / "undisturbed"
    finished(place.springs(), reference)
    table, noticed, ends = [], {}, {}
    for victim in ("fluid", "solid", "coupler"):
        for phase in ("connect", "configure", "start", "advance", "exchange", "save", "load", "frame", "stop"):
            row = []
            for number in (signal.SIGKILL, signal.SIGTERM, signal.SIGSTOP, signal.SIGINT):
                where = type(place)(place.folder / f"{victim}-{phase}-{number.name}")
                what, first, took = struck(where, phase, number, victim, "solid" if victim == "solid" else "fluid")
                expect_same(where.folder / "out", reference, frames=False)
                row.append(f"{what} ({first:.1f} s)")
                if "resumed" in what or "goes on" in what:
                    noticed.setdefault((victim, number.name), []).append(first)
                    ends.setdefault((victim, number.name), []).append(took)
            table.append(f"| {victim} | {phase} | " + " | ".join(row) + " |")
    text = "\n| who | phase | SIGKILL | SIGTERM | SIGSTOP | SIGINT |\n|---|---|---|---|---|---|\n" + "\n".join(table) + "\n"
    for (victim, name), values in noticed.items():
        text += (f"{victim} {name}: noticed after {sorted(values)[len(values) // 2]:.2f} s (median), {max(values):.2f} s (most); "
                 f"ended after {max(ends[victim, name]):.1f} s at most\n")
    return text


def case_times_until_noticed(place, times=7):
    """How long it takes until a participant's loss between two requests is said, and how long until everyone is at the checkpoint."""
    reference = place.folder / "undisturbed"
    finished(place.springs(), reference)
    text = []
    for number in (signal.SIGKILL, signal.SIGSTOP, signal.SIGTERM):
        noticed, recovered = [], []
        for attempt in range(times):
            where = type(place)(place.folder / f"{number.name}-{attempt}")
            what, first, _ = struck(where, "exchange", number, "solid", "solid")
            expect(what == "goes on", f"{number.name}: {what}")
            expect_same(where.folder / "out", reference, frames=False)
            noticed.append(first)
            recovered.append(summary(where.folder / "out")["recovery"]["recovery_s"])
        text.append(f"{number.name} {sorted(noticed)[times // 2]:.3f} s median, {max(noticed):.3f} s at most, recovered in "
                    f"{sorted(recovered)[times // 2]:.3f} and {max(recovered):.3f} s")
    return f"{times} of each: " + "; ".join(text)
