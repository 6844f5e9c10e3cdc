"""What a solver does with bytes that are no message, or none that it should get. It stays up and serves the next run."""
import os
import random
import socket
import struct
import time

import zmq

from driver import PROGRAMS, expect, finished
from security_cases import Server


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
                                    ("fluid", "wrong-length", 4, "'fluid'"),
                                    ("solid", "wrong-length", 4, "'solid'")):
        bad = f'misbehaviour = "{kind}"\nat_window = 7'
        scene = place.springs(**{who: bad})
        run = finished(scene, place.folder / f"{who}-{kind}", status=status, line=line)
        expect("window 7" in run.said() and "saved after window 5" in run.said(), run.said())
