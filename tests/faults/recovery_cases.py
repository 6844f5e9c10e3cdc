"""Interrupted and gone on with: the same bits as in one piece."""
import json
import os
import signal
import time

from driver import PROGRAMS, Run, expect, expect_same, finished, summary

SERIAL = 'acceleration = "iqn-ils"\nrelaxation = 0.01'
COUPLINGS = {
    "iqn-ils": SERIAL,
    "iqn-ils-quadratic": SERIAL + '\npredictor = "quadratic"',
    "iqn-imvj": 'acceleration = "iqn-imvj"\nrelaxation = 0.01',
    "parallel": 'scheme = "parallel-implicit"\nacceleration = "iqn-ils"\nrelaxation = 0.5',
    # The first window is tried again with small steps, which then stay.
    "parallel-with-care": 'scheme = "parallel-implicit"\nacceleration = "iqn-ils"\nrelaxation = 0.01',
    "aitken": 'acceleration = "aitken"\nrelaxation = 0.01',
}


def control_c_and_resume(place, coupling, end=0.6):
    scene = place.tube(coupling=COUPLINGS[coupling], end=end)
    undisturbed = place.folder / "undisturbed"
    finished(scene, undisturbed)
    out = place.folder / "out"
    run = Run(scene, out)
    run.wait_for_window(17)
    os.kill(run.process.pid, signal.SIGINT)
    run.expect_end(130, "the same command with --resume goes on")
    at = run.window()
    expect(17 <= at < end / 0.01, f"ended after window {at}")
    finished(scene, out, "--resume", line=f"goes on after window {at}")
    expect_same(out, undisturbed)
    expect(summary(out)["windows"] == round(end / 0.01), "the summary lacks the windows before")


def case_control_c_then_resume(place):
    control_c_and_resume(place, "iqn-ils")


def case_control_c_every_acceleration(place):
    for coupling in COUPLINGS:
        if coupling != "iqn-ils":
            control_c_and_resume(type(place)(place.folder / coupling), coupling, 0.4)


def strike(place, coupling, role, number, window=23, limit=60):
    """Sends a signal to a participant in the middle of a run; the run goes on by itself."""
    scene = place.tube(coupling=COUPLINGS[coupling], end=0.6)
    undisturbed = place.folder / "undisturbed"
    finished(scene, undisturbed)
    out = place.folder / "out"
    run = Run(scene, out, limit=limit)
    run.wait_for_window(window)
    os.kill(run.participants()[role], number)
    run.expect_end(0, "goes on after window")
    expect_same(out, undisturbed)
    expect(summary(out)["recovery"]["relaunches"] == 1, "the summary does not tell of the loss")
    return f"recovered in {summary(out)['recovery']['recovery_s']:.2f} s"


def case_killed_participant(place):
    return strike(place, "iqn-ils", "fluid", signal.SIGKILL)


def case_stopped_participant(place):
    return strike(place, "parallel", "solid", signal.SIGSTOP)


def case_terminated_participant(place):
    return strike(place, "iqn-imvj", "solid", signal.SIGTERM)


def case_killed_before_the_first_checkpoint(place):
    return strike_from_the_beginning(place)


def strike_from_the_beginning(place):
    scene = place.tube(end=0.3, recovery="")
    undisturbed = place.folder / "undisturbed"
    finished(scene, undisturbed)
    expect(not (undisturbed / "checkpoint").exists(), "a short run writes no checkpoint unless asked")
    out = place.folder / "out"
    run = Run(scene, out)
    run.wait_for_window(11)
    os.kill(run.participants()["solid"], signal.SIGKILL)
    run.expect_end(0, "goes on from the beginning")
    expect_same(out, undisturbed)


def case_killed_coupler(place):
    scene = place.tube(end=0.6)
    undisturbed = place.folder / "undisturbed"
    finished(scene, undisturbed)
    out = place.folder / "out"
    run = Run(scene, out)
    run.wait_for_window(23)
    os.kill(run.process.pid, signal.SIGKILL)
    killed = time.monotonic()
    run.end()
    while run.participants():
        expect(time.monotonic() - killed < 5, "the solvers did not end within 5 s of the coupler")
        time.sleep(0.02)
    took = time.monotonic() - killed
    # Half a line at the end of each table, as a machine that goes down leaves it.
    for name in ("iterations.csv", "convergence.csv", "watch/flow.csv"):
        with open(out / name, "a") as file:
            file.write("99,1,0.5")
    finished(scene, out, "--resume", line="goes on after window 20")
    expect_same(out, undisturbed)
    return f"solvers ended after {took:.2f} s"


