//! Tournaments without tasks, for tests.

use std::sync::Arc;

use chefshat_agents::AgentKind;
use chefshat_proto::v1;
use chefshat_tournament::{Change, Entrant, MAX_GAMES_AT_A_TIME, ParticipantKind, Tournament};
use tokio_util::sync::CancellationToken;

use super::handle::TournamentHandle;
use super::state::{TournamentShared, TournamentState};
use crate::journaled::{Folded, New};
use chefshat_admission::limits::Key;
use chefshat_room::ids::{Id, Token};
use chefshat_store::tournaments::TournamentHeader;
use chefshat_wire::convert::{self, MAX_NAME_CHARS};

impl TournamentHandle {
    /// A tournament with this number of built-in agents, without a task.
    pub fn for_tests(participants: usize) -> Arc<Self> {
        Self::with_settings(
            participants,
            v1::TournamentSettings {
                format: v1::TournamentFormat::Swiss.into(),
                ..v1::TournamentSettings::default()
            },
        )
    }

    /// The same with these settings.
    pub fn with_settings(participants: usize, settings: v1::TournamentSettings) -> Arc<Self> {
        let settings = v1::TournamentSettings {
            max_participants: convert::number(participants.max(2)),
            ..settings
        };
        let plan = convert::tournament_plan(&settings, [1; 32]).expect("valid settings");
        let mut core = Tournament::new(plan.core.clone()).expect("valid settings");
        for number in 0..participants {
            // The longest allowed name.
            let digits = format!("{number:04}");
            let long = "🍕".repeat(MAX_NAME_CHARS - digits.len());
            core.fold(&Change::Joined(Entrant {
                name: digits + &long,
                name_fingerprint: "0123456789abcdef".into(),
                kind: ParticipantKind::Agent,
                built_in: Some(AgentKind::Random.into()),
                filler: false,
                stateless: true,
                max_games: MAX_GAMES_AT_A_TIME,
                at_table: false,
            }));
        }
        let id = Id::random();
        let folded = Folded {
            header: TournamentHeader {
                id,
                settings: convert::settings_to_proto(&"🍕".repeat(MAX_NAME_CHARS), &plan),
                created_at_ms: 1,
                join_code: chefshat_room::ids::join_code(),
                owner: Token::random(id).hash(),
                deal_secret: [2; 32],
            },
            plan,
            state: TournamentState::new(core),
            rows: 1,
        };
        let shared = TournamentShared::default();
        let (handle, _) = Self::new(New { folded, shared }, Key::Local, CancellationToken::new());
        handle
    }
}
