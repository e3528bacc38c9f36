//! Calls that change a tournament by hand: leaving, replacing, pausing, postponing, calling again.

use super::{one, service};
use crate::error::Error;
use crate::repeat::{identify, repeated};
use crate::{Client, v1};

impl Client {
    /// Withdraws a participant, with its ticket or the owner token. Before the start its place is
    /// free again. After that a substitute plays its games in progress, and it forfeits the others.
    ///
    /// # Errors
    /// `TICKET_UNKNOWN`, `OWNER_TOKEN_WRONG`, `PARTICIPANT_UNKNOWN`, `PARTICIPANT_IS_FILLER`,
    /// `TOURNAMENT_OVER`, `TOURNAMENT_UNKNOWN`.
    pub async fn withdraw_participant(
        &self,
        request: v1::WithdrawParticipantRequest,
    ) -> Result<v1::Tournament, Error> {
        let response = service(self).withdraw_participant(request).await?;
        one(response.into_inner().tournament)
    }

    /// Removes a participant: it is withdrawn, and its ticket ends.
    ///
    /// # Errors
    /// `OWNER_TOKEN_WRONG`, `PARTICIPANT_UNKNOWN`, `PARTICIPANT_IS_FILLER`, `TOURNAMENT_OVER`,
    /// `TOURNAMENT_UNKNOWN`.
    pub async fn remove_participant(
        &self,
        tournament_id: impl Into<String>,
        owner_token: impl Into<String>,
        participant: u32,
    ) -> Result<v1::Tournament, Error> {
        let request = v1::RemoveParticipantRequest {
            tournament_id: tournament_id.into(),
            owner_token: owner_token.into(),
            participant,
        };
        let response = service(self).remove_participant(request).await?;
        one(response.into_inner().tournament)
    }

    /// Gives the place of a participant to a built-in agent or to somebody else; the response has
    /// the ticket of the latter. If the response is lost, the call is repeated and replaces once.
    ///
    /// # Errors
    /// `OWNER_TOKEN_WRONG`, `PARTICIPANT_UNKNOWN`, `NAME_TAKEN`, `NAME_RESERVED`, `NAME_REFUSED`,
    /// `KIND_NOT_ADMITTED`, `KIND_REFUSED`, `NOT_STATELESS`, `MAX_GAMES_REFUSED`,
    /// `SETTINGS_REFUSED`, `REPLACED_TOO_OFTEN`, `TOURNAMENT_OVER`, `TOURNAMENT_UNKNOWN`.
    pub async fn replace_participant(
        &self,
        mut request: v1::ReplaceParticipantRequest,
    ) -> Result<v1::ReplaceParticipantResponse, Error> {
        if !request.built_in_agent.is_empty() {
            let response = service(self).replace_participant(request).await?;
            return Ok(response.into_inner());
        }
        identify(&mut request.request_id);
        repeated(|| async { service(self).replace_participant(request.clone()).await }).await
    }

    /// Pauses a tournament: no game is called until it is resumed. Games in progress continue.
    ///
    /// # Errors
    /// `OWNER_TOKEN_WRONG`, `TOURNAMENT_NOT_PLAYING`, `TOURNAMENT_UNKNOWN`.
    pub async fn pause_tournament(
        &self,
        tournament_id: impl Into<String>,
        owner_token: impl Into<String>,
    ) -> Result<v1::Tournament, Error> {
        let request = v1::PauseTournamentRequest {
            tournament_id: tournament_id.into(),
            owner_token: owner_token.into(),
        };
        let response = service(self).pause_tournament(request).await?;
        one(response.into_inner().tournament)
    }

    /// Resumes a paused tournament.
    ///
    /// # Errors
    /// As [`pause_tournament`](Self::pause_tournament).
    pub async fn resume_tournament(
        &self,
        tournament_id: impl Into<String>,
        owner_token: impl Into<String>,
    ) -> Result<v1::Tournament, Error> {
        let request = v1::ResumeTournamentRequest {
            tournament_id: tournament_id.into(),
            owner_token: owner_token.into(),
        };
        let response = service(self).resume_tournament(request).await?;
        one(response.into_inner().tournament)
    }

    /// Moves a game that is not in progress to the end of the queue, with the ticket of one of its
    /// participants or the owner token.
    ///
    /// # Errors
    /// `TICKET_UNKNOWN`, `OWNER_TOKEN_WRONG`, `NOT_IN_GAME`, `GAME_UNKNOWN`, `GAME_NOT_DUE`,
    /// `POSTPONED_TOO_OFTEN`, `TOURNAMENT_NOT_PLAYING`, `TOURNAMENT_UNKNOWN`.
    pub async fn postpone_game(
        &self,
        request: v1::PostponeGameRequest,
    ) -> Result<v1::TournamentGame, Error> {
        let response = service(self).postpone_game(request).await?;
        game(response.into_inner().game)
    }

    /// Calls a due or void game before all others, with as many calls as at first.
    ///
    /// # Errors
    /// `OWNER_TOKEN_WRONG`, `GAME_UNKNOWN`, `GAME_NOT_DUE`, `TOURNAMENT_NOT_PLAYING`,
    /// `TOURNAMENT_UNKNOWN`.
    pub async fn call_game(
        &self,
        tournament_id: impl Into<String>,
        owner_token: impl Into<String>,
        number: u32,
    ) -> Result<v1::TournamentGame, Error> {
        let request = v1::CallGameRequest {
            tournament_id: tournament_id.into(),
            owner_token: owner_token.into(),
            game: number,
        };
        let response = service(self).call_game(request).await?;
        game(response.into_inner().game)
    }
}

fn game(game: Option<v1::TournamentGame>) -> Result<v1::TournamentGame, Error> {
    game.ok_or_else(|| Error::incomplete("game"))
}
