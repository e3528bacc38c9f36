// The key of the names used on this device, which tells them from the same names of others
// (`JoinRoomRequest.name_key`). It is made when a person first joins; the settings show it, so that
// another device can have it too.

import { fromHex, hex } from "./hex";
import { recall, remember } from "./store";

const STORED = "nameKey";
const BYTES = 32;

/** The key as 64 hexadecimal digits; null before anybody joined. */
export function nameKeyText(): string | null {
  const text = recall(STORED);
  return text !== null && isNameKey(text) ? text : null;
}

/** Whether a text is a key. */
export function isNameKey(text: string): boolean {
  return new RegExp(`^[0-9a-f]{${2 * BYTES}}$`, "i").test(text);
}

/** Stores the key of another device here. */
export function setNameKey(text: string): void {
  remember(STORED, text.toLowerCase());
}

/** The key, which is made and stored the first time. */
export function nameKey(): Uint8Array<ArrayBuffer> {
  const text = nameKeyText();
  if (text !== null) return fromHex(text);
  const key = crypto.getRandomValues(new Uint8Array(BYTES));
  setNameKey(hex(key));
  return key;
}

/** For names that are not the person's own: pseudonyms of studies, and robots. */
export const NO_KEY = new Uint8Array();
