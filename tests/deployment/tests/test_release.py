"""The files of a release, tried by the commands of docs/releases.md as they are written, but for those of Docker.

The archive, the package and the wheels are each installed on a system that has nothing else. Programs for another processor are
emulated.

`cargo xtask dist --try` runs this, and names the folder of the release in CHEFSHAT_DIST. It needs root, debootstrap and buildah.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import threading
import time
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import chefshat
import pytest
from chefshat import RandomAgent
from images import ROOT, Images, debian, end, require, run, until

DIST = Path(os.environ.get("CHEFSHAT_DIST", ""))
VERSION = tomllib.loads((ROOT / "Cargo.toml").read_text())["workspace"]["package"]["version"]
PAGE = (ROOT / "docs/releases.md").read_text()
#: Runs programs for aarch64.
EMULATOR = "qemu-aarch64-static"
#: How long a command may take, seconds.
PATIENCE_S = 1800.0

pytestmark = pytest.mark.skipif(
    not os.environ.get("CHEFSHAT_DIST"), reason="CHEFSHAT_DIST is not set: name the folder of a release"
)


def block(words: str) -> str:
    """The commands of the page in the block that begins with these words."""
    blocks: list[str] = re.findall(r"^```sh\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    (found,) = [block for block in blocks if block.startswith(words)]
    return found


class System:
    """A minimal Debian, in which somebody has downloaded files."""

    folder = "root/download"

    def __init__(self, root: Path) -> None:
        self.root = root

    def download(self, *files: Path) -> None:
        """Puts files into the folder of the person."""
        (self.root / self.folder).mkdir(exist_ok=True)
        for file in files:
            shutil.copy(file, self.root / self.folder)

    def type(self, commands: str, **environment: str) -> str:
        """Types commands, which must succeed. Returns what they print."""
        process = self.start(f"cd /{self.folder}; {commands}", **environment)
        output, _ = process.communicate(timeout=PATIENCE_S)
        assert process.returncode == 0, output
        return output

    def start(self, commands: str, **environment: str) -> subprocess.Popen[str]:
        """Types commands, which may run for long."""
        path = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"
        return subprocess.Popen(
            ["chroot", str(self.root), "/bin/bash", "-e", "-c", commands],
            env={"PATH": path, "HOME": "/root", **environment},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )


def bare(folder: Path, *packages: str) -> Iterator[System]:
    """A minimal Debian with further packages."""
    require("debootstrap")
    debian(folder, *packages)
    yield System(folder)
    shutil.rmtree(folder)


@pytest.fixture
def system(tmp_path: Path) -> Iterator[System]:
    """A minimal Debian."""
    yield from bare(tmp_path / "system")


@pytest.fixture
def python_system(tmp_path: Path) -> Iterator[System]:
    """A minimal Debian with Python."""
    yield from bare(tmp_path / "system", "python3-venv")


@pytest.fixture
def compiler_system(tmp_path: Path) -> Iterator[System]:
    """A minimal Debian with its compiler of protocols."""
    yield from bare(tmp_path / "system", "protobuf-compiler", "libprotobuf-dev")


def test_the_checksums_and_the_signature_are_right(tmp_path: Path) -> None:
    for file in DIST.iterdir():
        shutil.copy(file, tmp_path)
    listed = {line.split()[1] for line in (tmp_path / "SHA256SUMS").read_text().splitlines()}
    assert listed == {file.name for file in DIST.iterdir()} - {"SHA256SUMS", "SHA256SUMS.sig"}
    check, verify = block("sha256sum").splitlines()
    subprocess.run(check, shell=True, cwd=tmp_path, check=True)
    key = os.environ.get("CHEFSHAT_RELEASE_KEY")
    if key is None:
        pytest.skip("the release is not signed")
    (tmp_path / "signers").write_text(f"releases {Path(f'{key}.pub').read_text()}")
    subprocess.run(verify, shell=True, cwd=tmp_path, check=True)
    (tmp_path / "SHA256SUMS").write_text("")
    assert subprocess.run(verify, shell=True, cwd=tmp_path).returncode != 0


def test_the_program_of_the_archive_plays(system: System) -> None:
    system.download(DIST / f"chefshat-{VERSION}-x86_64-linux.tar.gz")
    output = system.type(block("tar -xzf"))
    assert "place" in output, output
    folder = system.root / system.folder / f"chefshat-{VERSION}-x86_64-linux"
    assert len(list((folder / "man").iterdir())) > 20
    assert {file.name for file in (folder / "completions").iterdir()} == {"chefshat", "_chefshat", "chefshat.fish"}


@pytest.mark.parametrize("page_bytes", [4096, 65536])
def test_the_programs_for_another_processor_play(tmp_path: Path, page_bytes: int) -> None:
    if shutil.which(EMULATOR) is None:
        pytest.skip(f"{EMULATOR} is not installed")
    name = f"chefshat-{VERSION}-aarch64-linux"
    shutil.unpack_archive(DIST / f"{name}.tar.gz", tmp_path)
    package = DIST / f"chefshat_{VERSION}_arm64.deb"
    subprocess.run(["dpkg-deb", "--extract", package, tmp_path / "package"], check=True)
    (wheel,) = DIST.glob("chefshat_server-*_aarch64.whl")
    shutil.unpack_archive(wheel, tmp_path / "wheel", "zip")

    def emulated(program: Path, *arguments: str) -> str:
        command = [EMULATOR, "-p", str(page_bytes), str(program), *arguments]
        done = subprocess.run(command, capture_output=True, check=True, text=True, timeout=PATIENCE_S)
        return done.stdout

    assert "place" in emulated(tmp_path / name / "chefshat", "demo")
    assert json.loads(emulated(tmp_path / name / "chefshat-lab", "simulate", "--games", "20", "--json"))
    assert "place" in emulated(tmp_path / "package/usr/bin/chefshat", "demo")
    for program in ("chefshat", "chefshat-lab"):
        (of_wheel,) = (tmp_path / "wheel").glob(f"*.data/scripts/{program}")
        assert of_wheel.read_bytes() == (tmp_path / name / program).read_bytes()


def test_everything_that_runs_has_the_licences_of_what_it_contains(tmp_path: Path) -> None:
    listed = {"tokio 1", "preact 11", "Atkinson Hyperlegible Next", "pyo3 0", "Apache License"}
    # What the programs link: jemalloc, musl, Rust's standard library.
    listed |= {"Jason Evans", "Rich Felker", "The Rust Project Developers"}
    for processor, debian_processor in [("x86_64", "amd64"), ("aarch64", "arm64")]:
        name = f"chefshat-{VERSION}-{processor}-linux"
        shutil.unpack_archive(DIST / f"{name}.tar.gz", tmp_path)
        notices = (tmp_path / name / "NOTICES.txt").read_text()
        assert {words for words in listed if words in notices} == listed
        package = DIST / f"chefshat_{VERSION}_{debian_processor}.deb"
        contents = subprocess.run(["dpkg-deb", "--contents", package], capture_output=True, check=True, text=True)
        assert "/usr/share/doc/chefshat/NOTICES.txt" in contents.stdout
    for wheel in [*DIST.glob("chefshat_native-*.whl"), *DIST.glob("chefshat_server-*.whl")]:
        shutil.unpack_archive(wheel, tmp_path / wheel.stem, "zip")
        (file,) = (tmp_path / wheel.stem).glob("*.dist-info/licenses/NOTICES.txt")
        text = file.read_text()
        assert {words for words in listed if words in text} == listed


def test_the_debian_package_has_a_service(system: System) -> None:
    system.download(DIST / f"chefshat_{VERSION}_amd64.deb")
    assert "place" in system.type(block("sudo dpkg").replace("sudo ", ""))
    assert VERSION in system.type("chefshat --version")
    unit = system.type("cat /lib/systemd/system/chefshat.service")
    (start,) = re.findall(r"^ExecStart=(.*)$", unit, re.MULTILINE)
    # As systemd would start it.
    address = f"127.197.{(os.getpid() >> 8) & 255}.{os.getpid() & 255}:50051"
    as_user = f"setpriv --reuid=chefshat --regid=chefshat --clear-groups {start} --listen {address}"
    server = system.start(f"exec {as_user}", CHEFSHAT_DATA_DIR="/var/lib/chefshat")
    try:
        give_up_at = time.monotonic() + PATIENCE_S
        while "healthy" not in system.type("chefshat health && echo healthy || true", CHEFSHAT_SERVER=f"http://{address}"):
            assert server.poll() is None, server.communicate()
            assert time.monotonic() < give_up_at
        play(address)
    finally:
        server.terminate()
    output, _ = server.communicate(timeout=PATIENCE_S)
    assert server.returncode == 0, output
    assert system.type("stat --format %U /var/lib/chefshat/games.sqlite3").strip() == "chefshat"
    # An upgrade, where systemd runs.
    note = r"printf '#!/bin/sh\necho \"$@\" >> /told\n' > /usr/bin/systemctl; chmod +x /usr/bin/systemctl"
    system.type(f"mkdir -p /run/systemd/system; {note}; dpkg --install chefshat_{VERSION}_amd64.deb")
    assert system.type("cat /told").splitlines() == ["daemon-reload", "try-restart chefshat.service"]
    system.type("dpkg --remove chefshat")
    assert list((system.root / "var/lib/chefshat/records").iterdir())
    assert (system.root / "etc/chefshat/chefshat.toml").exists()


def test_the_wheels_are_installed_as_the_page_says(python_system: System, tmp_path: Path) -> None:
    wheels = sorted(DIST.glob("*.whl"))
    assert len(wheels) == 7
    downloads = tmp_path / "downloads"
    sdk = next(wheel for wheel in wheels if wheel.name.startswith("chefshat-"))
    run([sys.executable, "-m", "pip", "download", "--quiet", "--dest", str(downloads), f"{sdk}[envs]", "pip"])
    python_system.download(*wheels, ROOT / "clients/python/tools/try_wheels.py")
    with index(downloads, tmp_path / "index") as (url, asked):
        output = python_system.type(block("python3 -m venv"), PIP_INDEX_URL=url)
        assert "action_mask" in output, output
        assert "place" in output, output
        activated = ". .venv/bin/activate; export PATH; "
        others = "./chefshat_paper-*.whl ./chefshat_robot-*.whl"
        tried = "chefshat-robot --help; python -I try_wheels.py"
        python_system.type(f"{activated} pip install {others}; {tried}", PIP_INDEX_URL=url)
    assert "gymnasium" in asked
    # A stranger may have registered these there.
    assert not [name for name in asked if name.startswith("chefshat")]


@contextmanager
def index(wheels: Path, folder: Path) -> Iterator[tuple[str, set[str]]]:
    """An index of Python packages with the wheels of others in a folder. Yields its address, and the names it was asked for."""
    for wheel in wheels.iterdir():
        name = re.sub(r"[-_.]+", "-", wheel.name.split("-")[0]).lower()
        if not name.startswith("chefshat"):
            (folder / name).mkdir(parents=True)
            shutil.copy(wheel, folder / name)
    asked: set[str] = set()

    class Handler(SimpleHTTPRequestHandler):
        def do_GET(self) -> None:
            asked.add(self.path.split("/")[1])
            super().do_GET()

        def log_message(self, *_: object) -> None:
            """Prints nothing."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Handler, directory=folder))
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/", asked
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def test_the_image_plays(tmp_path: Path) -> None:
    images = Images(tmp_path, tmp_path)
    try:
        image = images.load(DIST / f"chefshat-{VERSION}-image.tar")
        configuration = images.configuration(image)
        assert configuration["User"] == "65532:65532"
        # Some versions of Buildah add a PATH.
        own = [variable for variable in configuration["Env"] if not variable.startswith("PATH=")]
        assert own == ["CHEFSHAT_DATA_DIR=/data", "CHEFSHAT_LISTEN=0.0.0.0:50051"]
        address = f"127.196.{(os.getpid() >> 8) & 255}.{os.getpid() & 255}:50051"
        environment = {"CHEFSHAT_LISTEN": address, "CHEFSHAT_SERVER": f"http://{address}"}
        container = images.container(image)
        code, output = container.run("demo", environment=environment)
        assert code == 0, output
        server = container.start(environment=environment)
        try:
            until(server, container, environment)
            play(address)
        finally:
            end(server)
    finally:
        images.close()


