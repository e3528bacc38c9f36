//! A Shift of a physical table: what was reported and decided, in order, and the game that follows
//! from it. Nothing here judges; [`crate::Referee`] does.

use chefshat_engine::{
    Action, BySeat, Cards, Decision, DecisionKind, Event, ExchangePair, Face, Game, Observation,
    Opening, RuleSet, Seat,
};

use crate::counts::{JOKER, NOTHING, add_action, cards_of, counts_of};
use crate::gifts::pairs;
use crate::{Fact, PhysicalGame, Report, ShiftFacts, StartState};

/// Something that counts.
#[derive(Debug, Clone)]
pub(crate) struct Entry {
    /// Number of the report or decision.
    pub(crate) number: u64,
    /// The report, if it can be corrected. One without a seat is about the seat whose turn it was,
    /// which is only assumed.
    pub(crate) report: Option<Report>,
    pub(crate) act: Act,
    /// Number of the pizza, if it is a turn.
    pub(crate) pizza: u32,
    /// Whether the cards of a remote seat's decision were seen on the table.
    pub(crate) confirmed: bool,
}

impl Entry {
    /// The report, with the seat it is about also where it names none.
    pub(crate) fn named(&self) -> Option<Report> {
        let report = self.report.as_ref()?;
        Some(match self.act {
            Act::Turn(seat, _) => report.with_seat(seat),
            _ => report.clone(),
        })
    }

    /// Whether it is only assumed which seat the report is about.
    pub(crate) fn is_assumed(&self) -> bool {
        let report = self.report.as_ref();
        matches!(self.act, Act::Turn(..)) && report.is_some_and(|it| it.seat().is_none())
    }
}

/// What happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Act {
    /// A hand as dealt.
    Dealt(Seat, Cards),
    /// A hand after the exchange, as it was at this point.
    Held(Seat, Cards),
    /// A seat was dealt two jokers, and declared or declined.
    Special(Seat, bool),
    /// Nobody declares a special action.
    NoSpecial,
    /// A seat at the table gave its cards.
    Gift(Seat, Option<Cards>),
    /// A remote seat chose a card to give.
    Give(Seat, Action),
    /// The exchange is over, because somebody plays.
    ExchangeOver,
    /// A seat played or passed.
    Turn(Seat, Action),
}

/// A Shift: its start and what counts, in order.
#[derive(Debug, Clone)]
pub(crate) struct Shift {
    pub(crate) start: StartState,
    pub(crate) entries: Vec<Entry>,
}

impl Shift {
    pub(crate) fn new(start: StartState) -> Self {
        Self {
            start,
            entries: Vec::new(),
        }
    }