def case_killed_again_and_again(place):
    """More losses than relaunches allowed, but with checkpoints in between."""
    scene = place.tube(end=0.6, recovery="[recovery]\nevery = 5\nrelaunches = 1")
    undisturbed = place.folder / "undisturbed"
    finished(scene, undisturbed)
    out = place.folder / "out"
    run = Run(scene, out)
    for window, role in ((7, "fluid"), (18, "solid"), (31, "fluid"), (44, "solid")):
        run.wait_for_window(window)
        os.kill(run.participants()[role], signal.SIGKILL)
    run.expect_end(0)
    expect_same(out, undisturbed)
    return f"{summary(out)['recovery']['relaunches']} relaunches"


def case_no_relaunch_wanted(place):
    scene = place.tube(end=0.6, recovery="[recovery]\nevery = 10\nrelaunches = 0")
    undisturbed = place.folder / "undisturbed"
    finished(scene, undisturbed)
    out = place.folder / "out"
    run = Run(scene, out)
    run.wait_for_window(23)
    os.kill(run.participants()["fluid"], signal.SIGKILL)
    struck = time.monotonic()
    run.expect_end(4, "participant 'fluid' was lost at window")
    took = time.monotonic() - struck
    expect(took < 2, f"the end took {took:.1f} s")
    expect("saved after window 20" in run.said(), run.said())
    finished(scene, out, "--resume")
    expect_same(out, undisturbed)
    return f"ended after {took:.2f} s"


def case_a_crash_that_repeats_itself(place):
    scene = place.springs(fluid='misbehaviour = "crash"\nat_window = 7')
    run = finished(scene, place.folder / "out", status=4, line="participant 'fluid' was lost at window 7, iteration 1")
    expect(summary(run.out)["recovery"]["relaunches"] == 3, run.said())
    expect("saved after window 5" in run.said(), run.said())


def case_no_solution_then_resumed_with_other_settings(place):
    """Exit 3, then the same run with more iterations."""
    scene, out = interrupted_tube(place)
    undisturbed = place.folder / "undisturbed"
    finished(scene, undisturbed)
    run = finished(scene, out, "--resume", "--set", "coupling.max_iterations=3", "--set", "coupling.recover=false",
                   status=3, line="did not converge: window 21")
    expect("saved after window 20" in run.said(), run.said())
    finished(scene, out, "--resume")
    expect_same(out, undisturbed)


def case_longer_than_first_meant(place):
    short, long = place.tube("short.toml", end=0.3), place.tube("long.toml", end=0.5)
    undisturbed = place.folder / "undisturbed"
    finished(long, undisturbed)
    out = place.folder / "out"
    finished(short, out)
    finished(long, out, "--resume", line="goes on after window 20")
    expect_same(out, undisturbed)


def interrupted_tube(place, end=0.4):
    scene = place.tube(end=end)
    out = place.folder / "out"
    run = Run(scene, out)
    run.wait_for_window(23)
    os.kill(run.process.pid, signal.SIGKILL)
    run.end()
    time.sleep(1)
    return scene, out


