//! A participant's data in stored studies. Deleting them while no server runs does what its
//! withdrawal does while one runs.

use std::io;
use std::sync::Arc;

use chefshat_record::pseudonym::Named;
use chefshat_room::ids::GameId;
use chefshat_study::{Answer, Change, Withdrew};
use serde_json::json;

use super::data::{DataError, ParticipantData};
use super::export::Sheet;
use crate::studies::restored;
use chefshat_base::clock::since_epoch_ms;
use chefshat_store::samples::Samples;
use chefshat_store::studies::StoredStudy;
use chefshat_store::{StoreError, units_of};
use chefshat_wire::convert::{self, Mirrored as _};

impl ParticipantData {
    /// Whether a participant of this name has a game of a study that is not over.
    pub(super) async fn plays_in_studies(&self, who: &Named) -> Result<bool, StoreError> {
        for (stored, number) in self.in_studies(who).await? {
            let mut is_playing = false;
            for change in &stored.changes {
                match change {
                    Change::Placed(it) if it.number == number => is_playing = true,
                    Change::GameEnded(it) if it.number == number => is_playing = false,
                    _ => {}
                }
            }
            if is_playing {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Deletes a participant's data from the studies. Returns from how many.
    pub(super) async fn delete_from_studies(&self, who: &Named) -> Result<u64, DataError> {
        let mut count = 0;
        for (stored, number) in self.in_studies(who).await? {
            let mut changes = stored.changes;
            let mut games = games_of(&changes, number);
            changes.push(Change::Withdrew(Withdrew {
                number,
                delete_data: true,
                at_ms: since_epoch_ms(),
            }));
            for change in &mut changes {
                change.forget(number);
            }
            // A server completes what is interrupted between these two.
            let id = stored.header.id;
            let forgotten = vec![number];
            StoredStudy::rewrite(self.store.as_ref(), id, &changes, forgotten).await?;
            let samples = Arc::new(Samples::new(self.data_dir.clone()));
            let undeleted = samples.delete(games.clone()).await;
            let undeleted = undeleted.map_err(io::Error::other)?;
            games.retain(|game| !undeleted.contains_key(game));
            self.store.delete(games).await?;
            // Doing it again completes it.
            if let Some(error) = undeleted.into_values().next() {
                return Err(error.into());
            }
            count += 1;
        }
        Ok(count)
    }

    /// Sends a participant's consent, answers and interface traces.
    pub(super) async fn export_studies(
        &self,
        who: &Named,
        sheet: &mut Sheet<'_>,
        unreadable: &mut Vec<String>,
    ) -> Result<(), DataError> {
        for (stored, number) in self.in_readable_studies(who, unreadable).await? {
            let id = stored.header.id;
            let study = match restored(&stored) {
                Ok((_, study)) => study,
                Err(problem) => {
                    unreadable.push(format!("study {id} cannot be read: {problem}"));
                    continue;
                }
            };
            let Some(participant) = study.participant(number) else {
                continue;
            };
            let state = participant.status.to_proto();
            let consent = participant.consent.as_ref().map(|consent| {
                json!({
                    "atMs": consent.at_ms,
                    "version": consent.version,
                    "language": consent.language,
                    "textSha256": hex::encode(&consent.text_sha256),
                })
            });
            let devices = participant.devices.iter().map(|(session, opened)| {
                let device = convert::device_to_proto(&opened.device);
                json!({ "session": session, "openedAtMs": opened.at_ms, "device": device })
            });
            let devices: Vec<_> = devices.collect();
            let games = games_of(&stored.changes, number);
            let games: Vec<String> = games.iter().map(GameId::to_string).collect();
            let mut lines = vec![json!({ "study": {
                "studyId": id.to_string(),
                "name": stored.header.settings.name,
                "number": number,
                "panelId": participant.panel_id(),
                "state": state.as_str_name(),
                "devices": devices,
                "consent": consent,
                "reachedAtMs": participant.reached_at_ms,
                "passedOver": participant.passed_over,
                "endedAtMs": participant.ended_at_ms,
                "gameIds": games,
            } })];
            for (step, questionnaire, item, answer) in study.answered_items(participant) {
                let value = answer.value.as_ref().map(|value| match value {
                    Answer::Number(number) => json!(number),
                    Answer::Options(chosen) => json!(chosen.options),
                    Answer::Text(text) => json!(text),
                });
                lines.push(json!({ "answer": {
                    "step": step,
                    "questionnaire": questionnaire.id,
                    "item": item.map(|item| &item.id),
                    "value": value,
                    "answeredAfterMs": answer.answered_after_ms,
                }, "studyId": id.to_string() }));
            }
            sheet.send(lines).await?;
            let all = self.store.traces(id).await?;
            for traces in all.iter().filter(|traces| traces.number == number) {
                let game = traces.game.to_string();
                let lines = traces.traces.iter();
                let session = traces.session;
                let lines = lines
                    .map(|trace| json!({ "trace": trace, "gameId": game, "session": session }));
                sheet.send(lines.collect()).await?;
            }
        }
        Ok(())
    }

    /// The studies that have the participant, with its number. Nobody has a key there.
    pub(super) async fn in_studies(
        &self,
        who: &Named,
    ) -> Result<Vec<(StoredStudy, u32)>, StoreError> {
        let mut unreadable = Vec::new();
        let found = self.in_readable_studies(who, &mut unreadable).await?;
        // What is to be changed everywhere must be readable everywhere.
        match unreadable.pop() {
            Some(problem) => Err(StoreError::Unreadable(problem)),
            None => Ok(found),
        }
    }

    /// As [`Self::in_studies`]. Studies that cannot be read are named.
    async fn in_readable_studies(
        &self,
        who: &Named,
        unreadable: &mut Vec<String>,
    ) -> Result<Vec<(StoredStudy, u32)>, StoreError> {
        let mut found = Vec::new();
        for id in units_of(self.store.as_ref(), usize::MAX).await? {
            let stored = match StoredStudy::read(self.store.as_ref(), id).await {
                Err(StoreError::Unreadable(problem)) => {
                    unreadable.push(problem);
                    continue;
                }
                stored => stored?,
            };
            let Some(stored) = stored else { continue };
            let number = stored.changes.iter().find_map(|change| match change {
                Change::Added(added) if who.is(&added.pseudonym, "") => Some(added.number),
                _ => None,
            });
            found.extend(number.map(|number| (stored, number)));
        }
        Ok(found)
    }
}

/// The games of a participant.
fn games_of(changes: &[Change], wanted: u32) -> Vec<GameId> {
    let games = changes.iter().filter_map(|change| match change {
        Change::Placed(it) if it.number == wanted => Some(convert::game_of(&it.game().ok()?)),
        _ => None,
    });
    games.collect()
}

#[cfg(test)]
mod tests {
    use chefshat_proto::v1;
    use chefshat_room::ids::{Id, SecretHash};
    use chefshat_study::Added;
    use tokio::sync::mpsc;

    use super::*;
    use chefshat_store::MemoryStore;
    use chefshat_store::studies::StudyHeader;
    use chefshat_store::testing::TypedUnits as _;

    #[tokio::test]
    async fn a_study_whose_settings_cannot_be_read_is_named_in_an_export() {
        let store = Arc::new(MemoryStore::default());
        let header = StudyHeader {
            id: Id::from_bytes([7; 16]),
            // Those of a later version, say: this one knows no study without conditions.
            settings: v1::StudySettings::default(),
            created_at_ms: 1,
            owner: SecretHash::of(b"owner"),
            key: [8; 32],
        };
        let id = header.id;
        store.create_study(Arc::new(header)).await.expect("stored");
        let added = Change::Added(Added {
            number: 1,
            pseudonym: "Ada".to_owned(),
            joined: None,
            test: false,
            planned: None,
        });
        let appended = store.append_study(id, 0, vec![added]).await;
        appended.expect("stored");
        let data = ParticipantData::new(store, None);
        let who = Named {
            name: "Ada".to_owned(),
            fingerprint: None,
        };
        let (sender, mut lines) = mpsc::channel(1);
        let skipped = data.export(&who, &sender).await.expect("an export");
        drop(sender);
        assert_eq!(lines.recv().await, None);
        let [problem] = &skipped.named[..] else {
            panic!("{skipped:?}");
        };
        assert!(problem.contains(&id.to_string()), "{problem}");
    }
}
