//! Invalid settings and forbidden actions of tournaments: refused with a reason and the field at
//! fault.

use chefshat_proto::v1::{
    self, room_service_client::RoomServiceClient,
    tournament_service_client::TournamentServiceClient,
};
use chefshat_tests::TestServer;
use tonic::Code;
use tonic_types::StatusExt as _;

use crate::records::reason;
use crate::tournaments::{create, id_of};

#[tokio::test]
async fn who_asks_for_a_room_with_the_code_of_a_tournament_has_not_tried_a_wrong_code() {
    let server = TestServer::start().await;
    let channel = server.channel().await;
    let settings = v1::TournamentSettings {
        name: "Coppa".into(),
        format: v1::TournamentFormat::Swiss.into(),
        ..v1::TournamentSettings::default()
    };
    let created = create(&mut TournamentServiceClient::new(channel.clone()), settings).await;
    let mut rooms = RoomServiceClient::new(channel);
    // More than may be wrong at once.
    for _ in 0..300 {
        let refused = rooms
            .get_room(v1::GetRoomRequest {
                join_code: created.join_code.clone(),
                ..v1::GetRoomRequest::default()
            })
            .await
            .expect_err("no room has it");
        assert_eq!(reason(&refused), "JOIN_CODE_WRONG");
    }
}

