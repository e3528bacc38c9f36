//! Checks a decision against the game before it: seat, legality, source and time.

use chefshat_engine::limits::{
    MAX_ANNOTATION_BYTES, MAX_ANNOTATION_BYTES_PER_GAME, MAX_ATTEMPTS, MAX_HINTS,
};
use chefshat_engine::{ActionId, ActionSpace, DecisionKind, Game, Mask, Seat};
use chefshat_proto::v1::{self, DecisionSource as Source};
use prost::Message;

use super::difference::must_be;
use super::header::Setup;
use crate::convert::{action_id, decision_kind, has_real_cards, invalid_reward, seat_number};

/// The state of a seat between its decisions.
#[derive(Debug, Clone)]
pub(super) struct SeatClock {
    /// The number of decisions so far.
    pub(super) decisions: u64,
    /// Time per decision before the time bank is used, milliseconds.
    pub(super) decision_time_ms: u32,
    /// Time bank left, milliseconds.
    pub(super) bank_ms: u32,
    /// How long the game waits for the seat while it is not connected, milliseconds. `None`: an
    /// absence changes nothing.
    pub(super) absence_ms: Option<u32>,
    /// Whether the seat is a built-in agent's.
    pub(super) built_in: bool,
    /// Whether its player sits at the physical table.
    pub(super) at_table: bool,
    /// Whether a substitute plays for the seat.
    pub(super) substituted: bool,
    /// Whether its participant is connected; `None` if the events do not tell.
    pub(super) connected: Option<bool>,
    /// When its connection was lost, or the last decision was taken if that is later.
    pub(super) lost_at_ms: u64,
    /// How long it was not connected since the last decision, in absences that have ended.
    pub(super) away_ms: u64,
    /// Whether its last decision certainly ended because it was away, so that it is substituted.
    pub(super) absent: bool,
    /// Whether it may be substituted, because it was away when its last decision ended.
    pub(super) absent_at_most: bool,
    /// Timeouts in a row, as far as they certainly count.
    pub(super) timeouts: u32,
    /// Timeouts in a row, if everything counts that may: servers differ in whether silent decisions
    /// do.
    pub(super) timeouts_at_most: u32,
    /// Bytes of its annotations so far.
    pub(super) annotation_bytes: usize,
}

impl SeatClock {
    /// Counts a decision of the seat.
    pub(super) fn count(&mut self, kind: DecisionKind, record: &v1::DecisionRecord) {
        self.decisions += 1;
        let own_ms = u64::from(self.decision_time_ms) + u64::from(self.bank_ms);
        self.bank_ms = record.bank_left_ms;
        self.annotation_bytes += (record.annotations.as_ref()).map_or(0, Message::encoded_len);
        let silent = u32::from(kind == DecisionKind::SpecialAction);
        let by_absence = record.source() == Source::Disconnected && self.absence_ms.is_some();
        self.absent_at_most = by_absence && silent == 0;
        self.absent = self.absent_at_most && record.decision_time_us < own_ms * 1000;
        match record.source() {
            Source::Agent => {
                self.timeouts = 0;
                self.timeouts_at_most *= silent;
            }
            Source::Timeout | Source::Disconnected => {
                self.timeouts += 1 - silent;
                self.timeouts_at_most += 1;
            }
            _ => {}
        }
    }
}

impl SeatClock {
    /// The connection was lost.
    pub(super) fn lose(&mut self, elapsed_ms: u64) {
        if self.connected != Some(false) {
            self.lost_at_ms = elapsed_ms;
        }
        self.connected = Some(false);
    }

    /// How long it was at most not connected since the last decision, until now. `None` if the
    /// events do not tell.
    pub(super) fn away_ms_at(&self, elapsed_ms: u64) -> Option<u64> {
        match self.connected? {
            true => Some(self.away_ms),
            // Both ends are truncated.
            false => Some(self.away_ms + elapsed_ms.saturating_sub(self.lost_at_ms) + 1),
        }
    }

    /// How much of the time of a decision, taken now, the bank may not pay for because the seat was
    /// away, milliseconds.
    fn unbanked_ms_at(&self, elapsed_ms: u64) -> u64 {
        match self.absence_ms {
            Some(_) => self.away_ms_at(elapsed_ms).unwrap_or(u64::from(u32::MAX)),
            None => 0,
        }
    }
}

