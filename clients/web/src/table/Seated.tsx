// The table from a seat, with announcements, sounds and what calls a person back on their turn. The page knows where the seat comes from (a
// room or a tournament) and shows problems with it in the banner.

import type { ComponentChildren } from "preact";
import { isOn } from "../preferences";
import type { Acting } from "./acting";
import { useAttention } from "./attention";
import { useAutoPass } from "./auto-pass";
import { useAnnounced } from "./following";
import { TableView } from "./view/TableView";
import { WaitingRoom } from "./view/WaitingRoom";

interface SeatedProps {
  acting: Acting;
  /** Whether the person takes part in a study: then every decision is made at its turn, by hand. */
  study: boolean;
  banner?: ComponentChildren;
  /** Additional tools of the table. */
  tools?: ComponentChildren;
  /** The next step after the game. */
  onward?: ComponentChildren;
  /** Shown below the seats while the room waits. */
  below?: ComponentChildren;
}

/** The table from a seat. */
export function Seated({ acting, study, banner, tools, onward, below }: SeatedProps) {
  const { table, own, decision, awaited } = acting.live.value;
  useAnnounced(table, own, decision);
  useAttention(decision, table.phase !== "gameOver" && table.phase !== "aborted");
  const autoPassing = useAutoPass(acting, !study && !table.physical && isOn("autoPass"));
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
      sending={acting.sending.value !== undefined}
      trouble={acting.trouble.value}
      banner={banner}
      tools={tools}
      onward={onward}
      caption={table.roomName}
      hint={acting.hint.value}
      plans={!study && isOn("plans")}
      autoPassing={autoPassing}
      onHint={table.policy?.hints ? acting.askHint : undefined}
      onAnswer={acting.answer}
      onExpress={acting.express}
      phrases={!study}
    />
  );
}
