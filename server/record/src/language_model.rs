//! What the record says of a language model that played a seat: the annotations of its decisions with a
//! choice. Nobody but the participant vouches for them.

use std::ops::Add;
use std::str::FromStr;

use chefshat_proto::v1;
use serde::{Deserialize, Serialize};

/// The key of the model's name.
pub const MODEL: &str = "model";
/// The key of the number of tokens of the questions and answers of a decision.
pub const TOKENS: &str = "tokens";
/// The key of these tokens by what they are for, the JSON object [`Usage`]; absent if the endpoint did not
/// report all of them so.
pub const USAGE: &str = "usage";
/// The key of the model's answers to the questions of a decision, a JSON array of texts.
pub const ANSWERS: &str = "answers";
/// At the first decision of a game: the key of host and port of the endpoint.
pub const ENDPOINT: &str = "endpoint";
/// At the first decision of a game: the key of the version and digest of the first message.
pub const PROMPT: &str = "prompt";
/// At the first decision of a game: the key of what else is sent with each question, a JSON object.
pub const SAMPLING: &str = "sampling";
/// At the first decision of a game: the key of the prices of tokens, the JSON object [`Price`].
pub const PRICE: &str = "price";

/// Tokens by what they are for, as an endpoint reports them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Usage {
    /// Of questions.
    pub prompt: u64,
    /// Those of them that came from the cache of the endpoint.
    pub cached: u64,
    /// Of answers.
    pub completion: u64,
    /// Those of them that the model reasoned with.
    pub reasoning: u64,
}

impl Add for Usage {
    type Output = Self;

    fn add(self, more: Self) -> Self {
        Self {
            prompt: self.prompt.saturating_add(more.prompt),
            cached: self.cached.saturating_add(more.cached),
            completion: self.completion.saturating_add(more.completion),
            reasoning: self.reasoning.saturating_add(more.reasoning),
        }
    }
}

/// Tokens that a price is for.
const MILLION: f64 = 1e6;

/// Prices of a million tokens, in any currency.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Price {
    /// Of questions.
    questions: f64,
    /// Of answers.
    answers: f64,
    /// Of cached questions.
    cached: f64,
}

impl Price {
    /// Whether all are numbers from 0: those of a record may be anything.
    fn is_possible(self) -> bool {
        let all = [self.questions, self.answers, self.cached];
        all.iter().all(|price| price.is_finite() && *price >= 0.0)
    }

