//! The certificates with which nodes connect: an authority of the cluster's own signs one for each
//! node.

use std::path::{Path, PathBuf};

use chefshat_server::peers::PEER_NAME;
use rcgen::{BasicConstraints, CertificateParams, IsCa, Issuer, KeyPair};

/// The authority.
pub(crate) struct Authority {
    issuer: Issuer<'static, KeyPair>,
    file: PathBuf,
}

/// The files of one node, PEM.
#[derive(Debug)]
pub(crate) struct Certificate {
    pub(crate) certificate: PathBuf,
    pub(crate) key: PathBuf,
    pub(crate) authority: PathBuf,
}

impl Authority {
    /// Makes an authority, with its certificate in this folder.
    pub(crate) fn new(folder: &Path) -> Self {
        let mut params = CertificateParams::new([]).expect("no names");
        params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        let key = KeyPair::generate().expect("a key");
        let certificate = params.self_signed(&key).expect("a certificate");
        let file = folder.join("authority.pem");
        std::fs::write(&file, certificate.pem()).expect("written");
        let issuer = Issuer::new(params, key);
        Self { issuer, file }
    }

    /// Makes the certificate of a node, in the folder of the node.
    pub(crate) fn certificate(&self, folder: &Path) -> Certificate {
        let params = CertificateParams::new([PEER_NAME.to_owned()]).expect("a name");
        let pair = KeyPair::generate().expect("a key");
        let signed = params.signed_by(&pair, &self.issuer).expect("signed");
        let (certificate, key) = (folder.join("node.pem"), folder.join("node.key"));
        std::fs::write(&certificate, signed.pem()).expect("written");
        std::fs::write(&key, pair.serialize_pem()).expect("written");
        Certificate {
            certificate,
            key,
            authority: self.file.clone(),
        }
    }
}
