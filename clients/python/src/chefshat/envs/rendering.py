"""Formats a seat's situation as text, for `render` of the environments."""

import gymnasium
import numpy as np

from chefshat import pb
from chefshat.columns import Situations

RENDER_MODES = ("ansi", "human")
# Maximum number of legal actions listed; further ones are counted.
MAX_LISTED = 12


def check_render_mode(render_mode: str | None) -> None:
    """Raises ValueError if it is neither None nor one of `RENDER_MODES`."""
    if render_mode is not None and render_mode not in RENDER_MODES:
        raise ValueError(f'render_mode={render_mode!r}: choose "ansi" or "human", or leave it out')


def can_render(render_mode: str | None) -> bool:
    """Whether an environment was made for `render`. Warns as Gymnasium's and PettingZoo's own do if it was not."""
    if render_mode is None:
        gymnasium.logger.warn('render needs an environment made with render_mode="ansi" or "human"')
    return render_mode is not None


def as_text(situations: Situations, row: int, texts: tuple[str, ...]) -> str:
    """Formats the situation of one row."""
    seen = situations.observations
    faces = situations.sizes.faces
    seat = int(situations.seats[row])
    role = _role(int(seen.roles[row, seat]))
    lines = [
        f"Shift {seen.shifts[row]}, pizza {seen.pizzas[row]}; seat {seat}{f' ({role})' if role else ''} {_asked(situations, row)}"
    ]
    face, size, jokers = seen.boards[row].tolist()
    cards = [str(face)] * (size - jokers) + ["J"] * jokers
    lines.append(f"  board: {' '.join(cards) or 'empty'}")
    held = [str(face) for face in np.repeat(np.arange(1, faces + 1), seen.hands[row, :faces])] + ["J"] * int(seen.hands[row, faces])
    lines.append(f"  hand:  {' '.join(held) or 'empty'}{' (with the Golden card)' if seen.golden[row] else ''}")
    lines.append("  seat  cards  points  place")
    for other in range(situations.sizes.players):
        place = seen.places[row, other] or "-"
        marks = ", ".join(filter(None, [_role(int(seen.roles[row, other])), "passed" if seen.passed[row, other] else ""]))
        numbers = f"{other:>6}  {seen.cards_left[row, other]:>5}  {seen.points[row, other]:>6}  {place:>5}"
        lines.append(f"{numbers}  {marks}".rstrip())
    legal = np.flatnonzero(situations.masks[row]).tolist()
    if legal:
        listed = ", ".join(texts[action] for action in legal[:MAX_LISTED])
        more = f" and {len(legal) - MAX_LISTED} more" if len(legal) > MAX_LISTED else ""
        lines.append(f"  may: {listed}{more}")
    return "\n".join(lines)


def _asked(situations: Situations, row: int) -> str:
    kind = int(situations.kinds[row])
    asked = {
        0: "is at the end of the episode",
        pb.DECISION_KIND_TURN: "takes a turn",
        pb.DECISION_KIND_EXCHANGE: "gives a card",
        pb.DECISION_KIND_SPECIAL_ACTION: "may declare a special action",
    }
    return asked.get(kind, "decides")


def _role(role: int) -> str:
    """Returns the name of a role; empty for none."""
    names = {pb.ROLE_CHEF: "Chef", pb.ROLE_SOUS_CHEF: "Sous-Chef", pb.ROLE_COOK: "Cook"}
    names |= {pb.ROLE_WAITER: "Waiter", pb.ROLE_DISHWASHER: "Dishwasher"}
    return names.get(role, "")  # type: ignore[call-overload, no-any-return]
