// A study at the table: when the game is over its last questionnaire is offered. What is left out is in hiding.ts.

import { AfterStudy } from "./AfterStudy";
import { studyIn } from "./study";

interface AtTableProps {
  roomId: string;
  /** Whether a game is over, with a result or without; not where a room was closed before one began. */
  over: boolean;
}

/** What a study adds to the banner of a table; nothing where this device takes part in none. */
export function AtTable({ roomId, over }: AtTableProps) {
  const study = studyIn(roomId);
  if (!study || !over) return null;
  return <AfterStudy after={study.after} blanks={{ name: study.name, room: roomId }} />;
}
