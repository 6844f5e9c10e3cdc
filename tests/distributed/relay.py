"""A relay of TCP connections that is slow, stands still or breaks, as a network does: `Relay(there).delay = 0.05`."""
import collections
import selectors
import socket
import threading
import time


class _Way:
    """Bytes of one connection in one direction, each piece with the time at which it may go on."""

    def __init__(self, source, sink):
        self.source, self.sink = source, sink
        self.pieces = collections.deque()
        self.free_at = 0.0  # when the line has sent what went before


class Relay:
    """Listens at `address` (host, port) and passes every connection on to `there`. The attributes may be set at any time:
    `delay` [s] each way, `bandwidth` [bytes/s] each way, `still` (nothing passes, everything is kept)."""

    def __init__(self, there, address=("127.0.0.1", 0)):
        self.there = there
        self.delay, self.bandwidth, self.still = 0.0, None, False
        self.connections = 0
        self.bytes = 0
        self._refuse = False
        self._cut = threading.Event()
        self._end = threading.Event()
        self._listener = socket.create_server(address)
        self.port = self._listener.getsockname()[1]
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._end.set()
        self._thread.join()

    def cut(self, for_good=False):
        """Breaks every connection; new ones are let through again after `mend`, or at once unless `for_good`."""
        self._refuse = for_good
        self._cut.set()

    def mend(self):
        self._refuse = False

    def _work(self):
        selector = selectors.DefaultSelector()
        self._listener.setblocking(False)
        selector.register(self._listener, selectors.EVENT_READ, None)
        ways = {}

        def close(one):
            for way in [way for way in ways.values() if one in (way.source, way.sink)]:
                if ways.pop(way.source, None):
                    selector.unregister(way.source)
                way.source.close()

        def close_all():
            for one in list(ways):
                close(one)

        while not self._end.is_set():
            for key, _ in selector.select(0.001 if any(way.pieces for way in ways.values()) else 0.02):
                if key.fileobj is self._listener:
                    here, _ = self._listener.accept()
                    if self._refuse:
                        here.close()
                        continue
                    try:
                        far = socket.create_connection(self.there, timeout=2)
                    except OSError:
                        here.close()
                        continue
                    self.connections += 1
                    for one, other in ((here, far), (far, here)):
                        one.setblocking(False)
                        one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                        ways[one] = _Way(one, other)
                        selector.register(one, selectors.EVENT_READ, None)
                    continue
                way = ways.get(key.fileobj)
                if way is None:
                    continue
                try:
                    piece = way.source.recv(65536)
                except BlockingIOError:
                    continue
                except OSError:
                    piece = b""
                if not piece:
                    close(way.source)
                    continue
                self.bytes += len(piece)
                now = time.monotonic()
                if self.bandwidth:
                    way.free_at = max(now, way.free_at) + len(piece) / self.bandwidth
                way.pieces.append([max(now, way.free_at) + self.delay, piece])
            if self._cut.is_set():
                self._cut.clear()
                close_all()
            if self.still:
                continue
            now = time.monotonic()
            for way in list(ways.values()):
                while way.pieces and way.pieces[0][0] <= now:
                    try:
                        sent = way.sink.send(way.pieces[0][1])
                    except BlockingIOError:
                        break
                    except OSError:
                        close(way.source)
                        break
                    if sent == len(way.pieces[0][1]):
                        way.pieces.popleft()
                    else:
                        way.pieces[0][1] = way.pieces[0][1][sent:]
        close_all()
        self._listener.close()
