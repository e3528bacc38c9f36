// "Play again" after a game in a room that this device created: a new room with the same rules,
// seats and agents. Other people and agents need its invitation, which the new room shows.

import { t } from "../i18n";
import { useAttempt } from "../parts/attempt";
import { Button } from "../parts/Button";
import { Notice } from "../parts/Notice";
import { playAgain } from "./room-like";
import { heldSeat, hostedRoom } from "./seat";

/** The button; null where it does not apply. `others` if anyone but built-in agents played. */
export function Again({ roomId, others }: { roomId: string; others: boolean }) {
  const words = t().lobby.quick;
  const { busy, fault, run } = useAttempt();
  const held = heldSeat(roomId);
  if (!held || !hostedRoom(roomId)) return null;
  return (
    <>
      <Button look="main" busy={busy} onClick={() => run(() => playAgain(roomId, held.name, held.seat))}>
        {others ? words.againTogether : words.again}
      </Button>
      {fault && <Notice kind="fault">{fault}</Notice>}
    </>
  );
}
