//! Removes a participant's name from stored games and tournaments: in which order, and what becomes of
//! each row. A database reads the rows and writes those that change; games and tournaments that are
//! over change in no other way. Files of records and studies are not handled here.

use std::sync::Arc;

use async_trait::async_trait;
use chefshat_proto::v1;
use chefshat_record::convert::seat_number;
use chefshat_record::outcome::without_comments;
use chefshat_record::pseudonym::{Named, ParticipantSeats, Pseudonym, Redactions};
use chefshat_record::signature::SigningKey;
use chefshat_tournament::Change as TournamentChange;
use prost::Message as _;

use super::decode_pool::DecodePool;
use super::form::{self, Unreadable, check_form};
use super::tournaments::TournamentEntry;
use super::{ForgetError, Forgotten, StoreError, StoredGame};
use chefshat_room::ids::GameId;
use chefshat_room::journal::{Change, Entry, Fill, GameHeader, StudyGame};

/// Most games and tournaments that one transaction rewrites. What rooms commit meanwhile waits for it.
pub(super) const MAX_REWRITTEN_AT_ONCE: usize = 64;
/// Bytes of rewritten rows after which a transaction is committed, however few games they are of.
const ENOUGH_BYTES: usize = 1024 * 1024;

/// A database from which a participant is removed.
#[async_trait]
pub(super) trait Rewritable: Sync {
    /// The numbers of the games that may contain a name. Only the headers of games that are not over
    /// are searched: whom others name is among their participants.
    async fn games_with(&self, name: &str) -> Result<Vec<i64>, StoreError>;
    /// The numbers of the tournaments that may contain a name.
    async fn tournaments_with(&self, name: &str) -> Result<Vec<i64>, StoreError>;
    /// The rows of a game; `None` if it was deleted.
    async fn game_rows(&self, number: i64) -> Result<Option<GameRows>, StoreError>;
    /// The rows of a tournament's journal, in order.
    async fn tournament_rows(&self, number: i64) -> Result<Vec<TournamentRow>, StoreError>;
    /// Writes what changes in one transaction.
    async fn write(&self, rewrite: Rewrite) -> Result<(), StoreError>;
    /// Where games are decoded.
    fn decoding(&self) -> &DecodePool;
}

/// Removes a participant from a database, in transactions of bounded size. A game or tournament has
/// either all of the name or nothing of it, so what was interrupted is completed by doing it again.
///
/// # Errors
/// See [`ForgetError`].
pub(super) async fn forget_participant(
    database: &impl Rewritable,
    who: &Pseudonym,
) -> Result<Forgotten, ForgetError> {
    let mut forgotten = Forgotten::default();
    let mut rewrite = Rewrite::new(who);
    for stored in find(database, who).await? {
        rewrite = add(database, rewrite, stored).await?;
        if rewrite.is_large() {
            let large = std::mem::replace(&mut rewrite, Rewrite::new(who));
            commit(database, large, &mut forgotten).await?;
        }
    }
    commit(database, rewrite, &mut forgotten).await?;
    Ok(forgotten)
}

/// A stored game or tournament, by its number.
#[derive(Clone, Copy)]
enum Stored {
    Game(i64),
    Tournament(i64),
}

/// The games and tournaments that the participant is in. Everything is read once before anything is
/// changed, since what is not over or cannot be read refuses the removal.
async fn find(database: &impl Rewritable, who: &Pseudonym) -> Result<Vec<Stored>, ForgetError> {
    let name = who.of.name.as_str();
    let games = database.games_with(name).await?.into_iter();
    let tournaments = database.tournaments_with(name).await?.into_iter();
    // Nothing is signed yet.
    let unsigned = Pseudonym {
        key: None,
        ..who.clone()
    };
    let mut found = Vec::new();
    for stored in (games.map(Stored::Game)).chain(tournaments.map(Stored::Tournament)) {
        let rewrite = add(database, Rewrite::new(&unsigned), stored).await?;
        if !rewrite.is_empty() {
            found.push(stored);
        }
    }
    Ok(found)
}

