// The table as the holder of a seat sees and plays it, with what happens announced and heard. Where the seat comes from (a room, a
// tournament) is for the page, which says what is wrong with it in the banner.

import type { ComponentChildren } from "preact";
import type { Acting } from "./acting";
import { gesture } from "./expressions";
import { useAnnounced } from "./following";
import { TableView } from "./view/TableView";
import { WaitingRoom } from "./view/WaitingRoom";

interface SeatedProps {
  acting: Acting;
  banner?: ComponentChildren;
  /** Beside the tools of the table. */
  tools?: ComponentChildren;
  /** The next step once the game is over. */
  onward?: ComponentChildren;
  /** Below the seats while the room waits. */
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
      onAnswer={acting.answer}
      onExpress={(label) => acting.express(gesture(label))}
    />
  );
}
