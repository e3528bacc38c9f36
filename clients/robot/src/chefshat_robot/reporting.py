"""A robot's own reports to a physical table: what it has carried, it has laid, passed or given.

With them a table needs no camera for the robot's seat; with a camera they do no harm: the referee recognises repeated reports.
"""

from __future__ import annotations

import logging

from chefshat import ChefsHatError, pb

from chefshat_robot import layout
from chefshat_robot.drivers.driver import Pick
from chefshat_robot.running import Sender
from chefshat_robot.table import TableState

LOG = logging.getLogger("chefshat_robot")


class Reporter(Sender[pb.TableReport]):
    """Reports what a robot has carried."""

    def carried(self, pick: Pick, state: TableState) -> None:
        """Queues the report for pieces that were carried, if they mean something in the game."""
        report = report_of(pick, state)
        if report is not None:
            self.send(report)

    async def _deliver(self, item: pb.TableReport) -> None:
        try:
            response = await self._client.tables.report(self._ticket, item)
            if response.verdict not in (pb.REPORT_VERDICT_ACCEPTED, pb.REPORT_VERDICT_KNOWN):
                LOG.warning("the referee did not accept what the robot did: %s", response.detail)
        except ChefsHatError as error:
            LOG.warning("what the robot did was not reported: %s", error)


def report_of(pick: Pick, state: TableState) -> pb.TableReport | None:
    """Returns the report for pieces that a robot has carried; None if they mean nothing, as a pass card taken back."""
    seat = state.seat
    if seat is None:
        return None
    report = pb.TableReport(source=pb.REPORT_SOURCE_ROBOT)
    pieces = [move.piece for move in pick.moves]
    ends = [move.end for move in pick.moves]
    if pieces == ["pass"]:
        if ends[0] != layout.pass_place(seat):
            return None
        getattr(report, "pass").CopyFrom(pb.PassShown(seat=seat))
        return report
    cards = pb.SeenCards(cards=[card_of(piece, state.faces) for piece in pieces], golden="golden" in pieces)
    if ends[0] == layout.play_places(1)[0]:
        report.laid.CopyFrom(pb.CardsLaid(seat=seat, cards=cards))
    else:
        report.gift.CopyFrom(pb.GiftSeen(seat=seat, cards=cards))
    return report


def card_of(piece: str, faces: int) -> int:
    """Returns the number of a card: its face, or F+1 for a joker."""
    return {"golden": faces, "joker": faces + 1}.get(piece) or int(piece)
