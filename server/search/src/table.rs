//! Counts the deals that the holders of hidden cards allow, kind by kind, and draws one of them.
//!
//! A deal gives each physical card to a holder. All cards of a kind are alike, so a way to split a
//! kind counts as often as there are physical cards to make it: n! / (k1! k2! …). A state says how
//! many cards each holder has been dealt of the kinds so far, and how many cards each hidden
//! chooser gave. [`Table::completions`] is the number of ways to deal the remaining kinds.

use std::ops::ControlFlow;

use crate::KnowledgeError;
use crate::holders::{Dealt, Holders, MAX_KINDS};

/// The most numbers in a state: five seats, the cards set aside, and the gifts of two pairs.
const MAX_VARIABLES: usize = 8;
/// A number of the state, for each variable.
type State = [u8; MAX_VARIABLES];

/// What a variable of a state counts.
#[derive(Clone, Debug)]
struct Variable {
    /// Its range before each kind, and after the last.
    ranges: Vec<(u8, u8)>,
    /// The step of its value in the index of a state; 0 if the others determine it.
    stride: Vec<usize>,
}

/// One way to split a kind among the holders.
#[derive(Copy, Clone, Debug)]
pub(crate) struct Split {
    /// The state with this kind dealt.
    pub(crate) next: State,
    /// Variable of the holder that is dealt the Golden card.
    pub(crate) golden: Option<u8>,
    weight: f64,
}

/// The steps that counting may still take, over all tables of a decision. A step is to lay out a
/// state, which takes 8 bytes, or to try a way to split a kind.
pub(crate) struct Steps {
    all: u64,
    left: u64,
}

impl Steps {
    pub(crate) fn new(all: u64) -> Steps {
        Steps { all, left: all }
    }

    fn take(&mut self, steps: u64) -> Result<(), KnowledgeError> {
        let left = self.left.checked_sub(steps);
        self.left = left.ok_or(KnowledgeError::TooManySteps(self.all))?;
        Ok(())
    }
}

/// The deals that are possible.
#[derive(Clone, Debug)]
pub(crate) struct Table {
    holders: Holders,
    variables: Vec<Variable>,
    /// Of each kind, the number of completions of each state; NaN if not counted yet.
    layers: Vec<Vec<f64>>,
}

impl Table {
    /// Counts the deals.
    ///
    /// # Errors
    /// If that takes more `steps` than are left.
    pub(crate) fn new(holders: Holders, steps: &mut Steps) -> Result<Table, KnowledgeError> {
        let mut table = Table {
            variables: variables(&holders),
            holders,
            layers: Vec::new(),
        };
        if !table.is_feasible() {
            return Ok(table);
        }
        let mut sizes = Vec::new();
        for kind in 0..=table.holders.kinds() {
            let size = table.index_layer(kind);
            steps.take(size as u64)?;
            sizes.push(size);
        }
        // Nothing is allocated before it is clear that all of it is allowed.
        table.layers = (sizes.into_iter())
            .map(|size| vec![f64::NAN; size])
            .collect();
        table.count(0, State::default(), steps)?;
        Ok(table)
    }

    /// The number of states that are laid out.
    pub(crate) fn states(&self) -> usize {
        self.layers.iter().map(Vec::len).sum()
    }

    /// The number of ways to deal the hidden cards and to choose the hidden gifts, physical cards
    /// distinguished.
    pub(crate) fn ways(&self) -> f64 {
        if !self.is_feasible() {
            return 0.0;
        }
        let orders: f64 = (0..self.holders.kinds())
            .map(|kind| factorial(self.holders.hidden_of(kind).plain))
            .product();
        self.completions(0, &State::default()) * orders
    }

    /// Draws a deal: calls `take` with each kind, the state before it, and how it is split.
    /// `uniform` gives numbers from 0 to below 1.
    ///
    /// # Panics
    /// If there is no deal.
    pub(crate) fn draw(
        &self,
        mut uniform: impl FnMut() -> f64,
        mut take: impl FnMut(usize, &State, &Split),
    ) {
        let mut state = State::default();
        for kind in 0..self.holders.kinds() {
            let mut rest = uniform() * self.completions(kind, &state);
            let mut chosen = None;
            let _ = self.splits(kind, &state, &mut |split| {
                let ways = split.weight * self.completions(kind + 1, &split.next);
                if ways > 0.0 {
                    chosen = Some(split);
                    rest -= ways;
                    if rest < 0.0 {
                        return ControlFlow::Break(());
                    }
                }
                ControlFlow::Continue(())
            });
            let split = chosen.expect("there is a deal");
            take(kind, &state, &split);
            state = split.next;
        }
    }

    /// The holders.
    pub(crate) fn holders(&self) -> &Holders {
        &self.holders
    }

