//! Tests of redaction: two games that differ only in cards hidden from a viewer, played by the same
//! decisions under the same clock, must send this viewer the same bytes. A deliberate leak is
//! detected by the same comparison.

use std::sync::Arc;
use std::time::Duration;

use chefshat_agents::AgentKind;
use chefshat_engine::{
    ActionId, BySeat, Cards, DecisionKind, RuleSetSpec, Seat, SeedPlan, Stop, Viewer,
};
use chefshat_proto::v1;
use chefshat_record::convert::{decision_kind, observation_to_proto};
use chefshat_record::replay::replay;
use chefshat_referee::counts::JOKER;
use chefshat_referee::{Report, SeenCards};
use chefshat_room::journal::{Change, Fill, GameHeader, ParticipantKind, SeatLabels};
use chefshat_room::policy::{AbortPolicy, KindClock, Policy};
use chefshat_room::testing::real_table::{PERSON, policy};
use chefshat_room::testing::{
    OPEN, Table, dealt, ms, second_shift, shifts, study_game, study_member,
};
use chefshat_room::{Core, OpenDecision, ReportVerdict, Verdict};
use prost::Message as _;

use crate::convert;

/// Swaps two cards of different faces between two hands.
fn swapped(hands: &BySeat<Cards>, one: Seat, other: Seat, faces: u8) -> Option<BySeat<Cards>> {
    let counts = |seat: Seat| hands[seat].counts(faces).collect::<Vec<u8>>();
    let (mut ours, mut theirs) = (counts(one), counts(other));
    // Not the top face: the holder of the Golden card is known.
    let top = usize::from(faces) - 1;
    let mine = (0..top).find(|face| ours[*face] > 0 && theirs[*face] == 0)?;
    let yours = (0..top)
        .rev()
        .find(|face| theirs[*face] > 0 && *face != mine)?;
    ours[mine] -= 1;
    theirs[mine] += 1;
    theirs[yours] -= 1;
    ours[yours] += 1;
    let mut hands = *hands;
    hands[one] = Cards::from_counts(faces, &ours, hands[one].has_golden())?;
    hands[other] = Cards::from_counts(faces, &theirs, hands[other].has_golden())?;
    Some(hands)
}

/// A seat for a program.
const AGENT: Fill = Fill::Open {
    reserved_for: Some(ParticipantKind::Agent),
};

/// What was sent to a viewer from a position in the log on: the events, and the open decision if it
/// is that of `own`.
pub(super) fn sent_since(
    from: usize,
    table: &Table,
    own: Option<Seat>,
    see: Viewer,
) -> Vec<Vec<u8>> {
    let core = &table.core;
    let events = (from..core.log().len())
        .filter_map(|position| convert::event_to_proto(core, position, see))
        .map(|event| event.encode_to_vec());
    let open = (core.awaited()).filter(|open| own == Some(open.decision.seat));
    let written = |open| encoded(core, open, table.now, true);
    events.chain(open.map(written)).collect()
}

fn encoded(core: &Core, open: &OpenDecision, now: Duration, with_mask: bool) -> Vec<u8> {
    let mut written = Vec::new();
    crate::encoded::encode_decision(core, open, now, with_mask, &mut written);
    written
}

/// Everything sent to the viewer: all events, and the open decision if it is the viewer's.
fn sent_to(table: &Table, viewer: Seat, see: Viewer) -> Vec<Vec<u8>> {
    sent_since(0, table, Some(viewer), see)
}

/// The events of the record.
fn recorded(table: &Table) -> impl Iterator<Item = v1::game_event::Kind> {
    let lines = convert::record_lines(table.core.header(), &table.journal);
    lines.into_iter().filter_map(|line| match line.line {
        Some(v1::record_line::Line::Event(event)) => event.kind,
        _ => None,
    })
}

