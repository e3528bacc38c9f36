"""The options by which a command reaches a server and joins a room or a tournament, or resumes its place there; and playing.

The commands are `agent`, `learn.play` and `players_club`; their output is in `outcome`, the protocol of a game in `session`, the
file of a ticket in `ticket_file`.
"""

import argparse
import os
import re
import secrets
import sys
from collections.abc import Callable
from contextlib import nullcontext, suppress
from dataclasses import dataclass, replace
from pathlib import Path

from chefshat import pb
from chefshat.address import CA, TOKEN, ServerAddress
from chefshat.agents import Agent
from chefshat.client import Client
from chefshat.decision import SeatInfo
from chefshat.errors import ChefsHatError
from chefshat.limits import MAX_GAMES, MAX_SEATS
from chefshat.outcome import Played
from chefshat.participant import MakeAgent
from chefshat.ticket_file import TicketFile

#: Environment variable that may contain the address of a server, for commands that play on one.
SERVER = "CHEFSHAT_SERVER"
#: Environment variable that may contain a ticket.
TICKET = "CHEFSHAT_TICKET"
#: Length of the key of a name.
NAME_KEY_BYTES = 32


@dataclass(frozen=True)
class JoinOptions:
    """How to get one place: by `code`, `tournament` or `ticket`, or by an existing `ticket_file`.

    Attributes:
        code: a room's join code.
        tournament: a tournament's join code.
        ticket: the ticket of a place to resume.
        ticket_file: stores the ticket until the game or tournament is over. An existing one names the place to resume.
        name: display name, for joining.
        name_key: the key of the name, 32 bytes; empty: none.
        seat: the seat of the room; None: the first free one.
        games: games of the tournament to play at a time.
        stateless: declares that the agent remembers nothing from one game of the tournament to the next.
    """

    code: str | None = None
    tournament: str | None = None
    ticket: str | None = None
    ticket_file: Path | None = None
    name: str = ""
    name_key: bytes = b""
    seat: int | None = None
    games: int = 1
    stateless: bool = False


def add_server_options(parser: argparse.ArgumentParser, *flags: str, required: bool = False, default: str | None = None) -> None:
    """Adds --address (and other `flags` for the same), --token, --ca, --secret.

    An address that is required or has a default may be in the environment.
    """
    what = "the server" if required or default else "a running server"
    unless = ""
    if required or default:
        otherwise = f", otherwise {default}" if default else ""
        unless = f" (default: that of the environment variable {SERVER}{otherwise})"
        default = os.environ.get(SERVER, default)
    parser.add_argument(
        *flags,
        "--address",
        dest="address",
        required=required and default is None,
        default=default,
        metavar="ADDRESS",
        help=f"{what}, HOST:PORT or https://HOST:PORT{unless}",
    )
    parser.add_argument(
        "--token",
        help=f"the token that the server requires. The environment variable {TOKEN} does the same and, unlike this option, does "
        "not show in lists of processes",
    )
    parser.add_argument(
        "--ca",
        type=Path,
        metavar="FILE",
        help=f"PEM file of the certificate authorities to trust with https:// (default: that of {CA}, or else the system's)",
    )
    parser.add_argument(
        "--secret",
        action="append",
        default=[],
        metavar="SECRET",
        help="an owner token or a ticket, to find and watch what is unlisted or private; repeatable",
    )


def server_of(options: argparse.Namespace) -> ServerAddress:
    """Returns the server that the options name."""
    return ServerAddress(options.address, options.token, options.ca, tuple(options.secret))


def server_if_any(options: argparse.Namespace) -> ServerAddress | None:
    """Returns the server that the options name; None without --address."""
    return None if options.address is None else server_of(options)


