// The colour theme: light, dark, or as the system is set. The colours are in theme.css.

import { signal } from "@preact/signals";
import { recall, remember } from "./store";

/** A theme; "system" follows the system's setting. */
export type Theme = "system" | "light" | "dark";

/** The chosen theme. */
export const theme = signal<Theme>("system");

/** Applies the theme chosen earlier on this device. */
export function startTheme(): void {
  const chosen = recall(STORED);
  setTheme(chosen === "light" || chosen === "dark" ? chosen : "system");
}

/** Applies a theme and stores the choice on this device. */
export function setTheme(chosen: Theme): void {
  theme.value = chosen;
  remember(STORED, chosen === "system" ? null : chosen);
  if (chosen === "system") delete document.documentElement.dataset.theme;
  else document.documentElement.dataset.theme = chosen;
}

/** Name in the device's storage; older versions of the page wrote it too. */
const STORED = "look";
