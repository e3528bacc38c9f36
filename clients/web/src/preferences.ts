// What a person has switched on or off for play at the table, stored on this device. The switches
// are in parts/Settings.tsx; sound has its own, at the table (table/sounds.ts).

import { signal } from "@preact/signals";
import { recall, remember } from "./store";

/** Each preference, and whether it is on at first. */
const AT_FIRST = {
  /** Cards, passing and playing by single keys. */
  keys: true,
  /** The turn in the title and the icon of the browser's tab. */
  tab: true,
  /** A notification of the turn while the page is not seen. */
  notification: false,
  vibration: true,
  /** Keeps the screen on at the table. */
  awake: true,
  /** Passes when nothing else is legal. */
  autoPass: false,
  /** Chooses a play before the turn. */
  plans: true,
  /** Shows special moments of the game in large, and the cards of the exchange on their way. */
  moments: true,
};

export type Preference = keyof typeof AT_FIRST;

const STORED = "prefers.";

const current = signal(
  Object.fromEntries(Object.entries(AT_FIRST).map(([name, on]) => [name, stored(name, on)])) as typeof AT_FIRST,
);

/** Whether a preference is on. A component that asks is rendered again when it changes. */
export function isOn(name: Preference): boolean {
  return current.value[name];
}

/** Switches a preference and stores the choice on this device. */
export function setPreference(name: Preference, on: boolean): void {
  current.value = { ...current.peek(), [name]: on };
  remember(STORED + name, on === AT_FIRST[name] ? null : on ? "on" : "off");
}

function stored(name: string, atFirst: boolean): boolean {
  const value = recall(STORED + name);
  return value === null ? atFirst : value === "on";
}
