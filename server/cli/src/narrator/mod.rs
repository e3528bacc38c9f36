//! A game told to a person: events in, text out, in the order of the events and without looking ahead, so that a game can be followed
//! while it is played. A Shift gets a heading, a pizza a line that grows with it. Printing is the caller's, and so is the decision
//! about colours: the text carries them always.

mod chain;
mod tables;
#[cfg(test)]
mod tests;
mod text;

use chefshat_client::v1::{self, game_event::Kind};
use chefshat_engine::{Opening, PassScope, RuleSet, RuleSetSpec, Stop};
use chefshat_record::convert::rules_from_proto;

use chain::Chain;
pub(super) use chain::{cards, reason};
pub(super) use tables::abort_reason;
use text::{BOLD, DIM, GOLD, PLAIN, Piece, label, seat_style, wrapped};
pub(super) use text::{MAX_NAME, clean, columns, heading, row};

/// Where lines that belong to a Shift begin.
const INDENT: &str = "   ";

/// Tells a game.
#[derive(Debug, Default)]
pub(super) struct Narrator {
    /// What each seat is called, index = seat.
    names: Vec<String>,
    /// What plays each seat, in a word; set before the game begins, else taken from its start.
    labels: Vec<String>,
    /// What is known of the rules once the game has begun.
    rules: Option<RuleSet>,
    hand_size: u32,
    /// Roles in this Shift, index = seat.
    roles: Vec<v1::Role>,
    scores: Vec<u64>,
    declared: bool,
    exchanges: Vec<Piece>,
    /// The last decision told was taken over from a recorded game.
    recorded: bool,
    chain: Chain,
}

impl Narrator {
    /// Nothing told yet.
    pub(super) fn new() -> Self {
        Self::default()
    }

    /// With a word for what plays each seat, where the narrator knows more than the server tells.
    #[must_use]
    pub(super) fn with_labels(mut self, labels: impl IntoIterator<Item = String>) -> Self {
        self.labels = labels.into_iter().collect();
        self
    }

    /// What an event adds to the text. Ends in the middle of a line while a pizza is being made.
    pub(super) fn tell(&mut self, event: &v1::GameEvent) -> String {
        let Some(kind) = &event.kind else {
            return String::new();
        };
        match kind {
            Kind::Play(play) => {
                let before = self.exchange_told() + &self.branch_told(play.source());
                before + &self.chain.play(play, &self.names)
            }
            Kind::Pass(pass) => {
                let before = self.exchange_told() + &self.branch_told(pass.source());
                self.chain.pass(pass);
                before
            }
            Kind::SeatFinished(finished) => self.chain.finished(finished),
            Kind::CardsExchanged(cards) => {
                self.exchange(cards);
                String::new()
            }
            Kind::PizzaDone(done) => self.chain.done(done, &self.names),
            Kind::ShiftStarted(start) => self.shift_started(start),
            Kind::RolesAssigned(assigned) => self.roles_assigned(assigned),
            Kind::SpecialActionDeclared(declared) => {
                self.branch_told(declared.source()) + &self.special(declared)
            }
            Kind::ShiftEnded(end) => self.shift_ended(end),
            Kind::GameStarted(start) => self.game_started(start),
            Kind::GameEnded(end) => self.game_ended(end),
            Kind::GameAborted(end) => {
                let reason = abort_reason(end.reason());
                let words = format!("The game was aborted and has no result: {reason}.");
                let mut out = self.chain.close(&self.names);
                out.push_str(&format!("\n{}\n", Piece::new(BOLD, &words).as_str()));
                out
            }
            Kind::Seated(seated) => {
                let label = participant_label(seated.kind(), "");
                let name = clean(&seated.name, MAX_NAME);
                self.remark(
                    seated.seat,
                    Some(&name),
                    &format!(" ({label}) takes seat {}", seated.seat),
                )
            }
            Kind::Vacated(seat) => {
                self.remark(seat.seat, Some("nobody"), " holds this seat any more")
            }
            Kind::Disconnected(seat) => self.remark(seat.seat, None, " has lost the connection"),
            Kind::Returned(seat) => self.remark(seat.seat, None, " is back"),
            Kind::ServerRestarted(_) => {
                self.note("the server was restarted; the game goes on where it stood")
            }
            Kind::Substituted(seat) => {
                let agent = clean(&seat.built_in_agent, MAX_NAME);
                let words = format!(" is played by the built-in agent {agent} from here on");
                self.remark(seat.seat, None, &words)
            }
            Kind::ExpressionShown(shown) => {
                let label = shown
                    .expression
                    .as_ref()
                    .map_or("", |expression| &expression.label);
                let words = format!(" shows {}", clean(label, 40));
                self.remark(shown.seat, None, &words)
            }
        }
    }

