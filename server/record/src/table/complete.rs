//! Completing the Shifts of a real table: hands and gifts that nobody wrote down are filled in with cards that fit everything that is told, so
//! that the rule engine can play the Shift and judge it. The same facts are always completed in the same way. What of the hands is not
//! filled in but known, because it is told or follows from what is told, is said beside them. How such cards are found is in `puzzle`.

use chefshat_engine::{BySeat, Cards, RuleSet, Seat, SeatOrder};

use super::facts::{Counts, Fact, Tally};
use super::known::Known;
use super::offers::Tries;
use super::puzzle::Puzzle;

/// How much is looked at to complete a Shift: choices of gifts, and pairs of them. Mostly one of the first fits, or it is soon seen that none
/// can; a record that somebody made up must not keep the server busy.
const MAX_TRIES: usize = 200_000;
/// The same of all Shifts of a game together.
const MAX_TRIES_OF_GAME: usize = 10 * MAX_TRIES;

/// A Shift that can be played by the engine.
#[derive(Debug, Clone)]
pub(crate) struct Plan {
    /// The hands as dealt.
    pub(super) dealt: BySeat<Cards>,
    /// What each seat gives.
    pub(super) gifts: BySeat<Counts>,
    /// Who chooses what it gives.
    pub(super) choosers: BySeat<bool>,
    /// The seat drawn at the deal, for the opening that needs one.
    pub(super) drawn: Option<Seat>,
    /// What is known of the hands as dealt.
    pub(super) dealt_known: Known,
    /// What is known of the hands after the exchange.
    pub(super) held_known: Known,
}

/// A fact that cannot be, after those before it.
#[derive(Debug, Clone)]
pub(crate) struct Misfit {
    /// The line that tells it.
    pub(crate) line: usize,
    /// Why not.
    pub(crate) problem: String,
}

/// Completes the Shifts of a game, one after the other.
#[derive(Debug)]
pub(super) struct Completer {
    /// What may be looked at for the Shifts that fit.
    left: usize,
    /// What may be looked at for one Shift.
    most: usize,
}

impl Default for Completer {
    fn default() -> Self {
        Self {
            left: MAX_TRIES_OF_GAME,
            most: MAX_TRIES,
        }
    }
}

impl Completer {
    /// Completes a Shift from the longest run of facts that fits, and says which fact breaks it off, if one does.
    pub(super) fn complete(
        &mut self,
        rules: &RuleSet,
        order: Option<SeatOrder>,
        facts: &[(usize, Fact)],
    ) -> (Plan, Option<Misfit>) {
        let try_first = |count: usize, tries: &mut Tries| {
            Puzzle::new(rules, order, Tally::of(rules, &facts[..count])).solve(tries)
        };
        let most = self.most.min(self.left);
        let mut tries = Tries::new(most);
        let whole = try_first(facts.len(), &mut tries);
        self.left -= most - tries.left;
        let mut failure = match whole {
            Ok(plan) => return (plan, None),
            Err(problem) => problem,
        };
        // The facts are looked at again, fewer of them: what fits with more of them fits with fewer. The game goes no further than to the
        // one that is found, so that this is done once.
        let again = |count: usize| try_first(count, &mut Tries::new(self.most));
        let (mut fits, mut breaks) = (0, facts.len());
        while breaks - fits > 1 {
            let middle = fits + (breaks - fits) / 2;
            match again(middle) {
                Ok(_) => fits = middle,
                Err(problem) => (breaks, failure) = (middle, problem),
            }
        }
        let plan =
            again(fits).expect("nothing told leaves every deal open, and the rest has fitted");
        let misfit = Misfit {
            line: facts[breaks - 1].0,
            problem: failure,
        };
        (plan, Some(misfit))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by it")]
mod tests {
    use chefshat_engine::{Action, Face, RuleSetSpec};

    use crate::table::complete::*;

    #[test]
    fn a_search_that_is_given_up_says_so_and_ends_the_game_there() {
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
        let (_, misfit) = Completer::default().complete(&rules, order, &facts);
        assert!(misfit.is_none(), "{misfit:?}");

        // What may be looked at, for a Shift and for all of them, and the line at which it was not enough.
        for (most, left, line) in [(5, 5, 8), (1000, 5, 9)] {
            let mut completer = Completer { left, most };
            let (_, misfit) = completer.complete(&rules, order, &facts);
            let misfit = misfit.unwrap();
            assert_eq!(misfit.line, line);
            assert!(
                misfit.problem.contains("tell more hands and gifts"),
                "{misfit:?}"
            );
        }
        // What is left over from one Shift is there for the next.
        let mut completer = Completer::default();
        completer.complete(&rules, order, &facts);
        let used = MAX_TRIES_OF_GAME - completer.left;
        assert!((1..1000).contains(&used), "{used}");
        completer.left = used;
        assert!(completer.complete(&rules, order, &facts).1.is_none());
        assert!(completer.complete(&rules, order, &facts).1.is_some());
    }
}
