//! Dense layers in 32-bit floats, laid out for inner loops over contiguous memory. Only sums,
//! products and ReLU are used, which the compiler neither fuses nor reorders, so a file gives the
//! same values on every machine, whatever the width of its vector instructions (`Sums` is
//! compiled for several). tanh does not; it is applied only where outputs are displayed.

use pulp::{Arch, NullaryFnOnce};

/// Independent partial sums of a dot product, to fill one or two vector registers.
const LANES: usize = 8;
/// Units of a hidden layer that are summed at a time, as many as vector registers hold.
const TILE: usize = 64;

/// A hidden layer with ReLU.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Hidden {
    /// Weights by input, so that inputs of 0, which are common, are skipped.
    by_input: Vec<f32>,
    bias: Vec<f32>,
}

impl Hidden {
    /// A layer of `bias.len()` units (at least 1); `weights` by unit, as in files.
    pub(super) fn new(weights: &[f32], bias: Vec<f32>) -> Hidden {
        let (units, inputs) = (bias.len(), weights.len() / bias.len());
        let by_input = (0..inputs)
            .flat_map(|input| (0..units).map(move |unit| weights[unit * inputs + input]))
            .collect();
        Hidden { by_input, bias }
    }

    /// Computes the units' values into `out`, replacing its content.
    pub(super) fn forward(&self, input: &[f32], out: &mut Vec<f32>) {
        assert_eq!(
            input.len() * self.bias.len(),
            self.by_input.len(),
            "there are as many values as the layer has inputs"
        );
        out.clear();
        out.extend_from_slice(&self.bias);
        let used: Vec<(usize, f32)> = (input.iter().copied().enumerate())
            .filter(|(_, value)| *value != 0.0)
            .collect();
        Arch::new().dispatch(Sums {
            used: &used,
            by_input: &self.by_input,
            out,
        });
        for unit in out {
            *unit = unit.max(0.0);
        }
    }
}

/// The sums of a hidden layer. A value and not a closure, because only its inlined call is compiled
/// for each width of vector instructions.
struct Sums<'a> {
    /// The inputs other than 0, with their numbers.
    used: &'a [(usize, f32)],
    by_input: &'a [f32],
    out: &'a mut [f32],
}

impl NullaryFnOnce for Sums<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let units = self.out.len();
        let (tiles, rest) = self.out.as_chunks_mut::<TILE>();
        let after = units - rest.len();
        for (tile, first) in tiles.iter_mut().zip((0..).step_by(TILE)) {
            // A copy, to stay in registers.
            let mut sums = *tile;
            for &(index, value) in self.used {
                add(
                    &mut sums,
                    value,
                    &self.by_input[index * units + first..][..TILE],
                );
            }
            *tile = sums;
        }
        for &(index, value) in self.used {
            let weights = &self.by_input[index * units + after..];
            add(rest, value, &weights[..units - after]);
        }
    }
}

/// Adds weights times a value to sums.
#[inline(always)]
fn add(sums: &mut [f32], value: f32, weights: &[f32]) {
    for (sum, weight) in sums.iter_mut().zip(weights) {
        *sum += value * weight;
    }
}

/// The last layer, without an activation. Its outputs are computed one at a time, because few
/// actions are legal.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Output {
    /// Weights by output.
    weights: Vec<f32>,
    bias: Vec<f32>,
}

impl Output {
    /// A layer of `bias.len()` outputs (at least 1); `weights` by output, as in files.
    pub(super) fn new(weights: Vec<f32>, bias: Vec<f32>) -> Output {
        Output { weights, bias }
    }

    /// Number of outputs.
    pub(super) fn len(&self) -> usize {
        self.bias.len()
    }

    /// Number of inputs.
    pub(super) fn inputs(&self) -> usize {
        self.weights.len() / self.bias.len()
    }

    /// Computes one output. `input` must have the layer's number of inputs.
    pub(super) fn value(&self, index: usize, input: &[f32]) -> f32 {
        let row = &self.weights[index * input.len()..][..input.len()];
        self.bias[index] + dot(row, input)
    }
}

/// The dot product of two slices of the same length.
fn dot(left: &[f32], right: &[f32]) -> f32 {
    let (lefts, left_rest) = left.as_chunks::<LANES>();
    let (rights, right_rest) = right.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for (a, b) in lefts.iter().zip(rights) {
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
    }
    let rest: f32 = left_rest.iter().zip(right_rest).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f32>() + rest
}

#[cfg(test)]
mod tests {
    use crate::network::layers::*;

    #[test]
    fn layers_agree_with_sums_by_hand() {
        // Two units of three inputs; ReLU cuts off the second.
        let hidden = Hidden::new(&[1.0, 2.0, -3.0, 0.5, -4.0, 1.0], vec![0.25, 1.0]);
        let mut out = vec![9.0; 7];
        hidden.forward(&[2.0, 1.0, 0.0], &mut out);
        assert_eq!(out, [4.25, 0.0]);
        hidden.forward(&[0.0, 0.0, 1.0], &mut out);
        assert_eq!(out, [0.0, 2.0]);

        let output = Output::new(vec![1.0, -1.0, 0.5, 2.0], vec![0.0, 10.0]);
        assert_eq!((output.len(), output.inputs()), (2, 2));
        assert_eq!(output.value(0, &[4.25, 1.0]), 3.25);
        assert_eq!(output.value(1, &[4.0, 1.0]), 14.0);
    }

    #[test]
    fn dot_products_of_every_length_are_right() {
        for length in 0..40u8 {
            let left: Vec<f32> = (0..length).map(f32::from).collect();
            let right: Vec<f32> = left.iter().map(|number| 2.0 * number - 3.0).collect();
            let expected: f32 = left.iter().zip(&right).map(|(a, b)| a * b).sum();
            assert_eq!(dot(&left, &right), expected, "{length} whole numbers");
        }
    }
}