    fn is_feasible(&self) -> bool {
        self.variables
            .iter()
            .all(|variable| variable.ranges.iter().all(|(low, high)| low <= high))
    }

    /// Lays out the states before a kind, and returns how many there are.
    fn index_layer(&mut self, kind: usize) -> usize {
        let width = |variable: &Variable| {
            let (low, high) = variable.ranges[kind];
            usize::from(high - low) + 1
        };
        // The cards dealt so far are known, so the widest holder's number follows from the others.
        let holders = self.holders.pairs.len() * 2 + self.holders.singles.len();
        let widest = (0..holders).max_by_key(|&holder| width(&self.variables[holder]));
        let mut size = 1usize;
        for (index, variable) in self.variables.iter_mut().enumerate() {
            if Some(index) == widest {
                variable.stride.push(0);
            } else {
                variable.stride.push(size);
                size = size.saturating_mul(width(variable));
            }
        }
        size
    }

    fn index(&self, kind: usize, state: &State) -> usize {
        self.variables
            .iter()
            .zip(state)
            .map(|(variable, &value)| {
                usize::from(value - variable.ranges[kind].0) * variable.stride[kind]
            })
            .sum()
    }

    fn completions(&self, kind: usize, state: &State) -> f64 {
        self.layers[kind][self.index(kind, state)]
    }

    /// Counts the completions of a state.
    fn count(
        &mut self,
        kind: usize,
        state: State,
        steps: &mut Steps,
    ) -> Result<f64, KnowledgeError> {
        let index = self.index(kind, &state);
        let known = self.layers[kind][index];
        if !known.is_nan() {
            return Ok(known);
        }
        let mut sum = 0.0;
        if kind == self.holders.kinds() {
            sum = 1.0;
        } else {
            let mut splits = Vec::new();
            let _ = self.splits(kind, &state, &mut |split| {
                splits.push((split.next, split.weight));
                ControlFlow::Continue(())
            });
            steps.take(splits.len() as u64)?;
            for (next, weight) in splits {
                sum += weight * self.count(kind + 1, next, steps)?;
            }
        }
        self.layers[kind][index] = sum;
        Ok(sum)
    }

    /// Calls `found` with every way to split a kind among the holders.
    fn splits(
        &self,
        kind: usize,
        state: &State,
        found: &mut impl FnMut(Split) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let start = Split {
            next: *state,
            golden: None,
            weight: 1.0,
        };
        self.split_among(kind, state, 0, self.holders.hidden_of(kind), start, found)
    }

    /// Splits what is `left` of a kind among the holders from a block on. Blocks are the pairs, then
    /// the singles.
    fn split_among(
        &self,
        kind: usize,
        state: &State,
        block: usize,
        left: Dealt,
        so_far: Split,
        found: &mut impl FnMut(Split) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let (pairs, faces) = (&self.holders.pairs, self.holders.faces);
        let blocks = pairs.len() + self.holders.singles.len();
        if block == blocks {
            return if left.total() == 0 {
                found(so_far)
            } else {
                ControlFlow::Continue(())
            };
        }
        if let Some(pair) = pairs.get(block) {
            let [chooser, forced, gifts] = [2 * block, 2 * block + 1, self.gifts_variable(block)];
            let due = pair.count - pair.count.min(state[forced]);
            for first in self.portions(kind, state, chooser, left) {
                let next = so_far.with(chooser, first);
                let rest = remainder(left, first);
                for second in self.portions(kind, state, forced, rest) {
                    let mut next = next.with(forced, second);
                    let rest = remainder(rest, second);
                    for given in 0..=first.total().min(pair.count - state[gifts]) {
                        let total = state[gifts] + given;
                        let (fewest, _) = self.variables[gifts].ranges[kind + 1];
                        let possible = pair.allows(kind, faces, [first, second], given, due);
                        if !possible || total < fewest {
                            continue;
                        }
                        next.next[gifts] = total;
                        let weighted = Split {
                            weight: next.weight * choose(first.total(), given),
                            ..next
                        };
                        self.split_among(kind, state, block + 1, rest, weighted, found)?;
                    }
                }
            }
        } else {
            let single = &self.holders.singles[block - pairs.len()];
            let variable = block + pairs.len();
            for dealt in self.portions(kind, state, variable, left) {
                if single.allows(kind, faces, dealt) {
                    let rest = remainder(left, dealt);
                    let next = so_far.with(variable, dealt);
                    self.split_among(kind, state, block + 1, rest, next, found)?;
                }
            }
        }
        ControlFlow::Continue(())
    }

    /// The variable of the gifts of a pair.
    pub(crate) fn gifts_variable(&self, pair: usize) -> usize {
        self.holders.pairs.len() * 2 + self.holders.singles.len() + pair
    }

