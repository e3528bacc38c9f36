// Asks for a room until the server answers.

import { askUntilAnswered } from "../api/asking";
import { roomApi } from "../api/client";
import type { Fault } from "../api/faults";
import type { Room } from "../gen/chefshat/v1/room_pb";

/** The room; `isWanted` and `onFault` as in `askUntilAnswered`. */
export function askRoom(
  roomId: string,
  isWanted: () => boolean,
  onFault?: (fault: Fault) => void,
): Promise<Room | undefined> {
  const ask = async () => (await roomApi.getRoom({ roomId })).room;
  return askUntilAnswered(ask, isWanted, onFault);
}
