//! Settings of tournaments, checked, and tournaments as messages.

use chefshat_agents::{AgentKind, NamedAgent};
use chefshat_engine::RuleSet;
use chefshat_proto::v1;
use chefshat_record::convert::{FieldProblem, rules_from_proto, rules_to_proto};
use chefshat_referee::Referee;
use chefshat_tournament::{
    Deals, Format, Game, GameState, MAX_PARTICIPANTS, ParticipantKind, Settings, Tournament,
};

use super::agent::{agent_from_proto, check_real_cards};
use super::mirrored::{Mirrored as _, kind_to_proto};
use super::number;
use super::policy::{policy_from_proto, policy_to_proto};
use chefshat_room::ids::{GameId, RoomId, SeriesId};
use chefshat_room::policy::{AbortPolicy, Policy};

/// Defaults of fields that a request leaves unset.
const DEFAULT_PARTICIPANTS: u32 = 64;
const DEFAULT_NO_SHOW_MS: u32 = 60_000;
const DEFAULT_CALLS: u32 = 2;
const DEFAULT_PARALLEL: u32 = 64;

/// The checked settings of a tournament.
#[derive(Debug)]
pub struct TournamentPlan {
    /// The settings of its core.
    pub core: Settings,
    /// The rules of all games.
    pub rules: RuleSet,
    /// The policy of all games.
    pub policy: Policy,
    /// Kinds that may join; empty: all.
    pub kinds: Vec<ParticipantKind>,
    /// The built-in agents that take part.
    pub built_in: Vec<NamedAgent>,
    /// The seed of all deals, if the owner sets it.
    pub deal_seed: Option<[u8; 32]>,
    /// When it starts by itself, milliseconds since the Unix epoch.
    pub start_at_ms: Option<u64>,
}

/// Checks the settings of a new tournament and fills in defaults. `draw_seed` is used if the
/// request has no seed.
///
/// # Errors
/// The first invalid field.
pub fn tournament_plan(
    message: &v1::TournamentSettings,
    draw_seed: [u8; 32],
) -> Result<TournamentPlan, FieldProblem> {
    let rules = rules_from_proto(&message.rules.clone().unwrap_or_default())
        .map_err(|problem| FieldProblem::new("rules", problem.to_string()))?;
    let deals = Deals::from_proto("deals", message.deals)?.unwrap_or_default();
    let standard = |value: u32, standard: u32| if value == 0 { standard } else { value };
    let count = |value: u32| usize::try_from(value).unwrap_or(usize::MAX);
    let no_show_ms = standard(message.no_show_time_ms, DEFAULT_NO_SHOW_MS);
    let built_in: Vec<NamedAgent> = (message.built_in_agents.iter())
        .map(|name| {
            agent_from_proto("built_in_agents", name)?
                .ok_or_else(|| FieldProblem::new("built_in_agents", "a built-in agent has no name"))
        })
        .collect::<Result<_, _>>()?;
    let max_participants = standard(message.max_participants, DEFAULT_PARTICIPANTS);
    if built_in.len() > count(max_participants).min(MAX_PARTICIPANTS) {
        let problem = format!(
            "{} built-in agents do not fit {max_participants} participants",
            built_in.len()
        );
        return Err(FieldProblem::new("built_in_agents", problem));
    }
    let physical_tables = count(message.physical_tables);
    let deal_seed = seed("deal_seed", &message.deal_seed)?;
    let filler = agent_from_proto("filler", &message.filler)?.unwrap_or(AgentKind::Random.into());
    let policy = policy(message, deals, no_show_ms)?;
    if physical_tables > 0 {
        check_real_cards("filler", filler)?;
        if policy.hints {
            let problem = "hints are not given at tables with real cards";
            return Err(FieldProblem::new("hints", problem));
        }
        check_real_cards("policy.substitute", policy.substitute)?;
        (built_in.iter()).try_for_each(|agent| check_real_cards("built_in_agents", *agent))?;
        Referee::check_rules(&rules).map_err(|problem| FieldProblem::new("rules", problem))?;
        if deal_seed.is_some() {
            let problem = "leave it unset: at a physical table the server deals nothing";
            return Err(FieldProblem::new("deal_seed", problem));
        }
    }
    Ok(TournamentPlan {
        core: Settings {
            format: Format::from_proto("format", message.format)?
                .ok_or_else(|| FieldProblem::new("format", "set knockout, round robin or swiss"))?,
            players: rules.players(),
            points: rules.points_slice().to_vec(),
            rounds: (message.rounds != 0).then_some(message.rounds),
            games_per_pairing: standard(message.games_per_pairing, 1),
            deals,
            max_participants: count(max_participants),
            start_when_joined: (message.start_when_joined != 0)
                .then(|| count(message.start_when_joined)),
            no_show_ms: no_show_ms.into(),
            max_calls: standard(message.max_calls, DEFAULT_CALLS),
            max_parallel: count(standard(message.max_parallel_games, DEFAULT_PARALLEL)),
            physical_tables,
            draw_seed: seed("draw_seed", &message.draw_seed)?.unwrap_or(draw_seed),
            filler,
        },
        policy,
        kinds: (message.kinds.iter())
            .map(|kind| {
                ParticipantKind::from_proto("kinds", *kind)?
                    .ok_or_else(|| FieldProblem::new("kinds", "a kind is unspecified"))
            })
            .collect::<Result<_, _>>()?,
        rules,
        built_in,
        deal_seed,
        start_at_ms: (message.start_at_ms != 0).then_some(message.start_at_ms),
    })
}

