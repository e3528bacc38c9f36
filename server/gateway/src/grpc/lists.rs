//! Lists over all nodes of a cluster. Each node lists what it has, newest first, and numbers it; the
//! node that was asked merges the lists by the time of creation, and shows once what several nodes
//! have. A page token says how far each list has been shown. A single server's token is the number of
//! the last entry alone.

use std::collections::{BTreeMap, VecDeque};
use std::future::Future;
use std::time::Duration;

use futures::future::join_all;
use sha2::{Digest as _, Sha256};
use tokio::time::timeout;
use tonic::transport::Channel;
use tonic::{Response, Status};
use tracing::debug;

use super::forward::{FromPeer, Gateway};
use super::limits::make_way;
use super::pages;
use chefshat_hosting::cluster::Peer;

/// How long another node may take to list what it has. Without its answer, that is left out.
const PEER_TIMEOUT: Duration = Duration::from_secs(2);
/// The metadata of another node's answer with the numbers of what it lists.
const NUMBERS: &str = "chefshat-numbers";

/// A part of the list of one node, newest first.
pub(super) struct Part<T> {
    /// The entries with their numbers.
    pub(super) entries: Vec<(u64, T)>,
    /// The number after which more may follow; `None` at the end.
    pub(super) rest: Option<u64>,
}

/// A page: entries, and the token of the next page, or nothing.
type Page<T> = (Vec<T>, String);

/// How a list is asked for at one node.
pub(super) trait Listing {
    /// What is listed.
    type Entry;
    /// The response.
    type Response;

    /// What this node has before a number, or all.
    fn here(
        &self,
        before: Option<u64>,
    ) -> impl Future<Output = Result<Part<Self::Entry>, Status>> + Send;

    /// Asks another node, with this page token.
    fn there(
        &self,
        gateway: &Gateway,
        channel: Channel,
        page_token: String,
    ) -> impl Future<Output = Result<Response<Self::Response>, Status>> + Send;

    /// The entries of a response, and the token of the next page, or nothing.
    fn page(response: Self::Response) -> (Vec<Self::Entry>, String);

    /// The response with a page.
    fn response(entries: Vec<Self::Entry>, next_page_token: String) -> Self::Response;

    /// When an entry was created, milliseconds since the Unix epoch.
    fn created_at_ms(entry: &Self::Entry) -> u64;

    /// The id of an entry.
    fn id(entry: &Self::Entry) -> &str;
}

/// Answers a request for a page of this size.
pub(super) async fn list<L: Listing>(
    listing: &L,
    extensions: &http::Extensions,
    page_token: &str,
    page_size: usize,
) -> Result<Response<L::Response>, Status> {
    if let Some(gateway) = extensions.get::<Gateway>() {
        // A node that cannot be reached holds up no other calls.
        make_way(extensions);
        let (entries, next) = everywhere(listing, gateway, page_token, page_size).await?;
        return Ok(Response::new(L::response(entries, next)));
    }
    let part = listing.here(pages::last_shown(page_token)?).await?;
    let numbers: Vec<_> = part
        .entries
        .iter()
        .map(|(number, _)| number.to_string())
        .collect();
    let entries = part.entries.into_iter().map(|(_, entry)| entry).collect();
    let next = part.rest.map_or_else(String::new, |rest| rest.to_string());
    let mut response = Response::new(L::response(entries, next));
    if extensions.get::<FromPeer>().is_some() {
        let numbers = numbers.join(",").parse().expect("digits and commas");
        response.metadata_mut().insert(NUMBERS, numbers);
    }
    Ok(response)
}

