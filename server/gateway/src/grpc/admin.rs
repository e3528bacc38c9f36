//! `AdminService`: operates the server. The role that its calls need stands in `access`.

use std::sync::Arc;
use std::time::{Duration, UNIX_EPOCH};

use chefshat_proto::v1::{
    self, admin_service_client::AdminServiceClient, admin_service_server::AdminService,
    study_service_client::StudyServiceClient,
};
use chefshat_record::pseudonym::{Named, Pseudonym, is_fingerprint};
use futures::future::join_all;
use tokio::sync::mpsc;
use tokio::time::timeout;
use tokio_util::sync::CancellationToken;
use tonic::metadata::{Binary, MetadataValue};
use tonic::{Code, Request, Response, Status};
use tracing::info;

use super::follow::{self, Responses};
use super::forward::{FromPeer, Gateway};
use super::limits::charged;
use super::lookup::Lookup;
use super::pages;
use super::status::{
    Refusal, invalid, owner_unreachable, room_unknown, shutting_down, status, store_failed,
    tournament_unknown,
};
use super::tournaments;
use crate::connections::{Client, Connections};
use chefshat_admission::limits::Key;
use chefshat_base::clock::millis;
use chefshat_base::tasks::short;
use chefshat_hosting::cluster::{FoundBy, Location};
use chefshat_hosting::config::FOLLOW_SEND_TIMEOUT;
use chefshat_hosting::participants::{DataError, Participants, StudiesElsewhere};
use chefshat_hosting::retention::Retention;
use chefshat_room::ids::{RoomId, StudyId, TournamentId};
use chefshat_store::{ForgetError, Keep};

/// Most clients in a page.
const CLIENTS_PER_PAGE: u32 = 1_000;
/// How long another node may take to remove a participant from its memory.
const PEER_TIMEOUT: Duration = Duration::from_secs(10);
/// Metadata of a request of another node that deletes a participant: the pseudonym, or nothing
/// before there is one.
const PSEUDONYM: &str = "chefshat-pseudonym-bin";

/// The service.
#[derive(Debug, Clone)]
pub struct AdminCalls {
    lookup: Lookup,
    connections: Arc<Connections>,
    retention: Retention,
    participants: Arc<Participants>,
    /// Cancelled when all streams must end.
    closing: CancellationToken,
}

impl AdminCalls {
    /// Creates the service for this server; `closing` ends its streams.
    pub fn new(
        lookup: Lookup,
        connections: Arc<Connections>,
        retention: Retention,
        participants: Arc<Participants>,
        closing: CancellationToken,
    ) -> Self {
        Self {
            lookup,
            connections,
            retention,
            participants,
            closing,
        }
    }
}

impl AdminService for AdminCalls {
    type ExportParticipantStream = Responses<v1::ExportParticipantResponse>;

    async fn list_clients(
        &self,
        request: Request<v1::ListClientsRequest>,
    ) -> Result<Response<v1::ListClientsResponse>, Status> {
        let request = request.into_inner();
        let after = pages::last_shown(&request.page_token)?.unwrap_or_default();
        let size = pages::size_within(request.page_size, CLIENTS_PER_PAGE, CLIENTS_PER_PAGE);
        let clients = self.connections.clients();
        let mut later = clients.iter().filter(|client| client.id > after);
        let page: Vec<_> = later.by_ref().take(size).collect();
        let next_page_token = match (later.next(), page.last()) {
            (Some(_), Some(last)) => last.id.to_string(),
            _ => String::new(),
        };
        Ok(Response::new(v1::ListClientsResponse {
            clients: page.into_iter().map(|client| described(client)).collect(),
            next_page_token,
        }))
    }

