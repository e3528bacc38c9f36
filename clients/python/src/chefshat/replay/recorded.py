"""Transitions of recorded games: from datasets of `chefshat export`, from files of records, and from a server's records.

Records are converted to datasets by the program, which knows the rules. Reading a dataset's files is in `tables`.
"""

import json
import subprocess
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chefshat import pb
from chefshat.address import ServerAddress
from chefshat.columns import NO_SEAT, Sizes
from chefshat.errors import ChefsHatError
from chefshat.files import write_record
from chefshat.learn import features
from chefshat.local_server import clean_environment, find_binary
from chefshat.replay.tables import Decisions, has_pyarrow, read
from chefshat.transitions import RewardFunction, Transitions

# Maximum number of players listed in an error.
MOST_NAMES = 20
SCHEMES = ("validity", "paper", "paper_intended", "winning", "points")
_KINDS = {
    "turn": pb.DECISION_KIND_TURN,
    "exchange": pb.DECISION_KIND_EXCHANGE,
    "special_action": pb.DECISION_KIND_SPECIAL_ACTION,
}


def from_dataset(
    path: Path | str,
    *,
    rewards: str | RewardFunction | None = None,
    episode: str = "shift",
    decisions: str = "all",
    invalid_attempts: bool = True,
    agents: Sequence[str] | None = None,
) -> Transitions:
    """Returns the transitions of a dataset's games as from a `VectorEnv`, ordered by game and seat.

    Datasets lack final observations: `after` is all zeros at the end of an episode, and `truncated` is false. Games are numbered in
    the order of the dataset. Decisions with an unknown hand (imported games) are omitted, and so are the last decisions of
    unfinished episodes.

    Args:
        path: a folder made by `chefshat export`, or its file decisions.parquet, .jsonl or .csv.
        rewards: the scheme, "validity", "paper", "paper_intended", "winning" or "points"; or a function; None: 0.
        episode: "shift" or "game".
        decisions: "all" or "turns".
        invalid_attempts: whether each invalid attempt is a transition to the same decision.
        agents: names of the players whose decisions to include; None: all.

    Raises:
        FileNotFoundError: there is no dataset.
        ImportError: it is a Parquet file, and pyarrow is not installed.
        ValueError: it is not a dataset, its games differ in players or decks, an argument is invalid, or one of `agents` did not
            play.
    """
    if isinstance(rewards, str) and rewards not in SCHEMES:
        raise ValueError(f"rewards={rewards!r}: choose one of {', '.join(map(repr, SCHEMES))}, or give a function")
    for argument, value, known in (("episode", episode, ("shift", "game")), ("decisions", decisions, ("all", "turns"))):
        if value not in known:
            raise ValueError(f"{argument}={value!r}: choose one of {', '.join(map(repr, known))}")
    table = read(Path(path))
    _check_agents(table, agents)
    sizes = _sizes(table)
    scheme = rewards if isinstance(rewards, str) else ""
    steps = _steps(table, sizes, by_game=episode == "game", turns_only=decisions == "turns", agents=agents)
    columns = _columns(table, sizes, steps, scheme, by_game=episode == "game")
    if invalid_attempts:
        columns = _with_attempts(table, steps, scheme, columns)
    transitions = Transitions.unflatten(sizes, columns)
    if callable(rewards):
        transitions.__dict__["rewards"] = np.asarray(rewards(transitions), np.float32)
    return transitions


def from_records(paths: Path | str | Sequence[Path | str], **options: Any) -> Transitions:  # noqa: ANN401 - See from_dataset.
    """Returns the transitions of recorded games: files GAME-ID.jsonl, or folders of them. `options` are those of `from_dataset`.

    Raises:
        ChefsHatError: the program chefshat was not found (see `find_binary`), or it refuses a record, which the message names.
    """
    files = [paths] if isinstance(paths, (str, Path)) else list(paths)
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "dataset"
        form = "parquet" if has_pyarrow() else "jsonl"
        # A server's address is no alternative here.
        lab = ". It needs the program chefshat-lab beside it (cargo build --release -p chefshat -p chefshat-lab)"
        program = find_binary("replay the records on this machine", instead=lab)
        command = [str(program), "export", *map(str, files), "--out", str(made), "--format", form]
        done = subprocess.run(command, capture_output=True, text=True, env=clean_environment())
        if done.returncode != 0:
            raise ChefsHatError("RECORDS_REFUSED", done.stderr.strip() or f"`chefshat export` failed with {done.returncode}")
        return from_dataset(made, **options)


