//! What the table waits for, what is to be laid for remote seats, and what counts.

use chefshat_engine::{
    Action, BySeat, Cards, Decision, DecisionKind, Face, Opening, RuleSet, Seat, SpecialAction,
    Viewer,
};

use super::Referee;
use crate::counts::{NOTHING, add_action, cards_of, counts_of_action};
use crate::shift::{Act, Played, Shift, gifts_of};
use crate::words::{cards_text, counts_text};
use crate::{Report, Stage, ToLay};

/// A Shift as it counts, for the record.
#[derive(Debug, Clone)]
pub struct ShiftStory {
    /// The hands as dealt, as far as they are known.
    pub hands: BySeat<Option<Cards>>,
    /// The gifts that are stated, in the order of the seats: the giver and, if known, the cards.
    /// Empty until the exchange is over.
    pub gifts: Vec<(Seat, Option<Cards>)>,
    /// Decisions in order, with the number of the report or decision. Gifts that were chosen are
    /// one decision for each card.
    pub decisions: Vec<(u64, Seat, Action)>,
}

/// A report that counts.
#[derive(Debug, Clone)]
pub struct Accepted {
    /// Its number.
    pub number: u64,
    /// The report. One about a turn has its seat.
    pub report: Report,
    /// Whether it named no seat: that it was the turn of this one is only assumed.
    pub is_assumed: bool,
}

impl Referee {
    /// What the table waits for.
    pub fn stage(&self) -> Stage {
        let (shift, rules) = (self.shift(), &self.rules);
        if self.game().is_over() {
            return match self.end_confirmed {
                true => Stage::Over,
                false => Stage::Confirmation,
            };
        }
        if self.asked.is_some() {
            return Stage::Question;
        }
        let unknown = |seat: &Seat| self.remote[*seat] && !self.hand_known(*seat);
        if shift.has_turns() {
            let seat = self.to_act().expect("a Shift in progress has a turn");
            return match unknown(&seat) {
                true => Stage::Hand(seat),
                false => Stage::Turn(seat),
            };
        }
        if let Some(seat) = self.remote.seats().find(unknown) {
            return Stage::Hand(seat);
        }
        if let Some(seat) = shift.open_special(rules) {
            return Stage::Special(seat);
        }
        if !shift.exchange_is_over(rules, &self.remote)
            && let Some(seat) = shift.next_giver(rules, &self.remote)
        {
            return Stage::Gift(seat);
        }
        match self.opener() {
            Some(seat) => Stage::Turn(seat),
            None => Stage::Opening,
        }
    }

    /// The seat whose turn it is by the game; before the first turn it may be only assumed.
    pub(super) fn to_act(&self) -> Option<Seat> {
        let open = self.game().decision()?;
        (open.kind == DecisionKind::Turn).then_some(open.seat)
    }

    /// The seat that opens the Shift, if it is known who holds the Golden card.
    pub(super) fn opener(&self) -> Option<Seat> {
        let top = Face::new(self.rules.faces())?;
        let hands = self.game().hands();
        let known = |seat: &Seat| self.hand_known(*seat);
        let holder = (hands.seats())
            .filter(known)
            .find(|seat| hands[*seat].has_golden() && hands[*seat].count(top) > 0);
        let mut others = hands.seats().filter(|seat| !known(seat));
        holder.or_else(|| match (others.next(), others.next()) {
            (Some(only), None) => Some(only),
            _ => None,
        })
    }

    /// The open decision, if a remote seat whose hand is known decides.
    pub fn decision(&self) -> Option<Decision> {
        let seat = match self.stage() {
            Stage::Turn(seat) | Stage::Gift(seat) | Stage::Special(Some(seat)) => seat,
            _ => return None,
        };
        (self.game().decision()).filter(|open| open.seat == seat && self.remote[seat])
    }

    /// For people: what the table waits for. Not who has both jokers: nobody learns that.
    pub fn waiting_for(&self) -> String {
        let name = |seat: Seat| self.names.of(seat);
        let remote = |seat: Seat| self.remote[seat];
        match self.stage() {
            Stage::Hand(seat) => format!("Show the hand of {}.", name(seat)),
            Stage::Special(_) => "Does anybody declare a special action?".into(),
            Stage::Gift(seat) if remote(seat) => {
                format!("{} chooses what to give.", name(seat))
            }
            Stage::Gift(seat) => format!("{} gives cards.", name(seat)),
            Stage::Opening => format!(
                "The player with the Golden {} opens the Shift.",
                self.rules.faces()
            ),
            Stage::Turn(seat) => format!("It is {}'s turn.", name(seat)),
            Stage::Question => {
                let asked = self.asked.as_ref().map(|asked| asked.id.as_str());
                let question = (self.questions.iter()).find(|it| Some(it.id.as_str()) == asked);
                question.map_or_else(String::new, |question| question.text.clone())
            }
            Stage::Confirmation => "The game is over. Was the last play read correctly?".into(),
            Stage::Over => "The game is over.".into(),
        }
    }

