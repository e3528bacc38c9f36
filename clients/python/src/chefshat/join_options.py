"""How a command comes by its place in a room or a tournament, and by the same place again after its process died.

Here are the options that say so, and playing, until there is something to print. The commands are `agent`, `learn.play` and
`players_club`; what they print is in `outcome`, how a game is played in `session`, the file that keeps a ticket in `ticket_file`.
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
from chefshat.limits import MAX_GAMES, MAX_SEATS
from chefshat.outcome import Played
from chefshat.participant import MakeAgent
from chefshat.ticket_file import TicketFile

#: Environment variable that a ticket may stand in.
TICKET = "CHEFSHAT_TICKET"


@dataclass(frozen=True)
class JoinOptions:
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
    parser.add_argument("--seat", type=int, help="a certain seat of the room, from 0 (the first free one unless given)")
    parser.add_argument(
        "--games",
        type=int,
        help=f"games of a tournament to play at a time, 1 to {MAX_GAMES} (1 unless given); with a ticket it is as many as before",
    )
    parser.add_argument(
        "--stateless", action="store_true", help="say that the agent remembers nothing from game to game (tournaments)"
    )


def ways(parser: argparse.ArgumentParser, options: argparse.Namespace, *, needs_name: bool = True) -> list[JoinOptions]:
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
    if options.stateless and options.tournament is None:
        parser.error("--stateless is said when joining: give it with --tournament, the place of a ticket has been taken already")
    if options.seat is not None and not 0 <= options.seat < MAX_SEATS:
        parser.error(f"--seat: seats are counted from 0, and no table has more than {MAX_SEATS}")
    if options.games is not None and not 1 <= options.games <= MAX_GAMES:
        parser.error(f"--games: a participant plays 1 to {MAX_GAMES} games at a time")
    way = JoinOptions(
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
    client: Client,
    way: JoinOptions,
    make_agent: MakeAgent,
    *,
    check_rules: Callable[[pb.RuleSet], None] = lambda rules: None,
    prepare: Callable[[int], None] | None = None,
) -> Played:
    """Takes the place, or goes on in it, and plays until its game or tournament is over.

    Args:
        client: the connection to the server.
        way: how the place is come by.
        make_agent: gives the agent of each game.
        check_rules: raises ValueError if the agent does not know games by these rules; asked when joining.
        prepare: told, in a tournament and before its first game here, how many of its games the participant plays at a time. That
            was said when the place was taken, and may be more than `way.games` where it is gone on in.

    Raises:
        ChefsHatError: the place was refused or lost, or the server stayed unreachable.
        OSError: the file with the ticket cannot be read or begun, or another command plays in its place.
        ValueError: what `check_rules` raises.
        KeyboardInterrupt: Ctrl-C. Where a place had been taken it says in words what becomes of that.
    """
    with TicketFile(way.ticket_file) if way.ticket_file is not None else nullcontext() as file:
        ticket = way.ticket or _kept(way, file) or _join(client, way, file, check_rules)
        played = _play(client, way, ticket, make_agent, prepare)
        if file is not None:
            try:
                file.forget()
            except OSError as error:
                print(f"warning: all is over, but its ticket is still kept: {error}; remove {file.path}", file=sys.stderr)
        return played


def _play(client: Client, way: JoinOptions, ticket: str, make_agent: MakeAgent, prepare: Callable[[int], None] | None) -> Played:
    """Plays in the place that the ticket is of, until its game or tournament is over."""
    entered: list[pb.Entered] = []
    prepared = prepare is None
    seats = 0

    def enter(place: pb.Entered) -> None:
        nonlocal prepared
        entered.append(place)
        if prepare is None or prepared:
            return
        try:
            participants = client.get_tournament(place.tournament_id).participants
        except ChefsHatError as error:
            if not error.retryable:
                raise
            return  # The next connection asks again.
        prepared = True
        prepare(min(participants[place.participant].max_games, MAX_GAMES))

    def seated(seat: SeatInfo) -> Agent:
        nonlocal seats
        seats += 1
        if entered and sys.stderr.isatty():
            print(f"game {seats}: seat {seat.seat} of room {seat.room_id}", file=sys.stderr)
        return make_agent(seat)

    try:
        games = client.play_tournament(ticket, seated, on_entered=enter)
    except ChefsHatError as error:
        if error.reason == "TICKET_UNKNOWN" and way.ticket_file is not None:
            message = f"{error.message}; the ticket is that in {way.ticket_file}: remove the file to take another place"
            raise ChefsHatError(error.reason, message, error.metadata, error.code) from error
        raise
    except KeyboardInterrupt:
        raise KeyboardInterrupt("the place is the server's to fill until its ticket is used again") from None
    if not entered:
        games[0].raise_for_error()
        return Played(games)
    last = entered[-1]
    return Played(games, client.tournament_results(last.tournament_id), last.participant)


def _kept(way: JoinOptions, file: TicketFile | None) -> str | None:
    """The ticket that is kept in the file; None if a place is to be taken first."""
    if file is None:
        return None
    if file.ticket:
        print(f"goes on in the place whose ticket is in {file.path}", file=sys.stderr)
        return file.ticket
    if way.code is None and way.tournament is None:
        raise FileNotFoundError(f"there is no ticket in {file.path}: give --code or --tournament to take a place")
    return None


def _join(client: Client, way: JoinOptions, file: TicketFile | None, check_rules: Callable[[pb.RuleSet], None]) -> str:
    """Takes the place, and sees to it that the ticket is not lost with this process."""
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
    # Whoever has the ticket has the place: it is told to the one who started the agent alone.
    how = f"another goes on in its {where} with --ticket {ticket}"
    if file is not None:
        try:
            file.keep(ticket)
            how = f"it goes on in its {where} when it is started again: {file.path} has its ticket"
        except OSError as error:
            # The place is taken, and nobody else knows the ticket.
            print(f"warning: {file.path} cannot keep the ticket: {error}", file=sys.stderr)
    print(f"should this agent end before {what}, {how}", file=sys.stderr)
    return ticket
