"""Addresses that other machines reach: keys, who is not let in, what is never written down."""
import contextlib
import os
import pathlib
import pty
import re
import socket
import stat
import subprocess
import time

from driver import PROGRAMS, ROOT, Run, expect, expect_same, finished

COUPLER = str(PROGRAMS / "coupler")


def command(*words, limit=20):
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, timeout=limit, cwd=ROOT)
    return done.returncode, done.stdout + done.stderr


def keys(place, *names):
    for name in names:
        status, text = command(COUPLER, "keys", place.folder / name)
        expect(status == 0, text)
    return [place.folder / name for name in names]


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def own_address():
    """An address of this machine that others may reach; None where there is none."""
    for word in command("hostname", "-I")[1].split():
        if "." in word:
            return word
    return None


class Server:
    """An elastic tube's wall that was started by hand."""

    def __init__(self, place, name, address, *options):
        self.log = place.folder / f"{name}.log"
        self.file = open(self.log, "w")
        self.process = subprocess.Popen([str(PROGRAMS / "elastic-tube"), "--bind", address, "--folder",
                                         str(place.folder / name), *options], stdout=self.file, stderr=self.file)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()

    def wait_for(self, line, limit=10):
        deadline = time.monotonic() + limit
        while line not in self.log.read_text():
            expect(time.monotonic() < deadline, f"'{line}' is not in the log:\n{self.log.read_text()}")
            time.sleep(0.05)


def scene_at(place, address, hosts, top="", name="remote.toml"):
    text = place.tube(end=0.2).read_text()
    text = text.replace(f'[solid]\nsolver = "{PROGRAMS}/elastic-tube"', f'[solid]\nconnect = "{address}"')
    text = text.replace("[coupling]", f"{top}\n[coupling]\nconnect_timeout = 3.0", 1)
    return place.write(name, text + hosts)


def hosts(coupler, server):
    return f'[hosts.coupler]\nkey = "{coupler}.key"\n[hosts.solid]\npublic_key = "{server}.pub"\n'


def case_keys_let_in_and_keep_out(place):
    address = own_address()
    if address is None:
        return "NOT TESTED: this machine has no address besides loopback"
    undisturbed = place.folder / "undisturbed"
    finished(place.tube(end=0.2), undisturbed)
    server, coupler, stranger = keys(place, "server", "coupler", "stranger")
    mode = stat.S_IMODE(pathlib.Path(f"{server}.key").stat().st_mode)
    expect(mode == 0o600, f"the secret file has mode {mode:o}")
    expect(command(COUPLER, "keys", server)[0] == 2, "a key was written over")
    endpoint = f"tcp://{address}:{free_port()}"
    out = place.folder / "out"
    with Server(place, "by-hand", endpoint, "--key", f"{server}.key", "--allow", f"{coupler}.pub") as one:
        one.wait_for("elastic-tube 1 at")
        # Without keys in the scene nothing is launched.
        finished(scene_at(place, endpoint, ""), out, status=2, line="which other machines reach")
        # Without a key, with another than those on the list, with another than the server's, with noise.
        finished(scene_at(place, endpoint, "", "insecure = true"), out, status=4, line="INSECURE")
        began = time.monotonic()
        finished(scene_at(place, endpoint, hosts(stranger, server)), out, status=4, line="is not among those")
        refused_after = time.monotonic() - began
        finished(scene_at(place, endpoint, hosts(coupler, stranger)), out, status=4, line="holds another key than public_key says")
        with socket.create_connection((address, int(endpoint.rsplit(":", 1)[1]))) as noise:
            noise.sendall(os.urandom(4096))
            noise.settimeout(2)
            try:
                while noise.recv(4096):
                    pass
            except OSError:
                pass
        # Each is counted as long as they are few.
        one.wait_for("(3 so far)")
        counts = [int(count) for count in re.findall(r"refused a connection: .* \((\d+) so far\)", one.log.read_text())]
        expect(counts[:3] == [1, 2, 3] and counts == sorted(set(counts)), f"refused connections are counted as {counts}")
        expect("refused a request" not in one.log.read_text(), "a stranger's message was read")
        status, text = command(COUPLER, "ping", endpoint, "--key", f"{coupler}.key", "--server-key", f"{server}.pub")
        expect(status == 0 and "free" in text, text)
        # And who is on the list is served as ever. Whoever looks at the processes learns no secret.
        run = Run(scene_at(place, endpoint, hosts(coupler, server)), out)
        processes = b""
        for name in ("cmdline", "environ"):
            for process in (run.process.pid, one.process.pid):
                with contextlib.suppress(OSError):
                    processes += pathlib.Path(f"/proc/{process}/{name}").read_bytes()
        run.expect_end(0)
        expect_same(out, undisturbed)
    secrets = [line.split('"')[1] for name in (server, coupler)
               for line in pathlib.Path(f"{name}.key").read_text().splitlines() if line.startswith("secret_key")]
    expect(len(secrets) == 2, "no secrets found")
    expect(f"{server}.key".encode() in processes, "the processes were not seen")
    expect(not any(secret.encode() in processes for secret in secrets), "a secret is in the list of processes")
    for path in [*out.rglob("*"), one.log, run.text]:
        if path.is_file():
            content = path.read_bytes()
            for secret in secrets:
                expect(secret.encode() not in content, f"a secret is in {path}")
    return f"a stranger is turned away within {refused_after:.1f} s"


