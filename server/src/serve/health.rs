//! What health checks say: whether the server serves.

use tokio::sync::watch;
use tonic_health::ServingStatus;
use tonic_health::server::HealthReporter;
use tracing::warn;

use crate::metrics::StoreMetrics;

/// Reports whether the server serves: a node while it has a lease and once it has been reached, and
/// each while what it writes is committed.
pub(super) async fn report(
    health: HealthReporter,
    mut node: Option<watch::Receiver<bool>>,
    written: Option<StoreMetrics>,
) {
    let mut was_stalled = false;
    loop {
        let node_serves = node.as_mut().is_none_or(|it| *it.borrow_and_update());
        let is_stalled = written.as_ref().is_some_and(StoreMetrics::is_stalled);
        let status = match node_serves && !is_stalled {
            true => ServingStatus::Serving,
            false => ServingStatus::NotServing,
        };
        health.set_service_status("", status).await;
        if is_stalled && !was_stalled {
            warn!("nothing has been committed for a while: health checks fail until something is");
        } else if was_stalled && !is_stalled {
            warn!("something has been committed: health checks pass again");
        }
        was_stalled = is_stalled;
        let node_changes = async {
            match &mut node {
                // Its node has ended otherwise.
                Some(node) => node.changed().await.is_ok(),
                None => std::future::pending().await,
            }
        };
        let stall_changes = async {
            match &written {
                Some(written) => written.is_not(is_stalled).await,
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            has_node = node_changes => if !has_node { return },
            () = stall_changes => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use tokio::time::sleep;
    use tonic_health::pb::HealthCheckRequest;
    use tonic_health::pb::health_client::HealthClient;

    use super::*;

    #[tokio::test(start_paused = true)]
    async fn a_server_serves_while_it_has_a_lease_and_commits() {
        let (reporter, service) = tonic_health::server::health_reporter();
        let (lease, has_lease) = watch::channel(true);
        let written = StoreMetrics::default();
        let reporting = report(reporter, Some(has_lease), Some(written.clone()));
        let _reporting = tokio_util::task::AbortOnDropHandle::new(tokio::spawn(reporting));
        let serves = async || {
            // Longer than a stall takes to be noticed.
            sleep(Duration::from_secs(15)).await;
            let mut health = HealthClient::new(service.clone());
            let answer = health.check(HealthCheckRequest::default()).await;
            let status = answer.expect("it is known").into_inner().status();
            status == tonic_health::pb::health_check_response::ServingStatus::Serving
        };
        assert!(serves().await);
        lease.send_replace(false);
        assert!(!serves().await, "no lease");
        lease.send_replace(true);
        assert!(serves().await);
        let waits = written.waits();
        assert!(!serves().await, "nothing is committed");
        lease.send_replace(false);
        assert!(!serves().await, "neither");
        lease.send_replace(true);
        assert!(!serves().await, "nothing is committed");
        written.committed(1, Duration::ZERO);
        drop(waits);
        assert!(serves().await);
    }
}
