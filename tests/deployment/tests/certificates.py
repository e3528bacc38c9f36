"""A certificate authority of the tests, and certificates of servers and proxies, which are replaced."""

import contextlib
import os
import ssl
import time
from collections.abc import Callable
from pathlib import Path

import trustme

AUTHORITY = trustme.CA()
#: How long a test waits for something that must happen, seconds.
PATIENCE_S = 300.0


def trust(folder: Path) -> Path:
    """Makes every client of this process and of its children trust the authority. Returns the file of the authority."""
    file = folder / "ca.pem"
    AUTHORITY.cert_pem.write_to_path(file)
    os.environ["CHEFSHAT_CA"] = str(file)
    # For the browser tests, which call the server without a client of ours.
    os.environ["NODE_EXTRA_CA_CERTS"] = str(file)
    return file


def issue(address: str, folder: Path) -> str:
    """Replaces tls.crt and tls.key in a folder by a new certificate of an address. Returns it as text."""
    folder.mkdir(exist_ok=True)
    issued = AUTHORITY.issue_cert(address)
    chain = b"".join(blob.bytes() for blob in issued.cert_chain_pems)
    for name, content in (("tls.crt", chain), ("tls.key", issued.private_key_pem.bytes())):
        part = folder.parent / f".{name}.part"
        part.write_bytes(content)
        part.replace(folder / name)
    return issued.cert_chain_pems[0].bytes().decode()


def until_served(certificate: str, host: str, port: int, explanation: Callable[[], str]) -> None:
    """Waits until new connections get a certificate. The explanation says why they never will, or nothing."""
    give_up_at = time.monotonic() + PATIENCE_S
    while True:
        with contextlib.suppress(OSError):
            served = ssl.get_server_certificate((host, port), timeout=PATIENCE_S)
            if served.split() == certificate.split():
                return
        assert not explanation(), explanation()
        assert time.monotonic() < give_up_at, "the certificate is not served"
        time.sleep(0.05)


def client_context() -> ssl.SSLContext:
    """TLS as a client that trusts the authority."""
    context = ssl.create_default_context()
    AUTHORITY.configure_trust(context)
    return context