def test_an_agent_is_built_from_the_crates(tmp_path: Path) -> None:
    for name in ("proto", "client"):
        run(["tar", "-xzf", str(DIST / f"chefshat-{name}-{VERSION}.crate"), "-C", str(tmp_path)])
    folder = tmp_path / f"chefshat-client-{VERSION}"
    proto = json.dumps(str(tmp_path / f"chefshat-proto-{VERSION}"))
    build = ["cargo", "build", "--quiet", "--example", "random_agent", "--config", f"patch.crates-io.chefshat-proto.path={proto}"]
    environment = os.environ | {"CARGO_TARGET_DIR": str(tmp_path / "target")}
    subprocess.run(build, cwd=folder, env=environment, check=True, timeout=PATIENCE_S)
    assert (tmp_path / "target/debug/examples/random_agent").exists()


def test_the_protocol_compiles_elsewhere(compiler_system: System) -> None:
    compiler_system.download(DIST / f"chefshat-protocol-{VERSION}.tar.gz")
    protocol = f"chefshat-protocol-{VERSION}"
    # Without /proc, the compiler does not find the folder of its well-known types by itself.
    include = f"-I {protocol} -I /usr/include"
    compiler_system.type(f"tar -xzf {protocol}.tar.gz; protoc {include} --cpp_out=. {protocol}/chefshat/v1/*.proto")
    folder = compiler_system.root / compiler_system.folder
    headers = {header.name.removesuffix(".pb.h") for header in folder.glob("chefshat/v1/*.pb.h")}
    assert headers == {file.stem for file in (ROOT / "proto/chefshat/v1").glob("*.proto")}


