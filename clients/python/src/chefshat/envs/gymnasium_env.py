"""One seat against built-in agents as a `gymnasium.Env`.

Many games at once are in `gymnasium_vector`, all seats of a game in `chefshat_v1`.
"""

from typing import Any, ClassVar, Unpack

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from chefshat.address import ServerAddress
from chefshat.columns import Endings
from chefshat.envs.copying import NotCopied
from chefshat.envs.illegal import penalties, with_limit
from chefshat.envs.observing import Form, ObservationFunction
from chefshat.envs.options import EnvOptions
from chefshat.envs.rendering import RENDER_MODES, as_text, can_render, check_render_mode
from chefshat.errors import ChefsHatError
from chefshat.vector import Batch, VectorEnv


def take(vector: VectorEnv, action: Any, invalid_penalty: float) -> tuple[Batch, float]:  # noqa: ANN401 - As Gymnasium has it.
    """Takes the decision of the only game.

    Returns the batch with the next decision or an ending, and the penalty of an illegal action.
    """
    actions = np.asarray([action])
    penalty = float(penalties(vector.batch, actions, invalid_penalty)[0]) if invalid_penalty else 0.0
    batch = vector.step(actions)
    if not len(batch) and not batch.ended:
        wait_for_a_row(vector, or_an_end=True)
        batch = vector.batch
    return batch, penalty


def wait_for_a_row(vector: VectorEnv, *, or_an_end: bool = False) -> None:
    """Steps until the only game has a decision, or optionally an ending: a batch may be empty.

    Raises:
        ChefsHatError: the games are over.
    """
    while len(vector.batch) == 0 and not (or_an_end and vector.batch.ended > 0):
        if vector.batch.done:
            raise ChefsHatError("GAMES_OVER", "all total_games games are over; leave total_games out, or reset with a seed")
        vector.step(np.zeros(0, np.uint16))


def check_open(vector: VectorEnv) -> None:
    """Raises Gymnasium's error if the games have been closed."""
    if vector.closed:
        raise gymnasium.error.ClosedEnvironmentError("the environment is closed: make a new one")