/// The context of a decision.
pub(super) struct OpenDecision<'a> {
    pub(super) setup: &'a Setup,
    pub(super) game: &'a Game,
    pub(super) seat: Seat,
    pub(super) kind: DecisionKind,
    pub(super) clock: &'a SeatClock,
    /// Whether the decision is taken over from another record.
    pub(super) taken_over: bool,
    /// Whether the hand, and so the legal actions, are known.
    pub(super) hand_known: bool,
    /// Milliseconds since the previous decision or the start of the game.
    pub(super) since_last_ms: u64,
    /// The longest time per decision of any seat, milliseconds.
    pub(super) longest_decision_ms: u32,
    /// The shortest time that a special action may have, milliseconds.
    pub(super) shortest_special_ms: u32,
}

impl OpenDecision<'_> {
    /// Checks everything except the events that follow, and returns the action.
    ///
    /// # Errors
    /// The first wrong field.
    pub(super) fn check(&self, record: &v1::DecisionRecord) -> Result<ActionId, String> {
        let seat = seat_number(self.seat);
        if record.seat != seat {
            return Err(must_be("seat", record.seat, seat));
        }
        let id = self.clock.decisions + 1;
        if record.decision_id != id {
            return Err(must_be("decisionId", record.decision_id, id));
        }
        let kind = decision_kind(self.kind);
        if record.kind() != kind {
            return Err(must_be(
                "kind",
                record.kind().as_str_name(),
                kind.as_str_name(),
            ));
        }
        let action = self.check_action(record)?;
        self.check_attempts(record)?;
        self.check_source(record, action)?;
        self.check_times(record)?;
        self.check_annotations(record.annotations.as_ref())?;
        self.check_hints(record)?;
        Ok(action)
    }

    fn check_action(&self, record: &v1::DecisionRecord) -> Result<ActionId, String> {
        let space = self.setup.rules.actions();
        let legal = self.game.legal_actions();
        if self.hand_known {
            check_mask(&record.action_mask, &legal, space)?;
        } else if !record.action_mask.is_empty() {
            return Err("actionMask is present, but the hand is unknown".into());
        }
        let action = action_id(record.action);
        let text = space.text(action).ok_or_else(|| {
            format!(
                "action is {} and must be below {}",
                record.action,
                space.size()
            )
        })?;
        if record.text != text {
            return Err(must_be("text", record.text.as_str(), text));
        }
        if let Err(error) = self.game.check(action) {
            return Err(format!("action is {}: {error}", record.action));
        }
        Ok(action)
    }

    fn check_attempts(&self, record: &v1::DecisionRecord) -> Result<(), String> {
        let legal = self.game.legal_actions();
        // A correction may have changed the game before a decision of a physical room.
        let unchanged = self.setup.origin != v1::GameOrigin::Physical;
        for (index, attempt) in record.invalid_attempts.iter().enumerate() {
            if unchanged && self.hand_known && legal.contains(action_id(*attempt)) {
                return Err(format!(
                    "invalidAttempts[{index}] is {attempt}, which was legal"
                ));
            }
        }
        let attempts = record.invalid_attempts.len();
        let expected = invalid_reward(self.setup.scheme, self.kind, attempts);
        if record.invalid_reward == expected {
            return Ok(());
        }
        let shown =
            |reward: Option<f32>| reward.map_or("absent".into(), |reward| reward.to_string());
        Err(must_be(
            "invalidReward",
            shown(record.invalid_reward),
            shown(expected),
        ))
    }

    fn check_hints(&self, record: &v1::DecisionRecord) -> Result<(), String> {
        let most = match self.setup.hints && !self.clock.built_in {
            true => MAX_HINTS,
            false => 0,
        };
        if record.hints > most {
            return Err(format!(
                "hints is {} and must be at most {most}",
                record.hints
            ));
        }
        Ok(())
    }

    fn check_source(&self, record: &v1::DecisionRecord, action: ActionId) -> Result<(), String> {
        let source = Source::try_from(record.source).unwrap_or_default();
        let name = source.as_str_name();
        if self.taken_over != (source == Source::Recorded) {
            return Err(if self.taken_over {
                must_be("source", name, Source::Recorded.as_str_name())
            } else {
                format!(
                    "source is {name}, but all decisions taken over from another record came before"
                )
            });
        }
        let SeatClock {
            built_in,
            at_table,
            substituted,
            ..
        } = *self.clock;
        let by_server = substituted || built_in || at_table;
        let possible = match source {
            Source::Unspecified => false,
            Source::Agent => !substituted && !at_table,
            Source::Timeout | Source::Disconnected => !by_server,
            Source::Substitute => substituted,
            Source::Invalid | Source::Recorded => !at_table,
            Source::Table => self.setup.origin == v1::GameOrigin::Physical,
        };
        let imported = self.setup.origin == v1::GameOrigin::Imported;
        if !possible || (imported && source != Source::Agent) {
            let whose = match (imported, at_table, built_in, substituted) {
                (true, ..) => "every player of a real table decides",
                (_, true, ..) => "the seat's player sits at the table",
                (_, _, true, _) => "the seat is a built-in agent's",
                (_, _, _, true) => "a substitute plays for the seat",
                _ => "the seat's own agent plays",
            };
            return Err(format!("source is {name}, but {whose}"));
        }
        let limit = match self.setup.max_invalid_attempts {
            0 => MAX_ATTEMPTS,
            limit => limit,
        };
        let connected = self.clock.connected;
        let alone = match source {
            Source::Timeout => connected == Some(false),
            Source::Disconnected => connected == Some(true),
            _ => false,
        };
        if alone {
            return Err(format!(
                "source is {name}, but by the events the seat was {}connected",
                if connected == Some(true) { "" } else { "not " }
            ));
        }
        let exhausted = record.invalid_attempts.len() >= limit as usize;
        if record.invalid_attempts.len() > limit as usize
            || exhausted != (source == Source::Invalid)
        {
            return Err(format!(
                "source is {name} after {} invalid attempts, but the default decision follows after {limit}",
                record.invalid_attempts.len()
            ));
        }
        // As for the attempts.
        let unchanged = self.setup.origin != v1::GameOrigin::Physical;
        let by_default = matches!(
            source,
            Source::Timeout | Source::Disconnected | Source::Invalid
        );
        match self.game.default_action() {
            Some(default) if by_default && unchanged && default != action => Err(format!(
                "action is {} and must be {default}, the default decision, because source is {name}",
                record.action
            )),
            _ => Ok(()),
        }
    }

    fn check_times(&self, record: &v1::DecisionRecord) -> Result<(), String> {
        let time = record.decision_time_us;
        let timed = matches!(
            record.source(),
            Source::Agent
                | Source::Timeout
                | Source::Disconnected
                | Source::Invalid
                | Source::Table
        );
        if time > 0 && (!timed || (self.clock.built_in && record.source() != Source::Table)) {
            return Err(must_be("decisionTimeUs", time, 0));
        }
        // Both ends of the span are truncated to milliseconds.
        let most = self.since_last_ms.saturating_add(1).saturating_mul(1000);
        if time > most && !has_real_cards(self.setup.origin) {
            return Err(format!(
                "decisionTimeUs is {time}, but only {} ms passed since the previous decision",
                self.since_last_ms
            ));
        }
        let bank_ms = self.clock.bank_ms;
        if record.source() == Source::Table {
            // No clock runs for a player at the table.
            return match record.bank_left_ms == bank_ms {
                true => Ok(()),
                false => Err(must_be("bankLeftMs", record.bank_left_ms, bank_ms)),
            };
        }
        if !has_real_cards(self.setup.origin) && !self.clock.built_in {
            self.check_limit(record)?;
        }
        if self.kind == DecisionKind::SpecialAction && record.bank_left_ms == bank_ms {
            // It does not use the bank, since others see what is left of it. It once did.
            return Ok(());
        }
        let beyond_us = time.saturating_sub(u64::from(self.clock.decision_time_ms) * 1000);
        let bank_us = u64::from(bank_ms) * 1000;
        let unbanked_us = self.clock.unbanked_ms_at(record.elapsed_ms) * 1000;
        let left = bank_us.saturating_sub(beyond_us.saturating_sub(unbanked_us)) / 1000;
        // The time was truncated to microseconds after the bank was charged.
        let least = match self.setup.origin {
            // Decisions that a correction voided took their time too.
            v1::GameOrigin::Physical => 0,
            _ => bank_us.saturating_sub(beyond_us + u64::from(beyond_us > 0)) / 1000,
        };
        if (least..=left).contains(&record.bank_left_ms.into()) {
            Ok(())
        } else {
            Err(must_be("bankLeftMs", record.bank_left_ms, left))
        }
    }
}

