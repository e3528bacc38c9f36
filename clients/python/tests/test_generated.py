"""The committed generated code matches its sources: the .proto files and `_async`."""

import importlib.util
import sys
from pathlib import Path

import pytest

import chefshat

PACKAGE = Path(__file__).resolve().parents[1]
COMMITTED = Path(chefshat.__file__).parent


def files(folder: Path) -> dict[str, str]:
    return {
        path.relative_to(folder).as_posix(): path.read_text(encoding="utf-8")
        for generated in ("_gen", "_sync")
        for path in sorted((folder / generated).rglob("*.py*"))
        if path.suffix in (".py", ".pyi")
    }


def test_generated_code_is_up_to_date(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    spec = importlib.util.spec_from_file_location("generate", PACKAGE / "tools" / "generate.py")
    assert spec is not None
    assert spec.loader is not None
    generator = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "generate", generator)
    spec.loader.exec_module(generator)
    generator.generate(tmp_path)
    made, committed = files(tmp_path), files(COMMITTED)
    assert {"_gen/chefshat/v1/play_service_pb2_grpc.py", "_sync/calls.py"} <= made.keys()
    stale = sorted(name for name in made.keys() | committed.keys() if made.get(name) != committed.get(name))
    assert stale == [], "run `python tools/generate.py` and commit what it writes"


def test_generated_code_imports_from_inside_the_package() -> None:
    for name, text in files(COMMITTED).items():
        assert "from chefshat.v1" not in text, name
        assert "import chefshat.v1" not in text, name
