//! Files and folders that only their owner opens. Where a system has no such modes, they have the
//! rights of the folder that they are in.

use std::fs::{DirBuilder, OpenOptions};
use std::io;
use std::path::Path;

/// Options that create a file which only its owner opens.
#[must_use]
pub fn options() -> OpenOptions {
    #[cfg_attr(not(unix), expect(unused_mut, reason = "there is no mode to set"))]
    let mut options = OpenOptions::new();
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    options
}

/// Creates a folder that only its owner opens, with those above it. Closes one that exists.
///
/// # Errors
/// The folder cannot be created, or belongs to someone else.
pub fn create_folder(folder: &Path) -> io::Result<()> {
    let mut builder = DirBuilder::new();
    builder.recursive(true);
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(folder)?;
    #[cfg(unix)]
    std::fs::set_permissions(folder, std::os::unix::fs::PermissionsExt::from_mode(0o700))?;
    Ok(())
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::fs::PermissionsExt as _;

    use super::*;

    #[test]
    fn only_the_owner_opens_what_is_private() {
        let folder = tempfile::tempdir().expect("a folder");
        let (outer, file) = (folder.path().join("outer"), folder.path().join("file"));
        create_folder(&outer.join("inner")).expect("created");
        std::fs::set_permissions(&outer, std::os::unix::fs::PermissionsExt::from_mode(0o755))
            .expect("ours");
        create_folder(&outer).expect("closed");
        options()
            .create_new(true)
            .write(true)
            .open(&file)
            .expect("new");
        for (path, mode) in [
            (&outer.join("inner"), 0o700),
            (&outer, 0o700),
            (&file, 0o600),
        ] {
            let metadata = path.metadata().expect("there");
            assert_eq!(metadata.permissions().mode() & 0o777, mode, "{path:?}");
        }
    }
}
