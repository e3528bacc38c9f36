"""Opening channels: TLS, tokens, and the options of connections. Addresses are in `address`."""

import ipaddress
import os
import ssl
import warnings
import weakref
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple, cast
from urllib.parse import urlsplit

from chefshat.address import CA, TOKEN, ServerAddress
from chefshat.errors import ChefsHatError, closed
from chefshat.network import grpc

# Metadata that shows an owner token or a ticket.
_SECRET = "chefshat-secret"
# First line of each certificate in a PEM file.
_CERTIFICATE = b"-----BEGIN CERTIFICATE-----"

# Times in milliseconds. The channel's own delays between connection attempts are short, because `Backoff` adds its own. (Except for
# "grpc.min_reconnect_backoff_ms", which despite its name limits the duration of one attempt.) While a stream is open and silent,
# pings detect a dead peer, in less than the default time for a decision: 10 s.
CHANNEL_OPTIONS: list[tuple[str, int]] = [
    ("grpc.initial_reconnect_backoff_ms", 100),
    ("grpc.max_reconnect_backoff_ms", 1000),
    ("grpc.keepalive_time_ms", 3_000),
    ("grpc.keepalive_timeout_ms", 5_000),
    # Limits the wait for the answer to any ping, 60 s otherwise.
    ("grpc.http2.ping_timeout_ms", 5_000),
    # By default a silent connection is only pinged twice.
    ("grpc.http2.max_pings_without_data", 0),
    # Gives every client of a process its own connection.
    ("grpc.use_local_subchannel_pool", 1),
]


#: Seconds that a call with one answer waits for it, unless a client has another limit.
TIMEOUT_S = 15.0


class Target(NamedTuple):
    """The address of a server: gRPC's authority, and whether to use TLS."""

    authority: str
    tls: bool


def target(address: str) -> Target:
    """Parses "host:port", "http://host:port" (the same) or "https://host:port" (TLS)."""
    scheme, separator, rest = address.partition("://")
    if not separator:
        return Target(address, tls=False)
    if scheme not in ("http", "https"):
        raise _refused("ADDRESS_REFUSED", f"the address {address!r} must begin with http:// or https://")
    return Target(rest.rstrip("/"), tls=scheme == "https")


def channel(server: ServerAddress, options: Sequence[tuple[str, int]] = (), *, timeout: float | None = TIMEOUT_S) -> grpc.Channel:
    """Opens a blocking channel.

    Args:
        server: where, and what it requires.
        options: added to `CHANNEL_OPTIONS`, or replace them.
        timeout: seconds that a call with one answer waits for it; None: for ever.
    """
    where = target(server.address)
    together = list({**dict(CHANNEL_OPTIONS), **dict(options)}.items())
    if where.tls:
        opened = grpc.secure_channel(where.authority, _credentials(server.ca), together)
    else:
        opened = grpc.insecure_channel(where.authority, together)
    return cast(grpc.Channel, _Calling(opened, _metadata(server, where), timeout))


def async_channel(server: ServerAddress, *, timeout: float | None = TIMEOUT_S) -> grpc.aio.Channel:
    """Opens a channel of asyncio, like `channel`. Call it where the event loop runs."""
    where = target(server.address)
    if where.tls:
        opened = grpc.aio.secure_channel(where.authority, _credentials(server.ca), CHANNEL_OPTIONS)
    else:
        opened = grpc.aio.insecure_channel(where.authority, CHANNEL_OPTIONS)
    return cast(grpc.aio.Channel, _Calling(opened, _metadata(server, where), timeout))


def _metadata(server: ServerAddress, where: Target) -> tuple[tuple[str, str], ...]:
    """Returns the token and the secrets to send with every call.

    Warns once if a token can be read on the way to another machine.
    """
    token = os.environ.get(TOKEN, "") if server.token is None else server.token
    token = token.strip()
    if not (token.isascii() and token.isprintable()):
        raise _refused("TOKEN_REFUSED", "the token is malformed: copy it as `chefshat token create` printed it")
    host = urlsplit(f"//{where.authority}").hostname or ""
    if token and not where.tls and not _is_this_machine(host):
        warnings.warn(f"the token is sent unencrypted to {host}; use https://{host}", stacklevel=1)
    secrets = [secret.strip() for secret in server.secrets]
    if not all(secret.isalnum() and secret.isascii() for secret in secrets):
        raise _refused("SECRETS_REFUSED", "a secret is malformed: give owner tokens and tickets as the server returned them")
    authorization = (("authorization", f"Bearer {token}"),) if token else ()
    return (*authorization, *((_SECRET, secret) for secret in secrets))


