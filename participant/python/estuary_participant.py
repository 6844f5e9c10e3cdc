"""The kit for participants in Python: a class with a method for each phase, and serve() to answer the coupler with it.

The contract itself is proto/README.md; this file is all that stands between it and a solver, on python3-zmq and the
messages that protoc generated (build/generated/python). In another language, write the same.
"""
import argparse, concurrent.futures, os, pathlib, re, signal, sys, time, tomllib

here = pathlib.Path(__file__).resolve().parent
for folder in (os.environ.get("ESTUARY_MESSAGES"), here / "../generated/python", here / "../share/estuary/python", here / "../../build/generated/python"):
    if folder and (pathlib.Path(folder) / "estuary/v1/protocol_pb2.py").exists():
        sys.path.insert(0, str(folder))
        break

import zmq
from estuary.v1 import payload_pb2 as payload, protocol_pb2 as protocol

PROTOCOL_VERSION = 1
PROGRESS_INTERVAL = 0.2  # s; after 1.5 s of silence a participant counts as lost


class Refused(Exception):
    """Becomes an Error reply: kind of protocol.Error, field as in the contract, what was wrong, what to try."""
    def __init__(self, message, kind="BAD_MESSAGE", field="", advice=""):
        super().__init__(message)
        self.kind, self.field, self.advice = kind, field, advice


def check(field, values, size, surface=None, expected=None):
    """Refuses values that are not `size` finite numbers, or that belong to another surface."""
    if surface is not None and surface != expected:
        raise Refused(f"belongs to surface {surface}, expected {expected}", field=field)
    if len(values) != size:
        raise Refused(f"has {len(values)} values, expected {size}", field=field)
    for place, value in enumerate(values):
        if value - value != 0:  # infinities and NaN
            raise Refused(f"value {place} is {value}", field=field)
    return list(values)


def check_surface(surface):
    """Refuses a wet surface that is none; gives it back."""
    def refuse(what):
        raise Refused(what, field="initial.wet_surface")
    if surface.dimension not in (2, 3):
        refuse(f"has {surface.dimension} dimensions")
    positions, facets = surface.reference_positions, surface.connectivity
    if not positions or len(positions) % surface.dimension or not facets or len(facets) % surface.dimension:
        refuse(f"has {len(positions)} coordinates and {len(facets)} node numbers in {surface.dimension} dimensions")
    check("initial.wet_surface.reference_positions", positions, len(positions))
    if max(facets) >= len(positions) // surface.dimension:
        refuse(f"has a facet of node {max(facets)}, which is not there")
    return surface


class Table:
    """One table of the scene. Keys that nobody took are refused with the line they are in."""
    files_below = None  # the only folder of files that a scene may name, where it came over the network

    def __init__(self, values, name, text):
        self.values, self.name, self.lines, self.taken, self.problems = values, name, text.splitlines(), set(), []

    def take(self, key, default=None, kind=float):
        self.taken.add(key)
        value = self.values.get(key, default)
        if value is None:
            self.problem("", f"'{self.name}.{key}' is missing")
        elif kind is float and (isinstance(value, bool) or not isinstance(value, (int, float)) or value - value != 0):
            self.problem(key, f"'{self.name}.{key}' has to be a number")
        elif kind not in (None, float) and not isinstance(value, kind):
            self.problem(key, f"'{self.name}.{key}' has to be of type {kind.__name__}")
        else:
            return value
        return kind() if kind else None

    def take_file(self, key):
        """The name of a file to be read, "" when there is none; in a scene that came over the network one below the working
        folder, with that folder."""
        name = self.take(key, "", str)
        if name and self.files_below:
            folder = self.files_below.resolve()
            path = (folder / name).resolve()
            if folder not in path.parents:
                self.problem(key, f"'{name}' is not in the working folder of the participant ({folder}), the only place where a "
                                  "scene that came over the network may name files: put it there")
                return ""
            name = str(path)
        return name

    def problem(self, key, message):
        inside, place = False, 0
        for number, line in enumerate(self.lines, 1):
            if header := re.match(r"\s*\[+([\w.-]+)\]", line):
                inside = header[1] == self.name or header[1] == f"{self.name}.{key}"
            if inside and (not key or re.match(rf"\s*({re.escape(key)}\s*=|\[+{re.escape(self.name)}\.{re.escape(key)}\])", line)):
                place = number
                break
        self.problems.append(protocol.Problem(line=place, column=1 if place else 0, message=message))

    def refuse_unknown(self):
        for key in self.values.keys() - self.taken - {"solver", "connect", "threads"}:
            self.problem(key, f"'{self.name}.{key}' is unknown; known are {', '.join(sorted(self.taken))}")


