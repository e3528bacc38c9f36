//! Dense layers in 32-bit floats, for several observations at a time. Only sums, products and ReLU
//! are used, in an order that does not depend on the other observations, and the compiler neither
//! fuses nor reorders them: a file gives the same values alone and in any batch, on every machine,
//! whatever the width of its vector registers. tanh does not; it is applied only where outputs are
//! displayed.

use pulp::{Arch, NullaryFnOnce, Simd, WithSimd};

use super::sparse::SparseRows;

/// Independent partial sums of a dot product, to fill one or two vector registers.
const LANES: usize = 8;
/// Units of a hidden layer that are summed at a time, as many as vector registers hold. The weights
/// of a tile mostly stay in the first-level cache from one observation to the next.
const TILE: usize = 32;

/// A hidden layer with ReLU. Its units are followed by others, always 0, up to a multiple of
/// [`TILE`].
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Hidden {
    /// Weights by tile, within it by input, so that inputs of 0, which are common, are skipped.
    weights: Vec<[f32; TILE]>,
    /// By tile.
    bias: Vec<[f32; TILE]>,
    inputs: usize,
}

impl Hidden {
    /// A layer of `bias.len()` units (at least 1); `weights` by unit, as in files.
    pub(super) fn new(weights: &[f32], bias: &[f32]) -> Hidden {
        let (units, inputs) = (bias.len(), weights.len() / bias.len());
        let tile = |first: usize, value: &dyn Fn(usize) -> f32| {
            std::array::from_fn(|lane| match first + lane {
                unit if unit < units => value(unit),
                _ => 0.0,
            })
        };
        let firsts = (0..units).step_by(TILE);
        let by_input = |first| {
            (0..inputs).map(move |input| tile(first, &|unit| weights[unit * inputs + input]))
        };
        Hidden {
            weights: firsts.clone().flat_map(by_input).collect(),
            bias: firsts
                .map(|first| tile(first, &|unit| bias[unit]))
                .collect(),
            inputs,
        }
    }

    /// Number of units, with those that are always 0.
    pub(super) fn units(&self) -> usize {
        self.bias.as_flattened().len()
    }

    /// Number of weights, with those of units that are always 0.
    pub(super) fn weights(&self) -> usize {
        self.weights.as_flattened().len()
    }

    /// Computes the units' values for each row into `out`, replacing its content.
    ///
    /// # Panics
    /// If a row has an input that the layer has not.
    pub(super) fn forward(&self, rows: &SparseRows, out: &mut Vec<f32>) {
        out.clear();
        out.resize(rows.len() * self.units(), 0.0);
        let (layer, out) = (self, out.as_chunks_mut().0);
        Arch::new().dispatch(Sums { layer, rows, out });
    }
}

/// The values of a hidden layer.
struct Sums<'a> {
    layer: &'a Hidden,
    rows: &'a SparseRows,
    /// By row, within it by tile.
    out: &'a mut [[f32; TILE]],
}

impl WithSimd for Sums<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        match S::F32_LANES {
            16 => self.in_registers::<S, 2>(simd),
            8 => self.in_registers::<S, 4>(simd),
            4 => self.in_registers::<S, 8>(simd),
            _ => self.in_registers::<S, TILE>(simd),
        }
    }
}

impl Sums<'_> {
    /// Sums with a tile in N registers.
    #[inline(always)]
    fn in_registers<S: Simd, const N: usize>(self, simd: S) {
        let Hidden {
            weights,
            bias,
            inputs,
        } = self.layer;
        let zero = simd.splat_f32s(0.0);
        for (tile, weights) in weights.chunks_exact(*inputs).enumerate() {
            let (weights, _) = S::as_simd_f32s(weights.as_flattened());
            let (weights, _) = weights.as_chunks::<N>();
            let (start, _) = S::as_simd_f32s(&bias[tile]);
            for (row, out) in self.rows.iter().zip(self.out.chunks_exact_mut(bias.len())) {
                let mut sums: [S::f32s; N] = std::array::from_fn(|part| start[part]);
                for &(index, value) in row {
                    let value = simd.splat_f32s(value);
                    for (sum, weight) in sums.iter_mut().zip(&weights[index as usize]) {
                        *sum = simd.add_f32s(*sum, simd.mul_f32s(value, *weight));
                    }
                }
                let (out, _) = S::as_mut_simd_f32s(&mut out[tile]);
                for (out, sum) in out.iter_mut().zip(sums) {
                    // NaN is not greater.
                    let greater = simd.greater_than_f32s(sum, zero);
                    *out = simd.select_f32s(greater, sum, zero);
                }
            }
        }
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

    /// Number of weights.
    pub(super) fn weights(&self) -> usize {
        self.weights.len()
    }

    /// Calls `found` with each row's number, and the index and value of each of its `wanted`
    /// outputs that exist. The rows are of this `length`, with the layer's inputs first.
    pub(super) fn for_each<W: Iterator<Item = usize>>(
        &self,
        rows: &[f32],
        length: usize,
        wanted: impl Iterator<Item = W>,
        found: impl FnMut(usize, usize, f32),
    ) {
        Arch::new().dispatch(Scores {
            layer: self,
            rows,
            length,
            wanted,
            found,
        });
    }
}