    pub(crate) fn acts(&self) -> impl DoubleEndedIterator<Item = Act> + '_ {
        self.entries.iter().map(|entry| entry.act)
    }

    pub(crate) fn turns(&self) -> impl DoubleEndedIterator<Item = (Seat, Action)> + '_ {
        self.acts().filter_map(|act| match act {
            Act::Turn(seat, action) => Some((seat, action)),
            _ => None,
        })
    }

    pub(crate) fn has_turns(&self) -> bool {
        self.turns().next().is_some()
    }

    /// Whether a hand was stated as dealt.
    pub(crate) fn dealt(&self, seat: Seat) -> Option<Cards> {
        self.acts().find_map(|act| match act {
            Act::Dealt(of, cards) if of == seat => Some(cards),
            _ => None,
        })
    }

    /// The gift of a seat at the table, if it gave.
    pub(crate) fn gift(&self, seat: Seat) -> Option<Option<Cards>> {
        self.acts().find_map(|act| match act {
            Act::Gift(of, cards) if of == seat => Some(cards),
            _ => None,
        })
    }

    /// The cards that a remote seat chose to give, in order.
    pub(crate) fn gives(&self, seat: Seat) -> impl Iterator<Item = Action> + '_ {
        self.acts().filter_map(move |act| match act {
            Act::Give(of, action) if of == seat => Some(action),
            _ => None,
        })
    }

    /// Whether it is settled that no further special action is declared.
    pub(crate) fn special_is_settled(&self) -> bool {
        self.acts().any(|act| match act {
            Act::Special(..)
            | Act::NoSpecial
            | Act::Gift(..)
            | Act::Give(..)
            | Act::ExchangeOver
            | Act::Held(..)
            | Act::Turn(..) => true,
            Act::Dealt(..) => false,
        })
    }

    /// The pairs that exchange cards; none in the first Shift.
    pub(crate) fn pairs(&self, rules: &RuleSet) -> Vec<ExchangePair> {
        let declared = self.acts().find_map(|act| match act {
            Act::Special(seat, true) => Some(seat),
            _ => None,
        });
        pairs(rules, self.start.last_order, declared)
    }

    /// Whether a seat that chooses its gift has given it.
    fn has_given(&self, pair: &ExchangePair, remote: &BySeat<bool>) -> bool {
        if remote[pair.chooser] {
            self.gives(pair.chooser).count() >= usize::from(pair.size)
        } else {
            self.gift(pair.chooser).is_some()
        }
    }

    /// Whether the exchange is over.
    pub(crate) fn exchange_is_over(&self, rules: &RuleSet, remote: &BySeat<bool>) -> bool {
        let over = |act| matches!(act, Act::ExchangeOver | Act::Held(..) | Act::Turn(..));
        self.acts().any(over) || self.next_giver(rules, remote).is_none()
    }

    /// The seat whose gift is awaited next.
    pub(crate) fn next_giver(&self, rules: &RuleSet, remote: &BySeat<bool>) -> Option<Seat> {
        (self.pairs(rules).iter())
            .find(|pair| !self.has_given(pair, remote))
            .map(|pair| pair.chooser)
    }

    /// The facts of the Shift, with the decisions before its first turn.
    fn facts(&self, rules: &RuleSet, remote: &BySeat<bool>) -> (ShiftFacts, Vec<(Seat, Action)>) {
        let pairs = self.pairs(rules);
        let over = self.exchange_is_over(rules, remote);
        let choosing = (!over)
            .then(|| self.next_giver(rules, remote))
            .flatten()
            .filter(|seat| remote[*seat] && self.open_special(rules).is_none());
        let mut facts = Vec::new();
        let mut decisions = Vec::new();
        let mut played: BySeat<[u8; JOKER + 1]> = BySeat::filled(rules.players(), NOTHING);
        for entry in &self.entries {
            let fact = match entry.act {
                Act::Dealt(seat, cards) => Some(Fact::Hand(seat, cards)),
                Act::Held(seat, cards) => {
                    let held = self.as_held(rules, seat, cards, &played[seat]);
                    held.map(|cards| match pairs.as_slice() {
                        [] => Fact::Hand(seat, cards),
                        _ => Fact::Held(seat, cards),
                    })
                }
                Act::Special(seat, declared) => {
                    let action = if declared {
                        Action::Declare
                    } else {
                        Action::Decline
                    };
                    decisions.push((seat, action));
                    Some(Fact::Special { seat, declared })
                }
                Act::Give(seat, action) => {
                    decisions.push((seat, action));
                    Some(Fact::Gives(seat, action))
                }
                Act::Turn(seat, action) => {
                    add_action(&mut played[seat], action);
                    Some(Fact::Turn(seat, action))
                }
                Act::NoSpecial | Act::Gift(..) | Act::ExchangeOver => None,
            };
            let number = usize::try_from(entry.number).unwrap_or(usize::MAX);
            facts.extend(fact.map(|fact| (number, fact)));
        }
        for pair in &pairs {
            for seat in [pair.chooser, pair.forced] {
                let chosen = remote[seat] && seat == pair.chooser;
                let gift = match self.gift(seat) {
                    _ if chosen => self.chosen_gift(rules, seat, pair.size),
                    Some(cards) => cards,
                    None => None,
                };
                let given = self.gift(seat).is_some() || gift.is_some();
                if over || (choosing.is_some() && choosing != Some(seat) && given) {
                    facts.push((0, Fact::Given(seat, gift)));
                    if let Some(cards) = gift.filter(|_| !chosen && seat == pair.chooser) {
                        decisions.extend(gifts_of(cards, rules).map(|gift| (seat, gift)));
                    }
                }
            }
        }
        let facts = ShiftFacts {
            facts,
            choosing,
            special_is_settled: self.open_special(rules).is_none(),
        };
        (facts, decisions)
    }

    /// Whether a special action may still be declared, and by whom, if only one seat can.
    pub(crate) fn open_special(&self, rules: &RuleSet) -> Option<Option<Seat>> {
        if !rules.special_actions()
            || rules.jokers() < 2
            || self.start.last_order.is_none()
            || self.special_is_settled()
        {
            return None;
        }
        let hands = BySeat::from_fn(rules.players(), |seat| self.dealt(seat));
        let with = |jokers: u8| {
            (hands.iter()).find(|(_, hand)| hand.is_some_and(|hand| hand.jokers() == jokers))
        };
        match (with(2), with(1)) {
            (Some((seat, _)), _) => Some(Some(seat)),
            (None, Some(_)) => None,
            (None, None) => hands.values().any(Option::is_none).then_some(None),
        }
    }

    /// The gift a remote seat chose, once it is complete and its hand known.
    pub(crate) fn chosen_gift(&self, rules: &RuleSet, seat: Seat, size: u8) -> Option<Cards> {
        let hand = self.dealt(seat)?;
        let mut counts = NOTHING;
        for gift in self.gives(seat) {
            add_action(&mut counts, gift);
        }
        if counts.iter().sum::<u8>() < size {
            return None;
        }
        let top = Face::new(rules.faces())?;
        let of_top = counts[usize::from(rules.faces()) - 1];
        let golden = hand.has_golden() && of_top > 0 && of_top == hand.count(top);
        cards_of(rules, &counts, golden)
    }

    /// The gifts that are stated: the giver and, if known, the cards.
    pub(crate) fn stated_gifts(
        &self,
        rules: &RuleSet,
        remote: &BySeat<bool>,
    ) -> Vec<(Seat, Option<Cards>)> {
        let pairs = self.pairs(rules);
        let mut gifts: Vec<(Seat, Option<Cards>)> = (pairs.iter())
            .flat_map(|pair| {
                [
                    (pair.chooser, pair.size, remote[pair.chooser]),
                    (pair.forced, 0, false),
                ]
            })
            .filter_map(|(seat, size, chosen)| match self.gift(seat) {
                _ if chosen => Some((seat, Some(self.chosen_gift(rules, seat, size)?))),
                gift => Some((seat, gift?)),
            })
            .collect();
        gifts.sort_by_key(|(seat, _)| seat.index());
        gifts
    }

    /// The hand after the exchange, from the hand as seen later and what the seat played before.
    fn as_held(
        &self,
        rules: &RuleSet,
        seat: Seat,
        seen: Cards,
        played: &[u8; JOKER + 1],
    ) -> Option<Cards> {
        let mut counts = counts_of(seen, rules.faces());
        crate::counts::add(&mut counts, played);
        let opened = self
            .turns()
            .next()
            .is_some_and(|(opener, _)| opener == seat)
            && rules.opening() == Opening::Golden;
        let played_any = played.iter().any(|count| *count > 0);
        cards_of(rules, &counts, seen.has_golden() || (opened && played_any))
    }
}

