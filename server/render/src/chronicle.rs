//! The participants and the last events of a game, which scenes show beside its state. Built from
//! the events of a record or of a room.

use std::collections::VecDeque;

use chefshat_engine::{Event, Seat, SpecialAction, Viewer};
use chefshat_proto::v1::{self, game_event::Kind};

use super::card::Card;
use chefshat_record::convert::{cards_from_numbers, seat_from_number};
use chefshat_record::words;

/// The most log entries.
const LOG_LENGTH: usize = 9;

/// A participant.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Participant {
    /// Displayed name; empty while the seat is free.
    pub name: String,
    /// Its kind.
    pub kind: ParticipantKind,
    /// Its connection.
    pub presence: Presence,
}

/// A kind of participant.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum ParticipantKind {
    /// Unknown.
    #[default]
    Unspecified,
    /// A person.
    Person,
    /// A robot.
    Robot,
    /// A program.
    Agent,
    /// A language model.
    Model,
    /// The built-in agent of this name.
    BuiltIn(String),
}

/// Whether a participant is connected.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum Presence {
    /// Connected.
    #[default]
    Connected,
    /// Disconnected.
    Disconnected,
    /// Substituted by the built-in agent of this name.
    Substituted(String),
}

/// An event, redacted for the viewer.
#[derive(Debug, Clone, PartialEq)]
pub enum LogEntry {
    /// This Shift was dealt.
    Dealt(u32),
    /// A seat played.
    Played {
        /// The seat.
        seat: Seat,
        /// The cards.
        cards: Vec<Card>,
        /// The reason if the participant did not decide.
        cause: Option<&'static str>,
    },
    /// A seat passed.
    Passed {
        /// The seat.
        seat: Seat,
        /// The reason if the participant did not decide.
        cause: Option<&'static str>,
    },
    /// A seat finished.
    Finished {
        /// The seat.
        seat: Seat,
        /// Its place, from 1.
        place: u32,
    },
    /// A pizza ended.
    PizzaDone {
        /// Its number in the Shift, from 1.
        pizza: u32,
        /// The leader of the next one.
        next: Seat,
    },
    /// A seat declared a special action.
    Declared {
        /// The seat.
        seat: Seat,
        /// The special action.
        special: SpecialAction,
    },
    /// Cards were given.
    Gave {
        /// The giver.
        giver: Seat,
        /// The receiver.
        receiver: Seat,
        /// The number of cards.
        count: u32,
        /// The cards, if the viewer may see them.
        cards: Option<Vec<Card>>,
    },
    /// A Shift ended.
    ShiftOver {
        /// Its number, from 1.
        shift: u32,
        /// The seat that finished first.
        winner: Seat,
    },
    /// A seat showed an expression.
    Expressed {
        /// The seat.
        seat: Seat,
        /// The label.
        label: String,
        /// What it says, if it has words.
        words: Option<String>,
    },
}

/// The participants and the last events of a game.
#[derive(Debug, Clone)]
pub struct Chronicle {
    caption: String,
    viewer: Viewer,
    faces: u8,
    golden_opening: bool,
    participants: Vec<Participant>,
    log: VecDeque<LogEntry>,
    last_to_play: Option<Seat>,
    /// Whether the Shift awaits its first turn.
    opening: bool,
}

impl Chronicle {
    /// The chronicle of a game at its start, for one viewer.
    pub fn new(
        caption: &str,
        seats: &[v1::Participant],
        rules: &chefshat_engine::RuleSet,
        viewer: Viewer,
    ) -> Self {
        let mut chronicle = Self {
            caption: caption.to_owned(),
            viewer,
            faces: rules.faces(),
            golden_opening: rules.opening() == chefshat_engine::Opening::Golden,
            participants: vec![Participant::default(); rules.players()],
            log: VecDeque::new(),
            last_to_play: None,
            opening: false,
        };
        chronicle.seat_all(seats);
        chronicle
    }

    /// Name of the room or record.
    pub fn caption(&self) -> &str {
        &self.caption
    }

    /// A participant.
    pub fn participant(&self, seat: Seat) -> Participant {
        self.participants
            .get(seat.index())
            .cloned()
            .unwrap_or_default()
    }

    /// The last seat to play in this pizza.
    pub fn last_to_play(&self) -> Option<Seat> {
        self.last_to_play
    }

    /// The last events, newest last.
    pub fn log(&self) -> impl Iterator<Item = &LogEntry> {
        self.log.iter()
    }

    /// Applies an event. Events with an invalid seat are ignored.
    pub fn note(&mut self, kind: &Kind) {
        if let Some(entry) = self.apply(kind) {
            if self.log.len() == LOG_LENGTH {
                self.log.pop_front();
            }
            self.log.push_back(entry);
        }
    }