def add_options(parser: argparse.ArgumentParser, *, several_codes: bool = False) -> None:
    """Adds all options of `JoinOptions` except --name."""
    more = "; repeat it to play rooms one after another" if several_codes else ""
    parser.add_argument("--code", action="append" if several_codes else "store", help=f"a room's join code{more}")
    parser.add_argument("--tournament", metavar="CODE", help="a tournament's join code; plays until the tournament is over")
    parser.add_argument(
        "--ticket",
        help="the ticket of a place in a room or a tournament, to resume there. The environment variable "
        f"{TICKET} does the same and, unlike this option, does not show in lists of processes",
    )
    parser.add_argument(
        "--ticket-file",
        type=Path,
        metavar="FILE",
        help="store the ticket in this file, readable only by you, until the game or tournament is over; an existing "
        "file is resumed from, so run the same command again after its process died",
    )
    add_name_key_option(parser)
    parser.add_argument("--seat", type=int, help="the seat of the room, from 0 (default: the first free one)")
    parser.add_argument(
        "--games",
        type=int,
        help=f"games of a tournament to play at a time, 1 to {MAX_GAMES} (default: 1; with a ticket: as many as when joining)",
    )
    parser.add_argument(
        "--stateless", action="store_true", help="declare that the agent remembers nothing from game to game (tournaments)"
    )


def add_name_key_option(parser: argparse.ArgumentParser) -> None:
    """Adds the option that `name_key` reads."""
    parser.add_argument(
        "--name-key",
        type=Path,
        metavar="FILE",
        help="file with the key that tells this name from the same name of others, in leaderboards and records; it is created "
        "if it does not exist: keep it secret, and use it again",
    )


def name_key(file: Path | None) -> bytes:
    """Returns the key in a file, which is created, readable only by its owner, if it does not exist; empty without a file.

    Raises:
        ValueError: the file contains no key.
        OSError: it cannot be read or created.
    """
    if file is None:
        return b""
    try:
        text = file.read_text(encoding="ascii").strip()
    except FileNotFoundError:
        _create_key(file)
        text = file.read_text(encoding="ascii").strip()
    if not re.fullmatch(rf"[0-9a-fA-F]{{{2 * NAME_KEY_BYTES}}}", text):
        digits = 2 * NAME_KEY_BYTES
        raise ValueError(f"{file} contains no key: {digits} hexadecimal digits; name a file that does not exist to create one")
    return bytes.fromhex(text)


