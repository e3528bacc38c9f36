//! What a game of a language model costs.

use std::str::FromStr;

use serde::Serialize;

use super::endpoint::Used;

/// Tokens that a price is for.
const MILLION: f64 = 1e6;

/// Prices of a million tokens, in any currency.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct Price {
    /// Of questions.
    questions: f64,
    /// Of answers.
    answers: f64,
    /// Of cached questions.
    cached: f64,
}

impl Price {
    /// What these tokens cost.
    pub(super) fn of(self, used: Used) -> f64 {
        let cached = used.cached.min(used.prompt);
        let new = used.prompt - cached;
        let parts = [
            (new, self.questions),
            (cached, self.cached),
            (used.completion, self.answers),
        ];
        let sum: f64 = (parts.iter())
            .map(|(tokens, price)| *tokens as f64 * price)
            .sum();
        sum / MILLION
    }
}

/// Prices that cannot be read.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "give the prices of a million tokens of questions and of answers, and perhaps of cached questions, as in 0.4,1.6,0.1"
)]
pub(super) struct NotPrices;

impl FromStr for Price {
    type Err = NotPrices;

    fn from_str(text: &str) -> Result<Self, NotPrices> {
        let price = |text: &str| {
            let price = text.trim().parse::<f64>();
            price.ok().filter(|it| it.is_finite() && *it >= 0.0)
        };
        let prices: Option<Vec<f64>> = text.split(',').map(price).collect();
        let (questions, answers, cached) = match prices.as_deref() {
            Some(&[questions, answers]) => (questions, answers, questions),
            Some(&[questions, answers, cached]) => (questions, answers, cached),
            _ => return Err(NotPrices),
        };
        Ok(Self {
            questions,
            answers,
            cached,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cached_questions_have_a_price_of_their_own() {
        let used = Used {
            prompt: 3_000_000,
            cached: 1_000_000,
            completion: 500_000,
            ..Used::default()
        };
        let cost = |text: &str| text.parse::<Price>().expect("prices").of(used);
        assert_eq!(cost("0.5,2"), 1.5 + 1.0);
        assert_eq!(cost("0.5, 2, 0.25"), 1.25 + 1.0);
        for wrong in ["", "1", "1,2,3,4", "1,-2", "1,NaN", "one,2"] {
            assert_eq!(wrong.parse::<Price>(), Err(NotPrices), "{wrong}");
        }
    }
}
