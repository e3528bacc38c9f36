//! Generates the server side of the streaming services again, with responses that are already
//! encoded (`wire`), and both sides of the streams between nodes.

use std::path::PathBuf;

use prost::Message as _;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo::rerun-if-changed=../proto/chefshat");
    // Cargo does not notice new files there by itself.
    if std::env::var_os("CARGO_FEATURE_EMBEDDED_PAGE").is_some() {
        println!("cargo::rerun-if-changed=../clients/web/dist");
    }
    let files = ["v1/play_service", "v1/spectator_service", "peer/v1/peer"]
        .map(|service| PathBuf::from(format!("../proto/chefshat/{service}.proto")));
    let descriptors = protox::compile(files, ["../proto"])?;
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    std::fs::write(out.join("peer.bin"), descriptors.encode_to_vec())?;
    tonic_prost_build::configure()
        .client_mod_attribute("chefshat.v1", "#[cfg(any())]")
        .codec_path("crate::wire::SmallBuffers")
        .btree_map(".")
        .extern_path(".chefshat.v1", "::chefshat_proto::v1")
        .extern_path(".chefshat.v1.PlayResponse", "crate::wire::Updates")
        .extern_path(
            ".chefshat.v1.PlayServiceWatchResponse",
            "crate::wire::Updates",
        )
        .extern_path(
            ".chefshat.v1.SpectatorServiceWatchResponse",
            "crate::wire::Updates",
        )
        .extern_path(".chefshat.peer.v1.PlayResponse", "crate::wire::Updates")
        .compile_well_known_types(true)
        .extern_path(".google.protobuf", "::pbjson_types")
        .compile_fds(descriptors)?;
    Ok(())
}
