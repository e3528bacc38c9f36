//! Attachments of a stream to what is not in the memory of a node of a cluster: another node has it,
//! or nobody for the moment, because it is being taken over. They are parked and looked for beside
//! the reader, which continues to read: the other seats of the stream are not delayed, and keep their
//! stream however long the search takes.

use std::collections::{BTreeMap, BTreeSet};
use std::pin::Pin;
use std::task::{Context, Poll, ready};

use chefshat_proto::v1;
use chefshat_room::ids::UnitToken;
use futures::{StreamExt as _, stream};
use tokio::time::{Instant, Sleep, sleep};
use tokio_util::task::AbortOnDropHandle;
use tonic::Status;

use super::waiting::WaitingCommand;
use crate::grpc::takeover::{PATIENCE, Pauses};

/// Most attachments of one stream that are looked for at a time.
const LOOKS_AT_ONCE: usize = 8;

/// An attachment that waits for its room or tournament.
pub(super) struct Parked {
    pub(super) attach: v1::Attach,
    pub(super) since: Instant,
    /// Its commands that have been read meanwhile.
    pub(super) commands: Vec<WaitingCommand>,
}

impl Parked {
    pub(super) fn new(attach: v1::Attach) -> Self {
        Self {
            attach,
            since: Instant::now(),
            commands: Vec::new(),
        }
    }

    /// Whether it has waited for longer than a client's longest pause.
    pub(super) fn is_overdue(&self) -> bool {
        self.since.elapsed() >= PATIENCE
    }

    /// Whether it has this secret, as a participant of a tournament and its seats have the same.
    pub(super) fn has_secret(&self, secret: &[u8; 32]) -> bool {
        UnitToken::parse(&self.attach.ticket).is_some_and(|token| token.secret == *secret)
    }
}

/// What a search has found: the handle of an attachment, and whether this node has its room or
/// tournament and the caller reaches it.
pub(super) type Found = (u32, Result<(), Status>);

/// Looks for several attachments; those that change hands are not among what it returns.
type Search = AbortOnDropHandle<Vec<Found>>;

/// The attachments of a stream that wait.
pub(super) struct Parking {
    waiting: BTreeMap<u32, Parked>,
    /// Those that have not been looked for.
    fresh: BTreeSet<u32>,
    search: Option<Search>,
    /// Until all are looked for again.
    pause: Pin<Box<Sleep>>,
    pauses: Pauses,
}

impl Parking {
    pub(super) fn new() -> Self {
        let mut pauses = Pauses::new();
        Self {
            waiting: BTreeMap::new(),
            fresh: BTreeSet::new(),
            search: None,
            pause: Box::pin(sleep(pauses.next())),
            pauses,
        }
    }

    pub(super) fn count(&self) -> usize {
        self.waiting.len()
    }

    /// The waiting attachments.
    pub(super) fn attachments(&self) -> impl Iterator<Item = &v1::Attach> {
        self.waiting.values().map(|parked| &parked.attach)
    }

    pub(super) fn get(&self, handle: u32) -> Option<&Parked> {
        self.waiting.get(&handle)
    }

    pub(super) fn get_mut(&mut self, handle: u32) -> Option<&mut Parked> {
        self.waiting.get_mut(&handle)
    }

    /// Adds an attachment, which is looked for at once.
    pub(super) fn park(&mut self, handle: u32, attach: v1::Attach) {
        if self.waiting.is_empty() {
            self.pauses = Pauses::new();
        }
        self.fresh.insert(handle);
        self.waiting.insert(handle, Parked::new(attach));
    }

    /// Adds an attachment again that was found where it could not be attached. It is looked for
    /// after the next pause.
    pub(super) fn park_again(&mut self, handle: u32, parked: Parked) {
        self.waiting.insert(handle, parked);
    }

    pub(super) fn take(&mut self, handle: u32) -> Option<Parked> {
        self.fresh.remove(&handle);
        self.waiting.remove(&handle)
    }

    /// Whether an attachment with this secret was parked before this handle.
    pub(super) fn has_before(&self, handle: u32, secret: &[u8; 32]) -> bool {
        let mut before = self.waiting.range(..handle);
        before.any(|(_, parked)| parked.has_secret(secret))
    }

    /// Whether an attachment has waited for so long that its client should rather try another node.
    pub(super) fn is_overdue(&self) -> bool {
        self.waiting.values().any(Parked::is_overdue)
    }

    /// Waits for the end of the next search; what it has found is still parked. `begin` begins one:
    /// for the first of two lists, and for the second one if that finds something.
    pub(super) fn poll_found(
        &mut self,
        context: &mut Context<'_>,
        begin: impl FnOnce(Vec<(u32, UnitToken)>, Vec<(u32, UnitToken)>) -> Search,
    ) -> Poll<Vec<Found>> {
        if self.search.is_none() {
            if self.waiting.is_empty() {
                return Poll::Pending;
            }
            let is_time = self.pause.as_mut().poll(context).is_ready();
            let fresh = std::mem::take(&mut self.fresh);
            let all = self.tokens(|_| true);
            let first = match is_time {
                true => all.clone(),
                false if fresh.is_empty() => return Poll::Pending,
                false => self.tokens(|handle| fresh.contains(&handle)),
            };
            self.search = Some(begin(first, all));
        }
        let search = self.search.as_mut().expect("just begun");
        // If it has failed, it begins again after the pause.
        let found = ready!(Pin::new(search).poll(context)).unwrap_or_default();
        self.search = None;
        let next = self.pauses.next();
        self.pause.as_mut().reset(Instant::now() + next);
        Poll::Ready(found)
    }

    fn tokens(&self, is_meant: impl Fn(u32) -> bool) -> Vec<(u32, UnitToken)> {
        let meant = self.waiting.iter().filter(|(handle, _)| is_meant(**handle));
        let tokens = meant.filter_map(|(handle, parked)| {
            let token = UnitToken::parse(&parked.attach.ticket)?;
            Some((*handle, token))
        });
        tokens.collect()
    }
}

/// Looks for the first attachments; `look` returns `None` for one that changes hands. If something is
/// found, it looks for all that were parked before it too: the seats of a participant, which its
/// client attaches before it, change hands together with it, and must not be attached after it.
pub(super) async fn search<F>(
    mut first: Vec<(u32, UnitToken)>,
    all: Vec<(u32, UnitToken)>,
    look: impl Fn(UnitToken) -> F,
) -> Vec<Found>
where
    F: Future<Output = Option<Result<(), Status>>>,
{
    let mut found = BTreeMap::new();
    loop {
        let looks = first.iter().copied().map(|(handle, token)| {
            let look = look(token);
            async move { (handle, look.await) }
        });
        let looked: Vec<_> = (stream::iter(looks).buffer_unordered(LOOKS_AT_ONCE))
            .collect()
            .await;
        let before = found.len();
        let settled = looked.into_iter();
        found.extend(settled.filter_map(|(handle, it)| Some((handle, it?))));
        let last = found.keys().next_back().copied();
        first = (all.iter().copied())
            .filter(|(handle, _)| last.is_some_and(|it| *handle < it))
            .filter(|(handle, _)| !found.contains_key(handle))
            .collect();
        if found.len() == before || first.is_empty() {
            return found.into_iter().collect();
        }
    }
}
