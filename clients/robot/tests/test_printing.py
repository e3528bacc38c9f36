"""Every printed page is rasterised and decoded again."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest

from chefshat_robot import charuco, field
from chefshat_robot.cli import main
from chefshat_robot.deck import DECKS, FIELD_TAGS, HAND_TAGS, Piece, PieceKind, piece_of_tag
from chefshat_robot.field import CARD_HEIGHT, CARD_TAG_CENTRE, CARD_TAG_SIZE, CARD_WIDTH
from chefshat_robot.printing.canvas import ASSETS, PAPERS
from chefshat_robot.printing.command import SECTIONS, print_game
from chefshat_robot.printing.surfaces import FIELD, HAND
from chefshat_robot.printing.tiles import FLAP, TOP, Tiling

from .pages import MM, Page, Tag, pages_of

SIZES = {"a4": (210.0, 297.0), "letter": (215.9, 279.4)}
PIECES = {"cards": (PieceKind.CARD, 68), "roles": (PieceKind.ROLE, 6), "passes": (PieceKind.PASS, 6)}


@pytest.fixture(scope="module", params=[pytest.param(name, marks=[] if name == "a4" else pytest.mark.slow) for name in PAPERS])
def paper(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def printed(paper: str, tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[Page]]:
    """The pages of each part, with backs."""
    folder = tmp_path_factory.mktemp("printed")
    return {part: pages_of(print_game(PAPERS[paper], 3, [part], backs=True), folder) for part in SECTIONS}


def close(tag: Tag, number: int, x: float, y: float, angle: float, size: float) -> bool:
    """Whether a tag was found where it should be, to 0.15 mm and a degree."""
    turned = (tag.angle - angle + 180) % 360 - 180
    return tag.number == number and np.hypot(tag.x - x, tag.y - y) < 0.15 and abs(turned) < 1 and abs(tag.size - size) < 0.15


def check_pieces(pages: Sequence[Page], size: tuple[float, float], pieces: Sequence[Piece]) -> None:
    """Checks the tags and QR codes of sheets with nine pieces each."""
    left, top = (size[0] - 3 * CARD_WIDTH) / 2, (size[1] - 3 * CARD_HEIGHT) / 2
    assert len(pages) == -(-len(pieces) // 9)
    for number, page in enumerate(pages):
        sheet = pieces[9 * number : 9 * number + 9]
        tags, codes = page.tags(), page.qr_codes()
        assert set(codes) == {piece.qr_text for piece in sheet}
        assert len(tags) == 2 * len(sheet)
        for slot, piece in enumerate(sheet):
            x, y = left + slot % 3 * CARD_WIDTH, top + slot // 3 * CARD_HEIGHT
            upper, lower = tags[2 * slot : 2 * slot + 2]
            inset_x, inset_y = CARD_TAG_CENTRE
            assert close(upper, piece.tag, x + inset_x, y + inset_y, 0, CARD_TAG_SIZE), upper
            assert close(lower, piece.tag, x + CARD_WIDTH - inset_x, y + CARD_HEIGHT - inset_y, 180, CARD_TAG_SIZE), lower
            assert piece_of_tag(upper.number) == piece
            code_x, code_y = codes[piece.qr_text]
            assert np.hypot(code_x - x - 11.0, code_y - y - 77.0) < 0.5


@pytest.mark.parametrize("part", PIECES)
def test_every_piece_is_read_back(printed: dict[str, list[Page]], paper: str, part: str) -> None:
    kind, count = PIECES[part]
    check_pieces(printed[part][0::2], SIZES[paper], [Piece(kind, 3, number) for number in range(count)])


def test_backs_lie_behind_their_cards(printed: dict[str, list[Page]], paper: str) -> None:
    width, height = SIZES[paper]
    left, top = (width - 3 * CARD_WIDTH) / 2, (height - 3 * CARD_HEIGHT) / 2
    backs = printed["cards"][1::2]
    for number, page in enumerate(backs):
        assert page.tags() == []
        assert page.qr_codes() == {}
        cards = min(9, 68 - 9 * number)
        # Of a sheet turned over on its long edge, the left column is the right one.
        expected = {(2 - slot % 3, slot // 3) for slot in range(cards)}
        # The bottom of a card shows nothing but the colour of the back.
        found = {
            (column, row)
            for column in range(3)
            for row in range(3)
            if page.colour(left + (column + 0.5) * CARD_WIDTH, top + (row + 1) * CARD_HEIGHT - 3) == (0x1F, 0x5F, 0x5B)
        }
        assert found == expected


def assembled(pages: Sequence[Page], tiling: Tiling) -> Page:
    """The sheets of a tiling cut and glued together: its part of each page, without flaps."""
    width, height = tiling.tile
    size = (round(tiling.width * MM), round(tiling.height * MM))
    whole = np.full((size[1], size[0], 3), 255, dtype=np.uint8)
    for number, page in enumerate(pages):
        row, column = divmod(number, tiling.columns)
        # A whole pixel of the result is a part of a pixel of the page.
        left, top = column * width, row * height
        page_left = (page.size[0] - width - FLAP) / 2
        scale_x, scale_y = MM / page.pixels_per_mm
        shift = np.array([[scale_x, 0.0, (left - page_left) * MM], [0.0, scale_y, (top - TOP) * MM]])
        moved = cv2.warpAffine(page.image, shift, size)
        x, y = slice(round(left * MM), round((left + width) * MM)), slice(round(top * MM), round((top + height) * MM))
        whole[y, x] = moved[y, x]
    return Page(whole, (tiling.width, tiling.height))


def test_the_sheets_of_the_field_make_the_field(printed: dict[str, list[Page]]) -> None:
    pages = printed["field"]
    assert len(pages) == 6
    whole = assembled(pages, FIELD)
    tags = whole.tags()
    assert len(tags) == 4
    for number, (tag, (x, y)) in enumerate(zip(tags, field.corner_tags(), strict=True)):
        assert close(tag, FIELD_TAGS + number, x, y, 0, field.FIELD_TAG_SIZE), tag
    for place in field.places() + field.pass_places():
        drawn, inside = outline(whole, place, 0.0), outline(whole, place, -1.5)
        # The outline is dashed.
        assert 0.4 < drawn < 0.9, (place, drawn)
        assert inside < 0.1, (place, inside)


def outline(page: Page, place: field.Place, wider: float) -> float:
    """The part of a place's outline that is drawn; of an outline `wider` mm further out."""
    width, height = extent(place)
    half_x, half_y = width / 2 + wider, height / 2 + wider
    # Without the rounded corners.
    along_x, along_y = np.arange(-half_x + 6, half_x - 6, 0.2), np.arange(-half_y + 6, half_y - 6, 0.2)
    points = [(x, side * half_y) for x in along_x for side in (-1, 1)] + [(side * half_x, y) for y in along_y for side in (-1, 1)]
    return float(np.mean([sum(page.colour(place.x + x, place.y + y)) < 640 for x, y in points]))


