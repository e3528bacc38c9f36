//! The header of a game.

use std::collections::BTreeMap;
use std::sync::Arc;

use chefshat_engine::{ActionId, MAX_SEATS, Seat, SeedPlan};
use chefshat_proto::v1;
use chefshat_record::convert::{FieldProblem, rules_from_proto, rules_to_proto, seat_number};
use prost::Message;
use prost::encoding::{DecodeContext, decode_key, skip_field};

use super::entry::{number_of, value_of};
use super::{Unreadable, action, array, check_form};
use crate::units::{UnitKey, UnitKind};
use chefshat_room::ids::{Id, SecretHash};
use chefshat_room::journal::{GameHeader, SeatLabels, StudyGame, StudyMember, TournamentGame};
use chefshat_wire::convert;

#[derive(Clone, PartialEq, Message)]
struct HeaderForm {
    #[prost(bytes = "vec", tag = "1")]
    room_id: Vec<u8>,
    #[prost(bytes = "vec", tag = "2")]
    game_id: Vec<u8>,
    #[prost(string, tag = "3")]
    name: String,
    #[prost(message, optional, tag = "4")]
    rules: Option<v1::RuleSet>,
    #[prost(uint32, tag = "5")]
    rules_version: u32,
    #[prost(message, optional, tag = "6")]
    policy: Option<v1::RoomPolicy>,
    #[prost(message, repeated, tag = "7")]
    seats: Vec<v1::SeatConfig>,
    #[prost(bytes = "vec", tag = "8")]
    server_seed: Vec<u8>,
    #[prost(bytes = "vec", tag = "9")]
    nonce: Vec<u8>,
    #[prost(bytes = "vec", tag = "10")]
    fixed_game_seed: Vec<u8>,
    #[prost(uint64, tag = "11")]
    created_at_ms: u64,
    #[prost(string, tag = "12")]
    join_code: String,
    #[prost(bytes = "vec", tag = "13")]
    owner: Vec<u8>,
    #[prost(message, optional, tag = "14")]
    start: Option<v1::GameStart>,
    #[prost(uint32, repeated, tag = "15")]
    actions_taken_over: Vec<u32>,
    #[prost(bytes = "vec", tag = "16")]
    tournament: Vec<u8>,
    #[prost(bytes = "vec", tag = "17")]
    series: Vec<u8>,
    /// The hash of the table's ticket; empty unless the room is physical.
    #[prost(bytes = "vec", tag = "18")]
    table: Vec<u8>,
    #[prost(message, optional, tag = "19")]
    study: Option<StudyForm>,
    /// Empty: `FIRST_VERSION`.
    #[prost(string, tag = "20")]
    server_version: String,
    #[prost(bool, tag = "21")]
    participant_removed: bool,
}

/// The tag of `HeaderForm::owner`.
const OWNER: u32 = 13;
/// Bytes of a header that are enough to read its owner: what may be long, the actions of a branch,
/// comes after it.
pub(crate) const OWNER_WITHIN: i32 = 8 * 1024;

/// The version of the server whose headers do not name it.
const FIRST_VERSION: &str = "0.1.0";

#[derive(Clone, PartialEq, Message)]
struct StudyForm {
    #[prost(bytes = "vec", tag = "1")]
    study: Vec<u8>,
    #[prost(string, tag = "2")]
    name: String,
    #[prost(string, tag = "3")]
    condition: String,
    #[prost(btree_map = "string, string", tag = "4")]
    levels: BTreeMap<String, String>,
    #[prost(uint32, tag = "5")]
    number: u32,
    #[prost(string, tag = "6")]
    participant: String,
    #[prost(uint32, tag = "7")]
    session: u32,
    #[prost(uint32, tag = "8")]
    step: u32,
    #[prost(bool, tag = "9")]
    practice: bool,
    #[prost(uint32, optional, tag = "10")]
    seed_index: Option<u32>,
    #[prost(uint32, tag = "11")]
    seat: u32,
    #[prost(uint32, tag = "12")]
    attempt: u32,
    #[prost(uint32, tag = "13")]
    labels: u32,
    /// 0: none.
    #[prost(uint32, tag = "14")]
    group: u32,
    /// Its participants but the first.
    #[prost(message, repeated, tag = "15")]
    others: Vec<MemberForm>,
}