def damage(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0x10
    path.write_bytes(content)


def case_damaged_checkpoint(place):
    scene, out = interrupted_tube(place)
    undisturbed = place.folder / "undisturbed"
    finished(scene, undisturbed)
    newest = max((out / "checkpoint").glob("set-*.json"), key=lambda path: json.loads(path.read_text())["window"])
    expect(json.loads(newest.read_text())["window"] == 20, "not what was expected")
    slot = newest.stem.split("-")[1]
    damage(out / "solid" / f"checkpoint-{slot}.h5")
    finished(scene, out, "--resume", line="goes on after window 10").said().index("is damaged")
    expect_same(out, undisturbed)
    # All of them: refused, and nothing is thrown away.
    scene, out = interrupted_tube(type(place)(place.folder / "all"))
    for path in (out / "checkpoint").glob("coupler-*.h5"):
        path.write_bytes(path.read_bytes()[:1000])
    before = (out / "iterations.csv").read_bytes()
    finished(scene, out, "--resume", status=2, line="no checkpoint in")
    expect((out / "iterations.csv").read_bytes() == before, "the tables of the run before were touched")


def case_lost_rows(place):
    """A table that does not reach as far as the newest checkpoint, after a machine's end."""
    scene, out = interrupted_tube(place)
    undisturbed = place.folder / "undisturbed"
    finished(scene, undisturbed)
    lines = (out / "watch" / "flow.csv").read_text().splitlines(keepends=True)
    (out / "watch" / "flow.csv").write_text("".join(lines[:16]))
    finished(scene, out, "--resume", line="goes on after window 10")
    expect_same(out, undisturbed)


def case_other_scene_other_version(place):
    scene, out = interrupted_tube(place)
    other = place.write("other.toml", scene.read_text().replace("window = 0.01", "window = 0.005"))
    finished(other, out, "--resume", status=2, line="belongs to another scene: it had 'window = 0.01'")
    for path in (out / "checkpoint").glob("set-*.json"):
        text = path.read_text()
        path.write_text(text.replace('"estuary": "', '"estuary": "9'))
    finished(scene, out, "--resume", status=2, line="was written by version 9")


def case_resume_without_a_checkpoint(place):
    scene = place.tube(end=0.05)
    finished(scene, place.folder / "out", "--resume", line="there is no checkpoint yet")


def case_two_runs_in_one_folder(place):
    scene = place.springs(fluid="seconds = 0.2")
    out = place.folder / "out"
    run = Run(scene, out)
    run.wait_for_window(1)
    second = subprocess_status(scene, out)
    expect(second[0] == 2 and "another run writes into" in second[1], str(second))
    os.kill(run.process.pid, signal.SIGINT)
    run.end()


def subprocess_status(scene, out):
    import subprocess
    done = subprocess.run([str(PROGRAMS / "coupler"), "run", str(scene), "--out", str(out)], capture_output=True,
                          text=True, timeout=20)
    return done.returncode, done.stderr


def connected(place, number):
    """A solver that was started by hand; returns its process and the scene that connects to it."""
    import subprocess
    address = f"ipc://{place.folder}/s"
    server = subprocess.Popen([str(PROGRAMS / "elastic-tube"), "--bind", address, "--folder",
                               str(place.folder / f"by-hand-{number}")],
                              stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    scene = place.tube(end=0.6)
    text = scene.read_text().replace(f'[solid]\nsolver = "{PROGRAMS}/elastic-tube"',
                                     f'[solid]\nconnect = "{address}"')
    return server, place.write("connect.toml", text)


def case_who_was_not_launched_is_kept(place):
    """The loss of one participant leaves the one that was started by hand in place."""
    undisturbed = place.folder / "undisturbed"
    finished(place.tube(end=0.6), undisturbed)
    server, scene = connected(place, 1)
    try:
        for window, out in ((4, place.folder / "early"), (23, place.folder / "late")):
            if server.poll() is not None:
                server, scene = connected(place, window)
            run = Run(scene, out)
            run.wait_for_window(window)
            os.kill(run.participants()["fluid"], signal.SIGKILL)
            run.expect_end(0, "goes on after window")
            expect_same(out, undisturbed)
            expect("solid: is still there" in run.log(), run.log())
            server.wait(5)
    finally:
        server.kill()


def case_who_does_not_come_back(place):
    undisturbed = place.folder / "undisturbed"
    finished(place.tube(end=0.6), undisturbed)
    server, scene = connected(place, 1)
    scene.write_text(scene.read_text().replace("[coupling]", "[coupling]\nconnect_timeout = 1.0"))
    out = place.folder / "out"
    run = Run(scene, out)
    run.wait_for_window(23)
    server.kill()
    server.wait()
    struck = time.monotonic()
    run.expect_end(4, "participant 'solid' did not answer")
    took = time.monotonic() - struck
    expect("saved after window 20" in run.said(), run.said())
    server, scene_again = connected(place, 1)
    try:
        finished(scene_again, out, "--resume", line="goes on after window 20")
        expect_same(out, undisturbed)
    finally:
        server.kill()
    return f"given up after {took:.1f} s"


def case_who_comes_back_late(place):
    """Another process takes the place of one that was started by hand."""
    undisturbed = place.folder / "undisturbed"
    finished(place.tube(end=0.6), undisturbed)
    server, scene = connected(place, 1)
    out = place.folder / "out"
    run = Run(scene, out)
    run.wait_for_window(23)
    server.kill()
    server.wait()
    server, _ = connected(place, 1)
    try:
        run.expect_end(0, "goes on after window 20")
        expect_same(out, undisturbed)
    finally:
        server.kill()
