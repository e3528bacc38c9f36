//! The generated code is what the `.proto` files say. With `CHEFSHAT_GENERATE=1` it is written anew:
//!
//! ```text
//! CHEFSHAT_GENERATE=1 cargo test -p chefshat-proto --test generated
//! ```
//!
//! It is checked in, so that building the server needs no generator. Protox reads the files: no
//! protoc is needed.

mod shapes;

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

use prost::Message as _;
use prost_types::FileDescriptorSet;
use tonic_prost_build::Builder;

type Generated = Result<(), Box<dyn Error>>;

/// Compares what `generate` writes into a folder with what is checked in, or replaces that.
fn check(checked_in: &str, generate: impl FnOnce(&Path) -> Generated) {
    let checked_in = Path::new(env!("CARGO_MANIFEST_DIR")).join(checked_in);
    let made = tempfile::tempdir().expect("a folder");
    generate(made.path()).expect("the .proto files are correct");
    let files = |folder: &Path| {
        let mut files: Vec<_> = (fs::read_dir(folder).expect("the folder"))
            .map(|file| file.expect("a file").file_name())
            .collect();
        files.sort();
        files
    };
    if std::env::var_os("CHEFSHAT_GENERATE").is_some_and(|value| value == "1") {
        fs::create_dir_all(&checked_in).expect("created");
        for file in files(&checked_in) {
            fs::remove_file(checked_in.join(file)).expect("removed");
        }
        for file in files(made.path()) {
            fs::copy(made.path().join(&file), checked_in.join(&file)).expect("written");
        }
    }
    assert_eq!(files(&checked_in), files(made.path()));
    for file in files(made.path()) {
        let read = |folder: &Path| fs::read(folder.join(&file)).expect("a file");
        assert!(
            read(&checked_in) == read(made.path()),
            "{} is not what the .proto files say: run CHEFSHAT_GENERATE=1 cargo test -p chefshat-proto --test generated",
            checked_in.join(&file).display()
        );
    }
}

/// Rewrites the traits of services in a folder, so that implementations have plain `async fn`. The macro
/// `async_trait` boxes each future, and the lifetimes in its bounds make the compiler prove anew for
/// every service that all it uses is `Send`: half of the time that the gateway took to build.
fn with_async_methods(out: &Path) -> Generated {
    let replaced = |method: &str, from: &str, to: &str| {
        assert!(
            method.contains(from),
            "tonic writes methods otherwise: {method}"
        );
        method.replacen(from, to, 1)
    };
    for file in fs::read_dir(out)? {
        let path = file?.path();
        if path.extension().is_none_or(|extension| extension != "rs") {
            continue;
        }
        let code = fs::read_to_string(&path)?.replace("    #[async_trait]\n", "");
        let mut parts = code.split("        async fn ");
        let mut rewritten = parts.next().unwrap_or_default().to_owned();
        for method in parts {
            let method = replaced(
                method,
                ") -> std::result::Result<",
                ") -> impl Future<Output = std::result::Result<",
            );
            let method = replaced(&method, ">;\n", ">> + std::marker::Send;\n");
            rewritten += &format!("        fn {method}");
        }
        fs::write(&path, rewritten)?;
    }
    Ok(())
}

/// A builder of code in this folder.
fn builder(out: &Path) -> Builder {
    tonic_prost_build::configure()
        .out_dir(out)
        .compile_well_known_types(true)
        .extern_path(".google.protobuf.Timestamp", "crate::Timestamp")
}

#[test]
fn the_code_of_the_protocol_is_that_of_its_files() {
    check("generated", |out| {
        let mut files: Vec<PathBuf> = fs::read_dir("chefshat/v1")?
            .map(|entry| Ok(entry?.path()))
            .collect::<std::io::Result<_>>()?;
        files.retain(|path| path.extension().is_some_and(|ext| ext == "proto"));
        files.sort();
        let descriptors = protox::compile(&files, ["."])?;
        let encoded = descriptors.encode_to_vec();
        fs::write(out.join("descriptors.bin"), &encoded)?;
        fs::write(out.join("shapes.rs"), shapes::of(&descriptors))?;
        messages(out, descriptors)?;
        pbjson_build::Builder::new()
            .register_descriptors(&encoded)?
            .btree_map(["."])
            .out_dir(out)
            .build(&[".chefshat.v1"])?;
        // pbjson collects the entries of maps of 64-bit numbers in another map before it writes them.
        let path = out.join("chefshat.v1.serde.rs");
        fs::write(
            &path,
            fs::read_to_string(&path)?.replace("HashMap", "BTreeMap"),
        )?;
        Ok(())
    });
}

