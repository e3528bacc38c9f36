//! What operators use beside a server: Prometheus, with the shipped configuration and rules.

use std::collections::BTreeSet;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::Duration;

use http_body_util::{BodyExt as _, Full};
use hyper_util::client::legacy::Client as HttpClient;
use hyper_util::rt::TokioExecutor;
use serde_json::Value;
use tempfile::TempDir;
use tokio::process::{Child, Command};

use crate::{own_address, patiently};

/// A file of the repository.
pub fn source(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path)
}

/// What a web page of this machine has.
///
/// # Panics
/// It does not answer.
pub async fn get(url: &str) -> String {
    let http = HttpClient::builder(TokioExecutor::new()).build_http::<Full<bytes::Bytes>>();
    let answer = http.get(url.parse().expect("a URL")).await;
    let body = answer.expect("an answer").into_body().collect().await;
    String::from_utf8(body.expect("complete").to_bytes().to_vec()).expect("text")
}

/// Whether a page is there.
async fn is_ok(url: &str) -> bool {
    let http = HttpClient::builder(TokioExecutor::new()).build_http::<Full<bytes::Bytes>>();
    let answer = http.get(url.parse().expect("a URL")).await;
    answer.is_ok_and(|answer| answer.status().is_success())
}

/// A Prometheus with the shipped rules that scrapes by the shipped configuration.
#[derive(Debug)]
pub struct Prometheus {
    url: String,
    _process: Child,
    _folder: TempDir,
}

impl Prometheus {
    /// Starts it, unless it is not installed. It scrapes servers and evaluates its rules this often,
    /// in Prometheus' notation.
    ///
    /// # Panics
    /// The configuration is not valid.
    pub async fn start(scraped: &[SocketAddr], every: &str) -> Option<Self> {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let shipped = source("docker/prometheus/prometheus.yml");
        let targets: Vec<String> = scraped.iter().map(SocketAddr::to_string).collect();
        let config = std::fs::read_to_string(shipped)
            .expect("it is shipped")
            .replace("server:9464", &targets.join("\", \""))
            .replace("15s", every);
        let config_file = folder.path().join("prometheus.yml");
        std::fs::write(&config_file, config).expect("written");
        let rules = source("docker/prometheus/alerts.yml");
        std::fs::copy(rules, folder.path().join("alerts.yml")).expect("copied");

        let checked = Command::new("promtool")
            .arg("check")
            .arg("config")
            .arg(&config_file)
            .output()
            .await;
        let Ok(checked) = checked else {
            return None;
        };
        assert!(checked.status.success(), "{checked:?}");

        // The port is free: no other program of this machine listens on this address.
        let address = format!("{}:9090", own_address());
        let process = Command::new("prometheus")
            .arg(format!("--config.file={}", config_file.display()))
            .arg(format!(
                "--storage.tsdb.path={}",
                folder.path().join("data").display()
            ))
            .arg(format!("--web.listen-address={address}"))
            .current_dir(folder.path())
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .kill_on_drop(true)
            .spawn()
            .expect("promtool and prometheus are one package");
        let ready = format!("http://{address}/-/ready");
        patiently("Prometheus to be ready", async {
            while !is_ok(&ready).await {
                tokio::time::sleep(Duration::from_millis(50)).await;
            }
        })
        .await;
        Some(Self {
            url: format!("http://{address}/api/v1"),
            _process: process,
            _folder: folder,
        })
    }

    /// What its interface answers at a path.
    ///
    /// # Panics
    /// The answer is not JSON.
    pub async fn api(&self, path: &str) -> Value {
        serde_json::from_str(&get(&format!("{}/{path}", self.url)).await).expect("JSON")
    }

    /// The names of the alerts that fire.
    ///
    /// # Panics
    /// Prometheus does not answer.
    pub async fn firing(&self) -> BTreeSet<String> {
        let answer = self.api("alerts").await;
        let alerts = answer["data"]["alerts"].as_array().expect("a list");
        let firing = alerts.iter().filter(|alert| alert["state"] == "firing");
        let names = firing.filter_map(|alert| alert["labels"]["alertname"].as_str());
        names.map(str::to_owned).collect()
    }

    /// Evaluates an expression until it has data.
    ///
    /// # Panics
    /// The expression is invalid, or has no data for long.
    pub async fn has_data(&self, expression: &str) {
        let escaped: String = (expression.bytes())
            .map(|byte| format!("%{byte:02x}"))
            .collect();
        patiently(expression, async {
            loop {
                let answer = self.api(&format!("query?query={escaped}")).await;
                assert_eq!(answer["status"], "success", "{expression}: {answer}");
                let result = answer["data"]["result"].as_array().expect("a result");
                if !result.is_empty() {
                    return;
                }
                tokio::time::sleep(Duration::from_millis(100)).await;
            }
        })
        .await;
    }
}
