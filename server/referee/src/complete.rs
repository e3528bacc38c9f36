//! Completes the Shifts of a real table: unknown hands and gifts are filled in with cards that fit
//! all stated facts, so that the rule engine can play the Shift. Deterministic. Reports beside the
//! hands what is known of them, because it was stated or follows. The search is in `search`.

use chefshat_engine::{RuleSet, SeatOrder};

use crate::candidates::SearchBudget;
use crate::facts::{Fact, Tally};
use crate::puzzle::Puzzle;
use crate::search::Plan;

/// Search steps per Shift: gifts and pairs of gifts. Usually one of the first fits; the bound
/// keeps a made-up record from occupying the server.
const MAX_SHIFT_STEPS: usize = 200_000;
/// Search steps per game.
const MAX_GAME_STEPS: usize = 10 * MAX_SHIFT_STEPS;

/// A fact that contradicts those before it.
#[derive(Debug, Clone)]
pub(crate) struct Contradiction {
    /// The line that states it.
    pub(crate) line: usize,
    pub(crate) problem: String,
    /// Whether the search ended before everything was tried: it may be none.
    pub(crate) is_unresolved: bool,
}

/// Completes the Shifts of a game in order.
#[derive(Debug)]
pub(crate) struct Completer {
    /// Steps left for the game.
    left: usize,
    /// Steps per Shift.
    per_shift: usize,
}

impl Default for Completer {
    fn default() -> Self {
        Self {
            left: MAX_GAME_STEPS,
            per_shift: MAX_SHIFT_STEPS,
        }
    }
}

impl Completer {
    /// Completes a Shift from the longest prefix of facts that fits, and returns the first fact
    /// that does not.
    pub(crate) fn complete(
        &mut self,
        rules: &RuleSet,
        order: Option<SeatOrder>,
        facts: &[(usize, Fact)],
    ) -> (Plan, Option<Contradiction>) {
        let solve = |count: usize, budget: &mut SearchBudget| {
            Puzzle::new(rules, order, Tally::of(rules, &facts[..count])).solve(budget)
        };
        let steps = self.per_shift.min(self.left);
        let mut budget = SearchBudget::new(steps);
        let complete = solve(facts.len(), &mut budget);
        self.left -= steps - budget.left;
        let mut failure = match complete {
            Ok(plan) => return (plan, None),
            Err(problem) => problem,
        };
        let is_unresolved = budget.exhausted;
        // A prefix of facts that fit also fits, so bisect. The game ends at the contradiction, so
        // this happens once.
        let again = |count: usize| solve(count, &mut SearchBudget::new(self.per_shift));
        let (mut fits, mut breaks) = (0, facts.len());
        while breaks - fits > 1 {
            let middle = fits + (breaks - fits) / 2;
            match again(middle) {
                Ok(_) => fits = middle,
                Err(problem) => (breaks, failure) = (middle, problem),
            }
        }
        let plan = again(fits).expect("no facts fit every deal, and longer prefixes were checked");
        let contradiction = Contradiction {
            line: facts[breaks - 1].0,
            problem: failure,
            is_unresolved,
        };
        (plan, Some(contradiction))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by it")]
mod tests {
    use chefshat_engine::{Action, Face, RuleSetSpec, Seat};

    use super::*;

    #[test]
    fn an_exhausted_search_is_reported_at_its_line() {
        let spec = RuleSetSpec {
            players: 6,
            faces: 15,
            points: Vec::new(),
            ..RuleSetSpec::default()
        };
        let rules = spec.validate().unwrap();
        let seats: Vec<Seat> = (0..6).map(Seat::new).collect();
        let order = SeatOrder::from_slice(&seats);
        let opening = Action::Play {
            face: Face::new(15).unwrap(),
            quantity: 2,
            jokers: 0,
        };
        let facts = [
            (8, Fact::Given(seats[0], None)),
            (9, Fact::Turn(seats[3], opening)),
        ];
        let (_, contradiction) = Completer::default().complete(&rules, order, &facts);
        assert!(contradiction.is_none(), "{contradiction:?}");

        // Steps per Shift and per game, and the line at which they run out.
        for (per_shift, left, line) in [(5, 5, 8), (1000, 5, 9)] {
            let mut completer = Completer { left, per_shift };
            let (_, contradiction) = completer.complete(&rules, order, &facts);
            let contradiction = contradiction.unwrap();
            assert_eq!(contradiction.line, line);
            assert!(
                contradiction.problem.contains("state more hands and gifts"),
                "{contradiction:?}"
            );
        }
        // The next Shift uses what is left.
        let mut completer = Completer::default();
        completer.complete(&rules, order, &facts);
        let used = MAX_GAME_STEPS - completer.left;
        assert!((1..1000).contains(&used), "{used}");
        completer.left = used;
        assert!(completer.complete(&rules, order, &facts).1.is_none());
        assert!(completer.complete(&rules, order, &facts).1.is_some());
    }
}