/// The single gifts of a gift.
pub(crate) fn gifts_of(cards: Cards, rules: &RuleSet) -> impl Iterator<Item = Action> + use<> {
    let counts = counts_of(cards, rules.faces());
    let jokers = usize::from(cards.jokers());
    (1..=rules.faces())
        .filter_map(Face::new)
        .flat_map(move |face| {
            let count = usize::from(counts[usize::from(face.get()) - 1]);
            std::iter::repeat_n(Action::Give(face), count)
        })
        .chain(std::iter::repeat_n(Action::GiveJoker, jokers))
}

/// The game of a Shift, with unknown hands completed.
#[derive(Debug, Clone)]
pub(crate) struct Played {
    pub(crate) game: Game,
    /// The events of the Shift, without cards that are not stated.
    pub(crate) events: Vec<Event>,
    /// The start of the next Shift, if this one is over and another follows.
    pub(crate) next: Option<StartState>,
    /// The hands as dealt that are known.
    pub(crate) dealt: BySeat<Option<Cards>>,
    pub(crate) hands_known: BySeat<bool>,
    pub(crate) golden_known: BySeat<bool>,
    pub(crate) gifts_known: BySeat<bool>,
}

/// Why no game contains what counts.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Misfit {
    pub(crate) text: String,
    /// Whether the search for a game ended before all hands were tried: there may be one.
    pub(crate) is_unresolved: bool,
}

