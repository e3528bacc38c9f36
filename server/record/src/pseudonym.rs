//! Pseudonymizes a participant in a record: replaces the name, also in markers, and drops
//! expressions and annotations. Decisions stay, so the record still verifies.

use std::sync::Arc;

use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};

use crate::convert::MAX_LABEL;
use crate::outcome::without_comments;
use crate::signature::SigningKey;

/// The longest name of a room, characters.
const MAX_ROOM_NAME: usize = 64;

/// Whether a text is empty or could be the fingerprint of a name and its key: 16 hexadecimal digits
/// in lower case.
pub fn is_fingerprint(text: &str) -> bool {
    let is_digit = |digit: u8| matches!(digit, b'0'..=b'9' | b'a'..=b'f');
    [0, 16].contains(&text.len()) && text.bytes().all(is_digit)
}

/// Whom a name means in records.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Named {
    /// The name.
    pub name: String,
    /// Of those who played under the name, the one with this fingerprint of its key; empty: those
    /// without a key; `None`: all.
    pub fingerprint: Option<String>,
}

impl Named {
    /// Whether a participant of this name and fingerprint is meant.
    pub fn is(&self, name: &str, fingerprint: &str) -> bool {
        name == self.name
            && self
                .fingerprint
                .as_deref()
                .is_none_or(|it| it == fingerprint)
    }

    /// Whether the participant of a seat is meant; built-in agents of the same name are not.
    pub fn is_at(&self, seat: &v1::Participant) -> bool {
        seat.built_in_agent.is_empty() && self.is(&seat.name, &seat.name_fingerprint)
    }

    /// Whether the participant may be in a record: markers may name those who are not, if all of a
    /// name are meant.
    fn may_be_in(&self, lines: &[v1::RecordLine]) -> bool {
        let in_header = |header: &v1::RecordHeader| {
            let of_study = |study: &v1::StudyRecord| {
                let mut others = study.others.iter().map(|other| &other.participant);
                self.is(&study.participant, "") || others.any(|name| self.is(name, ""))
            };
            header.seats.iter().any(|seat| self.is_at(seat))
                || header.study.as_ref().is_some_and(of_study)
        };
        self.fingerprint.is_none()
            || lines.iter().any(|line| match &line.line {
                Some(Line::Header(header)) => in_header(header),
                _ => false,
            })
    }
}

/// A participant and its pseudonym.
#[derive(Debug, Clone)]
pub struct Pseudonym {
    /// Whose name to replace.
    pub of: Named,
    /// The pseudonym, 1..=64 characters.
    pub pseudonym: String,
    /// Signs again what it had signed before the change.
    pub key: Option<Arc<SigningKey>>,
}

/// Numbers of changes to a record.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Redactions {
    /// Occurrences of the name replaced.
    pub names: u64,
    /// Expressions dropped.
    pub expressions: u64,
    /// Annotations dropped.
    pub annotations: u64,
}

impl std::ops::AddAssign for Redactions {
    fn add_assign(&mut self, more: Self) {
        self.names += more.names;
        self.expressions += more.expressions;
        self.annotations += more.annotations;
    }
}

/// The seats of one participant, followed through the events of a game. Records have the
/// fingerprints of those who played: who left before the game is the participant only if all of a
/// name are meant.
#[derive(Debug, Clone, Default)]
pub struct ParticipantSeats {
    seats: Vec<u32>,
    /// The seats in which the participant played.
    played: Vec<u32>,
    /// The seat of each who leaves from now on.
    leaving: Vec<u32>,
}

impl ParticipantSeats {
    /// The seats at the start of a record; in imported games no event seats a participant.
    pub fn at_start(lines: &[v1::RecordLine], who: &Named) -> Self {
        let mut own = Self::default();
        for line in lines.iter().filter_map(|line| line.line.as_ref()) {
            match line {
                Line::Header(header) => {
                    let played = header.seats.iter().filter(|seat| who.is_at(seat));
                    own.played = played.map(|seat| seat.seat).collect();
                    own.seats.clone_from(&own.played);
                }
                Line::Event(event) => match &event.kind {
                    Some(Kind::Seated(seated)) => own.vacated(seated.seat),
                    Some(Kind::Vacated(vacated)) => own.leaving.push(vacated.seat),
                    _ => {}
                },
                _ => {}
            }
        }
        own
    }

    /// Applies an event. Returns whether the participant takes a seat with it.
    pub fn follow(&mut self, event: &v1::GameEvent, who: &Named) -> bool {
        match &event.kind {
            Some(Kind::Seated(seated)) => {
                let stays = !self.leaving.contains(&seated.seat);
                let is_meant =
                    who.fingerprint.is_none() || (stays && self.played.contains(&seated.seat));
                let is_own = seated.name == who.name && is_meant;
                self.seated(seated.seat, is_own);
                is_own
            }
            Some(Kind::Vacated(vacated)) => {
                let left = self.leaving.iter().position(|seat| *seat == vacated.seat);
                left.map(|index| self.leaving.swap_remove(index));
                self.vacated(vacated.seat);
                false
            }
            _ => false,
        }
    }

    /// Applies a seating.
    pub fn seated(&mut self, seat: u32, own: bool) {
        self.vacated(seat);
        if own {
            self.seats.push(seat);
        }
    }

    /// Applies a vacated seat.
    pub fn vacated(&mut self, seat: u32) {
        self.seats.retain(|known| *known != seat);
    }

    /// Whether a seat is the participant's.
    pub fn has(&self, seat: u32) -> bool {
        self.seats.contains(&seat)
    }
}

