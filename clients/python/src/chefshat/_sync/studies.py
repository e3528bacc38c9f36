"""The calls of StudyService. See `calls`."""

from collections.abc import Iterator

from chefshat import pb
from chefshat._gen.chefshat.v1.study_service_pb2_grpc import StudyServiceStub
from chefshat._sync.connection import Connection
from chefshat.errors import from_rpc_error
from chefshat.network import grpc


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
        failures = 0
        while True:
            call = self._studies.FollowStudy(pb.FollowStudyRequest(study_id=study_id, owner_token=owner_token))
            try:
                for response in call:
                    failures = 0
                    for participant in response.participants:
                        yield participant
                return
            except grpc.RpcError as error:
                failures += 1
                self._connection.wait(failures, from_rpc_error(error))
            finally:
                call.cancel()