    /// Ends the line that is open, if one is, where nothing more will be told.
    pub(super) fn break_off(&mut self) -> &'static str {
        self.chain.break_off()
    }

    fn game_started(&mut self, start: &v1::GameStarted) -> String {
        self.rules = start
            .rules
            .as_ref()
            .and_then(|rules| rules_from_proto(rules).ok());
        self.hand_size = start.hand_size;
        self.scores = vec![0; start.seats.len()];
        self.names = names(&start.seats);
        if self.labels.len() != start.seats.len() {
            let played_by =
                |seat: &v1::Participant| participant_label(seat.kind(), &seat.built_in_agent);
            self.labels = start.seats.iter().map(played_by).collect();
        }
        let seats: Vec<Piece> = (0u32..)
            .zip(&self.labels)
            .map(|(seat, label)| {
                self.name(seat)
                    .and(DIM, &format!(" {}", clean(label, MAX_NAME * 2)))
            })
            .collect();
        let mut out = wrapped(&label("at the table"), &seats);
        if let Some(rules) = &self.rules {
            out.push_str(&wrapped(&label("the rules"), &in_words(rules)));
        }
        out
    }

    fn shift_started(&mut self, start: &v1::ShiftStarted) -> String {
        let mut out = self.chain.close(&self.names);
        self.roles.clear();
        self.declared = false;
        self.exchanges.clear();
        let golden = self
            .rules
            .is_some_and(|rules| rules.opening() == Opening::Golden);
        self.chain = Chain::new(&self.names, self.hand_size, golden);
        out.push_str(&heading(&format!("Shift {}", start.shift)));
        if start.shift == 1 && golden {
            let top = self.rules.map_or(0, |rules| rules.faces());
            let words =
                format!("nobody has a role yet; who holds the Golden {top} (★) must open with it");
            out.push_str(&format!("{INDENT}{}\n", Piece::new(DIM, &words).as_str()));
        }
        out
    }

    fn roles_assigned(&mut self, assigned: &v1::RolesAssigned) -> String {
        self.roles = assigned.roles().collect();
        let mut seats: Vec<(u32, v1::Role)> = (0u32..).zip(self.roles.iter().copied()).collect();
        seats.sort_by_key(|(_, role)| *role);
        let items: Vec<Piece> = seats
            .into_iter()
            .map(|(seat, role)| {
                Piece::new(DIM, title(role))
                    .and(PLAIN, " ")
                    .join(&self.name(seat))
            })
            .collect();
        let start = if self.declared { "now  " } else { "" };
        wrapped(&Piece::new(PLAIN, INDENT).and(BOLD, start), &items)
    }

    fn special(&mut self, declared: &v1::SpecialActionDeclared) -> String {
        self.declared = true;
        let role = usize::try_from(declared.seat)
            .ok()
            .and_then(|seat| self.roles.get(seat).copied());
        let title = role.map_or("seat", title);
        let (name, words) = match declared.action() {
            v1::SpecialAction::FoodFight => {
                ("Food Fight!", "two jokers: all roles are turned around")
            }
            v1::SpecialAction::DinnerIsServed => {
                ("Dinner is served!", "two jokers: nobody exchanges cards")
            }
            v1::SpecialAction::Unspecified => ("A special action!", ""),
        };
        let line = Piece::new(PLAIN, INDENT)
            .and(GOLD, &format!("✦ {name} "))
            .and(PLAIN, &format!("{title} "))
            .join(&self.name(declared.seat))
            .and(PLAIN, &format!(" has {words}"));
        format!("{}\n", line.as_str())
    }

    fn exchange(&mut self, cards: &v1::CardsExchanged) {
        let item = self
            .name(cards.giver)
            .and(PLAIN, &format!(" {} ", cards.count))
            .and(DIM, "→ ")
            .join(&self.name(cards.receiver));
        self.exchanges.push(item);
    }

    /// The exchange, which is told as a whole when the first turn says that it is complete.
    fn exchange_told(&mut self) -> String {
        if self.exchanges.is_empty() {
            return String::new();
        }
        let start = Piece::new(PLAIN, INDENT).and(DIM, "exchange  ");
        wrapped(&start, &std::mem::take(&mut self.exchanges))
    }

    /// The point up to which decisions were taken over from a recorded game, once one has been taken otherwise.
    fn branch_told(&mut self, source: v1::DecisionSource) -> String {
        let recorded = source == v1::DecisionSource::Recorded;
        if std::mem::replace(&mut self.recorded, recorded) && !recorded {
            return self.note("so far as in a recorded game; from here on by those at the table");
        }
        String::new()
    }

    /// A line about the whole game, in the middle of whatever is being told.
    fn note(&mut self, words: &str) -> String {
        let line = Piece::new(PLAIN, INDENT).and(DIM, words);
        self.chain.interrupted_by(line.as_str())
    }

    /// A line about a seat, in the middle of whatever is being told.
    fn remark(&mut self, seat: u32, name: Option<&str>, words: &str) -> String {
        let name = match name {
            Some(name) => Piece::new(seat_style(seat), name),
            None => self.name(seat),
        };
        let line = Piece::new(PLAIN, INDENT).join(&name).and(DIM, words);
        self.chain.interrupted_by(line.as_str())
    }

    fn name(&self, seat: u32) -> Piece {
        Piece::new(seat_style(seat), &name_of(&self.names, seat))
    }
}