    async fn disconnect_client(
        &self,
        request: Request<v1::DisconnectClientRequest>,
    ) -> Result<Response<v1::DisconnectClientResponse>, Status> {
        let id = request.into_inner().client_id;
        let client = self.connections.client(id).ok_or_else(|| {
            status(
                Code::NotFound,
                "CLIENT_UNKNOWN",
                "no connected client has this id; list the clients to see which there are",
                [("field", "client_id")],
            )
        })?;
        info!(address = ?client.address, "an operator disconnects a client");
        client.close();
        Ok(Response::new(v1::DisconnectClientResponse {}))
    }

    async fn close_room(
        &self,
        request: Request<v1::AdminServiceCloseRoomRequest>,
    ) -> Result<Response<v1::AdminServiceCloseRoomResponse>, Status> {
        let key = charged(request.extensions());
        let id = RoomId::parse(&request.into_inner().room_id).ok_or_else(room_unknown)?;
        let handle = self.lookup.room_here(id, key).await?;
        let handle = handle.ok_or_else(room_unknown)?;
        info!(room = %handle.id(), "an operator closes a room");
        handle.close_without_token().await;
        let room = handle.describe().await.map_err(Refusal::from)?;
        let room = Some(room);
        Ok(Response::new(v1::AdminServiceCloseRoomResponse { room }))
    }

    async fn close_tournament(
        &self,
        request: Request<v1::AdminServiceCloseTournamentRequest>,
    ) -> Result<Response<v1::AdminServiceCloseTournamentResponse>, Status> {
        let key = charged(request.extensions());
        let id = TournamentId::parse(&request.into_inner().tournament_id)
            .ok_or_else(tournament_unknown)?;
        let handle = self.lookup.tournament_here(id, key).await?;
        let handle = handle.ok_or_else(tournament_unknown)?;
        info!(tournament = %handle.id(), "an operator closes a tournament");
        handle.close().await.map_err(tournaments::stopped)?;
        let tournament = Some(handle.describe());
        Ok(Response::new(v1::AdminServiceCloseTournamentResponse {
            tournament,
        }))
    }

    async fn get_storage(
        &self,
        _request: Request<v1::GetStorageRequest>,
    ) -> Result<Response<v1::GetStorageResponse>, Status> {
        let usage = self.retention.usage().await.map_err(failed)?;
        Ok(Response::new(v1::GetStorageResponse {
            database_bytes: usage.disk.bytes,
            record_bytes: usage.record_bytes,
            record_files: usage.record_files,
            free_bytes: usage.disk.free_bytes,
            finished_games: usage.finished_games,
            open_rooms: self.lookup.rooms().open_count() as u64,
            connections: self.connections.clients().len() as u64,
        }))
    }

    async fn prune_records(
        &self,
        request: Request<v1::PruneRecordsRequest>,
    ) -> Result<Response<v1::PruneRecordsResponse>, Status> {
        let request = request.into_inner();
        let keep = Keep {
            ended_since_ms: Some(request.ended_before_ms).filter(|ms| *ms > 0),
            newest: Some(request.keep).filter(|count| *count > 0),
        };
        if keep == Keep::default() {
            let problem = "set ended_before_ms, keep or both";
            return Err(invalid("PRUNE_REFUSED", "keep", problem));
        }
        let pruned = self.retention.prune(keep).await.map_err(failed)?;
        Ok(Response::new(v1::PruneRecordsResponse {
            games: pruned.games,
            freed_bytes: pruned.freed_bytes,
        }))
    }