/// The events of the log, unredacted.
fn logged(table: &Table, from: usize) -> impl Iterator<Item = v1::game_event::Kind> {
    (from..table.core.log().len()).filter_map(|position| {
        convert::event_to_proto(&table.core, position, Viewer::Everything)?.kind
    })
}

/// Two tables that differ in two hidden cards, as if they had been dealt so.
fn pair(viewer: Seat, one: Seat, other: Seat, seed: u8) -> Option<(Table, Table)> {
    let table = |seed| {
        let mut table = Table::empty(
            Policy {
                reward_scheme: Some(chefshat_engine::RewardScheme::Paper),
                ..Policy::default()
            },
            vec![OPEN; 4],
        );
        let mut header = GameHeader::clone(table.core.header());
        header.seed = SeedPlan::Fixed {
            game_seed: [seed; 32],
        };
        table.core = Core::new(Arc::new(header));
        table.fill();
        table
    };
    assert!(viewer != one && viewer != other);
    let (plain, mut other_table) = (table(seed), table(seed));
    other_table
        .core
        .replace_hands(|game| swapped(game.hands(), one, other, game.rules().faces()))?;
    Some((plain, other_table))
}

/// Plays both tables by the same decisions until the rules differ; returns the number of turns.
fn play_both(
    plain: &mut Table,
    swapped: &mut Table,
    mut each: impl FnMut(&Table, &Table),
) -> usize {
    for turn in 0.. {
        each(plain, swapped);
        let (seat, id) = plain.open();
        assert_eq!(swapped.open(), (seat, id));
        let common: Vec<ActionId> = plain
            .core
            .legal_actions()
            .iter()
            .filter(|action| swapped.core.legal_actions().contains(*action))
            .collect();
        let shift = plain.core.game().expect("a started game").shift();
        if common.is_empty() || shift > 1 {
            return turn;
        }
        let action = common[turn % common.len()].index().into();
        for table in [&mut *plain, &mut *swapped] {
            table.now += ms(10);
            assert_eq!(table.answer(seat, id, action).verdict, Verdict::Accepted);
        }
        if plain.core.game().expect("a started game").shift() > 1 {
            // The next Shift has new deals; the hidden cards are played or known by then.
            return turn;
        }
    }
    unreachable!("a Shift ends")
}

#[test]
fn hidden_cards_do_not_change_what_is_sent() {
    let seats = [0, 1, 2, 3].map(Seat::new);
    let mut turns = 0;
    for seed in 0..40 {
        let viewer = seats[usize::from(seed) % 4];
        let (one, other) = (
            seats[(viewer.index() + 1) % 4],
            seats[(viewer.index() + 2) % 4],
        );
        let Some((mut plain, mut swapped)) = pair(viewer, one, other, seed) else {
            continue;
        };
        turns += play_both(&mut plain, &mut swapped, |plain, swapped| {
            for see in [Viewer::Seat(viewer), Viewer::Spectator] {
                assert_eq!(sent_to(plain, viewer, see), sent_to(swapped, viewer, see));
            }
        });
    }
    assert!(turns > 400, "only {turns} turns were compared");
}

/// A table of four agents, of which a person plays these seats.
fn with_wizards(wizards: &[usize]) -> Table {
    let mut table = Table::empty(Policy::default(), vec![AGENT; 4]);
    let mut header = GameHeader::clone(table.core.header());
    header.wizards = wizards.iter().copied().collect();
    table.core = Core::new(Arc::new(header));
    table.fill();
    table
}

