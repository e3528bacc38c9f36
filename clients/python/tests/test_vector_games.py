"""`VectorEnv` in this process and on the real server: invariants of games, and refusals."""

import pickle
from collections import Counter
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import chefshat
from chefshat import ChefsHatError, Transitions, VectorEnv, pb, sample_legal


def test_invariants_hold_in_every_game(anywhere: str | None) -> None:
    rng = np.random.default_rng(1)
    decided, ended, games_over = 0, 0, 0
    points = np.zeros(4)
    with VectorEnv(anywhere, 16, seed=1, rewards="points", shift_statistics=True) as env:
        batch = env.batch
        assert (env.players, env.faces, env.hand_size, env.num_actions, env.turn_actions) == (4, 11, 17, 214, 200)
        assert env.base_seed == 1
        assert batch.beginnings.games.tolist() == list(range(16))
        while ended < 60:
            seen, rows = batch.observations, np.arange(len(batch))
            assert batch.games.tolist() == list(range(16))
            assert (seen.hands.sum(axis=1) == seen.cards_left[rows, batch.seats]).all()
            assert batch.masks.any(axis=1).all()
            turns = batch.kinds == pb.DECISION_KIND_TURN
            assert not batch.masks[turns, 200:].any()
            assert not batch.masks[~turns, :200].any()
            assert (batch.rewards == 0).all()
            decided += len(batch)
            batch = env.step(sample_legal(batch.mask_bits, rng))
            endings, shifts = batch.endings, batch.shifts
            assert shifts is not None
            assert len(endings) == 4 * len(shifts)
            assert endings.games.tolist() == np.repeat(shifts.games, 4).tolist()
            assert (np.sort(endings.places_taken.reshape(-1, 4), axis=1) == [1, 2, 3, 4]).all()
            assert (endings.places_taken.reshape(-1, 4) == shifts.places).all()
            assert (endings.rewards.reshape(-1, 4) == shifts.points).all()
            assert (shifts.reward_sums == shifts.points).all()
            assert (shifts.valid.sum(axis=1) == shifts.turns).all()
            points += endings.rewards.reshape(-1, 4).sum(axis=0)
            ended += len(shifts)
            games_over += int(endings.game_over.sum()) // 4
        assert batch.totals.client_decisions == batch.totals.decisions == decided
        assert batch.totals.shifts == ended
        assert batch.totals.games == games_over
        assert points.sum() == 9 * ended


def trajectory(env: VectorEnv, steps: int) -> list[Any]:
    """Returns observations and rewards while the last legal action is taken each time."""
    found = []
    for _ in range(steps):
        batch = env.step(env.num_actions - 1 - env.batch.masks[:, ::-1].argmax(axis=1))
        found.append(
            [batch.seats.tolist(), batch.observations.hands.tolist(), batch.rewards.tolist(), batch.endings.places_taken.tolist()]
        )
    return found


def test_a_game_of_a_batch_can_be_replayed_alone(anywhere: str | None) -> None:
    options: dict[str, Any] = {"rewards": "paper", "client_seats": [1], "opponents": ["greedy", "random", "random_unmasked"]}
    with VectorEnv(anywhere, 3, seed=5, **options) as env:
        seeds = [bytes(seed) for seed in env.batch.beginnings.seeds]
        together = trajectory(env, 40)
        env.reset(seed=5)
        assert trajectory(env, 40) == together
        env.reset(seed=6)
        assert trajectory(env, 40) != together
    for game, seed in enumerate(seeds):
        with VectorEnv(anywhere, 1, seed=[seed], **options) as env:
            alone = trajectory(env, 40)
        assert [[column[0] for column in step[:3]] for step in alone] == [
            [column[game] for column in step[:3]] for step in together
        ]


