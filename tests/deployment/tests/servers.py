"""Servers that store their games and require tokens."""

import os
import signal
import subprocess
from pathlib import Path

import chefshat
import pytest
from certificates import PATIENCE_S, issue
from chefshat.local_server import BINARY, LocalServer


class GuardedServer(LocalServer):
    """A server that requires tokens.

    Attributes:
        data: its data directory.
        tokens: a token of each role.
    """

    def __init__(self, data: Path, *options: str) -> None:
        """Creates the tokens of a server with a data directory and further options."""
        binary = os.environ.get(BINARY)
        if not binary:
            pytest.skip(f"{BINARY} is not set: name the chefshat binary")
        super().__init__(binary, options=["--data-dir", str(data), "--access", "tokens", "--grace", "0", *options])
        self.data = data
        self.tokens = {role: self._create_token(role) for role in ("admin", "host", "player", "spectator")}

    @property
    def url(self) -> str:
        """Where clients reach it without a proxy."""
        return f"http://{self.address}"

    def client(self, role: str, url: str | None = None) -> chefshat.Client:
        """A client with the token of a role, which reaches the server directly or at a URL."""
        return chefshat.Client(url or self.url, token=self.tokens[role])

    def freeze(self) -> None:
        """Halts the process with its connections open, like a machine that is cut off; `kill` ends it."""
        os.kill(self.pid, signal.SIGSTOP)

    def _create_token(self, role: str) -> str:
        return run("token", "create", "--role", role, "--data-dir", self.data).stdout.strip()


class EncryptedServer(GuardedServer):
    """A server with TLS of its own.

    Attributes:
        tls: the folder of its certificate.
    """

    def __init__(self, data: Path, tls: Path, *options: str) -> None:
        """Prepares a server that takes its certificate from an empty folder."""
        issue("127.0.0.1", tls)
        super().__init__(data, "--tls-cert", str(tls / "tls.crt"), "--tls-key", str(tls / "tls.key"), *options)
        self.tls = tls

    @property
    def url(self) -> str:
        return f"https://{self.address}"


def run(*arguments: str | Path, environment: dict[str, str] | None = None) -> subprocess.CompletedProcess[str]:
    """Runs a command of the program, which must succeed."""
    done = attempt(*arguments, environment=environment)
    assert done.returncode == 0, done.stderr
    return done


def attempt(*arguments: str | Path, environment: dict[str, str] | None = None) -> subprocess.CompletedProcess[str]:
    """Runs a command of the program."""
    command = [os.environ[BINARY], *arguments]
    return subprocess.run(command, env=os.environ | (environment or {}), capture_output=True, text=True, timeout=PATIENCE_S)
