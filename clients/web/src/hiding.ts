// The parts of the page that a study hides from its participants. hiding.css hides most of them by
// `data-hide` of the document; screen reader announcements and keyboard handling ask here.

import { signal } from "@preact/signals";
import "./hiding.css";
import { documentMarker } from "./parts/marks";

/** A part that a study can hide. */
export type Hideable = "log" | "lookup" | "expressions" | "played" | "pages";

/** The hidden parts; empty outside a study. */
export const hidden = signal<readonly Hideable[]>([]);

/** Hides parts until the returned function is called. */
export const leaveOut = documentMarker<Hideable>("hide", (parts) => {
  hidden.value = parts;
});
