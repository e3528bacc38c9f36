//! `cargo xtask dist`: everything of a release, in the folder `target/artefacts`, from the commit that is
//! checked out: the static programs as archives, Debian packages and an image, the wheels, the
//! crates, the protocol, the book, the source, what they contain, checksums and a signature.
//! docs/releases.md says what is for whom. The tests of `tests/deployment` try them on bare systems.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::book;
use crate::command::{cargo, git, python_command, read, run as run_command, succeeds};
use crate::failure::Failure;
use crate::notices::{FEATURE, FILE as NOTICES, notices};
use crate::places::{DEPLOYMENT, Places};
use crate::setup::{self, at};
use crate::steps::Steps;
use crate::wheels::{self, PROGRAMS};

/// The version of everything.
const VERSION: &str = env!("CARGO_PKG_VERSION");
/// What archives and Debian packages are made for.
const PLATFORMS: [Platform; 2] = [
    Platform {
        processor: wheels::PROCESSORS[0],
        debian: "amd64",
    },
    Platform {
        processor: wheels::PROCESSORS[1],
        debian: "arm64",
    },
];
/// Cargo's profile of what is published.
const PROFILE: &str = "dist";
/// The crates that others build on.
const CRATES: [&str; 3] = ["chefshat-proto", "chefshat-engine", "chefshat-client"];
/// Shells with completion scripts, and where Debian keeps them.
const COMPLETIONS: [(&str, &str); 3] = [
    ("bash", "usr/share/bash-completion/completions/chefshat"),
    ("zsh", "usr/share/zsh/vendor-completions/_chefshat"),
    ("fish", "usr/share/fish/vendor_completions.d/chefshat.fish"),
];
/// What a signature is for: part of what is signed.
const NAMESPACE: &str = "chefshat-release";

/// A processor for which the programs are built.
struct Platform {
    /// Rust's word for it.
    processor: &'static str,
    /// Debian's word for it.
    debian: &'static str,
}

impl Platform {
    /// That of this machine, on which the program can say what it has.
    fn host() -> Result<&'static Self, Failure> {
        let arch = std::env::consts::ARCH;
        let host = |platform: &&Self| platform.processor == arch;
        (PLATFORMS.iter().find(host))
            .ok_or_else(|| Failure::new(format!("no release is made on {arch}")))
    }

    /// The name of its archive.
    fn archive_name(&self) -> String {
        format!("chefshat-{VERSION}-{}-linux", self.processor)
    }
}

