// Links that bring a seat or a place to another device. What they bring comes after "#", which
// browsers send to no server.

import { isSecret, keepSecret } from "../api/secrets";
import { Visibility } from "../gen/chefshat/v1/room_pb";
import { readdress } from "../router";
import { remember } from "../store";

/** What a device holds in a room or a tournament. */
interface Holding {
  readonly ticket: string;
  readonly name: string;
}

/** A kind of what a device holds. */
interface Kind<Held extends Holding> {
  /** Its name in links. */
  name: string;
  /** The path of the page of a room or tournament. */
  path: (id: string) => string;
  /** The key under which the device stores it. */
  key: (id: string) => string;
  /** What the device holds. */
  held: (id: string) => Held | null;
  /** The number of the seat or participant. */
  numberOf: (held: Held) => number;
  withNumber: (holding: Holding, number: number) => Held;
}

/** The links of a kind. */
export function linksBringing<Held extends Holding>(kind: Kind<Held>) {
  const mark = `${kind.name}=`;
  /** Removes what the address brings from the address; stores what was chosen, if anything. */
  const decide = (id: string, chosen: Held | null): void => {
    readdress(location.search);
    if (!chosen) return;
    remember(kind.key(id), JSON.stringify(chosen));
    // Whether it is needed is not known yet.
    keepSecret(chosen.ticket, { visibility: Visibility.PRIVATE });
  };
  /**
   * Stores what the address brings, if anything. If this device holds another seat or place there,
   * it is returned instead, and stays in the address until `decide`: taking it would lose the other.
   */
  const fromLink = (id: string): Held | null => {
    const [given] = location.hash
      .replace(/^#/, "")
      .split("&")
      .filter((part) => part.startsWith(mark));
    if (!given) return null;
    const brought = parsed(kind, given.slice(mark.length), id);
    const held = kind.held(id);
    if (brought && held && held.ticket !== brought.ticket) return brought;
    decide(id, brought);
    return null;
  };
  /** The address that brings what is held to another device. */
  const linkTo = (id: string, held: Held): string => {
    const brought = JSON.stringify([held.ticket, kind.numberOf(held), held.name]);
    return `${location.origin}${kind.path(id)}#${mark}${encodeURIComponent(brought)}`;
  };
  return { linkTo, fromLink, decide };
}

/** What a link brings; null if it was cut or is another room's or tournament's. */
function parsed<Held extends Holding>(kind: Kind<Held>, text: string, id: string): Held | null {
  try {
    const [ticket, number, name]: unknown[] = JSON.parse(decodeURIComponent(text));
    // A ticket begins with the id of its room or tournament.
    if (!isSecret(ticket) || !ticket.startsWith(id)) return null;
    return Number.isInteger(number) && typeof name === "string"
      ? kind.withNumber({ ticket, name }, Number(number))
      : null;
  } catch {
    return null;
  }
}