def _create_key(file: Path) -> None:
    """Creates the file of a new key, complete when it appears, unless another process does so at the same time."""
    begun = file.with_name(f".{file.name}.{secrets.token_hex(8)}")
    descriptor = os.open(begun, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    try:
        with open(descriptor, "w", encoding="ascii") as created:
            created.write(f"{secrets.token_hex(NAME_KEY_BYTES)}\n")
        with suppress(FileExistsError):
            os.link(begun, file)
    finally:
        begun.unlink()


def ways(parser: argparse.ArgumentParser, options: argparse.Namespace, *, needs_name: bool = True) -> list[JoinOptions]:
    """Returns the places that the options name. Exits with 2, as the parser does, if options conflict."""
    codes = options.code if isinstance(options.code, list) else [options.code] if options.code is not None else []
    ticket = options.ticket or os.environ.get(TICKET)
    given = [
        *(["--code"] if codes else []),
        *(["--tournament"] if options.tournament is not None else []),
        *(["--ticket" if options.ticket else f"the environment variable {TICKET}"] if ticket else []),
    ]
    if len(given) > 1:
        parser.error(f"{' and '.join(given)} exclude each other: give one")
    if ticket and options.ticket_file is not None:
        parser.error(f"{given[0]} and --ticket-file both name a place: give one")
    if not given and options.ticket_file is None:
        parser.error("give --code, --tournament, --ticket or --ticket-file")
    if len(codes) > 1 and options.ticket_file is not None:
        parser.error("--ticket-file is for one place: give --code once")
    if needs_name and not ticket and given and not options.name:
        parser.error("the following arguments are required: --name")
    if codes and (options.games is not None or options.stateless):
        parser.error("--games and --stateless are for tournaments: give --tournament CODE instead of --code CODE")
    if options.seat is not None and not codes:
        parser.error("--seat is for joining a room: give it with --code. A tournament draws the seats, and a ticket has its seat")
    if options.name_key is not None and ticket:
        parser.error("--name-key is for joining: a ticket is of a place that is already taken")
    if options.stateless and options.tournament is None:
        parser.error("--stateless is for joining: give it with --tournament. A ticket is of a place that is already taken")
    if options.seat is not None and not 0 <= options.seat < MAX_SEATS:
        parser.error(f"--seat: seats are numbered from 0, and a table has at most {MAX_SEATS}")
    if options.games is not None and not 1 <= options.games <= MAX_GAMES:
        parser.error(f"--games: a participant plays 1 to {MAX_GAMES} games at a time")
    try:
        key = name_key(options.name_key)
    except (OSError, ValueError) as error:
        parser.error(f"--name-key: {error}")
    way = JoinOptions(
        tournament=options.tournament,
        ticket=ticket,
        ticket_file=options.ticket_file,
        name=options.name or "",
        name_key=key,
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
    """Takes or resumes the place, and plays until its game or tournament is over.

    Args:
        client: the connection to the server.
        way: how to get the place.
        make_agent: creates the agent of each game.
        check_rules: raises ValueError if the agent cannot play under these rules; called when joining.
        prepare: called before the first game of a tournament with the number of games the participant plays at a time. For a
            resumed place this may exceed `way.games`.

    Raises:
        ChefsHatError: the place was refused or lost, or the server stayed unreachable.
        OSError: the ticket file cannot be read or created, or another command uses it.
        ValueError: raised by `check_rules`.
        KeyboardInterrupt: Ctrl-C. Its message says what happens to a place already taken.
    """
    with TicketFile(way.ticket_file) if way.ticket_file is not None else nullcontext() as file:
        ticket = way.ticket or _stored(way, file) or _join(client, way, file, check_rules)
        played = _play(client, way, ticket, make_agent, prepare)
        if file is not None:
            try:
                file.forget()
            except OSError as error:
                print(f"warning: cannot delete the used ticket: {error}; remove {file.path}", file=sys.stderr)
        return played


def _play(client: Client, way: JoinOptions, ticket: str, make_agent: MakeAgent, prepare: Callable[[int], None] | None) -> Played:
    """Plays with a ticket until its game or tournament is over."""
    entered: list[pb.Entered] = []
    prepared = prepare is None
    seats = 0

    def enter(place: pb.Entered) -> None:
        nonlocal prepared
        entered.append(place)
        if prepare is None or prepared:
            return
        try:
            participants = client.tournaments.get(place.tournament_id).participants
        except ChefsHatError as error:
            if not error.retryable:
                raise
            return  # The next connection retries.
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
            message = f"{error.message}; the ticket comes from {way.ticket_file}: remove the file to join again"
            raise ChefsHatError(error.reason, message, error.metadata, error.code) from error
        raise
    except KeyboardInterrupt:
        raise KeyboardInterrupt("a substitute plays until the ticket is used again") from None
    if not entered:
        games[0].raise_for_error()
        return Played(games)
    last = entered[-1]
    return Played(games, client.tournaments.results(last.tournament_id), last.participant)


def _stored(way: JoinOptions, file: TicketFile | None) -> str | None:
    """Returns the ticket in the file; None if the command has to join first."""
    if file is None:
        return None
    if file.ticket:
        print(f"resuming with the ticket in {file.path}", file=sys.stderr)
        return file.ticket
    if way.code is None and way.tournament is None:
        raise FileNotFoundError(f"there is no ticket in {file.path}: give --code or --tournament to join")
    return None


def _join(client: Client, way: JoinOptions, file: TicketFile | None, check_rules: Callable[[pb.RuleSet], None]) -> str:
    """Joins, and stores or prints the ticket, so that it survives this process."""
    if way.tournament is not None:
        entrant = client.tournaments.join(
            way.tournament, way.name, max_games=way.games, stateless=way.stateless, name_key=way.name_key
        )
        ticket, rules = entrant.ticket, entrant.tournament.settings.rules
        what = "the tournament"
        left = "the tournament will be played without it"
    else:
        joined = client.rooms.join(way.code or "", way.name, seat=way.seat, name_key=way.name_key)
        ticket, rules = joined.ticket, joined.room.rules
        what = "the game"
        # An unattached seat does not start a game.
        left = f"seat {joined.seat} will be free again within two minutes"
    try:
        # The rules are only visible after joining.
        check_rules(rules)
    except ValueError as error:
        raise type(error)(f"{error}; {left}") from error
    # The ticket gives access to the place, so it is printed only to the user's standard error.
    how = f"with --ticket {ticket}"
    if file is not None:
        try:
            file.keep(ticket)
            how = f"by the same command: the ticket is in {file.path}"
        except OSError as error:
            # The place is taken, and the ticket exists nowhere else.
            print(f"warning: cannot store the ticket in {file.path}: {error}", file=sys.stderr)
    print(f"if this process ends before {what}, resume {how}", file=sys.stderr)
    return ticket
