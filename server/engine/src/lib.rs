//! The rule engine of Chef's Hat: pure values, nothing else.
//!
//! A [`Game`] is created from a validated [`RuleSet`] and a [`Seed`]. It says whose decision is
//! open ([`Game::decision`]), what is legal ([`Game::legal_actions`]) and what the rules require
//! ([`Game::requirement`]), applies an [`ActionId`] ([`Game::apply`]), reports [`Event`]s, and
//! gives each seat its [`Observation`]. [`Event::seen_by`] decides what a viewer may see of the cards.
//!
//! The rules are in `docs/rules.md`; comments cite its sections as §4.3. No files, sockets, clocks,
//! serialisation, threads, global randomness or agents live here: on every machine, a game is a
//! function of its rule set, its seed and its decisions.
//!
//! ```
//! use chefshat_engine::{Game, RuleSetSpec, Seed};
//!
//! let rules = RuleSetSpec::default().validate()?;
//! let mut game = Game::new(rules, Seed([7; 32]), |_| {});
//! while let Some(decision) = game.decision() {
//!     let action = game.legal_actions().nth(0).expect("an open decision has a legal action");
//!     game.apply(action, |event| println!("{:?} {event:?}", decision.seat))?;
//! }
//! println!("seat {} wins", game.standings().expect("the game has ended").winner());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod actions;
mod board;
mod by_seat;
mod cards;
mod deal;
mod decision;
mod event;
mod exchange;
mod game;
mod ids;
pub mod limits;
mod mask;
mod metrics;
mod observation;
mod order;
mod patterns;
mod played;
mod presets;
mod rewards;
mod roles;
mod rules;
mod seed_plan;

pub use actions::{Action, ActionSpace};
pub use board::Board;
pub use by_seat::BySeat;
pub use cards::Cards;
pub use deal::{Card, Deal, Seed};
pub use decision::{Decision, DecisionKind, GiftRequirement, PlayRequirement, Requirement};
pub use event::{Event, ShiftEnd, Viewer};
pub use exchange::ExchangePair;
pub use game::{ActionError, Game, GameState, Refusal, Script, ScriptError, Stage, StateError};
pub use ids::{ActionId, Face, Seat};
pub use mask::Mask;
pub use metrics::{
    MetricsRecorder, OwnChoices, RecorderState, SeatCounts, SeatMetrics, SeatStatistics,
    ShiftMetrics,
};
pub use observation::Observation;
pub use order::{SeatOrder, Standings};
pub use played::{PlayedDecision, RecordedDecision, TakenOver};
pub use rewards::RewardScheme;
pub use roles::{Role, SpecialAction};
pub use rules::{Opening, PassScope, RuleSet, RuleSetError, RuleSetSpec, Stop};
pub use seed_plan::{MAX_ENTROPY, SeedPlan};

/// Version of the rules that this crate implements. Every record names the version it was played
/// by.
pub const RULES_VERSION: u32 = 1;
/// The most seats a game can have.
pub const MAX_SEATS: usize = 6;
/// The most faces a deck can have.
pub const MAX_FACES: u8 = 15;
/// The most jokers a deck can have.
pub const MAX_JOKERS: u8 = 2;
