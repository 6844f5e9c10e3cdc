"""Networks between coupler and participant that are slow, stand still or break: the same results, later; or an end that keeps
what was computed. Over loopback, so that every machine can run them."""
import socket
import subprocess
import time

from driver import PROGRAMS, ROOT, Run, expect, expect_same, finished, summary
from relay import Relay
from security_cases import free_port, keys


class ByHand:
    """A solid, the tube's wall where not told otherwise, started by hand behind a relay, with keys."""

    def __init__(self, place, name="by-hand", port=None, program="elastic-tube"):
        self.port = port or free_port()
        self.log = place.folder / f"{name}.log"
        pair = place.folder / "server"
        if not pair.with_suffix(".key").exists():
            keys(place, "server", "coupler")
        self.words = [str(PROGRAMS / program), "--bind", f"tcp://127.0.0.1:{self.port}", "--folder",
                      str(place.folder / name), "--key", f"{pair}.key", "--allow", f"{place.folder}/coupler.pub"]
        self.file = open(self.log, "a")
        self.process = subprocess.Popen(self.words, stdout=self.file, stderr=self.file)
        self.relay = Relay(("127.0.0.1", self.port))
        # The relay would take a call before anyone is there to answer it.
        deadline = time.monotonic() + 30
        while True:
            with socket.socket() as call:
                if call.connect_ex(("127.0.0.1", self.port)) == 0:
                    break
            expect(self.process.poll() is None and time.monotonic() < deadline, f"{program} does not serve: {self.log.read_text()}")
            time.sleep(0.05)

    def __enter__(self):
        self.relay.__enter__()
        return self

    def __exit__(self, *_):
        self.relay.__exit__()
        self.process.kill()
        self.process.wait()

    def scene(self, place, end, patience=5.0, more=""):
        """A tube whose wall is reached through the relay."""
        text = place.tube(end=end).read_text()
        return self.reached(place, text.replace(f'[solid]\nsolver = "{PROGRAMS}/elastic-tube"', "[solid]"), patience, more)

    def reached(self, place, text, patience=5.0, more=""):
        """A scene whose solid it is."""
        text = text.replace("[solid]", f'[solid]\nconnect = "tcp://127.0.0.1:{self.relay.port}"', 1)
        text += (f'[hosts.coupler]\nkey = "{place.folder}/coupler.key"\n'
                 f'[hosts.solid]\npublic_key = "{place.folder}/server.pub"\nlost_after = {patience}\n')
        return place.write("relayed.toml", text.replace("[coupling]", f"[coupling]\n{more}", 1))


def undisturbed(place, end):
    out = place.folder / "undisturbed"
    finished(place.tube(end=end), out)
    return out


def slowdown(out, reference):
    """How much slower, and what the run itself says of where the time went."""
    fast, slow = summary(reference), summary(out)
    exchange = slow["participants"]["solid"]["exchange_s"]
    expect(exchange > 0.5 * (slow["wall_s"] - fast["wall_s"]), "the run does not say that it waited for the network")
    return f"{fast['wall_s']:.1f} s without, {slow['wall_s']:.1f} s ({exchange:.1f} s of it exchange with the solid)"


def case_latency(place, end=0.1):
    """50 ms each way."""
    reference = undisturbed(place, end)
    with ByHand(place) as solid:
        solid.relay.delay = 0.05
        out = place.folder / "out"
        finished(solid.scene(place, end), out, limit=120)
        expect_same(out, reference, elsewhere={"solid": place.folder / "by-hand"})
        expect(solid.relay.connections == 1, "the connection was not kept")
        return slowdown(out, reference)


def case_narrow_line(place, end=0.1):
    """100 kB/s: a message of a hundred nodes takes 32 ms."""
    reference = undisturbed(place, end)
    with ByHand(place) as solid:
        solid.relay.bandwidth = 1e5
        out = place.folder / "out"
        finished(solid.scene(place, end), out, limit=120)
        expect_same(out, reference, elsewhere={"solid": place.folder / "by-hand"})
        return slowdown(out, reference)


def case_stalls(place, end=0.4):
    """Nothing passes for three seconds, twice."""
    reference = undisturbed(place, end)
    with ByHand(place) as solid:
        solid.relay.delay = 0.001
        out = place.folder / "out"
        run = Run(solid.scene(place, end), out, limit=120)
        for window in (5, 15):
            run.wait_for_window(window)
            solid.relay.still = True
            time.sleep(3)
            solid.relay.still = False
        run.expect_end(0)
        expect_same(out, reference, elsewhere={"solid": place.folder / "by-hand"})
        expect(summary(out)["recovery"]["relaunches"] == 0, f"a stall was taken for a loss: {run.said()}")
        return slowdown(out, reference)


