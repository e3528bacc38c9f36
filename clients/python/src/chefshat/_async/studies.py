"""The calls of StudyService. See `calls`."""

from collections.abc import AsyncIterator
from contextlib import aclosing

from chefshat import pb
from chefshat._async.connection import AsyncConnection
from chefshat._gen.chefshat.v1.study_service_pb2_grpc import StudyServiceStub


class AsyncStudies:
    """Follows studies."""

    def __init__(self, connection: AsyncConnection) -> None:
        self._connection = connection
        self._studies = StudyServiceStub(connection.channel)

    async def follow(self, study_id: str, owner_token: str) -> AsyncIterator[pb.StudyParticipant]:
        """Iterates over the participants of a study, then over each one that changes, until the study is over. Reconnects.

        Args:
            study_id: the study.
            owner_token: its owner's token.
        """
        request = pb.FollowStudyRequest(study_id=study_id, owner_token=owner_token)
        async with aclosing(self._connection.messages(lambda: self._studies.FollowStudy(request))) as messages:
            async for message in messages:
                for participant in message.participants:
                    yield participant
