"""The setup of a `VectorEnv`: how its arguments become the first request of the stream.

The stream itself is not here (see `vector`).
"""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol, TypeAlias

import numpy as np

from chefshat import pb

Rules: TypeAlias = "pb.RuleSet | str | Mapping[str, Any] | None"
"""A rule set: the message, the name of a preset, or the message's fields. Short names of values will do: `opening="golden"`."""

Seed: TypeAlias = "int | Sequence[bytes] | None"
"""Where deals come from: a base seed, 0..2**64-1, from which every game's seed is drawn; or the games' own seeds, 32 bytes each,
taken in turn; None: chance."""

_SEED_BYTES = 32
_MAX_SEEDS = 16384
_MAX_BASE_SEED = 2**64 - 1


class Seeded(Protocol):
    """A request with the fields of a seed."""

    base_seed: int

    @property
    def game_seeds(self) -> pb.GameSeeds:
        """The games' own seeds."""


def vector_setup(
    *,
    games: int,
    client_seats: Sequence[int] | None,
    opponents: str | Sequence[str],
    rewards: str | None,
    episode: str,
    decisions: str,
    other_decisions: str | None,
    skip_forced: bool,
    invalid: str,
    max_invalid_attempts: int,
    total_games: int,
    seed: Seed,
    rules: Rules,
    hands: pb.ScriptedShift | None,
    branch: pb.BranchPoint | None,
    shift_statistics: bool,
    records: bool,
) -> pb.VectorSetup:
    """The request. Raises ValueError or TypeError for what cannot be said in one; the rest is for the server to judge."""
    if branch is not None and hands is not None:
        raise ValueError("a game begins from a record (branch) or with given hands (hands), not with both")
    if branch is not None and rules is not None:
        raise ValueError("a game that goes on from a record (branch) is played by the record's rules: leave rules out")
    if other_decisions is not None and decisions != "turns":
        raise ValueError('other_decisions names who decides what is no turn: it needs decisions="turns"')
    setup = pb.VectorSetup(
        games=games,
        client_seats=() if client_seats is None else client_seats,
        opponents=[opponents] if isinstance(opponents, str) else opponents,
        episode=choice("episode", episode, pb.EpisodeScope, "EPISODE_SCOPE_"),
        decisions=choice("decisions", decisions, pb.DecisionScope, "DECISION_SCOPE_"),
        other_decisions=other_decisions or "",
        skip_forced=skip_forced,
        invalid_actions=choice("invalid", invalid, pb.InvalidActionRule, "INVALID_ACTION_RULE_"),
        max_invalid_attempts=max_invalid_attempts,
        total_games=total_games,
        scripted=hands,
        branch=branch,
        shift_statistics=shift_statistics,
        records=records,
        # With a record's rules none may be named.
        rules=None if branch is not None else rule_set(rules),
    )
    if client_seats is not None and len(client_seats) == 0:
        raise ValueError("client_seats is empty: name at least one seat, or leave it out to play all")
    if rewards is not None:
        setup.reward_scheme = choice("rewards", rewards, pb.RewardScheme, "REWARD_SCHEME_")
    put_seed(setup, seed)
    return setup


def rule_set(rules: Rules) -> pb.RuleSet:
    """The message for a rule set."""
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
    """Sets a request's seed; none if it is None."""
    if seed is None:
        return
    if isinstance(seed, (int, np.integer)) and not isinstance(seed, bool):
        if not 0 <= seed <= _MAX_BASE_SEED:
            raise ValueError(f"a base seed is 0..={_MAX_BASE_SEED}, not {seed}")
        request.base_seed = int(seed)
        return
    if isinstance(seed, (str, bytes, bool)) or not isinstance(seed, Sequence):
        raise TypeError("a seed is a number, or a list of the games' seeds of 32 bytes each")
    if not 1 <= len(seed) <= _MAX_SEEDS:
        raise ValueError(f"1..={_MAX_SEEDS} seeds can be given, not {len(seed)}; later games use them again from the first on")
    for number, one in enumerate(seed):
        if not isinstance(one, bytes) or len(one) != _SEED_BYTES:
            raise ValueError(f"seed {number} is not {_SEED_BYTES} bytes")
    request.game_seeds.seeds.extend(seed)


def choice(argument: str, name: str, enum: Any, prefix: str) -> Any:  # noqa: ANN401 - Enums have no type in common.
    """The value of an enum by its short name, "ask_again" for INVALID_ACTION_RULE_ASK_AGAIN."""
    known = {full.removeprefix(prefix).lower(): value for full, value in enum.items() if value}
    if name not in known:
        raise ValueError(f"{argument}={name!r}: choose one of {', '.join(map(repr, known))}")
    return known[name]
