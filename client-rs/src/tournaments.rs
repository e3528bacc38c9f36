//! Tournaments: calls, following a tournament, and taking part in one. `by_hand` has the calls that
//! change a running tournament.

mod by_hand;

use futures::Stream;

use crate::backoff::Backoff;
use crate::connection::{Connection, MAX_RESPONSE_BYTES};
use crate::error::{Error, PlayError};
use crate::repeat::{identify, repeated};
use crate::session::Session;
use crate::stream::Reconnecting;
use crate::v1::tournament_service_client::TournamentServiceClient;
use crate::{Agent, Client, Outcome, PlayOptions, run, v1};

impl Client {
    /// Creates a tournament. The response has the join code for its participants and the token that
    /// starts and closes it.
    ///
    /// # Errors
    /// `RULE_SET_REFUSED`, `POLICY_REFUSED`, `SETTINGS_REFUSED` or `NAME_REFUSED`, with the
    /// offending field in the metadata; `TOO_MANY_TOURNAMENTS`, `DISK_NEARLY_FULL`;
    /// `SHUTTING_DOWN`.
    pub async fn create_tournament(
        &self,
        settings: v1::TournamentSettings,
    ) -> Result<v1::CreateTournamentResponse, Error> {
        let mut request = v1::CreateTournamentRequest {
            settings: Some(settings),
            ..Default::default()
        };
        identify(&mut request.request_id);
        repeated(|| async { service(self).create_tournament(request.clone()).await }).await
    }

    /// The public view of a tournament.
    ///
    /// # Errors
    /// `TOURNAMENT_UNKNOWN`.
    pub async fn tournament(
        &self,
        tournament_id: impl Into<String>,
    ) -> Result<v1::Tournament, Error> {
        let request = v1::GetTournamentRequest {
            tournament_id: tournament_id.into(),
            join_code: String::new(),
        };
        let response = repeated(|| async { service(self).get_tournament(request.clone()).await });
        one(response.await?.tournament)
    }

    /// A page of the server's tournaments, newest first, without participants.
    ///
    /// # Errors
    /// A failed connection, or an unknown page token.
    pub async fn list_tournaments(
        &self,
        request: v1::ListTournamentsRequest,
    ) -> Result<v1::ListTournamentsResponse, Error> {
        repeated(|| async { service(self).list_tournaments(request.clone()).await }).await
    }

    /// Joins a tournament, which the join code identifies. The response has the ticket for
    /// [`play_tournament`](Self::play_tournament). If the response is lost, the call is repeated
    /// and adds no second participant.
    ///
    /// # Errors
    /// `JOIN_CODE_WRONG`, `TOURNAMENT_FULL`, `TOURNAMENT_STARTED`, `NAME_TAKEN`, `NAME_REFUSED`,
    /// `KIND_NOT_ADMITTED`, `KIND_REFUSED`, `NOT_STATELESS`, `MAX_GAMES_REFUSED`,
    /// `TOURNAMENT_UNKNOWN`.
    pub async fn join_tournament(
        &self,
        mut request: v1::JoinTournamentRequest,
    ) -> Result<v1::JoinTournamentResponse, Error> {
        identify(&mut request.request_id);
        repeated(|| async { service(self).join_tournament(request.clone()).await }).await
    }

    /// Adds a participant who plays at a physical table with real cards, and for whom nobody
    /// connects. Returns the tournament and the participant's number. If the response is lost, the
    /// call is repeated and adds no second participant.
    ///
    /// # Errors
    /// `OWNER_TOKEN_WRONG`, `NO_PHYSICAL_TABLES`, `NAME_TAKEN`, `NAME_REFUSED`, `KIND_REFUSED`,
    /// `TOURNAMENT_FULL`, `TOURNAMENT_STARTED`, `TOURNAMENT_UNKNOWN`.
    pub async fn add_table_participant(
        &self,
        mut request: v1::AddTableParticipantRequest,
    ) -> Result<v1::AddTableParticipantResponse, Error> {
        identify(&mut request.request_id);
        repeated(|| async { service(self).add_table_participant(request.clone()).await }).await
    }

