"""Network files as opponents, in this process and on the real server."""

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chefshat.errors import ChefsHatError
from chefshat.vector import Batch, VectorEnv

ROOT = Path(__file__).parents[3]
TRAINED = ROOT / "server/agents/src/network/trained.safetensors"
OTHER = ROOT / "tests/fixtures/network/table-actions.safetensors"
SMALL = ROOT / "tests/fixtures/network/small-table.safetensors"


def played(address: str | None, opponents: Any) -> list[Batch]:
    """The batches of some games."""
    with VectorEnv(address, 40, client_seats=[1], opponents=opponents, rewards="points", seed=3) as env:
        env.sample(5)
        return [env.step(env.sample()) for _ in range(60)]


def are_equal(batches: list[Batch], others: list[Batch]) -> bool:
    """Whether the client has seen the same."""
    pairs = zip(batches, others, strict=True)
    return all(
        np.array_equal(one.mask_bits, other.mask_bits) and np.array_equal(one.observations.played, other.observations.played)
        for one, other in pairs
    )


def test_the_file_of_a_built_in_agent_plays_as_the_agent(anywhere: str | None) -> None:
    expected = played(anywhere, "trained")
    for file in (TRAINED, str(TRAINED), TRAINED.read_bytes()):
        assert are_equal(played(anywhere, file), expected)
    assert are_equal(played(anywhere, [TRAINED, "trained", TRAINED.read_bytes()]), expected)
    assert not are_equal(played(anywhere, OTHER), expected)


def test_files_mix_with_names_and_functions(anywhere: str | None) -> None:
    def first(batch: Batch) -> Any:
        return batch.masks.argmax(axis=1)

    def name(file: Path) -> str:
        return "network:" + hashlib.sha256(file.read_bytes()).hexdigest()[:16]

    cases: list[tuple[list[Any], tuple[str, ...]]] = [
        ([OTHER, "greedy", TRAINED], ("", name(OTHER), "greedy", name(TRAINED))),
        ([OTHER, first, "greedy"], ("", name(OTHER), "", "greedy")),
    ]
    for opponents, names in cases:
        with VectorEnv(anywhere, 3, client_seats=[0], opponents=opponents, seed=1) as env:
            assert env.built_in_agents == names
            for _ in range(20):
                env.step(env.sample())
            copies = env.fork([1], 2)
            copies.step(copies.sample())
            copies.close()


def test_files_that_cannot_play_are_refused_with_their_name(anywhere: str | None, tmp_path: Path) -> None:
    def refused(opponents: Any) -> str:
        with pytest.raises(ChefsHatError) as caught:
            VectorEnv(anywhere, 2, client_seats=[0], opponents=opponents)
        assert caught.value.reason == "SETUP_REFUSED"
        return str(caught.value)

    message = refused(["greedy", SMALL, "greedy"])
    assert f"{SMALL.name}: it is for 3 players" in message
    # A server need not know where files are.
    assert str(SMALL.parent) not in message
    assert "use one that was trained under such rules" in message
    broken = tmp_path / "broken.safetensors"
    broken.write_bytes(b"no network")
    assert f"{broken.name}: not a safetensors file" in refused(str(broken))
    assert "file 0: not a safetensors file" in refused(b"no network")
    with pytest.raises(FileNotFoundError, match=r"missing\.safetensors"):
        VectorEnv(anywhere, 2, client_seats=[0], opponents="missing.safetensors")


def test_a_server_takes_files_of_limited_size() -> None:
    content = TRAINED.read_bytes()
    files = [content, content + b" ", content + b"  "]
    with pytest.raises(ValueError, match="KiB, and a server takes less than 1024"):
        VectorEnv("127.0.0.1:1", 2, client_seats=[0], opponents=files)
