"""How a command comes by its place in a room or a tournament, and by the same place again after its process died.

Here are the options that say so, the ticket, and the file that keeps it; also playing, until there is something to print. The
commands are `agent`, `learn.play` and `players_club`; what they print is in `outcome`, how a game is played in `session`.
"""

import argparse
import os
import sys
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

from chefshat import pb
from chefshat.agents import Agent
from chefshat.client import Client
from chefshat.decision import SeatInfo
from chefshat.errors import ChefsHatError
from chefshat.files import secret_file
from chefshat.outcome import Played
from chefshat.participant import MakeAgent

#: Environment variable that a ticket may stand in.
TICKET = "CHEFSHAT_TICKET"


@dataclass(frozen=True)
class WayIn:
    """How one place is come by: with `code`, `tournament` or `ticket`, or with what is in `ticket_file` and nothing else.

    Attributes:
        code: a room's join code.
        tournament: a tournament's join code.
        ticket: the ticket of a place that was taken before.
        ticket_file: keeps the ticket while the place lasts. One that is there already says which place to go on in.
        name: name to show; used when joining.
        seat: a certain seat of the room.
        games: games of the tournament to play at a time.
        stateless: says that the agent remembers nothing from one game of the tournament to the next.
    """

    code: str | None = None
    tournament: str | None = None
    ticket: str | None = None
    ticket_file: Path | None = None
    name: str = ""
    seat: int | None = None
    games: int = 1
    stateless: bool = False


def add_options(parser: argparse.ArgumentParser, *, several_codes: bool = False) -> None:
    """Adds the options that say how a place is come by; all but --name."""
    more = "; several times: rooms played one after the other" if several_codes else ""
    parser.add_argument("--code", action="append" if several_codes else "store", help=f"a room's join code{more}")
    parser.add_argument("--tournament", metavar="CODE", help="the join code of a tournament, to play in it until it is over")
    parser.add_argument(
        "--ticket",
        help="the ticket of a place that was taken before, of a room or a tournament, to go on in it; may also stand in the "
        f"environment variable {TICKET}, which unlike this is in no list of processes",
    )
    parser.add_argument(
        "--ticket-file",
        type=Path,
        metavar="FILE",
        help="keep the ticket in this file, readable by you alone, until the game or tournament is over; if it is there already, "
        "go on in its place, so that the same command goes on after its process died",
    )
    parser.add_argument("--seat", type=int, help="a certain seat of the room (the first free one unless given)")
    parser.add_argument(
        "--games", type=int, help="games of a tournament to play at a time, 1 to 64 (1 unless given); with a ticket as before"
    )
    parser.add_argument(
        "--stateless", action="store_true", help="say that the agent remembers nothing from game to game (tournaments)"
    )


def ways(parser: argparse.ArgumentParser, options: argparse.Namespace, *, needs_name: bool = True) -> list[WayIn]:
    """The places that the options name. Ends the process with 2, as the parser does, where they do not go together."""
    codes = options.code if isinstance(options.code, list) else [options.code] if options.code is not None else []
    ticket = options.ticket or os.environ.get(TICKET)
    given = [
        *(["--code"] if codes else []),
        *(["--tournament"] if options.tournament is not None else []),
        *(["--ticket" if options.ticket else f"the environment variable {TICKET}"] if ticket else []),
    ]
    if len(given) > 1:
        parser.error(f"{' and '.join(given)} are several ways in: give one")
    if ticket and options.ticket_file is not None:
        parser.error(f"{given[0]} and --ticket-file both say which place it is: give one")
    if not given and options.ticket_file is None:
        parser.error("give --code, --tournament, --ticket or --ticket-file")
    if len(codes) > 1 and options.ticket_file is not None:
        parser.error("--ticket-file is for one place: give --code once")
    if needs_name and not ticket and given and not options.name:
        parser.error("the following arguments are required: --name")
    if codes and (options.games is not None or options.stateless):
        parser.error("--games and --stateless are for tournaments: give --tournament CODE in place of --code CODE")
    if options.seat is not None and not codes:
        parser.error("--seat is for joining a room, give it with --code: in a tournament the seats are drawn, a ticket has its own")
    if options.games is not None and options.games < 1:
        parser.error("--games: a participant plays at least one game at a time")
    way = WayIn(
        tournament=options.tournament,
        ticket=ticket,
        ticket_file=options.ticket_file,
        name=options.name or "",
        seat=options.seat,
        games=options.games or 1,
        stateless=options.stateless,
    )
    return [replace(way, code=code) for code in codes or [None]]