/// Adds a game or tournament to what is written, if the participant is in it.
async fn add(
    database: &impl Rewritable,
    rewrite: Rewrite,
    stored: Stored,
) -> Result<Rewrite, ForgetError> {
    match stored {
        Stored::Game(number) => {
            let Some(rows) = database.game_rows(number).await? else {
                return Ok(rewrite);
            };
            let bytes = bytes_of(&rows.journal) + rows.record.as_ref().map_or(0, Vec::len);
            let redacting = (database.decoding()).run(bytes / 64, move || rewrite.with_game(rows));
            redacting.await?
        }
        Stored::Tournament(number) => {
            let rows = database.tournament_rows(number).await?;
            rewrite.with_tournament(number, rows)
        }
    }
}

/// Writes what changes, and counts it.
async fn commit(
    database: &impl Rewritable,
    rewrite: Rewrite,
    forgotten: &mut Forgotten,
) -> Result<(), StoreError> {
    if rewrite.is_empty() {
        return Ok(());
    }
    let written = rewrite.forgotten.clone();
    database.write(rewrite).await?;
    forgotten.append(written);
    Ok(())
}

/// The rows of a game that may contain the name.
#[derive(Debug)]
pub(super) struct GameRows {
    pub(super) number: i64,
    pub(super) id: GameId,
    /// The version of the encoding.
    pub(super) form: i64,
    pub(super) is_running: bool,
    pub(super) is_filed: bool,
    pub(super) header: Option<Vec<u8>>,
    pub(super) summary: Option<Vec<u8>>,
    /// The record of an imported game.
    pub(super) record: Option<Vec<u8>>,
    /// The signature of a hosted game.
    pub(super) signature: Option<Vec<u8>>,
    /// The rows of its journal by their keys, in order.
    pub(super) journal: Vec<(i64, Vec<u8>)>,
}

/// A row of a tournament's journal: the version of the tournament's encoding, its position and its
/// entries.
pub(super) type TournamentRow = (i64, i64, Vec<u8>);

/// The rows of a game that are written again.
#[derive(Debug)]
pub(super) struct GameRewrite {
    pub(super) number: i64,
    pub(super) header: Option<Vec<u8>>,
    /// The summary, and the name of the room.
    pub(super) summary: Option<(Vec<u8>, String)>,
    /// The seats of the participant in the summary.
    pub(super) seats: Vec<i64>,
    pub(super) record: Option<Vec<u8>>,
    /// The signature of what is left, if the server had signed the whole.
    pub(super) signature: Option<Vec<u8>>,
    pub(super) journal: Vec<(i64, Vec<u8>)>,
}

/// The rows of a tournament that are written again, by their positions.
#[derive(Debug)]
pub(super) struct TournamentRewrite {
    pub(super) number: i64,
    pub(super) rows: Vec<(i64, Vec<u8>)>,
}

/// What one transaction writes to remove a participant.
#[derive(Debug)]
pub(super) struct Rewrite {
    pub(super) who: Pseudonym,
    pub(super) games: Vec<GameRewrite>,
    pub(super) tournaments: Vec<TournamentRewrite>,
    /// Bytes of all rows in them.
    bytes: usize,
    forgotten: Forgotten,
}

impl Rewrite {
    /// Nothing yet.
    fn new(who: &Pseudonym) -> Self {
        Self {
            who: who.clone(),
            games: Vec::new(),
            tournaments: Vec::new(),
            bytes: 0,
            forgotten: Forgotten::default(),
        }
    }

    fn is_empty(&self) -> bool {
        self.games.is_empty() && self.tournaments.is_empty()
    }

    /// Whether it is enough for one transaction.
    fn is_large(&self) -> bool {
        self.games.len() + self.tournaments.len() >= MAX_REWRITTEN_AT_ONCE
            || self.bytes >= ENOUGH_BYTES
    }

    /// Adds a game, if the participant is in it.
    ///
    /// # Errors
    /// The game is not over, or cannot be read.
    fn with_game(mut self, rows: GameRows) -> Result<Self, ForgetError> {
        let (id, is_filed, is_running) = (rows.id, rows.is_filed, rows.is_running);
        let rewritten = rewrite_game(rows, &self.who).map_err(|problem| unreadable(id, problem))?;
        let Some((game, redactions)) = rewritten else {
            return Ok(self);
        };
        if is_running {
            return Err(ForgetError::GameRunning(self.who.of.name));
        }
        self.bytes += game.bytes();
        self.games.push(game);
        self.forgotten.add(id, is_filed, redactions);
        Ok(self)
    }