    /// What these tokens cost.
    pub fn of(self, usage: Usage) -> f64 {
        let cached = usage.cached.min(usage.prompt);
        let new = usage.prompt - cached;
        let parts = [
            (new, self.questions),
            (cached, self.cached),
            (usage.completion, self.answers),
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
pub struct NotPrices;

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

/// Tokens and cost of games of a language model, by its own account.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct ModelUsage {
    /// Tokens of questions and answers.
    pub tokens: u64,
    /// What they cost, in the currency of the participant's prices; `None` without prices, or if the
    /// annotations do not have all tokens in parts.
    pub cost: Option<f64>,
}

impl ModelUsage {
    /// Of a game, by the annotations of each decision with a choice; `None` if none has tokens.
    pub fn of_game<'a>(choices: impl Iterator<Item = Option<&'a v1::Annotations>>) -> Option<Self> {
        let (mut tokens, mut usage, mut price) = (None, Some(Usage::default()), None);
        for said in choices {
            let said = |key: &str| said?.extra.get(key).map(String::as_str);
            price = price.or_else(|| serde_json::from_str::<Price>(said(PRICE)?).ok());
            let asked = said(TOKENS).and_then(|text| text.parse::<u64>().ok());
            if let Some(asked) = asked {
                tokens = Some(tokens.unwrap_or(0_u64).saturating_add(asked));
            }
            // A decision without tokens may have taken some.
            if asked != Some(0) {
                let parts = said(USAGE).and_then(|text| serde_json::from_str::<Usage>(text).ok());
                let parts = parts.filter(|_| asked.is_some());
                usage = usage.zip(parts).map(|(sum, parts)| sum + parts);
            }
        }
        let price = price.filter(|price| price.is_possible());
        let cost = price.zip(usage).map(|(price, usage)| price.of(usage));
        Some(Self {
            tokens: tokens?,
            cost: cost.filter(|cost| cost.is_finite()),
        })
    }

    /// Of several games; `None` if some have no tokens.
    pub fn sum(games: impl IntoIterator<Item = Option<Self>>) -> Option<Self> {
        let all: Vec<Self> = games.into_iter().collect::<Option<_>>()?;
        let costs: Option<Vec<f64>> = all.iter().map(|game| game.cost).collect();
        (!all.is_empty()).then(|| Self {
            tokens: (all.iter()).fold(0, |sum, game| game.tokens.saturating_add(sum)),
            cost: costs.map(|costs| costs.iter().sum()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cached_questions_have_a_price_of_their_own() {
        let usage = Usage {
            prompt: 3_000_000,
            cached: 1_000_000,
            completion: 500_000,
            ..Usage::default()
        };
        let cost = |text: &str| text.parse::<Price>().expect("prices").of(usage);
        assert_eq!(cost("0.5,2"), 1.5 + 1.0);
        assert_eq!(cost("0.5, 2, 0.25"), 1.25 + 1.0);
        for wrong in ["", "1", "1,2,3,4", "1,-2", "1,NaN", "one,2"] {
            assert_eq!(wrong.parse::<Price>(), Err(NotPrices), "{wrong}");
        }
    }

    fn decision(said: &[(&str, &str)]) -> v1::Annotations {
        let said = said
            .iter()
            .map(|(key, words)| ((*key).into(), (*words).into()));
        v1::Annotations {
            extra: said.collect(),
            ..v1::Annotations::default()
        }
    }

    #[test]
    fn a_game_costs_what_its_annotations_say() {
        let price = (PRICE, r#"{"questions":1.0,"answers":2.0,"cached":0.5}"#);
        let usage = (USAGE, r#"{"prompt":500000,"completion":250000}"#);
        let usage_of = |decisions: &[&[(&str, &str)]]| {
            let decisions: Vec<_> = decisions.iter().map(|said| decision(said)).collect();
            ModelUsage::of_game(decisions.iter().map(Some))
        };
        let of = |tokens, cost| Some(ModelUsage { tokens, cost });
        let tokens = (TOKENS, "1000000");
        assert_eq!(usage_of(&[]), None);
        assert_eq!(usage_of(&[&[("reason", "it was there")]]), None);
        let both: &[&[_]] = &[&[tokens, usage, price], &[tokens, usage]];
        assert_eq!(usage_of(both), of(2_000_000, Some(2.0)));
        // The fallback decided before the model was asked.
        let unasked: &[&[_]] = &[&[tokens, usage, price], &[(TOKENS, "0")]];
        assert_eq!(usage_of(unasked), of(1_000_000, Some(1.0)));
        let unpriced: &[&[_]] = &[&[tokens, usage]];
        assert_eq!(usage_of(unpriced), of(1_000_000, None));
        let in_part: &[&[_]] = &[&[tokens, usage, price], &[tokens]];
        assert_eq!(usage_of(in_part), of(2_000_000, None));
        // Late, so that the server decided, and the record has no annotations.
        let late: &[&[_]] = &[&[tokens, usage, price], &[]];
        assert_eq!(usage_of(late), of(1_000_000, None));
        // Records of others can have any numbers.
        let negative = (PRICE, r#"{"questions":-1,"answers":2,"cached":0.5}"#);
        assert_eq!(usage_of(&[&[tokens, usage, negative]]), of(1_000_000, None));
        let absurd = (
            PRICE,
            r#"{"questions":1e308,"answers":1e308,"cached":1e308}"#,
        );
        let most = (TOKENS, "18446744073709551615");
        assert_eq!(
            usage_of(&[&[most, usage, absurd], &[most, usage]]),
            of(u64::MAX, None)
        );

        let all = [usage_of(both), usage_of(unasked)];
        assert_eq!(ModelUsage::sum(all), of(3_000_000, Some(3.0)));
        assert_eq!(
            ModelUsage::sum([usage_of(both), usage_of(unpriced)]),
            of(3_000_000, None)
        );
        assert_eq!(ModelUsage::sum([usage_of(both), None]), None);
        assert_eq!(ModelUsage::sum([]), None);
    }
}
