// Parses the names of a study's participants: one per line, or a range such as "P01-P20".

/** Most participants that are added at a time. */
export const MAX_ADDED = 1_000;

/**
 * The distinct names in the order typed; at most one more than `MAX_ADDED`, so that an
 * excess is noticed.
 */
export function participantsIn(typed: string): string[] {
  const names = new Set<string>();
  for (const line of typed.split("\n"))
    for (const name of namesOf(line.trim())) {
      if (names.size > MAX_ADDED) return [...names];
      names.add(name);
    }
  return [...names];
}

/** The names of a line: a range, with as many digits as its start, or the line itself. */
function namesOf(line: string): string[] {
  if (line === "") return [];
  const range = /^(.*?)(\d{1,6})\s*[-–]\s*(.*?)(\d{1,6})$/.exec(line);
  const [, stem = "", first = "", again = "", last = ""] = range ?? [];
  const count = Number(last) - Number(first) + 1;
  if (!range || (again !== "" && again !== stem) || count < 1) return [line];
  return Array.from({ length: Math.min(count, MAX_ADDED + 1) }, (_, index) => {
    return stem + String(Number(first) + index).padStart(first.length, "0");
  });
}
