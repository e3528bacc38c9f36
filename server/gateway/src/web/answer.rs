//! Answers a browser: with the file named by the path, else with the document, which knows all
//! pages. Sets the headers for caching and content security.

use bytes::Bytes;
use http::{HeaderMap, HeaderName, HeaderValue, Method, Request, Response, StatusCode, header};
use sha2::{Digest as _, Sha256};

/// A built file.
#[derive(Debug, Clone)]
pub(super) struct File {
    /// Its media type.
    pub(super) media_type: String,
    /// A hash of its content.
    pub(super) hash: String,
    /// Its content.
    pub(super) bytes: Bytes,
}

impl File {
    /// A generated file.
    pub(super) fn new(media_type: &str, bytes: Bytes) -> Self {
        Self {
            media_type: media_type.to_owned(),
            hash: hex::encode(&Sha256::digest(&bytes)[..16]),
            bytes,
        }
    }
}

/// The document, which draws the page named by the path.
pub(super) const DOCUMENT: &str = "index.html";
/// Names of files in this folder change with their content.
const ASSETS: &str = "assets/";
/// The answer if the page is not built in.
const ABSENT: &[u8] = include_bytes!("absent.html");

/// Cached for a year, without revalidation.
const IMMUTABLE: HeaderValue = HeaderValue::from_static("public, max-age=31536000, immutable");
/// Cached, but revalidated each time.
const REVALIDATE: HeaderValue = HeaderValue::from_static("no-cache");
/// When it is worth trying again, seconds.
const RETRY_AFTER: HeaderValue = HeaderValue::from_static("5");
/// The page loads everything from its own server, sends nothing elsewhere, and cannot be framed.
const RULES: [(HeaderName, HeaderValue); 3] = [
    (
        header::CONTENT_SECURITY_POLICY,
        HeaderValue::from_static(
            "default-src 'self'; img-src 'self' data:; object-src 'none'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'",
        ),
    ),
    (
        header::X_CONTENT_TYPE_OPTIONS,
        HeaderValue::from_static("nosniff"),
    ),
    (
        header::REFERRER_POLICY,
        HeaderValue::from_static("no-referrer"),
    ),
];

/// The answer to a GET or HEAD request; `find` looks up files by name.
pub(super) fn answer<B>(
    find: impl Fn(&str) -> Option<File>,
    request: &Request<B>,
) -> Response<Bytes> {
    finished(chosen(find, request), request.method())
}

/// The answer with a file generated for this request.
pub(super) fn generated<B>(file: File, request: &Request<B>) -> Response<Bytes> {
    let tag = format!("\"{}\"", file.hash);
    let response = tagged(request, &tag, REVALIDATE, &file.media_type, file.bytes);
    finished(response, request.method())
}

/// The answer if the file does not exist.
pub(super) fn absent(method: &Method) -> Response<Bytes> {
    finished(not_found(), method)
}

/// The answer if too many others wait for such a file, or its caller has too many unread ones.
pub(super) fn busy(method: &Method) -> Response<Bytes> {
    let text = b"too many requests at a time; try again later\n";
    let mut response = plain(StatusCode::SERVICE_UNAVAILABLE, "text/plain", text);
    let headers = response.headers_mut();
    headers.insert(header::RETRY_AFTER, RETRY_AFTER);
    finished(response, method)
}

/// The answer to who asks whether the server takes new clients.
pub(super) fn health(serving: bool, method: &Method) -> Response<Bytes> {
    let response = match serving {
        true => plain(StatusCode::OK, "text/plain", b"serving\n"),
        false => plain(
            StatusCode::SERVICE_UNAVAILABLE,
            "text/plain",
            b"not serving\n",
        ),
    };
    finished(response, method)
}

fn finished(mut response: Response<Bytes>, method: &Method) -> Response<Bytes> {
    let length = response.body().len();
    response.headers_mut().extend(RULES);
    if response.status() != StatusCode::NOT_MODIFIED {
        response
            .headers_mut()
            .insert(header::CONTENT_LENGTH, length.into());
    }
    if method == Method::HEAD {
        *response.body_mut() = Bytes::new();
    }
    response
}

fn chosen<B>(find: impl Fn(&str) -> Option<File>, request: &Request<B>) -> Response<Bytes> {
    let path = request.uri().path().trim_start_matches('/');
    let asset = path.starts_with(ASSETS);
    let name = match find(path) {
        Some(_) => path,
        None if asset => return not_found(),
        None => DOCUMENT,
    };
    let Some(file) = find(name) else {
        return plain(
            StatusCode::SERVICE_UNAVAILABLE,
            "text/html; charset=utf-8",
            ABSENT,
        );
    };
    // Files that compress well have a compressed twin.
    let packed = (accepts_gzip(request.headers()))
        .then(|| find(&format!("{name}.gz")))
        .flatten();
    let tag = format!(
        "\"{}{}\"",
        file.hash,
        if packed.is_some() { "-gzip" } else { "" }
    );
    let caching = if asset { IMMUTABLE } else { REVALIDATE };
    let is_packed = packed.is_some();
    let bytes = packed.map_or(file.bytes, |packed| packed.bytes);
    let mut response = tagged(request, &tag, caching, &file.media_type, bytes);
    let is_sent = response.status() == StatusCode::OK;
    let headers = response.headers_mut();
    headers.insert(header::VARY, header::ACCEPT_ENCODING.into());
    if is_sent && is_packed {
        headers.insert(header::CONTENT_ENCODING, HeaderValue::from_static("gzip"));
    }
    response
}