#[derive(Clone, PartialEq, Message)]
struct MemberForm {
    #[prost(uint32, tag = "1")]
    number: u32,
    #[prost(string, tag = "2")]
    participant: String,
    #[prost(uint32, tag = "3")]
    session: u32,
    #[prost(uint32, tag = "4")]
    seat: u32,
}

/// The labels of seats, with their numbers.
const LABELS: [(u32, SeatLabels); 3] = [
    (1, SeatLabels::AsTheyAre),
    (2, SeatLabels::Kinds),
    (3, SeatLabels::Players),
];

/// Encodes a header.
pub(crate) fn header_to_bytes(header: &GameHeader) -> Vec<u8> {
    let (server_seed, nonce, fixed_game_seed) = match header.seed {
        SeedPlan::Committed { server_seed, nonce } => {
            (server_seed.to_vec(), nonce.to_vec(), vec![])
        }
        SeedPlan::Fixed { game_seed } => (vec![], vec![], game_seed.to_vec()),
    };
    let taken_over = header.start.branch.iter().flat_map(|b| &b.taken_over);
    HeaderForm {
        room_id: header.room_id.bytes().to_vec(),
        game_id: header.game_id.bytes().to_vec(),
        name: header.name.clone(),
        rules: Some(rules_to_proto(&header.rules)),
        rules_version: header.rules_version,
        policy: Some(convert::policy_to_proto(&header.policy)),
        seats: convert::seats_to_proto(header),
        server_seed,
        nonce,
        fixed_game_seed,
        created_at_ms: header.created_at_ms,
        join_code: header.join_code.clone(),
        owner: header.owner.bytes().to_vec(),
        start: convert::start_to_proto(&header.start, header.rules.faces()),
        actions_taken_over: taken_over
            .flat_map(|part| &part.actions)
            .map(|action| action.index().into())
            .collect(),
        tournament: (header.tournament)
            .map_or_else(Vec::new, |game| game.tournament.bytes().to_vec()),
        series: (header.series()).map_or_else(Vec::new, |series| series.bytes().to_vec()),
        table: (header.table).map_or_else(Vec::new, |table| table.bytes().to_vec()),
        study: header.study.as_deref().map(study_to_form),
        server_version: header.server_version.clone(),
        participant_removed: header.participant_removed,
    }
    .encode_to_vec()
}

fn study_to_form(game: &StudyGame) -> StudyForm {
    let mut members = game.members.iter().map(|member| MemberForm {
        number: member.number,
        participant: member.participant.clone(),
        session: member.session,
        seat: seat_number(member.seat),
    });
    let first = members.next().unwrap_or_default();
    StudyForm {
        study: game.study.bytes().to_vec(),
        name: game.name.clone(),
        condition: game.condition.clone(),
        levels: game.levels.clone(),
        number: first.number,
        participant: first.participant,
        session: first.session,
        step: game.step,
        practice: game.practice,
        seed_index: game.seed_index,
        seat: first.seat,
        attempt: game.attempt,
        labels: number_of(&LABELS, &game.labels),
        group: game.group.unwrap_or(0),
        others: members.collect(),
    }
}

fn member_from_form(form: MemberForm) -> Result<StudyMember, Unreadable> {
    let seat = usize::try_from(form.seat).ok();
    let seat = seat.filter(|seat| *seat < MAX_SEATS);
    let seat = seat.ok_or_else(|| Unreadable::new("the participant's seat does not exist"))?;
    Ok(StudyMember {
        number: form.number,
        participant: form.participant,
        session: form.session,
        seat: Seat::new(seat),
    })
}

fn study_from_form(form: StudyForm) -> Result<StudyGame, Unreadable> {
    let first = MemberForm {
        number: form.number,
        participant: form.participant,
        session: form.session,
        seat: form.seat,
    };
    let members = std::iter::once(first).chain(form.others);
    Ok(StudyGame {
        study: Id::from_bytes(array(&form.study, "the study's id")?),
        name: form.name,
        condition: form.condition,
        levels: form.levels,
        members: members.map(member_from_form).collect::<Result<_, _>>()?,
        group: Some(form.group).filter(|group| *group > 0),
        step: form.step,
        practice: form.practice,
        seed_index: form.seed_index,
        attempt: form.attempt,
        labels: value_of(&LABELS, form.labels, "labels of seats")?,
    })
}

