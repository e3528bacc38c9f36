"""A TCP proxy whose connections a test can cut or silence."""

import contextlib
import socket
import threading
import time
from typing import Self


class Proxy:
    """Forwards from a free port to `address`, each connection only after `delay_s` seconds; a context manager."""

    def __init__(self, address: str, delay_s: float = 0.0) -> None:
        self._delay_s = delay_s
        host, _, port = address.rpartition(":")
        self._server = (host, int(port))
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._lock = threading.Lock()
        self._sockets: list[socket.socket] = []
        self._silent: set[socket.socket] = set()
        self.address = f"127.0.0.1:{self._listener.getsockname()[1]}"
        self.cuts = 0

    def __enter__(self) -> Self:
        threading.Thread(target=self._accept, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        # Closing a listener does not wake a thread that accepts on it; shutting it down does.
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self.cut()

    def cut(self) -> None:
        """Cuts all current connections. New ones are forwarded."""
        with self._lock:
            self.cuts += 1
            for end in self._sockets:
                # The forwarding thread wakes up and closes it.
                with contextlib.suppress(OSError):
                    end.shutdown(socket.SHUT_RDWR)
            self._sockets.clear()

    def silence(self) -> None:
        """Forwards nothing more on the current connections, which stay open. New ones are forwarded."""
        with self._lock:
            self._silent.update(self._sockets)

    def _accept(self) -> None:
        while True:
            try:
                near, _ = self._listener.accept()
                time.sleep(self._delay_s)
                far = socket.create_connection(self._server)
            except OSError:
                return
            with self._lock:
                self._sockets += [near, far]
            threading.Thread(target=self._serve, args=(near, far), daemon=True).start()

    def _serve(self, near: socket.socket, far: socket.socket) -> None:
        """Forwards one connection both ways until it ends."""
        with near, far:
            back = threading.Thread(target=self._forward, args=(far, near), daemon=True)
            back.start()
            self._forward(near, far)
            back.join()

    def _forward(self, source: socket.socket, sink: socket.socket) -> None:
        """Copies until one side ends, then ends the other."""
        with contextlib.suppress(OSError):
            source.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            while data := source.recv(65536):
                if source not in self._silent:
                    sink.sendall(data)
        for end in (source, sink):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
