"""How a seat's words travel and are recorded: as expressions (decision.proto), which every client and record has already.

A line that a robot says is an expression with the label "say", whose `media` is the words themselves, as a data URL (RFC 2397):
`data:,` and the text in UTF-8, percent-encoded. Its `source` says who chose the words: MODEL for an agent or a robot's program,
SELF_REPORT for a person, as in a Wizard-of-Oz study. The label "help" is a robot's request to the people at the table, in the same
form. All other labels are feelings to show.
"""

from __future__ import annotations

import logging
from urllib.parse import quote, unquote

from chefshat import ChefsHatError, pb

from chefshat_robot.running import Sender

LOG = logging.getLogger("chefshat_robot")
SAY = "say"
HELP = "help"
PREFIX = "data:,"
# The protocol's bound on `media`, bytes.
MAX_MEDIA = 256
# Characters that a data URL need not encode.
_PLAIN = "!$&'()*+,;=:@/?-._~"


def line(text: str, *, label: str = SAY, by_person: bool = False, record_only: bool = False) -> pb.Expression:
    """Returns the expression for a line. A text that does not fit is cut off, and ends with an ellipsis.

    Args:
        text: the words.
        label: "say" or "help".
        by_person: whether a person chose them, and not a program.
        record_only: whether only the record has it.
    """
    source = pb.EXPRESSION_SOURCE_SELF_REPORT if by_person else pb.EXPRESSION_SOURCE_MODEL
    media = PREFIX + quote(text, safe=_PLAIN)
    while len(media) > MAX_MEDIA:
        text = text[:-2].rstrip() + "…"
        media = PREFIX + quote(text, safe=_PLAIN)
    return pb.Expression(label=label, media=media, source=source, record_only=record_only)


def text_of(expression: pb.Expression) -> str | None:
    """Returns the words of a line; None for any other expression."""
    if expression.label not in (SAY, HELP) or not expression.media.startswith(PREFIX):
        return None
    return unquote(expression.media.removeprefix(PREFIX))


class Outbox(Sender[pb.Expression]):
    """Sends the expressions of a seat. A refused expression is logged."""

    async def _deliver(self, item: pb.Expression) -> None:
        try:
            await self._client.send_expression(self._ticket, item)
        except ChefsHatError as error:
            LOG.info("an expression was not sent: %s", error)
