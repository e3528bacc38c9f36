// "Play again" after a game: a participant creates another room with the same rules, seats and agents,
// and the others see that there is one, and take their seats there. The first offer counts.

import { useEffect } from "preact/hooks";
import { usePolled } from "../api/poll";
import { GameOrigin } from "../gen/chefshat/v1/room_pb";
import { t } from "../i18n";
import { announce } from "../parts/Announcer";
import { useAttempt } from "../parts/attempt";
import { Button } from "../parts/Button";
import { Notice } from "../parts/Notice";
import { joinAgain, playAgain, roomOfTicket } from "./room-like";
import { type HeldSeat, heldSeat, hostedRoom } from "./seat";

/** Polling interval of the next room, milliseconds. */
const EVERY_MS = 3000;

/** The button; null where it does not apply. `others` if anyone but built-in agents played. */
export function Again({ roomId, others }: { roomId: string; others: boolean }) {
  const held = heldSeat(roomId);
  return held && <Offered {...{ roomId, held, others }} />;
}

function Offered({ roomId, held, others }: { roomId: string; held: HeldSeat; others: boolean }) {
  const words = t().lobby.quick;
  const ask = (signal: AbortSignal) => roomOfTicket(roomId, held.ticket, signal);
  const room = usePolled(ask, EVERY_MS, roomId).value;
  const code = room?.nextJoinCode ?? "";
  const { busy, fault, run } = useAttempt();
  useEffect(() => {
    if (code !== "" && !busy) announce(words.joinAgain);
  }, [code]);
  // Only the creator knows the hands of a scripted game and has the ticket of a table with real cards.
  const known = hostedRoom(roomId) !== null || room?.origin === GameOrigin.DEALT;
  if (code === "" && !known) return null;
  const label = code !== "" ? words.joinAgain : others ? words.againTogether : words.again;
  const act = () => (room && code !== "" ? joinAgain(room, held) : playAgain(roomId, held));
  return (
    <>
      <Button look="main" busy={busy} onClick={() => run(act)}>
        {label}
      </Button>
      {fault && <Notice kind="fault">{fault}</Notice>}
    </>
  );
}