    /// The secrets of the physical table at which a game is being played.
    ///
    /// # Errors
    /// `OWNER_TOKEN_WRONG`, `GAME_NOT_PHYSICAL`, `GAME_NOT_STARTED`, `GAME_OVER`, `GAME_UNKNOWN`,
    /// `TOURNAMENT_UNKNOWN`.
    pub async fn physical_table(
        &self,
        tournament_id: impl Into<String>,
        owner_token: impl Into<String>,
        game: u32,
    ) -> Result<v1::GetPhysicalTableResponse, Error> {
        let request = v1::GetPhysicalTableRequest {
            tournament_id: tournament_id.into(),
            owner_token: owner_token.into(),
            game,
        };
        repeated(|| async { service(self).get_physical_table(request.clone()).await }).await
    }

    /// Starts a tournament.
    ///
    /// # Errors
    /// `OWNER_TOKEN_WRONG`, `TOO_FEW_PARTICIPANTS`, `TOURNAMENT_STARTED`, `TOURNAMENT_UNKNOWN`.
    pub async fn start_tournament(
        &self,
        tournament_id: impl Into<String>,
        owner_token: impl Into<String>,
    ) -> Result<v1::Tournament, Error> {
        let request = v1::StartTournamentRequest {
            tournament_id: tournament_id.into(),
            owner_token: owner_token.into(),
        };
        let response = service(self).start_tournament(request).await?;
        one(response.into_inner().tournament)
    }

    /// Closes a tournament: running games are aborted, counted results remain.
    ///
    /// # Errors
    /// `OWNER_TOKEN_WRONG`, `TOURNAMENT_UNKNOWN`.
    pub async fn close_tournament(
        &self,
        tournament_id: impl Into<String>,
        owner_token: impl Into<String>,
    ) -> Result<v1::Tournament, Error> {
        let request = v1::CloseTournamentRequest {
            tournament_id: tournament_id.into(),
            owner_token: owner_token.into(),
        };
        let response = service(self).close_tournament(request).await?;
        one(response.into_inner().tournament)
    }

    /// Standings, ratings and the certainty of the order; final once the tournament is over.
    ///
    /// # Errors
    /// `TOURNAMENT_UNKNOWN`.
    pub async fn tournament_results(
        &self,
        tournament_id: impl Into<String>,
    ) -> Result<v1::GetTournamentResultsResponse, Error> {
        let request = v1::GetTournamentResultsRequest {
            tournament_id: tournament_id.into(),
        };
        repeated(|| async { service(self).get_tournament_results(request.clone()).await }).await
    }

    /// A page of a tournament's games, in order.
    ///
    /// # Errors
    /// `TOURNAMENT_UNKNOWN`, `PAGE_TOKEN_REFUSED`.
    pub async fn tournament_games(
        &self,
        request: v1::ListTournamentGamesRequest,
    ) -> Result<v1::ListTournamentGamesResponse, Error> {
        repeated(|| async { service(self).list_tournament_games(request.clone()).await }).await
    }

    /// The ratings of everybody who has played rated games on the server, best first.
    ///
    /// # Errors
    /// A failed connection.
    pub async fn leaderboard(
        &self,
        request: v1::GetLeaderboardRequest,
    ) -> Result<v1::GetLeaderboardResponse, Error> {
        repeated(|| async { service(self).get_leaderboard(request).await }).await
    }

    /// Follows a tournament. Connects when the first report is requested.
    pub fn follow_tournament(&self, tournament_id: impl Into<String>) -> TournamentFollower {
        TournamentFollower {
            service: service(self),
            tournament_id: tournament_id.into(),
            stream: Reconnecting::new(Backoff::default()),
            over: false,
        }
    }

    /// Takes part in a tournament until it is over, with the ticket from
    /// [`join_tournament`](Self::join_tournament): over one stream, in up to as many games at a
    /// time as declared when joining. `make` creates the agent of each game; it survives lost
    /// connections. Dropping the future leaves: games wait for the participant for a while, then it
    /// forfeits them.
    ///
    /// Returns the outcomes in the order in which the games started, including aborted ones. A game
    /// whose room was gone after a reconnection has no outcome; the server counts it or calls it
    /// again.
    ///
    /// # Errors
    /// See [`PlayError`], for the participant: `Superseded` if a newer connection takes part in its
    /// place. Agents of games that had ended by then have been notified ([`Agent::on_game_over`]).
    pub async fn play_tournament<A: Agent>(
        &self,
        ticket: impl Into<String>,
        make: impl FnMut(&v1::Attached) -> A + Send,
    ) -> Result<Vec<Outcome>, PlayError> {
        let options = PlayOptions::default();
        self.play_tournament_with(ticket, make, &options).await
    }

