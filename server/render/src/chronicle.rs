//! What a scene shows beyond the game itself: who sits at the table and what happened last. Fed with the events of a record, or of a
//! room being watched.

use std::collections::VecDeque;

use chefshat_engine::{Event, Seat, SpecialAction, Viewer};
use chefshat_proto::v1::{self, game_event::Kind};

use super::scene::{self, Card};
use chefshat_record::convert::{cards_from_numbers, seat_from_number};

/// Most happenings that are kept.
const LOG_LENGTH: usize = 9;

/// Who sits on a seat.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Participant {
    /// The name; empty while the seat is free.
    pub name: String,
    /// What it is.
    pub sort: Sort,
    /// What has become of its connection.
    pub presence: Presence,
}

/// What a participant is.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum Sort {
    /// Not said.
    #[default]
    Unsaid,
    /// A person.
    Person,
    /// A robot.
    Robot,
    /// A program.
    Agent,
    /// The server's own agent of this name.
    BuiltIn(String),
}

/// Whether a participant decides for itself.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum Presence {
    /// It does.
    #[default]
    Here,
    /// Its connection is lost.
    Away,
    /// The built-in agent of this name plays for it.
    Substituted(String),
}

/// One thing that happened, as the viewer may see it.
#[derive(Debug, Clone, PartialEq)]
pub enum Happening {
    /// Cards were dealt for this Shift.
    Dealt(u32),
    /// A seat played.
    Played {
        /// The seat.
        seat: Seat,
        /// The cards.
        cards: Vec<Card>,
        /// Why it was not the seat's own agent that decided, if so.
        cause: Option<&'static str>,
    },
    /// A seat passed.
    Passed {
        /// The seat.
        seat: Seat,
        /// Why it was not the seat's own agent that decided, if so.
        cause: Option<&'static str>,
    },
    /// A seat got rid of its last card.
    Finished {
        /// The seat.
        seat: Seat,
        /// Its place, from 1.
        place: u32,
    },
    /// A pizza was done.
    PizzaDone {
        /// Its number in the Shift, from 1.
        pizza: u32,
        /// Who leads the next one.
        next: Seat,
    },
    /// A seat declared a special action.
    Declared {
        /// The seat.
        seat: Seat,
        /// Which.
        special: SpecialAction,
    },
    /// Cards were given.
    Gave {
        /// By whom.
        giver: Seat,
        /// To whom.
        receiver: Seat,
        /// How many.
        count: u32,
        /// Which, where the viewer may know.
        cards: Option<Vec<Card>>,
    },
    /// A Shift ended.
    ShiftOver {
        /// Its number, from 1.
        shift: u32,
        /// Who finished first.
        winner: Seat,
    },
    /// A seat showed an expression of this label.
    Expressed {
        /// The seat.
        seat: Seat,
        /// The label.
        label: String,
    },
}

/// Who sits at the table and what happened last.
#[derive(Debug, Clone)]
pub struct Chronicle {
    caption: String,
    viewer: Viewer,
    faces: u8,
    golden_opening: bool,
    participants: Vec<Participant>,
    log: VecDeque<Happening>,
    last_to_play: Option<Seat>,
    /// No turn has been taken in this Shift.
    opening: bool,
}

impl Chronicle {
    /// Of a game that begins: its name, its seats, its rules, and who looks at it.
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

    /// Name of the game.
    pub fn caption(&self) -> &str {
        &self.caption
    }

    /// Who sits on a seat.
    pub fn participant(&self, seat: Seat) -> Participant {
        self.participants
            .get(seat.index())
            .cloned()
            .unwrap_or_default()
    }

    /// Who played last in this pizza.
    pub fn last_to_play(&self) -> Option<Seat> {
        self.last_to_play
    }

    /// What happened last, the newest at the end.
    pub fn log(&self) -> impl Iterator<Item = &Happening> {
        self.log.iter()
    }

    /// Takes note of an event. One that names no seat of the game is passed over.
    pub fn note(&mut self, kind: &Kind) {
        let happening = self.happening(kind);
        if let Some(happening) = happening {
            if self.log.len() == LOG_LENGTH {
                self.log.pop_front();
            }
            self.log.push_back(happening);
        }
    }