def test_the_book_is_complete(tmp_path: Path) -> None:
    run(["tar", "-xzf", str(DIST / f"chefshat-book-{VERSION}.tar.gz"), "-C", str(tmp_path)])
    pages = {page.stem for page in (ROOT / "docs").glob("*.md")}
    assert pages <= {page.stem for page in (tmp_path / "book").glob("*.html")}


def test_the_bills_name_what_is_inside() -> None:
    binary = json.loads((DIST / f"chefshat-{VERSION}.cdx.json").read_text())
    page = json.loads((DIST / f"chefshat-page-{VERSION}.cdx.json").read_text())
    assert binary["bomFormat"] == page["bomFormat"] == "CycloneDX"
    inside = {"tokio", "tonic", "prost", "rustls", "chefshat-engine", "rust-embed", "tikv-jemallocator"}
    assert inside <= {part["name"] for part in binary["components"]}
    assert "preact" in {part["name"] for part in page["components"]}


def test_the_source_is_complete(tmp_path: Path) -> None:
    run(["tar", "-xzf", str(DIST / f"chefshat-{VERSION}-source.tar.gz"), "-C", str(tmp_path)])
    folder = tmp_path / f"chefshat-{VERSION}-source"
    tracked = run(["git", "ls-files"]).splitlines()
    assert {str(file.relative_to(folder)) for file in folder.rglob("*") if not file.is_dir()} == set(tracked)


def play(address: str) -> None:
    """Plays a Shift on a server, from outside."""
    with chefshat.Client(address) as client:
        rules = chefshat.pb.RuleSet(target_shifts=1)
        room = client.rooms.create("a release", rules=rules, seats=[None, "greedy", "random", "trained"])
        ticket = client.rooms.join(room.join_code, "outside").ticket
        assert client.play(RandomAgent(1), ticket).finished