    /// Adds the rows of a tournament, if the participant is in it.
    ///
    /// # Errors
    /// The tournament is not over, or cannot be read.
    fn with_tournament(
        mut self,
        number: i64,
        rows: Vec<TournamentRow>,
    ) -> Result<Self, ForgetError> {
        let (mut changed, mut is_over) = (Vec::new(), false);
        for (form, position, bytes) in rows {
            let known = check_form(form);
            let read = known.and_then(|()| form::tournament_entries_from_bytes(&bytes));
            let mut entries = read.map_err(|problem| ForgetError::Unreadable {
                what: format!("tournament number {number}"),
                problem: problem.to_string(),
            })?;
            is_over |= entries.iter().any(TournamentEntry::is_end);
            if forget_entrant(&mut entries, &self.who) {
                changed.push((position, TournamentEntry::to_bytes(&entries)));
            }
        }
        if changed.is_empty() {
            return Ok(self);
        }
        if !is_over {
            return Err(ForgetError::TournamentRunning(self.who.of.name));
        }
        self.forgotten.tournaments += 1;
        let rows = changed;
        self.bytes += bytes_of(&rows);
        self.tournaments.push(TournamentRewrite { number, rows });
        Ok(self)
    }
}

impl GameRewrite {
    /// Bytes of its rows.
    fn bytes(&self) -> usize {
        let summary = self.summary.as_ref().map_or(0, |(bytes, _)| bytes.len());
        let others = [&self.header, &self.record].into_iter().flatten();
        bytes_of(&self.journal) + summary + others.map(Vec::len).sum::<usize>()
    }
}

fn bytes_of(rows: &[(i64, Vec<u8>)]) -> usize {
    rows.iter().map(|(_, bytes)| bytes.len()).sum()
}

impl Forgotten {
    fn append(&mut self, mut more: Self) {
        self.games.append(&mut more.games);
        self.filed.append(&mut more.filed);
        self.tournaments += more.tournaments;
        self.redactions += more.redactions;
    }

    pub(super) fn add(&mut self, game: GameId, is_filed: bool, redactions: Redactions) {
        self.games.push(game);
        self.filed.extend(is_filed.then_some(game));
        self.redactions += redactions;
    }
}

fn unreadable(game: GameId, problem: Unreadable) -> ForgetError {
    ForgetError::Unreadable {
        what: format!("game {game}"),
        problem: problem.to_string(),
    }
}

/// The key for which a pseudonym is signed, if it has signed the game as it is stored.
fn key_of<'w>(who: &'w Pseudonym, stored: &StoredGame) -> Option<&'w SigningKey> {
    // Records are made only for those that it may have signed.
    let may_have = |key: &&SigningKey| match stored {
        StoredGame::Hosted(.., Some(signature)) => signature.public_key == key.public().0,
        StoredGame::Hosted(.., None) | StoredGame::Imported(_) => false,
    };
    let key = who.key.as_deref().filter(may_have)?;
    key.has_signed(&stored.lines()).then_some(key)
}

/// The signature of a game without the participant.
fn signature_of(
    key: &SigningKey,
    header: Arc<GameHeader>,
    entries: Arc<[Entry]>,
) -> v1::RecordSignature {
    let left = StoredGame::Hosted(header, entries, None);
    key.sign_each(|add| left.each_line(|line| add(&line)))
}

/// Removes a participant from a game in memory that is over. If it changes, it is signed again by who
/// had signed it.
pub(super) fn forget_stored(
    stored: &mut StoredGame,
    summary: &mut v1::RecordSummary,
    who: &Pseudonym,
) -> Redactions {
    let key = key_of(who, stored);
    let redactions = match stored {
        StoredGame::Hosted(header, entries, signature) => {
            let is_in = is_in_header(header, &who.of) || is_seated(entries, &who.of);
            if who.of.fingerprint.is_some() && !is_in {
                return Redactions::default();
            }
            let mut changed = entries.to_vec();
            let mut seats = ParticipantSeats::default();
            let mut redactions = forget_entries(&mut changed, &mut seats, who);
            if is_in || redactions != Redactions::default() {
                redactions.names += forget_header(Arc::make_mut(header), who);
                *entries = changed.into();
                let signed =
                    key.map(|key| signature_of(key, Arc::clone(header), Arc::clone(entries)));
                *signature = signed.map(Arc::new);
            }
            redactions
        }
        StoredGame::Imported(lines) => {
            let mut changed = lines.to_vec();
            let redactions = who.redact(&mut changed);
            *lines = changed.into();
            redactions
        }
    };
    if redactions != Redactions::default() {
        forget_summary(summary, who);
    }
    redactions
}

