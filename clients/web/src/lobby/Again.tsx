// "Play again" after a game: the device that created the room creates another with the same rules,
// seats and agents. The others see that there is one, and take their seats there.

import { useEffect } from "preact/hooks";
import { usePolled } from "../api/poll";
import { t } from "../i18n";
import { announce } from "../parts/Announcer";
import { useAttempt } from "../parts/attempt";
import { Button } from "../parts/Button";
import { Notice } from "../parts/Notice";
import { joinAgain, playAgain, roomOfTicket } from "./room-like";
import { heldSeat, hostedRoom } from "./seat";

/** Polling interval of the next room, milliseconds. */
const EVERY_MS = 3000;

/** The button; null where it does not apply. `others` if anyone but built-in agents played. */
export function Again({ roomId, others }: { roomId: string; others: boolean }) {
  const words = t().lobby.quick;
  const held = heldSeat(roomId);
  if (!held) return null;
  if (!hostedRoom(roomId)) return <JoinAgain roomId={roomId} />;
  const label = others ? words.againTogether : words.again;
  return <Onward label={label} act={() => playAgain(roomId, held.name, held.seat)} />;
}

/** The button to the next room of another device, once there is one. */
function JoinAgain({ roomId }: { roomId: string }) {
  const label = t().lobby.quick.joinAgain;
  const held = heldSeat(roomId);
  const ask = async (signal: AbortSignal) => held && roomOfTicket(roomId, held.ticket, signal);
  const room = usePolled(ask, EVERY_MS, roomId).value;
  const code = room?.nextJoinCode ?? "";
  useEffect(() => {
    if (code !== "") announce(label);
  }, [code]);
  if (!held || !room || code === "") return null;
  return <Onward label={label} act={() => joinAgain(room, held.name, held.seat)} />;
}

function Onward({ label, act }: { label: string; act: () => Promise<void> }) {
  const { busy, fault, run } = useAttempt();
  return (
    <>
      <Button look="main" busy={busy} onClick={() => run(act)}>
        {label}
      </Button>
      {fault && <Notice kind="fault">{fault}</Notice>}
    </>
  );
}
