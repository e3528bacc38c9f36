//! Means with standard errors, and shares with intervals.

/// The 97.5 % point of the normal distribution.
const Z95: f64 = 1.959_963_984_540_054;

/// A closed interval.
#[derive(Copy, Clone, PartialEq, Debug)]
pub struct Interval {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Interval {
    /// Whether the interval contains a number.
    pub fn contains(&self, number: f64) -> bool {
        (self.low..=self.high).contains(&number)
    }
}

/// Wilson's 95 % interval of a share: `successes` of `trials` independent trials. 0 to 1 without a
/// trial.
pub fn wilson95(successes: u64, trials: u64) -> Interval {
    if trials == 0 {
        return Interval {
            low: 0.0,
            high: 1.0,
        };
    }
    let (n, share) = (trials as f64, successes as f64 / trials as f64);
    let z2 = Z95 * Z95;
    let middle = (share + z2 / (2.0 * n)) / (1.0 + z2 / n);
    let half = Z95 / (1.0 + z2 / n) * (share * (1.0 - share) / n + z2 / (4.0 * n * n)).sqrt();
    Interval {
        low: (middle - half).max(0.0),
        high: (middle + half).min(1.0),
    }
}

/// Count, mean and variance of a sample, computed in one pass by Welford's and Chan's formulas,
/// which stay accurate where the mean is large compared to the spread.
#[derive(Copy, Clone, PartialEq, Debug, Default)]
pub struct Moments {
    count: u64,
    mean: f64,
    /// Sum of squared deviations from the mean.
    squares: f64,
}

impl Moments {
    /// Adds a value.
    pub fn add(&mut self, value: f64) {
        self.count += 1;
        let distance = value - self.mean;
        self.mean += distance / self.count as f64;
        self.squares += distance * (value - self.mean);
    }

    /// Adds the values of another sample. The order of merging affects rounding only.
    pub fn merge(&mut self, other: &Moments) {
        if other.count == 0 {
            return;
        }
        let (own, others) = (self.count as f64, other.count as f64);
        let distance = other.mean - self.mean;
        self.count += other.count;
        self.mean += distance * others / (own + others);
        self.squares += other.squares + distance * distance * own * others / (own + others);
    }

    /// Number of values.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The mean; 0 without values.
    pub fn mean(&self) -> f64 {
        self.mean
    }

    /// The sample variance (n - 1 in the denominator); 0 with fewer than two values.
    pub fn variance(&self) -> f64 {
        if self.count < 2 {
            return 0.0;
        }
        self.squares / (self.count - 1) as f64
    }

    /// The standard error of the mean, √(variance / n); infinite with fewer than two values, which
    /// say nothing about it.
    pub fn standard_error(&self) -> f64 {
        if self.count < 2 {
            return f64::INFINITY;
        }
        (self.variance() / self.count as f64).sqrt()
    }

    /// The 95 % interval of the mean: 1.96 standard errors to either side, and all numbers with
    /// fewer than two values. Meant for a few dozen independent values or more; for ten values it
    /// is too narrow by a seventh.
    pub fn interval95(&self) -> Interval {
        let half = Z95 * self.standard_error();
        Interval {
            low: self.mean - half,
            high: self.mean + half,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(left: f64, right: f64) -> bool {
        (left - right).abs() < 1e-9
    }

    #[test]
    fn wilson_agrees_with_its_table() {
        // Computed by hand: 70 of 250 is 28 %.
        for (successes, trials, low, high) in [
            (70, 250, 0.227_994_4, 0.338_664_3),
            (0, 10, 0.0, 0.277_532_8),
            (10, 10, 0.722_467_2, 1.0),
            (5, 10, 0.236_593_1, 0.763_406_9),
        ] {
            let interval = wilson95(successes, trials);
            assert!((interval.low - low).abs() < 1e-6, "{interval:?}");
            assert!((interval.high - high).abs() < 1e-6, "{interval:?}");
        }
        assert!(wilson95(0, 0).contains(0.5));
    }

    #[test]
    fn moments_do_not_depend_on_how_a_sample_is_split() {
        let values = [3.0, -1.5, 8.25, 8.25, 0.0, 1e6, 1e6 + 1.0];
        let mean = values.iter().sum::<f64>() / 7.0;
        let squares = values.iter().map(|value| (value - mean).powi(2));
        let variance = squares.sum::<f64>() / 6.0;
        for split in 0..=values.len() {
            let (mut left, mut right) = (Moments::default(), Moments::default());
            values[..split].iter().for_each(|&value| left.add(value));
            values[split..].iter().for_each(|&value| right.add(value));
            left.merge(&right);
            assert_eq!(left.count(), 7);
            assert!(close(left.mean() / mean, 1.0), "{left:?}");
            assert!(close(left.variance() / variance, 1.0), "{left:?}");
            assert!(close(left.standard_error(), (left.variance() / 7.0).sqrt()));
            let half = left.interval95().high - left.mean();
            assert!(close(
                half / (1.959_963_984_540_054 * left.standard_error()),
                1.0
            ));
        }
    }

    #[test]
    fn fewer_than_two_values_say_nothing_about_the_mean() {
        let mut moments = Moments::default();
        for value in [7.0, 9.0] {
            let interval = moments.interval95();
            assert_eq!(
                (interval.low, interval.high),
                (f64::NEG_INFINITY, f64::INFINITY)
            );
            assert_eq!(moments.standard_error(), f64::INFINITY);
            moments.add(value);
        }
        assert_eq!((moments.mean(), moments.standard_error()), (8.0, 1.0));
        assert!(moments.interval95().low > 6.0);
    }
}
