"""What the coupler does with replies that are none, or that it did not ask for: somebody between it and a participant changes them."""
import os
import threading

import zmq

from driver import PROGRAMS, Failure, Run, expect, expect_same, finished, summary
from message_cases import ADVANCE, HELLO, Server, field, fields, free_port

PROGRESS = 8  # an answer has the number of what was asked, but for this


class Between:
    """Hands on what coupler and participant say to each other, but for the answer to one request, number `at` of its kind,
    which `change` makes a list of messages of (each a list of frames)."""

    def __init__(self, participant, change, at, kind=ADVANCE):
        self.context = zmq.Context()
        self.front, self.back = self.context.socket(zmq.ROUTER), self.context.socket(zmq.DEALER)
        for one in (self.front, self.back):
            one.linger = 0
            one.maxmsgsize = -1
        port = self.front.bind_to_random_port("tcp://127.0.0.1")
        self.address = f"tcp://127.0.0.1:{port}"
        self.back.connect(participant)
        self.change, self.at, self.kind, self.answers, self.before = change, at, kind, 0, []
        self.over, self.failure = False, None
        self.thread = threading.Thread(target=self.hand_on)

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.over = True
        self.thread.join()
        self.context.destroy()
        if self.failure is not None:
            raise Failure(f"between coupler and participant: {self.failure!r}") from self.failure

    def hand_on(self):
        try:
            self.hand_on_until_over()
        except Exception as error:  # of this thread; told to whoever uses it
            self.failure = error

    def hand_on_until_over(self):
        identity = None
        while not self.over:
            if self.front.poll(5):
                identity, *request = self.front.recv_multipart()
                self.back.send_multipart(request)
            while self.back.poll(0):
                reply = self.back.recv_multipart()
                for message in self.changed(reply):
                    self.front.send_multipart([identity, *message])

    def changed(self, reply):
        kinds = fields(b"".join(reply))
        if PROGRESS in kinds:
            return [reply]
        answers = [reply]
        if self.kind in kinds:
            self.answers += 1
            if self.answers == self.at:
                answers = self.change(reply, self.before)
        self.before.append(reply)
        return answers


def other_header(message, number, value):
    """The message with one field of its header replaced (the last one counts)."""
    return message + field(1, field(number, value))


# What becomes of the answer; what is said of it, where the run takes the participant for lost and goes back to its checkpoint.
NONE = "that are not a message of this protocol"
CHANGES = {
    "garbage": (lambda reply, before: [[os.urandom(1000)]], NONE),
    "half": (lambda reply, before: [[reply[0][:len(reply[0]) // 2]]], NONE),
    "two-frames": (lambda reply, before: [[reply[0], reply[0]]], NONE),
    # What was answered before, an answer twice and one for another run are not what is waited for.
    "replayed": (lambda reply, before: [*before[-5:], reply], None),
    "twice": (lambda reply, before: [reply, reply], None),
    "another-run": (lambda reply, before: [[other_header(reply[0], 2, b"other")], reply], None),
    "another-sequence": (lambda reply, before: [[other_header(reply[0], 5, 1 << 40)], reply], None),
    "empty": (lambda reply, before: [[b""], reply], "without a header"),
    # An answer that does not come is asked for again.
    "swallowed": (lambda reply, before: [], None),
    # After a message that is too large ZeroMQ does not connect again, as it does after a cut: the run ends and is gone on with.
    "oversized": (lambda reply, before: [[bytes(300 << 20)]], "did not answer"),
}


def scene_through(place, between):
    """A tube whose wall is connected to by way of `between`."""
    text = place.tube(end=0.4).read_text().replace(f'[solid]\nsolver = "{PROGRAMS}/elastic-tube"', f'[solid]\nconnect = "{between.address}"')
    return place.write("between.toml", text.replace("[coupling]", "[coupling]\nconnect_timeout = 8.0", 1))


def case_answer_to_hello_without_a_header(place):
    """From who has never answered properly it means other messages, not a loss: nothing to try again."""
    address = f"tcp://127.0.0.1:{free_port()}"
    with Server(place, "solid", address) as server, Between(address, lambda reply, before: [[b""]], at=1, kind=HELLO) as between:
        server.wait_for("elastic-tube 1 at")
        run = Run(scene_through(place, between), place.folder / "out")
        run.expect_end(2, "speaks protocol version 0")
        expect("build the solver with the messages of this coupler" in run.said(), run.said())
        expect(between.answers == 1, f"Hello was answered {between.answers} times")


def case_replies_that_are_none(place, kinds=tuple(CHANGES)):
    reference = place.folder / "undisturbed"
    finished(place.tube(end=0.4), reference)
    took = []
    for kind in kinds:
        change, line = CHANGES[kind]
        where = type(place)(place.folder / kind)
        address = f"tcp://127.0.0.1:{free_port()}"
        with Server(where, "solid", address) as server, Between(address, change, at=130) as between:
            server.wait_for("elastic-tube 1 at")
            scene = scene_through(where, between)
            run = Run(scene, where.folder / "out", limit=60)
            status = run.end()
            expect(status == (4 if kind == "oversized" else 0), f"{kind}: exit status {status}: {run.said()}")
            expect(between.answers >= between.at, f"{kind}: only {between.answers} answers, none was changed")
            expect(line is None or line in run.said(), f"{kind}: {run.said()}")
            expect(status or server.process.wait(5) == 0, f"{kind}: the participant did not end well")
        if status:
            with Server(where, "solid", address) as server:
                server.wait_for("elastic-tube 1 at")
                scene.write_text(scene.read_text().replace(between.address, address))
                finished(scene, run.out, "--resume", line="goes on after window 20")
        relaunches = summary(run.out)["recovery"]["relaunches"]
        expect(status or relaunches == (0 if line is None else 1), f"{kind}: {relaunches} relaunches: {run.said()}")
        expect_same(run.out, reference, elsewhere={"solid": where.folder / "solid"})
        took.append(f"{kind}: {f'exit {status}, resumed' if status else 'passed over' if line is None else 'recovered'}")
    return ", ".join(took)
