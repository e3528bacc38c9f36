"""The images of docker/Dockerfile, built and started: a server and an agent play, the server stops and keeps its data."""

import os
import re
import stat
from collections.abc import Iterator
from pathlib import Path

import chefshat
import pytest
from chefshat import RandomAgent, pb
from images import ROOT, Container, Images, end, run, stop, until

# The user of the images, who is nobody on this machine.
USER = 65532


@pytest.fixture(scope="module")
def images(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Images]:
    """Where the images are built."""
    cache = request.config.cache
    assert cache is not None
    images = Images(tmp_path_factory.mktemp("images"), cache.mkdir("images"))
    yield images
    images.close()


@pytest.fixture(scope="module")
def base(images: Images) -> str:
    """Debian with the Node of this machine."""
    node = Path(run(["node", "--print", "process.execPath"]))
    npm = Path(run(["npm", "root", "--global"])) / "npm"
    # Links of npm's own into the folder of programs would not survive the copy.
    script = '#!/bin/sh\nexec node /usr/local/lib/node_modules/npm/bin/npm-cli.js "$@"\n'
    files = {node: "/usr/local/bin/node", npm: "/usr/local/lib/node_modules/npm"}
    return images.base("node", [], files, {"usr/local/bin/npm": script})


@pytest.mark.slow
def test_a_server_and_an_agent_of_the_images_play(images: Images, base: str) -> None:
    binary = os.environ.get("CHEFSHAT_BIN")
    if not binary:
        pytest.skip("CHEFSHAT_BIN is not set: name the chefshat binary")
    bases = dict.fromkeys(("NODE_BASE", "RUST_BASE", "SERVER_BASE"), base)
    bases["BINARY"] = images.binary(Path(binary).parent)
    alone = images.container(images.build("server-alone", bases))
    code, output = alone.run("simulate", "--help", environment={})
    assert code == 1, output
    assert "chefshat-lab" in output
    check(images, images.build("server", bases), images.build("node-agent", bases))


@pytest.mark.slow
def test_the_images_are_built_from_source(images: Images, base: str) -> None:
    toolchain = Path(run(["rustc", "--print", "sysroot"]))
    # Some crates compile C.
    rust = images.base("rust", ["gcc", "libc6-dev", "make"], {toolchain: "/usr/local"}, {})
    bases = {"NODE_BASE": base, "RUST_BASE": rust, "SERVER_BASE": base}
    # Debian's buildah finds the stage only if it is named here.
    arguments = bases | {"BINARY": "build", "PROFILE": os.environ.get("CHEFSHAT_PROFILE", "dist")}
    image = images.build("server", arguments)
    check(images, image, images.build("node-agent", bases))


def test_the_default_base_gets_what_jemalloc_is_built_with() -> None:
    """The test above builds on Debian with make; the image of Rust on Alpine has none."""
    stage = (ROOT / "docker/Dockerfile").read_text().split("FROM ${RUST_BASE} AS build")[1].split("\nFROM ")[0]
    assert "tikv-jemalloc-sys" not in (ROOT / "Cargo.lock").read_text() or "apk add --no-cache make" in stage


#: Files with secrets that the pages of the book and the heads of the files in docker/ make.
SECRETS = [
    "chefshat-data/tokens.json",
    "docker/.env",
    "docker/peers/node.key",
    "docker/tls/tls.key",
    "keys/signing-key",
    "keys/tokens.json",
    "owner",
    "privkey.pem",
    "ada.ticket",
]


def test_secrets_stay_out_of_commits_and_images() -> None:
    assert run(["git", "check-ignore", "--no-index", *SECRETS]).splitlines() == SECRETS

    def patterns(file: str, prefix: str) -> list[str]:
        section = (ROOT / file).read_text().split("# Secrets.\n")[1].split("!/tests/fixtures/**")[0]
        return [line.removeprefix(prefix) for line in section.splitlines()]

    # A pattern without a slash holds in all folders for Git alone.
    assert patterns("docker/Dockerfile.dockerignore", "**/") == patterns(".gitignore", "")


def check(images: Images, server_image: str, agent_image: str) -> None:
    """Plays a game on a server of an image, with an agent of another; stops the server and looks at its data."""
    configuration = images.configuration(server_image)
    assert configuration["User"] == f"{USER}:{USER}"
    assert configuration["StopSignal"] == "SIGTERM"
    assert configuration["Healthcheck"]["Test"] == ["CMD", "/chefshat", "health"]
    assert list(configuration["Volumes"]) == ["/data"]
    assert configuration["Labels"]["org.opencontainers.image.title"] == "Chef's Hat"

    # A container has the network of this machine, so the server gets an address of its own.
    address = f"127.198.{(os.getpid() >> 8) & 255}.{os.getpid() & 255}:50051"
    environment = {"CHEFSHAT_LISTEN": address, "CHEFSHAT_SERVER": f"http://{address}"}
    container = images.container(server_image)
    token = create_token(container, environment)
    server = container.start(environment=environment)
    try:
        until(server, container, environment)
        game = play(address, token, images.container(agent_image))
        code, output = stop(server)
    finally:
        end(server)
    assert code == 0, output
    code, output = container.run("simulate", "--games", "2", environment=environment)
    assert code == 0, output
    assert container.run("health", environment=environment)[0] == 1

    # With storage by overlays it is found twice: in a layer, and where that is mounted.
    databases = [file.stat() for file in images.volumes().rglob("games.sqlite3")]
    assert {(found.st_uid, stat.S_IMODE(found.st_mode)) for found in databases} == {(USER, 0o600)}
    code, output = container.run("verify", f"/data/records/{game}.jsonl", environment=environment)
    assert code == 0, output


def create_token(container: Container, environment: dict[str, str]) -> str:
    """Creates a token in the data directory of a container."""
    # Buildah can lose the output of a program that ends at once.
    for _ in range(10):
        code, output = container.run("token", "create", "--role", "host", "--json", environment=environment)
        assert code == 0, output
        if token := re.search(r'"token":"([^"]+)"', output):
            return token[1]
    raise AssertionError("the container printed no token")


def play(address: str, token: str, agent: Container) -> str:
    """Plays a game from outside, with an agent in a container. Returns the game's id."""
    with chefshat.Client(address, token=token) as client:
        seats = [None, None, "greedy", "random"]
        room = client.rooms.create("images", rules=pb.RuleSet(target_shifts=1), seats=seats)
        ticket = client.rooms.join(room.join_code, "outside").ticket
        process = agent.start("--address", address, "--code", room.join_code, environment={"CHEFSHAT_TOKEN": token})
        result = client.play(RandomAgent(1), ticket)
        output, _ = process.communicate()
        assert process.returncode == 0, output
        assert result.finished
        return str(room.room.game_id)
