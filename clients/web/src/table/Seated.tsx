// The table from a seat, with announcements, sounds and what calls a person back on their turn. The
// page knows where the seat comes from (a room or a tournament) and shows problems with it in the
// banner.

import type { ComponentChildren } from "preact";
import { useEffect } from "preact/hooks";
import { announce } from "../parts/Announcer";
import { isOn } from "../preferences";
import { Console, isWizard } from "../wizard/Console";
import type { Acting } from "./acting";
import { useAttention } from "./attention";
import { useAutoPass } from "./auto-pass";
import { useAnnounced } from "./following";
import { isOver } from "./model/state";
import { Caption } from "./view/Caption";
import { TableView } from "./view/TableView";
import { WaitingRoom } from "./view/WaitingRoom";

interface SeatedProps {
  acting: Acting;
  /** Whether the person takes part in a study: then every decision is made at its turn, by hand. */
  study?: boolean;
  banner?: ComponentChildren;
  /** Additional tools of the table. */
  tools?: ComponentChildren;
  /** The next step after the game. */
  nextStep?: ComponentChildren;
  /** The person picked a card or put it back; its name is the face, or J for a joker. */
  onPick?: (card: string, picked: boolean) => void;
  /** Shown below the seats while the room waits. */
  below?: ComponentChildren;
}

/** The table from a seat. */
export function Seated({ acting, study = false, banner, tools, nextStep, below, onPick }: SeatedProps) {
  const { table, own, decision, awaited } = acting.live.value;
  const wizard = own !== undefined && isWizard(table.seats[own]);
  useAnnounced(table, own, decision);
  useAttention(table.roomId, decision, !isOver(table));
  const trouble = acting.trouble.value;
  useEffect(() => {
    if (trouble !== "") announce(trouble);
  }, [trouble]);
  const autoPassing = useAutoPass(acting, !study && !wizard && !table.physical && isOn("autoPass"));
  if (table.phase === "waiting") {
    return (
      <>
        <WaitingRoom table={table} own={own} banner={banner} />
        {below}
      </>
    );
  }
  return (
    <TableView
      table={table}
      own={own}
      decision={decision}
      awaited={awaited}
      sending={acting.sending.value}
      trouble={trouble}
      banner={banner}
      tools={tools}
      nextStep={nextStep}
      caption={<Caption table={table} />}
      hint={acting.hint.value}
      plans={!study && !wizard && isOn("plans")}
      autoPassing={autoPassing}
      onHint={table.policy?.hints ? acting.askHint : undefined}
      onAnswer={acting.answer}
      onPick={onPick}
      onExpress={wizard ? undefined : acting.express}
      phrases={!study && !wizard}
      chat={table.policy?.chat ?? false}
    >
      {wizard && !isOver(table) && (
        <Console
          table={table}
          decision={decision}
          hint={acting.hint.value}
          sending={acting.sending.value}
          onHint={table.policy?.hints ? acting.askHint : undefined}
          onAnswer={acting.answer}
          onExpress={acting.express}
        />
      )}
    </TableView>
  );
}
