"""The packages chefshat, chefshat-native and chefshat-server: versions that fit, and the oldest versions of what they need."""

import re
import tomllib
from pathlib import Path
from typing import Any

PACKAGE = Path(__file__).resolve().parents[1]


def project() -> dict[str, Any]:
    project: dict[str, Any] = tomllib.loads((PACKAGE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return project


def test_the_extras_pin_the_wheels_of_the_same_version() -> None:
    workspace = tomllib.loads((PACKAGE.parents[1] / "Cargo.toml").read_text(encoding="utf-8"))["workspace"]
    version = project()["version"]
    assert version == workspace["package"]["version"]
    for name in ("native", "server"):
        assert project()["optional-dependencies"][name] == [f"chefshat-{name}=={version}"]


def test_the_oldest_versions_are_those_that_are_tested() -> None:
    lines = (PACKAGE / "tests" / "oldest.txt").read_text(encoding="utf-8").splitlines()
    tested = dict(line.split("==") for line in lines if "==" in line)
    for requirement in project()["dependencies"]:
        name, oldest = re.match(r"([\w-]+)>=([\d.]+)", requirement).groups()  # type: ignore[union-attr]
        assert tested[name].startswith(oldest), requirement
