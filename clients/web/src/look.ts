// Light or dark: as the system says, or as the reader chose. The colours themselves are in theme.css.

import { signal } from "@preact/signals";
import { recall, remember } from "./store";

/** A look; "system" follows the system's setting. */
export type Look = "system" | "light" | "dark";

/** The look chosen. */
export const look = signal<Look>("system");

/** Takes the look that was chosen earlier on this device. */
export function startLook(): void {
  const chosen = recall("look");
  setLook(chosen === "light" || chosen === "dark" ? chosen : "system");
}

/** Chooses a look and keeps the choice on this device. */
export function setLook(chosen: Look): void {
  look.value = chosen;
  remember("look", chosen === "system" ? null : chosen);
  if (chosen === "system") delete document.documentElement.dataset.look;
  else document.documentElement.dataset.look = chosen;
}