#[test]
fn a_person_who_plays_as_an_agent_does_not_change_what_is_sent() {
    let (mut plain, mut wizard) = (with_wizards(&[]), with_wizards(&[0, 2]));
    let views = [0, 1, 2, 3].map(|seat| Viewer::Seat(Seat::new(seat)));
    let turns = play_both(&mut plain, &mut wizard, |plain, wizard| {
        for (seat, see) in views.into_iter().chain([Viewer::Spectator]).enumerate() {
            let viewer = Seat::new(seat % 4);
            assert_eq!(sent_to(plain, viewer, see), sent_to(wizard, viewer, see));
        }
        let room = |table: &Table| convert::describe_at(&table.core, table.now).encode_to_vec();
        assert_eq!(room(plain), room(wizard));
    });
    assert!(turns > 20, "only {turns} turns were compared");
    // The record says it, of these seats alone.
    let lines = convert::record_lines(wizard.core.header(), &wizard.journal);
    let Some(v1::record_line::Line::Header(header)) = &lines[0].line else {
        panic!("no header");
    };
    for seat in &header.seats {
        let (kind, shown) = match seat.seat {
            0 | 2 => (v1::ParticipantKind::Human, v1::ParticipantKind::Agent),
            _ => (v1::ParticipantKind::Agent, v1::ParticipantKind::Unspecified),
        };
        assert_eq!((seat.kind(), seat.shown_kind()), (kind, shown));
    }
}

/// The game of a study whose other seats are hidden.
#[derive(Debug, Clone)]
struct Hidden {
    labels: SeatLabels,
    /// Who holds the jokers. `None`: the first of two Shifts is dealt from the seed.
    jokers: Option<[usize; 2]>,
    policy: Policy,
    /// Whether the participant loses its connection at some of its decisions.
    leaves: bool,
    /// Whether participants play in groups: a second one has seat 2, unless a built-in agent plays in
    /// its place.
    grouped: bool,
}

/// The seat of the second participant of a group.
const SECOND: usize = 2;

impl Hidden {
    fn new(labels: SeatLabels) -> Self {
        Self {
            labels,
            jokers: None,
            policy: Policy {
                pace: Some(ms(300)),
                // A program has more time than a person.
                decision_time: ms(3_000),
                bank: ms(500),
                abort: AbortPolicy::Never,
                absence_time: Some(ms(3_000)),
                clocks: vec![KindClock {
                    kind: ParticipantKind::Human,
                    decision_time: Some(ms(2_000)),
                    bank: None,
                    absence_time: Some(ms(600)),
                }],
                ..Policy::default()
            },
            leaves: false,
            grouped: false,
        }
    }

    /// The kind of the participant who has a seat but that of the first participant.
    fn kind_of(&self, seat: usize) -> ParticipantKind {
        match self.grouped && seat == SECOND {
            true => ParticipantKind::Human,
            false => ParticipantKind::Agent,
        }
    }

    /// Its room, with these in the seats that are not the participant's.
    fn room(&self, others: Fill) -> Table {
        let mut fills = vec![OPEN, others, others, others];
        let mut study = study_game(self.labels);
        if self.grouped {
            study.group = Some(1);
            if !others.is_built_in() {
                study.members.push(study_member(2, "Bo", SECOND));
                fills[SECOND] = Fill::Open {
                    reserved_for: Some(ParticipantKind::Human),
                };
            }
        }
        let rules = RuleSetSpec {
            stop: Stop::Shifts(2),
            ..RuleSetSpec::default()
        };
        let valid = rules.validate().expect("a valid rule set");
        let mut table = Table::with_rules(self.policy.clone(), fills, rules);
        let mut header = GameHeader::clone(table.core.header());
        header.study = Some(Arc::new(study));
        header.start.script = self.jokers.map(|jokers| {
            let hands = dealt(&valid, 3, jokers.map(Seat::new));
            second_shift(hands.expect("every seat has cards to swap"))
        });
        table.core = Core::new(Arc::new(header));
        table
    }
}

