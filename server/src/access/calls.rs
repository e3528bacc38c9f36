//! The minimal role of every call, in one table. A test compares it with the services that the
//! server has, so no call is forgotten; a call that is not listed is not served.

use super::caller::Role::{self, Admin, Anyone, Host, Player, Spectator};
use Scoped::{Compared, Refused, Unlimited};

/// What a token that is limited to one room or tournament may do with a call.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scoped {
    /// Nothing: the call is about no room or tournament that exists.
    Refused,
    /// The service compares what the call is about with the caller's scope.
    Compared,
    /// As much as any other token.
    Unlimited,
}

/// What a call requires of its caller.
#[derive(Debug, Clone, Copy)]
pub struct Call {
    /// Its path, as in HTTP.
    pub path: &'static str,
    /// The minimal role.
    pub role: Role,
    /// What a scoped token may do with it.
    pub scoped: Scoped,
    /// Whether it reads records, for which the server may require a higher role.
    pub reads_records: bool,
    /// Whether its requests or answers are a stream.
    pub streams: bool,
    /// Whether its request, a single message, may be about a room or tournament of another node.
    pub forwarded: bool,
}

impl Call {
    /// The requirements of the call with this path.
    pub fn find(path: &str) -> Option<&'static Self> {
        let mut calls = CALLS.iter().chain(CALLS_OF_NODES);
        calls.find(|call| call.path == path)
    }

    const fn streaming(self) -> Self {
        Self {
            streams: true,
            ..self
        }
    }

    const fn forwarded(self) -> Self {
        Self {
            forwarded: true,
            ..self
        }
    }
}

const fn call(path: &'static str, role: Role, scoped: Scoped) -> Call {
    Call {
        path,
        role,
        scoped,
        reads_records: false,
        streams: false,
        forwarded: false,
    }
}

const fn records(path: &'static str) -> Call {
    Call {
        path,
        role: Role::Spectator,
        scoped: Scoped::Compared,
        reads_records: true,
        streams: false,
        forwarded: false,
    }
}