def take_part(
    client: Client, way: WayIn, make_agent: MakeAgent, *, check_rules: Callable[[pb.RuleSet], None] = lambda rules: None
) -> Played:
    """Takes the place, or goes on in it, and plays until its game or tournament is over.

    Args:
        client: the connection to the server.
        way: how the place is come by.
        make_agent: gives the agent of each game.
        check_rules: raises ValueError if the agent does not know games by these rules; asked when joining.

    Raises:
        ChefsHatError: the place was refused or lost, or the server stayed unreachable.
        OSError: the file with the ticket cannot be read or written.
        ValueError: what `check_rules` raises.
    """
    ticket = way.ticket or _kept(way) or _join(client, way, check_rules)
    entered: list[pb.Entered] = []
    seats = 0

    def seated(seat: SeatInfo) -> Agent:
        nonlocal seats
        seats += 1
        if entered and sys.stderr.isatty():
            print(f"game {seats}: seat {seat.seat} of room {seat.room_id}", file=sys.stderr)
        return make_agent(seat)

    try:
        games = client.play_tournament(ticket, seated, on_entered=entered.append)
    except ChefsHatError as error:
        if error.reason == "TICKET_UNKNOWN" and way.ticket_file is not None:
            message = f"{error.message}; the ticket is that in {way.ticket_file}: remove the file to take another place"
            raise ChefsHatError(error.reason, message, error.metadata, error.code) from error
        raise
    if entered:
        last = entered[-1]
        played = Played(games, client.tournament_results(last.tournament_id), last.participant)
    else:
        games[0].raise_for_error()
        played = Played(games)
    if way.ticket_file is not None:
        way.ticket_file.unlink(missing_ok=True)
    return played


def _kept(way: WayIn) -> str | None:
    """The ticket that is kept in the file; None if a place is to be taken first."""
    file = way.ticket_file
    if file is None:
        return None
    try:
        ticket = file.read_text(encoding="utf-8").strip()
    except FileNotFoundError:
        ticket = ""
    if ticket:
        print(f"goes on in the place whose ticket is in {file}", file=sys.stderr)
        return ticket
    if way.code is None and way.tournament is None:
        raise FileNotFoundError(f"there is no ticket in {file}: give --code or --tournament to take a place")
    return None


def _join(client: Client, way: WayIn, check_rules: Callable[[pb.RuleSet], None]) -> str:
    """Takes the place, and sees to it that the ticket is not lost with this process."""
    file = way.ticket_file
    # First the file, then the place: nobody waits for an agent that could not keep its ticket.
    with secret_file(file) if file is not None else nullcontext() as keep:
        if way.tournament is not None:
            entrant = client.join_tournament(way.tournament, way.name, max_games=way.games, stateless=way.stateless)
            ticket, rules = entrant.ticket, entrant.tournament.settings.rules
            what, where = "its tournament", "place"
            left = "its games in the tournament will be played without it"
        else:
            joined = client.join_room(way.code or "", way.name, seat=way.seat)
            ticket, rules = joined.ticket, joined.room.rules
            what, where = "its game", "seat"
            # A seat that is not attached starts no game.
            left = f"its seat {joined.seat} will be free again within two minutes"
        try:
            # Who has not joined cannot see what a code is of.
            check_rules(rules)
        except ValueError as error:
            raise type(error)(f"{error}; {left}") from error
        if keep is not None:
            keep(ticket)
    # Whoever has the ticket has the place: it is told to the one who started the agent alone.
    if file is None:
        games = f" --games {way.games}" if way.games > 1 else ""
        how = f"another goes on in its {where} with --ticket {ticket}{games}"
    else:
        how = f"it goes on in its {where} when it is started again: {file} has its ticket"
    print(f"should this agent end before {what}, {how}", file=sys.stderr)
    return ticket
