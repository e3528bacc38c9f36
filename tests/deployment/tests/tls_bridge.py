"""Lets a client without TLS reach a proxy: a port whose connections are forwarded over TLS with HTTP/2."""

import asyncio
import contextlib
import threading
from typing import Self

from certificates import client_context


class TlsBridge:
    """Forwards from a free port to `address`; a context manager."""

    def __init__(self, address: str) -> None:
        self._host, _, port = address.rpartition(":")
        self._port = int(port)
        self._context = client_context()
        self._context.set_alpn_protocols(["h2"])
        self._loop = asyncio.new_event_loop()

    def __enter__(self) -> Self:
        server = self._loop.run_until_complete(asyncio.start_server(self._forward, "127.0.0.1", 0))
        host, port = server.sockets[0].getsockname()
        self.address = f"{host}:{port}"
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()

    async def _forward(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            far_reader, far_writer = await asyncio.open_connection(self._host, self._port, ssl=self._context)
        except OSError:
            writer.close()
            return
        await asyncio.gather(_copy(reader, far_writer), _copy(far_reader, writer))


async def _copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Copies until one side ends, then ends the other."""
    with contextlib.suppress(OSError):
        while data := await reader.read(65536):
            writer.write(data)
            await writer.drain()
    writer.close()
