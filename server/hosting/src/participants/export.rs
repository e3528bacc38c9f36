//! Exports a participant's data as lines of JSON, without what others did in the same games.

use std::collections::BTreeSet;

use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};
use chefshat_record::pseudonym::{Named, ParticipantSeats};
use chefshat_record::replay::replay;
use chefshat_record::samples;
use chefshat_record::summary::summary;
use chefshat_room::ids::Id;
use chefshat_tournament::Change;
use serde_json::{Value, json};
use tokio::sync::mpsc;

use super::data::{DataError, ParticipantData, blocking};
use super::files::{Skipped, records_with};
use chefshat_store::tournaments::{StoredTournament, TournamentEntry};
use chefshat_store::units::UnitKey;
use chefshat_store::{Part, StoreError, units_of};

/// Page size of the list of records.
const AT_A_TIME: usize = 100;

/// Lines on their way to a receiver, after one that says whose data they are.
pub(super) struct Sheet<'s> {
    who: &'s Named,
    sender: &'s mpsc::Sender<String>,
    has_begun: bool,
}

impl Sheet<'_> {
    /// Sends lines.
    ///
    /// # Errors
    /// Nobody receives them any more.
    pub(super) async fn send(&mut self, lines: Vec<Value>) -> Result<(), DataError> {
        if lines.is_empty() {
            return Ok(());
        }
        let version = env!("CARGO_PKG_VERSION");
        let mut head = json!({ "participant": { "formatVersion": 2, "name": self.who.name, "serverVersion": version } });
        if let Some(fingerprint) = &self.who.fingerprint {
            head["participant"]["nameFingerprint"] = json!(fingerprint);
        }
        let head = (!std::mem::replace(&mut self.has_begun, true)).then_some(head);
        for line in head.into_iter().chain(lines) {
            let sent = self.sender.send(line.to_string()).await;
            sent.map_err(|_| DataError::Gone)?;
        }
        Ok(())
    }
}

impl ParticipantData {
    /// Sends all that is stored about a participant: nothing if nothing is. Returns which files
    /// could not be read.
    ///
    /// # Errors
    /// The store or the folder of records failed, or nobody receives the lines.
    pub async fn export(
        &self,
        who: &Named,
        sender: &mpsc::Sender<String>,
    ) -> Result<Skipped, DataError> {
        let mut sheet = Sheet {
            who,
            sender,
            has_begun: false,
        };
        let mut skipped = Skipped::default();
        let known = self.export_games(who, &mut sheet, &mut skipped).await?;
        let files = self.export_files(who, known, &mut sheet).await?;
        skipped.named.extend(files.named);
        skipped.other.extend(files.other);
        for id in units_of(self.store.as_ref(), usize::MAX).await? {
            let unit = self.store.unit(UnitKey::Tournament(id)).await?;
            let Some(unit) = unit else { continue };
            let tournament = match StoredTournament::decode(id, &unit) {
                Ok(tournament) => tournament,
                Err(problem) => {
                    skipped.named.push(problem.to_string());
                    continue;
                }
            };
            let mut lines = Vec::new();
            for entry in &tournament.entries {
                if let TournamentEntry::Change(
                    Change::Joined(entrant) | Change::Replaced { by: entrant, .. },
                ) = entry
                    && entrant.built_in.is_none()
                    && who.is(&entrant.name, &entrant.name_fingerprint)
                {
                    lines.push(json!({ "tournament": {
                        "tournamentId": tournament.header.id.to_string(),
                        "name": tournament.header.settings.name,
                        "createdAtMs": tournament.header.created_at_ms,
                        "stateless": entrant.stateless,
                    } }));
                }
            }
            sheet.send(lines).await?;
        }
        self.export_studies(who, &mut sheet, &mut skipped.named)
            .await?;
        Ok(skipped)
    }

    /// Sends the games of the store. Returns their ids. One that cannot be read is named, and the
    /// others follow.
    async fn export_games(
        &self,
        who: &Named,
        sheet: &mut Sheet<'_>,
        skipped: &mut Skipped,
    ) -> Result<BTreeSet<String>, DataError> {
        let mut known = BTreeSet::new();
        let filter = v1::RecordFilter {
            participant: who.name.clone(),
            ..v1::RecordFilter::default()
        };
        let mut after = 0;
        loop {
            let found = (self.store)
                .list(&filter, Part::After(after), AT_A_TIME)
                .await?;
            let Some(last) = found.last() else { break };
            after = last.number;
            for listed in found {
                let summary = match listed.summary {
                    Ok(summary) => summary,
                    Err(unreadable) => {
                        skipped.named.push(unreadable.to_string());
                        continue;
                    }
                };
                known.insert(summary.game_id.clone());
                let Some(game) = Id::parse(&summary.game_id) else {
                    continue;
                };
                let stored = match self.store.finished(game).await {
                    Err(StoreError::Unreadable(problem)) => {
                        skipped.named.push(problem);
                        continue;
                    }
                    stored => stored?,
                };
                if let Some(stored) = stored {
                    let seats = seats_of(&summary, who).map(|seat| seat.seat).collect();
                    let who = who.clone();
                    let reading = blocking(move || lines_of_game(&summary, &stored.lines(), &who));
                    sheet.send(reading.await?).await?;
                    let id = game.to_string();
                    match self.export_samples(id, seats, sheet).await {
                        Err(DataError::Io(problem)) => {
                            skipped
                                .named
                                .push(format!("samples of game {game}: {problem}"));
                        }
                        exported => exported?,
                    }
                }
            }
        }
        Ok(known)
    }

