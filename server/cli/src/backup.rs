//! `chefshat backup` and `chefshat restore`: copy a data directory while a server uses it, and put
//! a copy in place. The database is copied by [`chefshat_server::store`]; everything else in the
//! directory are files that are written once or replaced atomically.

use std::collections::BTreeSet;
use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use chefshat_record::atomic_file::sync_folder_of;
use chefshat_record::jsonl::folder_of;
use chefshat_record::{private, samples};
use chefshat_server::store::{DATABASE_FILE, DatabaseCopy, LOCK_FILE, check_copy, copy_database};
use clap::Args;
use serde_json::json;

use super::new_folder::{NewFolder, at};
use super::numbers::counted;
use super::{CommandError, data_dir, say};

/// Ending of files that are being written.
const PART: &str = "part";

/// Copy a data directory while a server uses it.
#[derive(Debug, Args)]
#[command(
    after_help = "The copy contains secrets: seeds of unfinished games, the signing key. Only you can read it; keep it so.\n\n\
                  Example:\n  chefshat backup /backups/chefshat-2027-03-01 --data-dir ./chefshat-data"
)]
pub(super) struct Backup {
    /// Folder to create. It appears when the copy is complete.
    #[arg(value_name = "TARGET")]
    target: PathBuf,
    /// Data directory. Default: chefshat in the user's data directory.
    #[arg(long, env = "CHEFSHAT_DATA_DIR")]
    data_dir: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

impl Backup {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let source = data_dir::name(self.data_dir)?;
        let target = self.target;
        // Only its owner can open it.
        let part = NewFolder::beside(&target, 0o700)?;
        // A record that is written later belongs to a game that the copy of the database may know
        // as unfinished.
        let mut records = names(&folder_of(&source))?;
        let copied = copy_database(&source, part.path()).await?;
        records.extend(
            copied
                .recorded
                .iter()
                .map(|id| format!("{id}.jsonl").into()),
        );
        let others = names(&source)?;
        copy_files(&source, part.path(), &others)?;
        let records = copy_files(&folder_of(&source), &folder_of(part.path()), &records)?;
        copy_samples(&source, part.path())?;
        sync();
        part.finish()?;
        report(self.json, "backup", &target, &copied, records, "")
    }
}

/// Create a data directory from a copy that `chefshat backup` made.
#[derive(Debug, Args)]
#[command(
    after_help = "Unfinished games resume when a server is started on the directory. Restart their agents with their tickets: they may \
                  have seen more than the copy knows.\n\nExample:\n  chefshat restore /backups/chefshat-2027-03-01 --data-dir ./chefshat-data"
)]
pub(super) struct Restore {
    /// The copy.
    #[arg(value_name = "SOURCE")]
    source: PathBuf,
    /// Data directory, which must be missing or empty. Default: chefshat in the user's data
    /// directory.
    #[arg(long, env = "CHEFSHAT_DATA_DIR")]
    data_dir: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

impl Restore {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let (source, target) = (self.source, data_dir::name(self.data_dir)?);
        if !source.join(DATABASE_FILE).exists() {
            return Err(format!(
                "{} has no {DATABASE_FILE}; name a folder that `chefshat backup` has made",
                source.display()
            )
            .into());
        }
        let copied = check_copy(&source).await?;
        if let Some(file) = first_entry(&target)? {
            return Err(format!(
                "{} is not empty: it has {}; choose another folder with --data-dir, or move it away. Nothing was changed",
                target.display(),
                file.display(),
            )
            .into());
        }
        copy_files(&source, &target, &names(&source)?)?;
        let records = names(&folder_of(&source))?;
        let records = copy_files(&folder_of(&source), &folder_of(&target), &records)?;
        copy_samples(&source, &target)?;
        // Last, under its name only when complete: a directory without a database is refused by
        // another attempt, and used by no server.
        let part = target.join(format!("{DATABASE_FILE}.{PART}"));
        copy_file(&source.join(DATABASE_FILE), &part)?;
        sync();
        let database = target.join(DATABASE_FILE);
        fs::rename(&part, &database).map_err(|error| at(&database, &error))?;
        sync_folder_of(&database).map_err(|error| at(&database, &error))?;
        let folder = folder_of(&target);
        let advice = format!(
            "; `chefshat verify {}` checks the records",
            folder.display()
        );
        report(self.json, "data_dir", &target, &copied, records, &advice)
    }
}

