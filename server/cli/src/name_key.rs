//! `--name-key`: the file with the key of a participant's name.

use std::path::PathBuf;

use clap::Args;

use crate::{CommandError, key_file};

/// The flag for the key of a name.
#[derive(Debug, Args)]
pub struct NameKeyArg {
    /// File with the key that tells this name from the same name of others, in leaderboards and
    /// records. It is created if it does not exist; keep it secret, and use it again.
    #[arg(long, value_name = "FILE", conflicts_with = "ticket")]
    name_key: Option<PathBuf>,
}

impl NameKeyArg {
    /// The key, 32 bytes; empty without the flag.
    ///
    /// # Errors
    /// The file contains no key, or cannot be read or created.
    pub fn key(&self) -> Result<Vec<u8>, CommandError> {
        let Some(file) = &self.name_key else {
            return Ok(Vec::new());
        };
        let key = key_file::read_or_create(file).map_err(|error| format!("--name-key: {error}"));
        Ok(key?.to_vec())
    }
}

#[cfg(all(test, unix))]
mod tests {
    use std::fs;
    use std::os::unix::fs::PermissionsExt as _;
    use std::path::Path;

    use crate::name_key::*;

    #[test]
    fn a_key_is_created_once_and_kept() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("name.key");
        let arg = |file: &Path| NameKeyArg {
            name_key: Some(file.to_owned()),
        };
        let key = arg(&file).key().unwrap();
        assert_eq!(key.len(), 32);
        assert_eq!(arg(&file).key().unwrap(), key);
        let mode = fs::metadata(&file).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o600);
        assert_ne!(arg(&folder.path().join("other.key")).key().unwrap(), key);
        assert!(NameKeyArg { name_key: None }.key().unwrap().is_empty());

        fs::write(&file, "0123").unwrap();
        let refused = arg(&file).key().unwrap_err().to_string();
        assert!(refused.contains("contains no key"), "{refused}");
        let refused = arg(folder.path()).key().unwrap_err().to_string();
        assert!(refused.starts_with("--name-key: "), "{refused}");
    }
}
