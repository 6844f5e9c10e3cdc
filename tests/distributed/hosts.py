"""Hosts of a network on one machine: each is a set of namespaces of its own (network, mounts, host name, processes) with its own
address, its own sshd and its own home folder; they share the programs, read-only, and no other files.

Wants root and a kernel that has namespaces, veth and bridges.
"""
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import time

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "faults"))
from driver import PROGRAMS, ROOT, Failure, Run, expect  # noqa: E402  the folder has to be on the path first

SSH_CONFIG = """Host *
  StrictHostKeyChecking yes
  UserKnownHostsFile /root/.ssh/known_hosts
  IdentityFile /root/.ssh/id_ed25519
  ConnectTimeout 10
"""
SSHD_CONFIG = """Port 22
ListenAddress {address}
HostKey /root/.sshd/host_key
AuthorizedKeysFile /root/.ssh/authorized_keys
PidFile none
StrictModes no
UsePAM no
PasswordAuthentication no
PermitRootLogin yes
PrintMotd no
MaxStartups 100
"""
# Becomes a host: everything after this happens where the others see nothing of it.
BIRTH = """set -e
mount --make-rprivate /
mount -t tmpfs tmpfs /mnt
mkdir /mnt/programs /mnt/configs
mount --bind {programs} /mnt/programs
mount -o remount,ro,bind /mnt/programs
mount --bind {configs} /mnt/configs
mount -o remount,ro,bind /mnt/configs
mount --bind {home} /root
mount --bind {home}/etc-hosts /etc/hosts
mount -t tmpfs tmpfs /run
mkdir /run/sshd
mount -t tmpfs tmpfs /tmp
mount -t tmpfs tmpfs {hidden} 2>/dev/null || true
hostname {name}
ip link set lo up
touch /root/born
exec sleep infinity
"""


def command(*words, **options):
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, **options)
    if done.returncode:
        raise Failure(f"{' '.join(map(str, words))} ended with status {done.returncode}: {done.stdout}{done.stderr}")
    return done.stdout


def why_not():
    """What this machine lacks to be several; nothing when it lacks nothing."""
    if os.geteuid() != 0:
        return "only root may make network namespaces"
    for program in ("ip", "unshare", "nsenter", "ssh", "ssh-keygen", "/usr/sbin/sshd"):
        if shutil.which(program) is None:
            return f"there is no {program} (packages of packages-distributed.txt)"
    tried = subprocess.run(["unshare", "--mount", "--net", "--uts", "--pid", "--fork", "--mount-proc", "sh", "-c",
                            "mount -t tmpfs tmpfs /mnt && ip link add probe type veth peer name probed && "
                            "ip link add bridge type bridge"], capture_output=True, text=True)
    return f"no namespaces here: {tried.stderr.strip()}" if tried.returncode else None


