//! Tournaments for tests: settings and participants.

use chefshat_agents::AgentKind;
use chefshat_tournament::{Deals, Entrant, EntrantKind, Format, Settings, Tournament};

/// Settings of a tournament of up to 64 participants in games of four.
pub(crate) fn settings(format: Format) -> Settings {
    Settings {
        format,
        players: 4,
        points: vec![5, 3, 1, 0],
        rounds: None,
        games_per_pairing: 1,
        deals: Deals::Independent,
        max_participants: 64,
        start_when_joined: None,
        no_show_ms: 1000,
        max_calls: 2,
        max_parallel: 64,
        draw_seed: [7; 32],
        filler: AgentKind::Random,
    }
}

/// A tournament of these built-in agents that has begun; `None` is a client.
pub(crate) fn begun(
    settings: Settings,
    agents: impl IntoIterator<Item = Option<AgentKind>>,
) -> Tournament {
    let mut tournament = Tournament::new(settings).unwrap();
    for (number, built_in) in agents.into_iter().enumerate() {
        let joined = tournament.join(Entrant {
            name: format!("agent {number}"),
            kind: EntrantKind::Agent,
            built_in,
            filler: false,
            stateless: true,
            max_games: 1,
        });
        tournament.fold(&joined.unwrap());
    }
    for change in tournament.begin().unwrap() {
        tournament.fold(&change);
    }
    tournament
}
