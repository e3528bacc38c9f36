// The name of a room at its table, and how many spectators watch. They are no events of a game, so the
// room is polled.

import { roomApi } from "../../api/client";
import { usePolled } from "../../api/poll";
import { t } from "../../i18n";
import { isOver, type TableState } from "../model/state";

/** Polling interval, milliseconds. */
const EVERY_MS = 10_000;

interface CaptionProps {
  table: TableState;
  /** Whether the reader is a spectator. */
  watched?: boolean;
}

/** The caption of a table. */
export function Caption({ table, watched = false }: CaptionProps) {
  const words = t().table.watch;
  const { roomId, roomName, policy } = table;
  const over = isOver(table);
  const ask = async (signal: AbortSignal) => {
    if (over || !policy?.spectators) return 0;
    const { room } = await roomApi.getRoom({ roomId }, { signal });
    return room?.spectators ?? 0;
  };
  const { value: spectators } = usePolled(ask, EVERY_MS, `${roomId} ${over}`);
  const parts = [roomName, watched && words.viewer, spectators && words.spectators(spectators)];
  return <>{parts.filter(Boolean).join(" · ")}</>;
}
