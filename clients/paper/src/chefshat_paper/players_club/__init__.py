"""Players Club adapter: runs players written for the reference implementation's second version, unchanged, as remote agents.

`python -m chefshat_paper.players_club` joins a room with one. Each runs in its own process, optionally with another Python, so that
its dependencies are not needed here. `PlayersClubAgent` is the agent, `AgentProcess` its process.
"""

from chefshat_paper.players_club.agent import PlayersClubAgent, RulesDoNotFit
from chefshat_paper.players_club.process import AgentError, AgentProcess, AgentSpec

__all__ = ["AgentError", "AgentProcess", "AgentSpec", "PlayersClubAgent", "RulesDoNotFit"]
