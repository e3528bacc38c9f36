// How long something takes, in English.

import { durations } from "../plural";

/** Milliseconds in words. */
export const time = durations("en", {
  second: { one: "# second", other: "# seconds" },
  minute: { one: "# minute", other: "# minutes" },
  hour: { one: "# hour", other: "# hours" },
});