def test_the_sheets_of_the_hand_strip_make_the_strip(printed: dict[str, list[Page]]) -> None:
    pages = printed["hand"]
    assert len(pages) == 2
    tags = assembled(pages, HAND).tags()
    assert len(tags) == 4
    for number, (tag, (x, y)) in enumerate(zip(tags, field.hand_tags(), strict=True)):
        assert close(tag, HAND_TAGS + number, x, y, 0, CARD_TAG_SIZE), tag


def test_cards_cover_neither_each_other_nor_codes() -> None:
    """The geometry that is printed: places apart from each other, the tags of a hand's cards to be seen."""
    boxes = [(place.x, place.y, *extent(place)) for place in field.places() + field.pass_places()]
    tag = field.FIELD_TAG_SIZE * 10 / 8
    boxes += [(x, y, tag, tag) for x, y in field.corner_tags()]
    for number, (x, y, width, height) in enumerate(boxes):
        assert width / 2 <= x <= field.WIDTH - width / 2
        assert height / 2 <= y <= field.HEIGHT - height / 2
        for other_x, other_y, other_width, other_height in boxes[:number]:
            gap = max(abs(x - other_x) - (width + other_width) / 2, abs(y - other_y) - (height + other_height) / 2)
            assert gap >= 3, (x, y, other_x, other_y)
    hand = field.hand_places()
    assert len(hand) == field.HAND_CARDS
    quiet = CARD_TAG_CENTRE[0] + CARD_TAG_SIZE * 5 / 8
    for place, following in pairwise(hand):
        assert following.x - place.x >= quiet
    (left, _), (right, _), _, _ = field.hand_tags()
    assert hand[0].x - CARD_WIDTH / 2 >= left + CARD_TAG_SIZE * 5 / 8
    assert hand[-1].x + CARD_WIDTH / 2 <= right - CARD_TAG_SIZE * 5 / 8


def extent(place: field.Place) -> tuple[float, float]:
    """Width and height of a card on a place, in mm."""
    return (CARD_WIDTH, CARD_HEIGHT) if place.angle == 0 else (CARD_HEIGHT, CARD_WIDTH)


