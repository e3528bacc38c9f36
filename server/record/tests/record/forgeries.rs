//! Forgeries: what replaying a record shows to be wrong, what only its signature shows, and what
//! neither can. `docs/records.md` has the same list; a test compares the two.

use std::path::Path;
use std::sync::Arc;

use crate::fixture;
use chefshat_engine::{BySeat, Game, PlayedDecision, Seed};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};
use chefshat_record::convert::{Played, reward_scheme_from_proto, rules_from_proto};
use chefshat_record::jsonl;
use chefshat_record::pseudonym::{Named, Pseudonym};
use chefshat_record::replay::replay;
use chefshat_record::signature::{PublicKey, SigningKey, signer};
use chefshat_record::testing::{aborted, footer, header};

use Outcome::{Believed, Replay, Signature};

type Lines = Vec<v1::RecordLine>;

/// How a forgery is caught.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Outcome {
    /// By replaying the record, signed or not.
    Replay,
    /// Only by the signature: an unsigned record that is forged so is accepted.
    Signature,
    /// Not at all.
    Believed,
}

/// What is forged, as in the docs; how it is caught; and the change.
type Forgery = (&'static str, Outcome, fn(&mut Lines));

/// The forgeries. Numbers of lines are those of
/// the fixture `committed.jsonl`, from 1.
#[rustfmt::skip] // One row each.
const FORGERIES: [Forgery; 47] = [
    // The deal.
    ("a card of a hand", Replay, |lines| if let Kind::ShiftStarted(shift) = kind(lines, 5) { shift.hands[1].cards[0] = 4 }),
    ("the hands of two seats exchanged", Replay, |lines| if let Kind::ShiftStarted(shift) = kind(lines, 5) { shift.hands.swap(0, 1) }),
    ("the holder of the Golden card", Replay, |lines| if let Kind::ShiftStarted(shift) = kind(lines, 5) { shift.hands[2].golden = false }),
    ("another server seed", Replay, |lines| reveal(lines).server_seed[0] ^= 1),
    ("another nonce", Replay, |lines| reveal(lines).nonce[0] ^= 1),
    ("the bytes of a seat", Replay, |lines| reveal(lines).seat_entropy[2][0] ^= 1),
    ("another commitment", Replay, |lines| header(lines).seed_commitment[0] ^= 1),
    ("the seed as fixed by the creator, without commitment", Signature, fixed_seed),
    // Decisions.
    ("another action", Replay, |lines| decision(lines, 8).action = 199),
    ("another action with its event", Replay, |lines| { decision(lines, 8).action = 199; decision(lines, 8).text = "pass".into(); *kind(lines, 9) = Kind::Pass(v1::Pass { seat: 3, source: 1, decision_time_us: 1_277 }) }),
    ("a decision left out", Replay, |lines| drop(lines.drain(7..9))),
    ("a decision added", Replay, |lines| { let again = lines[7].clone(); lines.insert(8, again) }),
    ("another seat as the one that decided", Replay, |lines| decision(lines, 8).seat = 0),
    ("a legal action as illegal", Replay, |lines| decision(lines, 8).action_mask[24] = 0),
    ("an illegal attempt added", Signature, |lines| { decision(lines, 8).invalid_attempts = vec![0]; decision(lines, 8).invalid_reward = Some(-1.0) }),
    ("an attempt left out where the limit was reached", Replay, |lines| { decision(lines, 10).invalid_attempts.pop(); }),
    ("other illegal attempts", Signature, |lines| decision(lines, 10).invalid_attempts[0] = 84),
    // Sources and times.
    ("a pass of the agent as a timeout before its time was up", Replay, |lines| source(lines, 16, v1::DecisionSource::Timeout)),
    ("a timeout as the agent's own pass", Replay, |lines| source(lines, 21, v1::DecisionSource::Agent)),
    ("a timeout as a lost connection", Replay, |lines| source(lines, 21, v1::DecisionSource::Disconnected)),
    ("a decision of the agent as the substitute's", Replay, |lines| source(lines, 8, v1::DecisionSource::Substitute)),
    ("a decision of the substitute as the agent's", Replay, |lines| source(lines, 69, v1::DecisionSource::Agent)),
    ("a decision time longer than the time that passed", Replay, |lines| time(lines, 8, 9_000_000)),
    ("a decision time longer than the seat had", Replay, |lines| { shift_clock(lines, 6, 1_000); time(lines, 6, 900_000) }),
    ("a shorter decision time", Signature, |lines| time(lines, 8, 12)),
    ("more in the time bank", Replay, |lines| decision(lines, 14).bank_left_ms = 30),
    ("all later times moved", Signature, |lines| shift_clock(lines, 8, 5_000)),
    ("a time before an earlier one", Replay, |lines| decision(lines, 14).elapsed_ms = 3),
    // Seats and connections.
    ("a dropped substitution", Replay, |lines| without_event(lines, 51)),
    ("a substitution added", Replay, |lines| with_event(lines, 380, Kind::Substituted(v1::Substituted { seat: 3, built_in_agent: "random".into(), for_good: false }))),
    ("a participant left for good, where none can", Replay, |lines| with_event(lines, 380, Kind::Substituted(v1::Substituted { seat: 3, built_in_agent: "random".into(), for_good: true }))),
    ("a lost connection added", Signature, |lines| with_event(lines, 380, Kind::Disconnected(v1::Disconnected { seat: 3, ..v1::Disconnected::default() }))),
    ("a decision ended by an absence shorter than the absence time", Replay, short_absence),
    ("another name everywhere", Signature, rename),
    ("another name at one place", Replay, |lines| header(lines).seats[3].name = "Rosa".into()),
    ("another kind of participant everywhere", Signature, another_kind),
    // What participants added.
    ("annotations added", Signature, |lines| decision(lines, 8).annotations = Some(v1::Annotations { value_estimate: Some(0.5), ..v1::Annotations::default() })),
    ("annotations above the limit", Replay, |lines| decision(lines, 8).annotations = Some(v1::Annotations { extra: [("note".to_owned(), "x".repeat(5_000))].into(), ..v1::Annotations::default() })),
    ("an expression added", Signature, |lines| with_event(lines, 380, Kind::ExpressionShown(Box::new(v1::ExpressionShown { seat: 3, expression: Some(v1::Expression { label: "joy".into(), ..v1::Expression::default() }) })))),
    // The room.
    ("another date", Signature, |lines| header(lines).created_at_ms += 86_400_000),
    ("another policy everywhere", Signature, another_policy),
    ("another room, tournament or series", Signature, |lines| { header(lines).room_name = "final".into(); header(lines).tournament_id = "0".repeat(32) }),
    // The result.
    ("another winner", Replay, |lines| if let Kind::GameEnded(ended) = kind(lines, 492) { ended.standings[0].seat = 1 }),
    ("other decisions on the same deal", Signature, other_decisions),
    ("cut short and called aborted", Signature, cut_short),
    ("a reward", Replay, |lines| if let Some(Line::Event(event)) = &mut lines[8].line { event.rewards[0].value = 1.0 }),
    ("the record signed again with another key", Believed, |lines| { let signature = SigningKey::from_seed(&[9; 32]).sign(lines); footer(lines).signature = Some(signature) }),
];

fn decision(lines: &mut Lines, line: usize) -> &mut v1::DecisionRecord {
    match &mut lines[line - 1].line {
        Some(Line::Decision(decision)) => decision,
        other => panic!("{other:?}"),
    }
}

fn kind(lines: &mut Lines, line: usize) -> &mut Kind {
    match &mut lines[line - 1].line {
        Some(Line::Event(event)) => event.kind.as_mut().expect("an event"),
        other => panic!("{other:?}"),
    }
}

fn reveal(lines: &mut Lines) -> &mut v1::SeedReveal {
    match kind(lines, 492) {
        Kind::GameEnded(ended) => ended.reveal.as_mut().expect("a reveal"),
        other => panic!("{other:?}"),
    }
}

/// Changes the source of a decision and of its event.
fn source(lines: &mut Lines, line: usize, source: v1::DecisionSource) {
    decision(lines, line).source = source.into();
    match kind(lines, line + 1) {
        Kind::Pass(pass) => pass.source = source.into(),
        Kind::Play(play) => play.source = source.into(),
        other => panic!("{other:?}"),
    }
}

/// Changes the time of a decision, in its event and in the bank too.
fn time(lines: &mut Lines, line: usize, time_us: u64) {
    let decision = decision(lines, line);
    decision.decision_time_us = time_us;
    let beyond_ms = u32::try_from(time_us / 1000)
        .expect("small")
        .saturating_sub(10);
    decision.bank_left_ms = 60_u32.saturating_sub(beyond_ms);
    match kind(lines, line + 1) {
        Kind::Pass(pass) => pass.decision_time_us = time_us,
        Kind::Play(play) => play.decision_time_us = time_us,
        other => panic!("{other:?}"),
    }
}

/// Moves the times from a line on.
fn shift_clock(lines: &mut Lines, from: usize, ms: u64) {
    for line in &mut lines[from - 1..] {
        match &mut line.line {
            Some(Line::Decision(decision)) => decision.elapsed_ms += ms,
            Some(Line::Event(event)) => event.elapsed_ms += ms,
            _ => {}
        }
    }
}

fn with_event(lines: &mut Lines, before: usize, kind: Kind) {
    let elapsed_ms = match &lines[before - 1].line {
        Some(Line::Event(event)) => event.elapsed_ms,
        other => panic!("{other:?}"),
    };
    lines.insert(before - 1, event_line(elapsed_ms, kind));
    number_events(lines);
}

fn event_line(elapsed_ms: u64, kind: Kind) -> v1::RecordLine {
    let event = v1::GameEvent {
        elapsed_ms,
        kind: Some(kind),
        ..v1::GameEvent::default()
    };
    let line = Some(Line::Event(event));
    v1::RecordLine { line }
}

/// The third agent loses its connection a millisecond before a pass, which so becomes the server's.
fn short_absence(lines: &mut Lines) {
    everywhere(lines, |_| {}, |policy| policy.absence_time_ms = Some(5));
    shift_clock(lines, 56, 10);
    time(lines, 56, 8_000);
    source(lines, 56, v1::DecisionSource::Disconnected);
    let lost = Kind::Disconnected(v1::Disconnected {
        seat: 3,
        ..v1::Disconnected::default()
    });
    let given = Kind::Substituted(v1::Substituted {
        seat: 3,
        built_in_agent: "random".into(),
        for_good: false,
    });
    let back = Kind::Returned(v1::Returned { seat: 3 });
    // From the last: after the events that follow from the pass, and before the decision.
    for (before, elapsed_ms, kind) in [(59, 143, back), (59, 143, given), (56, 142, lost)] {
        lines.insert(before - 1, event_line(elapsed_ms, kind));
    }
    number_events(lines);
}

fn without_event(lines: &mut Lines, line: usize) {
    lines.remove(line - 1);
    number_events(lines);
}

/// Numbers the events again.
fn number_events(lines: &mut Lines) {
    let mut events = 0;
    for line in lines.iter_mut() {
        if let Some(Line::Event(event)) = &mut line.line {
            events += 1;
            event.sequence = events;
        }
    }
    footer(lines).events = events;
}

/// Applies a change to the header and to the event that repeats it.
fn everywhere(
    lines: &mut Lines,
    seats: impl Fn(&mut [v1::Participant]),
    policy: impl Fn(&mut v1::RoomPolicy),
) {
    seats(&mut header(lines).seats);
    policy(header(lines).policy.as_mut().expect("a policy"));
    if let Kind::GameStarted(started) = kind(lines, 4) {
        seats(&mut started.seats);
        policy(started.policy.as_mut().expect("a policy"));
    }
}

fn rename(lines: &mut Lines) {
    everywhere(lines, |seats| seats[3].name = "Rosa".into(), |_| {});
    if let Kind::Seated(seated) = kind(lines, 3) {
        seated.name = "Rosa".into();
    }
}

fn another_kind(lines: &mut Lines) {
    let human = v1::ParticipantKind::Human.into();
    everywhere(lines, |seats| seats[3].kind = human, |_| {});
    if let Kind::Seated(seated) = kind(lines, 3) {
        seated.kind = human;
    }
}

fn another_policy(lines: &mut Lines) {
    everywhere(lines, |_| {}, |policy| policy.spectators = Some(false));
}

fn fixed_seed(lines: &mut Lines) {
    header(lines).origin = v1::GameOrigin::FixedSeed.into();
    header(lines).seed_commitment.clear();
    if let Kind::GameStarted(started) = kind(lines, 4) {
        started.seed_commitment.clear();
    }
    let game_seed = reveal(lines).game_seed.clone();
    *reveal(lines) = v1::SeedReveal {
        game_seed,
        ..v1::SeedReveal::default()
    };
}

/// Another game from the same seed, with the times of its beginning throughout.
fn other_decisions(lines: &mut Lines) {
    let game_seed = reveal(lines).game_seed.clone();
    let seed = Seed(game_seed.try_into().expect("32 bytes"));
    let rules = header(lines).rules.clone().expect("rules");
    let rules = rules_from_proto(&rules).expect("valid rules");
    let policy = header(lines).policy.clone().expect("a policy");
    let mut game = Game::new(rules, seed, |_| {});
    let mut decisions = Vec::new();
    while game.decision().is_some() {
        let action = game.legal_actions().iter().next().expect("an action");
        game.apply(action, |_| {}).expect("it is legal");
        decisions.push(PlayedDecision {
            action,
            attempts: Vec::new(),
            by_default: false,
        });
    }
    let played = Played {
        by: "",
        rules: &rules,
        agents: &BySeat::filled(rules.players(), None),
        seed,
        scheme: reward_scheme_from_proto(policy.reward_scheme()),
        policy: &policy,
        decisions: &decisions,
    };
    let mut other = played.record();
    let is_start = |line: &v1::RecordLine| matches!(&line.line, Some(Line::Event(event)) if matches!(event.kind, Some(Kind::GameStarted(_))));
    let start = |lines: &Lines| lines.iter().position(is_start).expect("it starts") + 1;
    let mut footer_line = other.pop().expect("a footer");
    if let Some(Line::Footer(it)) = &mut footer_line.line {
        it.signature.clone_from(&footer(lines).signature);
    }
    let reveal = reveal(lines).clone();
    let mut rest = other.split_off(start(&other));
    let elapsed = match &lines[start(lines)].line {
        Some(Line::Event(event)) => event.elapsed_ms,
        other => panic!("{other:?}"),
    };
    for line in &mut rest {
        match &mut line.line {
            Some(Line::Decision(decision)) => decision.elapsed_ms = elapsed,
            Some(Line::Event(event)) => {
                event.elapsed_ms = elapsed;
                if let Some(Kind::GameEnded(ended)) = &mut event.kind {
                    ended.reveal = Some(reveal.clone());
                }
            }
            _ => {}
        }
    }
    lines.truncate(start(lines));
    lines.extend(rest);
    lines.push(footer_line);
    for seat in &mut header(lines).seats {
        seat.substituted = false;
    }
    number_events(lines);
}

/// The game closed by its owner before one of its decisions.
fn cut_short(lines: &mut Lines) {
    let is_decision = |line: &v1::RecordLine| matches!(line.line, Some(Line::Decision(_)));
    let cut = 8 + lines[8..].iter().position(is_decision).expect("a decision");
    let signature = footer(lines).signature.take();
    *lines = aborted(lines.clone(), cut);
    for seat in &mut header(lines).seats {
        seat.substituted = false;
    }
    footer(lines).signature = signature;
}

fn committed() -> Lines {
    fixture("committed.jsonl")
}

fn key() -> SigningKey {
    SigningKey::from_seed(&[7; 32])
}

fn signed() -> Lines {
    let mut lines = committed();
    footer(&mut lines).signature = Some(key().sign(&lines));
    lines
}

fn outcome(forge: fn(&mut Lines)) -> Outcome {
    let (mut plain, mut with_signature) = (committed(), signed());
    forge(&mut plain);
    forge(&mut with_signature);
    let accepted = replay(&with_signature).is_ok();
    match (replay(&plain).is_ok(), accepted) {
        (false, false) => Replay,
        (true, false) => Signature,
        (_, true) => Believed,
    }
}

#[test]
fn each_forgery_is_caught_as_the_table_says() {
    let wrong: Vec<String> = FORGERIES
        .iter()
        .map(|(name, expected, forge)| (name, *expected, outcome(*forge)))
        .filter(|(_, expected, found)| expected != found)
        .map(|(name, expected, found)| format!("{name}: {expected:?}, but it is {found:?}"))
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_pinned_key_catches_what_is_signed_again() {
    let mut lines = signed();
    assert_eq!(
        replay(&lines).expect("it fits").signed_by,
        Some(key().public())
    );
    let (.., forge) = FORGERIES[FORGERIES.len() - 1];
    rename(&mut lines);
    forge(&mut lines);
    let signed_by = replay(&lines).expect("a valid signature").signed_by;
    assert_ne!(signed_by, Some(key().public()));
}

/// A restart while the room waited: every seat was attached again before the game started, so that
/// the timeout of line 21 stays one.
#[test]
fn a_restart_before_the_game_leaves_its_timeouts_valid() {
    let mut lines = committed();
    let restarted = Kind::ServerRestarted(v1::ServerRestarted::default());
    with_event(&mut lines, 4, restarted);
    replay(&lines).expect("valid");
}

#[test]
fn a_record_without_a_participant_says_so_and_is_signed_by_who_had_signed_it() {
    let delete = |name: &str, key: Option<SigningKey>, lines: &mut Lines| {
        let pseudonym = Pseudonym {
            of: Named {
                name: name.into(),
                fingerprint: None,
            },
            pseudonym: "deleted participant".into(),
            key: key.map(Arc::new),
        };
        pseudonym.redact(lines);
        replay(lines).expect("it fits")
    };
    let unchanged = delete("nobody", Some(key()), &mut signed());
    assert_eq!(unchanged.signed_by, Some(key().public()));
    assert!(!unchanged.redacted);
    let mut forged = signed();
    rename(&mut forged);
    for (mut lines, name, with, signed_by) in [
        (signed(), "Greta", Some(key()), Some(key().public())),
        (signed(), "Greta", None, None),
        (
            signed(),
            "Greta",
            Some(SigningKey::from_seed(&[9; 32])),
            None,
        ),
        (committed(), "Greta", Some(key()), None),
        // It vouches for nothing that it has not signed.
        (forged, "Rosa", Some(key()), None),
    ] {
        let redacted = delete(name, with, &mut lines);
        assert_eq!(redacted.signed_by, signed_by);
        assert!(redacted.redacted && footer(&mut lines).participant_removed);
    }
}

#[test]
fn of_those_who_share_a_name_only_the_one_meant_is_removed() {
    let seat = |seat: u32, fingerprint: &str| v1::Participant {
        seat,
        name: "Ana".into(),
        name_fingerprint: fingerprint.into(),
        ..v1::Participant::default()
    };
    let header = v1::RecordHeader {
        seats: vec![seat(0, "0123456789abcdef"), seat(1, "")],
        ..v1::RecordHeader::default()
    };
    let event = |kind| event_line(0, kind);
    let seated = |seat| {
        event(Kind::Seated(Box::new(v1::Seated {
            seat,
            name: "Ana".into(),
            ..v1::Seated::default()
        })))
    };
    let shown = |seat| {
        event(Kind::ExpressionShown(Box::new(v1::ExpressionShown {
            seat,
            ..v1::ExpressionShown::default()
        })))
    };
    let lines = [
        v1::RecordLine {
            line: Some(Line::Header(Box::new(header))),
        },
        // One of the name leaves before the game: the record does not say which.
        seated(0),
        event(Kind::Vacated(v1::Vacated { seat: 0 })),
        seated(0),
        seated(1),
        shown(0),
        shown(1),
    ];
    for (fingerprint, names, expressions) in [
        (Some("0123456789abcdef"), 2, 1),
        (Some(""), 2, 1),
        (Some("fedcba9876543210"), 0, 0),
        (None, 5, 2),
    ] {
        let who = Pseudonym {
            of: Named {
                name: "Ana".into(),
                fingerprint: fingerprint.map(str::to_owned),
            },
            pseudonym: "deleted participant".into(),
            key: None,
        };
        let mut redacted = lines.to_vec();
        let found = who.redact(&mut redacted);
        assert_eq!(
            (found.names, found.expressions),
            (names, expressions),
            "{fingerprint:?}"
        );
        let text = format!("{redacted:?}");
        assert_eq!(text.matches("deleted participant").count() as u64, names);
        assert_eq!(text.matches("\"Ana\"").count() as u64, 5 - names);
    }
}

#[test]
fn the_docs_list_what_a_record_can_and_cannot_prove() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/records.md");
    let docs = std::fs::read_to_string(path).expect("the docs");
    let rows: Vec<&str> = docs
        .lines()
        .skip_while(|line| *line != "| forgery | caught by |")
        .skip(2)
        .take_while(|line| line.starts_with('|'))
        .collect();
    let expected: Vec<String> = FORGERIES
        .iter()
        .map(|(name, outcome, _)| {
            let caught = match outcome {
                Replay => "replay",
                Signature => "signature",
                Believed => "a pinned key",
            };
            format!("| {name} | {caught} |")
        })
        .collect();
    assert_eq!(rows, expected);
}

#[test]
fn a_signature_survives_the_file_and_public_keys_their_text() {
    let lines = signed();
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("signed.jsonl");
    jsonl::write(&path, &lines).expect("written");
    let read = jsonl::read(&path).expect("read");
    assert_eq!(signer(&read), Ok(Some(key().public())));
    // The same signature, computed in Python before signatures had a version of their text.
    let other = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/fixtures/signed.jsonl");
    let mut earlier = lines.clone();
    if let Some(signature) = &mut footer(&mut earlier).signature {
        signature.text_version = 0;
    }
    assert_eq!(jsonl::read(&other).expect("read"), earlier);
    assert_eq!(signer(&earlier), Ok(Some(key().public())));
    assert_eq!(signer(&committed()), Ok(None));
    let text = key().public().to_string();
    assert_eq!(text.parse(), Ok(key().public()));
    for wrong in ["", "ed25519:", "ed25519:00", &text[8..]] {
        assert!(wrong.parse::<PublicKey>().is_err(), "{wrong:?}");
    }
    // RFC 8032, 7.1, test 1.
    let seed = "9d61b19deffd5a60ba844af492ec2cc44449c5697b326919703bac031cae7f60";
    let seed: [u8; 32] = hex::decode(seed)
        .expect("hexadecimal")
        .try_into()
        .expect("32 bytes");
    let public = "ed25519:d75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a";
    assert_eq!(SigningKey::from_seed(&seed).public().to_string(), public);
}