/// The answer with bytes, or without them if the browser has those of this tag.
fn tagged<B>(
    request: &Request<B>,
    tag: &str,
    caching: HeaderValue,
    media_type: &str,
    bytes: Bytes,
) -> Response<Bytes> {
    let mut response = Response::new(Bytes::new());
    let headers = response.headers_mut();
    headers.insert(header::CACHE_CONTROL, caching);
    headers.insert(header::ETAG, word(tag));
    let known = (request.headers().get(header::IF_NONE_MATCH))
        .is_some_and(|tags| tags.as_bytes() == tag.as_bytes());
    if known {
        *response.status_mut() = StatusCode::NOT_MODIFIED;
        return response;
    }
    headers.insert(header::CONTENT_TYPE, word(&with_charset(media_type)));
    *response.body_mut() = bytes;
    response
}

fn not_found() -> Response<Bytes> {
    plain(StatusCode::NOT_FOUND, "text/plain", b"no such file\n")
}

fn plain(status: StatusCode, media_type: &'static str, text: &'static [u8]) -> Response<Bytes> {
    let mut response = Response::new(Bytes::from_static(text));
    *response.status_mut() = status;
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(media_type));
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    response
}

/// Whether the browser accepts gzip.
fn accepts_gzip(headers: &HeaderMap) -> bool {
    let offered = headers.get_all(header::ACCEPT_ENCODING).iter();
    offered
        .filter_map(|value| value.to_str().ok())
        .flat_map(|value| value.split(','))
        .any(|coding| {
            let mut parts = coding.split(';').map(str::trim);
            let refused = |weight: &str| weight.trim_end_matches(['0', '.']) == "q=";
            parts.next() == Some("gzip") && !parts.any(refused)
        })
}

fn with_charset(media_type: &str) -> String {
    match media_type.starts_with("text/") {
        true => format!("{media_type}; charset=utf-8"),
        false => media_type.to_owned(),
    }
}

fn word(text: &str) -> HeaderValue {
    HeaderValue::from_str(text).expect("media types and hashes are visible ASCII")
}

#[cfg(test)]
mod tests {
    use crate::web::answer::*;

    fn built(name: &str) -> Option<File> {
        let (media_type, text) = match name {
            "index.html" => ("text/html", "document"),
            "index.html.gz" => ("application/gzip", "packed document"),
            "assets/a-1.js" => ("text/javascript", "code"),
            _ => return None,
        };
        Some(File {
            media_type: media_type.to_owned(),
            hash: format!("hash-of-{name}"),
            bytes: Bytes::from_static(text.as_bytes()),
        })
    }

    fn get(path: &str, headers: &[(HeaderName, &str)]) -> Response<Bytes> {
        let mut request = Request::get(path);
        for (name, value) in headers {
            request = request.header(name, *value);
        }
        answer(built, &request.body(()).expect("a request"))
    }

    #[test]
    fn every_path_is_a_page_but_assets_must_exist() {
        for (path, status, body) in [
            ("/", 200, "document"),
            ("/rooms/0123", 200, "document"),
            ("/people/Dr.%20Rosa", 200, "document"),
            ("/assets/a-1.js", 200, "code"),
            ("/assets/a-2.js", 404, "no such file\n"),
            ("/assets/../index.html", 404, "no such file\n"),
        ] {
            let response = get(path, &[]);
            assert_eq!(
                (response.status().as_u16(), response.body().as_ref()),
                (status, body.as_bytes()),
                "{path}"
            );
            for (name, value) in RULES {
                assert_eq!(response.headers()[&name], value, "{path}");
            }
        }
    }

    #[test]
    fn no_other_page_may_show_ours_in_a_frame() {
        for path in ["/", "/rooms/0123", "/assets/a-1.js", "/assets/a-2.js"] {
            let response = get(path, &[]);
            let rules = response.headers()["content-security-policy"].to_str();
            let mut rules = rules.expect("text").split("; ");
            assert!(rules.any(|rule| rule == "frame-ancestors 'none'"), "{path}");
        }
    }

    #[test]
    fn assets_are_immutable_and_the_document_is_revalidated() {
        assert_eq!(
            get("/assets/a-1.js", &[]).headers()["cache-control"],
            IMMUTABLE
        );
        let document = get("/", &[]);
        assert_eq!(document.headers()["cache-control"], REVALIDATE);
        let tag = document.headers()["etag"].to_str().expect("text");
        let again = get("/tournaments", &[(header::IF_NONE_MATCH, tag)]);
        assert_eq!(again.status(), StatusCode::NOT_MODIFIED);
        assert!(again.body().is_empty());
    }

    #[test]
    fn browsers_that_accept_gzip_get_the_compressed_file() {
        for (accepted, packed) in [
            ("gzip", true),
            ("br, gzip;q=0.5", true),
            ("deflate", false),
            ("gzip;q=0", false),
            ("gzip; q=0.0, br", false),
            ("", false),
        ] {
            let response = get("/", &[(header::ACCEPT_ENCODING, accepted)]);
            assert_eq!(
                response.headers().contains_key("content-encoding"),
                packed,
                "{accepted}"
            );
            let type_said = &response.headers()["content-type"];
            assert_eq!(type_said, "text/html; charset=utf-8", "{accepted}");
        }
    }

    #[test]
    fn the_answer_to_head_has_a_length_and_no_body() {
        let request = Request::head("/").body(()).expect("a request");
        let response = answer(built, &request);
        assert_eq!(response.headers()["content-length"], "8");
        assert!(response.body().is_empty());
    }

    #[test]
    fn the_answer_without_a_build_says_how_to_build() {
        let request = Request::get("/").body(()).expect("a request");
        let response = answer(|_| None, &request);
        assert_eq!(response.status(), StatusCode::SERVICE_UNAVAILABLE);
        let text = String::from_utf8_lossy(response.body()).into_owned();
        assert!(text.contains("cargo xtask web"), "{text}");
    }
}