    fn happening(&mut self, kind: &Kind) -> Option<Happening> {
        match kind {
            Kind::Seated(seated) => {
                let participant = self.participant_mut(seated.seat)?;
                participant.name.clone_from(&seated.name);
                participant.sort = sort(seated.kind(), "");
                None
            }
            Kind::GameStarted(started) => {
                self.seat_all(&started.seats);
                None
            }
            Kind::Disconnected(gone) => self.set_presence(gone.seat, Presence::Away),
            Kind::Returned(back) => self.set_presence(back.seat, Presence::Here),
            Kind::Substituted(substituted) => {
                let agent = substituted.built_in_agent.clone();
                self.set_presence(substituted.seat, Presence::Substituted(agent))
            }
            Kind::ShiftStarted(started) => {
                self.last_to_play = None;
                self.opening = true;
                Some(Happening::Dealt(started.shift))
            }
            Kind::SpecialActionDeclared(declared) => Some(Happening::Declared {
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
                Some(Happening::Played {
                    seat,
                    cards: play_cards(play, golden),
                    cause: cause(play.source()),
                })
            }
            Kind::Pass(pass) => {
                self.opening = false;
                Some(Happening::Passed {
                    seat: self.seat(pass.seat)?,
                    cause: cause(pass.source()),
                })
            }
            Kind::PizzaDone(done) => {
                self.last_to_play = None;
                Some(Happening::PizzaDone {
                    pizza: done.pizza,
                    next: self.seat(done.next_leader)?,
                })
            }
            Kind::SeatFinished(finished) => Some(Happening::Finished {
                seat: self.seat(finished.seat)?,
                place: finished.place,
            }),
            Kind::ShiftEnded(ended) => Some(Happening::ShiftOver {
                shift: ended.shift,
                winner: self.seat(*ended.order.first()?)?,
            }),
            Kind::ExpressionShown(shown) => Some(Happening::Expressed {
                seat: self.seat(shown.seat)?,
                label: shown.expression.as_ref()?.label.clone(),
            }),
            _ => None,
        }
    }

    /// What the viewer may see of an exchange, by the one rule there is for it.
    fn exchange(&self, exchanged: &v1::CardsExchanged) -> Option<Happening> {
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
        Some(Happening::Gave {
            giver,
            receiver,
            count: exchanged.count,
            cards: cards.map(|cards| scene::cards(cards, self.faces)),
        })
    }

    fn seat(&self, number: u32) -> Option<Seat> {
        seat_from_number(number, self.participants.len())
    }

    fn participant_mut(&mut self, number: u32) -> Option<&mut Participant> {
        let seat = self.seat(number)?;
        self.participants.get_mut(seat.index())
    }

    fn set_presence(&mut self, number: u32, presence: Presence) -> Option<Happening> {
        self.participant_mut(number)?.presence = presence;
        None
    }

    fn seat_all(&mut self, seats: &[v1::Participant]) {
        for seat in seats {
            if let Some(participant) = self.participant_mut(seat.seat) {
                participant.name.clone_from(&seat.name);
                participant.sort = sort(seat.kind(), &seat.built_in_agent);
            }
        }
    }
}

/// The cards of a play, in the order in which they are laid down.
pub(super) fn play_cards(play: &v1::Play, golden: bool) -> Vec<Card> {
    let count = |number: u32| u8::try_from(number).unwrap_or(0);
    scene::played(
        count(play.face),
        count(play.quantity),
        count(play.jokers),
        golden,
    )
}

fn sort(kind: v1::ParticipantKind, built_in: &str) -> Sort {
    if !built_in.is_empty() {
        return Sort::BuiltIn(built_in.to_owned());
    }
    match kind {
        v1::ParticipantKind::Unspecified => Sort::Unsaid,
        v1::ParticipantKind::Agent => Sort::Agent,
        v1::ParticipantKind::Human => Sort::Person,
        v1::ParticipantKind::Robot => Sort::Robot,
    }
}

/// Why a decision was not the seat's own, in words.
fn cause(source: v1::DecisionSource) -> Option<&'static str> {
    match source {
        v1::DecisionSource::Timeout => Some("out of time"),
        v1::DecisionSource::Invalid => Some("invalid answers"),
        v1::DecisionSource::Disconnected => Some("not connected"),
        v1::DecisionSource::Substitute => Some("substitute"),
        v1::DecisionSource::Unspecified
        | v1::DecisionSource::Agent
        | v1::DecisionSource::Recorded => None,
    }
}