    /// [`play_tournament`](Self::play_tournament) with options. The entropy is the same for all
    /// games of the participant; it counts in those that are dealt independently.
    ///
    /// # Errors
    /// As [`play_tournament`](Self::play_tournament).
    pub async fn play_tournament_with<A: Agent>(
        &self,
        ticket: impl Into<String>,
        make: impl FnMut(&v1::Attached) -> A + Send,
        options: &PlayOptions,
    ) -> Result<Vec<Outcome>, PlayError> {
        let (_, played) = self.take_part(ticket, make, options).await?;
        Ok(played)
    }

    /// [`play_tournament_with`](Self::play_tournament_with) that also returns whose ticket it was:
    /// `None` for that of a seat, whose game alone is played.
    ///
    /// # Errors
    /// As [`play_tournament`](Self::play_tournament).
    pub async fn take_part<A: Agent>(
        &self,
        ticket: impl Into<String>,
        make: impl FnMut(&v1::Attached) -> A + Send,
        options: &PlayOptions,
    ) -> Result<(Option<v1::Entered>, Vec<Outcome>), PlayError> {
        let mut session = Session::of_participant(ticket.into(), make, options);
        run::run(self.channel(), &mut session, &options.backoff).await;
        let entered = session.take_entered();
        Ok((entered, session.into_played()?))
    }
}

/// Follows one tournament across lost connections; created by [`Client::follow_tournament`].
#[derive(Debug)]
pub struct TournamentFollower {
    service: TournamentServiceClient<Connection>,
    tournament_id: String,
    stream: Reconnecting<v1::FollowTournamentResponse>,
    over: bool,
}

impl TournamentFollower {
    /// Replaces the default backoff.
    #[must_use]
    pub fn with_backoff(mut self, backoff: Backoff) -> Self {
        self.stream.set_backoff(backoff);
        self
    }

    /// The state of the tournament: at once, then after every change; `None` after the report of
    /// its end. Cancel safe: dropping the future loses nothing.
    ///
    /// # Errors
    /// The server's refusal (`TOURNAMENT_UNKNOWN`, `TOO_MANY_FOLLOWERS`), or the last failure if
    /// the connection cannot be restored in time. After an error there are no more reports.
    pub async fn next(&mut self) -> Result<Option<v1::FollowTournamentResponse>, Error> {
        if self.over {
            return Ok(None);
        }
        let follow = || {
            let (mut service, tournament_id) = (self.service.clone(), self.tournament_id.clone());
            let request = v1::FollowTournamentRequest { tournament_id };
            async move { service.follow_tournament(request).await }
        };
        let state =
            |report: v1::FollowTournamentResponse| report.tournament.is_some().then_some(report);
        let report = self.stream.next_state(follow, state).await;
        let tournament = report.as_ref().map(|report| report.tournament.as_ref());
        self.over = tournament.map_or(true, |it| it.is_some_and(is_over));
        report.map(Some)
    }

    /// Converts the follower to a [`Stream`].
    pub fn into_stream(
        self,
    ) -> impl Stream<Item = Result<v1::FollowTournamentResponse, Error>> + Send {
        futures::stream::try_unfold(self, |mut follower| async {
            let report = follower.next().await?;
            Ok(report.map(|report| (report, follower)))
        })
    }
}

fn service(client: &Client) -> TournamentServiceClient<Connection> {
    TournamentServiceClient::new(client.channel()).max_decoding_message_size(MAX_RESPONSE_BYTES)
}

fn one(tournament: Option<v1::Tournament>) -> Result<v1::Tournament, Error> {
    tournament.ok_or_else(|| Error::incomplete("tournament"))
}

fn is_over(tournament: &v1::Tournament) -> bool {
    matches!(
        tournament.state(),
        v1::TournamentState::Finished | v1::TournamentState::Closed
    )
}