/// Removes a participant from a game, which is signed again if it changes; `None` if it does not.
fn rewrite_game(
    rows: GameRows,
    who: &Pseudonym,
) -> Result<Option<(GameRewrite, Redactions)>, Unreadable> {
    // What this version does not know would be lost.
    check_form(rows.form)?;
    let mut game = GameRewrite {
        number: rows.number,
        header: None,
        summary: None,
        seats: Vec::new(),
        record: None,
        signature: None,
        journal: Vec::new(),
    };
    let key = key_of_rows(&rows, who)?;
    // What is left of the journal, if it is signed.
    let mut left = Vec::new();
    let header = rows.header.as_deref().map(form::header_from_bytes);
    let mut header = header.transpose()?;
    let mut is_in = header.as_ref().is_some_and(|it| is_in_header(it, &who.of));
    if who.of.fingerprint.is_some() && rows.record.is_none() {
        is_in = is_in || is_seated_in_rows(&rows.journal, &who.of)?;
        if !is_in {
            return Ok(None);
        }
    }
    let (mut own, mut redactions) = (ParticipantSeats::default(), Redactions::default());
    // Row by row, because a long decoded game is much larger.
    for (row, bytes) in rows.journal {
        let mut entries = Vec::new();
        form::read_entries(&bytes, &mut entries)?;
        let of_row = forget_entries(&mut entries, &mut own, who);
        if key.is_some() {
            left.extend_from_slice(&entries);
        }
        if of_row != Redactions::default() {
            redactions += of_row;
            game.journal
                .push((row, form::entries_to_bytes(&mut entries)));
        }
    }
    if let Some(record) = rows.record {
        let mut lines = form::lines_from_bytes(&record)?;
        redactions += who.redact(&mut lines);
        game.record = Some(form::lines_to_bytes(&lines));
    }
    if !is_in && redactions == Redactions::default() {
        return Ok(None);
    }
    if let Some(header) = &mut header {
        redactions.names += forget_header(header, who);
        game.header = Some(form::header_to_bytes(header));
        let signature = key.map(|key| signature_of(key, Arc::new(header.clone()), left.into()));
        game.signature = signature.as_ref().map(form::signature_to_bytes);
    }
    if let Some(summary) = rows.summary {
        let mut summary = v1::RecordSummary::decode(summary.as_slice())?;
        game.seats = (summary.seats.iter())
            .filter(|seat| who.of.is_at(seat))
            .map(|seat| seat.seat.into())
            .collect();
        forget_summary(&mut summary, who);
        game.summary = Some((summary.encode_to_vec(), summary.room_name));
    }
    Ok(Some((game, redactions)))
}

/// As [`key_of`], for the rows of a game. A game of the key is decoded as a whole.
fn key_of_rows<'w>(
    rows: &GameRows,
    who: &'w Pseudonym,
) -> Result<Option<&'w SigningKey>, Unreadable> {
    let signature = rows.signature.as_deref().map(form::signature_from_bytes);
    let (Some(signature), Some(key)) = (signature.transpose()?, &who.key) else {
        return Ok(None);
    };
    if signature.public_key != key.public().0 {
        return Ok(None);
    }
    let header = form::stored_header(rows.header.as_deref())?;
    let mut entries = Vec::new();
    for (_, bytes) in &rows.journal {
        form::read_entries(bytes, &mut entries)?;
    }
    let signature = Some(Arc::new(signature));
    let stored = StoredGame::Hosted(Arc::new(header), entries.into(), signature);
    Ok(key_of(who, &stored))
}