/// Every call of the server. Those played most often come first.
pub const CALLS: &[Call] = &[
    call("/chefshat.v1.PlayService/Act", Player, Compared).forwarded(),
    call("/chefshat.v1.PlayService/Play", Player, Compared).streaming(),
    call("/chefshat.v1.PlayService/Watch", Player, Compared).streaming(),
    call("/chefshat.v1.SpectatorService/Watch", Spectator, Compared)
        .streaming()
        .forwarded(),
    call("/chefshat.v1.TableService/Report", Player, Compared).forwarded(),
    call("/chefshat.v1.TableService/Watch", Player, Compared)
        .streaming()
        .forwarded(),
    call("/chefshat.v1.InstrumentService/AddMarker", Host, Compared).forwarded(),
    call(
        "/chefshat.v1.InstrumentService/FollowMarkers",
        Host,
        Compared,
    )
    .streaming()
    .forwarded(),
    call(
        "/chefshat.v1.InstrumentService/AddSamples",
        Player,
        Compared,
    )
    .forwarded(),
    call("/chefshat.v1.RoomService/GetRoom", Spectator, Compared).forwarded(),
    call("/chefshat.v1.RoomService/ListRooms", Spectator, Compared),
    call("/chefshat.v1.RoomService/JoinRoom", Player, Compared).forwarded(),
    call("/chefshat.v1.RoomService/LeaveRoom", Player, Compared).forwarded(),
    call("/chefshat.v1.RoomService/CreateRoom", Host, Refused).forwarded(),
    call("/chefshat.v1.RoomService/CloseRoom", Host, Compared).forwarded(),
    call("/chefshat.v1.RoomService/SetNextRoom", Host, Compared).forwarded(),
    call("/chefshat.v1.StudyService/CreateStudy", Host, Refused).forwarded(),
    call("/chefshat.v1.StudyService/GetStudy", Spectator, Refused).forwarded(),
    call("/chefshat.v1.StudyService/ListStudies", Spectator, Refused),
    call(
        "/chefshat.v1.StudyService/AddStudyParticipants",
        Host,
        Refused,
    )
    .forwarded(),
    call("/chefshat.v1.StudyService/ListStudyLinks", Host, Refused).forwarded(),
    call("/chefshat.v1.StudyService/FollowStudy", Spectator, Refused)
        .streaming()
        .forwarded(),
    call(
        "/chefshat.v1.StudyService/RemoveStudyParticipant",
        Host,
        Refused,
    )
    .forwarded(),
    call("/chefshat.v1.StudyService/CloseStudy", Host, Refused).forwarded(),
    call("/chefshat.v1.StudyService/ExportStudy", Host, Refused)
        .streaming()
        .forwarded(),
    call(
        "/chefshat.v1.StudyService/DeleteStudyParticipant",
        Host,
        Refused,
    )
    .forwarded(),
    call("/chefshat.v1.StudyService/DeleteStudy", Host, Refused).forwarded(),
    call(
        "/chefshat.v1.ParticipationService/OpenStudy",
        Player,
        Refused,
    )
    .forwarded(),
    call(
        "/chefshat.v1.ParticipationService/FollowParticipation",
        Player,
        Refused,
    )
    .streaming()
    .forwarded(),
    call(
        "/chefshat.v1.ParticipationService/GiveConsent",
        Player,
        Refused,
    )
    .forwarded(),
    call(
        "/chefshat.v1.ParticipationService/AnswerQuestionnaire",
        Player,
        Refused,
    )
    .forwarded(),
    call(
        "/chefshat.v1.ParticipationService/ContinueStudy",
        Player,
        Refused,
    )
    .forwarded(),
    call(
        "/chefshat.v1.ParticipationService/RecordTraces",
        Player,
        Refused,
    )
    .forwarded(),
    call(
        "/chefshat.v1.ParticipationService/WithdrawFromStudy",
        Player,
        Refused,
    )
    .forwarded(),
    call(
        "/chefshat.v1.TournamentService/GetTournament",
        Spectator,
        Compared,
    )
    .forwarded(),
    call(
        "/chefshat.v1.TournamentService/ListTournaments",
        Spectator,
        Compared,
    ),
    call(
        "/chefshat.v1.TournamentService/FollowTournament",
        Spectator,
        Compared,
    )
    .streaming()
    .forwarded(),
    call(
        "/chefshat.v1.TournamentService/GetTournamentResults",
        Spectator,
        Compared,
    )
    .forwarded(),
    call(
        "/chefshat.v1.TournamentService/ListTournamentGames",
        Spectator,
        Compared,
    )
    .forwarded(),
    call(
        "/chefshat.v1.TournamentService/GetLeaderboard",
        Spectator,
        Refused,
    ),
    call(
        "/chefshat.v1.TournamentService/JoinTournament",
        Player,
        Compared,
    )
    .forwarded(),
    call(
        "/chefshat.v1.TournamentService/CreateTournament",
        Host,
        Refused,
    )
    .forwarded(),
    call(
        "/chefshat.v1.TournamentService/AddTableParticipant",
        Host,
        Compared,
    )
    .forwarded(),
    call(
        "/chefshat.v1.TournamentService/GetPhysicalTable",
        Host,
        Compared,
    )
    .forwarded(),
    call(
        "/chefshat.v1.TournamentService/StartTournament",
        Host,
        Compared,
    )
    .forwarded(),
    call(
        "/chefshat.v1.TournamentService/CloseTournament",
        Host,
        Compared,
    )
    .forwarded(),
    call(
        "/chefshat.v1.TournamentService/WithdrawParticipant",
        Player,
        Compared,
    )
    .forwarded(),
    call(
        "/chefshat.v1.TournamentService/RemoveParticipant",
        Host,
        Compared,
    )
    .forwarded(),
    call(
        "/chefshat.v1.TournamentService/ReplaceParticipant",
        Host,
        Compared,
    )
    .forwarded(),
    call(
        "/chefshat.v1.TournamentService/PauseTournament",
        Host,
        Compared,
    )
    .forwarded(),
    call(
        "/chefshat.v1.TournamentService/ResumeTournament",
        Host,
        Compared,
    )
    .forwarded(),
    call(
        "/chefshat.v1.TournamentService/PostponeGame",
        Player,
        Compared,
    )
    .forwarded(),
    call("/chefshat.v1.TournamentService/CallGame", Host, Compared).forwarded(),
    records("/chefshat.v1.RecordService/ListRecords"),
    records("/chefshat.v1.RecordService/GetRecord")
        .streaming()
        .forwarded(),
    records("/chefshat.v1.RecordService/StreamRecords").streaming(),
    call("/chefshat.v1.RecordService/ImportRecord", Host, Refused).streaming(),
    call("/chefshat.v1.VectorService/Run", Player, Refused).streaming(),
    call("/chefshat.v1.AnalysisService/Evaluate", Player, Compared)
        .streaming()
        .forwarded(),
    call(
        "/chefshat.v1.AnalysisService/LegalActions",
        Player,
        Compared,
    )
    .forwarded(),
    call("/chefshat.v1.AdminService/ListClients", Admin, Refused),
    call("/chefshat.v1.AdminService/DisconnectClient", Admin, Refused),
    call("/chefshat.v1.AdminService/CloseRoom", Admin, Refused).forwarded(),
    call("/chefshat.v1.AdminService/CloseTournament", Admin, Refused).forwarded(),
    call("/chefshat.v1.AdminService/GetStorage", Admin, Refused),
    call("/chefshat.v1.AdminService/PruneRecords", Admin, Refused),
    call(
        "/chefshat.v1.AdminService/ExportParticipant",
        Admin,
        Refused,
    )
    .streaming(),
    call(
        "/chefshat.v1.AdminService/DeleteParticipant",
        Admin,
        Refused,
    ),
    call(
        "/chefshat.v1.ServerService/GetServerInfo",
        Anyone,
        Unlimited,
    ),
    call(
        "/chefshat.v1.ServerService/GetActionTable",
        Spectator,
        Unlimited,
    ),
    call("/chefshat.v1.ServerService/GetClock", Spectator, Compared).forwarded(),
    call("/grpc.health.v1.Health/Check", Anyone, Unlimited),
    call("/grpc.health.v1.Health/Watch", Anyone, Unlimited).streaming(),
    call(
        "/grpc.reflection.v1.ServerReflection/ServerReflectionInfo",
        Anyone,
        Unlimited,
    )
    .streaming(),
];