/// Decodes the header of a hosted game.
///
/// # Errors
/// It is missing, or has an invalid field.
pub(crate) fn stored_header(bytes: Option<&[u8]>) -> Result<GameHeader, Unreadable> {
    header_from_bytes(bytes.ok_or_else(|| Unreadable::new("its header is missing"))?)
}

/// The tournament or study that a stored game is part of, if any. An imported game has no header and
/// is part of nothing here.
///
/// # Errors
/// This version cannot read it.
pub(crate) fn stored_unit(form: i64, header: Option<&[u8]>) -> Result<Option<UnitKey>, Unreadable> {
    check_form(form)?;
    let Some(header) = header else {
        return Ok(None);
    };
    let header = HeaderForm::decode(header)?;
    let (kind, id) = match header.study {
        Some(study) => (UnitKind::Study, study.study),
        None => (UnitKind::Tournament, header.tournament),
    };
    match id.is_empty() {
        true => Ok(None),
        false => array(&id, "the id of what it is part of").map(|id| Some(kind.unit(id))),
    }
}

/// The owner's hash in a header, or in its first [`OWNER_WITHIN`] bytes. `None` if it cannot be read.
pub(crate) fn stored_owner(mut header: &[u8]) -> Option<SecretHash> {
    let context = DecodeContext::default();
    loop {
        let (tag, kind) = decode_key(&mut header).ok()?;
        if tag == OWNER {
            let mut owner = Vec::new();
            prost::encoding::bytes::merge(kind, &mut owner, &mut header, context).ok()?;
            return array(&owner, "").ok().map(SecretHash::from_bytes);
        }
        skip_field(kind, tag, &mut header, context.clone()).ok()?;
    }
}

/// Decodes a header.
///
/// # Errors
/// An invalid field.
pub(crate) fn header_from_bytes(bytes: &[u8]) -> Result<GameHeader, Unreadable> {
    let form = HeaderForm::decode(bytes)?;
    let field = |problem: FieldProblem| Unreadable(problem.to_string());
    let rules = rules_from_proto(&form.rules.unwrap_or_default()).map_err(field)?;
    let actions = form.actions_taken_over.iter().copied().map(action);
    let actions: Vec<ActionId> = actions.collect::<Result<_, _>>()?;
    let start = form.start.unwrap_or_default();
    Ok(GameHeader {
        room_id: Id::from_bytes(array(&form.room_id, "the room's id")?),
        game_id: Id::from_bytes(array(&form.game_id, "the game's id")?),
        name: form.name,
        rules_version: form.rules_version,
        server_version: match form.server_version.as_str() {
            "" => FIRST_VERSION.into(),
            _ => form.server_version,
        },
        policy: convert::policy_from_proto(&form.policy.unwrap_or_default()).map_err(field)?,
        fills: convert::fills_from_proto(&form.seats, &rules).map_err(field)?,
        wizards: convert::wizards_from_proto(&form.seats),
        // Not checked again: stored games stay readable even if the rules for names change.
        display_names: (form.seats.into_iter().enumerate())
            .filter(|(_, seat)| !seat.name.is_empty())
            .map(|(seat, config)| (seat, config.name))
            .collect(),
        recorded: BTreeMap::new(),
        start: convert::start_from_proto(&start, &actions, &rules).map_err(field)?,
        rules,
        seed: if form.fixed_game_seed.is_empty() {
            SeedPlan::Committed {
                server_seed: array(&form.server_seed, "the server's seed")?,
                nonce: array(&form.nonce, "the nonce")?,
            }
        } else {
            SeedPlan::Fixed {
                game_seed: array(&form.fixed_game_seed, "the game seed")?,
            }
        },
        created_at_ms: form.created_at_ms,
        participant_removed: form.participant_removed,
        join_code: form.join_code,
        owner: SecretHash::from_bytes(array(&form.owner, "the owner's hash")?),
        table: match form.table.as_slice() {
            [] => None,
            hash => Some(SecretHash::from_bytes(array(hash, "the table's hash")?)),
        },
        study: (form.study.map(study_from_form).transpose()?).map(Arc::new),
        tournament: if form.tournament.is_empty() {
            None
        } else {
            Some(TournamentGame {
                tournament: Id::from_bytes(array(&form.tournament, "the tournament's id")?),
                series: match form.series.as_slice() {
                    [] => None,
                    series => Some(Id::from_bytes(array(series, "the series' id")?)),
                },
            })
        },
    })
}