fn seed(name: &'static str, bytes: &[u8]) -> Result<Option<[u8; 32]>, FieldProblem> {
    if bytes.is_empty() {
        return Ok(None);
    }
    bytes.try_into().map(Some).map_err(|_| {
        let problem = format!("{} bytes; give 32, or none", bytes.len());
        FieldProblem::new(name, problem)
    })
}

/// The policy of all games. Fields that a tournament sets itself must be unset or agree with it.
fn policy(
    message: &v1::TournamentSettings,
    deals: Deals,
    no_show_ms: u32,
) -> Result<Policy, FieldProblem> {
    let refuse = |problem: String| Err(FieldProblem::new("policy", problem));
    let mut asked = message.policy.clone().unwrap_or_default();
    if ![v1::AbortPolicy::Unspecified, v1::AbortPolicy::Never].contains(&asked.abort()) {
        return refuse(
            "abort: games of a tournament continue with substitutes; leave it unset".into(),
        );
    }
    if asked.waiting_time_ms.is_some_and(|time| time != no_show_ms) {
        return refuse("waiting_time_ms: set no_show_time_ms of the tournament instead".into());
    }
    if deals != Deals::Independent {
        if asked.spectators == Some(true) {
            return refuse(
                "spectators: a spectator of one game would see the cards of others with the same deal".into(),
            );
        }
        asked.spectators = Some(false);
    }
    if deals == Deals::SameAtAllTables && asked.durability() == v1::Durability::Ephemeral {
        return refuse(
            "durability: a lost game would be dealt again to participants who have seen its cards"
                .into(),
        );
    }
    asked.abort = v1::AbortPolicy::Never.into();
    asked.waiting_time_ms = Some(no_show_ms);
    let policy = policy_from_proto(&asked);
    let policy = policy.map_err(|problem| FieldProblem::new("policy", problem.to_string()))?;
    debug_assert_eq!(policy.abort, AbortPolicy::Never);
    Ok(policy)
}

/// The settings of a tournament, every field set.
pub fn settings_to_proto(name: &str, plan: &TournamentPlan) -> v1::TournamentSettings {
    let core = &plan.core;
    v1::TournamentSettings {
        name: name.to_owned(),
        format: core.format.to_proto().into(),
        rules: Some(rules_to_proto(&plan.rules)),
        policy: Some(policy_to_proto(&plan.policy)),
        rounds: core.rounds.unwrap_or(0),
        games_per_pairing: core.games_per_pairing,
        deals: core.deals.to_proto().into(),
        kinds: (plan.kinds.iter())
            .map(|kind| kind_to_proto(Some(*kind)))
            .collect(),
        max_participants: number(core.max_participants),
        built_in_agents: (plan.built_in.iter()).map(|kind| kind.name()).collect(),
        start_when_joined: core.start_when_joined.map_or(0, number),
        no_show_time_ms: u32::try_from(core.no_show_ms).unwrap_or(u32::MAX),
        max_calls: core.max_calls,
        max_parallel_games: number(core.max_parallel),
        draw_seed: core.draw_seed.to_vec(),
        filler: core.filler.name().to_owned(),
        deal_seed: (plan.deal_seed).map_or_else(Vec::new, |seed| seed.to_vec()),
        physical_tables: number(core.physical_tables),
        start_at_ms: plan.start_at_ms.unwrap_or(0),
    }
}

