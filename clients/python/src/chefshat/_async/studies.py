"""The calls of StudyService. See `calls`."""

from collections.abc import AsyncIterator

from chefshat import pb
from chefshat._async.connection import AsyncConnection
from chefshat._gen.chefshat.v1.study_service_pb2_grpc import StudyServiceStub
from chefshat.errors import from_rpc_error
from chefshat.network import grpc


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
        failures = 0
        while True:
            call = self._studies.FollowStudy(pb.FollowStudyRequest(study_id=study_id, owner_token=owner_token))
            try:
                async for response in call:
                    failures = 0
                    for participant in response.participants:
                        yield participant
                return
            except grpc.RpcError as error:
                failures += 1
                await self._connection.wait(failures, from_rpc_error(error))
            finally:
                call.cancel()