/// Says what was copied to a folder, which JSON calls `name`.
fn report(
    json: bool,
    name: &str,
    folder: &Path,
    copied: &DatabaseCopy,
    records: u64,
    advice: &str,
) -> Result<ExitCode, CommandError> {
    let folder = folder.display();
    if json {
        say(json!({
            name: folder.to_string(),
            "finished_games": copied.finished,
            "unfinished_games": copied.unfinished,
            "records": records,
        }))?;
    } else {
        say(format_args!(
            "{folder}: {}, {} unfinished, {}{advice}",
            counted(copied.finished, "finished game"),
            copied.unfinished,
            counted(records, "record"),
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Any file or folder in a folder, by name.
fn first_entry(folder: &Path) -> Result<Option<OsString>, CommandError> {
    let mut entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        entries => entries.map_err(|error| at(folder, &error))?,
    };
    let first = entries.next().transpose();
    let first = first.map_err(|error| at(folder, &error))?;
    Ok(first.map(|entry| entry.file_name()))
}

/// The files of a folder to copy one by one; none if it does not exist.
fn names(folder: &Path) -> Result<BTreeSet<OsString>, CommandError> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(BTreeSet::new()),
        entries => entries.map_err(|error| at(folder, &error))?,
    };
    let mut names = BTreeSet::new();
    for entry in entries {
        let entry = entry.map_err(|error| at(folder, &error))?;
        let name = entry.file_name();
        let is_file = entry.file_type().is_ok_and(|kind| kind.is_file());
        let own = name.to_string_lossy();
        let elsewhere = own.starts_with(DATABASE_FILE) || own == LOCK_FILE;
        let unfinished = Path::new(&name).extension() == Some(OsStr::new(PART));
        if is_file && !elsewhere && !unfinished {
            names.insert(name);
        }
    }
    Ok(names)
}

/// Copies the samples of a data directory, if it has any. The last chunk of a file that is being
/// written may be incomplete, and is ignored.
fn copy_samples(from: &Path, to: &Path) -> Result<(), CommandError> {
    let (from, to) = (samples::folder_of(from), samples::folder_of(to));
    let files = names(&from)?;
    match files.is_empty() {
        true => Ok(()),
        false => copy_files(&from, &to, &files).map(drop),
    }
}

/// Copies files into a folder, which is created. Skips those that have been deleted meanwhile.
/// Returns the number of copied files.
fn copy_files(from: &Path, to: &Path, names: &BTreeSet<OsString>) -> Result<u64, CommandError> {
    private::create_folder(to).map_err(|error| at(to, &error))?;
    let mut copied = 0;
    for name in names {
        copied += u64::from(copy_file(&from.join(name), &to.join(name))?);
    }
    Ok(copied)
}

/// Brings what was copied to the disk: one call for any number of files. Where there is none, each was
/// synced when it was copied.
fn sync() {
    #[cfg(unix)]
    rustix::fs::sync();
}

/// Copies a file so that only its owner can read it. Returns `false` if it does not exist.
fn copy_file(from: &Path, to: &Path) -> Result<bool, CommandError> {
    let mut source = match File::open(from) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(false),
        source => source.map_err(|error| at(from, &error))?,
    };
    let mut copy = || {
        let mut options = private::options();
        let mut target = options.write(true).create_new(true).open(to)?;
        io::copy(&mut source, &mut target)?;
        // Elsewhere one call syncs all files.
        match cfg!(unix) {
            true => Ok(()),
            false => target.sync_all(),
        }
    };
    copy().map_err(|error| at(to, &error))?;
    Ok(true)
}
