"""`python -m chefshat_server`: runs the program `chefshat` with the same arguments."""

import os
import subprocess
import sys

from chefshat_server import find_binary


def main() -> int:
    """Runs the program and returns its exit code."""
    command = [str(find_binary()), *sys.argv[1:]]
    if os.name == "posix":
        # Replaces this process, so that signals reach the program.
        os.execv(command[0], command)
    return subprocess.run(command).returncode


if __name__ == "__main__":
    sys.exit(main())
