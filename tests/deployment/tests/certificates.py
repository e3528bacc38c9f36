"""A certificate authority of the tests, and certificates of a proxy that it replaces."""

import os
import ssl
from pathlib import Path

import trustme

AUTHORITY = trustme.CA()


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
    issued = AUTHORITY.issue_cert(address)
    chain = b"".join(blob.bytes() for blob in issued.cert_chain_pems)
    for name, content in (("tls.crt", chain), ("tls.key", issued.private_key_pem.bytes())):
        part = folder.parent / f".{name}.part"
        part.write_bytes(content)
        part.replace(folder / name)
    return issued.cert_chain_pems[0].bytes().decode()


def client_context() -> ssl.SSLContext:
    """TLS as a client that trusts the authority."""
    context = ssl.create_default_context()
    AUTHORITY.configure_trust(context)
    return context
