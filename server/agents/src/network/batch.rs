//! Decisions that a network takes together: the weights are read once for all of them, and nothing
//! is allocated once the buffers have grown. Each action is the one that it would take alone.

use std::cell::RefCell;

use chefshat_engine::{ActionId, Mask, Observation};

use super::sparse::SparseRows;
use super::{Network, NetworkInput, features};

thread_local! {
    /// The buffers of single decisions.
    static SINGLE: RefCell<NetworkBatch> = RefCell::default();
}

/// Decisions that wait for a network, with its buffers. Use it with one network at a time.
#[derive(Debug, Default)]
pub struct NetworkBatch {
    inputs: SparseRows,
    legal: Vec<Mask>,
    hidden: SparseRows,
    values: Vec<f32>,
    /// For each decision the best action so far, and its output.
    best: Vec<(ActionId, f32)>,
}

impl NetworkBatch {
    /// Number of decisions that wait.
    pub fn len(&self) -> usize {
        self.legal.len()
    }

    /// Whether no decision waits.
    pub fn is_empty(&self) -> bool {
        self.legal.is_empty()
    }
}

impl Network {
    /// Chooses the legal action with the highest output before tanh, the lowest index of equals.
    /// NaN, from weights too large to sum, counts as the lowest. Without an output for the decision
    /// takes the default action ([`Observation::default_action`]). In a game that the network does
    /// not fit plays as the built-in agent `greedy`.
    ///
    /// # Panics
    /// If `legal` is empty.
    pub fn decide(&self, observation: &Observation, legal: &Mask) -> ActionId {
        SINGLE.with_borrow_mut(|batch| {
            batch.clear();
            if let Some(action) = self.decide_or_wait(observation, legal, batch) {
                return action;
            }
            let mut chosen = None;
            self.decide_all(batch, |_, action| chosen = Some(action));
            chosen.expect("one decision has waited")
        })
    }

    /// Chooses as [`Network::decide`] if that needs no outputs; otherwise adds the decision to the
    /// batch.
    ///
    /// # Panics
    /// If `legal` is empty.
    pub fn decide_or_wait(
        &self,
        observation: &Observation,
        legal: &Mask,
        batch: &mut NetworkBatch,
    ) -> Option<ActionId> {
        let known = self.decide_without_outputs(observation, legal);
        if known.is_none() {
            self.write_features(observation, legal, &mut batch.inputs, &mut batch.values);
            batch.legal.push(*legal);
        }
        known
    }

    /// Calls `decided` with the place in the batch, from 0, and the action of each decision that
    /// waits. Empties the batch.
    pub fn decide_all(&self, batch: &mut NetworkBatch, mut decided: impl FnMut(usize, ActionId)) {
        let mut best = std::mem::take(&mut batch.best);
        best.clear();
        best.extend(batch.legal.iter().map(|legal| {
            let first = legal.nth(0).expect("a decision has a legal action");
            (first, f32::NEG_INFINITY)
        }));
        // Before tanh, which keeps the order but differs between platforms and saturates. NaN
        // compares as not greater.
        self.outputs_of_all(batch, |decision, action, sum| {
            let best = &mut best[decision];
            if sum > best.1 {
                *best = (action, sum);
            }
        });
        for (decision, (action, _)) in best.iter().enumerate() {
            decided(decision, *action);
        }
        batch.best = best;
    }

    /// Calls `found` with the place in the batch, from 0, each legal action of the decision that waits
    /// there, and its output before tanh. Empties the batch.
    pub fn outputs_of_all(
        &self,
        batch: &mut NetworkBatch,
        mut found: impl FnMut(usize, ActionId, f32),
    ) {
        let NetworkBatch {
            inputs,
            legal,
            hidden,
            values,
            ..
        } = &mut *batch;
        let length = self.last_hidden(inputs, hidden, values);
        let wanted = legal.iter().map(|legal| {
            let actions = legal.iter();
            actions.map(|action| usize::from(action.index()))
        });
        self.output
            .for_each(values, length, wanted, |decision, index, sum| {
                found(decision, ActionId::new(index as u16), sum);
            });
        batch.clear();
    }

    /// Computes the T or A outputs for an input from [`Network::features`]. After tanh the last
    /// digits may differ between platforms.
    ///
    /// # Panics
    /// If the input has the wrong length.
    pub fn outputs(&self, features: &[f32]) -> Vec<f32> {
        assert_eq!(
            features.len(),
            self.inputs,
            "there are as many features as the network has inputs"
        );
        let mut inputs = SparseRows::default();
        inputs.extend(features, self.inputs);
        let (mut hidden, mut values) = (SparseRows::default(), Vec::new());
        let length = self.last_hidden(&inputs, &mut hidden, &mut values);
        let mut outputs = Vec::with_capacity(self.output.len());
        let all = std::iter::once(0..self.output.len());
        self.output.for_each(&values, length, all, |_, _, sum| {
            outputs.push(if self.info.tanh { sum.tanh() } else { sum });
        });
        outputs
    }

    /// Writes the features of an observation as a row.
    fn write_features(
        &self,
        observation: &Observation,
        legal: &Mask,
        out: &mut SparseRows,
        buffer: &mut Vec<f32>,
    ) {
        match self.info.input {
            NetworkInput::Classic => {
                buffer.clear();
                buffer.resize(observation.classic_len(), 0.0);
                observation.write_classic_vector(legal, buffer);
                out.extend(buffer, buffer.len());
            }
            NetworkInput::Table => {
                features::write_table(observation, legal, out);
            }
        }
    }

    /// Writes the values of the last hidden layer, or the inputs if there is none, for each row.
    /// Returns the length of the rows, whose first values count.
    fn last_hidden(
        &self,
        inputs: &SparseRows,
        hidden: &mut SparseRows,
        values: &mut Vec<f32>,
    ) -> usize {
        let Some((first, rest)) = self.hidden.split_first() else {
            inputs.write(self.inputs, values);
            return self.inputs;
        };
        first.forward(inputs, values);
        let mut units = first.units();
        for layer in rest {
            hidden.clear();
            hidden.extend(values, units);
            layer.forward(hidden, values);
            units = layer.units();
        }
        units
    }
}

impl NetworkBatch {
    fn clear(&mut self) {
        self.inputs.clear();
        self.legal.clear();
    }
}