/// What is shown: its class, and its bytes.
type Shown = Vec<(&'static str, Vec<u8>)>;

/// Everything that anybody but the owner of a study may learn about one of its rooms.
fn shown_of(table: &Table) -> Shown {
    let core = &table.core;
    let own = Seat::new(0);
    let awaited = core.awaited_in_public();
    let mut shown = vec![
        (
            "the room",
            convert::describe_at(core, table.now).encode_to_vec(),
        ),
        ("the start", convert::game_started(core).encode_to_vec()),
        (
            "whom it waits for",
            convert::awaited_to_proto(awaited, table.now).encode_to_vec(),
        ),
        (
            "what spectators see",
            core.visible_to_spectators().to_be_bytes().to_vec(),
        ),
    ];
    for see in [Viewer::Seat(own), Viewer::Spectator, Viewer::Everything] {
        shown.push(("a snapshot", convert::snapshot(core, see).encode_to_vec()));
        let messages = sent_to(table, own, see).into_iter();
        shown.extend(messages.map(|message| ("a message", message)));
    }
    shown
}

/// Plays a game with built-in agents in the other seats, and the same game with programs that decide
/// the same at the same times. Returns the games, and what was shown at every moment of them.
fn with_both_fills(hidden: &Hidden) -> [(Table, Shown); 2] {
    let built_in = hidden.room(Fill::BuiltIn(AgentKind::Greedy.into()));
    let mut both = [(built_in, Vec::new()), (hidden.room(AGENT), Vec::new())];
    let note = |both: &mut [(Table, Vec<_>); 2]| {
        for (table, shown) in both {
            shown.extend(shown_of(table));
        }
    };
    // Before and after the programs have come.
    note(&mut both);
    for seat in 1..4 {
        let kind = hidden.kind_of(seat);
        assert_eq!(both[1].0.join(kind), Ok(Seat::new(seat)));
        both[1].0.attach(Seat::new(seat));
        note(&mut both);
    }
    let own = Seat::new(0);
    let mut connections = both.each_mut().map(|(table, _)| {
        table.now += ms(50);
        assert_eq!(table.join(ParticipantKind::Human), Ok(own));
        table.attach(own)
    });
    let mut read = 0;
    // Until when the participant is away.
    let mut returns_at = None;
    for turn in 0.. {
        let [(built_in, _), (programs, _)] = &mut both;
        for entry in &built_in.journal[read..] {
            if let Change::Decided(decided) = &entry.change
                && decided.seat != own
                && !programs.core.state().is_over()
            {
                let (seat, id) = programs.open();
                // A program that is not asked at the same time cannot answer.
                if seat == decided.seat {
                    programs.answer(seat, id, decided.action.index().into());
                }
            }
        }
        read = built_in.journal.len();
        note(&mut both);
        let core = &both[0].0.core;
        if core.state().is_over() {
            break;
        }
        let asked = core.awaited().filter(|open| open.decision.seat == own);
        let asked = asked.map(|open| open.id);
        if returns_at.is_some_and(|at| both[0].0.now >= at) {
            connections = both.each_mut().map(|(table, _)| table.attach(own));
            returns_at = None;
        } else if returns_at.is_some() {
            both.iter_mut()
                .for_each(|(table, _)| table.pass_time(ms(50)));
        } else if let Some(id) = asked {
            let leaves = hidden.leaves && id % 3 == 1;
            for ((table, shown), connection) in both.iter_mut().zip(connections) {
                table.pass_time(ms(50));
                if leaves {
                    table.lost(own, connection);
                } else {
                    let action = table.legal(turn);
                    let verdict = table.answer(own, id, action).verdict;
                    shown.push(("a verdict", format!("{verdict:?}").into_bytes()));
                }
            }
            if first_difference(&both).is_err() {
                break;
            }
            // Some absences are shorter than the absence time, some longer than all the time.
            let away = [300, 900, 4_000][usize::try_from(id).unwrap_or_default() / 3 % 3];
            returns_at = leaves.then(|| both[0].0.now + ms(away));
        } else {
            both.iter_mut()
                .for_each(|(table, _)| table.pass_time(ms(50)));
        }
    }
    both
}

/// The first class in which what was shown differs, and how many messages were compared.
fn first_difference([(_, one), (_, other)]: &[(Table, Shown); 2]) -> Result<usize, &'static str> {
    let differing = (one.iter().zip(other)).find(|((_, one), (_, other))| one != other);
    match differing {
        Some(((what, _), _)) => Err(what),
        None if one.len() != other.len() => Err("the end"),
        None => Ok(one.len()),
    }
}