def test_a_custom_reward_can_equal_a_scheme(anywhere: str | None) -> None:
    def validity(transitions: Transitions) -> NDArray[np.float32]:
        turns = transitions.kinds == pb.DECISION_KIND_TURN
        return np.where(turns, np.where(transitions.invalid, -1, 1), 0).astype(np.float32)

    rng = np.random.default_rng(2)
    options: dict[str, Any] = {"seed": 9, "invalid": "ask_again", "client_seats": [0, 2]}
    wrong = 0
    with (
        VectorEnv(anywhere, 8, rewards="validity", **options) as scheme,
        VectorEnv(anywhere, 8, reward_function=validity, **options) as own,
    ):
        while len(scheme.batch.endings) == 0 or wrong < 100:
            actions = sample_legal(scheme.batch.mask_bits, rng)
            tried = rng.random(len(actions)) < 0.3
            actions[tried] = rng.integers(0, 214, tried.sum())
            wrong += int((~scheme.batch.masks[np.arange(len(actions)), actions]).sum())
            expected, actual = scheme.step(actions), own.step(actions)
            assert expected.seats.tolist() == actual.seats.tolist()
            assert expected.attempts.tolist() == actual.attempts.tolist()
            assert expected.rewards.tolist() == actual.rewards.tolist()
            assert expected.endings.rewards.tolist() == actual.endings.rewards.tolist()
        assert scheme.batch.totals.invalid_attempts == wrong


def test_turns_have_the_200_actions_of_the_paper(anywhere: str | None) -> None:
    with VectorEnv(anywhere, 8, seed=1, decisions="turns", other_decisions="greedy", skip_forced=True) as env:
        kinds: Counter[int] = Counter()
        while env.batch.totals.games < 2:
            batch = env.step(sample_legal(env.batch.mask_bits, np.random.default_rng(0)))
            kinds.update(batch.kinds.tolist())
            assert (batch.masks.sum(axis=1) > 1).all()
            assert not batch.masks[:, 200:].any()
        assert set(kinds) == {pb.DECISION_KIND_TURN}


def test_a_limited_number_of_games(anywhere: str | None) -> None:
    rng = np.random.default_rng(3)
    with VectorEnv(anywhere, 2, seed=1, total_games=5, episode="game", rules={"target_shifts": 2}) as env:
        begun, over = env.batch.beginnings.indices.tolist(), 0
        while not env.batch.done:
            batch = env.step(sample_legal(env.batch.mask_bits, rng))
            begun += batch.beginnings.indices.tolist()
            over += len(batch.endings)
            assert batch.endings.game_over.all()
        assert sorted(begun) == [0, 1, 2, 3, 4]
        assert over == 4 * 5
        assert env.batch.totals.games == 5
        assert len(env.batch) == 0
        assert len(env.reset()) == 0
        assert len(env.reset(9)) == 2


def test_other_rules_have_other_widths(anywhere: str | None) -> None:
    with VectorEnv(anywhere, 2, rules={"players": 6, "faces": 15, "jokers": 1}, transitions=True) as env:
        for _ in range(50):
            batch = env.step(sample_legal(env.batch.mask_bits, np.random.default_rng(4)))
        assert env.num_actions == 380
        assert batch.masks.shape == (2, 380)
        assert batch.observations.hands.shape == (2, 16)
        assert batch.observations.roles.shape == (2, 6)
        assert batch.transitions.before.observations.points.shape[1] == 6


@pytest.mark.server
def test_games_continue_from_a_record(real_address: str) -> None:
    with chefshat.Client(real_address) as client:
        room = client.rooms.create("to branch from", seats=[None, "greedy", "random", "random"])
        client.play(chefshat.RandomAgent(seed=1), client.rooms.join(room.join_code, "Ada").ticket)
        decisions = [line.decision for line in client.records.read(room.room.game_id) if line.HasField("decision")]
    branch = pb.BranchPoint(game_id=room.room.game_id, decisions=30)
    with VectorEnv(real_address, 3, branch=branch) as env:
        following = decisions[30]
        assert env.batch.seats.tolist() == [following.seat] * 3
        assert env.batch.mask_bits[2].tobytes() == following.action_mask
        env.step([following.action] * 3)
        assert env.batch.seats.tolist() == [decisions[31].seat] * 3
    missing = pb.BranchPoint(game_id="0" * 32, decisions=1)
    with pytest.raises(ChefsHatError) as refused:
        VectorEnv(real_address, 1, branch=missing)
    assert refused.value.reason == "GAME_UNKNOWN"


def test_games_start_with_given_hands(anywhere: str | None) -> None:
    rules = pb.RuleSet(players=2, faces=4, jokers=2)
    cards = [[1, 2, 3, 4, 4, 5], [2, 3, 3, 4, 4, 5]]
    hands = [pb.SeatCards(seat=seat, cards=held, golden=seat == 1) for seat, held in enumerate(cards)]
    with VectorEnv(anywhere, 2, rules=rules, hands=pb.ScriptedShift(hands=hands)) as env:
        assert env.batch.seats.tolist() == [1, 1]
        assert env.batch.observations.hands.tolist() == [[0, 1, 2, 2, 1]] * 2
        assert env.batch.observations.golden.tolist() == [1, 1]


