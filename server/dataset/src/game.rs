//! The game of a row, from the header and footer of its record.

use std::sync::{Arc, OnceLock};

use chefshat_engine::RuleSet;
use chefshat_proto::v1::{self, record_line::Line};

use chefshat_record::convert::{has_real_cards, kind_name, rules_from_proto};
use chefshat_record::replay::{ReplayError, replay};

/// The origin of imported games.
pub(super) const IMPORTED: &str = "imported";

/// The values shared by all rows of a game.
#[derive(Debug)]
pub(super) struct GameInfo {
    pub(super) game_id: String,
    pub(super) room_name: String,
    pub(super) origin: &'static str,
    /// Whether it was played with real cards, so that some may be unknown.
    pub(super) real_cards: bool,
    pub(super) rules: String,
    pub(super) rule_set: RuleSet,
    pub(super) rules_version: u32,
    /// Microseconds since the Unix epoch; `None` for a simulated game.
    pub(super) created_at: Option<i64>,
    pub(super) finished: bool,
    pub(super) players: u8,
    /// Size of the action space.
    pub(super) actions: u16,
    pub(super) server_version: String,
    /// Where it belongs in a study.
    pub(super) study: Option<v1::StudyRecord>,
    /// The public key of the record's signature, which the replay verifies.
    pub(super) signed_by: OnceLock<String>,
    /// The participants at the start of the game, by seat.
    pub(super) seats: Vec<Arc<SeatInfo>>,
}

/// A participant.
#[derive(Debug)]
pub(super) struct SeatInfo {
    pub(super) name: String,
    /// The fingerprint of the name and its key, if it has one.
    pub(super) name_fingerprint: Option<String>,
    pub(super) kind: &'static str,
    /// As what it was shown, if a person played the seat as another kind.
    pub(super) shown_kind: Option<&'static str>,
    pub(super) built_in: Option<String>,
}

impl SeatInfo {
    /// `built_in` is empty unless the participant is a built-in agent.
    pub(super) fn new(name: &str, kind: v1::ParticipantKind, built_in: &str) -> Self {
        let built_in = Some(built_in).filter(|name| !name.is_empty());
        Self {
            name: name.to_owned(),
            name_fingerprint: None,
            kind: built_in.map_or_else(|| kind_name(kind), |_| "built_in"),
            shown_kind: None,
            built_in: built_in.map(str::to_owned),
        }
    }

    /// A participant of a seat that a person plays as this kind.
    pub(super) fn wizard(name: &str, shown: v1::ParticipantKind) -> Self {
        Self {
            shown_kind: Some(kind_name(shown)),
            ..Self::new(name, v1::ParticipantKind::Human, "")
        }
    }

    fn of(seat: &v1::Participant) -> Self {
        let info = match seat.shown_kind() {
            v1::ParticipantKind::Unspecified => {
                Self::new(&seat.name, seat.kind(), &seat.built_in_agent)
            }
            shown => Self::wizard(&seat.name, shown),
        };
        let fingerprint = Some(&seat.name_fingerprint).filter(|it| !it.is_empty());
        Self {
            name_fingerprint: fingerprint.cloned(),
            ..info
        }
    }
}

/// Reads the header and footer of a record, before its replay.
///
/// # Errors
/// The first wrong line, if these lines are invalid.
pub(super) fn checked_info(lines: &[v1::RecordLine]) -> Result<GameInfo, ReplayError> {
    // The replay reports invalid lines more precisely.
    game_info(lines).or_else(|error| replay(lines).and(Err(error)))
}

fn game_info(lines: &[v1::RecordLine]) -> Result<GameInfo, ReplayError> {
    let at_header = |problem: String| ReplayError { line: 1, problem };
    let Some(Line::Header(header)) = lines.first().and_then(|line| line.line.as_ref()) else {
        return Err(at_header("the first line must be the header".into()));
    };
    // It becomes the name of a folder.
    if hex::decode_to_slice(&header.game_id, &mut [0; 16]).is_err() {
        return Err(at_header(format!(
            "the game id {:?} is not 32 hexadecimal digits",
            header.game_id
        )));
    }
    let rules = header
        .rules
        .as_ref()
        .ok_or_else(|| at_header("the header has no rule set".into()))?;
    let rule_set = rules_from_proto(rules).map_err(|error| at_header(error.to_string()))?;
    if header.seats.len() != rule_set.players() {
        return Err(at_header(format!(
            "the header has {} seats, but the rule set has {} players",
            header.seats.len(),
            rule_set.players()
        )));
    }
    let footer = match lines.last().and_then(|line| line.line.as_ref()) {
        Some(Line::Footer(footer)) => Some(footer),
        _ => None,
    };
    Ok(GameInfo {
        game_id: header.game_id.clone(),
        room_name: header.room_name.clone(),
        origin: match header.origin() {
            v1::GameOrigin::Unspecified | v1::GameOrigin::Dealt => "dealt",
            v1::GameOrigin::FixedSeed => "fixed_seed",
            v1::GameOrigin::Scripted => "scripted",
            v1::GameOrigin::Branched => "branched",
            v1::GameOrigin::Imported => IMPORTED,
            v1::GameOrigin::Physical => "physical",
        },
        real_cards: has_real_cards(header.origin()),
        rules: serde_json::to_string(rules).map_err(|error| at_header(error.to_string()))?,
        rules_version: header.rules_version,
        created_at: i64::try_from(header.created_at_ms)
            .ok()
            .filter(|at| *at > 0)
            .and_then(|at| at.checked_mul(1000)),
        finished: footer.is_some_and(|footer| footer.state() == v1::RoomState::Finished),
        players: u8::try_from(rule_set.players()).expect("at most six players"),
        actions: rule_set.actions().size(),
        rule_set,
        server_version: header.server_version.clone(),
        study: header.study.clone(),
        signed_by: OnceLock::new(),
        seats: (header.seats.iter())
            .map(SeatInfo::of)
            .map(Arc::new)
            .collect(),
    })
}