/// Plays a game with both fills, in which nothing that is shown may differ and whose records replay.
fn same_with_both_fills(hidden: &Hidden, least: usize) -> [(Table, Shown); 2] {
    let both = with_both_fills(hidden);
    let compared = first_difference(&both).unwrap_or_else(|what| {
        panic!("{what} differs: {hidden:?}");
    });
    assert!(compared > least, "only {compared} messages: {hidden:?}");
    for (table, _) in &both {
        table.assert_replays();
        let lines = convert::record_lines(table.core.header(), &table.journal);
        replay(&lines).unwrap_or_else(|error| panic!("{error}: {hidden:?}"));
    }
    both
}

#[test]
fn what_fills_a_hidden_seat_of_a_study_does_not_change_what_is_shown() {
    for labels in [SeatLabels::Kinds, SeatLabels::Players] {
        let [(built_in, _), (programs, _)] = same_with_both_fills(&Hidden::new(labels), 2_000);
        assert!(programs.core.state().is_over(), "the same game");
        // The record has what is true, for the owner of the study.
        let times = |table: &Table| {
            let plays = recorded(table).filter_map(|kind| match kind {
                v1::game_event::Kind::Play(play) if play.seat > 0 => Some(play.decision_time_us),
                _ => None,
            });
            plays.collect::<Vec<_>>()
        };
        assert!(times(&built_in).iter().all(|time| *time == 0));
        assert!(times(&programs).iter().all(|time| *time > 0));
        assert_eq!(times(&built_in).len(), times(&programs).len());
    }
    // The comparison finds what is shown where nothing is hidden.
    let [(_, shown), (_, other)] = with_both_fills(&Hidden::new(SeatLabels::AsTheyAre));
    for what in [
        "the room",
        "the start",
        "whom it waits for",
        "a snapshot",
        "a message",
    ] {
        let of = |shown: &[(&str, Vec<u8>)]| {
            let messages = shown.iter().filter(|(name, _)| *name == what);
            messages
                .map(|(_, message)| message.clone())
                .collect::<Vec<_>>()
        };
        assert_ne!(of(&shown), of(&other), "{what}");
    }
}

/// Whoever holds the jokers, each Shift waits as long, and the game waits as long for a participant
/// who is away.
#[test]
fn what_fills_a_hidden_seat_of_a_study_does_not_change_when_it_is_shown() {
    let mut decided = [0; 2];
    for jokers in [None, Some([1, 2]), Some([2, 2]), Some([0, 0])] {
        for (leaves, pace) in [(false, 300), (false, 0), (true, 300), (true, 0)] {
            for abort in [AbortPolicy::Never, AbortPolicy::AllLost] {
                let mut hidden = Hidden::new(SeatLabels::Players);
                (hidden.jokers, hidden.leaves) = (jokers, leaves);
                (hidden.policy.pace, hidden.policy.abort) = (Some(ms(pace)), abort);
                let [_, (programs, _)] = same_with_both_fills(&hidden, 200);
                let silent = programs.core.header().rules.actions();
                let silent = [silent.decline(), silent.declare()];
                for entry in &programs.journal {
                    if let Change::Decided(it) = &entry.change
                        && silent.contains(&it.action)
                    {
                        decided[usize::from(it.seat == Seat::new(0))] += 1;
                    }
                }
            }
        }
    }
    assert!(decided.iter().all(|count| *count >= 8), "{decided:?}");
}

