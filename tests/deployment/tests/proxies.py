"""Real proxies with the configurations of docker/proxies, of which only addresses and paths are replaced."""

import contextlib
import itertools
import json
import os
import re
import shutil
import signal
import subprocess
import sysconfig
import time
import urllib.request
from abc import ABC, abstractmethod
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import ClassVar, Self

import pytest
from certificates import PATIENCE_S, issue, until_served

CONFIGURATIONS = Path(__file__).resolve().parents[3] / "docker" / "proxies"
_PORT = 8443
_numbers = itertools.count(1)


class Proxy(ABC):
    """A proxy in front of a server, which is reached with TLS; a context manager."""

    #: The program, which may be missing.
    program: ClassVar[str]
    #: The configurations; the first is the one to start with.
    files: ClassVar[tuple[str, ...]]

    def __init__(self, server: str, folder: Path, tls: Path | None = None) -> None:
        """Prepares the proxy of the server at host:port, with its files in an empty folder.

        The nodes of a cluster are three of them, with spaces between them. `tls` is the folder of the certificate, if that is the
        server's.
        """
        self._folder = folder
        self._tls = tls or folder / "tls"
        # Its own loopback address, so that tests do not compete for ports.
        high, low = (os.getpid() >> 8) & 255, os.getpid() & 255
        self.host = f"127.{200 + next(_numbers) % 50}.{high}.{low}"
        self.address = f"{self.host}:{_PORT}"
        self.url = f"https://{self.address}"
        for name in self.files:
            text = (CONFIGURATIONS / name).read_text()
            servers = server.split()
            if len(servers) > 1:
                text = self._for_cluster(text)
            for old, new in [*self._addresses(servers, name), *self._replacements(name)]:
                assert old in text, f"{name} has no {old}"
                text = text.replace(old, new)
            (folder / name).write_text(text)
        self._processes: list[subprocess.Popen[bytes]] = []
        # Envoy ends with the thread that started it.
        self._starter = ThreadPoolExecutor(1)

    def __enter__(self) -> Self:
        certificate = issue(self.host, self._tls)
        self._start()
        self._until_served(certificate)
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._processes:
            process.send_signal(signal.SIGTERM)
        for process in self._processes:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(5)
            # A master process passes its end on to its workers.
            process.kill()
            process.wait()
        self._starter.shutdown()

    def reload(self) -> None:
        """Replaces the certificate and reloads; returns when new connections get the new certificate."""
        certificate = issue(self.host, self._tls)
        self._reload()
        self._until_served(certificate)

    def _for_cluster(self, text: str) -> str:
        """A configuration as its comments tell to change it for a cluster: other lines instead of the one before them."""
        single, marker, cluster = text.partition("# A cluster has these lines instead of the last one.")
        assert marker, text
        return single.rstrip().rpartition("\n")[0] + "\n#" + re.sub(r"^( *)#   (?=\S)", r"\1", cluster, flags=re.MULTILINE)

    def _addresses(self, servers: list[str], name: str) -> list[tuple[str, str]]:
        """What to replace by the addresses of servers in a configuration."""
        if len(servers) == 1:
            return [("server:50051", servers[0])]
        return [(f"node{number}:50051", address) for number, address in enumerate(servers, 1)]

    @abstractmethod
    def _replacements(self, name: str) -> list[tuple[str, str]]:
        """What else to replace in a configuration."""

    @abstractmethod
    def _start(self) -> None: ...

    @abstractmethod
    def _reload(self) -> None: ...

    def _run(self, *arguments: str) -> None:
        with (self._folder / "log").open("ab") as log:
            command = [find(self.program), *arguments]
            starting = self._starter.submit(subprocess.Popen, command, stdout=log, stderr=log, cwd=self._folder)
            self._processes.append(starting.result())

    def _until_served(self, certificate: str) -> None:
        def ended() -> str:
            return "" if self._processes[-1].poll() is None else self.log

        until_served(certificate, self.host, _PORT, ended)

    @property
    def log(self) -> str:
        """The output of the program."""
        return (self._folder / "log").read_text()


class Nginx(Proxy):
    """Reloads by a signal: new workers accept, old ones finish."""

    program = "nginx"
    files = ("nginx.conf",)

    def _replacements(self, name: str) -> list[tuple[str, str]]:
        kinds = ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
        temporary = "".join(f" {kind}_temp_path {self._folder}/{kind};" for kind in kinds)
        return [
            ("listen 443 ", f"listen {self.address} "),
            # Not every machine has IPv6.
            ("listen [::]:443 ", "# "),
            ("/etc/chefshat/tls", str(self._tls)),
            ("http {", f"http {{{temporary}"),
        ]

    def _start(self) -> None:
        directives = f"daemon off; error_log stderr; pid {self._folder}/pid;"
        self._run("-e", "stderr", "-c", str(self._folder / self.files[0]), "-g", directives)

    def _reload(self) -> None:
        self._processes[0].send_signal(signal.SIGHUP)


