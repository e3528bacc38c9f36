"""Limits of messages: packs commands into requests, and checks annotations.

A message above the server's limit would end the stream, and after reconnecting the client would send it again. So the limits are
checked here. The meaning of the commands is in `session`.
"""

import math
from collections.abc import Iterable

from chefshat import pb

# The protocol's bound on commands in one request.
MAX_COMMANDS = 1024
# Maximum bytes of a request; servers accept 64 KiB.
MAX_REQUEST_BYTES = 32 * 1024
# The protocol's bound on one decision's annotations, encoded.
MAX_ANNOTATIONS_BYTES = 4 * 1024
# The protocol's bound on a seat's contribution to the game seed.
MAX_ENTROPY_BYTES = 32
# The protocol's bound on the games of a tournament that a participant plays at a time.
MAX_GAMES = 64
# The protocol's bound on the seats of a table.
MAX_SEATS = 6
# Upper bound of a command's overhead in a request: a tag and a length.
_COMMAND_OVERHEAD_BYTES = 6


def pack(commands: Iterable[pb.SeatCommand]) -> list[pb.PlayRequest]:
    """Packs the commands, in order, into as few requests as the limits allow: nearly always one."""
    batches: list[list[pb.SeatCommand]] = []
    taken = 0
    for command in commands:
        size = command.ByteSize() + _COMMAND_OVERHEAD_BYTES
        taken += size
        if batches and taken <= MAX_REQUEST_BYTES and len(batches[-1]) < MAX_COMMANDS:
            batches[-1].append(command)
        else:
            batches.append([command])
            taken = size
    return [pb.PlayRequest(commands=batch) for batch in batches]


def why_not_recorded(annotations: pb.Annotations) -> str:
    """Returns why the server would not record these annotations; empty if it would."""
    # Checks the numbers as the message stores them: a large double becomes an infinite float.
    if not math.isfinite(annotations.value_estimate):
        return "value_estimate is not a finite number"
    if not all(map(math.isfinite, annotations.action_scores)):
        return "action_scores has a number that is not finite"
    size = annotations.ByteSize()
    if size > MAX_ANNOTATIONS_BYTES:
        return f"they are {size} bytes long; the maximum is {MAX_ANNOTATIONS_BYTES}"
    return ""