/// Nobody of a group can tell who plays with it: another participant, or an agent in its place.
#[test]
fn who_else_of_a_group_plays_does_not_change_what_is_shown() {
    for jokers in [None, Some([1, 2]), Some([2, 2])] {
        for (leaves, pace) in [(false, 300), (true, 0)] {
            let mut hidden = Hidden::new(SeatLabels::Players);
            (hidden.jokers, hidden.leaves, hidden.grouped) = (jokers, leaves, true);
            hidden.policy.pace = Some(ms(pace));
            same_with_both_fills(&hidden, 200);
        }
    }
}

/// That somebody of a group has left for good is in the record alone.
#[test]
fn that_the_participant_of_a_hidden_seat_has_left_is_not_shown() {
    let mut hidden = Hidden::new(SeatLabels::Players);
    hidden.grouped = true;
    let mut table = hidden.room(AGENT);
    for seat in [1, SECOND, 3] {
        assert_eq!(table.join(hidden.kind_of(seat)), Ok(Seat::new(seat)));
        table.attach(Seat::new(seat));
    }
    assert_eq!(table.join(ParticipantKind::Human), Ok(Seat::new(0)));
    table.attach(Seat::new(0));
    let told = table.core.log().len();
    table.core.retire(table.now, Seat::new(SECOND), None);
    let is_retired = |change: &Change| matches!(change, Change::Retired(_));
    while !table.core.pending().iter().any(|it| is_retired(&it.change)) {
        table.pass_time(ms(50));
    }
    let substituted = |kind| matches!(kind, v1::game_event::Kind::Substituted(_));
    assert!(!logged(&table, told).any(substituted));
    let room = convert::describe_at(&table.core, table.now);
    assert!(room.seats.iter().all(|seat| !seat.substituted));
}

#[test]
fn in_a_hidden_study_the_first_gift_is_asked_for_at_the_same_time_whatever_fills_the_seats() {
    let built_in = Fill::BuiltIn(AgentKind::Greedy.into());
    // The participant's own time limits the phase, not that of a program.
    for (pace, ends) in [(150, 1_500), (300, 2_000)] {
        // Nobody is offered a special action, or a program thinks before it declines, or lets it run
        // out.
        let cases = [(built_in, None), (AGENT, None)].into_iter();
        let thinking = [0, 700, 9_000].map(|thinks| (AGENT, Some(thinks)));
        for (others, thinks) in cases.chain(thinking) {
            let mut hidden = Hidden::new(SeatLabels::Players);
            hidden.jokers = Some(thinks.map_or([1, 2], |_| [2, 2]));
            hidden.policy.pace = Some(ms(pace));
            let mut table = hidden.room(others);
            if others == AGENT {
                for _ in 1..4 {
                    let seat = table.join(ParticipantKind::Agent).expect("a free seat");
                    table.attach(seat);
                }
            }
            table.join(ParticipantKind::Human).expect("a free seat");
            table.attach(Seat::new(0));
            if let Some(thinks) = thinks {
                table.pass_time(ms(thinks.min(ends - 1)));
                let decline = table.core.header().rules.actions().decline();
                let (seat, id) = table.open();
                assert_eq!(seat, Seat::new(2));
                if thinks < ends {
                    table.answer(seat, id, decline.index().into());
                }
            }
            // The first gift is that of the participant, who was first in the Shift before.
            let gives = |table: &Table| {
                let awaited = table
                    .core
                    .awaited()
                    .filter(|open| open.decision.kind == DecisionKind::Exchange);
                awaited.map(|open| open.decision.seat)
            };
            table.pass_time(ms(ends - 1) - table.now);
            assert_eq!(gives(&table), None, "{others:?} {thinks:?} {pace}");
            table.pass_time(ms(1));
            let own = Some(Seat::new(0));
            assert_eq!(gives(&table), own, "{others:?} {thinks:?} {pace}");
        }
    }
}