/// Makes the release; `key`: a file with the SSH key that signs the checksums.
pub(crate) fn run(
    places: &Places,
    steps: &mut Steps,
    key: Option<&Path>,
    try_them: bool,
) -> Result<(), Failure> {
    let dist = places.dist();
    let stage = places.own.join("dist");
    let host = Platform::host()?;
    let mut commit = String::new();
    steps.run("check that all is committed", || {
        commit = committed(places)?;
        Ok(())
    })?;
    if let Some(key) = key {
        steps.run("check that the key is there", || {
            fs::metadata(key).map(drop).map_err(|error| at(key, &error))
        })?;
    }
    steps.run("empty the folder", || {
        [&dist, &stage]
            .into_iter()
            .try_for_each(|folder| emptied(folder))
    })?;

    book::run(places, steps)?;
    // With the page, which the binary contains.
    wheels::run(places, steps, &wheels::PROCESSORS, PROFILE, false)?;
    steps.run("copy the wheels", || {
        wheels::built(&places.wheels())?
            .iter()
            .try_for_each(|wheel| copy(wheel, &dist.join(file_name(wheel))))
    })?;

    let release = Release {
        places,
        dist: &dist,
        stage: &stage,
        date: read(git(places).args(["log", "-1", "--format=%ct", &commit]))?,
        commit,
        host,
    };
    for platform in &PLATFORMS {
        let name = platform.processor;
        steps.run(&format!("licences of what {name} contains"), || {
            release.notices(platform)
        })?;
        steps.run(&format!("archive of the programs, {name}"), || {
            release.programs_archive(platform)
        })?;
        steps.run(&format!("Debian package, {name}"), || {
            release.debian(platform)
        })?;
    }
    steps.program("package crates", &mut release.package_crates())?;
    steps.run("copy the crates", || release.copy_crates())?;
    steps.run("protocol and book", || release.protocol_and_book())?;
    steps.run("source", || release.source())?;
    let cyclonedx = setup::cargo_cyclonedx(places)?;
    steps.run("what it contains", || release.contents(cyclonedx))?;
    match setup::debian_programs(&setup::FOR_IMAGES) {
        Ok(()) => steps.run("image", || release.image())?,
        Err(failure) => steps.skip("image", &failure.to_string()),
    }
    steps.run("check that nothing has changed meanwhile", || {
        unchanged(places, &release.commit)
    })?;
    steps.run("checksums", || release.sign(key))?;
    if try_them {
        steps.run("set up Python", || setup::python_packages(places))?;
        steps.run("set up an emulator", || {
            setup::debian_programs(&[setup::EMULATOR])
        })?;
        let mut trying = python_command(places, DEPLOYMENT, "pytest");
        trying.env("CHEFSHAT_DIST", &dist);
        if let Some(key) = key {
            let key = std::path::absolute(key).map_err(|error| at(key, &error))?;
            trying.env("CHEFSHAT_RELEASE_KEY", key);
        }
        trying.args(["-p", "no:cacheprovider", "tests/test_release.py"]);
        steps.program("try everything on bare systems", &mut trying)?;
    }
    steps.run("the release", || release.list())
}

/// A release in the making.
struct Release<'a> {
    places: &'a Places,
    /// Where it is put.
    dist: &'a Path,
    /// Where it is prepared.
    stage: &'a Path,
    /// The commit that it is made from.
    commit: String,
    /// The time of the commit, seconds since 1970: that of all files in archives.
    date: String,
    /// The platform of this machine.
    host: &'static Platform,
}

