//! The files of certificates and keys for TLS, and what a server and a client make of them.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use rustls::pki_types::pem::PemObject as _;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::server::WebPkiClientVerifier;
use rustls::{ClientConfig, RootCertStore, ServerConfig};
use tracing::warn;
use x509_cert::Certificate;
use x509_cert::der::Decode as _;

/// The files that make a server use TLS.
#[derive(Debug, Clone)]
pub struct TlsFiles {
    /// The certificate of the server and those that lead to its authority, PEM.
    pub certificate: PathBuf,
    /// Its private key, PEM.
    pub key: PathBuf,
    /// Certificates of the authorities whose clients are admitted, PEM; `None`: clients need no
    /// certificate.
    pub client_authority: Option<PathBuf>,
}

/// What a server needs of the files.
#[derive(Debug)]
pub struct ServerTls {
    /// How it takes connections.
    pub config: Arc<ServerConfig>,
    /// When the first of its certificates, or of its authorities, expires: seconds since the Unix
    /// epoch. `None`: of none it is known.
    pub expires_at: Option<i64>,
}

/// Why the files cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TlsError {
    /// A file is unreadable or is not PEM.
    #[error("cannot read {path}: {problem}")]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// The certificate and the key cannot be used together.
    #[error("cannot use the certificate {path} with its key: {source}")]
    Certificate {
        /// The file of the certificate.
        path: PathBuf,
        /// The reason.
        source: rustls::Error,
    },
    /// The certificates of the authorities cannot be used.
    #[error("cannot use the authorities in {path}: {problem}")]
    Authority {
        /// The file of the authorities.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
}

impl TlsFiles {
    /// All of them.
    pub fn paths(&self) -> impl Iterator<Item = &Path> {
        let always = [self.certificate.as_path(), self.key.as_path()];
        always.into_iter().chain(self.client_authority.as_deref())
    }

    /// Reads them for a server.
    ///
    /// # Errors
    /// They cannot be used.
    pub fn read(&self) -> Result<ServerTls, TlsError> {
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let chain = certificates(&self.certificate)?;
        let mut expiries: Vec<i64> = chain.iter().filter_map(expires_at).collect();
        let key =
            PrivateKeyDer::from_pem_file(&self.key).map_err(|it| unreadable(&self.key, &it))?;
        let builder = ServerConfig::builder_with_provider(Arc::clone(&provider))
            .with_safe_default_protocol_versions()
            .expect("ring supports the default versions");
        let builder = match &self.client_authority {
            None => builder.with_no_client_auth(),
            Some(path) => {
                let wrong = |problem: &dyn std::fmt::Display| bad_authority(path, problem);
                let authorities = certificates(path)?;
                expiries.extend(authorities.iter().filter_map(expires_at));
                let roots = roots(path, authorities)?;
                let verifier = WebPkiClientVerifier::builder_with_provider(roots.into(), provider);
                builder.with_client_cert_verifier(verifier.build().map_err(|error| wrong(&error))?)
            }
        };
        let mut config = builder.with_single_cert(chain, key).map_err(|source| {
            let path = self.certificate.clone();
            TlsError::Certificate { path, source }
        })?;
        config.alpn_protocols = vec![b"h2".to_vec(), b"http/1.1".to_vec()];
        Ok(ServerTls {
            config: Arc::new(config),
            expires_at: expiries.into_iter().min(),
        })
    }

    /// How a node connects to others: it shows its certificate, and admits servers of the authority
    /// for clients alone.
    ///
    /// # Errors
    /// The files cannot be used.
    pub fn client_config(&self) -> Result<Arc<ClientConfig>, TlsError> {
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let chain = certificates(&self.certificate)?;
        let key =
            PrivateKeyDer::from_pem_file(&self.key).map_err(|it| unreadable(&self.key, &it))?;
        let roots = match &self.client_authority {
            Some(path) => roots(path, certificates(path)?)?,
            None => RootCertStore::empty(),
        };
        let builder = ClientConfig::builder_with_provider(provider)
            .with_safe_default_protocol_versions()
            .expect("ring supports the default versions")
            .with_root_certificates(roots);
        let mut config = builder
            .with_client_auth_cert(chain, key)
            .map_err(|source| {
                let path = self.certificate.clone();
                TlsError::Certificate { path, source }
            })?;
        config.alpn_protocols = vec![b"h2".to_vec()];
        Ok(Arc::new(config))
    }
}

/// The authorities with these certificates, which a file has.
fn roots(
    path: &Path,
    authorities: Vec<CertificateDer<'static>>,
) -> Result<RootCertStore, TlsError> {
    let mut roots = RootCertStore::empty();
    add_authorities(&mut roots, path, authorities);
    match roots.is_empty() {
        true => Err(bad_authority(path, &"none of its certificates can be used")),
        false => Ok(roots),
    }
}

/// Trusts these certificates of a file. Those that cannot be used, such as very old ones, are left
/// out: a file of many authorities may have some.
pub(crate) fn add_authorities(
    roots: &mut RootCertStore,
    path: &Path,
    authorities: Vec<CertificateDer<'static>>,
) {
    let (_, left_out) = roots.add_parsable_certificates(authorities);
    if left_out > 0 {
        let path = path.display();
        warn!(%path, left_out, "certificates of authorities that cannot be used are left out");
    }
}

/// When a certificate expires, in seconds since the Unix epoch; `None` if it is of a form that cannot be
/// read.
fn expires_at(certificate: &CertificateDer<'static>) -> Option<i64> {
    let certificate = Certificate::from_der(certificate).ok()?;
    let expires = certificate.tbs_certificate.validity.not_after;
    i64::try_from(expires.to_unix_duration().as_secs()).ok()
}

fn bad_authority(path: &Path, problem: &dyn std::fmt::Display) -> TlsError {
    TlsError::Authority {
        path: path.to_path_buf(),
        problem: problem.to_string(),
    }
}

/// The certificates of a file, at least one.
fn certificates(path: &Path) -> Result<Vec<CertificateDer<'static>>, TlsError> {
    let read = CertificateDer::pem_file_iter(path).and_then(Iterator::collect);
    let found: Vec<_> = read.map_err(|error| unreadable(path, &error))?;
    match found.is_empty() {
        true => Err(unreadable(path, &"it has no certificate in PEM")),
        false => Ok(found),
    }
}

fn unreadable(path: &Path, problem: &dyn std::fmt::Display) -> TlsError {
    TlsError::File {
        path: path.to_path_buf(),
        problem: problem.to_string(),
    }
}
