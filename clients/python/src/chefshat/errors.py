"""The one exception this package raises for what a server refuses or a connection suffers: made from gRPC, told by commands.

Wrong use of the package itself (a bad argument) raises ValueError or TypeError; what an agent raises is passed on untouched.
"""

import json
import sys
from collections.abc import Callable, Iterable, Mapping

import grpc
from google.rpc import error_details_pb2, status_pb2

from chefshat import pb

DETAILS_KEY = "grpc-status-details-bin"
#: Exit code of a command that Ctrl-C ended, as shells have it.
INTERRUPTED = 130

# The codes by their numbers on the wire.
_CODES: dict[int, grpc.StatusCode] = {code.value[0]: code for code in grpc.StatusCode}

# Codes after which trying again with the same arguments cannot help.
_FINAL_CODES = frozenset(
    {
        grpc.StatusCode.INVALID_ARGUMENT,
        grpc.StatusCode.NOT_FOUND,
        grpc.StatusCode.ALREADY_EXISTS,
        grpc.StatusCode.PERMISSION_DENIED,
        grpc.StatusCode.FAILED_PRECONDITION,
        grpc.StatusCode.OUT_OF_RANGE,
        grpc.StatusCode.UNIMPLEMENTED,
        grpc.StatusCode.UNAUTHENTICATED,
    }
)


class ChefsHatError(Exception):
    """Something a server refused, or a connection that is lost for good.

    Attributes:
        reason: why, in UPPER_SNAKE, for programs: for instance "ROOM_FULL" or "TICKET_UNKNOWN". Without a reason from the server it
            is the name of the gRPC code, for instance "UNAVAILABLE".
        message: the same in words, for people.
        metadata: names the offending field or limit; may be empty.
        code: the gRPC status code; where the refusal came inside a stream, the one a call of its own would have ended with. None if
            there is none.
    """

    def __init__(
        self,
        reason: str,
        message: str = "",
        metadata: Mapping[str, str] | None = None,
        code: grpc.StatusCode | None = None,
    ) -> None:
        super().__init__(f"{reason}: {message}" if message else reason)
        self.reason = reason
        self.message = message
        self.metadata = dict(metadata or {})
        self.code = code

    @property
    def retryable(self) -> bool:
        """Whether the same attempt may succeed later (a lost connection, a restarting server)."""
        return self.code is not None and self.code not in _FINAL_CODES


def connection_lost(message: str = "the server ended the stream before the game was over") -> ChefsHatError:
    """The error of a stream that ended without a status that says why."""
    return ChefsHatError("CONNECTION_LOST", message, code=grpc.StatusCode.UNAVAILABLE)


def from_refused(refused: pb.Refused) -> ChefsHatError:
    """Reads a refusal that came inside a stream."""
    # 0 is both "OK" and "not set", and no refusal is OK.
    code = _CODES.get(refused.code) if refused.code else None
    return ChefsHatError(refused.reason, refused.message, refused.metadata, code)


def from_rpc_error(error: grpc.RpcError) -> ChefsHatError:
    """Reads reason and metadata (google.rpc.ErrorInfo) out of a failed call, blocking or asyncio."""
    # Every error grpcio raises from a call is a call too, but the common base class does not say so.
    code = getattr(error, "code", lambda: None)() or grpc.StatusCode.UNKNOWN
    message = getattr(error, "details", lambda: None)() or ""
    trailers = getattr(error, "trailing_metadata", lambda: None)() or ()
    reason, metadata = _error_info(trailers)
    if code is grpc.StatusCode.UNAVAILABLE and not reason:
        # These are gRPC's own words, which say where it tried.
        message = f"no server answers ({message}): see that `chefshat serve` runs there, and give its address as HOST:PORT"
    return ChefsHatError(reason or code.name, message, metadata, code)


def _error_info(trailers: Iterable[tuple[str, str | bytes]]) -> tuple[str, dict[str, str]]:
    """The reason and metadata in a call's trailers; empty where the server gave none."""
    for key, value in trailers:
        if key != DETAILS_KEY or not isinstance(value, bytes):
            continue
        status = status_pb2.Status.FromString(value)
        for detail in status.details:
            info = error_details_pb2.ErrorInfo()
            if detail.Is(info.DESCRIPTOR) and detail.Unpack(info):
                return info.reason, dict(info.metadata)
    return "", {}


def exit_code(command: Callable[[], int], *refusals: type[Exception], as_json: bool) -> int:
    """Runs a command, and tells what it raises.

    Args:
        command: gives the exit code. A KeyboardInterrupt of its may say in words what is left.
        refusals: what it may raise besides ChefsHatError and OSError, each with a message that says what to do.
        as_json: see `failed`.

    Returns:
        Its exit code; 1 where it raised an error, 130 where Ctrl-C ended it.
    """
    told: tuple[type[Exception], ...] = (ChefsHatError, OSError, *refusals)
    try:
        return command()
    except told as error:
        return failed(error, as_json=as_json)
    except KeyboardInterrupt as interrupt:
        print("; ".join(["interrupted", *filter(None, [str(interrupt)])]), file=sys.stderr)
        return INTERRUPTED


def failed(error: Exception, *, as_json: bool) -> int:
    """What a command says of an error: a line of JSON on standard output, or words on standard error. Returns its exit code.

    The line has `event` ("error"), `reason`, `message` and, of a refusal by the server, `metadata`: those of `ChefsHatError`. The
    reason of another error is "REFUSED".
    """
    if as_json:
        said: dict[str, object] = {"event": "error", "reason": "REFUSED", "message": str(error)}
        if isinstance(error, ChefsHatError):
            said.update(reason=error.reason, message=error.message, metadata=error.metadata)
        print(json.dumps(said), flush=True)
    else:
        print(f"error: {error}", file=sys.stderr)
    return 1