    /// Sends the samples of seats of a game, whose lines have been sent.
    async fn export_samples(
        &self,
        game_id: String,
        seats: Vec<u32>,
        sheet: &Sheet<'_>,
    ) -> Result<(), DataError> {
        let Some(data_dir) = self.data_dir.clone() else {
            return Ok(());
        };
        let sender = sheet.sender.clone();
        let sending = blocking(move || {
            seats.into_iter().try_for_each(|seat| {
                let path = samples::path_of(&data_dir, &game_id, seat as usize);
                let send = |chunk: v1::SampleChunk| {
                    let line = json!({ "samples": {
                        "stream": chunk.stream,
                        "channels": chunk.channels,
                        "elapsedUs": chunk.elapsed_us,
                        "values": chunk.values,
                    }, "seat": seat, "gameId": game_id });
                    // That nobody receives them is noticed below.
                    let _ = sender.blocking_send(line.to_string());
                };
                samples::read(&path, send).map(drop)
            })
        });
        sending.await??;
        match sheet.sender.is_closed() {
            true => Err(DataError::Gone),
            false => Ok(()),
        }
    }

    /// Sends the games that are in files alone, such as imported ones.
    async fn export_files(
        &self,
        who: &Named,
        mut known: BTreeSet<String>,
        sheet: &mut Sheet<'_>,
    ) -> Result<Skipped, DataError> {
        let mut skipped = Skipped::default();
        let Some(data_dir) = self.data_dir.clone() else {
            return Ok(skipped);
        };
        let wanted = who.name.clone();
        for candidate in blocking(move || records_with(&data_dir, &wanted)).await?? {
            let who = who.clone();
            let reading = blocking(move || {
                let mut lines = Vec::new();
                if let Some(record) = skipped.read(&candidate) {
                    match replay(&record) {
                        Ok(replayed) => {
                            if let Some(summary) = summary(&record, &replayed)
                                && known.insert(summary.game_id.clone())
                            {
                                lines = lines_of_game(&summary, &record, &who);
                            }
                        }
                        Err(error) => {
                            let why = format!("{}: {error}", candidate.path.display());
                            skipped.note(&candidate, why);
                        }
                    }
                }
                (lines, skipped, known)
            });
            let lines;
            (lines, skipped, known) = reading.await?;
            sheet.send(lines).await?;
        }
        Ok(skipped)
    }
}

/// The seats of the participant in a game.
fn seats_of<'s>(
    summary: &'s v1::RecordSummary,
    who: &'s Named,
) -> impl Iterator<Item = &'s v1::Participant> {
    summary.seats.iter().filter(|seat| who.is_at(seat))
}

/// What the participant did in a game; nothing if it took no part.
fn lines_of_game(summary: &v1::RecordSummary, lines: &[v1::RecordLine], who: &Named) -> Vec<Value> {
    let game_id = &summary.game_id;
    let mut own = ParticipantSeats::at_start(lines, who);
    let mut rest = Vec::new();
    for line in lines.iter().filter_map(|line| line.line.as_ref()) {
        match line {
            Line::Decision(decision) if own.has(decision.seat) => {
                rest.push(json!({ "decision": decision, "gameId": game_id }));
            }
            Line::PrivateExpression(private) if own.has(private.seat) => {
                let shown = private.expression.as_ref();
                rest.push(expression(game_id, private.elapsed_ms, shown));
            }
            Line::Event(event) => {
                own.follow(event, who);
                if let Some(Kind::ExpressionShown(shown)) = &event.kind
                    && own.has(shown.seat)
                {
                    let shown = shown.expression.as_ref();
                    rest.push(expression(game_id, event.elapsed_ms, shown));
                }
            }
            _ => {}
        }
    }
    let seats: Vec<&v1::Participant> = seats_of(summary, who).collect();
    if seats.is_empty() && rest.is_empty() {
        return Vec::new();
    }
    let results: Vec<&v1::Standing> = (summary.standings.iter())
        .filter(|standing| seats.iter().any(|seat| seat.seat == standing.seat))
        .collect();
    let game = json!({ "game": {
        "gameId": game_id,
        "roomName": summary.room_name,
        "state": summary.state().as_str_name(),
        "createdAtMs": summary.created_at_ms,
        "endedAtMs": summary.ended_at_ms,
        "tournamentId": summary.tournament_id,
        "rules": summary.rules,
        "seats": seats,
        "results": results,
    } });
    rest.insert(0, game);
    rest
}

fn expression(game_id: &str, elapsed_ms: u64, expression: Option<&v1::Expression>) -> Value {
    json!({ "expression": expression, "elapsedMs": elapsed_ms, "gameId": game_id })
}
