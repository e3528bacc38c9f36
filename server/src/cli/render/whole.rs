//! A file that appears whole or not at all: written beside its place, synced, then moved there.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use super::CommandError;

/// A file being written. One that is not finished leaves nothing behind.
pub(super) struct WholeFile {
    path: PathBuf,
    part: PathBuf,
    file: Option<BufWriter<File>>,
}

impl WholeFile {
    /// Begins a file beside `path`.
    pub(super) fn create(path: &Path) -> Result<Self, CommandError> {
        let (path, part) = (path.to_path_buf(), part_of(path));
        let file = File::create(&part).map_err(|error| format!("{}: {error}", path.display()))?;
        Ok(Self {
            path,
            part,
            file: Some(BufWriter::new(file)),
        })
    }

    /// Where the file is until it is whole, for another program to write it.
    pub(super) fn part(&self) -> &Path {
        &self.part
    }

    /// Writes bytes.
    pub(super) fn write_all(&mut self, bytes: &[u8]) -> Result<(), CommandError> {
        Write::write_all(self, bytes)
            .map_err(|error| format!("{}: {error}", self.path.display()).into())
    }

    /// Puts the file in its place.
    pub(super) fn finish(mut self) -> Result<(), CommandError> {
        let synced = match self.file.take() {
            Some(file) => file
                .into_inner()
                .map_err(io::IntoInnerError::into_error)
                // What another program wrote under this name is synced by opening it anew.
                .and_then(|_| File::options().write(true).open(&self.part)?.sync_all()),
            None => Ok(()),
        };
        synced
            .and_then(|()| std::fs::rename(&self.part, &self.path))
            .map_err(|error| format!("{}: {error}", self.path.display()).into())
    }
}

impl Write for WholeFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match &mut self.file {
            Some(file) => file.write(bytes),
            None => Err(io::ErrorKind::BrokenPipe.into()),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.as_mut().map_or(Ok(()), Write::flush)
    }
}

impl Drop for WholeFile {
    fn drop(&mut self) {
        // After the file was put in its place there is nothing here any more; before, it is worth nothing.
        let _ = std::fs::remove_file(&self.part);
    }
}

fn part_of(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".part");
    name.into()
}
