//! What happens before the first turn of a Shift, and hands that become known: hands, special
//! actions, gifts, roles.

use std::sync::Arc;

use chefshat_engine::{DecisionKind, Opening, Role, Seat, Viewer};

use super::{Judged, Referee};
use crate::counts::{Counts, NOTHING, counts_of, size_of};
use crate::judge::as_cards;
use crate::shift::Act;
use crate::words::counts_text;
use crate::{Report, Ruling, SeenCards, Verdict, ViolatedRule};

impl Referee {
    pub(super) fn see_hand(
        &mut self,
        number: u64,
        seat: Seat,
        seen: &SeenCards,
        ruling: &mut Ruling,
    ) -> Judged {
        let refuse = |rule, text: String| Err((Some(seat), (rule, text)));
        let report = Report::Hand { seat, cards: *seen };
        let over = self.shift().exchange_is_over(&self.rules, &self.remote);
        let dealt =
            !self.shift().has_turns() && (!over || self.shift().pairs(&self.rules).is_empty());
        let expected = match dealt {
            true => self.rules.hand_size(),
            false => self.game().observe(Viewer::Spectator).cards_left[seat],
        };
        let name = self.names.of(seat).to_owned();
        let count = size_of(&seen.counts);
        let unlaid = self.unlaid(seat);
        if self.hand_known(seat) && unlaid != NOTHING {
            // What the seat has played may still be among its cards.
            let mut with_unlaid = counts_of(self.game().hands()[seat], self.rules.faces());
            for (sum, count) in with_unlaid.iter_mut().zip(unlaid) {
                *sum += count;
            }
            if seen.counts == with_unlaid {
                return Ok(Verdict::Known);
            }
        }
        if count != expected {
            return refuse(
                ViolatedRule::Cards,
                format!(
                    "{name} has {expected} cards, but {count} are seen. Show all of them side by side."
                ),
            );
        }
        let cards = as_cards(&self.rules, seen, self.golden_of(seat))
            .map_err(|broken| (Some(seat), broken))?;
        if self.hand_known(seat) {
            let known = self.game().hands()[seat];
            if known == cards {
                return Ok(Verdict::Known);
            }
            return refuse(
                ViolatedRule::Cards,
                format!(
                    "{name}'s hand is known, and {} are not it. Look again, or correct the earlier report.",
                    counts_text(&seen.counts)
                ),
            );
        }
        let act = match dealt {
            true => Act::Dealt(seat, cards),
            false => Act::Held(seat, cards),
        };
        match self.try_act(number, Some(&report), act) {
            Ok(()) => {
                ruling.hand = Some((seat, cards, dealt));
                Ok(Verdict::Accepted)
            }
            Err(problem) => refuse(
                ViolatedRule::Cards,
                format!(
                    "{name} cannot hold {}: {}.",
                    counts_text(&seen.counts),
                    self.names.replace_seats(&problem.text)
                ),
            ),
        }
    }

    pub(super) fn see_special(&mut self, number: u64, seat: Option<Seat>) -> Judged {
        let refuse = |text: String| Err((seat, (ViolatedRule::SpecialAction, text)));
        let report = Report::Special { seat };
        if let Some(seat) = seat {
            let declared = Act::Special(seat, true);
            let index = self.shift().acts().position(|act| act == declared);
            if let Some(index) = index {
                return Ok(self.confirm(self.shifts.len() - 1, index));
            }
        }
        let Some(only) = self.shift().open_special(&self.rules) else {
            return match seat {
                None => Ok(Verdict::Known),
                Some(_) => refuse("A special action is declared before the exchange, from the second Shift on, by a player with two jokers.".into()),
            };
        };
        match (seat, only) {
            (Some(seat), _) if self.remote[seat] => {
                let name = self.names.of(seat);
                return refuse(format!("{name} decides about a special action itself."));
            }
            // Nobody learns who has both jokers and keeps quiet (`docs/rules.md` §3.3).
            (Some(seat), Some(only)) if seat != only => {
                let name = self.names.of(seat);
                return refuse(format!("{name} cannot declare a special action."));
            }
            (None, Some(only)) if self.remote[only] => return Ok(Verdict::Known),
            _ => {}
        }
        let act = match (seat, only) {
            (Some(seat), _) => Act::Special(seat, true),
            (None, Some(only)) => Act::Special(only, false),
            (None, None) => Act::NoSpecial,
        };
        match self.try_act(number, Some(&report), act) {
            Ok(()) => Ok(Verdict::Accepted),
            Err(problem) => refuse(self.names.replace_seats(&problem.text)),
        }
    }