class Participant:
    """What a solver is made of. Every method but `advance` may be left as it is."""
    name, version, roles, capabilities, dimensions = "", "1", [], [], [2]
    folder = pathlib.Path(".")

    def configure(self, table, scene): pass       # takes its keys from the scene's table; notes problems in it
    def start(self, initial): return payload.Exchange()  # what others bring -> what this one brings
    def window_step(self): return 0.0             # windows may be multiples of it; 0: of any length; None: the scene's only
    def advance(self, window, inputs): raise NotImplementedError  # -> Exchange, {watch: {quantity: value}}
    def accept(self): pass                        # the last advance becomes the start of the next window
    def save(self, path): raise Refused("keeps no checkpoints", "FAILED")
    def load(self, path): raise Refused("keeps no checkpoints", "FAILED")
    def frame(self, number, time): return []      # writes fields; -> names of the files below self.folder


class Window:
    def __init__(self, request):
        header, message = request.header, request.advance
        self.number, self.iteration = header.window, header.iteration
        self.steady = message.mode == protocol.Advance.STEADY
        self.time, self.duration = message.time, message.duration


def read_scene(message):
    """The scene's tables with the overrides "key.path=value" of the command line."""
    scene = tomllib.loads(message.scene)
    for override in message.overrides:
        path, _, text = override.partition("=")
        *parents, key = path.strip().split(".")
        if not parents and text.strip().strip('"') == "off":
            scene.pop(key, None)
            continue
        try:
            value = tomllib.loads("value = " + text)["value"]
        except tomllib.TOMLDecodeError:
            value = text.strip()
        table = scene
        for parent in parents:
            table = table[int(parent)] if isinstance(table, list) else table.setdefault(parent, {})
        if isinstance(table, list):
            table[int(key)] = value
        else:
            table[key] = value
    return scene


def configure(participant, message):
    configured = protocol.Configured(variant="Python")
    try:
        scene = read_scene(message)
    except (tomllib.TOMLDecodeError, KeyError, IndexError, ValueError) as error:
        place = re.search(r"line (\d+), column (\d+)", str(error)) or [0, 0, 0]
        configured.problems.add(line=int(place[1]), column=int(place[2]), message=str(error))
        return configured
    table = Table(scene.get(message.role, {}), message.role, message.scene)
    for name, value in (participant.configure(table, scene) or {}).items():
        configured.plan.add(name=name, value=value)
    table.refuse_unknown()
    configured.problems.extend(table.problems)
    return configured


class Session:
    """One run: which phase is legal when, and what it becomes."""
    def __init__(self, participant, folder):
        self.participant, self.folder = participant, folder
        self.configured = self.started = self.advanced = False
        self.steps, self.compute = 0, 0.0

    def answer(self, request):
        reply, begin = protocol.Reply(header=request.header), time.monotonic()
        try:
            self.carry_out(request, reply)
        except Refused as refused:
            reply.ClearField("result")
            reply.error.kind = protocol.Error.Kind.Value(refused.kind)
            reply.error.field, reply.error.message, reply.error.advice = refused.field, str(refused), refused.advice
        except Exception as error:  # whatever a solver does wrong, the process stays up and says so
            reply.error.kind, reply.error.message = protocol.Error.FAILED, f"{type(error).__name__}: {error}"
        reply.compute_s = time.monotonic() - begin
        return reply

    def require(self, allowed, what):
        if not allowed:
            raise Refused(what, "OUT_OF_ORDER")

    def inside(self, file):
        if not re.fullmatch(r"[\w.-]+", file) or file in (".", ".."):
            raise Refused(f"'{file}' is not a plain file name", field="file")
        if (self.folder / file).is_symlink():
            raise Refused(f"'{file}' is a link that leads elsewhere", field="file")
        return self.folder / file

    def carry_out(self, request, reply):
        phase, solver = request.WhichOneof("phase"), self.participant
        if phase not in ("configure", "stop", None):
            self.require(self.configured, f"{phase} before a Configure without problems")
            self.require(phase == "start" or self.started, f"{phase} before Start")
        if phase == "configure":
            self.require(not self.started, "Configure after Start")
            reply.configured.CopyFrom(configure(solver, request.configure))
            self.configured = not reply.configured.problems
        elif phase == "start":
            self.require(not self.started, "a second Start")
            reply.started.SetInParent()
            reply.started.initial.CopyFrom(solver.start(request.start.initial))
            if solver.window_step() is not None:
                reply.started.window_step = solver.window_step()
            self.started = True
        elif phase == "advance":
            self.advanced = False
            outputs, watches = solver.advance(Window(request), request.advance.inputs)
            reply.advanced.outputs.CopyFrom(outputs)
            for name, values in watches.items():
                reply.advanced.watches.add(name=name, quantity=values.keys(), value=values.values())
            self.steps += 1
            reply.advanced.work.steps = self.steps
            self.advanced = not request.advance.accept
            if request.advance.accept:
                solver.accept()
        elif phase == "accept":
            self.require(self.advanced, "Accept without a completed Advance")
            solver.accept()
            self.advanced = False
            reply.done.SetInParent()
        elif phase == "save":
            solver.save(self.inside(request.save.file))
            reply.done.files.append(request.save.file)
        elif phase == "load":
            solver.load(self.inside(request.load.file))
            self.advanced = False
            reply.done.SetInParent()
        elif phase == "frame":
            reply.done.SetInParent()  # there may be no files
            reply.done.files.extend(solver.frame(request.frame.number, request.frame.time))
        elif phase == "stop":
            reply.done.SetInParent()
        else:
            raise Refused("the request names no phase", field="phase")


