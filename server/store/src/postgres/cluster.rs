//! Nodes, and who owns what. See [`ClusterStore`].

use std::ops::Range;
use std::sync::atomic::Ordering;
use std::time::Duration;

use async_trait::async_trait;
use chefshat_cluster::{LeaseTimes, Load};
use chefshat_engine::RULES_VERSION;
use futures::FutureExt as _;
use futures::future::pending;
use sqlx::postgres::{PgConnection, PgRow};
use sqlx::{Connection as _, Row as _};

use super::claims::{Claims, claim};
use super::handover::{Handed, release};
use super::partitions;
use super::values::{ROOM, kind_of, millis, text};
use super::{PostgresStore, lock};
use crate::cluster::{
    Beat, ClusterStore, Epoch, Heartbeat, LivingNode, LoadedUnit, Location, NodeId, NodeInfo,
    NodeStatus, Subject, WithoutNode,
};
use crate::form::FORM;
use crate::sql::integer;
use crate::{ResumableGame, StoreError};
use chefshat_room::ids::{GameId, Id, RoomId, UnitId};

/// Nodes that own nothing and have not beaten for this long are forgotten.
const FORGET_NODES_AFTER_MS: i64 = 24 * 60 * 60 * 1_000;
/// The number of a node is drawn at random: no two processes have the same, even if the database has gone
/// back in time and with it what it would count. Earlier versions counted from 1.
const NODE_NUMBERS: Range<i64> = 1 << 20..1 << 31;
/// How often a claim is tried again because the last owner has just written something.
const CLAIM_ATTEMPTS: usize = 5;
/// The columns of `location`.
macro_rules! locations {
    ($rest:literal) => {
        concat!(
            "SELECT id, kind, unit, node, epoch, over FROM owned ",
            $rest
        )
    };
}

impl PostgresStore {
    /// One attempt to claim units.
    async fn try_claim(&self, orphans: &[(UnitId, Epoch)]) -> Result<Claims, StoreError> {
        let (node, expire_after) = (self.node()?, self.expire_after());
        let orphans = orphans.to_vec();
        let claims = self.control.read(move |connection| {
            async move {
                let mut transaction = connection.begin().await?;
                let claims = claim(&mut transaction, node, expire_after, &orphans).await?;
                match claims {
                    Claims::Made(_) => transaction.commit().await?,
                    Claims::Busy => transaction.rollback().await?,
                }
                Ok(claims)
            }
            .boxed()
        });
        claims.await
    }

    async fn claim_one(&self, orphan: (UnitId, Epoch)) -> Result<Option<Epoch>, StoreError> {
        for _ in 0..CLAIM_ATTEMPTS {
            if let Claims::Made(mut claimed) = self.try_claim(&[orphan]).await? {
                return Ok(claimed.pop().flatten());
            }
        }
        Ok(None)
    }

    /// What is not over, survives its node and belongs to no node that lives.
    ///
    /// # Errors
    /// The database does not answer.
    pub async fn without_node(&self) -> Result<WithoutNode, StoreError> {
        let expire_after = self.expire_after();
        let counts = self.reader.read(move |connection| {
            sqlx::query(
                "SELECT count(*) FILTER (WHERE kind = 0) AS rooms, count(*) FILTER (WHERE kind = 1) AS tournaments,
                        count(*) FILTER (WHERE kind = 2) AS studies
                 FROM owned
                 WHERE NOT over AND durable
                   AND (node IS NULL OR node = ANY (ARRAY (SELECT node FROM nodes WHERE beat_ms + $1 <= clock_ms())))",
            )
            .bind(expire_after)
            .fetch_one(connection)
            .boxed()
        });
        let counts = counts.await?;
        Ok(WithoutNode {
            rooms: number(&counts, "rooms"),
            tournaments: number(&counts, "tournaments"),
            studies: number(&counts, "studies"),
        })
    }

    /// When leases expire, milliseconds after a beat.
    fn expire_after(&self) -> i64 {
        integer(self.options.lease.expire_after_ms())
    }