/// Whether the header of a game names the participant: at its physical table, or in its study.
/// Neither has a key.
fn is_in_header(header: &GameHeader, who: &Named) -> bool {
    let mut names = header.display_names.iter();
    let of_study = |study: &Arc<StudyGame>| {
        let mut members = study.members.iter();
        members.any(|member| who.is(&member.participant, ""))
    };
    names.any(|(seat, name)| is_at_table(&header.fills, *seat) && who.is(name, ""))
        || header.study.as_ref().is_some_and(of_study)
}

fn is_at_table(fills: &[Fill], seat: usize) -> bool {
    matches!(fills.get(seat), Some(Fill::AtTable(_)))
}

/// Whether the participant sits down in entries of a journal.
fn is_seated(entries: &[Entry], who: &Named) -> bool {
    entries.iter().any(|entry| match &entry.change {
        Change::Seated { participant, .. } => {
            who.is(&participant.name, &participant.name_fingerprint)
        }
        _ => false,
    })
}

/// As [`is_seated`], for the rows of a journal.
fn is_seated_in_rows(rows: &[(i64, Vec<u8>)], who: &Named) -> Result<bool, Unreadable> {
    for (_, bytes) in rows {
        let mut entries = Vec::new();
        form::read_entries(bytes, &mut entries)?;
        if is_seated(&entries, who) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Removes a participant from the header of its game; returns the number of replacements.
fn forget_header(header: &mut GameHeader, who: &Pseudonym) -> u64 {
    header.participant_removed = true;
    let mut names = who.in_text(&mut header.name);
    for (seat, name) in &mut header.display_names {
        if is_at_table(&header.fills, *seat) && who.of.is(name, "") {
            name.clone_from(&who.pseudonym);
            names += 1;
        }
    }
    if let Some(study) = &mut header.study {
        for member in &mut Arc::make_mut(study).members {
            if who.of.is(&member.participant, "") {
                member.participant.clone_from(&who.pseudonym);
                names += 1;
            }
        }
    }
    names
}

fn forget_summary(summary: &mut v1::RecordSummary, who: &Pseudonym) {
    who.in_seats(&mut summary.seats);
    who.in_text(&mut summary.room_name);
}

/// Removes a participant from entries of a journal. `own` are its seats before them.
fn forget_entries(
    entries: &mut Vec<Entry>,
    own: &mut ParticipantSeats,
    who: &Pseudonym,
) -> Redactions {
    let mut out = Redactions::default();
    entries.retain_mut(|entry| match &mut entry.change {
        Change::Seated { seat, participant } => {
            let is_own = who.of.is(&participant.name, &participant.name_fingerprint);
            own.seated(seat_number(*seat), is_own);
            if is_own {
                participant.name.clone_from(&who.pseudonym);
                participant.name_fingerprint.clear();
                out.names += 1;
            }
            true
        }
        Change::Vacated(seat) => {
            own.vacated(seat_number(*seat));
            true
        }
        Change::Decided(decided) => {
            if own.has(seat_number(decided.seat))
                && let Some(bytes) = &decided.annotations
            {
                let annotations = v1::Annotations::decode(bytes.as_ref()).ok();
                let left = annotations.as_ref().and_then(without_comments);
                let left = left.map(|it| it.encode_to_vec().into_boxed_slice());
                out.annotations += u64::from(left != decided.annotations);
                decided.annotations = left;
            }
            true
        }
        Change::Expressed { seat, .. } => {
            let drop = own.has(seat_number(*seat));
            out.expressions += u64::from(drop);
            !drop
        }
        Change::Marked(marked) => {
            out.names += who.in_label(&mut marked.label);
            true
        }
        _ => true,
    });
    out
}

/// Renames a participant in entries of a tournament's journal. Returns whether it is in them.
fn forget_entrant(entries: &mut [TournamentEntry], who: &Pseudonym) -> bool {
    let mut changed = false;
    for entry in entries {
        if let TournamentEntry::Change(
            TournamentChange::Joined(entrant) | TournamentChange::Replaced { by: entrant, .. },
        ) = entry
            && entrant.built_in.is_none()
            && who.of.is(&entrant.name, &entrant.name_fingerprint)
        {
            entrant.name.clone_from(&who.pseudonym);
            entrant.name_fingerprint.clear();
            changed = true;
        }
    }
    changed
}
