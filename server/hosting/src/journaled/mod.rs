//! What tournaments and studies have in common. A unit is a value that changes by the entries of its
//! journal, and one task (`actor`) that commits entries before it publishes them or acts on them.
//! Others reach it through its `handle`, which the `registry` of all units of a kind finds. What the
//! entries of a unit bring about (streams of participants, rooms of games) is in its own module.
//!
//! A room is not such a unit: its task decides on answers in microseconds (`room/`).

mod actor;
mod handle;
mod registry;
mod table;

use std::sync::Arc;

use tokio::sync::mpsc;
use tokio::time::Instant;

pub(crate) use actor::Unit;
pub use handle::{Handle, Stopped};
pub use registry::{CreateProblem, Folded, Registry};
pub(crate) use registry::{New, owner_of};

use crate::rooms::Rooms;
use chefshat_admission::limits::{Key, Refused};
use chefshat_base::tasks::LongTask;
use chefshat_room::ids::{Id, SecretHash};
use chefshat_store::StoreError;
use chefshat_store::units::{StoredUnit, UnitKind};

/// What a unit is from its creation on.
pub trait UnitHeader: Send + Sync {
    /// The unit.
    fn id(&self) -> Id;
    /// The hash of the owner token.
    fn owner(&self) -> &SecretHash;
    /// When it was created, milliseconds since the Unix epoch.
    fn created_at_ms(&self) -> u64;
    /// Its join code in its normal form, if it has one.
    fn join_code(&self) -> Option<&str> {
        None
    }
}

/// A kind of unit, and the effects that its entries have. The actor decides when each method is
/// called; until the server stops, in the order in which they stand here.
pub trait Journaled: Sized + Send + Sync + 'static {
    /// What does not change.
    type Header: UnitHeader;
    /// The settings, prepared.
    type Plan: Send + Sync;
    /// The value that changes.
    type State: Clone + Send + Sync;
    /// An entry of the journal.
    type Entry: Clone + Send + Sync;
    /// What a handle sends to the task.
    type Message: Send;
    /// What readers of one unit share besides its state.
    type Shared: Send + Sync;
    /// What all units of the kind share.
    type Common: Send + Sync;
    /// Why settings are refused.
    type SettingsProblem: std::error::Error + Send + 'static;

    /// The kind.
    const KIND: UnitKind;
    /// Its name in messages, in the plural.
    const NAMES: &'static str;
    /// Its task.
    const TASK: LongTask;
    /// What creates one.
    const CREATION: &'static str;
    /// Messages that wait for the task, at most.
    const MAILBOX: usize;
    /// Most units of the kind that are not over.
    const MOST: usize;

    /// The encoding of a header.
    fn header_to_bytes(header: &Self::Header) -> Vec<u8>;
    /// The encoding of entries, a row of the journal.
    fn row_to_bytes(entries: &[Self::Entry]) -> Vec<u8>;
    /// Folds what is stored of a unit. This may take long.
    ///
    /// # Errors
    /// Why this version cannot read it.
    fn fold(id: Id, stored: &StoredUnit) -> Result<Folded<Self>, String>;
    /// What readers of a unit that was in the store share.
    fn share(common: &Self::Common, folded: &Folded<Self>) -> Self::Shared;
    /// Handles a unit that cannot be read.
    fn set_unreadable(_id: Id, _rooms: &Rooms) {}
    /// Who is charged for the games of a unit whose creator is unknown.
    fn key_of(id: Id) -> Key;
    /// The refusal of a unit whose creator, or the server, has this number already.
    fn too_many(limit: u64) -> Refused;
    /// Applies an entry.
    fn apply(state: &mut Self::State, entry: &Self::Entry);
    /// Whether nothing can change any more. Such a unit has no task, and makes room for others.
    fn is_over(state: &Self::State) -> bool;
    /// Prepares what others may see of a unit before they can find it.
    fn enter(_handle: &Handle<Self>, _rooms: &Arc<Rooms>) {}
    /// Creates the task of a unit.
    fn new(unit: Unit<Self>, common: &Self::Common) -> Self;
    /// What every unit has.
    fn unit(&self) -> &Unit<Self>;
    /// What every unit has.
    fn unit_mut(&mut self) -> &mut Unit<Self>;

    /// Processes a message.
    fn receive(
        &mut self,
        message: Self::Message,
    ) -> impl Future<Output = Result<(), StoreError>> + Send;
    /// Adds the entries that follow now by themselves. Not called once the server stops.
    fn follow(&mut self) -> impl Future<Output = Result<(), StoreError>> + Send;
    /// Announces committed entries, which the handle shows by now.
    fn announce(&mut self, entries: &[Self::Entry]);
    /// Acts on what is committed. Not called once the server stops.
    fn act(&mut self) -> impl Future<Output = Result<(), StoreError>> + Send;
    /// Deletes what is to be deleted, if nothing is pending.
    fn delete(&mut self) -> impl Future<Output = Result<(), StoreError>> + Send {
        std::future::ready(Ok(()))
    }
    /// Whether the task ends because the unit is over or deleted, after its last messages have been
    /// answered.
    fn conclude(
        &mut self,
        inbox: &mut mpsc::Receiver<Self::Message>,
    ) -> impl Future<Output = Result<bool, StoreError>> + Send;
    /// When something is due by itself.
    fn wake_at(&self) -> Option<Instant>;
    /// Ends the streams of participants, which may reconnect, because the unit stops here.
    fn end_streams(&mut self) {}
}
