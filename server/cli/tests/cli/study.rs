//! `chefshat study` against a server: a study is created from the example, and deleted.

use tempfile::TempDir;

use super::run::{chefshat, run, serve};

/// The example of the documentation.
const EXAMPLE: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../docs/studies/example.toml"
);

#[test]
fn a_study_is_created_and_deleted() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(&folder.path().join("data"));
    let owner = folder.path().join("owner");
    let create = ["study", "create", EXAMPLE, "--json", "--server", &url];
    let owner_file = ["--owner-file", owner.to_str().unwrap()];
    let created = chefshat(&[&create[..], &owner_file].concat()).well().json();
    let id = created["study"]["studyId"].as_str().unwrap();
    let owned = |command: &str| {
        let owner = owner.to_str().unwrap();
        run(&url, &format!("study {command} {id} --owner-file {owner}"))
    };
    owned("links --add 3").well().assert_says(&["/study/"]);
    owned("delete").assert_refused("confirm with --yes");
    let deleted = owned("delete --yes --json").well().json();
    assert_eq!(deleted["study"]["participants"], 3, "{deleted}");
    owned("show").assert_failed("no study with this id and owner token");
    owned("delete --yes").assert_failed("no study with this id and owner token");
    chefshat(&["study", "--help"]).assert_helps("chefshat study links");
}
