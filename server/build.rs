//! Generates the server side of the services a second time, with responses of its own for streams of seats: their updates are encoded when
//! they happen, once for all who see the same, and not again when they are written (`wire.rs`).

use std::path::PathBuf;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo::rerun-if-changed=../proto/chefshat");
    // A release embeds the page for people as it was built last, and a new file there is no change of one that Cargo knows. Other builds
    // read the page when it is asked for.
    if std::env::var("PROFILE").is_ok_and(|profile| profile == "release") {
        println!("cargo::rerun-if-changed=../clients/web/dist");
    }
    let file = PathBuf::from("../proto/chefshat/v1/play_service.proto");
    let descriptors = protox::compile([file], ["../proto"])?;
    tonic_prost_build::configure()
        .build_client(false)
        .extern_path(".chefshat.v1", "::chefshat_proto::v1")
        .extern_path(".chefshat.v1.PlayResponse", "crate::wire::Updates")
        .extern_path(
            ".chefshat.v1.PlayServiceWatchResponse",
            "crate::wire::Updates",
        )
        .compile_well_known_types(true)
        .extern_path(".google.protobuf", "::pbjson_types")
        .compile_fds(descriptors)?;
    Ok(())
}
