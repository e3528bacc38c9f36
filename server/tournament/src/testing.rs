//! Tournaments for tests: settings and participants.
#![allow(
    clippy::unwrap_used,
    missing_docs,
    reason = "test support: panics where a test fails"
)]

use chefshat_agents::AgentKind;

use crate::{Deals, Entrant, Format, ParticipantKind, Settings, Tournament};

/// How long [`settings`] let a game wait.
pub const NO_SHOW_MS: u64 = 1000;

/// Settings of a tournament of up to 64 participants in games of four.
pub fn settings(format: Format) -> Settings {
    Settings {
        format,
        players: 4,
        points: vec![5, 3, 1, 0],
        rounds: None,
        games_per_pairing: 1,
        deals: Deals::Independent,
        max_participants: 64,
        start_when_joined: None,
        no_show_ms: NO_SHOW_MS,
        max_calls: 2,
        max_parallel: 64,
        physical_tables: 0,
        draw_seed: [7; 32],
        filler: AgentKind::Random.into(),
    }
}

/// A stateless agent that plays one game at a time.
pub fn entrant(name: &str) -> Entrant {
    Entrant {
        name: name.to_owned(),
        name_fingerprint: String::new(),
        kind: ParticipantKind::Agent,
        built_in: None,
        filler: false,
        stateless: true,
        max_games: 1,
        at_table: false,
    }
}

/// A tournament that these agents have joined, all present; `None` is a client.
pub fn joined(
    settings: Settings,
    agents: impl IntoIterator<Item = Option<AgentKind>>,
) -> Tournament {
    let mut tournament = Tournament::new(settings).unwrap();
    for (number, built_in) in agents.into_iter().enumerate() {
        let joined = tournament.join(Entrant {
            built_in: built_in.map(Into::into),
            ..entrant(&format!("agent {number}"))
        });
        tournament.fold(&joined.unwrap());
        tournament.set_present(number, true);
    }
    tournament
}

/// The same, begun.
pub fn begun(
    settings: Settings,
    agents: impl IntoIterator<Item = Option<AgentKind>>,
) -> Tournament {
    let mut tournament = joined(settings, agents);
    begin(&mut tournament);
    tournament
}

/// Begins a tournament that enough have joined.
pub fn begin(tournament: &mut Tournament) {
    for change in tournament.begin().unwrap() {
        tournament.fold(&change);
    }
}
