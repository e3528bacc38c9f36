// The ticket of a physical table: what this device may report about, and the link that gives the
// same to a tablet beside the table. The link has it after "#", which browsers send to no server.

import { isSecret } from "../api/secrets";
import { pathOf, readdress } from "../router";
import { recall, remember } from "../store";

const MARK = "#ticket=";

/** The ticket of a room's table on this device, if any. */
export function tableTicket(roomId: string): string | null {
  return recall(`table.${roomId}`);
}

/** Stores the ticket of a room's table; null deletes it. */
export function keepTableTicket(roomId: string, ticket: string | null): void {
  remember(`table.${roomId}`, ticket);
}

/** The address that opens the attendant's view on another device. */
export function attendantLink(roomId: string, ticket: string): string {
  return `${location.origin}${pathOf({ page: "attend", roomId })}${MARK}${encodeURIComponent(ticket)}`;
}

/** The ticket in the hash of an address; null if it has none. */
export function ticketIn(hash: string): string | null {
  if (!hash.startsWith(MARK)) return null;
  try {
    return decodeURIComponent(hash.slice(MARK.length)) || null;
  } catch {
    return null;
  }
}

/**
 * The ticket for a room: from the address, where it is removed so that it is not shown or shared by
 * accident, else this device's.
 */
export function takeTicket(roomId: string): string | null {
  const given = ticketIn(location.hash);
  if (given === null) return tableTicket(roomId);
  readdress(location.search);
  // One that was cut, or is that of another room, must not replace a good one.
  if (isSecret(given) && given.startsWith(roomId)) keepTableTicket(roomId, given);
  return tableTicket(roomId);
}