    async fn locate_where(
        &self,
        query: &'static str,
        value: LocatedBy,
    ) -> Result<Option<Location>, StoreError> {
        let row = self.reader.read(|connection| {
            let query = sqlx::query(query);
            match value {
                LocatedBy::Id(id) => query.bind(id.to_vec()),
                LocatedBy::Code(code) => query.bind(code),
            }
            .fetch_optional(connection)
            .boxed()
        });
        row.await?.as_ref().map(location).transpose()
    }
}

enum LocatedBy {
    Id([u8; 16]),
    Code(String),
}

#[async_trait]
impl ClusterStore for PostgresStore {
    fn lease(&self) -> LeaseTimes {
        self.options.lease
    }

    async fn join(&self, info: NodeInfo) -> Result<NodeId, StoreError> {
        let node: i64 = (self.control.read(|connection| {
            sqlx::query_scalar(
                "WITH forgotten AS (
                     DELETE FROM nodes WHERE beat_ms < clock_ms() - $6
                       AND NOT EXISTS (SELECT FROM owned WHERE owned.node = nodes.node AND NOT over)
                 )
                 INSERT INTO nodes (node, name, peer_endpoint, client_endpoint, build, capacity, beat_ms, reached)
                 OVERRIDING SYSTEM VALUE VALUES ($7, $1, $2, $3, $4, $5, clock_ms(), false) RETURNING node",
            )
            .bind(text(&info.name).into_owned())
            .bind(text(&info.peer_endpoint).into_owned())
            .bind(text(&info.client_endpoint).into_owned())
            .bind(text(&info.build).into_owned())
            .bind(integer(info.capacity))
            .bind(FORGET_NODES_AFTER_MS)
            .bind(rand::random_range(NODE_NUMBERS))
            .fetch_one(connection)
            .boxed()
        }))
        .await?;
        self.node.store(node, Ordering::Release);
        Ok(NodeId(node.cast_unsigned()))
    }

    async fn beat(&self, heartbeat: Heartbeat) -> Result<Option<Beat>, StoreError> {
        let node = self.node()?;
        let beat = self.beats.read(move |connection| {
            async move {
                let mut transaction = connection.begin().await?;
                let drain: Option<bool> = sqlx::query_scalar(
                    "UPDATE nodes SET beat_ms = clock_ms(), reached = $2, rooms = $3, drain = drain OR $4,
                            unreachable = $5, stalled = $6
                     WHERE node = $1 RETURNING drain",
                )
                .bind(node)
                .bind(heartbeat.reached)
                .bind(integer(heartbeat.rooms))
                .bind(heartbeat.drains)
                .bind(i32::try_from(heartbeat.unreachable).unwrap_or(i32::MAX))
                .bind(heartbeat.is_stalled)
                .fetch_optional(&mut *transaction)
                .await?;
                let Some(drain) = drain else {
                    return Ok(None);
                };
                // A statement of its own: a claim that the beat waited for is visible.
                let units = sqlx::query(
                    "SELECT DISTINCT unit, epoch FROM owned WHERE node = $1 AND NOT over",
                )
                .bind(node)
                .fetch_all(&mut *transaction)
                .await?;
                transaction.commit().await?;
                let owned = units.iter().filter_map(unit_at).collect();
                Ok(Some(Beat { owned, drain }))
            }
            .boxed()
        });
        beat.await
    }

    async fn orphans(&self, count: usize) -> Result<Vec<(UnitId, Epoch)>, StoreError> {
        let expire_after = self.expire_after();
        let node = self.node()?;
        let units = self.control.read(move |connection| {
            sqlx::query(
                // Each part has an index: usually there are none. All rows of a unit have the
                // same node.
                "WITH free AS (
                     SELECT unit, epoch, durable, form, rules_version FROM owned
                     WHERE NOT over AND node IS NULL
                     UNION ALL
                     SELECT unit, epoch, durable, form, rules_version FROM owned
                     WHERE NOT over
                       AND node = ANY (ARRAY (SELECT node FROM nodes WHERE beat_ms + $1 <= clock_ms()))
                 )
                 SELECT unit, epoch FROM free GROUP BY unit, epoch
                 HAVING bool_or(durable)
                    AND bool_and(form <= $2 AND coalesce(rules_version, $3) = $3)
                 ORDER BY hashtextextended(encode(unit, 'hex'), $5), unit LIMIT $4",
            )
            .bind(expire_after)
            .bind(FORM)
            .bind(i64::from(RULES_VERSION))
            .bind(integer(count as u64))
            .bind(node)
            .fetch_all(connection)
            .boxed()
        });
        Ok(units.await?.iter().filter_map(unit_at).collect())
    }

    async fn handed_over(&self) -> (UnitId, Epoch) {
        let mut handed = self.handed.lock().await;
        let listen = || Handed::listen(self.sessions.clone(), self.closing.clone());
        let handed = handed.get_or_insert_with(listen);
        while let Some((node, unit, epoch)) = handed.next().await {
            if self.node() == Ok(node) {
                return (unit, epoch);
            }
        }
        pending().await
    }

    async fn tidy(&self) -> Result<(), StoreError> {
        let expire_after = self.expire_after();
        let retention = millis(self.options.retention);
        self.control
            .read(move |connection| {
                async move {
                    // First: without them, nothing can be played.
                    partitions::add_next(connection).await?;
                    tidy(connection, expire_after, retention).await?;
                    partitions::tidy(connection).await
                }
                .boxed()
            })
            .await
    }

    async fn claim_all(
        &self,
        orphans: Vec<(UnitId, Epoch)>,
    ) -> Result<Vec<Option<Epoch>>, StoreError> {
        if orphans.len() > 1
            && let Claims::Made(claimed) = self.try_claim(&orphans).await?
        {
            return Ok(claimed);
        }
        let mut claimed = Vec::with_capacity(orphans.len());
        for orphan in orphans {
            claimed.push(self.claim_one(orphan).await?);
        }
        Ok(claimed)
    }

    async fn load(&self, unit: UnitId, epoch: Epoch) -> Result<Option<LoadedUnit>, StoreError> {
        let node = self.node()?;
        let at = integer(epoch.0);
        let retention = millis(self.options.retention);
        let items = self.control.read(move |connection| {
            sqlx::query(
                "SELECT number, games.form, header, over,
                        kind, node = $2 AND epoch = $3 AND NOT over AS is_owned
                 FROM owned LEFT JOIN games USING (game_id)
                 WHERE unit = $1 AND (kind <> 0 OR durable AND number IS NOT NULL
                                             AND (NOT over OR ended_ms >= clock_ms() - $4))
                 ORDER BY number",
            )
            .bind(unit.bytes().to_vec())
            .bind(node)
            .bind(at)
            .bind(retention)
            .fetch_all(connection)
            .boxed()
        });
        let items = items.await?;
        if !(items.iter()).any(|item| item.get::<Option<bool>, _>(5) == Some(true)) {
            return Ok(None);
        }
        let (rooms, others): (Vec<_>, Vec<_>) =
            (items.into_iter()).partition(|item| item.get::<i16, _>(4) == ROOM);
        let kind = others.iter().find_map(|item| kind_of(item.get(4)));
        let stored = match kind.map(|kind| kind.unit(*unit.bytes())) {
            Some(unit) => (self.control.unit(unit).await?).map(|it| (unit, it)),
            None => None,
        };
        let rooms = self.control.rooms(rooms).await?;
        if stored.is_some() {
            lock(&self.epochs).insert(unit, at);
        }
        Ok(Some(LoadedUnit {
            stored,
            // At the epoch that was asked for: if another one has come since, they are fenced.
            games: (rooms.into_iter())
                .map(|room| self.resumable(room, at))
                .collect(),
        }))
    }

    async fn release(
        &self,
        unit: UnitId,
        epoch: Epoch,
        next: Option<NodeId>,
    ) -> Result<(), StoreError> {
        let expire_after = self.expire_after();
        let unit = (unit, integer(epoch.0));
        let nodes = (self.node()?, next.map(|node| integer(node.0)));
        self.control
            .read(move |connection| release(connection, unit, nodes, expire_after).boxed())
            .await
    }

    async fn leave(&self) -> Result<bool, StoreError> {
        let node = self.node()?;
        let left = self.control.read(move |connection| {
            sqlx::query(
                "DELETE FROM nodes WHERE node = $1
                   AND NOT EXISTS (SELECT FROM owned WHERE node = $1 AND NOT over)",
            )
            .bind(node)
            .execute(connection)
            .boxed()
        });
        Ok(left.await?.rows_affected() > 0)
    }

    async fn locate(&self, id: UnitId) -> Result<Option<Location>, StoreError> {
        self.locate_where(locations!("WHERE id = $1"), LocatedBy::Id(*id.bytes()))
            .await
    }

    async fn locate_code(&self, join_code: &str) -> Result<Option<Location>, StoreError> {
        // A code may be used again once what had it is over.
        self.locate_where(
            locations!("WHERE join_code = $1 ORDER BY over, ended_ms DESC LIMIT 1"),
            LocatedBy::Code(text(join_code).into_owned()),
        )
        .await
    }

    async fn locate_game(&self, game: GameId) -> Result<Option<Location>, StoreError> {
        self.locate_where(
            locations!("WHERE game_id = $1 AND NOT over"),
            LocatedBy::Id(*game.bytes()),
        )
        .await
    }

    async fn ended_room(&self, room: RoomId) -> Result<Option<ResumableGame>, StoreError> {
        let rows = self.reader.read(move |connection| {
            sqlx::query(
                "SELECT number, games.form, header, over, epoch
                 FROM owned JOIN games USING (game_id) WHERE durable AND kind = 0 AND id = $1 AND over",
            )
            .bind(room.bytes().to_vec())
            .fetch_all(connection)
            .boxed()
        });
        let rows = rows.await?;
        let Some(epoch) = rows.first().map(|row| row.get(4)) else {
            return Ok(None);
        };
        let room = self.reader.rooms(rows).await?.pop();
        Ok(room.map(|room| self.resumable(room, epoch)))
    }

    async fn alive(&self) -> Result<Vec<LivingNode>, StoreError> {
        let expire_after = self.expire_after();
        let nodes = self.reader.read(move |connection| {
            sqlx::query(
                "SELECT node, name, peer_endpoint, client_endpoint, build, capacity, reached, drain, rooms
                 FROM nodes WHERE beat_ms + $1 > clock_ms()",
            )
            .bind(expire_after)
            .fetch_all(connection)
            .boxed()
        });
        let nodes = nodes.await?;
        let alive = nodes.iter().map(|row| {
            let (id, info) = node_of(row);
            let reached = row.get("reached");
            let takes_rooms = reached && !row.get::<bool, _>("drain") && info.capacity > 0;
            let rooms: Option<i64> = row.get("rooms");
            let load = rooms.filter(|_| takes_rooms).map(|rooms| Load {
                rooms: rooms.cast_unsigned(),
                capacity: info.capacity,
            });
            LivingNode {
                id,
                info,
                reached,
                load,
            }
        });
        Ok(alive.collect())
    }

    async fn nodes(&self) -> Result<Vec<NodeStatus>, StoreError> {
        let expire_after = self.expire_after();
        let nodes = self.reader.read(move |connection| {
            sqlx::query(
                "SELECT node, name, peer_endpoint, client_endpoint, build, capacity,
                        greatest(clock_ms() - beat_ms, 0) AS since_ms, beat_ms + $1 <= clock_ms() AS expired, drain, reached,
                        unreachable, stalled,
                        (SELECT count(*) FROM owned WHERE owned.node = nodes.node AND NOT over AND kind = 0) AS rooms,
                        (SELECT count(*) FROM owned WHERE owned.node = nodes.node AND NOT over AND kind = 1) AS tournaments,
                        (SELECT count(*) FROM owned WHERE owned.node = nodes.node AND NOT over AND kind = 2) AS studies
                 FROM nodes ORDER BY expired, name, node",
            )
            .bind(expire_after)
            .fetch_all(connection)
            .boxed()
        });
        Ok((nodes.await?.iter())
            .map(|row| {
                let (id, info) = node_of(row);
                NodeStatus {
                    id,
                    info,
                    last_beat: Duration::from_millis(number(row, "since_ms")),
                    expired: row.get("expired"),
                    drain: row.get("drain"),
                    reached: row.get("reached"),
                    unreachable: u32::try_from(row.get::<i32, _>("unreachable")).unwrap_or(0),
                    is_stalled: row.get("stalled"),
                    rooms: number(row, "rooms"),
                    tournaments: number(row, "tournaments"),
                    studies: number(row, "studies"),
                }
            })
            .collect())
    }

    async fn request_drain(&self, node: NodeId) -> Result<bool, StoreError> {
        let asked = self.control.read(move |connection| {
            sqlx::query("UPDATE nodes SET drain = true WHERE node = $1")
                .bind(integer(node.0))
                .execute(connection)
                .boxed()
        });
        Ok(asked.await?.rows_affected() > 0)
    }
}

