//! Work on large messages beside the tasks of the runtime.

use std::sync::mpsc;
use std::time::Duration;

use chefshat_proto::codec::{LARGE, beside_tasks};

/// On a runtime with one worker, another task runs while a large message is worked on: the work
/// waits for it.
#[tokio::test(flavor = "multi_thread", worker_threads = 1)]
async fn others_run_beside_a_large_message() {
    let (sender, received) = mpsc::channel();
    let working = tokio::spawn(async move {
        let other = tokio::spawn(async move { sender.send(()) });
        let met = beside_tasks(LARGE, || received.recv_timeout(Duration::from_secs(60)));
        (met, other.await)
    });
    let (met, other) = working.await.expect("no panic");
    assert_eq!(met, Ok(()));
    other.expect("no panic").expect("received");
}

#[tokio::test]
async fn a_runtime_of_one_thread_works_in_place() {
    assert_eq!(beside_tasks(LARGE, || 7), 7);
}
