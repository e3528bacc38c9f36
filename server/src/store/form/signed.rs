//! The signature of a hosted game.

use chefshat_proto::v1;
use prost::Message as _;

use super::Unreadable;
use crate::store::Signed;

#[derive(Clone, PartialEq, prost::Message)]
struct SignedForm {
    #[prost(string, tag = "1")]
    server_version: String,
    #[prost(bytes = "vec", tag = "2")]
    public_key: Vec<u8>,
    #[prost(bytes = "vec", tag = "3")]
    signature: Vec<u8>,
}

/// Encodes a signature.
pub(in crate::store) fn signed_to_bytes(signed: &Signed) -> Vec<u8> {
    let form = SignedForm {
        server_version: signed.server_version.clone(),
        public_key: signed.signature.public_key.clone(),
        signature: signed.signature.signature.clone(),
    };
    form.encode_to_vec()
}

/// Decodes a signature.
///
/// # Errors
/// Invalid bytes.
pub(in crate::store) fn signed_from_bytes(bytes: &[u8]) -> Result<Signed, Unreadable> {
    let form = SignedForm::decode(bytes)?;
    Ok(Signed {
        server_version: form.server_version,
        signature: v1::RecordSignature {
            public_key: form.public_key,
            signature: form.signature,
        },
    })
}
