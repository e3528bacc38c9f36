// "Play again" after a game against built-in agents only, in a room that this device created.

import { t } from "../i18n";
import { useAttempt } from "../parts/attempt";
import { Button } from "../parts/Button";
import { Notice } from "../parts/Notice";
import { playAgain } from "./room-like";
import { heldSeat, hostedRoom } from "./seat";

/** The button; null where it does not apply. */
export function Again({ roomId }: { roomId: string }) {
  const { busy, fault, run } = useAttempt();
  const held = heldSeat(roomId);
  if (!held || !hostedRoom(roomId)) return null;
  return (
    <>
      <Button look="main" busy={busy} onClick={() => run(() => playAgain(roomId, held.name, held.seat))}>
        {t().lobby.quick.again}
      </Button>
      {fault && <Notice kind="fault">{fault}</Notice>}
    </>
  );
}