class ChefsHatEnv(NotCopied, gymnasium.Env[Any, Any]):
    """One seat of a game; the other seats are built-in agents of the server.

    An action is the index of one of A actions (default 214). `info["action_mask"]` has A numbers, 1 where an action is legal;
    dictionary observations have it, too, and `action_masks()` returns it as booleans, as sb3-contrib requires.
    `action_space.sample(info["action_mask"])` draws a legal action. An illegal action is an invalid attempt: it gets the reward of
    the scheme (-1 by "validity" and the paper's) less `invalid_penalty`, and the decision is asked again; after 10 of them
    (`max_invalid_attempts`) the default action is taken.

    An episode is a Shift, or a game. After the end of a Shift `reset()` continues with the next Shift of the same game, so that
    roles, the exchange and special actions come up; in the middle of an episode, with a seed, or with `options={"new_game": True}`,
    it starts a new game, whose first Shift has none of them. `terminated` means that the episode has ended with places, also if
    its last Shift was adjudicated at the turn limit; `truncated` that it was cut off without. `info` also has: "kind" (a value of
    `pb.DecisionKind`), "invalid_attempts" (at this decision), and at the end of an episode "place", from 1.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": list(RENDER_MODES), "render_fps": 4}  # type: ignore[misc]

    def __init__(
        self,
        address: str | ServerAddress | None = None,
        *,
        seat: int = 0,
        observation: str | ObservationFunction = "table",
        rewards: str | None = "winning",
        invalid: str = "ask_again",
        invalid_penalty: float = 0.0,
        render_mode: str | None = None,
        **options: Unpack[EnvOptions],
    ) -> None:
        """Starts a game.

        Args:
            address: where the game is played; None: in this process, if it can. See `VectorEnv`.
            seat: the seat of the agent.
            observation: "table", "columns", "classic", or a function. See `Form`.
            rewards: the scheme; see `VectorOptions`. With "winning", 1 for finishing first, else -0.001 for each turn.
            invalid: effect of an illegal action; see `VectorOptions`.
            invalid_penalty: subtracted from the reward of an illegal action.
            render_mode: "ansi": `render()` returns a text; "human": each step prints it.
            options: further arguments of `VectorEnv`: `token`, `opponents`, `episode`, `decisions`, `rules`,
                `reward_function`, `max_invalid_attempts` (default 10; 0: unlimited).
        """
        check_render_mode(render_mode)
        if "client_seats" in options or "games" in options:
            raise ValueError("this environment has one game and one seat: choose it with seat=, or use chefshat.VectorEnv")
        self.render_mode = render_mode
        self.vector = VectorEnv(address, 1, client_seats=[seat], rewards=rewards, **with_limit(invalid, options))
        self._invalid_penalty = invalid_penalty
        sizes = self.vector.sizes
        self.action_space = spaces.Discrete(sizes.num_actions)
        self._form = Form(observation, sizes, self.vector.batch)
        self.observation_space = self._form.space_with_mask
        #: The seat's current situation, in row 0.
        self._now: Batch | Endings = self.vector.batch
        self._mask = np.zeros(sizes.num_actions, np.int8)
        # Whether an episode has begun, and whether a step has been taken in it.
        self._running = False
        self._stepped = False

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Starts the next episode. The last seed given determines the games and the opponents' random choices.

        Args:
            seed: begins the sequence of games of this seed; None: it continues.
            options: `{"new_game": True}`: the episode begins a game.
        """
        check_open(self.vector)
        super().reset(seed=seed)
        if seed is not None:
            self.vector.reset(seed)
        elif (self._running and self._stepped) or (options or {}).get("new_game"):
            self.vector.reset(games=[0])
        wait_for_a_row(self.vector)
        self._running = True
        self._stepped = False
        self._now = self.vector.batch
        if self.render_mode == "human":
            self.render()
        observed, _, info = self._read(self.vector.batch)
        return observed, info

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:  # noqa: ANN401 - As Gymnasium has it.
        """Takes the open decision. Returns the observation at the seat's next decision, or at the end of the episode."""
        check_open(self.vector)
        if not self._running:
            raise gymnasium.error.ResetNeeded("there is no running episode: call reset()")
        batch, penalty = take(self.vector, action, self._invalid_penalty)
        self._stepped = True
        if not batch.ended:
            self._now = batch
            observed, reward, info = self._read(batch)
            terminated = truncated = False
        else:
            # The seat had no decision in further ones.
            self._running = False
            observed, reward, info = self._read(batch, ended=True)
            self._now = endings = batch.endings
            truncated = bool(endings.truncated[0])
            terminated = not truncated
            info["place"] = int(endings.places_taken[0])
        if self.render_mode == "human":
            self.render()
        return observed, reward - penalty, terminated, truncated, info

    def action_masks(self) -> NDArray[np.bool_]:
        """Returns whether each of the A actions is legal now."""
        return self._mask.astype(np.bool_)

    def render(self) -> str | None:
        """Formats the seat's situation as text: returned with "ansi", printed with "human"."""
        if not can_render(self.render_mode):
            return None
        text = as_text(self._now, 0, self.vector.action_texts)
        if self.render_mode == "ansi":
            return text
        print(text)
        return None

    def close(self) -> None:
        """Ends the game."""
        self.vector.close()

    def _read(self, batch: Batch, *, ended: bool = False) -> tuple[Any, float, dict[str, Any]]:
        """Returns the observation, the reward and the info at the open decision, or at the end of the episode."""
        observation, mask, reward, _, kind, attempts = self._form.first(batch, ended=ended)
        self._mask = mask
        if self._form.has_parts:
            observation["action_mask"] = mask.copy()
        return observation, reward, {"action_mask": mask.copy(), "kind": kind, "invalid_attempts": attempts}
