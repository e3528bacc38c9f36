"""Players of the reference implementation as opponents of a `VectorEnv` and of a training."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chefshat import ChefsHatError, VectorEnv, pb, sample_legal
from chefshat.batch import Batch
from chefshat.learn import __main__ as command

from chefshat_paper.players_club import AgentError
from chefshat_paper.players_club.opponent import ClubOpponent

TESTS = str(Path(__file__).parent)


def club(player: str, **options: Any) -> ClubOpponent:
    return ClubOpponent(f"club_players:{player}", paths=(TESTS,), **options)


def played(address: str | None, opponent: Any) -> list[Batch]:
    """The batches of some games, which include exchanges."""
    rng = np.random.default_rng(1)
    with VectorEnv(address, 4, client_seats=[0], opponents=opponent, episode="game", rules={"target_shifts": 3}, seed=3) as env:
        batches = [env.batch]
        while batches[-1].totals.games < 4:
            batches.append(env.step(sample_legal(batches[-1].mask_bits, rng)))
        return batches


def test_a_player_plays_as_a_function_with_its_rule(anywhere: str | None) -> None:
    def largest(batch: Batch) -> Any:
        """Takes the last legal play; gives the rarest card, jokers last; declares special actions."""
        actions = []
        for row, mask in enumerate(batch.masks):
            legal = np.flatnonzero(mask)
            takes_last = batch.kinds[row] != pb.DECISION_KIND_TURN or len(legal) == 1
            actions.append(legal[-1] if takes_last else legal[-2])
        return np.array(actions)

    with club("Largest") as opponent:
        batches = played(anywhere, opponent)
    expected = played(anywhere, largest)
    assert len(batches) == len(expected)
    for batch, other in zip(batches, expected, strict=True):
        np.testing.assert_array_equal(batch.mask_bits, other.mask_bits)
        np.testing.assert_array_equal(batch.observations.received, other.observations.received)


def test_a_player_that_fails_is_named() -> None:
    with pytest.raises(AgentError, match="club_players:NoSuchPlayer"):
        club("NoSuchPlayer")
    with club("Rarest") as opponent, pytest.raises(ChefsHatError, match="only plays games of 4 players, 11 faces"):
        VectorEnv(None, 16, client_seats=[0], opponents=opponent, rules={"faces": 5}, seed=1)


@pytest.mark.slow
def test_a_training_against_a_player_resumes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PYTHONPATH", TESTS)
    out = tmp_path / "out.safetensors"
    games = ["--games", "0", "--opponent-games", "4", "--opponents", "club:club_players:Largest", "greedy", "random"]
    sizes = ["--steps", "16", "--minibatches", "2", "--width", "8", "--evaluations", "1", "--evaluation-games", "2"]
    arguments = ["--club-arguments", '{"unused": 1}']
    assert command.main(["ppo", "--out", str(out), "--decisions", "64", *games, *sizes, *arguments]) == 0
    setup, *others = (json.loads(line) for line in (tmp_path / "out.jsonl").read_text().splitlines())
    assert setup["plan"]["opponents"][0] == {
        "name": "club:club_players:Largest",
        "sha256": "",
        "python": "",
        "arguments": '{"unused": 1}',
    }
    assert others[-1]["evaluations"][2]["opponents"] == ["club_players:Largest", "greedy", "random"]

    resume = ["ppo", "--out", str(out), "--resume", "--decisions", "128"]
    assert command.main([*resume, "--opponent-arguments", "{}"]) == 1
    assert "opponent arguments" in capsys.readouterr().err
    assert command.main([*resume, *arguments]) == 0
    for wrong in ("[]", "{"):
        with pytest.raises(SystemExit):
            command.main([*resume, "--opponent-arguments", wrong])
    other = str(tmp_path / "other.safetensors")
    assert command.main(["ppo", "--out", other, "--decisions", "64", *games[:5], "club:club_players:NoSuchPlayer"]) == 1
    assert "NoSuchPlayer" in capsys.readouterr().err
