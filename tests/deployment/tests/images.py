"""Builds the images of docker/Dockerfile on base images made by debootstrap, and runs them. Nothing is pulled.

Everything runs as root, with Debian's buildah: images in a folder, containers in a chroot on the network of this machine.
"""

import json
import os
import shutil
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[3]
#: How long a step may take, seconds: longer than a complete build.
PATIENCE_S = 3600.0
# The certificate authorities of this machine, which the registry of a network may need.
_AUTHORITIES = Path("/etc/ssl/certs/ca-certificates.crt")
_SETTINGS = ("NODE_EXTRA_CA_CERTS", "SSL_CERT_FILE", "CARGO_HTTP_CAINFO")


class Images:
    """Images and containers in a folder of their own."""

    def __init__(self, storage: Path, cache: Path) -> None:
        """Uses an empty folder for the images, and a folder for base systems that is kept between runs."""
        require("buildah", "debootstrap")
        self._storage, self._cache = storage, cache
        # Temporary files include the caches of builds.
        temporary = storage / "tmp"
        temporary.mkdir()
        self._buildah = ["env", f"TMPDIR={temporary}", "buildah"]
        self._buildah += ["--root", str(storage / "root"), "--runroot", str(storage / "run")]

    def close(self) -> None:
        """Deletes all images and containers."""
        # Unmounts them.
        self._run("rm", "--all")
        shutil.rmtree(self._storage)

    def base(self, name: str, packages: list[str], files: dict[Path, str], scripts: dict[str, str]) -> str:
        """Makes a base image: a minimal Debian with further packages, files and folders of this machine, and new scripts."""
        # Another list of packages makes another system.
        system = self._cache / "-".join([name, *packages])
        if not system.exists():
            part = system.with_suffix(".part")
            shutil.rmtree(part, ignore_errors=True)
            debian(part, "ca-certificates", "libstdc++6", *packages)
            shutil.copy(_AUTHORITIES, part / _AUTHORITIES.relative_to("/"))
            for path, text in scripts.items():
                script = part / path
                script.write_text(text)
                script.chmod(0o755)
            part.rename(system)
        return self._image(name, {system: "/"} | files, [f"--env={setting}={_AUTHORITIES}" for setting in _SETTINGS])

    def binary(self, folder: Path) -> str:
        """Makes an image that contains only the programs of a folder: /chefshat and /chefshat-lab."""
        programs = {}
        for name in ("chefshat", "chefshat-lab"):
            stripped = self._storage / name
            run(["strip", "-o", str(stripped), str(folder / name)])
            programs[stripped] = f"/{name}"
        return self._image("binary", programs, [])

    def load(self, file: Path) -> str:
        """Loads the image of a file, as docker does."""
        return self._run("pull", "--quiet", f"docker-archive:{file}")

    def _image(self, name: str, files: dict[Path, str], configuration: list[str]) -> str:
        container = self._run("from", "scratch")
        for source, target in files.items():
            self._run("copy", "--quiet", container, str(source), target)
        if configuration:
            self._run("config", *configuration, container)
        image = f"localhost/{name}"
        self._run("commit", "--quiet", "--rm", container, image)
        return image

    def build(self, target: str, arguments: dict[str, str]) -> str:
        """Builds a target of docker/Dockerfile from the files of the source tree that Git knows."""
        context = self._storage / "context"
        if not context.exists():
            context.mkdir()
            copy = 'git ls-files -z --cached --others --exclude-standard | xargs -0 cp --parents --target-directory="$0"'
            run(["sh", "-c", copy, str(context)])
        image = f"localhost/{target}"
        given = [f"--build-arg={name}={value}" for name, value in arguments.items()]
        options = ["--format=docker", "--isolation=chroot", "--pull-never", f"--target={target}", f"--tag={image}", *given]
        ignored = "docker/Dockerfile.dockerignore"
        self._run("build", *options, f"--file={context}/docker/Dockerfile", f"--ignorefile={context}/{ignored}", str(context))
        return image

    def configuration(self, image: str) -> dict[str, Any]:
        """The configuration of an image, as Docker has it."""
        found: dict[str, Any] = json.loads(self._run("inspect", "--type=image", image))["Docker"]["config"]
        return found

    def container(self, image: str) -> "Container":
        """A container of an image, which is not running."""
        configuration = self.configuration(image)
        name = self._run("from", "--pull-never", image)
        return Container([*self._buildah, "run", "--isolation=chroot"], name, configuration)

    def volumes(self) -> Path:
        """The folder that contains the volumes of the containers."""
        return self._storage / "root"

    def _run(self, *arguments: str) -> str:
        return run([*self._buildah, *arguments])


class Container:
    """A container. Commands in it see the network and the processes of this machine."""

    def __init__(self, runner: list[str], name: str, configuration: dict[str, Any]) -> None:
        self._runner, self._name, self._configuration = runner, name, configuration

    def start(self, *arguments: str, environment: dict[str, str]) -> subprocess.Popen[str]:
        """Starts the program of the image with arguments instead of the image's own."""
        command = [*self._configuration["Entrypoint"], *(arguments or self._configuration["Cmd"])]
        settings = [f"--env={name}={value}" for name, value in environment.items()]
        return subprocess.Popen(
            [*self._runner, *settings, self._name, "--", *command],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def run(self, *command: str, environment: dict[str, str]) -> tuple[int, str]:
        """Runs the program of the image. Returns its exit code and output."""
        process = self.start(*command, environment=environment)
        output, _ = process.communicate(timeout=PATIENCE_S)
        return process.returncode, output


def require(*programs: str) -> None:
    """Skips the test without these programs or without root, whom they need."""
    if os.geteuid() != 0:
        pytest.skip("only root can make systems and images here")
    for program in programs:
        if shutil.which(program, path=f"{os.environ['PATH']}:/usr/sbin") is None:
            pytest.skip(f"{program} is not installed")


def debian(folder: Path, *packages: str) -> None:
    """Makes a minimal Debian of the release of this machine, with further packages."""
    release = dict(line.split("=", 1) for line in Path("/etc/os-release").read_text().splitlines() if "=" in line)
    include = [f"--include={','.join(packages)}"] if packages else []
    run(["debootstrap", "--variant=minbase", *include, release["VERSION_CODENAME"], str(folder)])


def stop(process: subprocess.Popen[str], number: int = signal.SIGTERM) -> tuple[int, str]:
    """Sends a signal to the program in a container, as an engine does. Returns its exit code and output."""
    os.kill(innermost(process.pid), number)
    output, _ = process.communicate(timeout=PATIENCE_S)
    return process.returncode, output


def end(process: subprocess.Popen[str]) -> None:
    """Kills the program in a container, if it is still running, and waits for its end."""
    if process.poll() is None:
        os.kill(innermost(process.pid), signal.SIGKILL)
        process.communicate(timeout=PATIENCE_S)


def innermost(process: int) -> int:
    """The last of a chain of processes that each wait for one child."""
    while True:
        children = [child for file in Path(f"/proc/{process}/task").glob("*/children") for child in file.read_text().split()]
        if not children:
            return process
        process = int(children[0])


def run(command: list[str]) -> str:
    """Runs a program in the source tree. Returns its output without the final line break."""
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode == 0, f"{' '.join(command)}\n{done.stdout}\n{done.stderr}"
    return done.stdout.strip()


def until(process: subprocess.Popen[str], container: Container, environment: dict[str, str]) -> None:
    """Waits until the health check of a server in a container succeeds."""
    give_up_at = time.monotonic() + PATIENCE_S
    while container.run("health", environment=environment)[0] != 0:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < give_up_at