fn messages(out: &Path, descriptors: FileDescriptorSet) -> Generated {
    let services = "#[cfg(feature = \"services\")]";
    builder(out)
        .client_mod_attribute(".", services)
        .server_mod_attribute(".", services)
        .codec_path("crate::codec::CallCodec")
        // Records are signed as they are written: the same message has the same bytes and text.
        .btree_map(".")
        // Rare and large: boxed, so that the frequent variants beside them stay small.
        .boxed(".chefshat.v1.GameEvent.kind.game_started")
        .boxed(".chefshat.v1.GameEvent.kind.game_ended")
        .boxed(".chefshat.v1.GameEvent.kind.game_aborted")
        .boxed(".chefshat.v1.GameEvent.kind.shift_ended")
        .boxed(".chefshat.v1.GameEvent.kind.expression_shown")
        .boxed(".chefshat.v1.GameEvent.kind.special_action_declared")
        .boxed(".chefshat.v1.GameEvent.kind.cards_exchanged")
        .boxed(".chefshat.v1.GameEvent.kind.seated")
        .boxed(".chefshat.v1.GameEvent.kind.hand_reported")
        .boxed(".chefshat.v1.GameEvent.kind.violation")
        .boxed(".chefshat.v1.GameEvent.kind.correction")
        .boxed(".chefshat.v1.RecordLine.line.header")
        .boxed(".chefshat.v1.SeatUpdate.update.snapshot")
        // Columns are sent and viewed as they are, without copies.
        .bytes(".chefshat.v1.VectorActions")
        .bytes(".chefshat.v1.VectorBatch")
        .bytes(".chefshat.v1.ObservationColumns")
        .bytes(".chefshat.v1.EpisodeEndings")
        .bytes(".chefshat.v1.GameBeginnings")
        .bytes(".chefshat.v1.ShiftStatistics")
        .bytes(".chefshat.v1.StudyPicture")
        .bytes(".chefshat.v1.GetStudyPictureResponse")
        .boxed(".chefshat.v1.RunResponse.response.batch")
        .boxed(".chefshat.v1.RunRequest.request.setup")
        .compile_fds(descriptors)?;
    with_async_methods(out)
}

/// The server side of the streaming services again, with responses that are already encoded
/// (`wire`), and both sides of the streams between nodes.
#[test]
fn the_code_of_the_server_is_that_of_its_files() {
    check("../server/wire/generated", |out| {
        let files = ["v1/play_service", "v1/spectator_service", "peer/v1/peer"]
            .map(|service| format!("chefshat/{service}.proto"));
        let descriptors = protox::compile(files, ["."])?;
        fs::write(out.join("peer.bin"), descriptors.encode_to_vec())?;
        builder(out)
            .client_mod_attribute("chefshat.v1", "#[cfg(any())]")
            .codec_path("crate::encoded::SmallBuffers")
            .btree_map(".")
            .extern_path(".chefshat.v1", "::chefshat_proto::v1")
            .extern_path(".chefshat.v1.PlayResponse", "crate::encoded::Updates")
            .extern_path(
                ".chefshat.v1.PlayServiceWatchResponse",
                "crate::encoded::Updates",
            )
            .extern_path(
                ".chefshat.v1.SpectatorServiceWatchResponse",
                "crate::encoded::Updates",
            )
            .extern_path(".chefshat.peer.v1.PlayResponse", "crate::encoded::Updates")
            .compile_fds(descriptors)?;
        with_async_methods(out)
    });
}

/// The service of the bare room beside which the load program measures.
#[test]
fn the_code_of_the_load_program_is_that_of_its_file() {
    check("../tests/load/generated", |out| {
        let descriptors = protox::compile(["bare.proto"], ["../tests/load/proto"])?;
        tonic_prost_build::configure()
            .out_dir(out)
            .compile_fds(descriptors)?;
        with_async_methods(out)
    });
}
