"""What a solver does with bytes that are no message, or none that it should get. It stays up and serves the next run."""
import os
import random
import socket
import struct
import subprocess
import time

import zmq

from driver import PROGRAMS, ROOT, expect, finished
from security_cases import Server, free_port


# Protocol Buffers by hand: enough for headers, and for what is wrong on purpose.
def varint(value):
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes(out + bytes([value]))


def field(number, content):
    if isinstance(content, int):
        return varint(number << 3) + varint(content)
    return varint(number << 3 | 2) + varint(len(content)) + content


def request(phase, content=b"", run=b"run", sequence=1, version=1, window=0, iteration=0):
    header = field(1, version) + field(2, run) + field(3, window) + field(4, iteration) + field(5, sequence)
    return field(1, header) + field(phase, content)


HELLO, CONFIGURE, START, ADVANCE, ACCEPT, SAVE, LOAD, FRAME, STOP = range(2, 11)


class Client:
    def __init__(self, address):
        self.context = zmq.Context()
        self.socket = self.context.socket(zmq.DEALER)
        self.socket.linger = 0
        self.socket.connect(address)

    def ask(self, *frames, limit=3.0):
        """The first reply that is no report of progress (field 8)."""
        self.socket.send_multipart(frames)
        return self.reply(limit)

    def reply(self, limit=3.0):
        deadline = time.monotonic() + limit
        while time.monotonic() < deadline:
            if self.socket.poll(100):
                reply = b"".join(self.socket.recv_multipart())
                kinds = fields(reply)
                if 8 not in kinds:
                    return kinds
        return {}

    def close(self):
        self.socket.close()
        self.context.term()


def fields(message):
    """Field numbers of a message with their contents."""
    found, at = {}, 0

    def number():
        nonlocal at
        value, shift = 0, 0
        while True:
            byte = message[at]
            at += 1
            value |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                return value

    while at < len(message):
        key = number()
        if key & 7 == 0:
            found[key >> 3] = number()
        elif key & 7 == 1:
            found[key >> 3] = message[at:at + 8]
            at += 8
        elif key & 7 == 2:
            size = number()
            found[key >> 3] = message[at:at + size]
            at += size
        else:
            break
    return found


def error_of(reply):
    expect(7 in reply, f"no Error came back but {list(reply)}")
    content = fields(reply[7])
    return content.get(1, 0), content.get(3, b"").decode()


BAD_MESSAGE, OUT_OF_ORDER, BUSY, VERSION = 1, 2, 3, 7


def case_messages_that_are_none(place):
    address = f"ipc://{place.folder}/s"
    scene = place.tube().read_bytes()
    with Server(place, "server", address) as server:
        server.wait_for("elastic-tube 1 at")
        client = Client(address)
        source = random.Random(3)
        for size in (0, 1, 7, 100, 5000):
            # No bytes at all are a message without anything in it, its version included.
            kind = error_of(client.ask(source.randbytes(size)))[0]
            expect(kind == (BAD_MESSAGE if size else VERSION), f"{size} bytes gave an Error of kind {kind}")
        expect(error_of(client.ask(request(HELLO), request(HELLO)))[0] == BAD_MESSAGE, "two frames")
        expect(error_of(client.ask(request(HELLO)[:-3]))[0] == BAD_MESSAGE, "half a message")
        expect(error_of(client.ask(request(CONFIGURE, version=9)))[0] == VERSION, "another version")
        expect(error_of(client.ask(request(CONFIGURE, run=b"")))[0] == BAD_MESSAGE, "no run")
        expect(error_of(client.ask(request(START, sequence=1)))[0] == OUT_OF_ORDER, "Start before Configure")
        reply = client.ask(request(CONFIGURE, field(1, b"solid") + field(3, b"[[[ no TOML"), sequence=2))
        expect(3 in reply and 1 in fields(reply[3]), "a scene that is none has problems")
        reply = client.ask(request(CONFIGURE, field(1, b"solid") + field(2, b"s") + field(3, scene), sequence=3))
        expect(3 in reply and 1 not in fields(reply[3]), f"not configured: {reply}")
        expect(4 in client.ask(request(START, sequence=4)), "not started")
        # Replayed: the same answer, nothing done twice; older: refused.
        expect(4 in client.ask(request(START, sequence=4)), "a repeated request gets its answer again")
        expect(error_of(client.ask(request(CONFIGURE, sequence=3)))[0] == OUT_OF_ORDER, "an old request")
        expect(error_of(client.ask(request(START, sequence=5)))[0] == OUT_OF_ORDER, "a second Start")
        expect(error_of(client.ask(request(ACCEPT, sequence=6)))[0] == OUT_OF_ORDER, "Accept before Advance")
        for sequence, name in enumerate((b"../x", b"/etc/passwd", b"", b"a/b", b".."), 7):
            for phase in (SAVE, LOAD):
                expect(error_of(client.ask(request(phase, field(1, name), sequence=10 * sequence + phase)))[0]
                       == BAD_MESSAGE, f"the file {name}")
        other = Client(address)
        expect(error_of(other.ask(request(CONFIGURE, run=b"other")))[0] == BUSY, "a second run")
        # An Advance without inputs, with a window that is none.
        sequence = 200
        for content in (b"", field(1, 0) + field(4, b"")):
            sequence += 1
            kind, _ = error_of(client.ask(request(ADVANCE, content, sequence=sequence, window=1, iteration=1)))
            expect(kind == BAD_MESSAGE, f"an Advance without inputs gave {kind}")
        # Half a message over the direct line, then silence; and a size that is absurd.
        line = socket.socket(socket.AF_UNIX)
        line.connect(f"{place.folder}/s.line")
        line.sendall(struct.pack("<Q", 1000) + b"half")
        expect(2 in client.ask(request(HELLO)), "somebody's silence keeps others waiting")
        line.close()
        line = socket.socket(socket.AF_UNIX)
        line.connect(f"{place.folder}/s.line")
        line.sendall(struct.pack("<Q", 1 << 60))
        expect(2 in client.ask(request(HELLO)), "no answer after an absurd size")
        line.close()
        # Noise that is not even ZeroMQ.
        noise = socket.socket(socket.AF_UNIX)
        noise.connect(f"{place.folder}/s")
        noise.sendall(os.urandom(10000))
        expect(2 in client.ask(request(HELLO)), "no answer after noise")
        noise.close()
        expect(6 in client.ask(request(STOP, sequence=900)), "not stopped")
        expect(server.process.wait(5) == 0, "it did not end well")
        client.close()
        other.close()


