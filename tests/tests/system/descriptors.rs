//! A server that runs out of file descriptors. It leaves some for everything else, so this happens
//! only if the system takes them away, as the tests here do.
#![cfg(target_os = "linux")]

use std::time::Duration;

use chefshat_client::Client;
use chefshat_tests::{Launch, Process, patiently};
use rustix::process::{Pid, Resource, Rlimit, prlimit};

/// File descriptors that the test leaves free.
const LEFT: usize = 5;

/// Number of open file descriptors of a process, and the first number above them.
fn open_descriptors(process: &Process) -> (usize, u64) {
    let folder = std::fs::read_dir(format!("/proc/{}/fd", process.id())).expect("it runs");
    let numbers = folder.map(|entry| {
        let name = entry.expect("it runs").file_name();
        name.to_string_lossy().parse::<u64>().expect("a number")
    });
    let numbers: Vec<_> = numbers.collect();
    (numbers.len(), numbers.iter().max().expect("some") + 1)
}

fn limit_descriptors(process: &Process, most: u64) {
    let pid = Pid::from_raw(i32::try_from(process.id()).expect("a process id"));
    let limit = Rlimit {
        current: Some(most),
        maximum: Some(most),
    };
    prlimit(pid, Resource::Nofile, limit).expect("it is a child of this process");
}

/// A client that a server serves.
async fn served(url: &str) -> Option<Client> {
    let client = Client::connect(url).await.ok()?;
    client.server_info().await.ok()?;
    Some(client)
}

#[tokio::test]
async fn without_descriptors_clients_are_refused_at_once_and_served_when_there_are_some() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut launch = Launch::new(folder.path());
    let server = launch.start().await.expect("it starts");
    let url = launch.url();
    let first = served(&url).await.expect("there are descriptors");

    let (open, above) = open_descriptors(&server);
    let most = above + LEFT as u64;
    limit_descriptors(&server, most);
    let free = usize::try_from(most).expect("few") - open;
    let mut held = Vec::new();
    // The others do not hang: the server gives up its reserve to close their connections.
    patiently("a client to be refused", async {
        while let Some(client) = served(&url).await {
            held.push(client);
        }
    })
    .await;
    assert!((1..=free).contains(&held.len()), "{} of {free}", held.len());
    for _ in 0..3 {
        let refused = served(&url);
        assert!(patiently("a client to be refused", refused).await.is_none());
    }
    first.server_info().await.expect("it stays connected");

    drop(held);
    patiently("a client to be served", async {
        while served(&url).await.is_none() {
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    })
    .await;
    let said = server.stop().await.said;
    assert!(said.contains("OUT_OF_DESCRIPTORS"), "{said}");
}