/// Removes what has long been over, and what died with its node.
async fn tidy(
    connection: &mut PgConnection,
    expire_after: i64,
    retention: i64,
) -> sqlx::Result<()> {
    // The clock was set back: as long as it has not come to the last beat of a node that has died
    // since, its lease would not end. One that lives beats again anyway.
    sqlx::query(
        "UPDATE nodes SET beat_ms = clock_ms()
         WHERE node IN (SELECT node FROM nodes WHERE beat_ms > clock_ms() FOR UPDATE SKIP LOCKED)",
    )
    .execute(&mut *connection)
    .await?;
    sqlx::query(
        "DELETE FROM owned WHERE id IN (
             SELECT id FROM owned WHERE NOT durable AND NOT over AND unit = id AND node IS NULL
             UNION ALL
             SELECT id FROM owned WHERE NOT durable AND NOT over AND unit = id
               AND node = ANY (ARRAY (SELECT node FROM nodes WHERE beat_ms + $1 <= clock_ms())))",
    )
    .bind(expire_after)
    .execute(&mut *connection)
    .await?;
    // Where a tournament was stays known: it is listed for ever. Which games are its own stays known
    // until it is over: it may need them (`Reader::prunable`).
    sqlx::query(
        "DELETE FROM owned WHERE over AND kind = 0 AND ended_ms < clock_ms() - $1
           AND NOT EXISTS (SELECT FROM tournaments
                           WHERE tournament_id = unit AND NOT tournaments.over)",
    )
    .bind(retention)
    .execute(&mut *connection)
    .await?;
    // Games that were abandoned before the deal leave nothing behind.
    sqlx::query(
        "WITH game AS (
             DELETE FROM games WHERE state <> 0 AND summary IS NULL AND ended_at_ms < clock_ms() - $1
             RETURNING number
         )
         INSERT INTO pruned (game, at_ms) SELECT number, clock_ms() FROM game ON CONFLICT DO NOTHING",
    )
    .bind(retention)
    .execute(&mut *connection)
    .await?;
    Ok(())
}

