"""The hands of other seats in a rollout: exact where they are known, compared with the deck and with the observations."""

import numpy as np

from chefshat.learn import features
from chefshat.learn.all_hands import other_hands, width
from chefshat.learn.features import num_actions, turn_column
from chefshat.learn.self_play import Collector, Floats
from chefshat.vector import VectorEnv

PLAYERS, FACES = 4, 11
DECK = np.append(np.arange(1, FACES + 1), 2)


class Chance:
    """Acts at random among the legal actions."""

    def __init__(self) -> None:
        self._chance = np.random.default_rng(1)

    def __call__(self, inputs: Floats) -> tuple[np.ndarray, Floats]:
        legal = inputs[:, -num_actions(FACES) :] > 0
        return (legal * self._chance.random(legal.shape)).argmax(axis=1), np.zeros(len(inputs), np.float32)


def test_hands_make_up_the_deck_and_have_the_cards_that_all_see(anywhere: str | None) -> None:
    with VectorEnv(anywhere, 32, episode="shift", seed=3) as env:
        collector = Collector(env, 32, 160)
        for _ in range(2):
            rollout = collector.collect(Chance())
            found = other_hands(rollout, PLAYERS, FACES)
            assert found.shape == (160, 32, width(PLAYERS, FACES))
            turns = rollout.present & (rollout.inputs[:, :, turn_column(PLAYERS, FACES)] > 0)
            assert 0 < turns.sum() < rollout.present.sum()
            assert not found[~turns].any()
            rows = rollout.inputs[turns]
            others = np.rint(found[turns].reshape(-1, PLAYERS - 1, FACES + 1) * DECK).astype(int)
            # The observation: own hand, Golden card, board, cards left from the own seat on; the cards played come before the
            # unseen ones, the gifts, the kind, the pizza and the mask.
            left = FACES + 1 + 1 + FACES + 2 + 2
            cards_left = np.rint(rows[:, left + 1 : left + PLAYERS] * features.dealt(PLAYERS, FACES, 2)).astype(int)
            unseen = turn_column(PLAYERS, FACES) - 3 * (FACES + 1)
            hidden = np.rint(rows[:, unseen : unseen + FACES + 1] * DECK).astype(int)
            sizes = others.sum(axis=2)
            # A hand is unknown only if the rollout begins or ends before the seat's turn in the Shift.
            assert ((sizes == cards_left) | (sizes == 0)).all()
            known = (sizes == cards_left).all(axis=1)
            assert known.mean() > 0.9
            np.testing.assert_array_equal(others[known].sum(axis=1), hidden[known])


def test_only_a_rollout_without_a_further_turn_hides_a_hand(anywhere: str | None) -> None:
    with VectorEnv(anywhere, 4, episode="shift", seed=3) as env:
        collector = Collector(env, 4, 12)
        rollout = collector.collect(Chance())
        found = other_hands(rollout, PLAYERS, FACES).reshape(12, 4, PLAYERS - 1, FACES + 1)
        for step, game in np.argwhere(rollout.inputs[:, :, turn_column(PLAYERS, FACES)] > 0):
            seat = int(rollout.seats[step, game])
            for place in range(PLAYERS - 1):
                other = (seat + 1 + place) % PLAYERS
                acts = (rollout.seats[:, game] == other) & rollout.present[:, game]
                assert found[step, game, place].any() == bool(acts.any())
