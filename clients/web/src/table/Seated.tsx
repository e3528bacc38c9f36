// The table from a seat, with announcements and sounds. The page knows where the seat comes from (a
// room or a tournament) and shows problems with it in the banner.

import type { ComponentChildren } from "preact";
import type { Acting } from "./acting";
import { gesture } from "./expressions";
import { useAnnounced } from "./following";
import { TableView } from "./view/TableView";
import { WaitingRoom } from "./view/WaitingRoom";

interface SeatedProps {
  acting: Acting;
  banner?: ComponentChildren;
  /** Additional tools of the table. */
  tools?: ComponentChildren;
  /** The next step after the game. */
  onward?: ComponentChildren;
  /** Shown below the seats while the room waits. */
  below?: ComponentChildren;
}

/** The table from a seat. */
export function Seated({ acting, banner, tools, onward, below }: SeatedProps) {
  const { table, own, decision } = acting.live.value;
  useAnnounced(table, own, decision);
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
      sending={acting.sending.value !== undefined}
      trouble={acting.trouble.value}
      banner={banner}
      tools={tools}
      onward={onward}
      caption={table.roomName}
      hint={acting.hint.value}
      onHint={table.policy?.hints ? acting.askHint : undefined}
      onAnswer={acting.answer}
      onExpress={(label) => acting.express(gesture(label))}
    />
  );
}