def case_insecure_is_red(place):
    """On a terminal; a file gets the words alone."""
    red, plain = "\033[1;31m", "\033[0m"
    scene = scene_at(place, "tcp://127.0.0.1:9", "", "insecure = true").read_text().replace("connect_timeout = 3.0", "connect_timeout = 0.2")
    words = [COUPLER, "run", place.write("insecure.toml", scene), "--out", place.folder / "out"]
    status, text = command(*words)
    expect(status == 4 and "INSECURE" in text and red not in text, text)
    ours, theirs = pty.openpty()
    process = subprocess.Popen([str(word) for word in words], stdout=theirs, stderr=theirs, cwd=ROOT)
    os.close(theirs)
    said = b""
    with contextlib.suppress(OSError):  # the end of a terminal
        while part := os.read(ours, 4096):
            said += part
    os.close(ours)
    expect(process.wait(20) == 4, said.decode())
    expect(re.search(re.escape(red) + "INSECURE: [^\033]*insecure = true[^\033]*" + re.escape(plain), said.decode()), repr(said.decode()))


def case_secret_files(place):
    server, coupler = keys(place, "server", "coupler")
    os.chmod(f"{server}.key", 0o644)
    bind = ["--bind", f"tcp://127.0.0.1:{free_port()}", "--folder", place.folder / "x"]
    tube = PROGRAMS / "elastic-tube"
    status, text = command(tube, *bind, "--key", f"{server}.key", "--allow", f"{coupler}.pub")
    expect(status == 1 and "others than its owner" in text, text)
    status, text = command(tube, *bind, "--key", f"{coupler}.pub", "--allow", f"{coupler}.pub")
    expect(status == 1, text)
    status, text = command(tube, *bind, "--key", f"{coupler}.key")
    expect(status == 2 and "belong together" in text, text)
    broken = place.write("broken.key", 'public_key = "abc"\nsecret_key = "SECRETSECRET"\n')
    broken.chmod(0o600)
    status, text = command(tube, *bind, "--key", broken, "--allow", f"{coupler}.pub")
    expect(status == 1 and "SECRETSECRET" not in text, text)
    status, text = command(tube, "--bind", f"tcp://0.0.0.0:{free_port()}", "--folder", place.folder / "x")
    expect(status == 1 and "other machines" in text, text)


def case_local_sockets_are_private(place):
    scene = place.springs(fluid="seconds = 0.5")
    run = Run(scene, place.folder / "out")
    run.wait_for_window(1)
    line = next(line for line in run.log().splitlines() if "--bind" in line)
    path = pathlib.Path(line.split("--bind ipc://")[1].split()[0])
    for one in (path.parent, path, pathlib.Path(str(path) + ".line")):
        expect(stat.S_IMODE(one.stat().st_mode) & 0o077 == 0, f"others can enter {one}")
    run.process.terminate()
    run.end()
    address = place.folder / "by-hand.socket"
    with Server(place, "by-hand", f"ipc://{address}") as one:
        one.wait_for("elastic-tube 1 at")
        for path in (address, pathlib.Path(f"{address}.line")):
            expect(stat.S_IMODE(path.stat().st_mode) & 0o077 == 0, f"others can enter {path}")
