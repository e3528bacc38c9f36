//! Fuzz targets: edited rows of the database are read or refused, and what is read resumes or is
//! refused, never a panic.

use bolero::check;
use chefshat_record::testing::Edits;
use chefshat_room::Core;
use chefshat_room::testing::{OPEN, Table, one_shift};
use chefshat_tournament::{Change, Entrant};

use super::*;
use crate::testing::folded;
use crate::tournaments::{StoredTournament, TournamentEntry};

/// Runs of each target in `cargo test`.
const RUNS: usize = 3_000;

/// A game that was interrupted after some decisions, as its two columns of the database.
fn interrupted() -> (Vec<u8>, Vec<u8>) {
    let fills = vec![OPEN, OPEN, Fill::BuiltIn(AgentKind::Random.into()), OPEN];
    let mut table = Table::with_rules(Policy::default(), fills, one_shift());
    for _ in 0..3 {
        let _ = table.join(ParticipantKind::Agent);
    }
    for seat in [0, 1, 3] {
        table.attach(Seat::new(seat));
    }
    for _ in 0..30 {
        match table.core.open() {
            Some(open) if open.decision.seat != Seat::new(2) => drop(table.play_one()),
            _ => table.pass_time(Duration::from_secs(1)),
        }
    }
    let mut journal = Vec::new();
    for entry in &table.journal {
        form::put_entry(entry, &mut journal);
    }
    (form::header_to_bytes(table.core.header()), journal)
}

/// Reads and resumes a game.
fn resume(header: &[u8], journal: &[u8]) -> Result<Core, String> {
    let header = form::header_from_bytes(header).map_err(|error| error.to_string())?;
    let mut entries = Vec::new();
    form::read_entries(journal, &mut entries).map_err(|error| error.to_string())?;
    let age = entries.last().map_or(Duration::ZERO, |entry| entry.at);
    Core::revived(Arc::new(header), &entries, age).map_err(|error| error.to_string())
}

#[test]
fn edited_games_resume_or_are_refused() {
    let (header, journal) = interrupted();
    let core = resume(&header, &journal).expect("it is not damaged");
    assert!(core.decisions() >= 20, "{} decisions", core.decisions());
    let inputs = check!().with_type::<(bool, Edits)>().with_iterations(RUNS);
    inputs.for_each(|(in_header, edits)| {
        let _ = match in_header {
            true => resume(&edits.apply(&header), &journal),
            false => resume(&header, &edits.apply(&journal)),
        };
    });
}

/// A tournament of four in its second round: a game counted, one called, one due.
fn tournament() -> (Vec<u8>, Vec<u8>) {
    let mut all = tournaments::every_entry();
    let counted = (all.iter_mut()).find_map(|entry| match entry {
        TournamentEntry::Change(Change::Counted { result, .. }) => Some(result.clone()),
        _ => None,
    });
    let mut result = counted.expect("an entry of every kind");
    for (participant, seat) in result.seats.iter_mut().enumerate() {
        seat.participant = participant;
        seat.statistics.points = 7;
    }
    let joined = |number| {
        TournamentEntry::Change(Change::Joined(Entrant {
            name: format!("agent {number}"),
            name_fingerprint: String::new(),
            kind: chefshat_tournament::ParticipantKind::Agent,
            built_in: None,
            filler: false,
            stateless: false,
            max_games: 2,
            at_table: false,
        }))
    };
    let round = |round| Change::Drawn {
        round,
        tables: vec![vec![0, 1, 2, 3]],
        byes: Vec::new(),
    };
    let call = |game| Change::Called {
        game,
        forfeited: vec![3],
    };
    let mut entries: Vec<TournamentEntry> = (0..4).map(joined).collect();
    let changes = [
        Change::Begun { rounds: 3 },
        round(1),
        call(0),
        Change::Rescheduled {
            game: 0,
            missing: vec![1],
            never_started: false,
        },
        call(0),
        Change::Counted { game: 0, result },
        round(2),
        call(1),
        round(3),
    ];
    entries.extend(changes.map(TournamentEntry::Change));
    (cup(3).to_bytes(), TournamentEntry::to_bytes(&entries))
}

#[test]
fn edited_tournaments_resume_or_are_refused() {
    let (header, entries) = tournament();
    let resume = |header: &[u8], entries: &[u8]| {
        let header = form::tournament_from_bytes(header).map_err(|error| error.to_string())?;
        let entries =
            form::tournament_entries_from_bytes(entries).map_err(|error| error.to_string())?;
        folded(&StoredTournament {
            header,
            rows: 1,
            entries,
        })
    };
    let core = resume(&header, &entries).expect("it is not damaged");
    assert_eq!(core.games().len(), 3);
    assert_eq!(core.games_over(), 1);
    let inputs = check!().with_type::<(bool, Edits)>().with_iterations(RUNS);
    inputs.for_each(|(in_header, edits)| {
        let _ = match in_header {
            true => resume(&edits.apply(&header), &entries),
            false => resume(&header, &edits.apply(&entries)),
        };
    });
}
