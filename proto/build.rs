//! Generates the protocol's code from the `.proto` files with protox: no protoc is needed.

#[path = "build/shapes.rs"]
mod shapes;

use std::path::{Path, PathBuf};

use prost::Message as _;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo::rerun-if-changed=chefshat");
    println!("cargo::rerun-if-changed=build");
    let mut files: Vec<PathBuf> = std::fs::read_dir("chefshat/v1")?
        .map(|entry| Ok(entry?.path()))
        .collect::<std::io::Result<_>>()?;
    files.retain(|path| path.extension().is_some_and(|ext| ext == "proto"));
    files.sort();

    let descriptors = protox::compile(&files, ["."])?;
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    let encoded = descriptors.encode_to_vec();
    write(&out.join("descriptors.bin"), &encoded)?;
    write(&out.join("shapes.rs"), shapes::of(&descriptors).as_bytes())?;
    let services = std::env::var_os("CARGO_FEATURE_SERVICES").is_some();
    tonic_prost_build::configure()
        .build_client(services)
        .build_server(services)
        .compile_well_known_types(true)
        .extern_path(".google.protobuf", "::pbjson_types")
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
        .boxed(".chefshat.v1.SeatUpdate.update.snapshot")
        // Columns are sent and viewed as they are, without copies.
        .bytes(".chefshat.v1.VectorActions")
        .bytes(".chefshat.v1.VectorBatch")
        .bytes(".chefshat.v1.ObservationColumns")
        .bytes(".chefshat.v1.EpisodeEndings")
        .bytes(".chefshat.v1.GameBeginnings")
        .bytes(".chefshat.v1.ShiftStatistics")
        .boxed(".chefshat.v1.RunResponse.response.batch")
        .boxed(".chefshat.v1.RunRequest.request.setup")
        .compile_fds(descriptors)?;
    pbjson_build::Builder::new()
        .register_descriptors(&encoded)?
        .btree_map(["."])
        .build(&[".chefshat.v1"])?;
    // pbjson collects the entries of maps of 64-bit numbers in another map before it writes them.
    let path = out.join("chefshat.v1.serde.rs");
    let code = std::fs::read_to_string(&path)?;
    write(&path, code.replace("HashMap", "BTreeMap").as_bytes())?;
    Ok(())
}

fn write(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    std::fs::write(path, bytes)
}