    /// The reports of this Shift that count and can be corrected, oldest first.
    pub fn accepted(&self) -> impl Iterator<Item = Accepted> {
        (self.shift().entries.iter()).filter_map(|entry| {
            Some(Accepted {
                number: entry.number,
                report: entry.named()?,
                is_assumed: entry.is_assumed(),
            })
        })
    }

    /// For people: what a report says, "Bo laid two 9s". Names no cards of hands and gifts.
    pub fn describe(&self, report: &Report) -> String {
        let name = |seat: &Option<Seat>| match seat {
            Some(seat) => self.names.of(*seat).to_owned(),
            None => "The player".to_owned(),
        };
        match report {
            Report::Laid { seat, cards } => {
                format!("{} laid {}", name(seat), counts_text(&cards.counts))
            }
            Report::Pass { seat } => format!("{} passed", name(seat)),
            Report::PassWithdrawn { seat } => {
                format!("{} took the pass back", self.names.of(*seat))
            }
            Report::Hand { seat, .. } => format!("The hand of {} was seen", self.names.of(*seat)),
            Report::Cleared => "The board was cleared".into(),
            Report::Special { seat: None } => "Nobody declares a special action".into(),
            Report::Special { seat } => format!("{} declared a special action", name(seat)),
            Report::Gift { seat, .. } => format!("{} gave cards", self.names.of(*seat)),
            Report::Role { seat, role } => format!("{} is {}", self.names.of(*seat), role.name()),
            Report::Correction { .. } => "A report was corrected".into(),
            Report::Question(question) => question.text.clone(),
            Report::Answer { .. } => "A question was answered".into(),
            Report::Pause(true) => "The game was paused".into(),
            Report::Pause(false) => "The game was resumed".into(),
            Report::EndConfirmed => "The end of the game was confirmed".into(),
        }
    }

    /// For people: what to do for a remote seat, "Lay two 9s for Ada".
    pub fn describe_to_lay(&self, it: &ToLay) -> String {
        let name = self.names.of(it.seat);
        let cards = || cards_text(&self.rules, it.cards);
        match (it.kind, it.receiver) {
            (DecisionKind::SpecialAction, _) => {
                let special = (self.shift().start.last_order)
                    .map(|order| SpecialAction::of_seat(it.seat, &order).name());
                format!("Announce {} for {name}", special.unwrap_or_default())
            }
            (DecisionKind::Exchange, Some(receiver)) => {
                format!(
                    "Give {} from {name} to {}",
                    cards(),
                    self.names.of(receiver)
                )
            }
            _ if it.cards.is_empty() => format!("Show the pass card of {name}"),
            _ => format!("Lay {} for {name}", cards()),
        }
    }

    /// Every Shift as it counts, for the record.
    pub fn story(&self) -> Vec<ShiftStory> {
        let shifts = self.shifts.iter().zip(&self.played);
        shifts
            .map(|(shift, played)| self.story_of(shift, played))
            .collect()
    }

    fn story_of(&self, shift: &Shift, played: &Played) -> ShiftStory {
        let over = shift.exchange_is_over(&self.rules, &self.remote);
        let choosers: Vec<Seat> = (shift.pairs(&self.rules).iter())
            .map(|pair| pair.chooser)
            .collect();
        let mut decisions = Vec::new();
        for entry in &shift.entries {
            let mut add = |seat, action| decisions.push((entry.number, seat, action));
            match entry.act {
                Act::Turn(seat, action) | Act::Give(seat, action) => add(seat, action),
                Act::Special(seat, true) => add(seat, Action::Declare),
                Act::Special(seat, false) => add(seat, Action::Decline),
                Act::Gift(seat, Some(cards))
                    if over && !self.remote[seat] && choosers.contains(&seat) =>
                {
                    gifts_of(cards, &self.rules).for_each(|gift| add(seat, gift));
                }
                Act::Dealt(..)
                | Act::Held(..)
                | Act::NoSpecial
                | Act::Gift(..)
                | Act::ExchangeOver => {}
            }
        }
        ShiftStory {
            hands: played.dealt,
            gifts: match over {
                true => shift.stated_gifts(&self.rules, &self.remote),
                false => Vec::new(),
            },
            decisions,
        }
    }

