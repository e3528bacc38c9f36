//! Files with size and SHA-256 computed while writing, for dataset cards and `SHA256SUMS`.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use sha2::{Digest as _, Sha256};

/// A file of a dataset.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileSummary {
    /// The path in the dataset, separated by `/`.
    pub path: String,
    /// Size in bytes.
    pub bytes: u64,
    /// SHA-256, lower-case hexadecimal.
    pub sha256: String,
}

/// A file being written.
pub(super) struct SummedFile {
    path: String,
    file: BufWriter<File>,
    hash: Sha256,
    bytes: u64,
}

impl SummedFile {
    /// Creates a file at `path` in `folder`, with its parent folders.
    pub(super) fn create(folder: &Path, path: &str) -> io::Result<Self> {
        let target = folder.join(path);
        if let Some(parent) = target.parent() {
            std::fs::create_dir_all(parent)?;
        }
        Ok(Self {
            path: path.to_owned(),
            file: BufWriter::new(File::create_new(target)?),
            hash: Sha256::new(),
            bytes: 0,
        })
    }

    /// Syncs the file and returns its summary.
    pub(super) fn finish(self) -> io::Result<FileSummary> {
        self.file.into_inner()?.sync_all()?;
        Ok(FileSummary {
            path: self.path,
            bytes: self.bytes,
            sha256: hex::encode(self.hash.finalize()),
        })
    }
}

impl Write for SummedFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.file.write(bytes)?;
        self.hash.update(&bytes[..written]);
        self.bytes += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}