impl OpenDecision<'_> {
    /// Checks that a decision was taken before the time was up, and a timeout after it.
    fn check_limit(&self, record: &v1::DecisionRecord) -> Result<(), String> {
        let clock = self.clock;
        let special = self.kind == DecisionKind::SpecialAction;
        let in_time = |ms: u64| record.decision_time_us < ms * 1000;
        let (own, bank) = (u64::from(clock.decision_time_ms), u64::from(clock.bank_ms));
        let absence = (clock.absence_ms).filter(|_| record.source() == Source::Disconnected);
        let unbanked = clock.unbanked_ms_at(record.elapsed_ms);
        // The absence time counts from the loss of the connection.
        let was_away = |absence: u32| {
            let away = clock.away_ms_at(record.elapsed_ms);
            away.is_none_or(|away| away >= absence.into())
        };
        // The longest time of any seat limits a special action, without the bank. It may have less.
        let (least, most) = match (special, absence) {
            (true, _) => (
                u64::from(self.shortest_special_ms),
                u64::from(self.longest_decision_ms).max(own + bank),
            ),
            (false, Some(absence)) if was_away(absence) => (absence.into(), own + bank),
            (false, _) => (own + bank, own + bank + unbanked),
        };
        match record.source() {
            Source::Timeout | Source::Disconnected if in_time(least) => Err(format!(
                "source is {}, but after {} microseconds the time was not up: the seat had {least} ms",
                record.source().as_str_name(),
                record.decision_time_us
            )),
            Source::Agent | Source::Invalid if !in_time(most) => Err(format!(
                "decisionTimeUs is {}, but the seat had only {most} ms",
                record.decision_time_us
            )),
            _ => Ok(()),
        }
    }

    fn check_annotations(&self, annotations: Option<&v1::Annotations>) -> Result<(), String> {
        let Some(annotations) = annotations else {
            return Ok(());
        };
        let mut numbers = (annotations.action_scores.iter()).chain(&annotations.value_estimate);
        if !numbers.all(|number| number.is_finite()) {
            return Err("annotations contain a number that is not finite".into());
        }
        let bytes = annotations.encoded_len();
        if bytes > MAX_ANNOTATION_BYTES {
            return Err(format!(
                "annotations have {bytes} bytes, of at most {MAX_ANNOTATION_BYTES}"
            ));
        }
        let all = self.clock.annotation_bytes + bytes;
        if all > MAX_ANNOTATION_BYTES_PER_GAME {
            return Err(format!(
                "the seat's annotations have {all} bytes so far, of at most {MAX_ANNOTATION_BYTES_PER_GAME} in a game"
            ));
        }
        Ok(())
    }
}

fn check_mask(found: &[u8], legal: &Mask, space: ActionSpace) -> Result<(), String> {
    let expected = legal.to_bytes(space.size());
    if found == expected {
        return Ok(());
    }
    if found.len() != expected.len() {
        return Err(format!(
            "actionMask has {} bytes and must have {}",
            found.len(),
            expected.len()
        ));
    }
    let stated = |action: u16| {
        found
            .get(usize::from(action / 8))
            .is_some_and(|byte| byte >> (action % 8) & 1 == 1)
    };
    let wrong =
        (0..space.size()).find(|&action| stated(action) != legal.contains(ActionId::new(action)));
    Err(match wrong {
        Some(action) => format!(
            "actionMask has {} as {}legal, but it is{}",
            space.text(ActionId::new(action)).unwrap_or_default(),
            if stated(action) { "" } else { "not " },
            if stated(action) { " not" } else { "" },
        ),
        None => "actionMask has bits beyond the last action".into(),
    })
}