    /// Lists the decisions of remote seats that nobody has carried out.
    pub(super) fn update_to_lay(&mut self) {
        let turns = self
            .recent_shifts()
            .flat_map(|shift| self.turns_to_lay(shift));
        let list: Vec<ToLay> = turns.collect();
        self.to_lay = self.gifts_to_lay().into_iter().chain(list).collect();
    }

    /// The Shift in progress and, before its first turn, the one before it, whose last cards may
    /// still have to be laid.
    pub(super) fn recent_shifts(&self) -> std::ops::Range<usize> {
        let current = self.shifts.len() - 1;
        match self.shift().has_turns() {
            true => current..current + 1,
            false => current.saturating_sub(1)..current + 1,
        }
    }

    fn turns_to_lay(&self, shift: usize) -> Vec<ToLay> {
        let number = shift_number(shift);
        let now = self.game().observe(Viewer::Spectator);
        let in_progress = (shift_number(self.shifts.len() - 1), now.pizza);
        let shift = &self.shifts[shift];
        let last_turn =
            (shift.entries.iter()).rposition(|entry| matches!(entry.act, Act::Turn(..)));
        let mut list: Vec<ToLay> = Vec::new();
        for (index, entry) in shift.entries.iter().enumerate() {
            let (kind, seat, action) = match entry.act {
                Act::Turn(seat, action) => (DecisionKind::Turn, seat, action),
                Act::Special(seat, true) => (DecisionKind::SpecialAction, seat, Action::Declare),
                _ => continue,
            };
            // A pass needs no card on the table once somebody else has acted or the pizza is over.
            let shown = last_turn != Some(index) || (number, entry.pizza) != in_progress;
            let done = entry.confirmed || (action == Action::Pass && shown);
            if self.remote[seat] && !done {
                let opening = shift.turns().next() == Some((seat, action)) && list.is_empty();
                list.extend(self.rules.actions().encode(action).map(|action_id| ToLay {
                    seat,
                    kind,
                    action: action_id,
                    cards: cards_of_action(&self.rules, action, opening),
                    receiver: None,
                    shift: number,
                    pizza: match kind {
                        DecisionKind::Turn => entry.pizza,
                        _ => 0,
                    },
                }));
            }
        }
        list
    }

    /// The gifts of remote seats that nobody has carried out.
    fn gifts_to_lay(&self) -> Vec<ToLay> {
        let shift = self.shift();
        if shift.has_turns() || shift.open_special(&self.rules).is_some() {
            return Vec::new();
        }
        let pairs = shift.pairs(&self.rules);
        let both = (pairs.iter()).flat_map(|pair| {
            [
                (pair.chooser, pair.forced, true),
                (pair.forced, pair.chooser, false),
            ]
            .map(|it| (pair, it))
        });
        both.filter(|(_, (seat, ..))| self.remote[*seat] && shift.gift(*seat).is_none())
            .filter_map(|(pair, (seat, receiver, chooses))| {
                let cards = match chooses {
                    true => shift.chosen_gift(&self.rules, seat, pair.size)?,
                    false => rarest(shift.dealt(seat)?, pair.size)?,
                };
                let action = self.rules.actions().give(cards.rarest()?)?;
                Some(ToLay {
                    seat,
                    kind: DecisionKind::Exchange,
                    action,
                    cards,
                    receiver: Some(receiver),
                    shift: shift_number(self.shifts.len() - 1),
                    pizza: 0,
                })
            })
            .collect()
    }
}

/// The number of the Shift at this index.
fn shift_number(index: usize) -> u32 {
    u32::try_from(index + 1).unwrap_or(u32::MAX)
}

/// The rarest cards of a hand, which a forced giver gives (`docs/rules.md` §3.4).
fn rarest(hand: Cards, size: u8) -> Option<Cards> {
    let mut left = hand;
    let mut counts = NOTHING;
    for _ in 0..size {
        let face = left.rarest()?;
        left = left.without_face(face, 1)?;
        add_action(&mut counts, Action::Give(face));
    }
    let mut list = counts[..usize::from(chefshat_engine::MAX_FACES)].to_vec();
    list.push(0);
    let golden = hand.has_golden() && !left.has_golden();
    Cards::from_counts(chefshat_engine::MAX_FACES, &list, false).filter(|_| !golden)
}

fn cards_of_action(rules: &RuleSet, action: Action, opening: bool) -> Cards {
    let counts = counts_of_action(action);
    let golden =
        opening && rules.opening() == Opening::Golden && counts[usize::from(rules.faces()) - 1] > 0;
    cards_of(rules, &counts, golden).unwrap_or_default()
}