impl Pseudonym {
    /// Pseudonymizes a record. Built-in agents of the same name are unaffected. A record that
    /// changes says so, and loses its signature unless it is of the key.
    pub fn redact(&self, lines: &mut Vec<v1::RecordLine>) -> Redactions {
        let mut out = Redactions::default();
        if !self.of.may_be_in(lines) {
            return out;
        }
        let key = self.key.as_ref().filter(|key| key.has_signed(lines));
        let mut own = ParticipantSeats::at_start(lines, &self.of);
        let mut dropped_events = 0;
        lines.retain_mut(|line| match &mut line.line {
            Some(Line::Header(header)) => {
                out.names += self.in_seats(&mut header.seats);
                if let Some(study) = &mut header.study {
                    let others = study.others.iter_mut().map(|other| &mut other.participant);
                    let names = std::iter::once(&mut study.participant).chain(others);
                    for name in names.filter(|name| self.of.is(name, "")) {
                        name.clone_from(&self.pseudonym);
                        out.names += 1;
                    }
                }
                true
            }
            Some(Line::Decision(decision)) => {
                if own.has(decision.seat) {
                    let left = decision.annotations.as_ref().and_then(without_comments);
                    out.annotations += u64::from(left != decision.annotations);
                    decision.annotations = left;
                }
                true
            }
            Some(Line::Event(event)) => {
                if let Some(Kind::ExpressionShown(shown)) = &event.kind
                    && own.has(shown.seat)
                {
                    out.expressions += 1;
                    dropped_events += 1;
                    return false;
                }
                event.sequence = event.sequence.saturating_sub(dropped_events);
                let is_own = own.follow(event, &self.of);
                match &mut event.kind {
                    Some(Kind::Seated(seated)) if is_own => {
                        seated.name.clone_from(&self.pseudonym);
                        out.names += 1;
                    }
                    Some(Kind::GameStarted(started)) => {
                        out.names += self.in_seats(&mut started.seats);
                    }
                    _ => {}
                }
                true
            }
            Some(Line::PrivateExpression(expression)) => {
                let drop = own.has(expression.seat);
                out.expressions += u64::from(drop);
                !drop
            }
            Some(Line::Marker(marker)) => {
                out.names += self.in_label(&mut marker.label);
                true
            }
            Some(Line::Footer(footer)) => {
                footer.events = footer.events.saturating_sub(dropped_events);
                true
            }
            None => true,
        });
        // Rooms are often named after a player.
        if out.names > 0
            && let Some(Line::Header(header)) =
                lines.first_mut().and_then(|line| line.line.as_mut())
        {
            out.names += self.in_text(&mut header.room_name);
        }
        if out != Redactions::default()
            && let Some(Line::Footer(footer)) = lines.last_mut().and_then(|line| line.line.as_mut())
        {
            footer.signature = None;
            footer.participant_removed = true;
            if let Some(key) = key {
                key.sign_in_place(lines);
            }
        }
        out
    }

    /// Replaces the name among seats; returns the number of replacements.
    pub fn in_seats(&self, seats: &mut [v1::Participant]) -> u64 {
        let mut found = 0;
        for seat in seats {
            if self.of.is_at(seat) {
                seat.name.clone_from(&self.pseudonym);
                seat.name_fingerprint.clear();
                found += 1;
            }
        }
        found
    }

    /// Replaces the name where it occurs as whole words in a room name; returns the number of
    /// replacements.
    pub fn in_text(&self, text: &mut String) -> u64 {
        self.in_words(text, MAX_ROOM_NAME)
    }

    /// Replaces the name where it occurs as whole words in the label of a marker; returns the
    /// number of replacements.
    pub fn in_label(&self, label: &mut String) -> u64 {
        self.in_words(label, MAX_LABEL)
    }

    /// As [`Pseudonym::in_text`], for a text of at most `max` characters.
    fn in_words(&self, text: &mut String, max: usize) -> u64 {
        let is_part = |character: Option<char>| character.is_some_and(char::is_alphanumeric);
        let (mut replaced, mut rest, mut found) = (String::new(), text.as_str(), 0);
        let name = self.of.name.as_str();
        while !name.is_empty()
            && let Some(at) = rest.find(name)
        {
            let (before, after) = (&rest[..at], &rest[at + name.len()..]);
            let alone = !is_part(before.chars().next_back().or(replaced.chars().next_back()))
                && !is_part(after.chars().next());
            replaced.push_str(before);
            replaced.push_str(if alone { &self.pseudonym } else { name });
            found += u64::from(alone);
            rest = after;
        }
        if found > 0 {
            replaced.push_str(rest);
            *text = replaced.chars().take(max).collect();
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use crate::pseudonym::*;

    #[test]
    fn a_name_is_replaced_in_room_names_only_as_a_word() {
        let pseudonym = Pseudonym {
            of: Named {
                name: "Ana".into(),
                fingerprint: None,
            },
            pseudonym: "X".into(),
            key: None,
        };
        for (text, expected, times) in [
            ("Ana’s table", "X’s table", 1),
            ("Ana and Ana", "X and X", 2),
            ("Banana", "Banana", 0),
            ("AnaAna", "AnaAna", 0),
            ("Havana, Ana", "Havana, X", 1),
            ("Anatole", "Anatole", 0),
            ("", "", 0),
        ] {
            let mut replaced = text.to_owned();
            assert_eq!(pseudonym.in_text(&mut replaced), times, "{text}");
            assert_eq!(replaced, expected);
        }
    }
}
