"""One seat against built-in agents as a `gymnasium.Env`.

Many games at once are in `gymnasium_vector`, all seats of a game in `chefshat_v1`.
"""

from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from chefshat import pb
from chefshat.columns import Situations
from chefshat.envs.seeing import Form, ObservationFunction
from chefshat.envs.showing import RENDER_MODES, action_texts, as_text, check_render_mode
from chefshat.errors import ChefsHatError
from chefshat.vector import VectorEnv


def wait_for_a_row(vector: VectorEnv, *, or_an_end: bool = False) -> None:
    """Steps until the only game has a decision, or if wanted an ending: its other seats may have left decisions for later.

    Raises:
        ChefsHatError: there is none because the games are over.
    """
    while len(vector.batch) == 0 and not (or_an_end and len(vector.batch.endings) > 0):
        if vector.batch.done:
            raise ChefsHatError("GAMES_OVER", "total_games have been played; leave it out, or reset with a seed")
        vector.step(np.zeros(0, np.uint16))


def check_open(vector: VectorEnv) -> None:
    """Raises Gymnasium's error if the games have been closed."""
    if vector.closed:
        raise gymnasium.error.ClosedEnvironmentError("the environment has been closed: make a new one")


class ChefsHatEnv(gymnasium.Env[Any, Any]):
    """One seat of a game; the other seats are built-in agents of the server.

    An action is the index of one of A actions (standard 214). Which are legal is in `info["action_mask"]`, A numbers of 0 or 1,
    and, where an observation is a dictionary, in it as well; `action_space.sample(info["action_mask"])` draws a legal one. An
    illegal action is an invalid attempt: it is rewarded as the scheme has it (-1 by "validity" and the paper's), and the decision
    is asked again.

    An episode is a Shift, or a game. After a Shift has ended `reset()` goes on with the next Shift of the same game; in the middle
    of an episode, or with a seed, it begins a new game. `terminated` says that the episode ended by the rules, `truncated` that it
    reached the limit of turns and was adjudicated. `info` also has: "kind" (a value of `pb.DecisionKind`), "invalid_attempts" (at
    this decision), and at the end of an episode "place", from 1.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": list(RENDER_MODES), "render_fps": 4}  # type: ignore[misc]

    def __init__(
        self,
        address: str | None = None,
        *,
        seat: int = 0,
        observation: str | ObservationFunction = "classic",
        rewards: str | None = "winning",
        invalid: str = "ask_again",
        render_mode: str | None = None,
        **options: Any,  # noqa: ANN401 - Those of `VectorEnv`.
    ) -> None:
        """Begins a game.

        Args:
            address: the server; None: one of this process's own, which is started if need be.
            seat: the seat that is played here.
            observation: "classic", "table", "columns", or a function of one's own. See `Form`.
            rewards: the scheme; see `VectorEnv`. With "winning", 1 for finishing first, else -0.001 for each turn.
            invalid: what an illegal action does; see `VectorEnv`.
            render_mode: "ansi": `render()` returns a text; "human": it is printed with each step.
            options: what else `VectorEnv` takes: `opponents`, `episode`, `decisions`, `rules`, `reward_function` and so on.
        """
        check_render_mode(render_mode)
        if "client_seats" in options or "games" in options:
            raise ValueError("this environment has one game and one seat: name the seat with seat=, or use chefshat.VectorEnv")
        self.render_mode = render_mode
        self.vector = VectorEnv(address, 1, client_seats=[seat], rewards=rewards, invalid=invalid, **options)
        sizes = self.vector.sizes
        self.action_space = spaces.Discrete(sizes.num_actions)
        self._form = Form(observation, sizes, self.vector.batch)
        self.observation_space = self._form.space_with_mask
        #: What the seat sees now, in row 0.
        self._now: Situations = self.vector.batch
        # Whether an episode has begun, and whether a step has been taken in it.
        self._running = False
        self._stepped = False

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begins the next episode. Games and their opponents' chance follow from the last seed that was given."""
        check_open(self.vector)
        super().reset(seed=seed)
        if seed is not None:
            self.vector.reset(seed)
        elif self._running and self._stepped:
            self.vector.reset()
        wait_for_a_row(self.vector)
        self._running = True
        self._stepped = False
        self._now = self.vector.batch
        if self.render_mode == "human":
            self.render()
        return self._observation(), self._info()

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:  # noqa: ANN401 - As Gymnasium has it.
        """Takes the open decision; returns what the seat sees when it decides next, or at the end of the episode."""
        check_open(self.vector)
        if not self._running:
            raise gymnasium.error.ResetNeeded("the episode is over, or none has begun: call reset()")
        self.vector.step(np.asarray([action]))
        self._stepped = True
        wait_for_a_row(self.vector, or_an_end=True)
        batch = self.vector.batch
        ended = len(batch.endings) > 0
        if ended:
            # In a further one the seat had nothing to decide.
            self._now = batch.endings
            reward, end = batch.endings.rewards[0], batch.endings.ends[0]
            self._running = False
        else:
            self._now = batch
            reward, end = batch.rewards[0], pb.EPISODE_END_UNSPECIFIED
        info = self._info()
        if ended:
            info["place"] = int(batch.endings.places_taken[0])
        if self.render_mode == "human":
            self.render()
        terminated, truncated = bool(end == pb.EPISODE_END_FINISHED), bool(end == pb.EPISODE_END_CUT_SHORT)
        return self._observation(), float(reward), terminated, truncated, info

    def render(self) -> str | None:
        """What the seat sees, as text: returned with "ansi", printed with "human"."""
        if self.render_mode is None:
            gymnasium.logger.warn('there is nothing to render: make the environment with render_mode="ansi" or "human"')
            return None
        text = as_text(self._now, 0, action_texts(self.vector.address, self.vector.faces))
        if self.render_mode == "ansi":
            return text
        print(text)
        return None

    def close(self) -> None:
        """Ends the game."""
        self.vector.close()

    def _observation(self) -> Any:  # noqa: ANN401 - Of the space's kind.
        observed = self._form.row(self._form.of(self._now), 0)
        if self._form.has_parts:
            observed["action_mask"] = self._mask()
        return observed

    def _mask(self) -> NDArray[np.int8]:
        return np.array(self._now.masks[0], np.int8)

    def _info(self) -> dict[str, Any]:
        attempts = int(self.vector.batch.attempts[0]) if self._running else 0
        return {"action_mask": self._mask(), "kind": int(self._now.kinds[0]), "invalid_attempts": attempts}
