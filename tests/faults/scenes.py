"""Every kind of scene, disturbed: it ends with the same bits as undisturbed."""
import os
import signal
import time
import tomllib

from driver import ROOT, Run, expect, expect_same, finished, summary

# Scene and how many of its windows are run.
SCENES = {
    "fsi/elastic-fin-transient": 30,
    "fsi/acoustic-piston": 200,
    "fsi/oscillatory-shear": 100,
    "fsi/added-mass": 40,
    "fsi/viv-cylinder": 12,
    "fsi/two-masses-three-springs": 70,
    "fsi/added-mass-string": 100,
    "fsi/elastic-tube": 100,
    "three-way/grains-on-elastic-plate": 60,
    "three-way/elastic-gate": 30,
    "grains/settling-disc": 400,
    "grains/boiling-2d": 80,
    "grains/boiling-3d": 12,
    "grains/drafting-kissing-tumbling": 60,
    "grains/moving-grain-galilean": 40,
    "grains/permeability": 6,
    "grains/cemented": 6,
    "grains/column-collapse": 20,
    "grains/haff-cooling": 60,
    "grains/bouncing-ball": 300,
    "grains/sliding-to-rolling": 100,
    "fluid/oscillating-cylinder": 12,
    "fluid/schaefer-turek-2": 20,
    "fluid/square-cylinder": 10,
    "fluid/wind-tunnel": 10,
    "fluid/taylor-green": 10,
    "fluid/womersley": 40,
    "solid/bar-tension": 60,
    "solid/bar-tension-updated": 60,
    "solid/bar-wave": 60,
    "solid/colliding-bars": 100,
    "solid/csm3": 20,
    "solid/oscillating-plate": 60,
    "solid/plastic-shear": 40,
    "solid/rigid-oscillator": 100,
    "solid/rigid-rotation": 40,
    "solid/shell-strip": 40,
    "solid/spinning-plate": 30,
    "solid/taylor-bar": 40,
}
ROLES = ("fluid", "solid", "grains")


def settings(name, threads, windows=None):
    """Options that shorten the scene; its windows and its participants."""
    with open(ROOT / "configs" / f"{name}.toml", "rb") as file:
        scene = tomllib.load(file)
    windows = windows or SCENES[name]
    roles = [role for role in ROLES if role in scene]
    options = ["--set", f"coupling.end_time={windows * scene['coupling']['window']!r}",
               "--set", f"output.frame_interval={max(1, windows // 3)}"]
    for role in roles:
        options += ["--set", f"{role}.threads={threads}"]
    return ROOT / "configs" / f"{name}.toml", options, windows, roles


def send(process, number):
    """False when it has ended by itself already."""
    try:
        if process:
            os.kill(process, number)
        return bool(process)
    except ProcessLookupError:
        return False


def undisturbed(place, name, windows=None):
    scene, options, _, _ = settings(name, 1, windows)
    out = place.folder / "undisturbed"
    done = Run(scene, out, *options, "--set", "recovery.every=0", limit=600 * PATIENCE)
    status = done.end()  # a check of the whole run need not hold after a part of it
    expect(status in (0, 1), done.said())
    return out, status, summary(out)["wall_s"]


def killed_and_resumed(place, name):
    """A participant is killed, later the coupler; the run is then gone on with by two threads."""
    reference, status, seconds = undisturbed(place, name)
    scene, options, windows, roles = settings(name, 1)
    every = max(1, windows // 7)
    keep = ["--set", f"recovery.every={every}"]
    out = place.folder / "out"
    run = Run(scene, out, *options, *keep, limit=600)
    run.wait_for_window(windows // 3)
    send(run.participants().get(roles[len(name) % len(roles)]), signal.SIGKILL)
    run.wait_for_window(min(windows - 1, windows * 2 // 3))
    early = run.process.poll() is None
    send(run.process.pid, signal.SIGKILL)
    run.end()
    while run.participants():
        time.sleep(0.05)
    if early:  # else it had ended before it could be killed
        again, options, _, _ = settings(name, 2)
        run = Run(again, out, *options, *keep, "--resume", limit=600)
        run.expect_end(status)
        expect("goes on after window" in run.said(), run.said())
    frames = expect_same(out, reference, os.environ.get("ESTUARY_FRAMES") != "0")
    return f"{frames} files of fields, {seconds:.1f} s undisturbed"


def cases(wanted):
    for name in wanted or SCENES:
        yield name.replace("/", "-"), lambda place, scene=name: killed_and_resumed(place, scene)


SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGSTOP, signal.SIGINT)
# Scene and how many of its windows: few, for there are many moments.
RANDOM_SCENES = {"fsi/elastic-tube": 40, "fsi/acoustic-piston": 60, "grains/settling-disc": 100, "fsi/elastic-fin-transient": 5}
# A machine with much else to do needs longer for everything.
PATIENCE = float(os.environ.get("ESTUARY_PATIENCE", "1"))


def random_cases(count, source):
    """Signals at random moments; either the run recovers by itself or it is gone on with, to the same bits."""
    references = {}

    def strike(place, name, number, victim, moment):
        if name not in references:
            folder = place.folder.parent / f"reference-{name.replace('/', '-')}"
            references[name] = undisturbed(type(place)(folder), name, RANDOM_SCENES[name])
        reference, status, seconds = references[name]
        scene, options, windows, roles = settings(name, 1, RANDOM_SCENES[name])
        keep = ["--no-report", "--set", f"recovery.every={max(1, windows // 7)}"]
        out = place.folder / "out"
        run = Run(scene, out, *options, *keep, limit=120 * PATIENCE)
        time.sleep(moment * (seconds + 0.4))
        target = run.process.pid
        if victim != "coupler":
            target = run.participants().get(roles[int(victim) % len(roles)])
        if run.process.poll() is None:
            send(target, number)
        if victim == "coupler" and number == signal.SIGSTOP:
            time.sleep(1)
            send(target, signal.SIGCONT)
        struck = time.monotonic()
        ended = run.end()
        took = time.monotonic() - struck
        what = f"{name} {number.name} to {victim} at {moment:.2f}"
        if victim != "coupler":
            # Who has not been there yet, or is told to stop already, is not brought back.
            expect(ended in (status, 4), f"{what}: exit status {ended}: {run.said()}")
        if ended != status:
            deadline = time.monotonic() + 5
            while run.participants():
                expect(time.monotonic() < deadline, f"{what}: processes were left behind")
                time.sleep(0.05)
            run = Run(scene, out, *options, *keep, "--resume", limit=120 * PATIENCE)
            run.expect_end(status)
        expect_same(out, reference, os.environ.get("ESTUARY_FRAMES") != "0")
        return f"{what}: {'gone on by itself' if ended == status else f'exit {ended}, resumed'}, {took:.1f} s"

    for k in range(count):
        name = list(RANDOM_SCENES)[k % len(RANDOM_SCENES)]
        number = source.choice(SIGNALS)
        victim = source.choice(("coupler", "0", "1"))
        moment = source.random()
        yield f"random-{k}", (lambda place, a=(name, number, victim, moment): strike(place, *a))
