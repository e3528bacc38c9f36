// The names of a study's participants as they are typed: one a line, or a range such as "P01-P20". Their links are in StudyLinks.tsx.

import { MAX_NAME } from "../lobby/room-form";

/** Most participants at a time: each may get a room of their own, and a server holds only so many. */
export const MAX_PARTICIPANTS = 100;

/** The names, each once, in the order in which they were typed; no more than `MAX_PARTICIPANTS` and one, so that too many can be told. */
export function participantsIn(typed: string): string[] {
  const names = new Set<string>();
  for (const line of typed.split("\n"))
    for (const name of namesOf(line.trim())) {
      if (names.size > MAX_PARTICIPANTS) return [...names];
      names.add(name);
    }
  return [...names];
}

/** The names that a line stands for: those of a range with as many digits as its first has, or the line itself. */
function namesOf(line: string): string[] {
  if (line === "") return [];
  const range = /^(.*?)(\d{1,6})\s*[-–]\s*(.*?)(\d{1,6})$/.exec(line);
  const [, stem = "", first = "", again = "", last = ""] = range ?? [];
  const count = Number(last) - Number(first) + 1;
  if (!range || (again !== "" && again !== stem) || count < 1) return [line];
  return Array.from({ length: Math.min(count, MAX_PARTICIPANTS + 1) }, (_, index) => {
    return stem + String(Number(first) + index).padStart(first.length, "0");
  });
}

/** Whether a name has more characters than the server takes: nobody could sit down by its link. */
export function isTooLong(name: string): boolean {
  return Array.from(name).length > MAX_NAME;
}