/// The calls that only nodes make of each other, on a listener of their own. The rest of the server
/// does not have them.
const CALLS_OF_NODES: &[Call] = &[
    call("/chefshat.peer.v1.PeerService/Play", Player, Compared).streaming(),
    call("/chefshat.peer.v1.PeerService/Share", Anyone, Unlimited).streaming(),
];

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use prost::Message as _;

    use super::*;

    /// The calls of all services, and whether their requests or answers are streams.
    fn served() -> BTreeSet<(String, bool)> {
        let descriptors = [
            chefshat_proto::DESCRIPTORS,
            tonic_health::pb::FILE_DESCRIPTOR_SET,
            tonic_reflection::pb::v1::FILE_DESCRIPTOR_SET,
        ];
        let mut served = BTreeSet::new();
        for bytes in descriptors {
            let set = prost_types::FileDescriptorSet::decode(bytes).expect("descriptors");
            for file in &set.file {
                for service in &file.service {
                    for method in &service.method {
                        let (package, service) = (file.package(), service.name());
                        let path = format!("/{package}.{service}/{}", method.name());
                        let streams = method.client_streaming() || method.server_streaming();
                        served.insert((path, streams));
                    }
                }
            }
        }
        served
    }

    #[test]
    fn every_call_of_the_protocol_is_listed_once_with_its_streams() {
        let calls = CALLS
            .iter()
            .map(|call| (call.path.to_owned(), call.streams));
        assert_eq!(calls.collect::<BTreeSet<_>>(), served());
        assert_eq!(served().len(), CALLS.len());
    }
}
