// How long the robot should seem to think: a time for each decision, drawn between two bounds. The
// invitation can set the bounds (`?think=2-6`, seconds); they are stored on this device.

import { recall, remember } from "../store";

/** Bounds of the time for a decision, seconds. */
export interface Pace {
  readonly least: number;
  readonly most: number;
}

export const FIRST_PACE: Pace = { least: 2, most: 6 };
/** Longest time, seconds. */
export const MAX_PACE = 60;

const PACE = "wizard.pace";

/** The bounds of a text like "2-6"; undefined if it has none. */
export function paceOf(text: string): Pace | undefined {
  const found = /^(\d+(?:\.\d+)?)-(\d+(?:\.\d+)?)$/.exec(text.trim());
  const least = Number(found?.[1]);
  const most = Number(found?.[2]);
  return found && least <= most && most <= MAX_PACE ? { least, most } : undefined;
}

export function storedPace(): Pace {
  return paceOf(recall(PACE) ?? "") ?? FIRST_PACE;
}

export function storePace({ least, most }: Pace): void {
  remember(PACE, `${least}-${most}`);
}

/**
 * A time for a decision, milliseconds. Short times are drawn as often as long ones on a logarithmic
 * scale, as people and programs take them; `chance` is from 0 to 1.
 */
export function drawn({ least, most }: Pace, chance: number): number {
  if (least <= 0) return Math.round(1000 * most * chance);
  return Math.round(1000 * least * (most / least) ** chance);
}
