// How long something takes, in Spanish.

import { durations } from "../plural";

/** Milliseconds in words. */
export const time = durations("es", {
  second: { one: "# segundo", other: "# segundos" },
  minute: { one: "# minuto", other: "# minutos" },
  hour: { one: "# hora", other: "# horas" },
});