    async fn export_participant(
        &self,
        request: Request<v1::ExportParticipantRequest>,
    ) -> Result<Response<Self::ExportParticipantStream>, Status> {
        let request = request.into_inner();
        let who = given(request.name, request.name_fingerprint)?;
        let (lines, mut exported) = mpsc::channel(1);
        let participants = Arc::clone(&self.participants);
        let (response, exporting) = follow::stream(
            self.closing.clone(),
            move |sender| async move {
                let (what, limit) = ("the export", FOLLOW_SEND_TIMEOUT);
                let forwarding = async {
                    let mut count = 0_u64;
                    while let Some(line) = exported.recv().await {
                        count += 1;
                        let response = v1::ExportParticipantResponse {
                            line,
                            ..v1::ExportParticipantResponse::default()
                        };
                        follow::send_part(&sender, response, what, limit).await?;
                    }
                    Ok(count)
                };
                let gathering = async move {
                    let gathered = participants.export(&who, &lines).await;
                    gathered.map_err(data_failed)
                };
                let (count, skipped) = tokio::try_join!(forwarding, gathering)?;
                if count == 0 && skipped.named.is_empty() {
                    return Err(status(
                        Code::NotFound,
                        "PARTICIPANT_UNKNOWN",
                        "nothing is stored under this name; give the exact name the participant played under",
                        [("field", "name")],
                    ));
                }
                let last = v1::ExportParticipantResponse {
                    line: String::new(),
                    unread_files: skipped.named,
                };
                follow::send_part(&sender, last, what, limit).await
            },
        );
        tokio::spawn(short("one call", exporting));
        Ok(response)
    }

    async fn delete_participant(
        &self,
        request: Request<v1::DeleteParticipantRequest>,
    ) -> Result<Response<v1::DeleteParticipantResponse>, Status> {
        let is_from_peer = request.extensions().get::<FromPeer>().is_some();
        let step = request.metadata().get_bin(PSEUDONYM).cloned();
        let elsewhere = OtherNodes(request.extensions().get::<Gateway>().cloned());
        let request = request.into_inner();
        let who = given(request.name, request.name_fingerprint)?;
        let participants = Arc::clone(&self.participants);
        // Runs to completion even if the client goes.
        let deleting = tokio::spawn(short("one call", async move {
            match step.filter(|_| is_from_peer) {
                Some(step) => for_another_node(&participants, who, &step).await,
                None => everywhere(&participants, who, &elsewhere).await,
            }
        }));
        let deleted = deleting.await.map_err(|error| {
            tracing::error!(%error, "deleting a participant's data failed");
            store_failed()
        })?;
        deleted.map(Response::new)
    }
}

/// Deletes a participant's data here, in the store, and from the memory of all other nodes.
async fn everywhere(
    participants: &Participants,
    who: Named,
    elsewhere: &OtherNodes,
) -> Result<v1::DeleteParticipantResponse, Status> {
    // Ephemeral games are in no database. What cannot be reached is said at the end.
    for (_, answer) in elsewhere.ask_all(&who, "").await {
        if let Err(refused) = answer
            && refused.code() == Code::FailedPrecondition
        {
            return Err(refused);
        }
    }
    let deleted = participants.delete(&who, elsewhere).await;
    let deleted = deleted.map_err(data_failed)?;
    let mut unreached = Vec::new();
    for (node, answer) in elsewhere.ask_all(&who, &deleted.pseudonym).await {
        if let Err(error) = answer {
            tracing::warn!(%node, %error, "another node may still show a deleted participant");
            unreached.push(node);
        }
    }
    if unreached.is_empty() {
        return Ok(deleted.into());
    }
    Err(status(
        Code::Unavailable,
        "OWNER_UNREACHABLE",
        format!(
            "the data are deleted, but these servers could not be told and may still show the name of games that are over: {}; \
             delete it once more when they can be reached, or restart them",
            unreached.join(", ")
        ),
        [],
    ))
}

/// What another node wants, which deletes a participant: to know whether it plays here, or, with the
/// pseudonym, to remove it from memory.
async fn for_another_node(
    participants: &Participants,
    who: Named,
    step: &MetadataValue<Binary>,
) -> Result<v1::DeleteParticipantResponse, Status> {
    let pseudonym = step.to_bytes().unwrap_or_default();
    match String::from_utf8_lossy(&pseudonym).into_owned() {
        none if none.is_empty() => participants.check(&who).await.map_err(data_failed)?,
        pseudonym => {
            let who = Pseudonym {
                of: who,
                pseudonym,
                key: None,
            };
            participants.forget_here(&who).await;
        }
    }
    Ok(v1::DeleteParticipantResponse::default())
}