#[test]
fn of_a_hidden_seat_only_what_it_plays_is_shown() {
    let mut table = Hidden::new(SeatLabels::Players).room(AGENT);
    for _ in 1..4 {
        table.join(ParticipantKind::Agent).expect("a free seat");
    }
    table.join(ParticipantKind::Human).expect("a free seat");
    let connections = [0, 1, 2, 3].map(|seat| table.attach(Seat::new(seat)));
    let before = shown_of(&table);
    let hidden = Seat::new(2);
    table.lost(hidden, connections[2]);
    assert_eq!(shown_of(&table), before);
    table.attach(hidden);
    assert_eq!(shown_of(&table), before);
    // The participant of the study sees its own.
    let length = table.core.log().len();
    table.lost(Seat::new(0), connections[0]);
    assert_eq!(table.core.log().len(), length + 1);

    // Both are substituted, and come back.
    let own = Seat::new(0);
    let connection = table.attach(hidden);
    table.lost(hidden, connection);
    let substituted = |table: &Table, seat| table.core.standing(seat).substituted;
    while !(substituted(&table, own) && substituted(&table, hidden)) {
        if table
            .core
            .awaited()
            .is_some_and(|open| ![own, hidden].contains(&open.decision.seat))
        {
            let (seat, id) = table.open();
            let action = table.legal(0);
            table.answer(seat, id, action);
        }
        table.pass_time(ms(50));
    }
    assert!(table.core.is_substituted_unseen(hidden) && !table.core.is_substituted_unseen(own));
    let room = convert::describe_at(&table.core, table.now);
    let shown: Vec<bool> = room.seats.iter().map(|seat| seat.substituted).collect();
    assert_eq!(shown, [true, false, false, false]);
    for seat in [own, hidden] {
        table.attach(seat);
        assert!(!substituted(&table, seat));
    }
    let presence = |kind: v1::game_event::Kind| match kind {
        v1::game_event::Kind::Substituted(it) => Some(("substituted", it.seat)),
        v1::game_event::Kind::Returned(it) => Some(("returned", it.seat)),
        _ => None,
    };
    let shown: Vec<_> = logged(&table, 0).filter_map(presence).collect();
    assert_eq!(shown, [("substituted", 0), ("returned", 0)]);
    // The record has both.
    let recorded: Vec<_> = recorded(&table).filter_map(presence).collect();
    for seat in [0, 2] {
        assert!(recorded.contains(&("substituted", seat)), "{recorded:?}");
        assert_eq!(
            recorded.iter().rfind(|(_, of)| *of == seat),
            Some(&("returned", seat))
        );
    }
    table.assert_replays();
}

/// The open decision as a message: the expected encoding.
fn decision_request(
    core: &Core,
    open: &OpenDecision,
    now: Duration,
    with_mask: bool,
) -> v1::DecisionRequest {
    let observation = core.observe(Viewer::Seat(open.decision.seat));
    let (time_left, bank_left) = core.time_left(now);
    let size = core.header().rules.actions().size();
    let mut request = v1::DecisionRequest {
        decision_id: open.id,
        kind: decision_kind(open.decision.kind).into(),
        observation: observation.map(|seen| observation_to_proto(&seen)),
        action_mask: if with_mask {
            core.legal_actions().to_bytes(size)
        } else {
            Vec::new()
        },
        time_left_ms: convert::millis(time_left),
        bank_left_ms: convert::millis(bank_left),
        invalid_attempts_left: core.attempts_left(),
        default_action: core
            .default_action()
            .expect("an open decision")
            .index()
            .into(),
        ..v1::DecisionRequest::default()
    };
    chefshat_record::convert::put_requirement(
        &mut request,
        core.requirement().expect("an open decision"),
    );
    request
}

