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
}

impl Call {
    /// The requirements of the call with this path.
    pub fn find(path: &str) -> Option<&'static Self> {
        CALLS.iter().find(|call| call.path == path)
    }
}

const fn call(path: &'static str, role: Role, scoped: Scoped) -> Call {
    Call {
        path,
        role,
        scoped,
        reads_records: false,
    }
}

const fn records(path: &'static str) -> Call {
    Call {
        path,
        role: Role::Spectator,
        scoped: Scoped::Compared,
        reads_records: true,
    }
}

/// Every call of the server. Those played most often come first.
pub const CALLS: &[Call] = &[
    call("/chefshat.v1.PlayService/Act", Player, Compared),
    call("/chefshat.v1.PlayService/Play", Player, Compared),
    call("/chefshat.v1.PlayService/Watch", Player, Compared),
    call("/chefshat.v1.SpectatorService/Watch", Spectator, Compared),
    call("/chefshat.v1.TableService/Report", Player, Compared),
    call("/chefshat.v1.TableService/Watch", Player, Compared),
    call("/chefshat.v1.RoomService/GetRoom", Spectator, Compared),
    call("/chefshat.v1.RoomService/ListRooms", Spectator, Compared),
    call("/chefshat.v1.RoomService/JoinRoom", Player, Compared),
    call("/chefshat.v1.RoomService/LeaveRoom", Player, Compared),
    call("/chefshat.v1.RoomService/CreateRoom", Host, Refused),
    call("/chefshat.v1.RoomService/CloseRoom", Host, Compared),
    call(
        "/chefshat.v1.TournamentService/GetTournament",
        Spectator,
        Compared,
    ),
    call(
        "/chefshat.v1.TournamentService/ListTournaments",
        Spectator,
        Compared,
    ),
    call(
        "/chefshat.v1.TournamentService/FollowTournament",
        Spectator,
        Compared,
    ),
    call(
        "/chefshat.v1.TournamentService/GetTournamentResults",
        Spectator,
        Compared,
    ),
    call(
        "/chefshat.v1.TournamentService/ListTournamentGames",
        Spectator,
        Compared,
    ),
    call(
        "/chefshat.v1.TournamentService/GetLeaderboard",
        Spectator,
        Refused,
    ),
    call(
        "/chefshat.v1.TournamentService/JoinTournament",
        Player,
        Compared,
    ),
    call(
        "/chefshat.v1.TournamentService/CreateTournament",
        Host,
        Refused,
    ),
    call(
        "/chefshat.v1.TournamentService/AddTableParticipant",
        Host,
        Compared,
    ),
    call(
        "/chefshat.v1.TournamentService/GetPhysicalTable",
        Host,
        Compared,
    ),
    call(
        "/chefshat.v1.TournamentService/StartTournament",
        Host,
        Compared,
    ),
    call(
        "/chefshat.v1.TournamentService/CloseTournament",
        Host,
        Compared,
    ),
    records("/chefshat.v1.RecordService/ListRecords"),
    records("/chefshat.v1.RecordService/GetRecord"),
    records("/chefshat.v1.RecordService/StreamRecords"),
    call("/chefshat.v1.RecordService/ImportRecord", Host, Refused),
    call("/chefshat.v1.VectorService/Run", Player, Refused),
    call("/chefshat.v1.AdminService/ListClients", Admin, Refused),
    call("/chefshat.v1.AdminService/DisconnectClient", Admin, Refused),
    call("/chefshat.v1.AdminService/CloseRoom", Admin, Refused),
    call("/chefshat.v1.AdminService/CloseTournament", Admin, Refused),
    call("/chefshat.v1.AdminService/GetStorage", Admin, Refused),
    call("/chefshat.v1.AdminService/PruneRecords", Admin, Refused),
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
    call("/grpc.health.v1.Health/Check", Anyone, Unlimited),
    call("/grpc.health.v1.Health/Watch", Anyone, Unlimited),
    call(
        "/grpc.reflection.v1.ServerReflection/ServerReflectionInfo",
        Anyone,
        Unlimited,
    ),
];

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use prost::Message as _;

    use super::*;

    #[test]
    fn every_call_of_the_protocol_is_listed_once() {
        let files = [
            chefshat_proto::DESCRIPTORS,
            tonic_health::pb::FILE_DESCRIPTOR_SET,
            tonic_reflection::pb::v1::FILE_DESCRIPTOR_SET,
        ]
        .into_iter()
        .flat_map(|bytes| {
            let set = prost_types::FileDescriptorSet::decode(bytes).expect("descriptors");
            set.file
        });
        let mut expected = BTreeSet::new();
        for file in files {
            for service in &file.service {
                for method in &service.method {
                    let (package, service) = (file.package(), service.name());
                    expected.insert(format!("/{package}.{service}/{}", method.name()));
                }
            }
        }
        let listed: BTreeSet<String> = CALLS.iter().map(|it| it.path.to_owned()).collect();
        assert_eq!(listed, expected);
        assert_eq!(listed.len(), CALLS.len());
    }
}