def test_the_calibration_sheet_is_the_board_of_the_calibration(printed: dict[str, list[Page]]) -> None:
    (page,) = printed["calibration"]
    corners, numbers, _, markers = cv2.aruco.CharucoDetector(charuco.board()).detectBoard(page.grey)
    assert np.ravel(numbers).tolist() == list(range((charuco.COLUMNS - 1) * (charuco.ROWS - 1)))
    assert sorted(np.ravel(markers).tolist()) == list(range(35))
    found = page.points(corners)
    expected = np.asarray(charuco.board().getChessboardCorners())[:, :2] + [(page.size[0] - 260) / 2, 6.5]
    assert np.abs(found - expected).max() < 0.1
    assert page.tags() == []


def test_pages_have_the_size_of_the_paper(printed: dict[str, list[Page]], paper: str) -> None:
    for part, pages in printed.items():
        for page in pages:
            size = page.size if page.size[0] < page.size[1] else page.size[::-1]
            assert np.allclose(size, SIZES[paper], atol=0.1), part


def test_nothing_lies_within_the_margins(printed: dict[str, list[Page]]) -> None:
    for part, pages in printed.items():
        for number, page in enumerate(pages):
            outside = np.ones(page.grey.shape, dtype=bool)
            edge = int(5 * MM)
            outside[edge:-edge, edge:-edge] = False
            assert (page.grey[outside] == 255).all(), (part, number)
            assert (page.grey[~outside] < 255).any(), (part, number)


def test_tags_have_a_quiet_zone_of_a_module(printed: dict[str, list[Page]]) -> None:
    checked = 0
    for page in [page for pages in printed.values() for page in pages]:
        for tag in page.tags():
            # The last pixel of the tag itself may be grey.
            inner, outer = tag.size / 2 + 0.25, tag.size * 5 / 8
            (left, top), (right, bottom) = ((np.array([tag.x, tag.y]) + side * outer) * page.pixels_per_mm for side in (-1, 1))
            around = page.grey[round(top) : round(bottom), round(left) : round(right)].copy()
            edge = round((outer - inner) * MM)
            around[edge:-edge, edge:-edge] = 255
            assert (around == 255).all(), tag
            checked += 1
    assert checked == 2 * (68 + 6 + 6) + 4 + 4


def test_decks_are_told_apart(tmp_path: Path) -> None:
    for deck in range(DECKS):
        (page,) = pages_of(print_game(PAPERS["a4"], deck, ["passes"]), tmp_path)
        assert {piece_of_tag(tag.number) for tag in page.tags()} == {Piece(PieceKind.PASS, deck, seat) for seat in range(6)}
        assert set(page.qr_codes()) == {f"CHEFSHAT/1/{deck}/P{seat}" for seat in range(6)}


def test_the_drawings_are_those_of_the_project() -> None:
    for copy in ASSETS.iterdir():
        folder = "symbols" if copy.suffix == ".svg" else "font"
        original = Path(__file__).parents[3] / "server/assets" / folder / copy.name
        assert copy.read_bytes() == original.read_bytes(), copy.name


def test_the_command_writes_the_parts_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "roles.pdf"
    assert main(["print", "--only", "passes,roles", "--paper", "letter", "--backs", "--out", str(file)]) == 0
    assert f"{file}: 4 pages" in capsys.readouterr().out
    assert file.read_bytes().startswith(b"%PDF")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--paper", "a3"], "invalid choice: 'a3'"),
        (["--deck", "7"], "invalid choice: 7"),
        (["--only", "cards,dice"], "'dice' is not one of cards,"),
        (["--only", ""], "'' is not one of cards,"),
    ],
)
def test_wrong_arguments_are_explained(arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as exit_info:
        main(["print", *arguments])
    assert exit_info.value.code == 2
    assert message in capsys.readouterr().err


def test_a_file_that_cannot_be_written_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["print", "--only", "roles", "--out", str(tmp_path / "no" / "roles.pdf")]) == 1
    assert f"No such file or directory: '{tmp_path / 'no' / 'roles.pdf'}'" in capsys.readouterr().err


def test_the_commands_of_the_book_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    page = (Path(__file__).parents[3] / "docs/robot-print.md").read_text()
    lines = [line for line in page.splitlines() if line.startswith("chefshat-robot print ")]
    assert len(lines) == 3
    for line in lines:
        assert main(shlex.split(line, comments=True)[1:]) == 0
    assert len(list(tmp_path.glob("*.pdf"))) == 3


def test_the_book_counts_the_sheets(printed: dict[str, list[Page]]) -> None:
    page = (Path(__file__).parents[3] / "docs/robot-print.md").read_text()
    for part, pages in printed.items():
        sheets = len(pages) // 2 if part in PIECES else len(pages)
        assert f"| `{part}` | {sheets} |" in page
