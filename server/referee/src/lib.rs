//! Games with real cards, as pure values: nothing is dealt here, and some cards are unknown.
//!
//! [`Fact`]s state part of a Shift. The cards they do not state are completed (`complete`, `search`)
//! so that the rule engine can play the Shift ([`PhysicalGame`]), and `known` says which cards
//! follow from the facts.

mod candidates;
mod complete;
pub mod counts;
mod facts;
mod game;
mod gifts;
mod judge;
mod known;
mod puzzle;
mod referee;
mod report;
mod search;
mod shift;
mod start;
mod words;

pub use facts::{Fact, ShiftFacts};
pub use game::PhysicalGame;
pub use referee::{Accepted, Answer, MAX_HELD, MAX_QUESTIONS, Referee, Refusal, ShiftStory};
pub use report::{
    Corrected, Question, Report, Ruling, SeenCards, Stage, ToLay, Verdict, ViolatedRule, Violation,
};
pub use start::{NO_SEED, StartState};