/// A page of the lists of all nodes.
async fn everywhere<L: Listing>(
    listing: &L,
    gateway: &Gateway,
    page_token: &str,
    page_size: usize,
) -> Result<Page<L::Entry>, Status> {
    let shown = Shown::parse(page_token)?;
    let (own, others) = gateway.directory().nodes().await;
    let own = key(&own);
    let peers: Vec<(String, Peer)> = (others.into_iter())
        .map(|peer| (key(&peer.node), peer))
        .filter(|(key, _)| shown.includes(key))
        .collect();
    let asked = peers.iter().map(|(key, peer)| {
        let before = shown.before(key);
        let asked = ask(listing, gateway, peer, before);
        async move {
            let part = asked.await;
            let part = part.inspect_err(|error| debug!(node = %peer.node, %error, "no list"));
            part.ok().map(|part| (key.clone(), before, part))
        }
    });
    let asked = join_all(asked);
    let here = async {
        match shown.includes(&own) {
            true => listing.here(shown.before(&own)).await.map(Some),
            false => Ok(None),
        }
    };
    let (asked, here) = futures::future::join(asked, here).await;
    let here = here?.map(|part| (own.clone(), shown.before(&own), part));
    let parts = asked.into_iter().flatten().chain(here);
    Ok(merged(parts, page_size, L::created_at_ms, L::id))
}

/// The list of another node.
async fn ask<L: Listing>(
    listing: &L,
    gateway: &Gateway,
    peer: &Peer,
    before: Option<u64>,
) -> Result<Part<L::Entry>, Status> {
    let token = before.map_or_else(String::new, |before| before.to_string());
    let asked = listing.there(gateway, gateway.peers().channel(peer), token);
    let response = (timeout(PEER_TIMEOUT, asked).await)
        .map_err(|_| Status::deadline_exceeded("it took too long"))??;
    let numbers = response
        .metadata()
        .get(NUMBERS)
        .and_then(|it| it.to_str().ok());
    let numbers: Vec<u64> = (numbers.unwrap_or_default().split(','))
        .filter_map(|number| number.parse().ok())
        .collect();
    let (entries, next) = L::page(response.into_inner());
    Ok(Part {
        entries: numbers.into_iter().zip(entries).collect(),
        rest: pages::last_shown(&next)?,
    })
}

/// The first entries of several lists, newest first. Each list comes with its node's key and the
/// number before which it starts.
fn merged<T, K: PartialEq + ?Sized>(
    parts: impl IntoIterator<Item = (String, Option<u64>, Part<T>)>,
    page_size: usize,
    created_at_ms: impl Fn(&T) -> u64,
    id: impl Fn(&T) -> &K,
) -> Page<T> {
    struct Source<T> {
        key: String,
        before: Option<u64>,
        entries: VecDeque<(u64, T)>,
        rest: Option<u64>,
    }
    let mut sources: Vec<Source<T>> = (parts.into_iter())
        .map(|(key, before, part)| Source {
            key,
            before,
            entries: part.entries.into(),
            rest: part.rest,
        })
        .collect();
    let mut entries = Vec::new();
    while entries.len() < page_size {
        // What follows in a list that has more may be newer than what the others have.
        let unknown = |source: &Source<T>| source.entries.is_empty() && source.rest.is_some();
        if sources.iter().any(unknown) {
            break;
        }
        let newest = (sources.iter_mut())
            .filter(|source| !source.entries.is_empty())
            .max_by_key(|source| {
                source
                    .entries
                    .front()
                    .map(|(_, entry)| created_at_ms(entry))
            });
        let Some((source, (number, entry))) = newest.and_then(|source| {
            let next = source.entries.pop_front()?;
            Some((source, next))
        }) else {
            break;
        };
        source.before = Some(number);
        for source in &mut sources {
            let is_same = |next: &mut (u64, T)| id(&next.1) == id(&entry);
            if let Some((number, _)) = source.entries.pop_front_if(is_same) {
                source.before = Some(number);
            }
        }
        entries.push(entry);
    }
    let left = sources.into_iter().filter_map(|source| {
        let before = match source.entries.is_empty() {
            false => source.before,
            true => Some(source.rest?),
        };
        Some((source.key, before))
    });
    (entries, Shown(Some(left.collect())).to_token())
}

/// How far the list of each node has been shown, by the node's key: the number of its last entry, or
/// nothing. `None` before the first page. Nodes that are not in it have nothing more.
struct Shown(Option<BTreeMap<String, Option<u64>>>);

