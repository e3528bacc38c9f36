"""The calls of StudyService. See `calls`."""

from collections.abc import Iterator
from contextlib import closing

from chefshat import pb
from chefshat._gen.chefshat.v1.study_service_pb2_grpc import StudyServiceStub
from chefshat._sync.connection import Connection


class Studies:
    """Follows studies."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._studies = StudyServiceStub(connection.channel)

    def follow(self, study_id: str, owner_token: str) -> Iterator[pb.StudyParticipant]:
        """Iterates over the participants of a study, then over each one that changes, until the study is over. Reconnects.

        Args:
            study_id: the study.
            owner_token: its owner's token.
        """
        request = pb.FollowStudyRequest(study_id=study_id, owner_token=owner_token)
        with closing(self._connection.messages(lambda: self._studies.FollowStudy(request))) as messages:
            for message in messages:
                for participant in message.participants:
                    yield participant
