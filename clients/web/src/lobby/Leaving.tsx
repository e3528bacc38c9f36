// Leaving a room in which this device has a seat. The dialog says beforehand what happens to the
// seat and how to come back: before the game the seat becomes free, afterwards it stays this
// device's. The creator of the room can also close it here.

import { AbortPolicy, type RoomPolicy } from "../gen/chefshat/v1/room_pb";
import { t } from "../i18n";
import { useAttempt } from "../parts/attempt";
import { Button } from "../parts/Button";
import { Dialog } from "../parts/Dialog";
import { Notice } from "../parts/Notice";
import { navigateFromHere } from "../router";
import { Tool } from "../table/view/Tools";
import css from "./Leaving.module.css";
import { clockOfPeople } from "./rooms";
import { closeRoom, giveBackSeat, hostedRoom } from "./seat";

interface LeaveButtonProps {
  roomId: string;
  /** An icon among the tools of the table, or a button with text. */
  look: "tool" | "button";
  onClick: () => void;
}

/** Opens the dialog. */
export function LeaveButton({ roomId, look, onClick }: LeaveButtonProps) {
  const words = t().lobby.leaving;
  return look === "tool" ? (
    <Tool label={words.leave} data-part="tool tool-leave" onClick={onClick}>
      <path d="M13 4H5v16h8M10 12h10M16.500 8.500l3.500 3.500l-3.500 3.500" />
    </Tool>
  ) : (
    <p class={css.leaving} data-part="leaving">
      <Button look="quiet" onClick={onClick}>
        {hostedRoom(roomId) ? words.leaveOrClose : words.leave}
      </Button>
    </p>
  );
}

interface LeaveDialogProps {
  roomId: string;
  /** Whether the game has started. It may start while the dialog is open. */
  playing: boolean;
  /** Whether anyone but built-in agents sits there besides. */
  others: boolean;
  policy: RoomPolicy | undefined;
  onClose: () => void;
}

/** The dialog. */
export function LeaveDialog({ roomId, playing, others, policy, onClose }: LeaveDialogProps) {
  const words = t().lobby.leaving;
  const { busy, fault, run } = useAttempt();
  const close = async () => {
    await closeRoom(roomId);
    onClose();
  };
  const leave = async () => {
    const navigate = navigateFromHere();
    if (!playing) await giveBackSeat(roomId);
    navigate({ page: "lobby" });
  };
  const givenUp =
    policy?.abort === AbortPolicy.ANY_LOST || (!others && policy?.abort !== AbortPolicy.NEVER) || policy === undefined;
  return (
    <Dialog title={words.title} onClose={onClose}>
      <div class="stack">
        {playing ? (
          <>
            <p>{awayWords(policy, givenUp, others)}</p>
            <p>{givenUp ? words.backUntilThen : words.back}</p>
          </>
        ) : (
          <p>{words.waiting}</p>
        )}
        {hostedRoom(roomId) && <p>{playing ? words.closePlaying : words.closeWaiting}</p>}
        {fault && <Notice kind="fault">{fault}</Notice>}
        <p class="row">
          <Button look="main" onClick={onClose}>
            {words.stay}
          </Button>
          <Button busy={busy} onClick={() => run(leave)}>
            {words.doIt}
          </Button>
          {hostedRoom(roomId) && (
            <Button busy={busy} onClick={() => run(close)}>
              {playing ? words.end : t().lobby.door.close}
            </Button>
          )}
        </p>
      </div>
    </Dialog>
  );
}

/** What happens at the decisions of somebody who has left. */
function awayWords(policy: RoomPolicy | undefined, givenUp: boolean, others: boolean): string {
  const words = t().lobby.leaving;
  const { maxTimeouts = 1, substitute = "" } = policy ?? {};
  const clock = policy && clockOfPeople(policy);
  if (clock?.absenceTimeMs === undefined) {
    return givenUp ? words.givenUp(maxTimeouts) : words.substituted(maxTimeouts, substitute);
  }
  if (!others && givenUp) return words.awayAlone;
  // A player that nobody waits for has all the time that it would have if it stayed.
  const timeMs = others ? Math.min(clock.absenceTimeMs, clock.decisionTimeMs) : clock.decisionTimeMs + clock.bankMs;
  const seconds = Math.ceil(timeMs / 1000);
  return givenUp ? words.awayGivenUp(seconds) : words.awaySubstituted(seconds, substitute);
}
