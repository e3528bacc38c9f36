"""What a message may hold: commands cut into requests, annotations the server would not record, bounds on what may be asked for.

A message the server finds too large ends the stream, and every seat on it would have to attach again only to send the same once
more. So nothing of the kind is sent. What the commands mean is not here (see `session`).
"""

import math
from collections.abc import Iterable

from chefshat import pb

# The protocol's bound on commands in one request.
MAX_COMMANDS = 1024
# Bytes at which a request is cut; servers take 64 KiB.
MAX_REQUEST_BYTES = 32 * 1024
# The protocol's bound on one decision's annotations, encoded.
MAX_ANNOTATIONS_BYTES = 4 * 1024
# The protocol's bound on what a seat adds to the game seed.
MAX_ENTROPY_BYTES = 32
# The protocol's bound on the games of a tournament that a participant plays at a time.
MAX_GAMES = 64
# The largest table that the rules know.
MAX_SEATS = 6
# Upper bound of what a command adds to its request besides its own length: a tag and a length.
_COMMAND_OVERHEAD_BYTES = 6


def pack(commands: Iterable[pb.SeatCommand]) -> list[pb.PlayRequest]:
    """The commands, in order, in as few requests as the limits allow: nearly always one."""
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
    """Why the server would not record these annotations, in words; empty if it would."""
    # Numbers are looked at as the message holds them: a large double has become an infinite float.
    if not math.isfinite(annotations.value_estimate):
        return "value_estimate is not a finite number"
    if not all(map(math.isfinite, annotations.action_scores)):
        return "action_scores holds a number that is not finite"
    size = annotations.ByteSize()
    if size > MAX_ANNOTATIONS_BYTES:
        return f"they are {size} bytes long, and {MAX_ANNOTATIONS_BYTES} are allowed"
    return ""