def case_duplicate_and_unknown_participants(place):
    """One process for two participants, under one name or under two; a role that nobody knows; a program that is none."""
    solver = f'solver = "{PROGRAMS}/elastic-tube"'
    text = place.tube(end=0.1).read_text()

    def written(name, first, second):
        before, after = text.split("[solid]\n")
        return place.write(name, before.replace(solver, first) + "[solid]\n" + after.replace(solver, second))

    port = free_port()
    here = f"tcp://127.0.0.1:{port}"
    out = place.folder / "out"
    finished(written("same.toml", f'connect = "{here}"', f'connect = "{here}"'), out, status=2, line="each is a process of its own")
    with Server(place, "server", here) as server:
        server.wait_for("elastic-tube 1 at")
        finished(written("alias.toml", f'connect = "{here}"', f'connect = "tcp://localhost:{port}"'), out, status=4,
                 line="needs one of its own")
    finished(place.write("role.toml", f"[heat]\n{solver}\n" + text), out, status=2, line="unknown key")
    finished(written("program.toml", solver, 'solver = "no-such-solver"'), out, status=2, line="no-such-solver")
    finished(written("other.toml", solver, f'solver = "{PROGRAMS}/coupler"'), out, status=4,
             line="participant 'solid' was lost at window 0, iteration 0")


def case_who_listens_but_says_nothing(place):
    """A socket that takes everything and never answers: the run says who, and for how long."""
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(f"{place.folder}/s")
    listener.listen()
    text = place.tube().read_text().replace(f'[solid]\nsolver = "{PROGRAMS}/elastic-tube"',
                                            f'[solid]\nconnect = "ipc://{place.folder}/s"')
    scene = place.write("silent.toml", text.replace("[coupling]", "[coupling]\nconnect_timeout = 1.0", 1))
    finished(scene, place.folder / "out", status=4, line="participant 'solid' did not answer", limit=15)
    listener.close()


def case_fields_that_are_wrong(place):
    """Values that are not finite, of another length, huge, or of a surface that changed: named, and never taken."""
    for who, kind, status, line in (("fluid", "nan", 3, "pressure = nan"), ("solid", "nan", 3, "displacement = nan"),
                                    ("fluid", "infinite", 3, "pressure = inf"), ("solid", "infinite", 3, "displacement = inf"),
                                    ("fluid", "wrong-length", 4, "'fluid'"),
                                    ("solid", "wrong-length", 4, "'solid'"),
                                    ("fluid", "nothing", 4, "'fluid'"), ("solid", "nothing", 4, "'solid'"),
                                    ("fluid", "another-surface", 4, "'fluid'"), ("solid", "another-surface", 4, "'solid'")):
        bad = f'misbehaviour = "{kind}"\nat_window = 7'
        scene = place.springs(**{who: bad})
        run = finished(scene, place.folder / f"{who}-{kind}", status=status, line=line)
        expect("window 7" in run.said() and "saved after window 5" in run.said(), run.said())
    # Huge ones are numbers: the window diverges, which is said, and it is tried again; zeros are a load like any other. What they were
    # for one iteration leaves no trace.
    reference = place.folder / "undisturbed"
    finished(place.springs(), reference)
    for who, kind in (("fluid", "huge"), ("solid", "huge"), ("fluid", "zero"), ("solid", "zero")):
        scene = place.springs(**{who: f'misbehaviour = "{kind}"\nat_window = 7'})
        run = finished(scene, place.folder / f"{who}-{kind}")
        expect(kind == "zero" or "diverged: window 7" in run.log(), run.log())
        ours, theirs = ((folder / "watch/tip.csv").read_text().splitlines()[-1].split(",") for folder in (run.out, reference))
        expect(ours[0] == theirs[0] and abs(float(ours[1]) - float(theirs[1])) < 1e-3 * float(theirs[1]), f"{ours} {theirs}")


