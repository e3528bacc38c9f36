//! Files with a key: 32 random bytes, as 64 hexadecimal digits.

use std::path::Path;
use std::{fs, io};

use chefshat_record::atomic_file::{AtomicFile, WriteError};

/// Reads the key in a file; `None` if the file does not exist.
///
/// # Errors
/// The file contains no key, or cannot be read.
pub fn read(file: &Path) -> Result<Option<[u8; 32]>, String> {
    let text = match fs::read_to_string(file) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        text => text.map_err(|error| format!("{}: {error}", file.display()))?,
    };
    let bytes = hex::decode(text.trim()).unwrap_or_default();
    match bytes.try_into() {
        Ok(key) => Ok(Some(key)),
        Err(_) => {
            let file = file.display();
            Err(format!("{file} contains no key: 64 hexadecimal digits"))
        }
    }
}

/// Reads the key in a file. Creates the file, with a new key and readable only by its owner, if it does not
/// exist.
///
/// # Errors
/// The file contains no key, or cannot be read or created.
pub fn read_or_create(file: &Path) -> Result<[u8; 32], String> {
    let found = read(file);
    if let Some(key) =
        found.map_err(|error| format!("{error}; name a file that does not exist to create one"))?
    {
        return Ok(key);
    }
    let key = rand::random::<[u8; 32]>();
    match create(file, &key) {
        Ok(()) => Ok(key),
        Err(error) => match read(file) {
            // Another process was first.
            Ok(Some(key)) => Ok(key),
            _ => Err(format!("{}: {}", file.display(), error.source)),
        },
    }
}

fn create(path: &Path, key: &[u8; 32]) -> Result<(), WriteError> {
    let mut file = AtomicFile::create_private(path)?;
    file.write_all(format!("{}\n", hex::encode(key)).as_bytes())?;
    file.finish_new()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_who_create_a_key_at_once_have_the_same() {
        let folder = tempfile::tempdir().expect("a folder");
        for round in 0..20 {
            let file = folder.path().join(round.to_string());
            let keys: Vec<_> = std::thread::scope(|scope| {
                let threads = [(); 8].map(|()| scope.spawn(|| read_or_create(&file)));
                threads.map(|it| it.join().expect("no panic")).to_vec()
            });
            let first = keys[0].clone().expect("a key");
            assert!(keys.iter().all(|key| *key == Ok(first)), "{keys:?}");
        }
    }
}
