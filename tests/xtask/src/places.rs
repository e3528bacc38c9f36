//! Paths: the source tree, which is only read, and the build folder, where everything is written.

use std::env;
use std::path::{Path, PathBuf};

use crate::failure::Failure;

/// The Python SDK.
pub(crate) const CLIENTS: &str = "clients/python";

/// The Python package that tests docker/. The other Python packages are clients.
pub(crate) const DEPLOYMENT: &str = "tests/deployment";

/// The Python packages, relative to the source tree: the SDK, then those built on it.
pub(crate) const PYTHON_PACKAGES: [&str; 4] =
    [CLIENTS, "clients/paper", "clients/robot", DEPLOYMENT];

/// The folders used by this program, all absolute.
pub(crate) struct Places {
    /// The source tree.
    pub(crate) root: PathBuf,
    /// Cargo's build folder.
    pub(crate) target: PathBuf,
    /// Environments and tools that this program sets up.
    pub(crate) own: PathBuf,
}

impl Places {
    /// Finds the source tree from the path of this crate, and the build folder as Cargo does.
    pub(crate) fn find() -> Result<Self, Failure> {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let root = root
            .canonicalize()
            .map_err(|error| Failure::new(format!("{}: {error}", root.display())))?;
        let target = env::var_os("CARGO_TARGET_DIR")
            .map_or_else(|| root.join("target"), |folder| root.join(folder));
        let own = target.join("xtask");
        Ok(Self { root, target, own })
    }

    /// The server built by the `build` step.
    pub(crate) fn chefshat(&self) -> PathBuf {
        self.target.join("debug/chefshat")
    }

    /// The Python module built by the `build` step.
    pub(crate) fn native_module(&self) -> PathBuf {
        self.target.join("debug/libchefshat_native.so")
    }

    /// The JavaScript agent.
    pub(crate) fn node_package(&self) -> PathBuf {
        self.root.join("clients/node")
    }

    /// The agent in C++.
    pub(crate) fn cpp_source(&self) -> PathBuf {
        self.root.join("clients/cpp")
    }

    /// Where the agent in C++ is built.
    pub(crate) fn cpp_build(&self) -> PathBuf {
        self.own.join("cpp")
    }

    /// The agent in C++, as a program.
    pub(crate) fn cpp_agent(&self) -> PathBuf {
        self.cpp_build().join("agent")
    }

    /// The page for people.
    pub(crate) fn web_package(&self) -> PathBuf {
        self.root.join("clients/web")
    }

    /// Where the server expects the built page: the only place in the source tree that is written
    /// to; Git ignores it.
    pub(crate) fn web_dist(&self) -> PathBuf {
        self.web_package().join("dist")
    }

    /// A folder that looks like the source tree to [`Places::web`].
    pub(crate) fn web_tree(&self) -> PathBuf {
        self.own.join("web")
    }

    /// Copy of the page's package, with its modules.
    pub(crate) fn web(&self) -> PathBuf {
        self.web_tree().join("clients/web")
    }

    /// Virtual environment of the Python packages.
    pub(crate) fn venv(&self) -> PathBuf {
        self.own.join("venv")
    }

    /// Interpreter of the Python packages' environment.
    pub(crate) fn python(&self) -> PathBuf {
        self.venv().join("bin/python")
    }

    /// Copy of the JavaScript agent, with its modules.
    pub(crate) fn node(&self) -> PathBuf {
        self.own.join("node")
    }

    /// Virtual environment of the checkers in tools.txt.
    pub(crate) fn tools(&self) -> PathBuf {
        self.own.join("tools")
    }

    /// Virtual environment of what makes the others.
    pub(crate) fn uv(&self) -> PathBuf {
        self.own.join("uv")
    }

    /// Virtual environment of the builders of wheels in wheels.txt.
    pub(crate) fn wheel_tools(&self) -> PathBuf {
        self.own.join("wheel-tools")
    }

    /// Where wheels are put.
    pub(crate) fn wheels(&self) -> PathBuf {
        self.target.join("wheels")
    }

    /// Where a release is put.
    pub(crate) fn dist(&self) -> PathBuf {
        self.target.join("artefacts")
    }

    /// The book, as a folder of HTML.
    pub(crate) fn book(&self) -> PathBuf {
        self.target.join("book")
    }

    /// Virtual environment with the oldest or newest versions that the Python SDK works with.
    pub(crate) fn versions(&self, which: &str) -> PathBuf {
        self.own.join(format!("venv-{which}"))
    }

    /// Where `cargo install` puts checkers written in Rust.
    pub(crate) fn cargo_tools(&self) -> PathBuf {
        self.own.join("tools-cargo")
    }
}
