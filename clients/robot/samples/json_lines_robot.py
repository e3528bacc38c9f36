"""A robot's own program for the driver `jsonlines`: prints the acts that it receives, and replies that each is done.

Run `python samples/json_lines_robot.py 7700`, then `chefshat-robot robot --driver jsonlines:port=7700 --code JOIN-CODE`. In place
of the prints, let your robot move; reply `failed` with a reason if it cannot.
"""

import json
import socketserver
import sys
from typing import Any


class Robot(socketserver.StreamRequestHandler):
    """A connection of the driver."""

    def handle(self) -> None:
        """Reads one message a line, until the driver leaves."""
        for line in self.rfile:
            message = json.loads(line)
            if message["type"] == "act":
                self.reply(message["id"], self.act(message))

    def act(self, act: dict[str, Any]) -> str:
        """Acts. Returns why it failed; empty if it did not."""
        match act["act"]:
            case "say":
                print(f"says: {act['text']}", flush=True)
            case "pick":
                for move in act["moves"]:
                    print(f"carries the {move['piece']} to x {move['end']['x']} mm, y {move['end']['y']} mm", flush=True)
            case "express":
                print(f"shows {act['label']}", flush=True)
            case _:
                return "this robot cannot turn its head"
        return ""

    def reply(self, number: str, reason: str) -> None:
        """Reports the end of an act."""
        answer = {"type": "failed", "id": number, "reason": reason} if reason else {"type": "done", "id": number}
        self.wfile.write(json.dumps(answer).encode() + b"\n")


if __name__ == "__main__":
    with socketserver.TCPServer(("", int(sys.argv[1])), Robot) as server:
        print(f"waiting for the driver on port {server.server_address[1]}", flush=True)
        server.serve_forever()