#[test]
fn a_directly_encoded_decision_equals_the_encoded_message() {
    let sizes = [(4, 11, 2), (2, 4, 0), (6, 15, 2), (3, 5, 1)];
    for (players, faces, jokers) in sizes {
        let rules = chefshat_engine::RuleSetSpec {
            players,
            faces,
            jokers,
            stop: Stop::Shifts(4),
            ..chefshat_engine::RuleSetSpec::default()
        };
        let policy = Policy {
            max_invalid_attempts: (players != 2).then_some(10),
            ..Policy::default()
        };
        let mut table = Table::with_rules(policy, vec![OPEN; usize::from(players)], rules);
        table.fill();
        let mut decisions = 0;
        while let Some(open) = table.core.open().cloned() {
            for with_mask in [true, false] {
                let message = decision_request(&table.core, &open, table.now, with_mask);
                let written = encoded(&table.core, &open, table.now, with_mask);
                assert_eq!(written, message.encode_to_vec());
            }
            decisions += 1;
            table.now += ms(7);
            table.play_one();
        }
        assert!(decisions > 30);
    }
}

#[test]
fn a_deliberate_leak_is_detected() {
    let [viewer, one, other] = [0, 1, 2].map(Seat::new);
    let (plain, swapped) = (0..40)
        .find_map(|seed| pair(viewer, one, other, seed))
        .expect("some deal has two cards to swap");
    // The leak: a viewer that sees everything.
    assert_ne!(
        sent_to(&plain, viewer, Viewer::Everything),
        sent_to(&swapped, viewer, Viewer::Everything)
    );
}

/// What the table reports wrongly about hidden cards, and the public events that follow.
fn wrong_reports_about(remote_hand: &[usize]) -> (Vec<String>, Vec<Vec<u8>>) {
    let seen = |faces: &[usize], golden| {
        let mut counts = [0; JOKER + 1];
        for face in faces {
            counts[face - 1] += 1;
        }
        SeenCards { counts, golden }
    };
    let hand = |seat, faces: &[usize], golden| Report::Hand {
        seat: Seat::new(seat),
        cards: seen(faces, golden),
    };
    let ada = [8, 8, 8, 8, 8, 9, 9, 9, 9, 9, 9, 9, 9, 10, 10, 10, 10];
    let with_elevens = [2, 3, 3, 4, 4, 4, 5, 5, 5, 6, 6, 6, 10, 10, 11, 11, 11];
    let mut table = Table::physical(policy(), vec![PERSON, OPEN, PERSON, PERSON], shifts(1));
    let seat = table.join(ParticipantKind::Agent).expect("a free seat");
    table.attach(seat);
    let first = table.report(hand(1, remote_hand, Some(false)));
    let mut details = Vec::new();
    for report in [
        hand(1, &ada, Some(false)),
        hand(1, &[1, 2], Some(false)),
        hand(0, &ada, Some(false)),
        hand(2, &with_elevens, None),
        Report::Laid {
            seat: Some(seat),
            cards: seen(&[9, 9], None),
        },
        Report::Correction {
            number: first.number,
            instead: Some(Box::new(hand(1, &[9; 17], Some(false)))),
        },
        Report::Gift {
            seat,
            cards: Some(seen(&[9], None)),
        },
        Report::Special {
            seat: Some(Seat::new(2)),
        },
    ] {
        match table.report(report).verdict {
            ReportVerdict::Violation(violation) => details.push(violation.text),
            verdict => panic!("{verdict:?}"),
        }
    }
    (details, sent_to(&table, Seat::new(0), Viewer::Spectator))
}

#[test]
fn violations_do_not_tell_hidden_cards() {
    let (details, public) =
        wrong_reports_about(&[4, 4, 5, 6, 6, 7, 7, 7, 8, 8, 8, 9, 9, 9, 9, 10, 10]);
    let (other_details, other_public) =
        wrong_reports_about(&[4, 4, 5, 6, 6, 7, 7, 7, 8, 8, 8, 9, 9, 9, 10, 10, 10]);
    assert_ne!(details, other_details, "the table learns what does not fit");
    assert_eq!(public, other_public);
}
