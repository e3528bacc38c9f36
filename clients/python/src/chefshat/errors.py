"""The exception for refusals by a server and lost connections, its conversion from gRPC, and error output of commands.

Wrong arguments raise ValueError or TypeError; exceptions of agents propagate unchanged. gRPC is only imported where one of its
errors or codes is at hand, since environments in this process work without it.
"""

import json
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING

from chefshat import pb

if TYPE_CHECKING:
    import grpc

DETAILS_KEY = "grpc-status-details-bin"
#: Reason of a connection whose server is not trusted or does not use TLS.
TLS_FAILED = "TLS_FAILED"
# What gRPC writes into the message of such a connection.
_TLS_MARKS = ("SSL_ERROR_SSL", "Verification Check failed")
#: Exit code of a command ended by Ctrl-C, by the convention of shells.
INTERRUPTED = 130

# Names of the codes after which a retry with the same arguments is pointless.
_FINAL_CODES = frozenset(
    {
        "INVALID_ARGUMENT",
        "NOT_FOUND",
        "ALREADY_EXISTS",
        "PERMISSION_DENIED",
        "FAILED_PRECONDITION",
        "OUT_OF_RANGE",
        "UNIMPLEMENTED",
        "UNAUTHENTICATED",
    }
)


class ChefsHatError(Exception):
    """A refusal by a server, or a connection that could not be restored.

    Attributes:
        reason: the reason in UPPER_SNAKE, for programs, for example "ROOM_FULL" or "TICKET_UNKNOWN". Without a reason from the
            server it is the name of the gRPC code, for example "UNAVAILABLE".
        message: the reason in words, for people.
        metadata: names the offending field or limit; may be empty.
        code: the gRPC status code; for a refusal inside a stream, the code that a unary call would return. None if there is none.
    """

    def __init__(
        self,
        reason: str,
        message: str = "",
        metadata: Mapping[str, str] | None = None,
        code: "grpc.StatusCode | None" = None,
    ) -> None:
        super().__init__(f"{reason}: {message}" if message else reason)
        self.reason = reason
        self.message = message
        self.metadata = dict(metadata or {})
        self.code = code

    @property
    def retryable(self) -> bool:
        """Whether the same attempt may succeed later (a lost connection, a restarting server)."""
        return self.code is not None and self.code.name not in _FINAL_CODES and self.reason != TLS_FAILED


def connection_lost(message: str = "the server ended the stream before the game was over") -> ChefsHatError:
    """Returns the error for a stream that ended without an error status."""
    from chefshat.network import grpc

    return ChefsHatError("CONNECTION_LOST", message, code=grpc.StatusCode.UNAVAILABLE)


def closed() -> ChefsHatError:
    """Returns the error for a call of a client that has been closed."""
    return ChefsHatError("CLIENT_CLOSED", "this client has been closed: create another one")


def from_refused(refused: pb.Refused) -> ChefsHatError:
    """Converts a refusal inside a stream."""
    from chefshat.network import grpc

    # 0 means unset here, since a refusal is never OK.
    code = next((code for code in grpc.StatusCode if refused.code and code.value[0] == refused.code), None)
    return ChefsHatError(refused.reason, refused.message, refused.metadata, code)


def from_rpc_error(error: "grpc.RpcError | grpc.Call") -> ChefsHatError:
    """Converts the error of a call, or the failed call, blocking or asyncio, with reason and metadata from google.rpc.ErrorInfo."""
    from chefshat.network import grpc

    # Errors of calls have these methods, but their common base class does not declare them.
    code = getattr(error, "code", lambda: None)() or grpc.StatusCode.UNKNOWN
    message = getattr(error, "details", lambda: None)() or ""
    trailers = getattr(error, "trailing_metadata", lambda: None)() or ()
    reason, metadata = _error_info(trailers)
    if code is grpc.StatusCode.UNAVAILABLE and any(mark in message for mark in _TLS_MARKS):
        how = "for a certificate of a private authority, give the authority's file as ca=, --ca or CHEFSHAT_CA"
        return ChefsHatError(TLS_FAILED, f"no secure connection ({message}); {how}", code=code)
    if reason == "TOKEN_MISSING":
        message = f"{message}; give it as token=, --token or CHEFSHAT_TOKEN"
    elif code is grpc.StatusCode.DEADLINE_EXCEEDED and not reason:
        message = "the server did not answer in time: try again, or give the client a longer timeout="
    elif code is grpc.StatusCode.UNAVAILABLE and not reason:
        # gRPC's message includes the address.
        message = f"no server answers ({message}): check that `chefshat serve` runs there, and give its address as HOST:PORT"
    return ChefsHatError(reason or code.name, message, metadata, code)


def _error_info(trailers: Iterable[tuple[str, str | bytes]]) -> tuple[str, dict[str, str]]:
    """Returns the reason and metadata in a call's trailers; empty if the server gave none."""
    from google.rpc import error_details_pb2, status_pb2

    for key, value in trailers:
        if key != DETAILS_KEY or not isinstance(value, bytes):
            continue
        status = status_pb2.Status.FromString(value)
        for detail in status.details:
            info = error_details_pb2.ErrorInfo()
            if detail.Is(info.DESCRIPTOR) and detail.Unpack(info):
                return info.reason, dict(info.metadata)
    return "", {}


@contextmanager
def first_error() -> Iterator[None]:
    """Raises the first error of a task group alone, with the cause that it has: it may be an agent's."""
    try:
        yield
    except BaseExceptionGroup as failed:
        error = failed.exceptions[0]
        raise error from error.__cause__


def exit_code(command: Callable[[], int], *refusals: type[Exception], as_json: bool) -> int:
    """Runs a command and prints the errors it raises.

    Args:
        command: returns the exit code. The message of its KeyboardInterrupt is printed.
        refusals: errors besides ChefsHatError and OSError, whose messages say what to do.
        as_json: see `failed`.

    Returns:
        The exit code of the command; 1 if it raised an error, 130 if Ctrl-C ended it.
    """
    expected: tuple[type[Exception], ...] = (ChefsHatError, OSError, *refusals)
    try:
        return command()
    except expected as error:
        return failed(error, as_json=as_json)
    except KeyboardInterrupt as interrupt:
        print("; ".join(["interrupted", *filter(None, [str(interrupt)])]), file=sys.stderr)
        return INTERRUPTED


def failed(error: Exception, *, as_json: bool) -> int:
    """Prints an error: a line of JSON on standard output, or words on standard error. Returns the exit code.

    The line has `event` ("error"), `reason`, `message` and, for a `ChefsHatError`, `metadata`. The reason of another error is
    "REFUSED".
    """
    if as_json:
        line: dict[str, object] = {"event": "error", "reason": "REFUSED", "message": str(error)}
        if isinstance(error, ChefsHatError):
            line.update(reason=error.reason, message=error.message, metadata=error.metadata)
        print(json.dumps(line), flush=True)
    else:
        print(f"error: {error}", file=sys.stderr)
    return 1
