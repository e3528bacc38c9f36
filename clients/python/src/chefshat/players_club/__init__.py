"""Players Club adapter: players written for the reference implementation's second version, unchanged, as remote agents.

`python -m chefshat.players_club` joins a room with one. Each runs in a process, and if need be a Python, of its own: nothing of
what it imports is needed here. `PlayersClubAgent` is the agent, `AgentProcess` the process it asks.
"""

from chefshat.players_club.agent import PlayersClubAgent, RulesDoNotFit
from chefshat.players_club.process import AgentError, AgentProcess, AgentSpec

__all__ = ["AgentError", "AgentProcess", "AgentSpec", "PlayersClubAgent", "RulesDoNotFit"]