impl Release<'_> {
    /// The program that runs here.
    fn binary(&self) -> PathBuf {
        self.program(self.host, PROGRAMS[0])
    }

    fn program(&self, platform: &Platform, name: &str) -> PathBuf {
        wheels::program(self.places, platform.processor, PROFILE, name)
    }

    /// Where the licences of what a platform's programs contain are.
    fn notices_of(&self, platform: &Platform) -> PathBuf {
        self.stage
            .join("notices")
            .join(platform.processor)
            .join(NOTICES)
    }

    fn notices(&self, platform: &Platform) -> Result<(), Failure> {
        let text = notices(self.places, &wheels::static_target(platform.processor))?;
        write(&self.notices_of(platform), &text)
    }

    /// The programs with their manual pages, completions and units, to unpack anywhere.
    fn programs_archive(&self, platform: &Platform) -> Result<(), Failure> {
        let name = platform.archive_name();
        let folder = self.stage.join(&name);
        for program in PROGRAMS {
            copy(&self.program(platform, program), &folder.join(program))?;
        }
        for document in ["docker/archive/README.md", "CHANGELOG.md", "LICENSE"] {
            let from = self.places.root.join(document);
            copy(&from, &folder.join(file_name(&from)))?;
        }
        copy(&self.notices_of(platform), &folder.join(NOTICES))?;
        for unit in ["chefshat.service", "chefshat.socket"] {
            let from = self.places.root.join("docker/systemd").join(unit);
            copy(&from, &folder.join("systemd").join(unit))?;
        }
        for (shell, path) in COMPLETIONS {
            let script = read(Command::new(self.binary()).args(["completions", shell]))?;
            let to = folder.join("completions").join(file_name(path.as_ref()));
            write(&to, &format!("{script}\n"))?;
        }
        let man = folder.join("man");
        run_command(
            Command::new(self.binary())
                .arg("man")
                .arg("--out-dir")
                .arg(&man),
        )?;
        self.archive(&name, self.stage, &[&name])
    }

    /// The same as a Debian package, with the user of the unit and its configuration.
    fn debian(&self, platform: &Platform) -> Result<(), Failure> {
        let root = self.stage.join("debian").join(platform.debian);
        let unpacked = self.stage.join(platform.archive_name());
        let scripts = self.places.root.join("docker/debian");
        for program in PROGRAMS {
            copy(&unpacked.join(program), &root.join("usr/bin").join(program))?;
        }
        for (_, path) in COMPLETIONS {
            let from = unpacked.join("completions").join(file_name(path.as_ref()));
            copy(&from, &root.join(path))?;
        }
        for page in entries(&unpacked.join("man"))? {
            let to = root.join("usr/share/man/man1").join(file_name(&page));
            copy(&page, &to)?;
            run_command(Command::new("gzip").args(["-9", "--no-name"]).arg(&to))?;
        }
        for unit in entries(&unpacked.join("systemd"))? {
            copy(
                &unit,
                &root.join("lib/systemd/system").join(file_name(&unit)),
            )?;
        }
        let licence = root.join("usr/share/doc/chefshat/copyright");
        copy(&unpacked.join("LICENSE"), &licence)?;
        let notices = root.join("usr/share/doc/chefshat").join(NOTICES);
        copy(&unpacked.join(NOTICES), &notices)?;
        let mut config = Command::new(self.binary());
        config.arg("config").env_clear();
        // As comments, so that a later version's defaults count.
        let settings = read(&mut config)?;
        let settings = settings
            .lines()
            .map(|line| match line.ends_with("# default") {
                true => format!("# {line}"),
                false => line.to_owned(),
            });
        let settings = settings.collect::<Vec<_>>().join("\n");
        write(
            &root.join("etc/chefshat/chefshat.toml"),
            &format!("{settings}\n"),
        )?;
        write(
            &root.join("DEBIAN/conffiles"),
            "/etc/chefshat/chefshat.toml\n",
        )?;
        for script in ["postinst", "prerm"] {
            copy(&scripts.join(script), &root.join("DEBIAN").join(script))?;
        }
        let control = scripts.join("control");
        let control = fs::read_to_string(&control).map_err(|error| at(&control, &error))?;
        let control = control.replace("@VERSION@", VERSION);
        write(
            &root.join("DEBIAN/control"),
            &control.replace("@ARCHITECTURE@", platform.debian),
        )?;
        let package = format!("chefshat_{VERSION}_{}.deb", platform.debian);
        let package = self.dist.join(package);
        let mut build = Command::new("dpkg-deb");
        build.args(["--build", "--root-owner-group", "-Zxz"]);
        build
            .arg(&root)
            .arg(package)
            .env("SOURCE_DATE_EPOCH", &self.date);
        run_command(&mut build)
    }

    fn package_crates(&self) -> Command {
        let mut package = cargo();
        package.current_dir(&self.places.root);
        package.args(["package", "--locked", "--quiet"]);
        for name in CRATES {
            package.args(["--package", name]);
        }
        package
    }

    fn copy_crates(&self) -> Result<(), Failure> {
        CRATES.into_iter().try_for_each(|name| {
            let file = format!("{name}-{VERSION}.crate");
            copy(
                &self.places.target.join("package").join(&file),
                &self.dist.join(&file),
            )
        })
    }

    fn protocol_and_book(&self) -> Result<(), Failure> {
        let protocol = format!("chefshat-protocol-{VERSION}");
        let proto = self.places.root.join("proto");
        let folder = self.stage.join(&protocol);
        run_command(Command::new("mkdir").arg(&folder))?;
        let mut copying = Command::new("cp");
        copying.arg("-r").arg(proto.join("chefshat"));
        copying.args([proto.join("README.md"), proto.join("buf.yaml")]);
        run_command(copying.arg(self.places.root.join("LICENSE")).arg(&folder))?;
        self.archive(&protocol, self.stage, &[&protocol])?;
        let book = self.places.book();
        let parent = book.parent().unwrap_or(&book);
        self.archive(
            &format!("chefshat-book-{VERSION}"),
            parent,
            &[&file_name(&book)],
        )
    }

    fn source(&self) -> Result<(), Failure> {
        let name = format!("chefshat-{VERSION}-source");
        let mut archive = git(self.places);
        archive.args(["archive", "--format=tar.gz"]);
        archive.arg(format!("--prefix={name}/"));
        archive.arg(format!("--output={}/{name}.tar.gz", self.dist.display()));
        run_command(archive.arg(&self.commit))?;
        // What describes the contents writes beside the manifests.
        run_command(
            Command::new("tar")
                .arg("-xzf")
                .arg(self.dist.join(format!("{name}.tar.gz")))
                .arg("-C")
                .arg(self.stage),
        )
    }

    /// The bills of materials of the binary and of the page in it.
    fn contents(&self, mut cyclonedx: Command) -> Result<(), Failure> {
        let source = self.stage.join(format!("chefshat-{VERSION}-source"));
        // It contains what the other program contains.
        let manifest = source.join("server/lab/Cargo.toml");
        cyclonedx
            .current_dir(&source)
            .arg("cyclonedx")
            .arg("--manifest-path");
        cyclonedx
            .arg(&manifest)
            .args(["--features", FEATURE, "--format", "json", "--quiet"])
            .arg("--target")
            .arg(wheels::static_target(self.host.processor));
        cyclonedx.args(["--override-filename", "contents"]);
        cyclonedx.env("SOURCE_DATE_EPOCH", &self.date);
        run_command(&mut cyclonedx)?;
        let binary = self.dist.join(format!("chefshat-{VERSION}.cdx.json"));
        copy(&source.join("server/lab/contents.json"), &binary)?;
        let mut npm = Command::new("npm");
        npm.current_dir(self.places.web());
        npm.args(["sbom", "--omit", "dev", "--sbom-format", "cyclonedx"]);
        let page = self.dist.join(format!("chefshat-page-{VERSION}.cdx.json"));
        write(&page, &format!("{}\n", read(&mut npm)?))
    }

    /// The image of docker/Dockerfile with the static binary, on a base that has certificate
    /// authorities and nothing else. Nothing is pulled.
    fn image(&self) -> Result<(), Failure> {
        let release =
            read(Command::new("sh").args(["-c", ". /etc/os-release; echo $VERSION_CODENAME"]))?;
        let system = self.places.own.join("image-base");
        if !system.join("etc/ssl/certs/ca-certificates.crt").exists() {
            let _ = fs::remove_dir_all(&system);
            let mut make = Command::new("/usr/sbin/debootstrap");
            make.args(["--variant=minbase", "--include=ca-certificates", &release]);
            run_command(make.arg(&system))?;
        }
        let authorities = "etc/ssl/certs/ca-certificates.crt";
        let system = system.display().to_string();
        self.base_image("base", &system, "/")?;
        self.base_image(
            "server-base",
            &format!("{system}/{authorities}"),
            &format!("/{authorities}"),
        )?;
        let programs = self.stage.join("programs");
        for program in PROGRAMS {
            copy(&self.program(self.host, program), &programs.join(program))?;
        }
        copy(&self.notices_of(self.host), &programs.join(NOTICES))?;
        self.base_image("binary", &programs.display().to_string(), "/")?;
        let root = self.places.root.display();
        let name = format!("localhost/chefshat:{VERSION}");
        let mut build = self.buildah();
        build.args([
            "build",
            "--format=docker",
            "--isolation=chroot",
            "--pull-never",
        ]);
        build.args(["--target=server", "--timestamp", &self.date, "--tag", &name]);
        for (argument, image) in [
            ("NODE_BASE", "base"),
            ("SERVER_BASE", "server-base"),
            ("BINARY", "binary"),
        ] {
            build.arg(format!("--build-arg={argument}=localhost/{image}"));
        }
        // No stage that is built reads the source tree.
        build.arg(format!("--file={root}/docker/Dockerfile"));
        run_command(build.arg(self.places.root.join("docker")))?;
        let file = self.dist.join(format!("chefshat-{VERSION}-image.tar"));
        let to = format!("docker-archive:{}:chefshat:{VERSION}", file.display());
        run_command(self.buildah().args(["push", "--quiet", &name, &to]))?;
        run_command(self.buildah().args(["rmi", "--all", "--force"]))
    }

    /// An image that contains a file or folder.
    fn base_image(&self, name: &str, from: &str, to: &str) -> Result<(), Failure> {
        let container = read(self.buildah().args(["from", "scratch"]))?;
        run_command(
            self.buildah()
                .args(["copy", "--quiet", &container, from, to]),
        )?;
        let image = format!("localhost/{name}");
        run_command(
            self.buildah()
                .args(["commit", "--quiet", "--rm", &container, &image]),
        )
    }

    fn buildah(&self) -> Command {
        let storage = self.stage.join("images");
        let mut buildah = Command::new("buildah");
        buildah.arg("--root").arg(storage.join("root"));
        buildah.arg("--runroot").arg(storage.join("run"));
        buildah
    }

    /// Writes the checksums of all files, and signs them.
    fn sign(&self, key: Option<&Path>) -> Result<(), Failure> {
        let files: Vec<String> = entries(self.dist)?
            .iter()
            .map(|file| file_name(file))
            .collect();
        let mut sums = Command::new("sha256sum");
        let sums = read(sums.current_dir(self.dist).arg("--").args(files))?;
        let file = self.dist.join("SHA256SUMS");
        write(&file, &format!("{sums}\n"))?;
        let Some(key) = key else {
            println!("    not signed: give --key FILE");
            return Ok(());
        };
        let mut sign = Command::new("ssh-keygen");
        sign.args(["-Y", "sign", "-q", "-n", NAMESPACE, "-f"]);
        run_command(sign.arg(key).arg(&file))
    }

    fn list(&self) -> Result<(), Failure> {
        for file in entries(self.dist)? {
            let metadata = fs::metadata(&file).map_err(|error| at(&file, &error))?;
            let megabytes = metadata.len() as f64 / 1e6;
            println!("    {megabytes:>7.2} MB  {}", file_name(&file));
        }
        println!("    in {}", self.dist.display());
        Ok(())
    }

    /// An archive that is the same for the same files.
    fn archive(&self, name: &str, folder: &Path, what: &[&str]) -> Result<(), Failure> {
        let mut tar = Command::new("tar");
        tar.args(["--sort=name", "--owner=0", "--group=0", "--numeric-owner"]);
        tar.arg("--mode=u=rwX,go=rX")
            .arg(format!("--mtime=@{}", self.date));
        tar.args(["--use-compress-program=gzip -9 -n", "-cf"]);
        tar.arg(self.dist.join(format!("{name}.tar.gz")));
        run_command(tar.arg("-C").arg(folder).args(what))
    }
}