    /// How many cards of a kind can be dealt to a holder.
    fn room(&self, kind: usize, state: &State, holder: usize) -> (u8, u8) {
        let (low, high) = self.variables[holder].ranges[kind + 1];
        let value = state[holder];
        (low.saturating_sub(value), high.saturating_sub(value))
    }

    /// The ways to deal a holder its part of what is left of a kind, so that the holders after it
    /// have room for the rest.
    fn portions(
        &self,
        kind: usize,
        state: &State,
        holder: usize,
        left: Dealt,
    ) -> impl Iterator<Item = Dealt> + use<> {
        let (low, high) = self.room(kind, state, holder);
        let holders = self.holders.pairs.len() * 2 + self.holders.singles.len();
        let later: u8 = (holder + 1..holders)
            .map(|holder| self.room(kind, state, holder).1)
            .fold(0, u8::saturating_add);
        let low = low.max(left.total().saturating_sub(later));
        [false, left.golden]
            .into_iter()
            .take(1 + usize::from(left.golden))
            .flat_map(move |golden| {
                let is_golden = u8::from(golden);
                let fewest = low.saturating_sub(is_golden);
                // An empty range if there is no room for the Golden card.
                let most = (high + 1).saturating_sub(is_golden).min(left.plain + 1);
                (fewest..most).map(move |plain| Dealt { plain, golden })
            })
    }
}

impl Split {
    /// With cards dealt to a holder.
    fn with(mut self, variable: usize, dealt: Dealt) -> Split {
        self.next[variable] += dealt.total();
        self.weight *= INVERSE_FACTORIALS[usize::from(dealt.plain)];
        if dealt.golden {
            self.golden = Some(variable as u8);
        }
        self
    }
}

fn remainder(left: Dealt, taken: Dealt) -> Dealt {
    Dealt {
        plain: left.plain - taken.plain,
        golden: left.golden && !taken.golden,
    }
}

/// The variables of the holders, in the order pairs (chooser, forced giver), singles, gifts of
/// pairs.
fn variables(holders: &Holders) -> Vec<Variable> {
    let kinds = holders.kinds();
    let all = |kind: usize| {
        let hidden = holders.hidden_of(kind);
        (0..=hidden.plain)
            .flat_map(move |plain| [false, hidden.golden].map(|golden| Dealt { plain, golden }))
    };
    let mut variables = Vec::new();
    for pair in &holders.pairs {
        for after in &pair.after {
            // Cards that were played may have been received.
            let least = |kind: usize| after.played[kind].saturating_sub(pair.count);
            variables.push(ranges(pair.size, kinds, least));
        }
    }
    for single in &holders.singles {
        let least = |kind: usize| {
            all(kind)
                .filter(|dealt| single.allows(kind, holders.faces, *dealt))
                .map(Dealt::total)
                .min()
                // No number of cards fits.
                .unwrap_or(single.size + 1)
        };
        variables.push(ranges(single.size, kinds, least));
    }
    for pair in &holders.pairs {
        let mut range = vec![(0, pair.count); kinds + 1];
        range[0] = (0, 0);
        range[kinds] = (pair.count, pair.count);
        variables.push(Variable {
            ranges: range,
            stride: Vec::new(),
        });
    }
    variables
}

/// The ranges of the number of cards dealt to a holder of `size` cards, at least `least` of each
/// kind. Some range is empty if there is no way.
fn ranges(size: u8, kinds: usize, least: impl Fn(usize) -> u8) -> Variable {
    let least: Vec<u8> = (0..kinds).map(least).collect();
    let sum = |kinds: &[u8]| {
        kinds
            .iter()
            .fold(0u8, |sum, &count| sum.saturating_add(count))
    };
    let ranges = (0..=kinds).map(|kind| {
        let (before, from) = least.split_at(kind);
        match size.checked_sub(sum(from)) {
            // Before the first kind nothing is dealt, after the last everything.
            Some(_) if kind == 0 => (0, 0),
            Some(high) if kind == kinds => (high, if sum(before) <= size { high } else { 0 }),
            Some(high) => (sum(before), high),
            None => (1, 0),
        }
    });
    Variable {
        ranges: ranges.collect(),
        stride: Vec::new(),
    }
}

const MAX_CARDS: usize = MAX_KINDS;

const INVERSE_FACTORIALS: [f64; MAX_CARDS] = {
    let mut table = [1.0; MAX_CARDS];
    let mut n = 1;
    while n < MAX_CARDS {
        table[n] = table[n - 1] / n as f64;
        n += 1;
    }
    table
};

fn factorial(n: u8) -> f64 {
    1.0 / INVERSE_FACTORIALS[usize::from(n)]
}

/// The number of ways to choose `k` of `n`, with `k` at most 2.
fn choose(n: u8, k: u8) -> f64 {
    let n = f64::from(n);
    match k {
        0 => 1.0,
        1 => n,
        _ => n * (n - 1.0) / 2.0,
    }
}
