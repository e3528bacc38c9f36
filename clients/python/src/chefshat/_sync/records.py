"""The calls of RecordService. See `calls`."""

from collections.abc import Iterator

from chefshat import pb
from chefshat._gen.chefshat.v1.record_service_pb2_grpc import RecordServiceStub
from chefshat._sync.connection import Connection
from chefshat.requests import pages, streamed


class Records:
    """Lists and reads the records of finished games."""

    def __init__(self, connection: Connection) -> None:
        self._records = RecordServiceStub(connection.channel)

    def list(self, wanted: pb.RecordFilter | None = None, *, newest_first: bool = False) -> Iterator[pb.RecordSummary]:
        """Iterates over the server's records that match a filter, oldest first by default. Fetches pages on demand."""
        request = pb.ListRecordsRequest(filter=wanted, newest_first=newest_first)
        return pages(self._records.ListRecords, request, lambda page: page.records)

    def read(self, game_id: str) -> Iterator[pb.RecordLine]:
        """Iterates over the lines of a finished game's record."""
        for response in streamed(self._records.GetRecord, pb.GetRecordRequest(game_id=game_id)):
            for line in response.lines:
                yield line
