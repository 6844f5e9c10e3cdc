"""Runs over two and three hosts, each with its own address and its own files: the same bits as on one."""
import os
import shutil
import signal
import subprocess
import time

from hosts import ROOT, HostRun, Network, Run, expect
from driver import expect_same, summary

PORT = 5555
DEFAULT_SOLVERS = {"fluid": "fluid-lbm", "solid": "solid-sph", "grains": "grains-dem"}


def local_run(place, scene, *options):
    """The same scene on this machine, without any network."""
    out = place.folder / "local"
    run = Run(ROOT / "configs" / f"{scene}.toml", out, "--no-report", *options, limit=300)
    status = run.end()
    expect(status in (0, 1), run.said())
    return out, status


def keys(host, name):
    """A pair in the host's home: NAME.key stays there, NAME.pub may be given away."""
    host.run("/mnt/programs/coupler", "keys", f"/root/{name}")


def write_scene(place, coupler, scene, where, more="", tables=()):
    """The scene with some participants on other hosts, by ssh and with keys."""
    text = (ROOT / "configs" / f"{scene}.toml").read_text()
    text += '\n[hosts.coupler]\nkey = "/root/coupler.key"\n'
    keys(coupler, "coupler")
    for role, host in where.items():
        keys(host, role)
        shutil.copy(coupler.home / "coupler.pub", host.home / "coupler.pub")
        shutil.copy(host.home / f"{role}.pub", coupler.home / f"{role}.pub")
        text += (f'[hosts.{role}]\nlaunch = "ssh"\nhost = "{host.name}"\naddress = "tcp://{host.address}:{PORT}"\n'
                 f'folder = "/root/run/{role}"\nkey = "/root/{role}.key"\nallow = "/root/coupler.pub"\n'
                 f'public_key = "/root/{role}.pub"\n')
    (coupler.home / "scene.toml").write_text(text + more)
    options = []
    for role in where:
        options += ["--set", f"{role}.solver=/mnt/programs/{DEFAULT_SOLVERS[role]}"]
    return options


def expect_nothing_left(hosts):
    deadline = time.monotonic() + 6
    names = DEFAULT_SOLVERS.values()
    while any(host.process and host.processes(name) for host in hosts for name in names):
        expect(time.monotonic() < deadline, "solvers were left behind on a host")
        time.sleep(0.05)


def expect_no_solvers(folder):
    """On this machine, below a folder."""
    deadline = time.monotonic() + 10
    while subprocess.run(["pgrep", "-f", f"--folder {folder}/"], capture_output=True).returncode == 0:
        expect(time.monotonic() < deadline, "solvers were left behind")
        time.sleep(0.05)


def distributed(place, scene, options, names, where):
    """A scene over hosts of these names; `where`: which role is on which of them, the coupler is on the first."""
    reference, status = local_run(place, scene, *options)
    with Network(place.folder / "net", *names) as hosts:
        by_name = dict(zip(names, hosts))
        placed = {role: by_name[name] for role, name in where.items()}
        launched = write_scene(place, hosts[0], scene, placed)
        run = HostRun(hosts[0], "scene.toml", "out", "--no-report", *options, *launched)
        run.expect_end(status)
        expect_nothing_left(hosts)
        elsewhere = {role: host.home / "run" / role for role, host in placed.items()}
        files = expect_same(run.out, reference, elsewhere=elsewhere)
        for role, host in placed.items():
            expect((run.out / "log" / f"{role}.log").stat().st_size > 0, f"no log of {role} came back")
            index = summary(run.out)["participants"][role]
            expect(index["folder"] == f"/root/run/{role}" and index["host"] == host.name, str(index))
            expect(not list((run.out / role).glob("*.hdf")), "frames of another host lie here")
        for host in hosts:
            for secret in host.home.glob("*.key"):
                word = next(line.split('"')[1] for line in secret.read_text().splitlines() if line.startswith("secret"))
                for path in run.out.rglob("*"):
                    expect(not path.is_file() or word.encode() not in path.read_bytes(), f"a secret is in {path}")
        return f"{files} files of fields; {summary(reference)['wall_s']:.1f} s on one host, {summary(run.out)['wall_s']:.1f} s"


FIN = ("--set", "fluid.spacing=0.02", "--set", "fluid.threads=1", "--set", "solid.threads=1")
DISC = ("--set", "coupling.end_time=0.02", "--set", "fluid.threads=1", "--set", "grains.threads=1")
GATE = ("--set", "coupling.end_time=0.01", "--set", "fluid.threads=1", "--set", "solid.threads=1", "--set", "grains.threads=1")


def case_fin_on_two_hosts(place):
    return distributed(place, "fsi/elastic-fin", FIN, ("here", "there"), {"solid": "there"})


def case_grains_on_two_hosts(place):
    return distributed(place, "grains/settling-disc", DISC, ("here", "there"), {"grains": "there"})


def case_gate_on_three_hosts(place):
    return distributed(place, "three-way/elastic-gate", GATE, ("here", "there", "yonder"),
                       {"solid": "there", "grains": "yonder"})


