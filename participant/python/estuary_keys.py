"""Keys for addresses that other machines reach: the files of `coupler keys`, CurveZMQ at the socket, and a list of who may come.
Who is not on it is turned away before anything of it is read."""
import pathlib, stat, sys, tomllib

import zmq
from zmq.auth.thread import ThreadAuthenticator
from zmq.utils import z85


class KeyFault(Exception):
    """Names the file, and never says what is in it."""


def read(file, *names):
    path = pathlib.Path(file)
    try:
        if "secret_key" in names and stat.S_IMODE(path.stat().st_mode) & 0o077:
            raise KeyFault(f"{file}: others than its owner can get at this secret; chmod 600 it")
        table = tomllib.loads(path.read_text())
    except OSError as error:
        raise KeyFault(f"{file}: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError):
        raise KeyFault(f"{file}: is no key file") from None
    keys = [table.get(name) for name in names]
    for name, key in zip(names, keys):
        try:
            if len(z85.decode(key)) != 32:
                raise ValueError
        except Exception:
            raise KeyFault(f"{file}: holds no `{name}` of 40 characters") from None
    return [key.encode() for key in keys]


class Gatekeeper:
    """The list, as ZeroMQ's authenticator asks it."""
    def __init__(self, allowed):
        self.allowed = set(allowed)
        self.refused = 0
        self.next_said = 1

    def callback(self, domain, key):
        if key in self.allowed:
            return True
        self.refused += 1
        # Each at first, then seldom: somebody may try for hours.
        if self.refused >= self.next_said:
            print(f"refused a connection: its key is not on the list ({self.refused} so far)", file=sys.stderr, flush=True)
            self.next_said = self.refused + 1 if self.refused < 10 else 2 * self.refused
        return False


def guard(context, socket, key_file, allowed_files):
    """To be called before the socket is bound. What comes back has to be kept."""
    public, secret = read(key_file, "public_key", "secret_key")
    allowed = [read(file, "public_key")[0] for file in allowed_files]
    authenticator = ThreadAuthenticator(context)
    authenticator.start()
    authenticator.configure_curve_callback(domain="*", credentials_provider=Gatekeeper(allowed))
    socket.curve_publickey, socket.curve_secretkey, socket.curve_server = public, secret, True
    return authenticator
