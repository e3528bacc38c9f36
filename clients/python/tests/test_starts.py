"""Games that begin with hands and actions of their own, in this process and on the real server."""

import numpy as np
import pytest

from chefshat import ChefsHatError, VectorEnv, pb


def dealt(anywhere: str | None, seed: int, length: int) -> tuple[pb.ScriptedShift, list[int]]:
    """Returns hands that a seed deals, and the lowest legal actions from there."""
    hands: dict[int, pb.SeatCards] = {}
    actions: list[int] = []
    with VectorEnv(anywhere, seed=seed) as env:
        while len(hands) < 4 or len(actions) < length:
            seat, seen = int(env.batch.seats[0]), env.batch.observations
            if seat not in hands:
                # In the first Shift nothing is exchanged, so this is the hand as dealt.
                cards = np.repeat(np.arange(1, 13), seen.hands[0])
                hands[seat] = pb.SeatCards(seat=seat, cards=cards.tolist(), golden=bool(seen.golden[0]))
            actions.append(int(env.batch.masks[0].argmax()))
            env.step(actions[-1:])
    return pb.ScriptedShift(hands=[hands[seat] for seat in range(4)]), actions[:length]


def test_games_begin_with_the_starts_in_turn(anywhere: str | None) -> None:
    starts = [dealt(anywhere, 3, 0), dealt(anywhere, 4, 9), dealt(anywhere, 5, 4)]
    with VectorEnv(anywhere, 5, starts=starts, history=16) as env:
        assert env.batch.observations.history_counts.tolist() == [0, 9, 4, 0, 9]
        for row in (1, 4):
            with VectorEnv(anywhere, seed=4, history=16) as alone:
                for action in starts[1][1]:
                    alone.step([action])
                for name, column in alone.batch.observations.as_dict().items():
                    assert (column[0] == getattr(env.batch.observations, name)[row]).all(), name
        # Game 0 continues with the index 5.
        assert env.reset(games=[0]).observations.history_counts[0] == 4


def test_wrong_starts_are_refused_by_entry_and_action(anywhere: str | None) -> None:
    hands, actions = dealt(anywhere, 3, 5)
    with pytest.raises(ChefsHatError, match="start 1, action 3 of its list: `give J` does not fit"):
        VectorEnv(anywhere, starts=[(hands, actions), (hands, [*actions[:3], 211])])
    with pytest.raises(ChefsHatError, match="start 0: hands") as refused:
        VectorEnv(anywhere, starts=[(pb.ScriptedShift(), [])])
    assert refused.value.reason == "SCRIPT_REFUSED"
    with pytest.raises(ChefsHatError, match="the list of starts is empty"):
        VectorEnv(anywhere, starts=[])
    with pytest.raises(ValueError, match="starts excludes"):
        VectorEnv(anywhere, starts=[(hands, [])], hands=hands)