impl<T: Into<String>> From<T> for Misfit {
    fn from(text: T) -> Self {
        Self {
            text: text.into(),
            is_unresolved: false,
        }
    }
}

/// Plays a Shift from what counts.
///
/// # Errors
/// Why no game contains all of it.
pub(crate) fn play(
    rules: &RuleSet,
    remote: &BySeat<bool>,
    shift: &Shift,
) -> Result<Played, Misfit> {
    let (facts, mut decisions) = shift.facts(rules, remote);
    let mut physical = PhysicalGame::new(*rules, vec![facts]);
    let mut events = Vec::new();
    let game = physical.start(&shift.start, &mut events);
    if let Some(problem) = physical.problem() {
        return Err(Misfit {
            text: problem.to_owned(),
            is_unresolved: physical.is_unresolved(),
        });
    }
    let mut game =
        (game.map_err(|error| error.to_string())?).expect("the Shift has facts, if only none");
    let dealt = BySeat::from_fn(rules.players(), |seat| physical.dealt(seat));
    let mut apply = |game: &mut Game, physical: &mut PhysicalGame, open: Decision, action| {
        let id = (rules.actions().encode(action)).ok_or("no deck has these cards")?;
        let mut new = Vec::new();
        game.apply(id, |event| new.push(event))
            .map_err(|error| error.to_string())?;
        physical.count_decision(open.seat, open.kind);
        let known = (
            physical.hands_known(game),
            physical.golden_known(game),
            physical.gifts_known(),
        );
        physical
            .advance(game, &mut new)
            .map_err(|error| error.to_string())?;
        events.extend(new);
        Ok::<_, String>(known)
    };
    while let Some(open) = game
        .decision()
        .filter(|open| open.kind != DecisionKind::Turn)
    {
        let is_next =
            |(seat, action): &(Seat, Action)| *seat == open.seat && kind_of(*action) == open.kind;
        let Some(index) = decisions.iter().position(is_next) else {
            break;
        };
        let (_, action) = decisions.remove(index);
        apply(&mut game, &mut physical, open, action)?;
    }
    let mut known = None;
    for (seat, action) in shift.turns() {
        let open = game
            .decision()
            .filter(|_| physical.is_open())
            .ok_or("the Shift is over")?;
        if open.seat != seat || open.kind != DecisionKind::Turn {
            return Err(format!("it is seat {}'s turn", open.seat).into());
        }
        known = Some(apply(&mut game, &mut physical, open, action)?);
    }
    let ended = events.iter().find_map(|event| match event {
        Event::ShiftEnded(end) => Some(StartState {
            shift: end.shift + 1,
            last_order: Some(end.order),
            scores: end
                .scores
                .map(|score| u32::try_from(score).unwrap_or(u32::MAX)),
        }),
        _ => None,
    });
    let (hands_known, golden_known, gifts_known) = match (&ended, known) {
        (Some(_), Some(known)) => known,
        _ => (
            physical.hands_known(&game),
            physical.golden_known(&game),
            physical.gifts_known(),
        ),
    };
    Ok(Played {
        events: events
            .into_iter()
            .map(|event| physical.redact(event))
            .collect(),
        next: ended.filter(|_| !game.is_over()),
        game,
        dealt,
        hands_known,
        golden_known,
        gifts_known,
    })
}

fn kind_of(action: Action) -> DecisionKind {
    match action {
        Action::Give(_) | Action::GiveJoker => DecisionKind::Exchange,
        Action::Decline | Action::Declare => DecisionKind::SpecialAction,
        Action::Play { .. } | Action::LoneJoker | Action::Pass => DecisionKind::Turn,
    }
}

impl Played {
    /// Removes cards that are only assumed from the observation of a seat.
    pub(crate) fn hide_assumed(
        &self,
        observation: &mut Observation,
        seat: Seat,
        partner: Option<Seat>,
    ) {
        if !self.hands_known[seat] || !self.golden_known[seat] {
            observation.hand = Cards::EMPTY;
        }
        if !self.gifts_known[seat] {
            observation.gave = Cards::EMPTY;
        }
        if partner.is_some_and(|partner| !self.gifts_known[partner]) {
            observation.received = Cards::EMPTY;
        }
    }
}
