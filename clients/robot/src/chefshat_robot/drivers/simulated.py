"""The driver `simulated`: a robot that does nothing but draw what it does. The default, and a stand-in while the real one is away.

With `frames=DIR` it writes a picture for each step: `000001.svg`, `000002.svg` and so on, with `png=true` also as PNG. It takes as
long for its acts as a calm person would; `speed=2` halves the times, `speed=0` takes none.
"""

from __future__ import annotations

import asyncio
from pathlib import Path

from chefshat import pb

from chefshat_robot.drivers import picture
from chefshat_robot.drivers.driver import LOG, Act, CardMove, Done, Driver, Express, Failed, Gaze, Outcome, Pick, Point, Say
from chefshat_robot.layout import Stand
from chefshat_robot.table import TableState

# Seconds at speed 1.
SECONDS_PER_CHARACTER = 0.06
SECONDS_PER_PIECE = 2.0
SECONDS = {Point: 1.0, Gaze: 0.3, Express: 0.8}
# Pictures of one run; beyond that none are written.
MAX_FRAMES = 10_000


class SimulatedDriver(Driver):
    """A robot that draws what it does.

    Attributes:
        acts: what it has done so far.
        frames_written: number of pictures.
    """

    def __init__(self, frames: Path | None = None, png: bool = False, speed: float = 1.0, clumsy: bool = False) -> None:
        """Configures the robot.

        Args:
            frames: folder for pictures, created if needed; None: none are drawn.
            png: whether to write the pictures as PNG, too. Needs the extra `frames`.
            speed: how fast it is; 0: it takes no time.
            clumsy: drops every card, to try what happens then.
        """
        super().__init__()
        self.acts: list[Act] = []
        self.frames_written = 0
        self._frames = frames
        self._png = png
        self._speed = speed
        self._clumsy = clumsy
        self._scene = picture.Scene()
        self._shift = 0

    async def connect(self) -> None:
        """Creates the folder. Raises OSError if that fails, and RobotError if pictures cannot be rendered."""
        if self._frames is not None:
            self._frames.mkdir(parents=True, exist_ok=True)
            await self._draw()

    async def perform(self, act: Act) -> Outcome:
        """Draws the act and takes its time."""
        self.acts.append(act)
        scene = self._scene
        match act:
            case Say(text):
                LOG.info("the robot says: %s", text)
                scene.speech = text
                await self._step(SECONDS_PER_CHARACTER * len(text))
                scene.speech = ""
            case Gaze(x, y):
                scene.gaze = (x, y)
                await self._step(SECONDS[Gaze])
            case Point(x, y):
                scene.hand, scene.pointing, scene.gaze = (x, y), True, (x, y)
                await self._step(SECONDS[Point])
                scene.hand, scene.pointing = None, False
            case Express(label):
                LOG.info("the robot shows %s", label)
                scene.mood = act
                await self._step(SECONDS[Express])
            case Pick(moves):
                LOG.info("the robot carries %s", ", ".join(move.piece for move in moves))
                return await self._carry(moves)
        return Done()

    async def show_event(self, event: pb.GameEvent) -> None:
        """Does nothing: the state has all that is drawn."""

    async def show_state(self, state: TableState) -> None:
        """Draws the table after an event."""
        scene = self._scene
        before, scene.state = scene.state, state
        if state.seat is not None and state.players:
            if scene.stand is None:
                scene.stand = Stand.at(state.seat, state.players)
            if state.shift != self._shift:
                scene.stand.fill(state.hand, state.golden)
                self._shift = state.shift
            elif state.hand != before.hand:
                scene.stand.settle(state.hand, state.golden)
        if (state.board_face, state.board_size, state.passed, state.shift, state.hand) != (
            before.board_face, before.board_size, before.passed, before.shift, before.hand,
        ):  # fmt: skip
            scene.moved.clear()
            await self._draw()

    async def close(self) -> None:
        """Does nothing."""

    async def _carry(self, moves: tuple[CardMove, ...]) -> Outcome:
        scene = self._scene
        try:
            for move in moves:
                if move.start is not None:
                    scene.hand = scene.gaze = (move.start.x, move.start.y)
                    await self._step(SECONDS_PER_PIECE / 2)
                if self._clumsy:
                    return Failed("the gripper dropped the card")
                self._lift(move.piece)
                scene.hand = scene.gaze = (move.end.x, move.end.y)
                scene.carried = move.piece
                await self._step(SECONDS_PER_PIECE / 2)
                scene.carried = None
                scene.moved.append(move)
        finally:
            scene.hand, scene.carried = None, None
        return Done()

    def _lift(self, piece: str) -> None:
        stand = self._scene.stand
        if stand is not None and piece in stand.slots:
            stand.slots[stand.slots.index(piece)] = None

    async def _step(self, seconds: float) -> None:
        """Draws the scene, and waits."""
        await self._draw()
        await asyncio.sleep(seconds / self._speed if self._speed > 0 else 0)

    async def _draw(self) -> None:
        if self._frames is None or self.frames_written >= MAX_FRAMES:
            return
        self.frames_written += 1
        path = self._frames / f"{self.frames_written:06}.svg"
        svg = picture.draw(self._scene)
        path.write_text(svg, encoding="utf-8")
        if self._png:
            path.with_suffix(".png").write_bytes(await asyncio.to_thread(picture.to_png, svg))
