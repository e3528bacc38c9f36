//! Generates the server side of the streaming services again, with responses that are already
//! encoded (`wire`).

use std::path::PathBuf;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo::rerun-if-changed=../proto/chefshat");
    // A release embeds the built page. Cargo does not notice new files there by itself. Other
    // builds read the page on each request.
    if std::env::var("PROFILE").is_ok_and(|profile| profile == "release") {
        println!("cargo::rerun-if-changed=../clients/web/dist");
    }
    let files = ["play_service", "spectator_service"]
        .map(|service| PathBuf::from(format!("../proto/chefshat/v1/{service}.proto")));
    let descriptors = protox::compile(files, ["../proto"])?;
    tonic_prost_build::configure()
        .build_client(false)
        .codec_path("crate::wire::SmallBuffers")
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
        .compile_well_known_types(true)
        .extern_path(".google.protobuf", "::pbjson_types")
        .compile_fds(descriptors)?;
    Ok(())
}
