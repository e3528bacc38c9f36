//! Flags for a rule set: a preset and one flag per field that overrides it. The engine validates
//! the result.

use chefshat_engine::{RuleSet, RuleSetSpec};
use chefshat_proto::v1;
use chefshat_record::convert::rules_from_proto;
use clap::Args;
use clap::builder::PossibleValuesParser;

use super::CommandError;
use super::choice::choice;

/// A rule set on the command line.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Rules")]
pub struct RulesArgs {
    /// Preset; every other flag overrides one field. paper: to 15 points, 5,3,1,0 by place, the
    /// Golden 11 opens. rulebook: the same with 3,2,1,0. original2020: as paper, but any 11 opens,
    /// the opener may pass and a pass binds for one turn.
    #[arg(long, default_value = "paper", value_parser = PossibleValuesParser::new(RuleSetSpec::PRESETS))]
    preset: String,
    /// Seats, 2 to 6. Default: 4.
    #[arg(long, value_name = "N")]
    players: Option<u32>,
    /// Faces, 4 to 15; the deck has f cards of face f. Default: 11.
    #[arg(long, value_name = "F")]
    faces: Option<u32>,
    /// Jokers, 0 to 2. Default: 2.
    #[arg(long, value_name = "J")]
    jokers: Option<u32>,
    /// End the game after the Shift in which a player reaches this many points. Default: 15.
    #[arg(long, value_name = "POINTS", conflicts_with = "target_shifts")]
    target_points: Option<u32>,
    /// End the game after this many Shifts.
    #[arg(long, value_name = "SHIFTS")]
    target_shifts: Option<u32>,
    /// Points by place, from the first, for example 5,3,1,0.
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    points: Vec<u32>,
    /// Whether cards are exchanged from the second Shift on.
    #[arg(long, value_name = "ON|OFF", value_parser = choice(&ON_OFF))]
    exchange: Option<bool>,
    /// Same as --exchange off.
    #[arg(long, conflicts_with = "exchange")]
    no_exchange: bool,
    /// Whether special actions are offered from the second Shift on.
    #[arg(long, value_name = "ON|OFF", value_parser = choice(&ON_OFF))]
    special_actions: Option<bool>,
    /// Same as --special-actions off.
    #[arg(long, conflicts_with = "special_actions")]
    no_special_actions: bool,
    /// Which seat opens a Shift.
    #[arg(long, value_parser = choice(&OPENINGS))]
    opening: Option<v1::Opening>,
    /// Whether the seat that opens a Shift may pass on that turn.
    #[arg(long, value_parser = choice(&[("forbidden", false, ""), ("allowed", true, "")]))]
    opening_pass: Option<bool>,
    /// How long a pass binds.
    #[arg(long, value_parser = choice(&PASS_SCOPES))]
    pass_scope: Option<v1::PassScope>,
    /// Consecutive pizzas without a play after which the leader has to play.
    #[arg(long, value_name = "PIZZAS")]
    max_idle_pizzas: Option<u32>,
    /// Turns after which a Shift is adjudicated.
    #[arg(long, value_name = "TURNS")]
    max_turns: Option<u32>,
}

const ON_OFF: [(&str, bool, &str); 2] = [("on", true, ""), ("off", false, "")];
const OPENINGS: [(&str, v1::Opening, &str); 2] = [
    (
        "golden",
        v1::Opening::Golden,
        "The holder of the Golden card, which must be played",
    ),
    (
        "any_top_face",
        v1::Opening::AnyTopFace,
        "The first seat from a random one that holds the highest face, which must be played",
    ),
];
const PASS_SCOPES: [(&str, v1::PassScope, &str); 2] = [
    ("pizza", v1::PassScope::Pizza, "Until the next pizza"),
    ("turn", v1::PassScope::Turn, "For that turn only"),
];

impl RulesArgs {
    /// Whether no flag changes the default.
    pub fn are_standard(&self) -> bool {
        let standard = v1::RuleSet {
            preset: RuleSetSpec::PRESETS[0].to_owned(),
            ..v1::RuleSet::default()
        };
        self.message() == standard
    }