def from_server(address: str | ServerAddress, wanted: pb.RecordFilter | None = None, **options: Any) -> Transitions:  # noqa: ANN401 - See from_dataset.
    """Returns the transitions of a server's recorded games, optionally those that match a filter.

    Downloads the records and replays them by the program chefshat on this machine. `options` are those of `from_dataset`.

    Raises:
        ChefsHatError: there are no such records, the server refuses, or see `from_records`.
    """
    from chefshat.client import Client

    with tempfile.TemporaryDirectory() as folder, Client(address) as client:
        count = 0
        for summary in client.records.list(wanted):
            try:
                save_record(client.records.read(summary.game_id), Path(folder) / f"{summary.game_id}.jsonl")
            except ChefsHatError as error:
                # Old games may be deleted while others are downloaded.
                if error.reason != "GAME_UNKNOWN":
                    raise
            else:
                count += 1
        if count == 0:
            raise ChefsHatError("NO_RECORDS", f"the server at {address} has no such records")
        return from_records(folder, **options)


def save_record(lines: Iterable[pb.RecordLine], path: Path | str) -> None:
    """Writes a record, for example from `Client.records.read`, to a file atomically, in the server's format."""
    write_record(path, lines)


class _Steps(NamedTuple):
    """The rows of the table that become T transitions."""

    # (T,): the row of the decision, and of the seat's next; -1 where the episode ended.
    before: NDArray[np.intp]
    after: NDArray[np.intp]
    # (R,): number of the game of each row of the table.
    games: NDArray[np.intp]


def _check_agents(table: Decisions, agents: Sequence[str] | None) -> None:
    """Refuses names of no player: a typo would silently give no transitions."""
    playing = sorted(table.coded("agent")[0]) if agents else []
    for name in agents or ():
        if name not in playing:
            raise ValueError(f"agents: no player of these games is called {name!r}; they are {', '.join(playing[:MOST_NAMES])}")


def _sizes(table: Decisions) -> Sizes:
    """Returns the sizes of all games of the table."""
    found = set()
    for text in table.coded("rules")[0]:
        rules = json.loads(text)
        found.add((int(rules["players"]), int(rules["faces"]), int(rules.get("jokers", 0))))
    if len(found) != 1:
        kinds = "; ".join(f"{players} players, {faces} faces, {jokers} jokers" for players, faces, jokers in sorted(found))
        raise ValueError(f"the dataset's games differ ({kinds}): make a dataset for each")
    ((players, faces, jokers),) = found
    hand_size = features.dealt(players, faces, jokers)
    return Sizes(players, faces, jokers, hand_size, features.num_actions(faces), features.turn_actions(faces))


def _steps(table: Decisions, sizes: Sizes, *, by_game: bool, turns_only: bool, agents: Sequence[str] | None) -> _Steps:
    """Pairs each decision with the next of the same seat in the same episode."""
    _, first_rows, by_code = np.unique(table.coded("game_id")[1], return_index=True, return_inverse=True)
    # The order of the dataset is that of the first rows.
    games = np.argsort(np.argsort(first_rows))[by_code]
    seats = table.numbers("seat", np.intp)
    shifts = table.numbers("shift", np.int64)
    known = table.packed("mask", sizes.mask_bytes)[1]
    rows = np.lexsort((table.numbers("number", np.int64), seats, games))
    if turns_only:
        rows = rows[table.is_in("phase", {"turn"})[rows]]
    same = (games[rows[1:]] == games[rows[:-1]]) & (seats[rows[1:]] == seats[rows[:-1]])
    if not by_game:
        same &= shifts[rows[1:]] == shifts[rows[:-1]]
    after = np.full(len(rows), -1, np.intp)
    after[:-1][same] = rows[1:][same]
    # Finished episodes have places.
    ends = table.numbers("game_place" if by_game else "shift_place", np.uint8)[rows] > 0
    wanted = known[rows] & np.where(after >= 0, known[after], ends)
    if agents is not None:
        wanted &= table.is_in("agent", agents)[rows]
    return _Steps(rows[wanted], after[wanted], games)


