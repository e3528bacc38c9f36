// The owner tokens and tickets that this device has received for what is unlisted or private. Calls
// about a room, a tournament or a record show those that may belong to it, and lists the newest ones:
// the server shows it only then. They stay after the end of a game, for its record.

import type { Message } from "@bufbuild/protobuf";
import type { Interceptor } from "@connectrpc/connect";
import { type RoomPolicy, Visibility } from "../gen/chefshat/v1/room_pb";
import { recall, recallObject, remember } from "../store";

/** The header that shows a secret. */
export const SECRET_HEADER = "chefshat-secret";
const STORED = "secrets";
/** Most secrets that the server accepts with a call. */
const MAX_SHOWN = 16;
/** Most secrets that are stored; older ones are dropped. */
const MAX_STORED = 200;

/**
 * Stores a secret of a room or tournament with this policy, unless it is public; with the game that
 * it shows if that is known.
 */
export function keepSecret(secret: string, policy: Pick<RoomPolicy, "visibility"> | undefined, gameId = ""): void {
  if (policy?.visibility !== Visibility.UNLISTED && policy?.visibility !== Visibility.PRIVATE) return;
  const others = kept().filter((other) => other.secret !== secret);
  remember(STORED, JSON.stringify({ kept: [{ secret, gameId }, ...others].slice(0, MAX_STORED) }));
}

/** Shows secrets with each call that they may be needed for. */
export const showSecrets: Interceptor = (next) => async (request) => {
  const show = (message: object) => {
    // The call may show one of its own.
    const shown = request.header.get(SECRET_HEADER)?.split(", ") ?? [];
    const more = secretsFor(request.method.name, message).filter((secret) => !shown.includes(secret));
    for (const secret of more.slice(0, MAX_SHOWN - shown.length)) request.header.append(SECRET_HEADER, secret);
  };
  if (!request.stream) {
    show(request.message);
    return next(request);
  }
  // The page calls no method with a stream of requests: there is one message.
  const messages: Message[] = [];
  for await (const message of request.message) messages.push(message);
  messages.forEach(show);
  return next({ ...request, message: again(messages) });
};

async function* again<Item>(items: readonly Item[]): AsyncIterable<Item> {
  yield* items;
}

/** The secrets to show with a call, the most likely ones first. */
export function secretsFor(method: string, message: object): string[] {
  const { roomId = "", tournamentId = "", gameId = "" }: Partial<Record<string, unknown>> = { ...message };
  const asked = [roomId, tournamentId, gameId].filter((id) => typeof id === "string" && id !== "");
  if (asked.length === 0 && !method.startsWith("List")) return [];
  // Of a table, this page may have the ticket alone (attend/ticket.ts).
  const table = recall(`table.${roomId}`);
  const all = [...(isSecret(table) ? [{ secret: table, gameId: "" }] : []), ...kept()];
  // A secret begins with the id of its room or tournament.
  const own = all.filter(({ secret, gameId: game }) => asked.includes(secret.slice(0, 32)) || asked.includes(game));
  // The room or game may belong to a tournament, of which the page knows nothing at this point.
  const others = all.filter((other) => !own.includes(other));
  return [...own, ...others].slice(0, MAX_SHOWN).map(({ secret }) => secret);
}

interface Kept {
  secret: string;
  gameId: string;
}

function kept(): Kept[] {
  const stored = recallObject(STORED, ({ kept: all }) => (Array.isArray(all) ? (all as unknown[]) : null));
  return (stored ?? []).flatMap((one) => {
    const { secret, gameId }: Partial<Record<string, unknown>> = { ...(one as object) };
    return isSecret(secret) ? [{ secret, gameId: typeof gameId === "string" ? gameId : "" }] : [];
  });
}

/** Whether a value may be a secret: the server refuses anything else. */
export function isSecret(value: unknown): value is string {
  return typeof value === "string" && /^[0-9a-f]{96}$/.test(value);
}