class Reception:
    """The socket: one thread, so that progress goes out while another one computes."""
    def __init__(self, participant, options):
        self.participant, self.session = participant, Session(participant, participant.folder)
        self.socket = zmq.Context.instance().socket(zmq.ROUTER)
        same_machine = re.match(r"ipc://|tcp://(127\.|localhost:|\[::1\])", options.bind)
        self.reconnect_within = 0.0 if options.bind.startswith("ipc://") else options.reconnect_timeout
        self.out_of_reach_since = None
        for option, value in ((zmq.ROUTER_MANDATORY, 1), (zmq.LINGER, 500), (zmq.MAXMSGSIZE, 256 << 20), (zmq.ROUTER_HANDOVER, 1), (zmq.SNDTIMEO, 2000),
                              (zmq.HEARTBEAT_IVL, 300), (zmq.HEARTBEAT_TIMEOUT, 15000 if same_machine else 5000)):
            self.socket.setsockopt(option, value)
        if options.key:
            import estuary_keys  # left out of runs on one machine
            self.guard = estuary_keys.guard(zmq.Context.instance(), self.socket, options.key, options.allow)
        before = os.umask(0o077)  # a local socket is its owner's
        self.socket.bind(options.bind)
        os.umask(before)
        self.patience = options.orphan_timeout or float("inf")
        self.computing = concurrent.futures.ThreadPoolExecutor(1)
        self.owner, self.run, self.role, self.last_reply, self.counter = None, "", "", None, 0
        self.job = self.job_header = None
        self.last_progress = time.monotonic()

    def send(self, client, reply):
        """Raises when the coupler is gone: then this process ends too. One whose connection broke may come back before that, and asks
        again for what was lost with it."""
        reply.header.protocol_version = PROTOCOL_VERSION
        try:
            self.socket.send_multipart([client, reply.SerializeToString()])
        except zmq.ZMQError as error:
            if error.errno not in (zmq.EHOSTUNREACH, zmq.EAGAIN):
                raise
            if client != self.owner:
                return
            now = time.monotonic()
            if self.out_of_reach_since is None:
                print(f"{self.participant.name}: the coupler is out of reach", file=sys.stderr)
                self.out_of_reach_since = now
            if now - self.out_of_reach_since >= self.reconnect_within:
                raise
        else:
            if client == self.owner:
                self.out_of_reach_since = None

    def refuse(self, client, header, kind, message):
        reply = protocol.Reply(header=header)
        reply.error.kind, reply.error.message = protocol.Error.Kind.Value(kind), message
        self.send(client, reply)

    def receive(self):
        client, *frames = self.socket.recv_multipart()
        request = protocol.Request()
        try:
            request.ParseFromString(frames[0] if len(frames) == 1 else b"\xff")
        except Exception:
            return self.refuse(client, None, "BAD_MESSAGE", "the bytes are not a request of this protocol")
        header, solver = request.header, self.participant
        refuse = lambda kind, message: self.refuse(client, header, kind, message)
        if header.protocol_version != PROTOCOL_VERSION:
            return refuse("VERSION", f"the request speaks protocol version {header.protocol_version}, this participant {PROTOCOL_VERSION}")
        if request.WhichOneof("phase") == "hello":
            welcome = protocol.Welcome(name=solver.name, version=solver.version, roles=solver.roles, run_id=self.run,
                                       capabilities=[*solver.capabilities, "advance-accepts"], dimensions=solver.dimensions, process=os.getpid())
            return self.send(client, protocol.Reply(header=header, welcome=welcome))
        if not header.run_id:
            return refuse("BAD_MESSAGE", "the request belongs to no run (run_id is empty)")
        self.run = self.run or header.run_id
        if header.run_id != self.run:
            return refuse("BUSY", f"busy with run {self.run}")
        # One process under two addresses: looked at before the order, because both count their requests from one.
        role = request.configure.role if request.WhichOneof("phase") == "configure" else ""
        if role and self.role and role != self.role:
            return refuse("BUSY", f"this process is '{self.role}' of the same run; '{role}' needs one of its own: launch a second one and connect to that")
        self.role = role or self.role
        self.owner, self.out_of_reach_since = client, None
        answered = self.last_reply.header.sequence if self.last_reply else 0
        working = self.job_header.sequence if self.job else 0
        if self.last_reply and header.sequence == answered:
            return self.send(client, self.last_reply)  # a retry is harmless
        if working and header.sequence == working:
            return None
        if header.sequence <= max(answered, working):
            return refuse("OUT_OF_ORDER", f"request {header.sequence} is older than request {max(answered, working)}")
        if working and request.WhichOneof("phase") != "stop":
            return refuse("OUT_OF_ORDER", f"request {header.sequence} came while request {working} is being worked on")
        if request.WhichOneof("phase") == "stop":
            self.send(client, self.session.answer(request))
            return "stop"
        self.job_header, self.job = header, self.computing.submit(self.session.answer, request)
        return None

    def report_progress(self):
        self.last_progress, self.counter = time.monotonic(), self.counter + 1
        if self.owner is None:
            self.patience -= PROGRESS_INTERVAL
            return self.patience > 0
        progress = protocol.Progress(phase="computing" if self.job else "idle", fraction=-1, counter=self.counter)
        header = self.job_header if self.job else protocol.Header(run_id=self.run)
        self.send(self.owner, protocol.Reply(header=header, progress=progress))
        return True

    def serve(self):
        while True:
            left = max(0.0, self.last_progress + PROGRESS_INTERVAL - time.monotonic())
            if self.job:  # waits for the answer, and looks for a Stop now and then
                concurrent.futures.wait([self.job], left)
                if self.job.done():
                    reply, self.job = self.job.result(), None
                    self.last_reply = reply
                    self.send(self.owner, reply)
            if self.socket.poll(0 if self.job else 1000 * left) and self.receive() == "stop":
                return 0
            if time.monotonic() - self.last_progress >= PROGRESS_INTERVAL and not self.report_progress():
                return 1


