//! Tells Cargo that the page is in the binary of some builds: it does not notice new files by itself.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if std::env::var_os("CARGO_FEATURE_EMBEDDED_PAGE").is_some() {
        println!("cargo::rerun-if-changed=../clients/web/dist");
    }
}
