//! The signature of a hosted game.

use chefshat_proto::v1;
use prost::Message as _;

use super::Unreadable;

/// Number 1 was the version of the server, which the header names now.
#[derive(Clone, PartialEq, prost::Message)]
struct SignatureForm {
    #[prost(bytes = "vec", tag = "2")]
    public_key: Vec<u8>,
    #[prost(bytes = "vec", tag = "3")]
    signature: Vec<u8>,
    #[prost(uint32, tag = "4")]
    text_version: u32,
}

/// Encodes a signature.
pub(crate) fn signature_to_bytes(signature: &v1::RecordSignature) -> Vec<u8> {
    let form = SignatureForm {
        public_key: signature.public_key.clone(),
        signature: signature.signature.clone(),
        text_version: signature.text_version,
    };
    form.encode_to_vec()
}

/// Decodes a signature.
///
/// # Errors
/// Invalid bytes.
pub(crate) fn signature_from_bytes(bytes: &[u8]) -> Result<v1::RecordSignature, Unreadable> {
    let form = SignatureForm::decode(bytes)?;
    Ok(v1::RecordSignature {
        public_key: form.public_key,
        signature: form.signature,
        text_version: form.text_version,
    })
}