class Host:
    def __init__(self, network, name, number):
        self.network, self.name = network, name
        self.address = f"10.77.{network.number}.{number}"
        self.home = network.folder / name
        self.link = f"es{network.number}h{number}"
        self.process = None
        (self.home / ".ssh").mkdir(parents=True)
        (self.home / ".sshd").mkdir()
        for key in (self.home / ".ssh/id_ed25519", self.home / ".sshd/host_key"):
            command("ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-C", name, "-f", key)

    def public(self, file):
        return (self.home / file).read_text().strip()

    def begin(self):
        (self.home / "born").unlink(missing_ok=True)
        script = BIRTH.format(programs=PROGRAMS, configs=ROOT / "configs", home=self.home, name=self.name,
                              hidden=self.network.folder)
        self.errors = open(self.network.folder / f"{self.name}.txt", "a")
        self.process = subprocess.Popen(
            ["unshare", "--mount", "--net", "--uts", "--pid", "--fork", "--kill-child", "--mount-proc", "sh", "-c", script],
            stdin=subprocess.DEVNULL, stdout=self.errors, stderr=self.errors, start_new_session=True)
        deadline = time.monotonic() + 10
        while not (self.home / "born").exists():
            expect(self.process.poll() is None and time.monotonic() < deadline,
                   f"host {self.name} was not made: {(self.network.folder / (self.name + '.txt')).read_text()}")
            time.sleep(0.02)
        children = pathlib.Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children").read_text().split()
        self.first = int(children[0])  # process 1 of the host
        command("ip", "link", "add", self.link, "type", "veth", "peer", "name", "eth0", "netns", str(self.first))
        # The same card again after a power failure: who knew it need not ask anew.
        self.run("ip", "link", "set", "eth0", "address", "02:77:" + ":".join(f"{int(part):02x}" for part in self.address.split(".")))
        command("ip", "link", "set", self.link, "master", self.network.bridge, "up")
        self.run("ip", "addr", "add", f"{self.address}/24", "dev", "eth0")
        self.run("ip", "link", "set", "eth0", "up")
        (self.home / ".sshd/config").write_text(SSHD_CONFIG.format(address=self.address))
        self.run("/usr/sbin/sshd", "-f", "/root/.sshd/config", "-E", "/root/.sshd/log")

    def enter(self, *words):
        """The words of a command on this host."""
        return ["nsenter", "--target", str(self.first), "--mount", "--net", "--uts", "--pid", "--wd=/root", "env", "HOME=/root",
                *(str(word) for word in words)]

    def run(self, *words):
        return command(*self.enter(*words))

    def end(self):
        """At once and with everything on it, as when the power fails: nobody says goodbye."""
        if self.process is None:
            return
        # Without the link first, its processes' sockets would still be closed properly.
        subprocess.run(["ip", "link", "del", self.link], capture_output=True)
        os.kill(self.first, signal.SIGKILL)
        self.process.wait()
        self.process = None

    def cut(self, yes=True):
        """Pulls the cable out, or puts it in again."""
        command("ip", "link", "set", self.link, "down" if yes else "up")

    def processes(self, name):
        """Numbers of the host's processes of a program; not of those that only wait for process 1, a mere sleep, to bury them."""
        found = []
        namespace = os.readlink(f"/proc/{self.first}/ns/pid")
        for entry in pathlib.Path("/proc").iterdir():
            try:
                if entry.name.isdigit() and (entry / "comm").read_text().strip() == name[:15] \
                        and os.readlink(entry / "ns/pid") == namespace and "State:\tZ" not in (entry / "status").read_text():
                    found.append(int(entry.name))
            except OSError:
                continue
        return found


class Network:
    """`with Network(folder, "here", "there") as (here, there): ...`"""

    count = 0

    def __init__(self, folder, *names):
        Network.count += 1
        self.number = (os.getpid() + Network.count) % 250 + 1
        self.folder = pathlib.Path(folder)
        self.folder.mkdir(parents=True)
        self.bridge = f"es{self.number}bridge"
        self.hosts = [Host(self, name, number) for number, name in enumerate(names, 1)]
        table = "127.0.0.1 localhost\n" + "".join(f"{host.address} {host.name}\n" for host in self.hosts)
        keys = "".join(host.public(".ssh/id_ed25519.pub") + "\n" for host in self.hosts)
        known = "".join(f"{host.name},{host.address} {host.public('.sshd/host_key.pub')}\n" for host in self.hosts)
        for host in self.hosts:
            (host.home / "etc-hosts").write_text(table)
            (host.home / ".ssh/authorized_keys").write_text(keys)
            (host.home / ".ssh/known_hosts").write_text(known)
            (host.home / ".ssh/config").write_text(SSH_CONFIG)

    def __enter__(self):
        command("ip", "link", "add", self.bridge, "type", "bridge")
        command("ip", "link", "set", self.bridge, "up")
        try:
            for host in self.hosts:
                host.begin()
        except BaseException:
            self.__exit__()
            raise
        return self.hosts

    def __exit__(self, *_):
        for host in self.hosts:
            host.end()
        subprocess.run(["ip", "link", "del", self.bridge], capture_output=True)


class HostRun(Run):
    """A run whose coupler is on one of the hosts; `out` is a folder of that host's home."""

    def __init__(self, host, scene, out, *options, limit=120):
        super().__init__(f"/root/{scene}", host.home / out, *options, limit=limit, prefix=host.enter(),
                         program="/mnt/programs/coupler", out_there=f"/root/{out}")
        self.host = host

    def coupler(self):
        """Number of the coupler's process: nsenter waits for it."""
        return self.host.processes("coupler")[0]
