"""The options of a `VectorEnv`, and the first request of its stream. The stream is in `vector`."""

import operator
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias, TypedDict, cast

import numpy as np

from chefshat import pb

if TYPE_CHECKING:
    from chefshat.opponents import Policy

Rules: TypeAlias = "pb.RuleSet | str | Mapping[str, Any] | None"
"""A rule set: the message, the name of a preset, or the message's fields. Enum values have short names: `opening="golden"`."""

Opponent: TypeAlias = str | PathLike[str] | bytes
"""A built-in agent by its name, or a network file: a path or a name that ends with .safetensors, or its content."""

Seed: TypeAlias = "int | Sequence[bytes] | None"
"""The seed of the deals: a base seed, 0..2**64-1, from which every game's seed is derived; or the games' seeds, 32 bytes each, used
in turn; None: random."""

NETWORK_SUFFIX = ".safetensors"
MAX_NETWORK_BYTES = 64 << 20
_SEED_BYTES = 32
_MAX_BASE_SEED = 2**64 - 1
# More would only wait for each other; each takes memory of its own.
_MAX_THREADS = 256


class Seeded(Protocol):
    """A request with the fields of a seed."""

    base_seed: int

    @property
    def game_seeds(self) -> pb.GameSeeds:
        """The games' seeds."""


class GameOptions(TypedDict, total=False):
    """The options of games in every kind of environment, all optional.

    Attributes:
        opponents: who plays the other seats: one for each, in the order of the seats, or one for all; default: "random". The name
            of a built-in agent; a network file (a path, a name that ends with .safetensors, or the content as bytes), which plays
            as fast as "trained"; or a function from a batch to the action of each row, see `Policy`. Functions decide within the
            same step: each is asked for all rows of its seats that wait, until only the client's are left. Its seats count for the
            server's limits as the client's. OPPONENT_FAILED says what it did wrong.
        episode: "shift" (default) or "game".
        decisions: "all" (default), or "turns": only the first T actions.
        other_decisions: with "turns": the built-in agent that takes the other decisions; default: the default action is taken.
        skip_forced: whether decisions with one legal action are taken without asking.
        max_invalid_attempts: with "ask_again": invalid attempts after which the default action is taken; 0 (default): unlimited.
        total_games: total number of games; 0 (default): unlimited.
        seed: a base seed, the games' seeds, or None (default) for random ones. See `Seed`.
        rules: the rule set; see `Rules`.
        hands: the hands each game begins with, instead of a deal.
        starts: the start of each game, used in turn like seeds: pairs of hands and the actions of all seats that were taken from
            there, for instance `[(hands, [17, 199]), (hands, [])]`. The actions do not end the Shift.
        branch: the point of a recorded game that each game continues from.
        shift_statistics: whether batches have `shifts`.
        records: whether batches have the `records` of games that have ended.
        history: K, the width of the column `observations.history`: the latest actions of the Shift; 0 (default): there is none.
        all_hands: whether batches have `all_hands`, the hands of all seats: for a critic that sees more than the actor, or for
            analysis.
    """

    opponents: "Opponent | Policy | Sequence[Opponent | Policy]"
    episode: str
    decisions: str
    other_decisions: str | None
    skip_forced: bool
    max_invalid_attempts: int
    total_games: int
    seed: Seed
    rules: Rules
    hands: pb.ScriptedShift | None
    starts: Sequence[tuple[pb.ScriptedShift, Sequence[int]]] | None
    branch: pb.BranchPoint | None
    shift_statistics: bool
    records: bool
    history: int
    all_hands: bool


class VectorOptions(GameOptions, total=False):
    """The options of a `VectorEnv`: those of `GameOptions`, and further ones, all optional.

    Attributes:
        client_seats: the seats played by the client; default: all, with no `opponents`.
        rewards: "validity", "paper", "paper_intended", "winning" or "points"; default: all rewards are 0.
        invalid: effect of an illegal action: "error" (default): `step` raises ILLEGAL_ACTION and takes none of the actions;
            "ask_again" counts it, rewards it and asks again.
    """

    client_seats: Sequence[int] | None
    rewards: str | None
    invalid: str


