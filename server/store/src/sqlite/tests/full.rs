//! A full disk, which is a database that may have no more pages: what frees space does not wait
//! behind what needs it.

use tokio::sync::{mpsc, oneshot, watch};
use tokio::task::JoinHandle;
use tokio::time::timeout;

use super::*;
use crate::StoreError;
use crate::sqlite::open::{self, IfGone};
use crate::sqlite::space::Space;
use crate::sqlite::writer::{self, Pending, Row, WriteCommand};
use crate::units::{UnitKey, UnitWrite};
use chefshat_base::metrics::StoreMetrics;

/// Longest time that a test waits for a commit.
const LIMIT: Duration = Duration::from_secs(20);

type Reply = oneshot::Receiver<Result<(), StoreError>>;

async fn send(commands: &mpsc::Sender<Pending>, command: WriteCommand) -> Reply {
    let (reply, committed) = oneshot::channel();
    let sent = commands.send((command, reply)).await;
    assert!(sent.is_ok(), "the writer runs");
    committed
}

async fn committed(reply: Reply) {
    let answer = timeout(LIMIT, reply).await.expect("in time");
    assert_eq!(answer.expect("an answer"), Ok(()));
}

fn imported(number: u8) -> WriteCommand {
    WriteCommand::Import {
        number: i64::from(number),
        game_id: id(number),
        record: vec![number; 400_000],
        summary: Box::new(v1::RecordSummary {
            state: v1::RoomState::Finished.into(),
            added: true,
            ..v1::RecordSummary::default()
        }),
    }
}

/// A writer whose database may have few pages, and the sender of its commands, of which `queue` may
/// wait.
async fn small_writer(
    folder: &Path,
    queue: usize,
) -> (mpsc::Sender<Pending>, Arc<Space>, JoinHandle<()>) {
    let opened = open::open(folder, IfGone::CreateFirst).await;
    let mut opened = opened.expect("a new database");
    let text = "PRAGMA max_page_count = 300";
    opened.writer.execute(text).await.expect("a small limit");
    let space = Space::new(folder);
    let (commands, queue) = mpsc::channel(queue);
    let (failed, _) = watch::channel(None);
    let metrics = StoreMetrics::default();
    let running = writer::run(opened.writer, 0, queue, failed, metrics, Arc::clone(&space));
    (commands, space, tokio::spawn(running))
}

async fn full(space: &Space) {
    while !space.is_full() {
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

#[tokio::test]
async fn deletions_go_first_while_the_disk_is_full() {
    let folder = tempfile::tempdir().expect("a folder");
    let (commands, space, running) = small_writer(folder.path(), writer::QUEUE).await;
    for game in [1, 2] {
        committed(send(&commands, imported(game)).await).await;
    }
    let study = UnitKey::Study(id(9));
    let create = UnitWrite::Create {
        join_code: None,
        header: Vec::new(),
        first: None,
    };
    committed(send(&commands, WriteCommand::Unit(study, create)).await).await;

    let mut third = send(&commands, imported(3)).await;
    full(&space).await;
    let mut fourth = send(&commands, imported(4)).await;
    let delete = WriteCommand::Unit(study, UnitWrite::Delete);
    committed(send(&commands, delete).await).await;
    assert!(third.try_recv().is_err() && fourth.try_recv().is_err());
    let games = vec![id(1), id(2)];
    committed(send(&commands, WriteCommand::Prune { games }).await).await;
    committed(third).await;
    committed(fourth).await;
    assert!(!space.is_full());
    drop(commands);
    running.await.expect("it ends");
}

#[tokio::test]
async fn deletions_go_first_however_many_rooms_wait() {
    const ROOMS: u16 = 6_000;
    let folder = tempfile::tempdir().expect("a folder");
    // All of them wait for the writer at once, and the deletion after them.
    let (commands, space, running) = small_writer(folder.path(), 2 * usize::from(ROOMS)).await;
    for game in [1, 2] {
        committed(send(&commands, imported(game)).await).await;
    }
    let third = send(&commands, imported(3)).await;
    full(&space).await;
    let mut rooms = Vec::new();
    for number in 1..=i64::from(ROOMS) {
        let row = Row {
            number,
            game: 10 + number,
            position: 0,
            previous: None,
            entries: vec![1],
            raises_form: false,
        };
        rooms.push(send(&commands, WriteCommand::Append(row)).await);
    }
    let games = vec![id(1), id(2)];
    committed(send(&commands, WriteCommand::Prune { games }).await).await;
    committed(third).await;
    for room in rooms {
        committed(room).await;
    }
    drop(commands);
    running.await.expect("it ends");
}
