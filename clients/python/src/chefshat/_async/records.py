"""The calls of RecordService. See `calls`."""

from collections.abc import AsyncIterator

from chefshat import pb
from chefshat._async.connection import AsyncConnection
from chefshat._gen.chefshat.v1.record_service_pb2_grpc import RecordServiceStub
from chefshat.requests import async_pages, async_streamed


class AsyncRecords:
    """Lists and reads the records of finished games."""

    def __init__(self, connection: AsyncConnection) -> None:
        self._records = RecordServiceStub(connection.channel)

    def list(self, wanted: pb.RecordFilter | None = None, *, newest_first: bool = False) -> AsyncIterator[pb.RecordSummary]:
        """Iterates over the server's records that match a filter, oldest first by default. Fetches pages on demand."""
        request = pb.ListRecordsRequest(filter=wanted, newest_first=newest_first)
        return async_pages(self._records.ListRecords, request, lambda page: page.records)

    async def read(self, game_id: str) -> AsyncIterator[pb.RecordLine]:
        """Iterates over the lines of a finished game's record."""
        async for response in async_streamed(self._records.GetRecord, pb.GetRecordRequest(game_id=game_id)):
            for line in response.lines:
                yield line
