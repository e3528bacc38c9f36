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
import { type HeldSeat, heldSeat, hostedRoom } from "./seat";

/** Polling interval of the next room, milliseconds. */
const EVERY_MS = 3000;

/** The button; null where it does not apply. `others` if anyone but built-in agents played. */
export function Again({ roomId, others }: { roomId: string; others: boolean }) {
  const words = t().lobby.quick;
  const held = heldSeat(roomId);
  if (!held || !hostedRoom(roomId)) return null;
  const label = others ? words.againTogether : words.again;
  return <Onward label={label} act={() => playAgain(roomId, held.name, held.seat)} />;
}

/** After a game in a room of another device: the button to its next room, once there is one. */
export function JoinAgain({ roomId }: { roomId: string }) {
  const held = heldSeat(roomId);
  if (!held || hostedRoom(roomId)) return null;
  return <Invited roomId={roomId} held={held} />;
}

function Invited({ roomId, held }: { roomId: string; held: HeldSeat }) {
  const label = t().lobby.quick.joinAgain;
  const ask = (signal: AbortSignal) => roomOfTicket(roomId, held.ticket, signal);
  const room = usePolled(ask, EVERY_MS, roomId).value;
  const code = room?.nextJoinCode ?? "";
  useEffect(() => {
    if (code !== "") announce(label);
  }, [code]);
  if (!room || code === "") return null;
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