/// How the lines of a pizza are to be read.
pub(super) fn legend() -> String {
    let items = [
        "3×9+J: three 9s and a joker",
        "(Rosa): a pass, not shown where it closes",
        "a face must fall, a size may only grow",
        "at the right: cards left",
    ]
    .map(|words| Piece::new(DIM, words));
    wrapped(&label("how to read"), &items)
}

/// What a seat is called.
fn name_of(names: &[String], seat: u32) -> String {
    usize::try_from(seat)
        .ok()
        .and_then(|seat| names.get(seat).cloned())
        .unwrap_or_else(|| format!("seat {seat}"))
}

/// Names as they are shown: short, safe, and no two alike.
pub(super) fn names(seats: &[v1::Participant]) -> Vec<String> {
    let short: Vec<String> = seats
        .iter()
        .map(|seat| clean(&seat.name, MAX_NAME))
        .collect();
    (0..short.len())
        .map(|seat| {
            let name = &short[seat];
            let alike = short.iter().filter(|other| *other == name).count();
            if name.is_empty() {
                format!("seat {seat}")
            } else if alike > 1 {
                format!("{}#{seat}", clean(name, MAX_NAME - 2))
            } else {
                name.clone()
            }
        })
        .collect()
}

/// What plays a seat, in a word.
fn participant_label(kind: v1::ParticipantKind, built_in_agent: &str) -> String {
    match kind {
        _ if !built_in_agent.is_empty() => clean(built_in_agent, MAX_NAME * 2),
        v1::ParticipantKind::Human => "human".into(),
        v1::ParticipantKind::Robot => "robot".into(),
        v1::ParticipantKind::Agent | v1::ParticipantKind::Unspecified => "agent".into(),
    }
}

/// The cook's title of a role.
pub(super) fn title(role: v1::Role) -> &'static str {
    match role {
        v1::Role::Unspecified => "no role",
        v1::Role::Chef => "Chef",
        v1::Role::SousChef => "Sous-Chef",
        v1::Role::Cook => "Cook",
        v1::Role::Waiter => "Waiter",
        v1::Role::Dishwasher => "Dishwasher",
    }
}

/// A rule set: its size, when it ends, and in what it differs from the standard.
fn in_words(rules: &RuleSet) -> Vec<Piece> {
    let spec = rules.spec();
    let mut words = vec![
        match spec.stop {
            Stop::Points(points) => format!("to {points} points"),
            Stop::Shifts(1) => "1 Shift".to_owned(),
            Stop::Shifts(shifts) => format!("{shifts} Shifts"),
        },
        format!("{} faces and {} jokers", spec.faces, spec.jokers),
        format!("{} cards each", rules.hand_size()),
    ];
    let points: Vec<String> = rules.points_slice().iter().map(u32::to_string).collect();
    words.push(format!("{} points by place", points.join(", ")));
    let standard = RuleSetSpec::default();
    if !spec.exchange {
        words.push("no exchange".into());
    }
    if !spec.special_actions {
        words.push("no special actions".into());
    }
    if spec.opening == Opening::AnyTopFace {
        words.push(format!("any {} opens", spec.faces));
    }
    if spec.opening_pass {
        words.push("the opener may pass".into());
    }
    if spec.pass_scope == PassScope::Turn {
        words.push("a pass binds for one turn".into());
    }
    if spec.max_idle_pizzas != standard.max_idle_pizzas {
        words.push(format!("at most {} idle pizzas", spec.max_idle_pizzas));
    }
    if spec.max_turns != standard.max_turns {
        words.push(format!("at most {} turns a Shift", spec.max_turns));
    }
    words.iter().map(|words| Piece::new(PLAIN, words)).collect()
}
