"""All messages and enums of the protocol under one name: `from chefshat import pb`, then `pb.RuleSet(preset="rulebook")`.

The .proto files document the fields; editors show them from the typed stubs. The services' stubs are not here:
`Client` and `aio.Client` wrap them.
"""

# ruff: noqa: F403
from chefshat._gen.chefshat.v1.analysis_service_pb2 import *
from chefshat._gen.chefshat.v1.decision_pb2 import *
from chefshat._gen.chefshat.v1.event_pb2 import *
from chefshat._gen.chefshat.v1.instrument_service_pb2 import *
from chefshat._gen.chefshat.v1.play_service_pb2 import *
from chefshat._gen.chefshat.v1.record_pb2 import *
from chefshat._gen.chefshat.v1.record_service_pb2 import *
from chefshat._gen.chefshat.v1.room_pb2 import *
from chefshat._gen.chefshat.v1.room_service_pb2 import *
from chefshat._gen.chefshat.v1.rules_pb2 import *
from chefshat._gen.chefshat.v1.server_service_pb2 import *
from chefshat._gen.chefshat.v1.spectator_service_pb2 import *
from chefshat._gen.chefshat.v1.study_pb2 import *
from chefshat._gen.chefshat.v1.study_service_pb2 import *
from chefshat._gen.chefshat.v1.table_pb2 import *
from chefshat._gen.chefshat.v1.table_service_pb2 import *
from chefshat._gen.chefshat.v1.tournament_pb2 import *
from chefshat._gen.chefshat.v1.tournament_service_pb2 import *
from chefshat._gen.chefshat.v1.vector_service_pb2 import *
