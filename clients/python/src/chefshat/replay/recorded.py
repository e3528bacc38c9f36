"""Transitions of games that were recorded: from datasets of `chefshat export`, from records as files, from those a server holds.

Records are not replayed here: the program does that, which knows the rules, when it makes a dataset of them. Reading a dataset's
files is in `tables`.
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
from chefshat.client import Client
from chefshat.columns import Sizes
from chefshat.errors import ChefsHatError
from chefshat.files import write_record
from chefshat.learn import features
from chefshat.local_server import clean_environment, find_binary
from chefshat.replay.tables import Decisions, has_pyarrow, read
from chefshat.transitions import RewardFunction, Transitions

# Players that an error names.
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
    """The transitions of a dataset's games, as a `VectorEnv` would have given them, by game and seat.

    What a seat saw at the end of an episode is not in a dataset: `after` is all zeros there. `truncated` is not known, and false.
    The number of a game counts the games of the dataset. Decisions whose hand nobody knows (imported games) are left out, and the
    last of each seat in an episode that was not played to its end.

    Args:
        path: a folder made by `chefshat export`, or its file decisions.parquet, .jsonl or .csv.
        rewards: the scheme, "validity", "paper", "paper_intended", "winning" or "points"; or a function of them; None: 0.
        episode: "shift" or "game".
        decisions: "all" or "turns".
        invalid_attempts: whether each invalid attempt is a transition to the same decision, as it was when it was made.
        agents: names of the players whose decisions are wanted; None: all.

    Raises:
        FileNotFoundError: there is no dataset.
        ImportError: it is a Parquet file, and pyarrow is not installed.
        ValueError: it is no dataset, its games differ in players or decks, an argument is none of its names, or one of `agents` did
            not play.
    """
    if isinstance(rewards, str) and rewards not in SCHEMES:
        raise ValueError(
            f"rewards={rewards!r}: choose one of {', '.join(map(repr, SCHEMES))}, or give a function of the transitions"
        )
    for argument, value, known in (("episode", episode, ("shift", "game")), ("decisions", decisions, ("all", "turns"))):
        if value not in known:
            raise ValueError(f"{argument}={value!r}: choose one of {', '.join(map(repr, known))}")
    table = read(Path(path))
    _check_agents(table, agents)
    sizes = _sizes(table)
    scheme = rewards if isinstance(rewards, str) else ""
    steps = _steps(table, by_game=episode == "game", turns_only=decisions == "turns", agents=agents)
    columns = _columns(table, sizes, steps, scheme, by_game=episode == "game")
    if invalid_attempts:
        columns = _with_attempts(table, steps, scheme, columns)
    transitions = Transitions.unflatten(sizes, columns)
    if callable(rewards):
        transitions.__dict__["rewards"] = np.asarray(rewards(transitions), np.float32)
    return transitions


def from_records(paths: Path | str | Sequence[Path | str], **options: Any) -> Transitions:  # noqa: ANN401 - See from_dataset.
    """The transitions of recorded games: files GAME-ID.jsonl, or folders of them. `options` are those of `from_dataset`.

    Raises:
        ChefsHatError: there is no chefshat program to replay them (see `find_binary`), or it refuses them: the message says which.
    """
    files = [paths] if isinstance(paths, (str, Path)) else list(paths)
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "dataset"
        form = "parquet" if has_pyarrow() else "jsonl"
        # Not instead of it the address of a server, as elsewhere.
        program = find_binary("replay the records, which is done on this machine, wherever they come from", instead="")
        command = [str(program), "export", *map(str, files), "--out", str(made), "--format", form]
        done = subprocess.run(command, capture_output=True, text=True, env=clean_environment())
        if done.returncode != 0:
            raise ChefsHatError("RECORDS_REFUSED", done.stderr.strip() or f"`chefshat export` failed with {done.returncode}")
        return from_dataset(made, **options)


def from_server(address: str, wanted: pb.RecordFilter | None = None, **options: Any) -> Transitions:  # noqa: ANN401 - See from_dataset.
    """The transitions of the games a server has records of; those a filter lets through if one is given.

    The records are fetched, and replayed by a chefshat program of this machine. `options` are those of `from_dataset`.

    Raises:
        ChefsHatError: there are none, the server refuses, or see `from_records`.
    """
    with tempfile.TemporaryDirectory() as folder, Client(address) as client:
        count = 0
        for summary in client.records(wanted):
            save_record(client.record(summary.game_id), Path(folder) / f"{summary.game_id}.jsonl")
            count += 1
        if count == 0:
            raise ChefsHatError("NO_RECORDS", f"the server at {address} has no such records")
        return from_records(folder, **options)


def save_record(lines: Iterable[pb.RecordLine], path: Path | str) -> None:
    """Writes a record as a file, whole or not at all, as the server keeps them: for instance what `Client.record` gives."""
    write_record(path, lines)


class _Steps(NamedTuple):
    """Which rows of the table become transitions. T of them."""

    # (T,): the row of the decision, and of the seat's next; -1 where the episode ended.
    before: NDArray[np.intp]
    after: NDArray[np.intp]
    # (R,): number of the game each row of the table belongs to.
    games: NDArray[np.intp]


def _check_agents(table: Decisions, agents: Sequence[str] | None) -> None:
    """Refuses names that nobody has who played: a slip would go unnoticed, and there would be nothing to learn from."""
    playing = np.unique(table.texts("agent")).tolist()
    for name in agents or ():
        if name not in playing:
            raise ValueError(f"agents: no player of these games is called {name!r}: choose of {', '.join(playing[:MOST_NAMES])}")


def _sizes(table: Decisions) -> Sizes:
    """The sizes that all games of the table have in common."""
    found = set()
    for text in np.unique(table.texts("rules")).tolist():
        rules = json.loads(text)
        found.add((int(rules["players"]), int(rules["faces"]), int(rules.get("jokers", 0))))
    if len(found) != 1:
        kinds = "; ".join(f"{players} players, {faces} faces, {jokers} jokers" for players, faces, jokers in sorted(found))
        raise ValueError(f"the dataset's games differ ({kinds}): make a dataset of each kind")
    ((players, faces, jokers),) = found
    hand_size = features.dealt(players, faces, jokers)
    return Sizes(players, faces, jokers, hand_size, features.num_actions(faces), features.turn_actions(faces))


def _steps(table: Decisions, *, by_game: bool, turns_only: bool, agents: Sequence[str] | None) -> _Steps:
    """Pairs each decision with the next of the same seat in the same episode."""
    games = np.unique(table.texts("game_id"), return_inverse=True)[1]
    seats = table.numbers("seat", np.intp)
    shifts = table.numbers("shift", np.int64)
    known = table.packed("mask", _sizes(table).mask_bytes)[1]
    rows = np.lexsort((table.numbers("number", np.int64), seats, games))
    if turns_only:
        rows = rows[table.texts("phase")[rows] == "turn"]
    same = (games[rows[1:]] == games[rows[:-1]]) & (seats[rows[1:]] == seats[rows[:-1]])
    if not by_game:
        same &= shifts[rows[1:]] == shifts[rows[:-1]]
    after = np.full(len(rows), -1, np.intp)
    after[:-1][same] = rows[1:][same]
    # Places are known where an episode was played to its end.
    ends = table.numbers("game_place" if by_game else "shift_place", np.uint8)[rows] > 0
    wanted = known[rows] & np.where(after >= 0, known[after], ends)
    if agents is not None:
        wanted &= np.isin(table.texts("agent")[rows], list(agents))
    return _Steps(rows[wanted], after[wanted], games)


def _columns(table: Decisions, sizes: Sizes, steps: _Steps, scheme: str, *, by_game: bool) -> dict[str, NDArray[Any]]:
    """The columns of transitions, by their flat names."""
    before, after, games = steps
    ended = after < 0
    situations: dict[str, NDArray[Any]] = {
        "seats": table.numbers("seat", np.uint8),
        "kinds": np.vectorize(_KINDS.get, otypes=[np.uint8])(table.texts("phase")),
        "mask_bits": table.packed("mask", sizes.mask_bytes)[0],
        "shifts": table.numbers("shift", np.uint32),
        "pizzas": table.numbers("pizza", np.uint32),
        "golden": table.numbers("golden", np.uint8),
        "boards": np.stack([table.numbers(f"board_{part}", np.uint8) for part in ("face", "size", "jokers")], axis=1),
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
        columns[f"after.{name}"][ended] = 0
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


def _with_attempts(table: Decisions, steps: _Steps, scheme: str, columns: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """The same with a transition for every invalid attempt, before that of the decision it was made at.

    Where the attempts were exhausted, the seat decided nothing more: its last attempt leads on, by way of the default decision.
    """
    tried, lengths = table.ragged("invalid_attempts")
    attempts = lengths[steps.before]
    if not attempts.any():
        return columns
    decided = (table.texts("source")[steps.before] != "invalid") | (attempts == 0)
    counts = attempts + decided
    # Each transition is repeated for its attempts. The last of them leads on, the others back to the same decision.
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
    # What is no action of any kind is told apart from all that are by being the largest number there is.
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
