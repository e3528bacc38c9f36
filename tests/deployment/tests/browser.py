"""People in a browser, by the tests of the page."""

import os
import subprocess

import pytest
from certificates import PATIENCE_S
from servers import GuardedServer


def people_play(server: GuardedServer, url: str) -> None:
    """Runs the tests of the page about tokens against a server at a URL: people play, with links that contain their tokens."""
    web = os.environ.get("CHEFSHAT_WEB_DIR")
    if not web:
        pytest.skip("CHEFSHAT_WEB_DIR is not set: name the folder of the page with its modules")
    played = subprocess.run(
        ["npm", "run", "test:browser", "--", "tests/browser/access.test.ts"],
        cwd=web,
        env=os.environ | {"CHEFSHAT_URL": url, "CHEFSHAT_DATA_DIR": str(server.data)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=PATIENCE_S,
    )
    assert played.returncode == 0, played.stdout
