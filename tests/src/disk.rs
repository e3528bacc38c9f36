//! A small separate disk for a test, which can be filled up or made read-only without side effects.

use std::ffi::OsString;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Stdio;

use tempfile::TempDir;
use tokio::io::{AsyncBufReadExt as _, BufReader};
use tokio::process::{Child, Command};

/// Reports, even if the output of tests is captured, that a test cannot run here.
pub fn skip(test: &str, why: &str) {
    // If the message cannot be written, there is nothing else to do.
    let _ = writeln!(std::io::stderr(), "SKIPPED {test}: {why}");
}

/// An in-memory file system in its own mount namespace, unmounted when dropped.
#[derive(Debug)]
pub struct SmallDisk {
    holder: Child,
    folder: TempDir,
    as_user: bool,
}

impl SmallDisk {
    /// Creates a disk of this size, in KiB.
    ///
    /// # Errors
    /// This machine does not allow it.
    pub async fn new(kib: u32) -> Result<Self, String> {
        // Only root may mount; other users may in a user namespace, if the system allows one.
        match Self::make(kib, false).await {
            Ok(disk) => Ok(disk),
            Err(as_root) => Self::make(kib, true)
                .await
                .map_err(|as_user| format!("no file system can be mounted: {as_root}; {as_user}")),
        }
    }

    async fn make(kib: u32, as_user: bool) -> Result<Self, String> {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut unshare = Command::new("unshare");
        unshare.args(["--mount", "--propagation", "private"]);
        if as_user {
            unshare.arg("--map-root-user");
        }
        let script =
            r#"mount -t tmpfs -o "size=$1k" tmpfs "$0" && echo mounted && exec sleep infinity"#;
        let mut holder = unshare
            .args(["sh", "-c", script])
            .arg(folder.path())
            .arg(kib.to_string())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .kill_on_drop(true)
            .spawn()
            .map_err(|error| format!("unshare: {error}"))?;
        let stdout = holder.stdout.take().expect("a pipe");
        let mut line = String::new();
        let said = BufReader::new(stdout).read_line(&mut line).await;
        if said.is_ok() && line.trim() == "mounted" {
            return Ok(Self {
                holder,
                folder,
                as_user,
            });
        }
        let output = holder.wait_with_output().await;
        let stderr = output.map(|output| String::from_utf8_lossy(&output.stderr).into_owned());
        Err(stderr.map_or_else(|error| error.to_string(), |text| text.trim().to_owned()))
    }

    /// The mount point, for processes in its namespace.
    pub fn mounted_at(&self) -> &Path {
        self.folder.path()
    }

    /// The program that runs another one in the namespace, with its arguments.
    pub fn enter(&self) -> Vec<OsString> {
        let target = format!("--target={}", self.id());
        let mut words = vec!["nsenter".into(), target.into(), "--mount".into()];
        if self.as_user {
            words.extend(["--user".into(), "--preserve-credentials".into()]);
        }
        words
    }

    /// The path from outside the namespace.
    pub fn path(&self) -> PathBuf {
        let root = PathBuf::from(format!("/proc/{}/root", self.id()));
        let inside = self
            .folder
            .path()
            .strip_prefix("/")
            .expect("an absolute path");
        root.join(inside)
    }

    /// Fills it up with a file of this name.
    pub fn fill(&self, name: &str) {
        let mut file = std::fs::File::create(self.path().join(name)).expect("a new file");
        let piece = [0xa5; 4096];
        while file.write_all(&piece).is_ok() {}
    }

    /// Shortens a file by this number of bytes, which are free then.
    pub fn shorten(&self, name: &str, bytes: u64) {
        let file = std::fs::File::options()
            .write(true)
            .open(self.path().join(name))
            .expect("a file");
        let length = file.metadata().expect("its length").len();
        file.set_len(length - bytes).expect("a shorter file");
    }

    /// Makes it read-only.
    pub async fn make_read_only(&self) {
        let mut enter = self.enter().into_iter();
        let status = Command::new(enter.next().expect("the program"))
            .args(enter)
            .args(["mount", "-o", "remount,ro"])
            .arg(self.folder.path())
            .status()
            .await;
        assert!(status.expect("nsenter runs").success());
    }

    fn id(&self) -> u32 {
        self.holder.id().expect("it sleeps forever")
    }
}
