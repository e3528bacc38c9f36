//! A file that appears whole or not at all: written beside its place, synced, then moved there. Folders of files that belong together are
//! made in [`chefshat_dataset`].

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// Why a file could not be written; whatever was in its place is still there.
#[derive(Debug, thiserror::Error)]
#[error("{path}: {source}")]
pub struct WriteError {
    /// The file that was to be.
    pub path: PathBuf,
    /// What the system said.
    pub source: io::Error,
}

/// A file being written. One that is not finished leaves nothing behind.
#[derive(Debug)]
pub struct WholeFile {
    path: PathBuf,
    part: PathBuf,
    file: Option<BufWriter<File>>,
}

impl WholeFile {
    /// Begins a file that will be `path`. Until then it is beside it, with the ending `.part`.
    ///
    /// # Errors
    /// The file cannot be made.
    pub fn create(path: &Path) -> Result<Self, WriteError> {
        let mut part = path.as_os_str().to_owned();
        part.push(".part");
        let part = PathBuf::from(part);
        let file = File::create(&part).map_err(|source| WriteError {
            path: path.to_path_buf(),
            source,
        })?;
        Ok(Self {
            path: path.to_path_buf(),
            part,
            file: Some(BufWriter::new(file)),
        })
    }

    /// Where the file is until it is whole, for another program to write it.
    pub fn part(&self) -> &Path {
        &self.part
    }

    /// Writes bytes.
    ///
    /// # Errors
    /// The file system refused.
    pub fn write_all(&mut self, bytes: &[u8]) -> Result<(), WriteError> {
        Write::write_all(self, bytes).map_err(|source| self.error(source))
    }

    /// Puts the file in its place, for good: the file and the folder are synced.
    ///
    /// # Errors
    /// The file system refused; what was written is gone.
    pub fn finish(mut self) -> Result<(), WriteError> {
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
            .and_then(|()| sync_folder_of(&self.path))
            .map_err(|source| self.error(source))
    }

    fn error(&self, source: io::Error) -> WriteError {
        WriteError {
            path: self.path.clone(),
            source,
        }
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

/// Sees to it that the folder of a file or folder knows it for good.
pub fn sync_folder_of(path: &Path) -> io::Result<()> {
    // Elsewhere a folder cannot be opened, nor need it be.
    if cfg!(unix) {
        let folder = path.parent().filter(|folder| *folder != Path::new(""));
        File::open(folder.unwrap_or(Path::new(".")))?.sync_all()?;
    }
    Ok(())
}
