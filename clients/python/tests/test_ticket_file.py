"""The file of a ticket: contents, lock and deletion."""

import os
import stat
from pathlib import Path

import pytest

from chefshat.ticket_file import TicketFile

HELD = "another command uses"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "ticket"


def test_a_ticket_replaces_an_empty_file_readable_only_by_its_owner(path: Path) -> None:
    path.write_text("\n")
    path.chmod(0o644)
    with TicketFile(path):
        pass
    assert path.read_text() == "\n"
    with TicketFile(path) as file:
        assert file.ticket == ""
        file.keep("new")
        assert (path.read_text(), stat.S_IMODE(path.stat().st_mode)) == ("new\n", 0o600)
        assert list(path.parent.iterdir()) == [path]
    with TicketFile(path) as file:
        assert file.ticket == "new"
        file.forget()
    assert list(path.parent.iterdir()) == []


def test_only_one_command_locks_the_file(path: Path) -> None:
    with TicketFile(path) as file:
        with pytest.raises(BlockingIOError, match=HELD), TicketFile(path):
            pass
        file.keep("mine")
        with pytest.raises(BlockingIOError, match=HELD), TicketFile(path):
            pass
    with TicketFile(path) as file, pytest.raises(BlockingIOError, match=HELD), TicketFile(path):
        pass
    with TicketFile(path) as file:
        assert file.ticket == "mine"


def test_files_of_a_killed_command_are_reused_privately(path: Path) -> None:
    left = path.with_name(".ticket.new")
    left.write_text("half of a longer ticket")
    left.chmod(0o644)
    with TicketFile(path) as file:
        assert file.ticket == ""
        file.keep("mine")
        assert (path.read_text(), stat.S_IMODE(path.stat().st_mode)) == ("mine\n", 0o600)
    assert list(path.parent.iterdir()) == [path]


def test_a_ticket_of_another_command_is_not_removed(path: Path) -> None:
    with TicketFile(path) as file:
        file.keep("mine")
        path.write_text("another's")
        file.forget()
        assert path.read_text() == "another's"
        path.unlink()
        file.forget()


def test_links_are_not_followed(path: Path) -> None:
    elsewhere = path.with_name("elsewhere")
    elsewhere.write_text("")
    os.symlink(elsewhere, path.with_name(".ticket.new"))
    with pytest.raises(OSError, match="symbolic link"), TicketFile(path):
        pass