def _columns(table: Decisions, sizes: Sizes, steps: _Steps, scheme: str, *, by_game: bool) -> dict[str, NDArray[Any]]:
    """Returns the columns of transitions, by their flat names."""
    before, after, games = steps
    ended = after < 0
    phases, phase_codes = table.coded("phase")
    situations: dict[str, NDArray[Any]] = {
        "seats": table.numbers("seat", np.uint8),
        "kinds": np.array([_KINDS[phase] for phase in phases], np.uint8)[phase_codes],
        "mask_bits": table.packed("mask", sizes.mask_bytes)[0],
        "shifts": table.numbers("shift", np.uint32),
        "pizzas": table.numbers("pizza", np.uint32),
        "golden": table.numbers("golden", np.uint8),
        "boards": np.stack([table.numbers(f"board_{part}", np.uint8) for part in ("face", "size", "jokers")], axis=1),
        "board_owners": _board_owners(table),
        "hands": table.lists("hand", sizes.card_kinds, np.uint8)[0],
        "points": np.minimum(table.lists("points", sizes.players, np.uint64)[0], np.iinfo(np.uint32).max).astype(np.uint32),
    }
    for name in ("cards_left", "passed", "places", "roles"):
        situations[name] = table.lists(name, sizes.players, np.uint8)[0]
    for name in ("played", "gave", "received"):
        situations[name] = table.lists(name, sizes.card_kinds, np.uint8)[0]
    columns: dict[str, NDArray[Any]] = {}
    for name, array in situations.items():
        columns[f"before.{name}"] = array[before]
        columns[f"after.{name}"] = array[after]
        columns[f"after.{name}"][ended] = NO_SEAT if name == "board_owners" else 0
    columns["after.seats"] = columns["before.seats"]
    shifts = table.numbers("shift", np.int64)
    last_shifts = np.zeros(games.max() + 1, np.int64)
    np.maximum.at(last_shifts, games, shifts)
    in_last = shifts[before] == last_shifts[games[before]]
    columns["games"] = games[before].astype(np.uint32)
    columns["attempts"] = table.numbers("invalid_count", np.uint32)[before]
    columns["actions"] = table.numbers("action", np.uint16)[before]
    columns["invalid"] = np.zeros(len(before), np.bool_)
    columns["rewards"] = table.numbers(f"reward_{scheme}", np.float32)[before] if scheme else np.zeros(len(before), np.float32)
    columns["ended"] = ended
    columns["truncated"] = np.zeros(len(before), np.bool_)
    columns["game_over"] = ended & in_last & table.numbers("finished", np.bool_)[before]
    places = table.numbers("game_place" if by_game else "shift_place", np.uint8)[before]
    columns["places_taken"] = np.where(ended, places, 0).astype(np.uint8)
    return columns


def _board_owners(table: Decisions) -> NDArray[np.uint8]:
    """Returns the seat that played the board of each row, NO_SEAT where it is empty or the dataset does not say."""
    if not table.has("board_owner"):
        return np.full(table.rows, NO_SEAT, np.uint8)
    return np.where(table.numbers("board_size", np.uint8) > 0, table.numbers("board_owner", np.uint8), np.uint8(NO_SEAT))


def _with_attempts(table: Decisions, steps: _Steps, scheme: str, columns: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Adds a transition for every invalid attempt, before that of its decision.

    If the attempts were exhausted, the last one leads to the next decision, since the server took the default action.
    """
    tried, lengths = table.ragged("invalid_attempts")
    attempts = lengths[steps.before]
    if not attempts.any():
        return columns
    decided = ~table.is_in("source", {"invalid"})[steps.before] | (attempts == 0)
    counts = attempts + decided
    # Repeats each transition for its attempts. The last one leads to the next decision, the others to the same one.
    source = np.repeat(np.arange(len(counts)), counts)
    last = np.cumsum(counts) - 1
    number = np.arange(len(source)) - np.repeat(last + 1 - counts, counts)
    back = np.ones(len(source), np.bool_)
    back[last] = False
    wrong = np.ones(len(source), np.bool_)
    wrong[last[decided]] = False
    more = {name: array[source] for name, array in columns.items()}
    begins = np.cumsum(lengths) - lengths
    chosen = tried[begins[steps.before[source[wrong]]] + number[wrong]]
    # Clips numbers that are not actions at the largest one.
    more["actions"][wrong] = np.minimum(chosen, np.iinfo(np.uint16).max)
    more["attempts"] = number.astype(np.uint32)
    more["invalid"] = wrong
    if scheme:
        given = table.numbers(f"invalid_reward_{scheme}", np.float32)[steps.before] / np.maximum(attempts, 1)
        more["rewards"][back] = 0
        more["rewards"][wrong] += given[source[wrong]]
    for name in ("ended", "game_over", "places_taken"):
        more[name][back] = 0
    for name in [name for name in more if name.startswith("after.")]:
        more[name][back] = more[name.replace("after.", "before.", 1)][back]
    return more