def vector_setup(games: int, options: VectorOptions) -> pb.VectorSetup:
    """Builds the request. Raises ValueError or TypeError for options it cannot express; the server checks the rest."""
    unknown = options.keys() - VectorOptions.__annotations__.keys()
    if unknown:
        raise TypeError(f"unknown options: {', '.join(sorted(unknown))}; known are {', '.join(VectorOptions.__annotations__)}")
    branch, hands, rules = options.get("branch"), options.get("hands"), options.get("rules")
    client_seats, opponents = options.get("client_seats"), options.get("opponents", "random")
    decisions, rewards = options.get("decisions", "all"), options.get("rewards")
    if branch is not None and hands is not None:
        raise ValueError("a game begins from a record (branch) or with given hands (hands), not both")
    starts = options.get("starts")
    if starts is not None and (branch is not None or hands is not None):
        raise ValueError("starts excludes branch and hands: each of them says how games begin")
    if hands is not None and not isinstance(hands, pb.ScriptedShift | dict):
        raise TypeError(f"hands is a pb.ScriptedShift or a dict of its fields (docs/branching.md), not {type(hands).__name__}")
    if branch is not None and rules is not None:
        raise ValueError("a game that continues a record (branch) has the record's rules: leave rules out")
    if options.get("other_decisions") is not None and decisions != "turns":
        raise ValueError('other_decisions is the agent for decisions other than turns: it needs decisions="turns"')
    setup = pb.VectorSetup(
        games=games,
        client_seats=() if client_seats is None else client_seats,
        episode=choice("episode", options.get("episode", "shift"), pb.EpisodeScope, "EPISODE_SCOPE_"),
        decisions=choice("decisions", decisions, pb.DecisionScope, "DECISION_SCOPE_"),
        other_decisions=options.get("other_decisions") or "",
        skip_forced=options.get("skip_forced", False),
        invalid_actions=choice("invalid", options.get("invalid", "error"), pb.InvalidActionRule, "INVALID_ACTION_RULE_"),
        max_invalid_attempts=options.get("max_invalid_attempts", 0),
        total_games=options.get("total_games", 0),
        scripted=hands,
        branch=branch,
        shift_statistics=options.get("shift_statistics", False),
        records=options.get("records", False),
        history=options.get("history", 0),
        all_hands=options.get("all_hands", False),
        # A branch has the record's rules.
        rules=None if branch is not None else rule_set(rules),
    )
    # Functions are not part of the setup.
    _put_opponents(setup, cast("Opponent | Sequence[Opponent]", opponents))
    if client_seats is not None and len(client_seats) == 0:
        raise ValueError("client_seats is empty: name at least one seat, or leave it out to play all")
    if starts is not None:
        setup.listed.SetInParent()
        for given, actions in starts:
            setup.listed.starts.add(hands=given, actions=np.asarray(actions, "<u2").tobytes())
    if rewards is not None:
        setup.reward_scheme = choice("rewards", rewards, pb.RewardScheme, "REWARD_SCHEME_")
    put_seed(setup, options.get("seed"))
    return setup


def is_network_file(agent: str | PathLike[str]) -> bool:
    """Returns whether this names a network file, and not a built-in agent. Raises TypeError if it is no name."""
    if not isinstance(agent, str | PathLike):
        raise TypeError(f"an agent is the name of a built-in one or the path of a network file, not a {type(agent).__name__}")
    return isinstance(agent, PathLike) or agent.endswith(NETWORK_SUFFIX)


