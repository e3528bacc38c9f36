//! A game in words. `view` reduces the events to a state, `story` turns each into sentences; both
//! the terminal client and this narrator draw from them. The narrator writes text in the order of
//! the events and without looking ahead, so that a game can be followed live: a heading for a
//! Shift, a growing line for a pizza. The text always has colours; the caller prints it and may
//! strip them.

pub mod awaited;
mod chain;
pub mod hand;
mod results;
pub mod story;
#[cfg(test)]
mod tests;
mod text;
pub mod view;

use chefshat_client::v1::{self, game_event::Kind};
use chefshat_engine::{Opening, RuleSet};
pub use chefshat_record::words;

use crate::kind::kind_name;
use crate::numbers::counted;
use crate::output::{stop_in_words, variations};
use awaited::AwaitedSeat;
use chain::Chain;
use story::Line;
pub use story::{abort_reason, aborted, title};
use text::{BOLD, DIM, GOLD, PLAIN, Piece, label, seat_style, wrapped};
pub use text::{MAX_NAME, clean, columns, heading, row};
use view::GameView;

/// Indentation of the lines of a Shift.
const INDENT: &str = "   ";

/// Writes a game as text.
#[derive(Debug, Default)]
pub struct Narrator {
    view: GameView,
    /// What plays each seat, in a word; from the start of the game unless set before.
    labels: Vec<String>,
    exchanges: Vec<Piece>,
    /// The last decision was copied from a recorded game.
    recorded: bool,
    chain: Chain,
}

impl Narrator {
    /// Narrates the game of a room.
    pub fn of_room(room: &v1::Room) -> Self {
        let view = GameView::of_room(room);
        Self {
            chain: Chain::new(&view),
            view,
            ..Self::default()
        }
    }

    /// Sets a label for what plays each seat, if the caller knows more than the server publishes.
    #[must_use]
    pub fn with_labels(mut self, labels: impl IntoIterator<Item = String>) -> Self {
        self.labels = labels.into_iter().collect();
        self
    }

    /// Returns the text of an event. It ends in the middle of a line while a pizza is being made.
    pub fn narrate(&mut self, event: &v1::GameEvent) -> String {
        let Some(kind) = &event.kind else {
            return String::new();
        };
        let before = self.before(kind);
        let lines = story::advance(&mut self.view, event);
        let after = match kind {
            Kind::GameStarted(start) => self.game_started(start),
            Kind::ShiftStarted(start) => self.shift_started(start),
            Kind::SpecialActionDeclared(_) => self.remarks(&lines, GOLD),
            Kind::Seated(_)
            | Kind::Vacated(_)
            | Kind::Disconnected(_)
            | Kind::Returned(_)
            | Kind::ServerRestarted(_)
            | Kind::Substituted(_)
            | Kind::ExpressionShown(_)
            | Kind::HandReported(_)
            | Kind::TablePaused(_) => self.remarks(&lines, DIM),
            Kind::Violation(_) | Kind::Correction(_) => self.remarks(&lines, BOLD),
            _ => String::new(),
        };
        before + &after
    }

    /// Returns the text about a seat that is away and awaited; empty for others.
    pub fn wait_for(&mut self, awaited: &v1::Awaited) -> String {
        let away = AwaitedSeat::new(awaited, 0).filter(AwaitedSeat::is_away);
        let words = away.and_then(|awaited| awaited.words(&self.view, 0));
        let line = words.map(|words| Line {
            seat: None,
            words,
            heading: false,
        });
        self.remarks(line.as_slice(), DIM)
    }

    /// Resumes from a snapshot in place of events that are gone.
    pub fn restore(&mut self, snapshot: &v1::Snapshot) -> String {
        let broken_off = self.break_off();
        self.exchanges.clear();
        self.view.restore(snapshot, None);
        self.chain = Chain::new(&self.view);
        broken_off.to_owned() + &self.remarks(&[story::unknown_before()], DIM)
    }

