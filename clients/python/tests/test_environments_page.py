"""The tables of docs/environments.md, compared with the numbers that are computed."""

import re
from pathlib import Path

import numpy as np
import pytest
from hand_made import HandMade, hand_made

from chefshat import pb
from chefshat.learn import features

PAGE = Path(__file__).resolve().parents[3] / "docs" / "environments.md"
COLUMNS = ("hands", "golden", "boards", "cards_left", "passed", "places", "roles", "points", "played", "gave", "received", "pizzas")
# What draws rows that differ in every number of a column.
ROWS = 2000


def listed(heading: str) -> dict[range, str]:
    """Returns the second column of the table below a heading, by the indices in the first."""
    text = PAGE.read_text(encoding="utf-8").split(f"## {heading}\n")[1].split("\n## ")[0]
    found = {}
    for first, last, cell in re.findall(r"^\| (\d+)(?:(?: … |, )(\d+))? \| ([^|]+) \|", text, re.MULTILINE):
        found[range(int(first), int(last or first) + 1)] = cell
    return found


def table(case: HandMade) -> features.Floats:
    sizes = case.sizes
    players, faces, hand_size = sizes.players, sizes.faces, sizes.hand_size
    return features.table(case, case.seats, case.kinds, case.mask_bits, players=players, faces=faces, hand_size=hand_size)


@pytest.mark.parametrize("name", [*COLUMNS, "kinds", "masks"])
def test_a_column_determines_the_numbers_of_its_rows(name: str) -> None:
    rows = listed("Observations")
    expected = [index for numbers, columns in rows.items() if f"`{name}`" in columns for index in numbers]
    field = "mask_bits" if name == "masks" else name
    case, other = hand_made(ROWS, seed=1), hand_made(ROWS, seed=2)
    before = table(case)
    setattr(case, field, getattr(other, field))
    assert np.flatnonzero((table(case) != before).any(axis=0)).tolist() == expected


def test_every_index_is_listed_once() -> None:
    for heading, count in (("Observations", features.table_width(4, 11)), ("Actions", features.num_actions(11))):
        assert [index for numbers in listed(heading) for index in numbers] == list(range(count))


def test_the_actions_are_those_of_the_engine() -> None:
    native = pytest.importorskip("chefshat_native")
    texts = native.action_texts(11)
    plays, joker, skip, gifts, gift_joker, special = listed("Actions")
    assert [texts[index] for index in plays] == [f"C{f};Q{q};J{j}" for f in range(1, 12) for q in range(1, f + 1) for j in range(3)]
    assert [texts[index] for index in (*joker, *skip)] == ["C0;Q0;J1", "pass"]
    assert [texts[index] for index in (*gifts, *gift_joker)] == [*(f"give C{face}" for face in range(1, 12)), "give J"]
    assert [texts[index] for index in special] == ["decline", "declare"]


def test_the_roles_are_in_the_order_of_the_page() -> None:
    (cell,) = re.findall(r"6 numbers a seat: none, ([^|]+) \|", PAGE.read_text(encoding="utf-8"))
    names = [name.removeprefix("ROLE_").replace("_", "-").title() for name in pb.Role.keys()[1:]]
    assert cell.split(", ") == names