/// Outputs of the last layer, as [`Output::for_each`] says. A value and not a closure, because only
/// its inlined call is compiled for each width of vector registers.
struct Scores<'a, I, F> {
    layer: &'a Output,
    rows: &'a [f32],
    length: usize,
    wanted: I,
    found: F,
}

impl<W, I, F> NullaryFnOnce for Scores<'_, I, F>
where
    W: Iterator<Item = usize>,
    I: Iterator<Item = W>,
    F: FnMut(usize, usize, f32),
{
    type Output = ();

    #[inline(always)]
    fn call(mut self) {
        let Output { weights, bias } = self.layer;
        let inputs = self.layer.inputs();
        let rows = self.rows.chunks_exact(self.length).zip(self.wanted);
        for (number, (row, wanted)) in rows.enumerate() {
            for index in wanted {
                if let Some(bias) = bias.get(index) {
                    let value = bias + dot(&weights[index * inputs..][..inputs], &row[..inputs]);
                    (self.found)(number, index, value);
                }
            }
        }
    }
}

/// The dot product of two slices of the same length.
#[inline(always)]
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

    fn rows(values: &[f32], length: usize) -> SparseRows {
        let mut rows = SparseRows::default();
        rows.extend(values, length);
        rows
    }

    #[test]
    fn layers_agree_with_sums_by_hand() {
        // Two units of three inputs; ReLU cuts off the second.
        let hidden = Hidden::new(&[1.0, 2.0, -3.0, 0.5, -4.0, 1.0], &[0.25, 1.0]);
        let mut out = vec![9.0; 7];
        hidden.forward(&rows(&[2.0, 1.0, 0.0, 0.0, 0.0, 1.0], 3), &mut out);
        let mut expected = [[0.0; TILE]; 2];
        (expected[0][0], expected[1][1]) = (4.25, 2.0);
        assert_eq!(out, expected.as_flattened());

        let output = Output::new(vec![1.0, -1.0, 0.5, 2.0], vec![0.0, 10.0]);
        assert_eq!((output.len(), output.inputs()), (2, 2));
        let mut found = Vec::new();
        let wanted = [vec![0, 2], vec![0, 1]].map(Vec::into_iter);
        let values = [4.25, 1.0, 9.0, 4.0, 1.0, 9.0];
        output.for_each(&values, 3, wanted.into_iter(), |row, index, value| {
            found.push((row, index, value));
        });
        assert_eq!(found, [(0, 0, 3.25), (1, 0, 3.0), (1, 1, 14.0)]);
    }

    #[test]
    fn layers_of_every_width_sum_in_the_order_of_inputs() {
        for units in (1..70).step_by(3) {
            let inputs = units % 7 + 1;
            let number = |index: usize| (index * 37 % 101) as f32 / 7.0 - 5.0;
            let weights: Vec<f32> = (0..units * inputs).map(number).collect();
            let bias: Vec<f32> = (0..units).map(|unit| number(unit + 13)).collect();
            let values: Vec<f32> = (0..3 * inputs).map(|index| number(5 * index)).collect();
            let expected = values.chunks_exact(inputs).flat_map(|row| {
                let (weights, bias) = (&weights, &bias);
                (0..units.next_multiple_of(TILE)).map(move |unit| {
                    if unit >= units {
                        return 0.0;
                    }
                    let weights = &weights[unit * inputs..][..inputs];
                    let add = |sum, (value, weight): (&f32, &f32)| sum + value * weight;
                    row.iter().zip(weights).fold(bias[unit], add).max(0.0)
                })
            });
            let mut out = Vec::new();
            Hidden::new(&weights, &bias).forward(&rows(&values, inputs), &mut out);
            assert_eq!(out, expected.collect::<Vec<_>>(), "{units} units");
        }
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