    /// Ends an open line when no more events will come.
    pub fn break_off(&mut self) -> &'static str {
        self.chain.break_off()
    }

    /// The text of an event that is laid out from the state before it.
    fn before(&mut self, kind: &Kind) -> String {
        match kind {
            Kind::Play(play) => {
                let before = self.finish_exchange() + &self.note_branch(play.source());
                before + &self.chain.play(play, &self.view)
            }
            Kind::Pass(pass) => {
                let before = self.finish_exchange() + &self.note_branch(pass.source());
                self.chain.pass(pass);
                before
            }
            Kind::SpecialActionDeclared(declared) => self.note_branch(declared.source()),
            Kind::SeatFinished(finished) => self.chain.finished(finished),
            Kind::CardsExchanged(cards) => {
                let item = self
                    .name(cards.giver)
                    .and(PLAIN, &format!(" {} ", counted(cards.count.into(), "card")))
                    .and(DIM, "→ ")
                    .join(&self.name(cards.receiver));
                self.exchanges.push(item);
                String::new()
            }
            Kind::RolesAssigned(assigned) => self.roles_assigned(assigned),
            Kind::PizzaDone(done) => self.chain.done(done, &self.view),
            Kind::ShiftStarted(_) => self.chain.close(&self.view),
            Kind::ShiftEnded(end) => self.shift_ended(end),
            // What was written of the pizza is void.
            Kind::Correction(correction) if correction.first_void > 0 => {
                self.exchanges.clear();
                self.chain.restart().to_owned()
            }
            Kind::GameEnded(end) => self.game_ended(end),
            Kind::GameAborted(end) => {
                let words = Piece::new(BOLD, &aborted(end.reason()));
                self.chain.close(&self.view) + &format!("\n{}\n", words.as_str())
            }
            _ => String::new(),
        }
    }

    fn game_started(&mut self, start: &v1::GameStarted) -> String {
        if self.labels.len() != start.seats.len() {
            let label = |seat: &v1::Participant| match seat.built_in_agent.as_str() {
                "" => kind_name(seat.kind()).to_owned(),
                agent => clean(agent, MAX_NAME * 2),
            };
            self.labels = start.seats.iter().map(label).collect();
        }
        let seats = (0u32..).zip(&self.labels).map(|(seat, label)| {
            self.name(seat)
                .and(DIM, &format!(" {}", clean(label, MAX_NAME * 2)))
        });
        let seats: Vec<Piece> = seats.collect();
        let mut out = wrapped(&label("at the table"), &seats);
        if let Some(rules) = &self.view.rules {
            out.push_str(&wrapped(&label("the rules"), &in_words(rules)));
        }
        out
    }

    fn shift_started(&mut self, start: &v1::ShiftStarted) -> String {
        self.exchanges.clear();
        self.chain = Chain::new(&self.view);
        let mut out = heading(&format!("Shift {}", start.shift));
        let rules = self.view.rules;
        if start.shift == 1 && rules.is_some_and(|rules| rules.opening() == Opening::Golden) {
            let top = self.view.faces();
            let words = format!(
                "no roles in the first Shift; the holder of the Golden {top} (★) opens with it"
            );
            out.push_str(&format!("{INDENT}{}\n", Piece::new(DIM, &words).as_str()));
        }
        out
    }

    fn roles_assigned(&mut self, assigned: &v1::RolesAssigned) -> String {
        let known = |seat: &view::SeatView| seat.role != v1::Role::Unspecified;
        let start = match self.view.seats.iter().any(known) {
            true => "now  ",
            false => "",
        };
        let mut seats: Vec<(u32, v1::Role)> = (0u32..).zip(assigned.roles()).collect();
        seats.sort_by_key(|(_, role)| *role);
        let items = seats.into_iter().map(|(seat, role)| {
            Piece::new(DIM, title(role))
                .and(PLAIN, " ")
                .join(&self.name(seat))
        });
        let items: Vec<Piece> = items.collect();
        wrapped(&Piece::new(PLAIN, INDENT).and(BOLD, start), &items)
    }

    /// Writes the exchange; it is complete when the first turn is taken.
    fn finish_exchange(&mut self) -> String {
        if self.exchanges.is_empty() {
            return String::new();
        }
        let start = Piece::new(PLAIN, INDENT).and(DIM, "exchange  ");
        wrapped(&start, &std::mem::take(&mut self.exchanges))
    }

    /// Marks the first decision that is not copied from a recorded game.
    fn note_branch(&mut self, source: v1::DecisionSource) -> String {
        let recorded = source == v1::DecisionSource::Recorded;
        if !std::mem::replace(&mut self.recorded, recorded) || recorded {
            return String::new();
        }
        let words = "end of the recorded decisions; the players decide from here";
        let line = Piece::new(PLAIN, INDENT).and(DIM, words);
        self.chain.interrupted_by(line.as_str())
    }

    /// Writes sentences of the story as lines, interrupting an open one.
    fn remarks(&mut self, lines: &[Line], style: anstyle::Style) -> String {
        let mut out = String::new();
        for line in lines {
            let start = Piece::new(PLAIN, INDENT);
            let piece = match line.seat {
                Some(seat) => start.join(&self.name(seat)).and(PLAIN, " "),
                None => start,
            };
            out.push_str(
                &self
                    .chain
                    .interrupted_by(piece.and(style, &line.words).as_str()),
            );
        }
        out
    }

    fn name(&self, seat: u32) -> Piece {
        Piece::new(seat_style(seat), &self.view.name(seat))
    }
}

/// Explains the lines of a pizza.
pub fn legend() -> String {
    let items = [
        "3×9+J: three 9s and a joker",
        "(Rosa): a pass, omitted at the end of a pizza",
        "each play: a lower face, no fewer cards",
        "on the right: cards left",
    ]
    .map(|words| Piece::new(DIM, words));
    wrapped(&label("how to read"), &items)
}

/// A rule set in words: its end, its size and its variations.
fn in_words(rules: &RuleSet) -> Vec<Piece> {
    let spec = rules.spec();
    let points: Vec<String> = rules.points_slice().iter().map(u32::to_string).collect();
    let mut words = vec![
        stop_in_words(spec.stop),
        format!(
            "{} faces and {}",
            spec.faces,
            counted(spec.jokers.into(), "joker")
        ),
        format!("{} cards each", rules.hand_size()),
        format!("{} points by place", points.join(", ")),
    ];
    words.extend(variations(rules));
    words.iter().map(|words| Piece::new(PLAIN, words)).collect()
}