/// The participants of a tournament.
pub fn tournament_participants(tournament: &Tournament) -> Vec<v1::TournamentParticipant> {
    let entrants = tournament.participants().iter().enumerate();
    entrants
        .map(|(index, entrant)| v1::TournamentParticipant {
            participant: number(index),
            name: entrant.name.clone(),
            kind: kind_to_proto(Some(entrant.kind)),
            built_in_agent: (entrant.built_in).map_or_else(String::new, |kind| kind.name()),
            filler: entrant.filler,
            stateless: entrant.stateless,
            max_games: number(entrant.max_games),
            connected: tournament.is_present(index) && !tournament.is_withdrawn(index),
            at_table: entrant.at_table,
            name_fingerprint: entrant.name_fingerprint.clone(),
            withdrawn: tournament.is_withdrawn(index),
            former: (tournament.former(index).iter())
                .map(|former| v1::FormerParticipant {
                    name: former.entrant.name.clone(),
                    kind: kind_to_proto(Some(former.entrant.kind)),
                    built_in_agent: (former.entrant.built_in)
                        .map_or_else(String::new, |kind| kind.name()),
                    games: former.games,
                })
                .collect(),
        })
        .collect()
}

/// A game of a tournament. `placed` is its room and game id.
pub fn tournament_game(
    index: usize,
    tournament: &Tournament,
    placed: Option<(RoomId, GameId)>,
    series: Option<SeriesId>,
    plan: &TournamentPlan,
) -> v1::TournamentGame {
    let game = &tournament.games()[index];
    let former_name = |participant| {
        let name = tournament.former_name(game, participant);
        name.unwrap_or_default().to_owned()
    };
    let seats = match &game.state {
        GameState::Counted(result) => (result.seats.iter())
            .map(|seat| v1::TournamentGameSeat {
                participant: number(seat.participant),
                forfeited: seat.forfeited,
                substituted: seat.statistics.substituted,
                place: number(seat.statistics.place),
                score: seat.score,
                points: seat.statistics.points,
                decisions: seat.statistics.decisions,
                wrong_actions: seat.statistics.wrong_actions,
                timeouts: seat.statistics.timeouts,
                decision_time_us: seat.statistics.decision_time_us,
                timed_decisions: seat.statistics.timed_decisions,
                performance_score: seat.statistics.performance_score,
                left: game.left.contains(&seat.participant),
                former_name: former_name(seat.participant),
            })
            .collect(),
        _ => (game.seats.iter())
            .map(|participant| v1::TournamentGameSeat {
                participant: number(*participant),
                forfeited: game.forfeited.contains(participant),
                left: game.left.contains(participant),
                former_name: former_name(*participant),
                ..v1::TournamentGameSeat::default()
            })
            .collect(),
    };
    let result = game.result();
    v1::TournamentGame {
        game: number(index),
        round: game.round,
        table: game.table,
        number: game.number,
        state: match game.state {
            GameState::Due => v1::TournamentGameState::Due,
            GameState::Playing => v1::TournamentGameState::Playing,
            GameState::Counted(_) => v1::TournamentGameState::Counted,
            GameState::Void => v1::TournamentGameState::Void,
        }
        .into(),
        seats,
        room_id: placed.map_or_else(String::new, |(room, _)| room.to_string()),
        game_id: placed.map_or_else(String::new, |(_, game)| game.to_string()),
        calls: game.calls,
        series_id: series.map_or_else(String::new, |series| series.to_string()),
        rated: is_rated(game, plan),
        shifts: result.map_or(0, |result| result.shifts),
        physical: game.physical,
        postponed: number(game.postponed.len()),
    }
}

/// Whether a game counts for ratings: it has a result, the server chose its deals, and no
/// participant was replaced.
pub fn is_rated(game: &Game, plan: &TournamentPlan) -> bool {
    game.is_rated() && plan.deal_seed.is_none()
}