def disturbed(place, strike, goes_on=True, options=(), windows=200):
    """The settling disc with the grains on another host; `strike(here, there, run)` at about half of its windows. Either the run
    goes on by itself, or it is gone on with once everybody is there again."""
    options = ("--set", f"coupling.end_time={windows * 1e-4:g}", "--set", "fluid.threads=1", "--set", "grains.threads=1",
               "--set", "recovery.every=20", *options)
    reference, done = local_run(place, "grains/settling-disc", *options)
    with Network(place.folder / "net", "here", "there") as (here, there):
        launched = write_scene(place, here, "grains/settling-disc", {"grains": there})
        words = ("--no-report", *options, *launched)
        run = HostRun(here, "scene.toml", "out", *words)
        run.done = done  # a part of the scene need not fulfil its checks
        run.wait_for_window(windows // 2)
        note = strike(here, there, run)
        expect_nothing_left((here, there))
        if not goes_on:
            for host in (here, there):
                if host.process is None:
                    host.begin()
                host.cut(False)
            run = HostRun(here, "scene.toml", "out", *words, "--resume")
            run.expect_end(done, "goes on after window")
        expect_same(run.out, reference, elsewhere={"grains": there.home / "run" / "grains"})
        return note


def case_killed_on_another_host(place):
    def strike(here, there, run):
        os.kill(there.processes("grains-dem")[0], signal.SIGKILL)
        run.expect_end(run.done, "goes on after window")
        return f"recovered in {summary(run.out)['recovery']['recovery_s']:.1f} s"
    return disturbed(place, strike)


def case_stopped_on_another_host(place):
    def strike(here, there, run):
        stopped = there.processes("grains-dem")[0]
        os.kill(stopped, signal.SIGSTOP)
        struck = time.monotonic()
        while "goes on after window" not in run.said():
            expect(time.monotonic() - struck < 30, run.said())
            time.sleep(0.05)
        took = time.monotonic() - struck
        run.expect_end(run.done)
        return f"noticed after {took:.1f} s, recovered in {summary(run.out)['recovery']['recovery_s']:.1f} s"
    return disturbed(place, strike)


def case_cable_out_for_three_seconds(place):
    """The same connections go on afterwards."""
    def strike(here, there, run):
        there.cut()
        time.sleep(3)
        there.cut(False)
        run.expect_end(run.done)
        expect(summary(run.out)["recovery"]["relaunches"] == 0, run.said())
    return disturbed(place, strike)


def case_cable_out_for_twelve_seconds(place):
    """Longer than a silence may last: the one beyond ends by itself, is launched anew once ssh comes through again."""
    def strike(here, there, run):
        there.cut()
        time.sleep(12)
        there.cut(False)
        run.expect_end(run.done, "goes on after window")
        return f"recovered in {summary(run.out)['recovery']['recovery_s']:.1f} s"
    return disturbed(place, strike)


def case_host_that_does_not_come_back(place):
    """The power fails on another host: exit 4, saved; later it is there again, and the run is gone on with."""
    def strike(here, there, run):
        there.end()
        struck = time.monotonic()
        run.expect_end(4, "participant 'grains'")
        return f"ended after {time.monotonic() - struck:.1f} s (connect_timeout 6 s)"
    return disturbed(place, strike, False, options=("--set", "coupling.connect_timeout=6"))


def case_power_fails_where_the_coupler_is(place):
    """Whoever is on other hosts ends by itself."""
    def strike(here, there, run):
        here.end()
        struck = time.monotonic()
        run.end()
        while there.processes("grains-dem"):
            expect(time.monotonic() - struck < 15, "the participant on the other host does not end")
            time.sleep(0.05)
        return f"the other host's participant ended after {time.monotonic() - struck:.1f} s"
    return disturbed(place, strike, False)


def case_interrupted_with_another_host(place):
    def strike(here, there, run):
        os.kill(run.coupler(), signal.SIGINT)
        struck = time.monotonic()
        run.expect_end(130)
        return f"ended after {time.monotonic() - struck:.1f} s"
    return disturbed(place, strike, False)


def case_ssh_that_is_refused(place):
    """What ssh says comes back to the person."""
    with Network(place.folder / "net", "here", "there") as (here, there):
        launched = write_scene(place, here, "grains/settling-disc", {"grains": there})
        (there.home / ".ssh/authorized_keys").write_text("")
        HostRun(here, "scene.toml", "out", *launched, limit=20).expect_end(4, "Permission denied")
        (here.home / ".ssh/known_hosts").write_text("")
        HostRun(here, "scene.toml", "out", *launched, limit=20).expect_end(4, "Host key verification failed")


def case_programs_that_are_not_there(place):
    with Network(place.folder / "net", "here", "there") as (here, there):
        write_scene(place, here, "grains/settling-disc", {"grains": there})
        HostRun(here, "scene.toml", "out", "--set", "grains.solver=no-such-program", limit=20).expect_end(
            4, "no-such-program")


def case_addresses_without_keys(place):
    """Nothing is launched; with `insecure = true` it runs, and says so."""
    with Network(place.folder / "net", "here", "there") as (here, there):
        launched = write_scene(place, here, "grains/settling-disc", {"grains": there})
        text = (here.home / "scene.toml").read_text()
        bare = "\n".join(line for line in text.splitlines()
                         if not line.startswith(("[hosts.coupler]", "key =", "allow =", "public_key =")))
        (here.home / "bare.toml").write_text(bare)
        HostRun(here, "bare.toml", "out", *launched, limit=20).expect_end(2, "which other machines reach")
        expect(not (there.home / "run").exists(), "something was launched")
        (here.home / "bare.toml").write_text("insecure = true\n" + bare)
        HostRun(here, "bare.toml", "out", *launched, "--no-report", "--set", "coupling.end_time=0.002", limit=30).expect_end(
            1, "INSECURE")
