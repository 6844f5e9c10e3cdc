"""Runs over two and three hosts, each with its own address and its own files: the same bits as on one."""
import os
import pathlib
import shutil
import signal
import time

from hosts import PROGRAMS, ROOT, HostRun, Network, Run, expect
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
