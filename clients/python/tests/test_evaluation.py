"""The summary of an evaluation."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from chefshat import Batch, ChefsHatError
from chefshat.learn import network
from chefshat.learn.evaluation import OneOpponent, compare, compared, evaluate, summed_up

FIXTURES = Path(__file__).resolve().parents[3] / "tests" / "fixtures" / "network"
PLAYERS = ("greedy", "random")


def test_shifts_of_one_game_are_not_independent() -> None:
    places = np.array([0, 2, 1, 3])
    # Two games of three equal Shifts each: as certain as two values, not six.
    found = summed_up(("greedy",) * 3, 2, np.array([0, 1, 0, 1, 0, 1]), np.array([5, 1, 5, 1, 5, 1], np.uint32), places)
    assert (found.shifts, found.points, found.places) == (6, 3.0, (0, 2, 1, 3))
    two_numbers = np.std([5, 1], ddof=1) / 2**0.5
    assert found.standard_error == pytest.approx(float(two_numbers))
    assert "3.000 ± 2.000 points per Shift against greedy, greedy, greedy (6 Shifts in 2 games" in str(found)


def test_independent_shifts_have_the_usual_error() -> None:
    points = np.random.default_rng(1).choice([5, 3, 1, 0], 400).astype(np.uint32)
    found = summed_up(("random",) * 3, 400, np.arange(400), points, np.array([1, 1, 1, 397]))
    assert found.standard_error == pytest.approx(float(points.std(ddof=1)) / 400**0.5)


def test_one_game_has_no_error() -> None:
    found = evaluate("greedy", "random", games=1, seed=1)
    assert (found.games, found.standard_error, found.to_json()["standard_error"]) == (1, float("inf"), None)
    assert "± inf points" in str(found)
    with pytest.raises(ValueError, match="opponents is empty"):
        evaluate("greedy", [], games=1)


def test_a_player_takes_any_seat() -> None:
    """The network of the built-in agent, among three of them, plays the same games from every seat: all points are shared out."""
    trained = network.load("trained")
    found = [evaluate(trained, "trained", games=10, seat=seat, seed=5) for seat in range(4)]
    assert len({one.shifts for one in found}) == 1
    assert sum(one.points for one in found) == pytest.approx(5 + 3 + 1)
    assert len({one.points for one in found}) > 1


def test_a_comparison_needs_no_luck_with_the_deals() -> None:
    trained = network.load("trained")

    def first_legal(batch: Batch) -> NDArray[np.intp]:
        return np.asarray(batch.masks.argmax(axis=1), np.intp)

    same = compare(trained, trained.actions_of, "greedy", deals=20, seed=5)
    assert (same.difference, same.standard_error) == (0, 0)
    found = compare(trained, first_legal, "greedy", deals=30, seats=[0, 2], seed=5)
    assert found.points[0] - found.points[1] == pytest.approx(found.difference)
    assert found.difference > 1
    alone = [evaluate(player, "greedy", games=30, seed=5) for player in (trained, first_legal)]
    independent = (alone[0].standard_error ** 2 + alone[1].standard_error ** 2) ** 0.5
    assert 0 < found.standard_error < independent
    assert "on 30 deals" in str(found)
    with pytest.raises(ValueError, match="at least 2"):
        compare(trained, first_legal, "greedy", deals=1)
    for seats in ([], [1, 1]):
        with pytest.raises(ValueError, match="name at least one seat, and each once"):
            compare(trained, first_legal, "greedy", deals=2, seats=seats)


def test_games_that_are_played_again_are_not_independent() -> None:
    one, other = bytes(32), b"x" * 32
    for seeds in ([one], [one, other, one, other]):
        with pytest.raises(ValueError, match=f"seed: {len(set(seeds))} different seeds for 4 deals; give one for each"):
            compare("greedy", "trained", "greedy", deals=4, seed=seeds)
        with pytest.raises(ValueError, match="different seeds for 3 games"):
            evaluate("greedy", "trained", games=3, seed=seeds)
    assert compare("greedy", "greedy", "trained", deals=2, seed=[one, other, one]).standard_error == 0


def test_evaluations_and_comparisons_mean_the_same() -> None:
    """Games have different numbers of Shifts: the mean of the games' means would be another number."""
    rules = {"preset": "paper", "target_points": 9}
    alone = [[evaluate(player, "random", games=30, seat=seat, seed=5, rules=rules) for seat in (1, 3)] for player in PLAYERS]
    found = compare(*PLAYERS, "random", deals=30, seats=[1, 3], seed=5, rules=rules)
    for points, parts in zip(found.points, alone, strict=True):
        shifts = sum(one.shifts for one in parts)
        assert points == pytest.approx(sum(one.points * one.shifts for one in parts) / shifts)
    one_seat = compare(PLAYERS[0], "random", "greedy", deals=30, seats=[1], seed=5, rules=rules)
    assert one_seat.points[0] == pytest.approx(evaluate(PLAYERS[0], "greedy", games=30, seat=1, seed=5, rules=rules).points)