def _is_this_machine(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _credentials(ca: Path | str | None) -> grpc.ChannelCredentials:
    """Returns the authorities of a file, of the environment, or of the system."""
    ca = ca or os.environ.get(CA)
    if ca:
        try:
            roots = Path(ca).read_bytes()
        except OSError as error:
            raise _refused("CA_REFUSED", f"cannot read the authorities: {error}") from error
        if _CERTIFICATE not in roots:
            raise _refused("CA_REFUSED", f"{ca} contains no certificate in PEM form")
        return grpc.ssl_channel_credentials(roots)
    # gRPC has authorities of its own, for systems without such a file.
    system = ssl.get_default_verify_paths().cafile
    return grpc.ssl_channel_credentials(Path(system).read_bytes() if system else None)


def _refused(reason: str, message: str) -> ChefsHatError:
    """Returns the error for arguments with which no connection is possible."""
    return ChefsHatError(reason, message, code=grpc.StatusCode.INVALID_ARGUMENT)


class _Calling:
    """A channel that sends metadata with every call and limits the time of those with one answer.

    Unlike interceptors it leaves the call objects of asyncio as they are, and unlike call credentials it does not need TLS.
    """

    def __init__(
        self, opened: grpc.Channel | grpc.aio.Channel, metadata: tuple[tuple[str, str], ...], timeout: float | None
    ) -> None:
        self._channel = opened
        self._metadata = metadata
        self._timeout = timeout
        self._closed = False
        self._begun: weakref.WeakSet[grpc.aio.Call] = weakref.WeakSet()

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - Whatever the channel has.
        return getattr(self._channel, name)

    def close(self, *arguments: Any) -> object:  # noqa: ANN401 - The channel's own.
        """Closes the channel. Further calls raise `ChefsHatError`."""
        self._closed = True
        # Older versions of gRPC leave alone a stream of asyncio that waits for its next message: it would wait for ever.
        for call in list(self._begun):
            call.cancel()
        return self._channel.close(*arguments)

    def unary_unary(self, *arguments: Any, **options: Any) -> Callable[..., object]:  # noqa: ANN401 - The channel's own.
        return self._calls(self._channel.unary_unary(*arguments, **options), self._timeout)

    def unary_stream(self, *arguments: Any, **options: Any) -> Callable[..., object]:  # noqa: ANN401 - The channel's own.
        return self._calls(self._channel.unary_stream(*arguments, **options))

    def stream_unary(self, *arguments: Any, **options: Any) -> Callable[..., object]:  # noqa: ANN401 - The channel's own.
        return self._calls(self._channel.stream_unary(*arguments, **options))

    def stream_stream(self, *arguments: Any, **options: Any) -> Callable[..., object]:  # noqa: ANN401 - The channel's own.
        return self._calls(self._channel.stream_stream(*arguments, **options))

    def _calls(self, method: Callable[..., object], timeout: float | None = None) -> Callable[..., object]:
        def call(*inputs: object) -> object:
            if self._closed:
                raise closed()
            try:
                begun = method(*inputs, metadata=self._metadata or None, timeout=timeout)
            except ValueError:
                # What gRPC raises if another thread has closed the channel just now.
                if self._closed:
                    raise closed() from None
                raise
            if isinstance(begun, grpc.aio.Call):
                self._begun.add(begun)
            return _Stream(begun) if isinstance(begun, Iterator) else begun

        return call


class _Stream(Iterator[object]):
    """The call of a blocking stream, cancelled and deleted before the interpreter ends.

    gRPC's own object takes a lock when it is deleted. While the interpreter ends, that can wait for ever: for a thread of gRPC that
    had the lock when it was stopped.
    """

    def __init__(self, call: Any) -> None:  # noqa: ANN401 - Its class is private to gRPC.
        # Emptied by `_end`, because a finalizer must not refer to the stream itself.
        self._calls = [call]
        weakref.finalize(self, _end, self._calls)

    def __next__(self) -> object:
        try:
            return next(self._call())
        except grpc.RpcError:
            self._call()
            raise

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - Whatever the call has.
        return getattr(self._call(), name)

    def _call(self) -> Any:  # noqa: ANN401 - Its class is private to gRPC.
        if not self._calls:
            # Ends a thread that still runs while the interpreter ends, and prints nothing.
            raise SystemExit
        return self._calls[0]

    def cancel(self) -> None:
        for call in self._calls:
            call.cancel()


def _end(calls: list[Any]) -> None:
    calls.pop().cancel()