def network_content(file: str | PathLike[str]) -> bytes:
    """Returns the content of a network file. Raises ValueError if it is too large for one: files of other kinds may be huge."""
    path = Path(file)
    if path.stat().st_size > MAX_NETWORK_BYTES:
        raise ValueError(f"{path} is larger than {MAX_NETWORK_BYTES >> 20} MiB, which no network for this game needs")
    return path.read_bytes()


def _put_opponents(setup: pb.VectorSetup, opponents: Opponent | Sequence[Opponent]) -> None:
    """Sets the opponents of a request, with the network files among them, each once."""
    numbers: dict[bytes, int] = {}
    for opponent in [opponents] if isinstance(opponents, (str, bytes, PathLike)) else opponents:
        if isinstance(opponent, bytes):
            name, content = "", opponent
        elif is_network_file(opponent):
            name, content = Path(opponent).name, network_content(opponent)
        else:
            setup.opponents.append(str(opponent))
            continue
        if content not in numbers:
            numbers[content] = len(numbers)
            setup.networks.add(name=name, content=content)
        setup.opponents.append(f"network:{numbers[content]}")


def rule_set(rules: Rules) -> pb.RuleSet:
    """Converts a rule set to a message."""
    if rules is None:
        return pb.RuleSet()
    if isinstance(rules, str):
        return pb.RuleSet(preset=rules)
    if isinstance(rules, pb.RuleSet):
        return rules
    fields = dict(rules)
    for name, enum, prefix in (("opening", pb.Opening, "OPENING_"), ("pass_scope", pb.PassScope, "PASS_SCOPE_")):
        if isinstance(fields.get(name), str):
            fields[name] = choice(name, fields[name].removeprefix(prefix).lower(), enum, prefix)
    try:
        return pb.RuleSet(**fields)
    except (ValueError, TypeError) as error:
        known = ", ".join(field.name for field in pb.RuleSet.DESCRIPTOR.fields)
        raise ValueError(f"rules: {error}; a rule set has the fields {known}") from error


def put_seed(request: Seeded, seed: Seed) -> None:
    """Sets a request's seed, unless it is None."""
    if seed is None:
        return
    if isinstance(seed, (int, np.integer)) and not isinstance(seed, bool):
        if not 0 <= seed <= _MAX_BASE_SEED:
            raise ValueError(f"a base seed is 0..={_MAX_BASE_SEED}, not {seed}")
        request.base_seed = int(seed)
        return
    if isinstance(seed, (str, bytes, bool)) or not isinstance(seed, Sequence):
        raise TypeError("a seed is a number, or a list of the games' seeds of 32 bytes each")
    if not seed:
        raise ValueError("give one seed or more; later games reuse them in turn")
    for number, one in enumerate(seed):
        if not isinstance(one, bytes) or len(one) != _SEED_BYTES:
            raise ValueError(f"seed {number} is not {_SEED_BYTES} bytes")
    request.game_seeds.seeds.extend(seed)


def thread_count(threads: int) -> int:
    """Checks a number of threads, 0 for one for each core."""
    return whole("threads", threads, 0, _MAX_THREADS)


def whole(argument: str, value: int, low: int, high: int) -> int:
    """Returns a whole number as Python's. Raises TypeError if it is none, ValueError if it is not in `low..=high`."""
    try:
        number = operator.index(value)
    except TypeError:
        raise TypeError(f"{argument} is a whole number, not {value!r}") from None
    if not low <= number <= high:
        raise ValueError(f"{argument} is {low}..={high}, not {number}")
    return number


def choice(argument: str, name: str, enum: Any, prefix: str) -> Any:  # noqa: ANN401 - Enums have no type in common.
    """Returns the value of an enum by its short name, for example "ask_again" for INVALID_ACTION_RULE_ASK_AGAIN."""
    known = {full.removeprefix(prefix).lower(): value for full, value in enum.items() if value}
    if name not in known:
        raise ValueError(f"{argument}={name!r}: choose one of {', '.join(map(repr, known))}")
    return known[name]