def test_a_comparison_has_the_error_of_its_deals() -> None:
    """That of the jackknife over deals, which knows no formula for ratios."""
    points, shifts = np.random.default_rng(2).integers(1, 9, (2, 2, 400)).astype(float)

    def difference(kept: NDArray[np.intp]) -> float:
        first, second = points[:, kept].sum(axis=1) / shifts[:, kept].sum(axis=1)
        return float(first - second)

    without = [difference(np.delete(np.arange(400), deal)) for deal in range(400)]
    expected = (399 * np.var(without)) ** 0.5
    assert compared(("greedy",), points, shifts).standard_error == pytest.approx(float(expected), rel=0.02)


@pytest.mark.parametrize("players", [2, 3, 5])
def test_a_comparison_is_from_every_seat_of_the_game(players: int) -> None:
    rules = {"preset": "paper", "players": players, "faces": 8, "target_shifts": 2}
    found = compare(*PLAYERS, "random", deals=6, seed=5, rules=rules)
    assert found == compare(*PLAYERS, "random", deals=6, seats=range(players), seed=5, rules=rules)
    assert found.opponents == ("random",) * (players - 1)


def test_any_opponent_may_be_the_only_one() -> None:
    trained = network.load("trained")

    def by_network(batch: Batch) -> NDArray[np.uint16]:
        return trained.actions_of(batch)

    names: list[tuple[OneOpponent, str]] = [("trained", "trained"), (by_network, "by_network"), (trained, "trained")]
    found = [evaluate("greedy", opponents, games=4, seed=1) for opponents, _ in names]
    assert [one.opponents for one in found] == [(name,) * 3 for _, name in names]
    assert {one.points for one in found} == {found[0].points}
    file = FIXTURES / "table-actions.safetensors"
    content = evaluate("greedy", file.read_bytes(), games=4, seed=1)
    assert evaluate("greedy", file, games=4, seed=1).points == content.points
    assert evaluate("greedy", [file] * 3, games=4, seed=1).opponents == (str(file),) * 3


def test_built_in_agents_and_files_are_players() -> None:
    pytest.importorskip("chefshat_native")
    trained, greedy = (evaluate(player, "random", games=12, seed=3) for player in ("trained", "greedy"))
    assert trained == evaluate(network.load("trained"), "random", games=12, seed=3)
    assert greedy != trained
    file = FIXTURES / "table-actions.safetensors"
    found = compare(file, "greedy", "greedy", deals=4, seed=1, seats=[0])
    assert found == compare(str(file), "greedy", "greedy", deals=4, seed=1, seats=[0])
    with pytest.raises(ChefsHatError, match="there is no agent"):
        evaluate("clever", "random", games=1)


def test_a_network_of_turns_leaves_other_decisions_to_its_opponents() -> None:
    turns, strong = network.load(FIXTURES / "classic-turns.safetensors"), network.load("trained")
    as_object = evaluate(turns, strong, games=20, seed=1)
    as_name = evaluate(turns, "trained", games=20, seed=1)
    assert (as_object.shifts, as_object.points, as_object.places) == (as_name.shifts, as_name.points, as_name.places)
    with pytest.raises(ValueError, match="turns alone"):
        evaluate(turns, strong.actions_of, games=1)