@pytest.mark.parametrize(
    ("options", "reason", "says"),
    [
        ({"games": 2**32 - 1}, "SETUP_REFUSED", "play "),
        ({"client_seats": [4]}, "SETUP_REFUSED", "seat"),
        ({"opponents": "nobody", "client_seats": [0]}, "SETUP_REFUSED", "nobody"),
        ({"rules": {"faces": 40}}, "RULE_SET_REFUSED", "40"),
        ({"rules": "no such preset"}, "RULE_SET_REFUSED", "no such preset"),
    ],
)
def test_setups_are_refused_with_their_reason(anywhere: str | None, options: Any, reason: str, says: str) -> None:
    with pytest.raises(ChefsHatError, match=says) as refused:
        VectorEnv(anywhere, **options)
    assert refused.value.reason == reason
    assert not refused.value.retryable


def test_an_illegal_action_is_reported_with_its_row(anywhere: str | None) -> None:
    with VectorEnv(anywhere, 4, seed=1) as env:
        actions = env.batch.masks.argmax(axis=1)
        actions[2] = env.batch.masks[2].argmin()
        with pytest.raises(ChefsHatError) as refused:
            env.step(actions)
        assert refused.value.reason == "ILLEGAL_ACTION"
        assert refused.value.metadata["row"] == "2"
        # It costs that row another choice, and the others nothing.
        before = env.save()
        actions[2] = env.batch.masks[2].argmax()
        assert env.batch.step == 1
        assert env.save() == before
        assert env.step(actions).step == 2
        assert env.batch.totals.client_decisions == 4
        # Nor does one of a decision that is left open.
        illegal = env.batch.masks.argmin(axis=1)
        assert env.step(illegal, leave_open=np.ones(4, np.bool_)).totals.client_decisions == 4


def test_threads_change_nothing(anywhere: str | None) -> None:
    if anywhere is not None:
        with pytest.raises(ValueError, match="a server chooses its own"):
            VectorEnv(anywhere, threads=2)
        return
    shown = []
    for threads in (0, 1, 3):
        with VectorEnv(games=400, client_seats=[0], opponents="greedy", seed=2, threads=threads) as env:
            env.sample(seed=1)
            for _ in range(20):
                env.step(env.sample())
            shown.append(env.batch.observations.hands.tolist())
    assert shown[0] == shown[1] == shown[2]
    for threads in (-1, 257):
        with pytest.raises(ValueError, match=rf"threads is 0\.\.=256, not {threads}"):
            VectorEnv(threads=threads)
    with pytest.raises(TypeError, match=r"threads is a whole number, not 1\.5"):
        VectorEnv(threads=1.5)  # type: ignore[arg-type]


def test_games_in_this_process_are_limited_by_its_memory() -> None:
    pytest.importorskip("chefshat_native")
    # A server takes 16,384 seats, 524,288 actions of histories and 16,384 seeds.
    seeds = [number.to_bytes(32, "little") for number in range(20_000)]
    with VectorEnv(games=20_000, client_seats=[0], history=64, seed=seeds) as env:
        assert len(env.batch) == 20_000
    with pytest.raises(ChefsHatError, match="MiB of memory are free: play fewer at a time"):
        VectorEnv(games=2**32 - 1)


def test_the_hands_of_all_seats(anywhere: str | None) -> None:
    with VectorEnv(anywhere, 6, seed=3, all_hands=True) as env:
        for _ in range(150):
            batch = env.batch
            hands = batch.all_hands.reshape(len(batch), 4, 12)
            assert (hands[np.arange(len(batch)), batch.seats] == batch.observations.hands).all()
            assert (hands.sum(axis=2) == batch.observations.cards_left).all()
            env.step(env.sample())
        assert pickle.loads(pickle.dumps(env.batch)).all_hands.tolist() == env.batch.all_hands.tolist()
    with VectorEnv(anywhere, 6, seed=3) as env:
        assert env.batch.all_hands.shape == (6, 0)
        assert "all_hands" not in env.batch.as_dict()