def serve(participant):
    """The main program: serves one run at the address given by --bind, or checks a scene with --check."""
    options = argparse.ArgumentParser(description=f"{participant.name}: a participant in an Estuary run")
    options.add_argument("--bind")
    options.add_argument("--folder", type=pathlib.Path, default=".")
    options.add_argument("--threads", type=int)
    options.add_argument("--orphan-timeout", type=float, default=0)
    options.add_argument("--reconnect-timeout", type=float, default=3.0, help="end after so many seconds without a connection to the coupler of a run (tcp:// only)")
    options.add_argument("--check", action="store_true")
    options.add_argument("--key", help="file of the own CurveZMQ key pair (made by `coupler keys`)")
    options.add_argument("--allow", action="append", default=[], help="file of the public key of a coupler that may come; may be repeated")
    options.add_argument("--insecure", action="store_true", help="allow an address that other machines reach, without authentication")
    options.add_argument("--version", action="version", version=participant.version)
    options = options.parse_args()
    if options.check:
        configured = configure(participant, protocol.Configure.FromString(sys.stdin.buffer.read()))
        sys.stdout.buffer.write(configured.SerializeToString())
        sys.exit(2 if configured.problems else 0)
    def wrong(what):
        print(f"{participant.name}: {what}", file=sys.stderr)
        sys.exit(2)
    if not options.bind:
        wrong("--bind is missing: the address to serve at, ipc:///path or tcp://host:port")
    if bool(options.key) != bool(options.allow):
        wrong("--key and --allow belong together")
    if not options.key and not options.insecure and not re.match(r"ipc://|tcp://(127\.|localhost:|\[::1\])", options.bind):
        wrong(f"other machines reach {options.bind}: give --key and --allow (`coupler keys` makes them), or --insecure")
    signal.signal(signal.SIGTERM, lambda *_: os._exit(1))
    signal.signal(signal.SIGINT, lambda *_: os._exit(1))
    options.folder.mkdir(parents=True, exist_ok=True)
    participant.folder = options.folder
    if not options.bind.startswith("ipc://"):
        Table.files_below = options.folder
    status = 1
    try:
        status = Reception(participant, options).serve()
    except zmq.ZMQError as error:
        print(f"{participant.name}: the coupler is gone, or the address is wrong: {error}", file=sys.stderr)
    except Exception as error:
        if type(error).__name__ != "KeyFault":
            raise
        print(f"{participant.name}: {error}", file=sys.stderr)
    zmq.Context.instance().destroy(linger=500)
    sys.stdout.flush()
    os._exit(status)  # a computation that is still going on does not hold us
