"""The command `python -m chefshat.agent`: plays one game in a room, or all of its games in a tournament, and prints the standings.

What an agent is stands in `agents`, not here.
"""

import argparse
import importlib
import inspect
import itertools
import json
import os
import sys
from collections.abc import Sequence

import chefshat
from chefshat import pb
from chefshat.agents import Agent, RandomAgent
from chefshat.decision import SeatInfo
from chefshat.errors import ChefsHatError
from chefshat.result import SeatResult

EXAMPLE = """example:
  python -m chefshat.agent --address 127.0.0.1:50051 --code ABCDEF --name Ada --agent random --seed 7
  python -m chefshat.agent --address 127.0.0.1:50051 --code ABCDEF --name Bob --agent my_module:MyAgent
  python -m chefshat.agent --address 127.0.0.1:50051 --tournament ABCDEF --games 8 --name Cleo

exit code: 0 the game or tournament was finished, 1 it was refused, lost, aborted or closed, 2 the arguments are wrong
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command and returns its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m chefshat.agent",
        description="Joins a room of a Chef's Hat server and plays one game, or a tournament to its end; prints the standings.",
        epilog=EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--address", required=True, help="the server, HOST:PORT")
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument("--code", help="the room's join code")
    where.add_argument("--tournament", metavar="CODE", help="the join code of a tournament; every game has an agent of its own")
    parser.add_argument("--name", required=True, help="name to show, 1 to 64 characters")
    parser.add_argument("--agent", default="random", help="'random', or module:Class of an Agent (default: random)")
    parser.add_argument("--seed", type=int, help="seed of the agent's chance; a tournament's games count on from it")
    parser.add_argument("--seat", type=int, help="a certain seat of the room (default: the first free one)")
    parser.add_argument("--games", type=int, help="games of a tournament to play at a time, 1 to 64 (default: 1)")
    parser.add_argument(
        "--stateless", action="store_true", help="say that the agent remembers nothing from game to game (tournaments)"
    )
    parser.add_argument("--json", action="store_true", help="print one line of JSON instead of a table")
    options = parser.parse_args(arguments)
    if options.tournament is None and (options.games is not None or options.stateless):
        parser.error("--games and --stateless are for tournaments: give --tournament CODE in place of --code CODE")
    if options.tournament is not None and options.seat is not None:
        parser.error("--seat is for rooms: in a tournament the seats are drawn")
    if options.games is not None and options.games < 1:
        parser.error("--games: a participant plays at least one game at a time")
    try:
        agent = make_agent(options.agent, options.seed)
    except (ImportError, AttributeError, TypeError, ValueError) as error:
        parser.error(f"--agent {options.agent}: {error}")
    try:
        if options.tournament is not None:
            return play_tournament(options)
        result = chefshat.play(agent, options.address, join_code=options.code, name=options.name, seat=options.seat)
    except ChefsHatError as error:
        if options.json:
            print(json.dumps({"event": "error", "reason": error.reason, "message": error.message, "metadata": error.metadata}))
        else:
            print(f"error: {error}", file=sys.stderr)
        return 1
    print(json.dumps(as_json(result)) if options.json else as_table(result), flush=True)
    return 0 if result.finished else 1


def play_tournament(options: argparse.Namespace) -> int:
    """Takes part in a tournament to its end, and prints how it stands then. Returns the command's exit code."""
    seats = itertools.count(0)

    def make(seat: SeatInfo) -> Agent:
        number = next(seats)
        if sys.stderr.isatty():
            print(f"game {number + 1}: seat {seat.seat} of room {seat.room_id}", file=sys.stderr)
        return make_agent(options.agent, None if options.seed is None else options.seed + number)

    with chefshat.Client(options.address) as client:
        joined = client.join_tournament(options.tournament, options.name, max_games=options.games or 1, stateless=options.stateless)
        played = client.play_tournament(joined.ticket, make)
        results = client.tournament_results(joined.tournament.tournament_id)
    finished = results.tournament.state == pb.TOURNAMENT_STATE_FINISHED
    if options.json:
        print(json.dumps(tournament_as_json(results, joined.participant, played)), flush=True)
    else:
        print(tournament_as_table(results, joined.participant), flush=True)
    return 0 if finished else 1