/// The other nodes of a cluster, if there is one, which decide about the operator's token themselves.
struct OtherNodes(Option<Gateway>);

impl OtherNodes {
    /// Asks all other nodes that live to do their part of the deletion of a participant. Returns
    /// their names and answers.
    async fn ask_all(&self, who: &Named, pseudonym: &str) -> Vec<(String, Result<(), Status>)> {
        let Some(gateway) = &self.0 else {
            return Vec::new();
        };
        let (_, others) = gateway.directory().nodes().await;
        let asking = others.into_iter().map(|peer| async move {
            let mut request = gateway.request(v1::DeleteParticipantRequest {
                name: who.name.clone(),
                name_fingerprint: who.fingerprint.clone(),
            });
            let step = MetadataValue::from_bytes(pseudonym.as_bytes());
            request.metadata_mut().insert_bin(PSEUDONYM, step);
            let mut service = AdminServiceClient::new(gateway.peers().channel(&peer));
            let asked = timeout(PEER_TIMEOUT, service.delete_participant(request)).await;
            let late = |_| Status::deadline_exceeded("it did not answer in time");
            let answer = asked.map_err(late).and_then(|answer| answer.map(drop));
            (peer.node.to_string(), answer)
        });
        join_all(asking).await
    }
}

impl StudiesElsewhere for OtherNodes {
    async fn delete_participant(&self, study: StudyId, number: u32) -> Result<(), DataError> {
        let Some(gateway) = &self.0 else {
            return Err(DataError::StudyUnreachable);
        };
        let found_by = FoundBy::from(study);
        let located = gateway.directory().locate(&found_by, Key::Resumed).await;
        let Location::Node(peer) = located else {
            return Err(DataError::StudyUnreachable);
        };
        let mut service = StudyServiceClient::new(gateway.peers().channel(&peer));
        let request = gateway.request(v1::DeleteStudyParticipantRequest {
            study_id: study.to_string(),
            owner_token: String::new(),
            number,
        });
        let deleted = service.delete_study_participant(request).await;
        deleted.map(drop).map_err(|error| {
            tracing::warn!(peer = %peer.node, %error, "another node did not delete a participant");
            gateway.directory().forget(&found_by);
            DataError::StudyUnreachable
        })
    }
}

/// A participant's name from a request. Empty seats have an empty one.
fn given(name: String, fingerprint: Option<String>) -> Result<Named, Status> {
    let refused = |name, what| Err(invalid("NAME_REFUSED", name, what));
    if name.is_empty() {
        return refused("name", "give the exact name the participant played under");
    }
    if !fingerprint.as_deref().is_none_or(is_fingerprint) {
        let what =
            "give 16 hexadecimal digits (0-9, a-f), or an empty text for those without a key";
        return refused("name_fingerprint", what);
    }
    Ok(Named { name, fingerprint })
}

fn data_failed(error: DataError) -> Status {
    match error {
        DataError::Forget(
            running @ (ForgetError::GameRunning(_) | ForgetError::TournamentRunning(_)),
        ) => status(
            Code::FailedPrecondition,
            "PARTICIPANT_PLAYING",
            running.to_string(),
            [("field", "name")],
        ),
        DataError::ShuttingDown => shutting_down(),
        DataError::StudyUnreachable => owner_unreachable(),
        error => {
            tracing::error!(%error, "a request for a participant's data failed");
            store_failed()
        }
    }
}

fn described(client: &Client) -> v1::ConnectedClient {
    let since = client.since.duration_since(UNIX_EPOCH).unwrap_or_default();
    v1::ConnectedClient {
        client_id: client.id,
        address: (client.address).map_or_else(String::new, |it| it.to_string()),
        token_id: client.token().map_or_else(String::new, |id| id.to_string()),
        connected_at_ms: millis(since),
        calls: client.calls(),
        streams: client.streams() as u64,
    }
}

fn failed(error: chefshat_store::StoreError) -> Status {
    tracing::error!(%error, "an operator's request failed");
    store_failed()
}
