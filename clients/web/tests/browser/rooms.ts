// Rooms and agents for browser tests: rooms made over the protocol, so that a test has the rules
// and opponents it needs, and agents that are programs of their own and connect as anybody's would.
// What people do on the page is in play.ts.

import { spawn } from "node:child_process";
import { existsSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { fromJson, type JsonValue } from "@bufbuild/protobuf";
import { createClient } from "@connectrpc/connect";
import { createGrpcWebTransport } from "@connectrpc/connect-web";
import { type RecordLine, RecordLineSchema } from "../../src/gen/chefshat/v1/record_pb";
import { ParticipantKind, type RoomPolicy } from "../../src/gen/chefshat/v1/room_pb";
import { RoomService } from "../../src/gen/chefshat/v1/room_service_pb";
import { TournamentService } from "../../src/gen/chefshat/v1/tournament_service_pb";
import { type Server, until } from "./stage";

/** Clients of a server's services, as a program in Node has them. */
export function clientsOf(server: Server) {
  const transport = createGrpcWebTransport({ baseUrl: server.url });
  return { rooms: createClient(RoomService, transport), tournaments: createClient(TournamentService, transport) };
}

/** What a test wants of a room. */
interface Wanted {
  name?: string;
  /** Who has each seat: a built-in agent by name, or free for a person or an agent. */
  seats: readonly string[];
  shifts?: number;
  /** Fewer than 11 for a short Shift. */
  faces?: number;
  /** The second Shift to begin with instead of a first deal: a hand for each seat, by face, a joker being one more than the faces. The top face
   * of the last hand that has it is the Golden card; in the Shift before the first seat was last. */
  hands?: readonly (readonly number[])[];
  /**
   * A game that counts for the leaderboard, and so is dealt by chance; otherwise the deals are
   * always the same.
   */
  rated?: boolean;
  policy?: Partial<Pick<RoomPolicy, "paceMs" | "spectatorDelayDecisions" | "spectatorsSeeHands">>;
}

/** A room of some Shifts without hurry. */
export async function newRoom(
  server: Server,
  wanted: Wanted,
): Promise<{ roomId: string; code: string; ownerToken: string }> {
  const { room, joinCode, ownerToken } = await clientsOf(server).rooms.createRoom({
    name: wanted.name ?? "Friday evening",
    rules: { preset: "paper", faces: wanted.faces ?? 11, stop: { case: "targetShifts", value: wanted.shifts ?? 1 } },
    seats: wanted.seats.map((who) => ({ filledBy: filledBy(who) })),
    policy: { decisionTimeMs: 3_600_000, paceMs: 0, spectators: true, ...wanted.policy },
    ...(wanted.hands && { start: { case: "scripted" as const, value: secondShift(wanted.hands, wanted.faces ?? 11) } }),
    ...(wanted.rated ? {} : { gameSeed: new Uint8Array(32).fill(7) }),
  });
  if (!room) throw new Error("the server did not say which room it made");
  return { roomId: room.roomId, code: joinCode, ownerToken };
}

function secondShift(dealt: readonly (readonly number[])[], top: number) {
  const golden = dealt.findLastIndex((cards) => cards.includes(top));
  const hands = dealt.map((cards, seat) => ({ seat, cards: cards.toSorted((a, b) => a - b), golden: seat === golden }));
  return { shift: 2, hands, lastOrder: [...dealt.keys()].slice(1).concat(0) };
}

function filledBy(who: string) {
  if (who === "person") return { case: "reservedFor" as const, value: ParticipantKind.HUMAN };
  if (who === "agent") return { case: "reservedFor" as const, value: ParticipantKind.AGENT };
  return { case: "builtInAgent" as const, value: who };
}

/** Runs a command of the program and gives its exit code once it has ended. */
export function program(...args: readonly string[]): Promise<number | null> {
  const child = spawn(process.env.CHEFSHAT_BIN ?? "", args, { stdio: "ignore" });
  return new Promise((resolve, reject) => {
    child.once("error", reject);
    child.once("exit", resolve);
  });
}

/** An agent that plays one game; gives its exit code, 0 if the game came to its end. */
export function agent(server: Server, kind: string, code: string, name: string): Promise<number | null> {
  return program("agent", kind, "--server", server.url, "--code", code, "--name", name, "--seed", "1");
}

/** The game that a room played or plays. */
export async function gameOf(server: Server, roomId: string): Promise<string> {
  const { room } = await clientsOf(server).rooms.getRoom({ roomId });
  return room?.gameId ?? "";
}

/** The record of a game that is over, once the server has written it. */
export async function recordOf(server: Server, gameId: string): Promise<RecordLine[]> {
  const path = join(server.dataDir, "records", `${gameId}.jsonl`);
  await until(() => existsSync(path));
  const lines = readFileSync(path, "utf8").trim().split("\n");
  return lines.map((line) => fromJson(RecordLineSchema, JSON.parse(line) as JsonValue));
}
