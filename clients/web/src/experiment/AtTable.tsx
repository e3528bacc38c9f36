// A study at the table: offers the last questionnaire after the game. Hidden parts are in
// hiding.ts.

import { AfterStudy } from "./AfterStudy";
import { studyIn } from "./study";

interface AtTableProps {
  roomId: string;
  /**
   * Whether a game is over, with or without a result; false if the room was closed before a game.
   */
  over: boolean;
}

/** The study's part of a table's banner; null if this device takes part in no study. */
export function AtTable({ roomId, over }: AtTableProps) {
  const study = studyIn(roomId);
  if (!study || !over) return null;
  return <AfterStudy after={study.after} blanks={{ name: study.name, room: roomId }} />;
}
