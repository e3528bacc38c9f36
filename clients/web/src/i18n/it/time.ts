// How long something takes, in Italian.

import { durations } from "../plural";

/** Milliseconds in words. */
export const time = durations("it", {
  second: { one: "# secondo", other: "# secondi" },
  minute: { one: "# minuto", other: "# minuti" },
  hour: { one: "# ora", other: "# ore" },
});
