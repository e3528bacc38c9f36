"""A player of the reference implementation as an opponent in a `VectorEnv`.

One process answers for all seats and games of an environment, one decision after another. It is asked for decisions, but not
notified of what others do: a player that learns or remembers while it plays does neither here. `agent` plays with notifications,
in rooms.
"""

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from chefshat import pb
from chefshat.batch import Batch
from chefshat.learn import features
from numpy.typing import NDArray

from chefshat_paper.players_club.agent import DECLARE, DECLINE, GIVE, GIVEN_BY, RulesDoNotFit, is_numbers
from chefshat_paper.players_club.process import AgentError, AgentProcess, AgentSpec
from chefshat_paper.players_club.table import ACTIONS, DINNER_SERVED, FACES, FOOD_FIGHT, HAND, JOKER, PLAYERS


class ClubOpponent:
    """Chooses the actions of seats of a `VectorEnv`; a context manager that ends its process.

    It plays turns by the player's 200 scores: the legal action with the highest.
    """

    def __init__(self, agent: str, *, arguments: Mapping[str, Any] | None = None, **spec: Any) -> None:  # noqa: ANN401
        """Starts the player.

        Args:
            agent: "module.path:Class".
            arguments: arguments of its constructor, by name; JSON values.
            spec: further attributes of `AgentSpec`, such as `python`.

        Raises:
            AgentError: the player could not be created.
        """
        self.__name__ = agent
        self._process = AgentProcess(AgentSpec(agent, agent.rpartition(":")[2], arguments or {}, **spec))
        self._process.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Ends the process."""
        self._process.close()

    def __call__(self, batch: Batch) -> NDArray[np.int64]:
        """Returns the action of each row.

        Raises:
            RulesDoNotFit: the games do not have four players, eleven faces and hands of 17 cards.
            AgentError: the player raised, gave an invalid answer, hung or died.
        """
        sizes = batch.sizes
        if (sizes.players, sizes.faces, sizes.hand_size) != (PLAYERS, FACES, HAND):
            raise RulesDoNotFit(f"{self.__name__} only plays games of {PLAYERS} players, {FACES} faces and hands of {HAND} cards")
        vectors = features.classic_of(batch)
        return np.array([self._action(batch, row, vectors[row]) for row in range(len(batch))], np.int64)

    def _action(self, batch: Batch, row: int, vector: NDArray[np.float32]) -> int:
        legal = np.flatnonzero(batch.masks[row])
        if len(legal) == 1:
            return int(legal[0])
        kind = int(batch.kinds[row])
        if kind == pb.DECISION_KIND_TURN:
            scores = self._asked(len(ACTIONS), "get_action", [float(number) for number in vector])
            return int(legal[np.argmax(np.array(scores)[legal])])
        seen = batch.observations
        role = int(seen.roles[row, batch.seats[row]])
        if kind == pb.DECISION_KIND_EXCHANGE:
            # The server asks for each card, the reference once for all.
            amount = max(GIVEN_BY.get(role, 1) - int(seen.gave[row].sum()), 1)
            cards = [int(card) for card in np.repeat(np.arange(1, JOKER + 1), seen.hands[row])]
            gift = GIVE + self._asked(amount, "get_exhanged_cards", cards, amount)[0]
            if gift not in legal:
                raise AgentError(f"{self.__name__}: get_exhanged_cards chose a card that is not in its hand")
            return int(gift)
        special = FOOD_FIGHT if role == pb.ROLE_DISHWASHER else DINNER_SERVED
        return DECLARE if self._process.call("do_special_action", {}, special) else DECLINE

    def _asked(self, count: int, method: str, *arguments: object) -> list[float]:
        answer = self._process.call(method, *arguments)
        if not (is_numbers(answer) and len(answer) == count):
            raise AgentError(f"{self.__name__}: {method} did not return {count} numbers")
        return answer
