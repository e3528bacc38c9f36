"""The calls of TableService. See `calls`."""

import secrets
from collections.abc import AsyncIterator
from contextlib import aclosing

from chefshat import pb
from chefshat._async.connection import AsyncConnection
from chefshat._gen.chefshat.v1.table_service_pb2_grpc import TableServiceStub
from chefshat.errors import ChefsHatError
from chefshat.requests import awaited


class AsyncTables:
    """Reports what happens at physical tables, where real cards are played, and follows their state."""

    def __init__(self, connection: AsyncConnection) -> None:
        self._connection = connection
        self._table = TableServiceStub(connection.channel)

    async def report(self, table_ticket: str, report: pb.TableReport, *, report_id: str = "") -> pb.ReportResponse:
        """Reports something that happened at a physical table.

        Args:
            table_ticket: the ticket of the table, from `rooms.create`.
            report: what happened.
            report_id: identifies the report, 1..=64 characters, so that it can be repeated safely; empty: a random one.

        Returns:
            The verdict of the referee, and the state of the table afterwards. A report that the rules or the cards do not allow is
            no error: see `verdict` and `detail`. Repeats the report while the server cannot be reached.
        """
        request = pb.ReportRequest(table_ticket=table_ticket, report_id=report_id or secrets.token_hex(16), report=report)
        failures = 0
        while True:
            try:
                return await awaited(self._table.Report, request)
            except ChefsHatError as error:
                failures += 1
                await self._connection.wait(failures, error)

    async def watch(self, table_ticket: str) -> AsyncIterator[pb.TableState]:
        """Iterates over the state of a physical table: now, and after every change, until its game is over. Reconnects.

        Args:
            table_ticket: the ticket of the table, from `rooms.create`.
        """
        request = pb.TableServiceWatchRequest(table_ticket=table_ticket)
        unfinished = "the server ended the stream before the game was over"
        messages = self._connection.messages(lambda: self._table.Watch(request), unfinished)
        async with aclosing(messages):
            async for message in messages:
                if message.HasField("state"):  # Others are heartbeats.
                    yield message.state
                    if message.state.stage == pb.TABLE_STAGE_OVER:
                        return
