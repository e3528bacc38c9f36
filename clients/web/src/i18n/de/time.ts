// How long something takes, in German.

import { durations } from "../plural";

/** Milliseconds in words. */
export const time = durations("de", {
  second: { one: "# Sekunde", other: "# Sekunden" },
  minute: { one: "# Minute", other: "# Minuten" },
  hour: { one: "# Stunde", other: "# Stunden" },
});