#[tokio::test]
async fn invalid_requests_are_refused_with_the_field() {
    let server = TestServer::start().await;
    let mut service = TournamentServiceClient::new(server.channel().await);
    let swiss = v1::TournamentFormat::Swiss.into();
    let named = |format| v1::TournamentSettings {
        name: "Coppa".into(),
        format,
        ..v1::TournamentSettings::default()
    };
    let cases = [
        (named(0), "SETTINGS_REFUSED", "format"),
        (
            v1::TournamentSettings {
                name: String::new(),
                ..named(swiss)
            },
            "NAME_REFUSED",
            "name",
        ),
        (
            v1::TournamentSettings {
                rules: Some(v1::RuleSet {
                    players: Some(9),
                    ..v1::RuleSet::default()
                }),
                ..named(swiss)
            },
            "RULE_SET_REFUSED",
            "rules",
        ),
        (
            v1::TournamentSettings {
                policy: Some(v1::RoomPolicy {
                    abort: v1::AbortPolicy::AnyLost.into(),
                    ..v1::RoomPolicy::default()
                }),
                ..named(swiss)
            },
            "POLICY_REFUSED",
            "policy",
        ),
        (
            v1::TournamentSettings {
                deals: v1::TournamentDeals::SameAtAllTables.into(),
                policy: Some(v1::RoomPolicy {
                    spectators: Some(true),
                    ..v1::RoomPolicy::default()
                }),
                ..named(swiss)
            },
            "POLICY_REFUSED",
            "policy",
        ),
        (
            v1::TournamentSettings {
                policy: Some(v1::RoomPolicy {
                    durability: v1::Durability::Durable.into(),
                    ..v1::RoomPolicy::default()
                }),
                ..named(swiss)
            },
            "POLICY_REFUSED",
            "policy",
        ),
        (
            v1::TournamentSettings {
                rules: Some(v1::RuleSet {
                    stop: Some(v1::rule_set::Stop::TargetShifts(1_001)),
                    ..v1::RuleSet::default()
                }),
                ..named(swiss)
            },
            "RULE_SET_REFUSED",
            "rules",
        ),
        (
            v1::TournamentSettings {
                built_in_agents: vec!["nobody".into()],
                ..named(swiss)
            },
            "SETTINGS_REFUSED",
            "built_in_agents",
        ),
        (
            v1::TournamentSettings {
                draw_seed: vec![1],
                ..named(swiss)
            },
            "SETTINGS_REFUSED",
            "draw_seed",
        ),
        (
            v1::TournamentSettings {
                max_calls: 99,
                ..named(swiss)
            },
            "SETTINGS_REFUSED",
            "max_calls",
        ),
        (
            v1::TournamentSettings {
                physical_tables: 1,
                deals: v1::TournamentDeals::SameAtAllTables.into(),
                ..named(swiss)
            },
            "SETTINGS_REFUSED",
            "physical_tables",
        ),
        (
            v1::TournamentSettings {
                physical_tables: 1,
                deal_seed: vec![1; 32],
                ..named(swiss)
            },
            "SETTINGS_REFUSED",
            "deal_seed",
        ),
        (
            v1::TournamentSettings {
                physical_tables: 1,
                rules: Some(v1::RuleSet {
                    opening: v1::Opening::AnyTopFace.into(),
                    ..v1::RuleSet::default()
                }),
                ..named(swiss)
            },
            "RULE_SET_REFUSED",
            "rules",
        ),
    ];
    for (settings, reason, field) in cases {
        let request = v1::CreateTournamentRequest {
            settings: Some(settings),
            ..Default::default()
        };
        let refused = service.create_tournament(request).await;
        let refused = refused.expect_err("a refusal");
        assert_eq!(refused.code(), Code::InvalidArgument, "{refused:?}");
        let info = refused.get_details_error_info().expect("error info");
        assert_eq!(info.reason, reason);
        assert_eq!(info.metadata["field"], field);
    }
    let created = create(
        &mut service,
        v1::TournamentSettings {
            deals: v1::TournamentDeals::Rotated.into(),
            kinds: vec![v1::ParticipantKind::Agent.into()],
            max_participants: 2,
            ..named(swiss)
        },
    )
    .await;
    let ask = |name: &str| v1::JoinTournamentRequest {
        join_code: created.join_code.clone(),
        name: name.to_owned(),
        stateless: true,
        ..v1::JoinTournamentRequest::default()
    };
    let first = service.join_tournament(ask("Ada")).await;
    let first = first.expect("joined").into_inner();
    let described = first.tournament.expect("a tournament");
    assert_eq!(described.participants.len(), 1);
    let listed = service
        .list_tournaments(v1::ListTournamentsRequest::default())
        .await;
    let mut listed = listed.expect("a page").into_inner().tournaments;
    // Without its participants it is the same.
    assert_eq!(listed[0].participants, []);
    listed[0].participants.clone_from(&described.participants);
    assert_eq!(listed, [described]);
    let no_kind = v1::GetLeaderboardRequest {
        kind: 77,
        ..v1::GetLeaderboardRequest::default()
    };
    let refused = service
        .get_leaderboard(no_kind)
        .await
        .expect_err("an unknown kind");
    let info = refused.get_details_error_info().expect("error info");
    assert_eq!(info.reason, "KIND_REFUSED");
    let joins = [
        (
            v1::JoinTournamentRequest {
                join_code: "WRONG".into(),
                ..ask("Bo")
            },
            "JOIN_CODE_WRONG",
        ),
        (
            v1::JoinTournamentRequest {
                tournament_id: "0".repeat(32),
                ..ask("Bo")
            },
            "TOURNAMENT_UNKNOWN",
        ),
        (
            v1::JoinTournamentRequest {
                kind: v1::ParticipantKind::Human.into(),
                ..ask("Bo")
            },
            "KIND_NOT_ADMITTED",
        ),
        (
            v1::JoinTournamentRequest {
                stateless: false,
                ..ask("Bo")
            },
            "NOT_STATELESS",
        ),
        (
            v1::JoinTournamentRequest {
                max_games: 65,
                ..ask("Bo")
            },
            "MAX_GAMES_REFUSED",
        ),
        (ask(" Ada "), "NAME_TAKEN"),
        (ask(""), "NAME_REFUSED"),
    ];
    for (request, reason) in joins {
        let refused = service.join_tournament(request).await;
        let refused = refused.expect_err("a refusal");
        let info = refused.get_details_error_info().expect("error info");
        assert_eq!(info.reason, reason);
    }
    let at_table =
        |created: &v1::CreateTournamentResponse, name: &str| v1::AddTableParticipantRequest {
            tournament_id: id_of(created),
            owner_token: created.owner_token.clone(),
            name: name.to_owned(),
            ..v1::AddTableParticipantRequest::default()
        };
    let with_tables = create(
        &mut service,
        v1::TournamentSettings {
            physical_tables: 1,
            max_participants: 2,
            ..named(swiss)
        },
    )
    .await;
    let adding = v1::AddTableParticipantRequest {
        request_id: vec![5; 32],
        ..at_table(&with_tables, "Ada")
    };
    let added = service.add_table_participant(adding.clone());
    let added = added.await.expect("added").into_inner();
    let again = service.add_table_participant(adding.clone());
    let again = again.await.expect("added before").into_inner();
    assert_eq!(again.participant, added.participant);
    let ada = &added.tournament.expect("a tournament").participants[0];
    assert!(ada.at_table && ada.connected && ada.kind() == v1::ParticipantKind::Human);
    let joined = service.join_tournament(v1::JoinTournamentRequest {
        join_code: with_tables.join_code.clone(),
        ..ask("Ada")
    });
    let refused = joined.await.expect_err("the name of the one at the table");
    let info = refused.get_details_error_info().expect("error info");
    assert_eq!(info.reason, "NAME_TAKEN");
    let strangers = v1::AddTableParticipantRequest {
        owner_token: "00".repeat(48),
        ..at_table(&with_tables, "Bo")
    };
    let unknown_kind = v1::AddTableParticipantRequest {
        kind: 77,
        ..at_table(&with_tables, "Bo")
    };
    for (request, reason) in [
        (
            v1::AddTableParticipantRequest {
                name: "Bo".into(),
                ..adding
            },
            "REQUEST_ID_USED",
        ),
        (at_table(&created, "Bo"), "NO_PHYSICAL_TABLES"),
        (at_table(&with_tables, "Ada"), "NAME_TAKEN"),
        (at_table(&with_tables, ""), "NAME_REFUSED"),
        (unknown_kind, "KIND_REFUSED"),
        (strangers, "OWNER_TOKEN_WRONG"),
    ] {
        let refused = service.add_table_participant(request).await;
        let refused = refused.expect_err("a refusal");
        let info = refused.get_details_error_info().expect("error info");
        assert_eq!(info.reason, reason);
    }
    let early = v1::StartTournamentRequest {
        tournament_id: id_of(&created),
        owner_token: created.owner_token.clone(),
    };
    let stranger = v1::StartTournamentRequest {
        owner_token: "00".repeat(48),
        ..early.clone()
    };
    for (request, reason) in [
        (stranger, "OWNER_TOKEN_WRONG"),
        (early, "TOO_FEW_PARTICIPANTS"),
    ] {
        let refused = service.start_tournament(request).await;
        let refused = refused.expect_err("a refusal");
        let info = refused.get_details_error_info().expect("error info");
        assert_eq!(info.reason, reason);
    }
    // A closed tournament accepts no participants.
    let close = v1::CloseTournamentRequest {
        tournament_id: id_of(&created),
        owner_token: created.owner_token.clone(),
    };
    let closed = service.close_tournament(close).await.expect("closed");
    let closed = closed.into_inner().tournament.expect("a tournament");
    assert_eq!(closed.state(), v1::TournamentState::Closed);
    let refused = service.join_tournament(ask("Bo")).await;
    assert_eq!(
        refused.expect_err("it is over").code(),
        Code::FailedPrecondition
    );
}