    fn apply(&mut self, kind: &Kind) -> Option<LogEntry> {
        match kind {
            Kind::Seated(seated) => {
                let participant = self.participant_mut(seated.seat)?;
                participant.name.clone_from(&seated.name);
                participant.kind = participant_kind(seated.kind(), "");
                None
            }
            Kind::GameStarted(started) => {
                self.seat_all(&started.seats);
                None
            }
            Kind::Disconnected(gone) => self.set_presence(gone.seat, Presence::Disconnected),
            Kind::Returned(back) => self.set_presence(back.seat, Presence::Connected),
            Kind::Substituted(substituted) => {
                let agent = substituted.built_in_agent.clone();
                self.set_presence(substituted.seat, Presence::Substituted(agent))
            }
            Kind::ShiftStarted(started) => {
                self.last_to_play = None;
                self.opening = true;
                Some(LogEntry::Dealt(started.shift))
            }
            Kind::SpecialActionDeclared(declared) => Some(LogEntry::Declared {
                seat: self.seat(declared.seat)?,
                special: match declared.action() {
                    v1::SpecialAction::FoodFight => SpecialAction::FoodFight,
                    v1::SpecialAction::DinnerIsServed => SpecialAction::DinnerIsServed,
                    v1::SpecialAction::Unspecified => return None,
                },
            }),
            Kind::CardsExchanged(exchanged) => self.exchange(exchanged),
            Kind::Play(play) => {
                let seat = self.seat(play.seat)?;
                self.last_to_play = Some(seat);
                let golden = std::mem::take(&mut self.opening) && self.golden_opening;
                Some(LogEntry::Played {
                    seat,
                    cards: play_cards(play, golden),
                    cause: cause(play.source()),
                })
            }
            Kind::Pass(pass) => {
                self.opening = false;
                Some(LogEntry::Passed {
                    seat: self.seat(pass.seat)?,
                    cause: cause(pass.source()),
                })
            }
            Kind::PizzaDone(done) => {
                self.last_to_play = None;
                Some(LogEntry::PizzaDone {
                    pizza: done.pizza,
                    next: self.seat(done.next_leader)?,
                })
            }
            Kind::SeatFinished(finished) => Some(LogEntry::Finished {
                seat: self.seat(finished.seat)?,
                place: finished.place,
            }),
            Kind::ShiftEnded(ended) => Some(LogEntry::ShiftOver {
                shift: ended.shift,
                winner: self.seat(*ended.order.first()?)?,
            }),
            Kind::ExpressionShown(shown) => {
                let expression = shown.expression.as_ref()?;
                Some(LogEntry::Expressed {
                    seat: self.seat(shown.seat)?,
                    label: expression.label.clone(),
                    words: words::from_data_url(&expression.media),
                })
            }
            _ => None,
        }
    }

    /// An exchange, redacted.
    fn exchange(&self, exchanged: &v1::CardsExchanged) -> Option<LogEntry> {
        let (giver, receiver) = (self.seat(exchanged.giver)?, self.seat(exchanged.receiver)?);
        let event = Event::CardsExchanged {
            giver,
            receiver,
            count: u8::try_from(exchanged.count).ok()?,
            cards: cards_from_numbers(&exchanged.cards, exchanged.golden, self.faces)
                .filter(|cards| !cards.is_empty()),
        };
        let Event::CardsExchanged { cards, .. } = event.seen_by(self.viewer) else {
            return None;
        };
        Some(LogEntry::Gave {
            giver,
            receiver,
            count: exchanged.count,
            cards: cards.map(|cards| Card::of_hand(cards, self.faces)),
        })
    }

    fn seat(&self, number: u32) -> Option<Seat> {
        seat_from_number(number, self.participants.len())
    }

    fn participant_mut(&mut self, number: u32) -> Option<&mut Participant> {
        let seat = self.seat(number)?;
        self.participants.get_mut(seat.index())
    }

    fn set_presence(&mut self, number: u32, presence: Presence) -> Option<LogEntry> {
        self.participant_mut(number)?.presence = presence;
        None
    }

    fn seat_all(&mut self, seats: &[v1::Participant]) {
        for seat in seats {
            if let Some(participant) = self.participant_mut(seat.seat) {
                participant.name.clone_from(&seat.name);
                participant.kind = participant_kind(seat.kind(), &seat.built_in_agent);
            }
        }
    }
}

/// The cards of a play, jokers last.
pub(super) fn play_cards(play: &v1::Play, golden: bool) -> Vec<Card> {
    let count = |number: u32| u8::try_from(number).unwrap_or(0);
    Card::of_play(
        count(play.face),
        count(play.quantity),
        count(play.jokers),
        golden,
    )
}

fn participant_kind(kind: v1::ParticipantKind, built_in: &str) -> ParticipantKind {
    if !built_in.is_empty() {
        return ParticipantKind::BuiltIn(built_in.to_owned());
    }
    match kind {
        v1::ParticipantKind::Unspecified => ParticipantKind::Unspecified,
        v1::ParticipantKind::Agent => ParticipantKind::Agent,
        v1::ParticipantKind::Human => ParticipantKind::Person,
        v1::ParticipantKind::Robot => ParticipantKind::Robot,
        v1::ParticipantKind::Model => ParticipantKind::Model,
    }
}

/// Why the participant did not decide, as text. A picture has no line about its substitute.
fn cause(source: v1::DecisionSource) -> Option<&'static str> {
    match source {
        v1::DecisionSource::Substitute => Some("substitute"),
        source => words::reason(source),
    }
}
