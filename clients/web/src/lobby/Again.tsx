// "Play again" after a game that this device has made, for one who played against nobody but agents of the server.

import { useState } from "preact/hooks";
import { inWords } from "../api/faults";
import { t } from "../i18n";
import { Button } from "../parts/Button";
import { Notice } from "../parts/Notice";
import { playAgain } from "./room-like";
import { heldSeat, hostedRoom } from "./seat";

/** The button; nothing for those to whom it does not apply. */
export function Again({ roomId }: { roomId: string }) {
  const [busy, setBusy] = useState(false);
  const [fault, setFault] = useState("");
  const held = heldSeat(roomId);
  if (!held || !hostedRoom(roomId)) return null;
  const play = async () => {
    setBusy(true);
    setFault("");
    try {
      await playAgain(roomId, held.name, held.seat);
    } catch (thrown) {
      setFault(inWords(thrown));
      setBusy(false);
    }
  };
  return (
    <>
      <Button look="main" busy={busy} onClick={() => void play()}>
        {t().lobby.quick.again}
      </Button>
      {fault && <Notice kind="fault">{fault}</Notice>}
    </>
  );
}
