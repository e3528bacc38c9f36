// Links that bring a seat or a place to another device. What they bring comes after "#", which
// browsers send to no server.

import { isSecret } from "../api/secrets";

/** A ticket, the number of the seat or participant, and its name. */
export type Brought = readonly [ticket: string, number: number, name: string];

/** The address at a path of this page that brings something, under a name for its kind. */
export function linkBringing(path: string, kind: string, brought: Brought): string {
  return `${location.origin}${path}#${kind}=${encodeURIComponent(JSON.stringify(brought))}`;
}

/**
 * What the address brings for a room or tournament; null if the link was cut or is another's,
 * undefined if it brings nothing of this kind.
 */
export function broughtBy(kind: string, id: string): Brought | null | undefined {
  const mark = `${kind}=`;
  const [given] = location.hash
    .replace(/^#/, "")
    .split("&")
    .filter((part) => part.startsWith(mark));
  return given ? parsed(given.slice(mark.length), id) : undefined;
}

function parsed(text: string, id: string): Brought | null {
  try {
    const [ticket, number, name]: unknown[] = JSON.parse(decodeURIComponent(text));
    // A ticket begins with the id of its room or tournament.
    if (!isSecret(ticket) || !ticket.startsWith(id)) return null;
    return Number.isInteger(number) && typeof name === "string" ? [ticket, Number(number), name] : null;
  } catch {
    return null;
  }
}