def case_a_message_that_is_too_large(place):
    """Nothing of it is kept, and others are served."""
    port = free_port()
    with Server(place, "server", f"tcp://127.0.0.1:{port}") as server:
        server.wait_for("elastic-tube 1 at")
        client, other = Client(f"tcp://127.0.0.1:{port}"), Client(f"tcp://127.0.0.1:{port}")
        expect(2 in other.ask(request(HELLO)), "no answer")
        client.socket.send(bytes(300 << 20))
        time.sleep(1)
        expect(2 in other.ask(request(HELLO)), "no answer beside a large message")
        with open(f"/proc/{server.process.pid}/status") as file:
            peak = next(int(line.split()[1]) for line in file if line.startswith("VmHWM"))
        client.close()
        other.close()
        expect(peak < 100_000, f"{peak} kB were taken")
        return f"{peak} kB at most"


# A scene of each kind of file that a solver reads, with the file at %s.
FILES = {
    "fluid-lbm": [("fluid", "configs/fluid/cavity.toml", '[[fluid.obstacle]]\nimage = "%s"\ncorner = [0.2, 0.2]\npixel = 0.01\n', "png")],
    "solid-sph": [("solid", None, 'dimension = 2\n[coupling]\nmode = "steady"\n[solid]\npoints = "%s"\nspacing = 0.1\ndensity = 1.0\n'
                                  'young_modulus = 1.0\npoisson_ratio = 0.3\n', "csv"),
                  ("solid", None, 'dimension = 2\n[coupling]\nmode = "steady"\n[solid]\nspacing = 0.1\ndensity = 1.0\nyoung_modulus = 1.0\n'
                                  'poisson_ratio = 0.3\n[solid.image]\nfile = "%s"\ncorner = [0, 0]\npixel = 0.1\n', "png")],
    "grains-dem": [("grains", "configs/grains/bouncing-ball.toml", '[[grains.group]]\nfile = "%s"\n', "csv"),
                   ("grains", "configs/grains/spheres-in-funnel.toml", '[[grains.wall]]\nname = "other"\nmesh = "%s"\n', "stl")],
    "given-pressure": [("fluid", None, 'dimension = 2\n[coupling]\nmode = "steady"\n[fluid]\nfile = "%s"\n', "csv")],
}


def case_files_that_a_scene_names(place):
    """Over the network a scene reads what lies in the server's working folder, writes nowhere else and starts nothing."""
    count = 0
    outside = place.folder / "outside"
    outside.mkdir()
    started = place.folder / "started"
    for program, scenes in FILES.items():
        folder = place.folder / program
        folder.mkdir()
        port = free_port()
        with open(place.folder / f"{program}.log", "w") as log:
            server = subprocess.Popen([str(PROGRAMS / program), "--bind", f"tcp://127.0.0.1:{port}", "--folder", str(folder)],
                                      stdout=log, stderr=log)
        client = Client(f"tcp://127.0.0.1:{port}")
        sequence = 0
        try:
            for role, base, more, kind in scenes:
                # What can be read is valid enough to be read, so that only its place is wrong.
                for where in (folder, outside):
                    (where / f"own.{kind}").write_text("solid\nendsolid\n" if kind == "stl" else "0,0\n1,1\n")
                link = folder / f"link.{kind}"
                link.symlink_to(outside / f"own.{kind}")
                (folder / "away").unlink(missing_ok=True)
                (folder / "away").symlink_to(outside)
                for name, refused in ((f"own.{kind}", False), (f"{folder}/own.{kind}", False), (f"../outside/own.{kind}", True),
                                      (f"{outside}/own.{kind}", True), (f"link.{kind}", True), (f"away/own.{kind}", True),
                                      ("/etc/passwd", True), ("/dev/zero", True), ("/proc/self/environ", True)):
                    text = ((ROOT / base).read_text() if base else "") + "\n" + more % name
                    text = text.replace(f"[{role}]\n", f"[{role}]\nsolver = \"touch {started}\"\n", 1)
                    sequence += 1
                    reply = client.ask(request(CONFIGURE, field(1, role.encode()) + field(3, text.encode()), sequence=sequence), limit=20)
                    expect(3 in reply, f"{program}: no Configured for {name} but {reply}")
                    found = b"is not in the working folder" in reply[3]
                    expect(found == refused, f"{program}, {kind}, {name}: {reply[3]}")
                    count += 1
            for number in (server.pid, *(int(entry) for entry in os.listdir(f"/proc/{server.pid}/task"))):
                expect(not open(f"/proc/{server.pid}/task/{number}/children").read(), f"{program} has started something")
            expect(server.poll() is None, f"{program} has ended")
        finally:
            client.close()
            server.kill()
            server.wait()
    expect(not started.exists(), "a program of the scene was started")
    return f"{count} names of files"