class HAProxy(Proxy):
    """Reloads by a signal to its master process: a new worker accepts, the old one finishes."""

    program = "haproxy"
    files = ("haproxy.cfg",)

    def _replacements(self, name: str) -> list[tuple[str, str]]:
        return [
            ("bind :443 ", f"bind {self.address} "),
            ("/etc/chefshat/tls", str(self._tls)),
            *self._of_this_machine(),
        ]

    def _of_this_machine(self) -> list[tuple[str, str]]:
        """Only root can become another user, and not every machine has IPv6."""
        identity = "    user haproxy\n    group haproxy\n"
        return [
            (identity, identity if os.geteuid() == 0 else ""),
            ("/run/haproxy/admin.sock", f"{self._folder}/admin.sock"),
            ("bind :::443 ", "# "),
        ]

    def _start(self) -> None:
        self._run("-W", "-db", "-f", self.files[0])

    def _reload(self) -> None:
        self._processes[0].send_signal(signal.SIGUSR2)


class HAProxyPassingThrough(HAProxy):
    """Passes connections on to a server that has the certificate. A new one needs no reload, but one must not hurt either."""

    files = ("haproxy-passing-through.cfg",)

    def _replacements(self, name: str) -> list[tuple[str, str]]:
        return [
            ("bind :443", f"bind {self.address}"),
            *self._of_this_machine(),
        ]


class Envoy(Proxy):
    """Loads a new certificate by itself. The first reload is a hot restart as well: a new process accepts, the old one finishes.

    A second hot restart would end the first process, with what it serves.
    """

    program = "envoy"
    files = ("envoy.yaml", "envoy-certificate.yaml")

    def _for_cluster(self, text: str) -> str:
        return text

    def _addresses(self, servers: list[str], name: str) -> list[tuple[str, str]]:
        """Each server is an endpoint."""
        if name != "envoy.yaml":
            return []
        line = "              - endpoint: { address: { socket_address: { address: server, port_value: 50051 } } }\n"
        pairs = [address.rpartition(":") for address in servers]
        return [
            (line, "".join(line.replace("server, port_value: 50051", f"{host}, port_value: {port}") for host, _, port in pairs))
        ]

    def _replacements(self, name: str) -> list[tuple[str, str]]:
        if name == "envoy-certificate.yaml":
            return [("/etc/chefshat/tls", str(self._tls))]
        return [
            ("address: 0.0.0.0, port_value: 443", f"address: {self.host}, port_value: {_PORT}"),
            # Not every machine has IPv6.
            ("additional_addresses: ", "# "),
            ("address: 127.0.0.1, port_value: 9901", f"address: {self.host}, port_value: 9901"),
            ("/etc/chefshat/envoy-certificate.yaml", str(self._folder / "envoy-certificate.yaml")),
        ]

    def _start(self) -> None:
        self._launch("--use-dynamic-base-id", "--base-id-path", "base-id")

    def _reload(self) -> None:
        if len(self._processes) > 1:
            return
        base_id = (self._folder / "base-id").read_text().strip()
        self._launch("--base-id", base_id, "--restart-epoch", "1")
        give_up_at = time.monotonic() + PATIENCE_S
        while not self._is_restarted():
            assert time.monotonic() < give_up_at, self.log
            time.sleep(0.05)

    def _is_restarted(self) -> bool:
        with contextlib.suppress(OSError, ValueError), urllib.request.urlopen(f"http://{self.host}:9901/server_info") as answer:
            info = json.load(answer)
            return bool(info["state"] == "LIVE" and info["command_line_options"]["restart_epoch"] == 1)
        return False

    def _launch(self, *arguments: str) -> None:
        short = ("--drain-time-s", "1", "--parent-shutdown-time-s", "600", "--concurrency", "1", "--log-level", "warning")
        self._run("-c", self.files[0], *short, *arguments)


def find(program: str) -> str:
    """The path of a proxy. Skips the test if there is none."""
    installed = Path(sysconfig.get_path("scripts")) / program
    found = str(installed) if installed.exists() else shutil.which(program, path=f"{os.environ['PATH']}:/usr/sbin")
    if found is None:
        pytest.skip(f"{program} is not installed")
    return found