    /// The rule set for the server; fields that are not given are left to the preset.
    pub fn message(&self) -> v1::RuleSet {
        use v1::rule_set::Stop;
        v1::RuleSet {
            preset: self.preset.clone(),
            players: self.players,
            faces: self.faces,
            jokers: self.jokers,
            stop: (self.target_points.map(Stop::TargetPoints))
                .or(self.target_shifts.map(Stop::TargetShifts)),
            points: self.points.clone(),
            exchange: self.exchange.or(self.no_exchange.then_some(false)),
            special_actions: (self.special_actions).or(self.no_special_actions.then_some(false)),
            opening: self.opening.unwrap_or_default().into(),
            opening_pass: self.opening_pass,
            pass_scope: self.pass_scope.unwrap_or_default().into(),
            max_idle_pizzas: self.max_idle_pizzas,
            max_turns: self.max_turns,
        }
    }

    /// The validated rule set.
    ///
    /// # Errors
    /// The first invalid flag.
    pub fn rules(&self) -> Result<RuleSet, CommandError> {
        rules_of(&self.message())
    }
}

/// Validates the rule set of a message made from flags.
///
/// # Errors
/// The first invalid flag.
pub fn rules_of(message: &v1::RuleSet) -> Result<RuleSet, CommandError> {
    rules_from_proto(message).map_err(|problem| by_flag(problem.field, &problem.message).into())
}

/// The problem with a field, with the flag instead of the field.
pub fn by_flag(field: &str, message: &str) -> String {
    let flag = match field {
        "reward_scheme" => "reward".to_owned(),
        "clocks" => "clock".to_owned(),
        "spectator_delay_decisions" => "spectator-delay".to_owned(),
        _ => field.replace('_', "-"),
    };
    // Some messages begin with the field.
    match message.strip_prefix(field) {
        Some(rest) if rest.starts_with(' ') => format!("--{flag}{rest}"),
        _ => format!("--{flag}: {message}"),
    }
}

#[cfg(test)]
mod tests {
    use chefshat_engine::{Opening, PassScope, Stop};
    use clap::Parser;

    use crate::rules_args::*;

    #[derive(Parser)]
    struct Only {
        #[command(flatten)]
        rules: RulesArgs,
    }

    fn spec(flags: &str) -> RuleSetSpec {
        let words = std::iter::once("test").chain(flags.split_whitespace());
        let only = Only::try_parse_from(words).expect("the flags are known");
        only.rules.rules().expect("the rules make sense").spec()
    }

    #[test]
    fn every_flag_sets_its_field() {
        let paper = spec("");
        let standard = RuleSetSpec::default()
            .validate()
            .expect("the standard")
            .spec();
        assert_eq!(paper, standard);
        assert_eq!(spec("--preset rulebook").points, [3, 2, 1, 0]);
        let changed = spec(
            "--players 3 --faces 9 --jokers 1 --target-shifts 7 --points 4,2,0 --exchange off --special-actions off \
             --opening any_top_face --opening-pass allowed --pass-scope turn --max-idle-pizzas 5 --max-turns 99",
        );
        let expected = RuleSetSpec {
            players: 3,
            faces: 9,
            jokers: 1,
            stop: Stop::Shifts(7),
            points: vec![4, 2, 0],
            exchange: false,
            special_actions: false,
            opening: Opening::AnyTopFace,
            opening_pass: true,
            pass_scope: PassScope::Turn,
            max_idle_pizzas: 5,
            max_turns: 99,
        };
        assert_eq!(changed, expected);
        let back = spec(
            "--preset original2020 --opening golden --opening-pass forbidden --pass-scope pizza",
        );
        assert_eq!(back, standard);
    }

    #[test]
    fn errors_name_the_flag() {
        let only = Only::try_parse_from(["test", "--faces", "3"]).expect("a number");
        let problem = only.rules.rules().expect_err("three faces are too few");
        assert!(problem.to_string().starts_with("--faces: "), "{problem}");
        let only = Only::try_parse_from(["test", "--max-turns", "0"]).expect("a number");
        let problem = only.rules.rules().expect_err("no turns are too few");
        assert!(
            problem.to_string().starts_with("--max-turns is 0"),
            "{problem}"
        );
        assert_eq!(by_flag("reward_scheme", "odd"), "--reward: odd");
    }
}
