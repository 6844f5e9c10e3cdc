"""Clocks that jump, and two runs at once."""
import os
import pathlib
import time

from driver import Run, expect, expect_same, finished, summary

FAKETIME = pathlib.Path("/usr/lib/x86_64-linux-gnu/faketime/libfaketimeMT.so.1")


def case_clock_jumps(place):
    """A day ahead, then two back, for everyone: no deadline is missed and none waited for, the bits are the same."""
    if not FAKETIME.exists():
        return "NOT TESTED: there is no libfaketime (package faketime)"
    reference = place.folder / "undisturbed"
    finished(place.springs(end=3.0, fluid="seconds = 0.05"), reference)
    clock = place.write("clock", "+0d")
    os.environ.update(LD_PRELOAD=str(FAKETIME), FAKETIME_TIMESTAMP_FILE=str(clock), FAKETIME_NO_CACHE="1",
                      FAKETIME_DONT_FAKE_MONOTONIC="1", DONT_FAKE_MONOTONIC="1")
    try:
        out = place.folder / "out"
        run = Run(place.springs("jumps.toml", end=3.0, fluid="seconds = 0.05"), out)
    finally:
        for name in ("LD_PRELOAD", "FAKETIME_TIMESTAMP_FILE", "FAKETIME_NO_CACHE", "FAKETIME_DONT_FAKE_MONOTONIC", "DONT_FAKE_MONOTONIC"):
            del os.environ[name]
    run.wait_for_window(8)
    clock.write_text("+1d")
    run.wait_for_window(18)
    clock.write_text("-1d")
    begin = time.monotonic()
    run.expect_end(0)
    expect(time.monotonic() - begin < 20, "it waited")
    days = {line[:10] for line in run.log().splitlines() if line[:2] == "20"}
    expect(len(days) >= 3, f"the clock did not jump: {days}")
    expect_same(out, reference)
    figures = summary(out)
    expect(figures["recovery"]["relaunches"] == 0 and 0 < figures["wall_s"] < 30, str(figures["recovery"]))
    return f"days in the log: {', '.join(sorted(days))}; wall time {figures['wall_s']:.1f} s"


def case_two_runs_at_once(place):
    """Of the same scene on one machine, each in its own folder: neither hears of the other."""
    scene = place.tube(end=0.4)
    reference = place.folder / "undisturbed"
    finished(scene, reference)
    runs = [Run(scene, place.folder / f"out-{number}") for number in range(2)]
    for run in runs:
        run.wait_for_window(5)
    expect(all(run.process.poll() is None for run in runs), "they did not run at the same time")
    for run in runs:
        run.expect_end(0)
        expect_same(run.out, reference)