impl Shown {
    fn parse(page_token: &str) -> Result<Self, Status> {
        if page_token.is_empty() {
            return Ok(Self(None));
        }
        let lists = page_token.split(',').map(|list| {
            let (key, number) = list.split_once('-').ok_or_else(pages::token_refused)?;
            Ok((key.to_owned(), pages::last_shown(number)?))
        });
        lists
            .collect::<Result<_, Status>>()
            .map(|lists| Self(Some(lists)))
    }

    fn to_token(&self) -> String {
        let lists: Vec<String> = (self.0.iter().flatten())
            .map(|(key, number)| match number {
                Some(number) => format!("{key}-{number}"),
                None => format!("{key}-"),
            })
            .collect();
        lists.join(",")
    }

    fn includes(&self, key: &str) -> bool {
        self.0.as_ref().is_none_or(|lists| lists.contains_key(key))
    }

    fn before(&self, key: &str) -> Option<u64> {
        *self.0.as_ref()?.get(key)?
    }
}

/// The key of a node in page tokens.
fn key(node: &str) -> String {
    hex::encode(&Sha256::digest(node)[..4])
}

/// Asks all other nodes something, and returns the answers of those that give one.
pub(super) async fn of_others<T, F>(
    gateway: &Gateway,
    ask: impl Fn(Channel) -> F,
) -> impl Iterator<Item = T>
where
    F: Future<Output = Result<Response<T>, Status>>,
{
    let (_, peers) = gateway.directory().nodes().await;
    let asked = peers
        .iter()
        .map(|peer| timeout(PEER_TIMEOUT, ask(gateway.peers().channel(peer))));
    let answers = join_all(asked).await.into_iter();
    answers.filter_map(|answer| Some(answer.ok()?.ok()?.into_inner()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A list of entries that were created at these times; numbers count down from 100.
    fn part(times: &[u64], rest: bool) -> Part<u64> {
        let entries: Vec<_> = (0..)
            .zip(times)
            .map(|(index, time)| (100 - index, *time))
            .collect();
        let last = entries.last().map(|(number, _)| *number);
        Part {
            entries,
            rest: rest.then(|| last.unwrap_or(100)),
        }
    }

    #[test]
    fn lists_are_merged_newest_first_and_continued_where_they_ended() {
        let lists = || {
            [
                ("a", part(&[90, 50, 10], false)),
                ("b", part(&[80, 70, 60], true)),
                ("c", part(&[], false)),
            ]
            .map(|(key, part)| (key.to_owned(), None, part))
        };
        let page = merged(lists(), 2, |time| *time, |time| time);
        assert_eq!(page, (vec![90, 80], "a-100,b-100".to_owned()));
        // More of the second list may be newer than 50.
        let page = merged(lists(), 10, |time| *time, |time| time);
        assert_eq!(page, (vec![90, 80, 70, 60], "a-100,b-98".to_owned()));
        let one = [("a".to_owned(), None, part(&[5, 4], false))];
        let page = merged(one, 2, |time| *time, |time| time);
        assert_eq!(page, (vec![5, 4], String::new()));
        let none = [
            ("a".to_owned(), None, part(&[5], false)),
            ("b".to_owned(), None, part(&[9], true)),
        ];
        let (_, next) = merged(none, 1, |time| *time, |time| time);
        assert_eq!(next, "a-,b-100");
        let shown = Shown::parse(&next).expect("its own");
        assert!(shown.includes("a") && shown.before("a").is_none());
        assert!(shown.includes("b") && !shown.includes("c"));
        assert_eq!(shown.before("b"), Some(100));
        assert_eq!(shown.to_token(), next);
        let copies = || {
            [("a", &[90, 50]), ("b", &[90, 10])]
                .map(|(key, times)| (key.to_owned(), None, part(times, false)))
        };
        let (entries, _) = merged(copies(), 9, |time| *time, |time| time);
        assert_eq!(entries, [90, 50, 10]);
        let (_, next) = merged(copies(), 1, |time| *time, |time| time);
        assert_eq!(next, "a-100,b-100");
        for wrong in ["7", "a", "a-x", ",", "a-1,b"] {
            assert!(Shown::parse(wrong).is_err(), "{wrong}");
        }
    }
}