/// A unit and its epoch, from a row.
fn unit_at(row: &PgRow) -> Option<(UnitId, Epoch)> {
    let epoch: i64 = row.get(1);
    Some((Id::from_bytes(id_of(row, 0)?), Epoch(epoch.cast_unsigned())))
}

/// A node, and what it said when it joined.
fn node_of(row: &PgRow) -> (NodeId, NodeInfo) {
    let info = NodeInfo {
        name: row.get("name"),
        peer_endpoint: row.get("peer_endpoint"),
        client_endpoint: row.get("client_endpoint"),
        build: row.get("build"),
        capacity: number(row, "capacity"),
    };
    (NodeId(number(row, "node")), info)
}

fn number(row: &PgRow, column: &str) -> u64 {
    row.get::<i64, _>(column).cast_unsigned()
}

fn id_of(row: &PgRow, column: usize) -> Option<[u8; 16]> {
    row.get::<&[u8], _>(column).try_into().ok()
}

fn location(row: &PgRow) -> Result<Location, StoreError> {
    let odd = || StoreError::Failed("an id in the database does not have 16 bytes".into());
    let id = id_of(row, 0).ok_or_else(odd)?;
    Ok(Location {
        subject: match kind_of(row.get(1)) {
            None => Subject::Room(Id::from_bytes(id)),
            Some(kind) => Subject::Unit(kind.unit(id)),
        },
        unit: Id::from_bytes(id_of(row, 2).ok_or_else(odd)?),
        node: row
            .get::<Option<i64>, _>(3)
            .map(|node| NodeId(node.cast_unsigned())),
        epoch: Epoch(row.get::<i64, _>(4).cast_unsigned()),
        over: row.get(5),
    })
}