    pub(super) fn see_gift(&mut self, number: u64, seat: Seat, seen: Option<&SeenCards>) -> Judged {
        let refuse = |rule, text: String| Err((Some(seat), (rule, text)));
        let report = Report::Gift {
            seat,
            cards: seen.copied(),
        };
        let name = self.names.of(seat).to_owned();
        let pairs = self.shift().pairs(&self.rules);
        let Some(pair) = pairs.iter().find(|pair| pair.has(seat)) else {
            return refuse(
                ViolatedRule::Gift,
                format!("{name} gives no cards in this Shift."),
            );
        };
        if self.shift().has_turns() {
            return refuse(ViolatedRule::Gift, "The exchange is over.".into());
        }
        if self.shift().gift(seat).is_some() {
            return Ok(Verdict::Known);
        }
        let special = self.shift().open_special(&self.rules).flatten();
        if special.is_some_and(|seat| self.remote[seat]) {
            let text = "A special action has not been decided yet: wait for it.".to_owned();
            return refuse(ViolatedRule::SpecialAction, text);
        }
        if let Some(seen) = seen.filter(|seen| size_of(&seen.counts) != pair.size) {
            return refuse(
                ViolatedRule::Gift,
                format!(
                    "{name} gives {} in this exchange, not {}.",
                    if pair.size == 1 {
                        "one card"
                    } else {
                        "two cards"
                    },
                    counts_text(&seen.counts)
                ),
            );
        }
        let decided = (self.to_lay.iter())
            .find(|it| it.seat == seat && it.receiver.is_some())
            .map(|it| it.cards);
        if self.remote[seat] && decided.is_none() && seat == pair.chooser {
            return refuse(
                ViolatedRule::Decision,
                format!("{name} has not decided yet which cards to give."),
            );
        }
        if let (Some(decided), Some(seen)) = (decided, seen)
            && counts_of(decided, self.rules.faces()) != seen.counts
        {
            let right = counts_text(&counts_of(decided, self.rules.faces()));
            return refuse(
                ViolatedRule::Decision,
                format!("{name} gives {right}, not {}.", counts_text(&seen.counts)),
            );
        }
        let cards = match (decided, seen) {
            (Some(decided), _) => Some(decided),
            (None, Some(seen)) => {
                let cards = as_cards(&self.rules, seen, self.golden_of(seat));
                Some(cards.map_err(|broken| (Some(seat), broken))?)
            }
            (None, None) => None,
        };
        match self.try_act(number, Some(&report), Act::Gift(seat, cards)) {
            Ok(()) => Ok(Verdict::Accepted),
            Err(problem) => refuse(
                ViolatedRule::Gift,
                format!(
                    "{name} cannot give these cards: {}.",
                    self.names.replace_seats(&problem.text)
                ),
            ),
        }
    }

    pub(super) fn see_role(&mut self, seat: Seat, role: Role) -> Judged {
        let refuse = |text: String| Err((Some(seat), (ViolatedRule::Role, text)));
        let name = self.names.of(seat);
        match self.game().roles()[seat] {
            Some(right) if right == role => Ok(Verdict::Accepted),
            Some(right) => refuse(format!("{name} is {}, not {}.", right.name(), role.name())),
            None => refuse("The first Shift has no roles.".into()),
        }
    }

    /// Whether a seat has the Golden card, if that follows from what is known: it lies on the table
    /// once the Shift is open, and nobody has it if somebody else does.
    fn golden_of(&self, seat: Seat) -> Option<bool> {
        let is_out = self.shift().has_turns() && self.rules.opening() == Opening::Golden;
        let hands = self.game().hands();
        let has = |other: Seat| self.hand_known(other) && hands[other].has_golden();
        let is_elsewhere = hands.seats().any(|other| other != seat && has(other));
        (is_out || is_elsewhere).then_some(false)
    }

    /// Cards that a remote seat has played and nobody has laid yet, by kind.
    fn unlaid(&self, seat: Seat) -> Counts {
        let shift = u32::try_from(self.shifts.len()).unwrap_or(u32::MAX);
        let mut unlaid = NOTHING;
        let turns = (self.to_lay.iter())
            .filter(|it| (it.seat, it.kind, it.shift) == (seat, DecisionKind::Turn, shift));
        for it in turns {
            for (sum, count) in (unlaid.iter_mut()).zip(counts_of(it.cards, self.rules.faces())) {
                *sum += count;
            }
        }
        unlaid
    }

    /// Marks a decision of a remote seat as carried out.
    pub(super) fn confirm(&mut self, shift: usize, index: usize) -> Verdict {
        let entry = &mut Arc::make_mut(&mut self.shifts[shift]).entries[index];
        if entry.confirmed || entry.report.is_some() {
            return Verdict::Known;
        }
        entry.confirmed = true;
        Verdict::Accepted
    }
}