/// The commit that is checked out, if the source tree is what it contains.
fn committed(places: &Places) -> Result<String, Failure> {
    let mut status = git(places);
    status.args(["status", "--porcelain", "--untracked-files=normal"]);
    match read(&mut status)?.is_empty() {
        true => read(git(places).args(["rev-parse", "HEAD"])),
        false => Err(Failure::new(
            "commit your changes: a release is made from a commit",
        )),
    }
}

/// Checks that the source tree still is what a commit contains: the steps read it one after the other.
fn unchanged(places: &Places, commit: &str) -> Result<(), Failure> {
    match committed(places)? == commit {
        true => Ok(()),
        false => Err(Failure::new(format!(
            "another commit was checked out meanwhile; check {commit} out and begin again"
        ))),
    }
}

fn emptied(folder: &Path) -> Result<(), Failure> {
    // Images have files that only `rm` of their owner removes.
    if folder.exists() && !succeeds("rm", &["-rf", &folder.display().to_string()]) {
        return Err(Failure::new(format!(
            "{} cannot be removed",
            folder.display()
        )));
    }
    fs::create_dir_all(folder).map_err(|error| at(folder, &error))
}

fn copy(from: &Path, to: &Path) -> Result<(), Failure> {
    let folder = to.parent().unwrap_or(to);
    fs::create_dir_all(folder).map_err(|error| at(folder, &error))?;
    fs::copy(from, to)
        .map(drop)
        .map_err(|error| at(from, &error))
}