def make_agent(name: str, seed: int | None) -> Agent:
    """Makes the agent called "random" or "module:Class"; a class whose constructor takes `seed` gets it."""
    if name == "random":
        return RandomAgent(seed)
    module_name, separator, class_name = name.partition(":")
    if not separator:
        raise ValueError("neither 'random' nor module:Class")
    if os.getcwd() not in sys.path:
        sys.path.insert(0, os.getcwd())
    found = getattr(importlib.import_module(module_name), class_name)
    if not (isinstance(found, type) and issubclass(found, Agent)):
        raise TypeError(f"{class_name} is not a subclass of chefshat.Agent")
    takes_seed = "seed" in inspect.signature(found).parameters
    if seed is not None and not takes_seed:
        raise ValueError(f"--seed is given, but {class_name} takes no argument `seed`")
    arguments = {"seed": seed} if takes_seed else {}
    return found(**arguments)


def as_json(result: SeatResult) -> dict[str, object]:
    """The result as plain values."""
    return {
        "event": "finished" if result.finished else "aborted",
        "abort_reason": result.abort_reason,
        "room_id": result.room_id,
        "game_id": result.game_id,
        "seat": result.seat,
        "place": result.place,
        "points": result.points,
        "standings": [{"seat": line.seat, "points": line.points, "place": line.place} for line in result.standings],
        "decisions": result.decisions,
        "invalid": result.invalid,
        "late": result.late,
        "annotations_dropped": result.annotations_dropped,
        "reconnects": result.reconnects,
        "entropy": result.entropy.hex(),
    }


def as_table(result: SeatResult) -> str:
    """The result for people."""
    if not result.finished:
        return f"The game was aborted ({result.abort_reason}) and has no result."
    lines = ["place  seat  points"]
    for line in result.standings:
        mine = "  <- this agent" if line.seat == result.seat else ""
        lines.append(f"{line.place:>5}  {line.seat:>4}  {line.points:>6}{mine}")
    lines.append(f"{result.decisions} decisions, {result.invalid} invalid answers, {result.late} too late")
    return "\n".join(lines)


def tournament_as_json(
    results: pb.GetTournamentResultsResponse, participant: int, played: Sequence[SeatResult]
) -> dict[str, object]:
    """How a tournament ended, and each game that was played in it here, as plain values."""
    finished = results.tournament.state == pb.TOURNAMENT_STATE_FINISHED
    games = [
        {**as_json(result), **({"event": "error", "reason": result.error.reason} if result.error else {})} for result in played
    ]
    return {
        "event": "finished" if finished else "closed",
        "tournament_id": results.tournament.tournament_id,
        "participant": participant,
        "place": next((line.place for line in results.standings if line.participant == participant), None),
        "standings": [
            {"participant": line.participant, "place": line.place, "score": line.score, "points": line.points, "games": line.games}
            for line in results.standings
        ],
        "games": games,
    }


def tournament_as_table(results: pb.GetTournamentResultsResponse, participant: int) -> str:
    """How a tournament ended, for people: scores and points are means of a game, by which the order goes."""
    lines = ["place  score  points  games  name"]
    names = [entrant.name for entrant in results.tournament.participants]
    for line in results.standings:
        mine = "  <- this agent" if line.participant == participant else ""
        games = max(line.games, 1)
        means = f"{line.score / games:>5.2f}  {line.points / games:>6.2f}"
        lines.append(f"{line.place:>5}  {means}  {line.games:>5}  {names[line.participant]}{mine}")
    if results.tournament.state != pb.TOURNAMENT_STATE_FINISHED:
        lines.append("The tournament was closed before its end.")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
