//! The minimal role of every call, and what its messages may cost, in one table. A test compares it
//! with the services that the server has, so no call is forgotten; a call that is not listed is not
//! served.

use std::collections::HashMap;
use std::sync::LazyLock;

use super::caller::Role::{self, Admin, Anyone, Host, Player, Spectator};
use Scoped::{Compared, Refused, Unlimited};

/// Largest message a client may send, bytes.
pub const MAX_MESSAGE_BYTES: usize = 64 * 1024;
/// Largest message from a node to the owner of seats, bytes: inputs of one client, each of which was
/// in a message of its own at most.
const MAX_PEER_REQUEST_BYTES: usize = MAX_INPUTS_PER_MESSAGE * (MAX_MESSAGE_BYTES + 1024);
/// Most inputs of a client in one message between nodes.
pub const MAX_INPUTS_PER_MESSAGE: usize = 64;
/// Largest message of a vector stream, bytes: large enough for a list of seeds.
pub const MAX_VECTOR_MESSAGE_BYTES: usize = 1024 * 1024;
/// Largest request about a study, bytes.
pub const MAX_STUDY_MESSAGE_BYTES: usize = 1024 * 1024;
/// What players send to a node that does not have their room.
const PLAY_OF_NODES: &str = "/chefshat.peer.v1.PeerService/Play";
const KIB: usize = 1024;
const MIB: usize = 1024 * KIB;
/// Calls that opening a stream counts as.
pub const COST_OF_STREAM: u64 = 5;

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

/// What one message of a call may be, as it is sent and as it is decoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MessageLimits {
    /// Bytes of the longest message.
    pub bytes: usize,
    /// Most submessages, texts in lists and entries of maps.
    pub elements: usize,
    /// Most bytes of memory that decoding takes: the largest permit of a message.
    pub memory: usize,
}

impl MessageLimits {
    /// Names, ids, codes, tickets and a few numbers: what most calls need.
    pub const USUAL: Self = Self {
        bytes: 4 * KIB,
        elements: 64,
        memory: 128 * KIB,
    };
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
    /// Whether its answers are a stream that carries heartbeats.
    pub heartbeats: bool,
    /// Whether its request, a single message, may be about a room or tournament of another node.
    pub forwarded: bool,
    /// Whether its client sends a stream of messages.
    pub sends_many: bool,
    /// Whether its service limits the rate of what its client sends.
    pub has_own_rate: bool,
    /// Whether each message of its client counts as a call, and its answers as those of calls: they
    /// are larger, and nothing else limits their number.
    pub charges_each: bool,
    /// What each of its messages may be.
    pub message: MessageLimits,
    /// Calls that it counts as for its caller. Decoding a large message counts besides.
    pub charge: u64,
}

impl Call {
    /// The requirements of the call with this path.
    pub fn find(path: &str) -> Option<&'static Self> {
        static BY_PATH: LazyLock<HashMap<&str, &Call>> =
            LazyLock::new(|| Call::all().map(|call| (call.path, call)).collect());
        BY_PATH.get(path).copied()
    }

    /// Every call, those between nodes included.
    pub fn all() -> impl Iterator<Item = &'static Self> {
        CALLS.iter().chain(CALLS_OF_NODES)
    }

    /// The longest message of all calls of a service, such as `chefshat.v1.PlayService`.
    pub fn longest_message_of(service: &str) -> usize {
        let calls = Self::all().filter(|call| call.service() == service);
        calls.map(|call| call.message.bytes).max().unwrap_or(0)
    }

    /// Whether its messages are of players, or make the decisions at a physical table: they do not
    /// wait for the messages of others.
    pub fn plays(&self) -> bool {
        let services = ["chefshat.v1.PlayService", "chefshat.v1.TableService"];
        services.contains(&self.service()) || self.path == PLAY_OF_NODES
    }

    /// The full name of its service.
    fn service(&self) -> &'static str {
        let path = self.path.trim_start_matches('/');
        path.split_once('/').map_or(path, |(service, _)| service)
    }

    const fn streaming(mut self) -> Self {
        self.streams = true;
        self.charge = COST_OF_STREAM;
        self
    }

    /// Its client receives what happens, as it happens.
    const fn following(mut self) -> Self {
        self.heartbeats = true;
        self.streaming()
    }

    /// Its client sends a stream.
    const fn sending(mut self) -> Self {
        self.sends_many = true;
        self.streaming().not_forwarded()
    }

    /// Its service limits the rate of the stream that its client sends.
    const fn with_own_rate(mut self) -> Self {
        self.has_own_rate = true;
        self
    }

    /// Each message of its client counts as a call.
    const fn charging_each(mut self) -> Self {
        self.charges_each = true;
        self
    }

    const fn takes(mut self, bytes: usize, elements: usize, memory: usize) -> Self {
        self.message = MessageLimits {
            bytes,
            elements,
            memory,
        };
        self
    }

    /// It is about nothing that one node has.
    const fn not_forwarded(mut self) -> Self {
        self.forwarded = false;
        self
    }

    const fn reading_records(mut self) -> Self {
        self.reads_records = true;
        self
    }
}