fn write(file: &Path, text: &str) -> Result<(), Failure> {
    let folder = file.parent().unwrap_or(file);
    fs::create_dir_all(folder).map_err(|error| at(folder, &error))?;
    fs::write(file, text).map_err(|error| at(file, &error))
}

/// What is in a folder, sorted.
fn entries(folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let listed = fs::read_dir(folder).map_err(|error| at(folder, &error))?;
    let mut paths: Vec<PathBuf> = listed
        .filter_map(|it| it.ok().map(|it| it.path()))
        .collect();
    paths.sort();
    Ok(paths)
}

fn file_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

#[test]
fn a_release_is_made_from_one_commit() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().to_path_buf();
    let places = Places {
        target: root.join("target"),
        own: root.join("target/xtask"),
        root,
    };
    let commit = || {
        let author = ["-c", "user.name=x", "-c", "user.email=x@example.org"];
        let mut commit = git(&places);
        commit.args(author);
        commit.args(["commit", "--quiet", "--allow-empty", "--message=x"]);
        run_command(&mut commit).unwrap();
        committed(&places).unwrap()
    };
    run_command(git(&places).args(["init", "--quiet"])).unwrap();
    let first = commit();
    unchanged(&places, &first).unwrap();
    let file = places.root.join("file");
    fs::write(&file, "").unwrap();
    unchanged(&places, &first).unwrap_err();
    fs::remove_file(&file).unwrap();
    unchanged(&places, &first).unwrap();
    assert_ne!(commit(), first);
    unchanged(&places, &first).unwrap_err();
}

