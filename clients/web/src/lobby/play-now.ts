// A quick game: a room with three built-in agents and the relaxed clock, with the person on the
// first seat.

import { serverInfo } from "../api/server";
import { t } from "../i18n";
import { navigateFromHere } from "../router";
import { quickGame } from "./room-form";
import { createRoom, takeSeat } from "./seat";

/** Creates the game and navigates to it. Without a name the person is a guest. */
export async function playNow(name: string): Promise<void> {
  const navigate = navigateFromHere();
  const words = t().lobby.quick;
  const { builtInAgents } = await serverInfo();
  const player = name.trim() || words.guest;
  const { joinCode } = await createRoom(quickGame(words.roomOf(player), player, builtInAgents));
  const { roomId } = await takeSeat(joinCode, player);
  navigate({ page: "room", roomId });
}