const fn call(path: &'static str, role: Role, scoped: Scoped) -> Call {
    Call {
        path,
        role,
        scoped,
        reads_records: false,
        streams: false,
        heartbeats: false,
        forwarded: true,
        sends_many: false,
        has_own_rate: false,
        charges_each: false,
        message: MessageLimits::USUAL,
        charge: 1,
    }
}

/// A call of the protocol, by its service and method.
macro_rules! call {
    ($path:literal, $role:expr, $scoped:expr) => {
        call(concat!("/chefshat.v1.", $path), $role, $scoped)
    };
}

/// Every call of the server. Those played most often come first.
pub const CALLS: &[Call] = &[
    call!("PlayService/Act", Player, Compared).takes(MAX_MESSAGE_BYTES, 1_200, MIB),
    call!("PlayService/Play", Player, Compared)
        .sending()
        .takes(MAX_MESSAGE_BYTES, 8_192, 3 * MIB),
    call!("PlayService/Watch", Player, Compared)
        .not_forwarded()
        .following()
        .takes(16 * KIB, 256, 512 * KIB),
    call!("SpectatorService/Watch", Spectator, Compared).following(),
    call!("TableService/Report", Player, Compared).takes(MAX_MESSAGE_BYTES, 512, 512 * KIB),
    call!("TableService/Watch", Player, Compared).following(),
    call!("InstrumentService/AddMarker", Host, Compared),
    call!("InstrumentService/FollowMarkers", Host, Compared).following(),
    call!("InstrumentService/AddSamples", Player, Compared).takes(MAX_MESSAGE_BYTES, 64, 768 * KIB),
    call!("RoomService/GetRoom", Spectator, Compared),
    call!("RoomService/ListRooms", Spectator, Compared).not_forwarded(),
    call!("RoomService/JoinRoom", Player, Compared),
    call!("RoomService/LeaveRoom", Player, Compared),
    call!("RoomService/CreateRoom", Host, Refused).takes(MAX_MESSAGE_BYTES, 512, 768 * KIB),
    call!("RoomService/CloseRoom", Host, Compared),
    call!("RoomService/SetNextRoom", Player, Compared),
    call!("StudyService/CreateStudy", Host, Refused).takes(
        MAX_STUDY_MESSAGE_BYTES,
        20_000,
        8 * MIB,
    ),
    call!("StudyService/GetStudy", Spectator, Refused),
    call!("StudyService/ListStudies", Spectator, Refused)
        .not_forwarded()
        .takes(16 * KIB, 256, 256 * KIB),
    call!("StudyService/AddStudyParticipants", Host, Refused).takes(320 * KIB, 2_048, MIB),
    call!("StudyService/ListStudyLinks", Host, Refused),
    call!("StudyService/FollowStudy", Spectator, Refused).following(),
    call!("StudyService/RemoveStudyParticipant", Host, Refused),
    call!("StudyService/CloseStudy", Host, Refused),
    call!("StudyService/ExportStudy", Host, Refused).streaming(),
    call!("StudyService/DeleteStudyParticipant", Host, Refused),
    call!("StudyService/DeleteStudy", Host, Refused),
    call!("ParticipationService/JoinStudy", Player, Refused),
    call!("ParticipationService/OpenStudy", Player, Refused),
    call!("ParticipationService/FollowParticipation", Player, Refused).following(),
    call!("ParticipationService/GiveConsent", Player, Refused),
    call!("ParticipationService/AnswerQuestionnaire", Player, Refused).takes(
        MAX_STUDY_MESSAGE_BYTES,
        512,
        3 * MIB,
    ),
    call!("ParticipationService/SaveAnswers", Player, Refused).takes(
        MAX_STUDY_MESSAGE_BYTES,
        512,
        3 * MIB,
    ),
    call!("ParticipationService/ContinueStudy", Player, Refused),
    call!("ParticipationService/RecordTraces", Player, Refused).takes(192 * KIB, 1_024, MIB),
    call!("ParticipationService/GetStudyPicture", Player, Refused),
    call!("ParticipationService/WithdrawFromStudy", Player, Refused),
    call!("TournamentService/GetTournament", Spectator, Compared),
    call!("TournamentService/ListTournaments", Spectator, Compared).not_forwarded(),
    call!("TournamentService/FollowTournament", Spectator, Compared).following(),
    call!(
        "TournamentService/GetTournamentResults",
        Spectator,
        Compared
    ),
    call!("TournamentService/ListTournamentGames", Spectator, Compared),
    call!("TournamentService/GetLeaderboard", Spectator, Refused).not_forwarded(),
    call!("TournamentService/JoinTournament", Player, Compared),
    call!("TournamentService/CreateTournament", Host, Refused).takes(MAX_MESSAGE_BYTES, 4_096, MIB),
    call!("TournamentService/AddTableParticipant", Host, Compared),
    call!("TournamentService/GetPhysicalTable", Host, Compared),
    call!("TournamentService/StartTournament", Host, Compared),
    call!("TournamentService/CloseTournament", Host, Compared),
    call!("TournamentService/WithdrawParticipant", Player, Compared),
    call!("TournamentService/RemoveParticipant", Host, Compared),
    call!("TournamentService/ReplaceParticipant", Host, Compared),
    call!("TournamentService/PauseTournament", Host, Compared),
    call!("TournamentService/ResumeTournament", Host, Compared),
    call!("TournamentService/PostponeGame", Player, Compared),
    call!("TournamentService/CallGame", Host, Compared),
    call!("RecordService/ListRecords", Spectator, Compared)
        .reading_records()
        .not_forwarded(),
    call!("RecordService/GetRecord", Spectator, Compared)
        .reading_records()
        .streaming(),
    call!("RecordService/StreamRecords", Spectator, Compared)
        .reading_records()
        .not_forwarded()
        .streaming(),
    call!("RecordService/ImportRecord", Host, Refused)
        .sending()
        .with_own_rate()
        .takes(MAX_MESSAGE_BYTES, 16_384, 6 * MIB),
    call!("VectorService/Run", Player, Refused).sending().takes(
        MAX_VECTOR_MESSAGE_BYTES,
        65_536,
        9 * MIB,
    ),
    call!("AnalysisService/Evaluate", Player, Compared)
        .streaming()
        .takes(MAX_MESSAGE_BYTES, 8_192, 4 * MIB),
    call!("AnalysisService/LegalActions", Player, Compared),
    call!("AdminService/ListClients", Admin, Refused).not_forwarded(),
    call!("AdminService/DisconnectClient", Admin, Refused).not_forwarded(),
    call!("AdminService/CloseRoom", Admin, Refused),
    call!("AdminService/CloseTournament", Admin, Refused),
    call!("AdminService/GetStorage", Admin, Refused).not_forwarded(),
    call!("AdminService/PruneRecords", Admin, Refused).not_forwarded(),
    call!("AdminService/ExportParticipant", Admin, Refused)
        .not_forwarded()
        .streaming(),
    call!("AdminService/DeleteParticipant", Admin, Refused).not_forwarded(),
    call!("ServerService/GetServerInfo", Anyone, Unlimited).not_forwarded(),
    call!("ServerService/GetActionTable", Spectator, Unlimited).not_forwarded(),
    call!("ServerService/GetClock", Spectator, Compared),
    call("/grpc.health.v1.Health/Check", Anyone, Unlimited).not_forwarded(),
    call("/grpc.health.v1.Health/Watch", Anyone, Unlimited)
        .not_forwarded()
        .streaming(),
    call(
        "/grpc.reflection.v1.ServerReflection/ServerReflectionInfo",
        Anyone,
        Unlimited,
    )
    .sending()
    .charging_each(),
];

/// The calls that only nodes make of each other, on a listener of their own. The rest of the server
/// does not have them.
const CALLS_OF_NODES: &[Call] = &[
    call(PLAY_OF_NODES, Player, Compared)
        .sending()
        .takes(MAX_PEER_REQUEST_BYTES, 80_000, 9 * MIB),
    call("/chefshat.peer.v1.PeerService/Share", Anyone, Unlimited).sending(),
    call("/chefshat.peer.v1.PeerService/Reach", Anyone, Unlimited).not_forwarded(),
    call("/chefshat.peer.v1.PeerService/Identify", Anyone, Unlimited).not_forwarded(),
];

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use prost::Message as _;

    use super::*;

    /// The calls of all services, and whether their requests or answers, and their requests, are
    /// streams.
    fn served() -> BTreeSet<(String, bool, bool)> {
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
                        served.insert((path, streams, method.client_streaming()));
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
            .map(|call| (call.path.to_owned(), call.streams, call.sends_many));
        assert_eq!(calls.collect::<BTreeSet<_>>(), served());
        assert_eq!(served().len(), CALLS.len());
    }
}