/// All packages have one version, and name each other with it.
#[test]
fn the_versions_agree() {
    let root = Places::find().unwrap().root;
    let quoted = format!("\"{VERSION}\"");
    let exact = format!("=={VERSION}\"");
    let cases = [
        ("Cargo.toml", format!("\nversion = {quoted}"), 1),
        (
            "Cargo.toml",
            format!("version = \"={VERSION}\""),
            CRATES.len(),
        ),
        (
            "clients/python/pyproject.toml",
            format!("\nversion = {quoted}"),
            1,
        ),
        ("clients/python/pyproject.toml", exact.clone(), 2),
        (
            "clients/paper/pyproject.toml",
            format!("\nversion = {quoted}"),
            1,
        ),
        (
            "clients/paper/pyproject.toml",
            format!("\"chefshat{exact}"),
            1,
        ),
        (
            "clients/robot/pyproject.toml",
            format!("\nversion = {quoted}"),
            1,
        ),
        (
            "clients/robot/pyproject.toml",
            format!("\"chefshat{exact}"),
            1,
        ),
        (
            "tests/deployment/pyproject.toml",
            format!("\nversion = {quoted}"),
            1,
        ),
        (
            "clients/node/package.json",
            format!("\"version\": {quoted}"),
            1,
        ),
        (
            "clients/web/package.json",
            format!("\"version\": {quoted}"),
            1,
        ),
        ("CITATION.cff", format!("\nversion: {VERSION}\n"), 1),
        ("CHANGELOG.md", format!("\n## [{VERSION}]"), 1),
    ];
    for (file, words, times) in cases {
        let text = fs::read_to_string(root.join(file)).unwrap();
        assert_eq!(text.matches(&words).count(), times, "{file}: {words}");
    }
}