def case_cut_and_mended(place, end=0.4):
    """Connections that are cut are made anew, and nothing is computed twice: whether a request or a reply was lost with it."""
    reference = undisturbed(place, end)
    with ByHand(place) as solid:
        solid.relay.delay = 0.002
        out = place.folder / "out"
        run = Run(solid.scene(place, end), out, limit=120)
        for window in range(2, 36, 4):
            run.wait_for_window(window)
            solid.relay.cut(for_good=window % 8 == 2)
            if window % 8 == 2:
                time.sleep(1.0)
                solid.relay.mend()
        run.expect_end(0)
        expect_same(out, reference, elsewhere={"solid": place.folder / "by-hand"})
        expect(summary(out)["recovery"]["relaunches"] == 0, f"a cut was taken for a loss: {run.said()}")
        return f"{solid.relay.connections - 1} times cut; {slowdown(out, reference)}"


def case_cut_before_a_participant_in_python(place):
    """Its kit keeps the run for `--reconnect-timeout` as well."""
    text = (ROOT / "configs/fsi/viv-cylinder.toml").read_text().split("[[check]]")[0]
    for old, new in (("spacing = 0.0625", "spacing = 0.25"), ("time_step = 0.005", "time_step = 0.025"), ("end_time = 100.0", "end_time = 2.0"),
                     ("[-16.0, -16.0]", "[-4.0, -4.0]"), ("[40.0, 32.0]", "[12.0, 8.0]"), ("from_time = 70.0", "")):
        expect(old in text, f"the scene has no '{old}' to make smaller")
        text = text.replace(old, new)
    text = text.replace("[fluid]", "[fluid]\nthreads = 1", 1)
    reference, out = place.folder / "undisturbed", place.folder / "out"
    finished(place.write("alone.toml", text.replace("[solid]", f'[solid]\nsolver = "{PROGRAMS}/spring-cylinder"', 1)), reference)
    with ByHand(place, program="spring-cylinder") as solid:
        solid.relay.delay = 0.002
        run = Run(solid.reached(place, text), out, limit=120)
        for window in (5, 15, 25):
            run.wait_for_window(window)
            solid.relay.cut(for_good=window == 15)
            if window == 15:
                time.sleep(1.0)
                solid.relay.mend()
        run.expect_end(0)
        expect_same(out, reference, frames=False)
        expect(solid.relay.connections >= 4, f"only {solid.relay.connections - 1} of three cuts were met")
        expect(summary(out)["recovery"]["relaunches"] == 0, f"a cut was taken for a loss: {run.said()}")
        return f"{solid.relay.connections - 1} times cut; {slowdown(out, reference)}"


def case_cut_for_good(place, end=0.4):
    """A line that does not come back: exit 4, everything saved, gone on with once it is there again."""
    reference = undisturbed(place, end)
    with ByHand(place) as solid:
        out = place.folder / "out"
        scene = solid.scene(place, end, 2.0, "connect_timeout = 3.0")
        run = Run(scene, out, limit=60)
        run.wait_for_window(23)
        solid.relay.cut(for_good=True)
        struck = time.monotonic()
        run.expect_end(4, "participant 'solid'")
        took = time.monotonic() - struck
        expect("saved after window 20" in run.said(), run.said())
        ended = solid.process.wait(10)
        solid_took = time.monotonic() - struck
        expect(ended == 1 and "is gone" in solid.log.read_text(), solid.log.read_text())
    with ByHand(place) as solid:
        finished(solid.scene(place, end), out, "--resume", line="goes on after window 20")
        expect_same(out, reference, elsewhere={"solid": place.folder / "by-hand"})
    return f"ended after {took:.1f} s, the participant beyond the cut after {solid_took:.1f} s"


def case_still_for_too_long(place, end=0.4):
    """A stall longer than `lost_after`: the one beyond it is given up, another takes its place, the same bits."""
    reference = undisturbed(place, end)
    with ByHand(place) as solid:
        out = place.folder / "out"
        run = Run(solid.scene(place, end, 2.0), out, limit=60)
        run.wait_for_window(23)
        solid.relay.still = True
        time.sleep(4)
        solid.relay.still = False
        run.expect_end(0, "goes on after window 20")
        expect_same(out, reference, elsewhere={"solid": place.folder / "by-hand"})
        return f"recovered in {summary(out)['recovery']['recovery_s']:.1f} s"
