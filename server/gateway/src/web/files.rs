//! The files of the built page: in the binary with the feature `embedded-page`, which published ones
//! have, otherwise read from the source tree on each request, so that building the page compiles
//! nothing here and a running server shows what was built last.

use super::answer::File;

/// A built file; `None` for hidden ones, which belong to the source tree.
pub(super) fn find(name: &str) -> Option<File> {
    match name.starts_with('.') {
        true => None,
        false => built(name),
    }
}

#[cfg(feature = "embedded-page")]
fn built(name: &str) -> Option<File> {
    use std::borrow::Cow;

    use bytes::Bytes;

    #[derive(rust_embed::RustEmbed)]
    #[folder = "../../clients/web/dist"]
    struct Dist;

    let file = Dist::get(name)?;
    let bytes = match file.data {
        Cow::Borrowed(bytes) => Bytes::from_static(bytes),
        Cow::Owned(bytes) => bytes.into(),
    };
    Some(File {
        media_type: file.metadata.mimetype().to_owned(),
        hash: hex::encode(&file.metadata.sha256_hash()[..16]),
        bytes,
    })
}

#[cfg(not(feature = "embedded-page"))]
fn built(name: &str) -> Option<File> {
    use std::path::{Component, Path};

    const DIST: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../clients/web/dist");

    let name = Path::new(name);
    let is_below = |part| matches!(part, Component::Normal(_));
    if !name.components().all(is_below) {
        return None;
    }
    let bytes = std::fs::read(Path::new(DIST).join(name)).ok()?;
    let media_type = mime_guess::from_path(name).first_or_octet_stream();
    Some(File::new(media_type.as_ref(), bytes.into()))
}
