//! Making tournaments.

use futures::FutureExt as _;

use super::*;
use crate::config::ServerConfig;
use crate::store::{SqliteStore, Store};

#[tokio::test]
async fn a_tournament_is_made_to_its_end_though_nobody_waits_for_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = SqliteStore::open(folder.path()).await.expect("a new one");
    let store: Arc<dyn Store> = Arc::new(store);
    let tracker = TaskTracker::new();
    let rooms = Rooms::new(
        &ServerConfig::default(),
        Arc::clone(&store),
        tracker.clone(),
    );
    let tournaments = Tournaments::new(rooms, tracker.clone());
    let settings = chefshat_proto::v1::TournamentSettings {
        format: chefshat_proto::v1::TournamentFormat::Swiss.into(),
        ..Default::default()
    };
    let plan = convert::tournament_plan(&settings, [7; 32]).expect("it can be held");
    // Whoever asked goes away while it is being kept.
    let asked = tournaments.create("Coppa", plan).now_or_never();
    assert!(asked.is_none(), "it takes a while");
    tournaments.end();
    tracker.close();
    tracker.wait().await;

    let made = tournaments.newest(None, None, 9);
    let [(_, hosted)] = made.as_slice() else {
        panic!("not one: {made:?}");
    };
    let found = tournaments.get(hosted.id()).expect("found by its id");
    assert_eq!(found.id(), hosted.id());
    let code = hosted.join_code().to_lowercase();
    let found = tournaments.by_code(&code).expect("found by its code");
    assert_eq!(found.id(), hosted.id());
    let kept = store.tournaments(0).await.expect("readable");
    assert_eq!(kept.len(), 1);
    assert!(tournaments.get(Id::random()).is_none());
    assert!(tournaments.by_code("").is_none());
}
