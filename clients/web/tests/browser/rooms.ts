// Rooms and agents for browser tests. Rooms are created over the protocol, so that a test controls
// rules and opponents; agents are separate processes. Players' actions are in play.ts.

import { spawn } from "node:child_process";
import { existsSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { fromJson, type JsonValue } from "@bufbuild/protobuf";
import { createClient, type Interceptor } from "@connectrpc/connect";
import { createGrpcWebTransport } from "@connectrpc/connect-web";
import { type RecordLine, RecordLineSchema } from "../../src/gen/chefshat/v1/record_pb";
import { ParticipantKind, type RoomPolicy } from "../../src/gen/chefshat/v1/room_pb";
import { RoomService } from "../../src/gen/chefshat/v1/room_service_pb";
import { StudyService } from "../../src/gen/chefshat/v1/study_service_pb";
import { TableService } from "../../src/gen/chefshat/v1/table_service_pb";
import { TournamentService } from "../../src/gen/chefshat/v1/tournament_service_pb";
import { type Server, until } from "./stage";

/** Clients of a server's services, for Node, with the token of a host if the server requires tokens. */
export function clientsOf(server: Server) {
  const authorize: Interceptor = (next) => (request) => {
    if (server.token) request.header.set("Authorization", `Bearer ${server.token}`);
    return next(request);
  };
  const transport = createGrpcWebTransport({ baseUrl: server.url, interceptors: [authorize] });
  return {
    rooms: createClient(RoomService, transport),
    tournaments: createClient(TournamentService, transport),
    tables: createClient(TableService, transport),
    studies: createClient(StudyService, transport),
  };
}

/** The options of a room. */
interface Wanted {
  name?: string;
  /** Each seat: a built-in agent by name, or reserved for a person, an agent or a person as a robot ("wizard"). */
  seats: readonly string[];
  shifts?: number;
  /** Fewer than 11 for a short Shift. */
  faces?: number;
  /**
   * Starts with the second Shift and these hands instead of a first deal. Jokers are one more than
   * the faces. The last hand with the top face holds the Golden card; the first seat finished last
   * in the previous Shift.
   */
  hands?: readonly (readonly number[])[];
  /** Whether the game is rated and so dealt at random; otherwise its deals are fixed. */
  rated?: boolean;
  policy?: Partial<
    Pick<RoomPolicy, "hints" | "paceMs" | "spectatorDelayDecisions" | "spectatorsSeeHands" | "visibility">
  >;
}

const AN_HOUR_MS = 3_600_000;

/** Creates a room for a few Shifts that waits an hour for each decision, also of those who are away. */
export async function newRoom(
  server: Server,
  wanted: Wanted,
): Promise<{ roomId: string; code: string; ownerToken: string }> {
  const { room, joinCode, ownerToken } = await clientsOf(server).rooms.createRoom({
    name: wanted.name ?? "Friday evening",
    rules: { preset: "paper", faces: wanted.faces ?? 11, stop: { case: "targetShifts", value: wanted.shifts ?? 1 } },
    seats: wanted.seats.map((who) => ({ filledBy: filledBy(who) })),
    policy: { decisionTimeMs: AN_HOUR_MS, absenceTimeMs: AN_HOUR_MS, paceMs: 0, spectators: true, ...wanted.policy },
    ...(wanted.hands && { start: { case: "scripted" as const, value: secondShift(wanted.hands, wanted.faces ?? 11) } }),
    ...(wanted.rated ? {} : { gameSeed: new Uint8Array(32).fill(7) }),
  });
  if (!room) throw new Error("the server did not say which room it made");
  return { roomId: room.roomId, code: joinCode, ownerToken };
}

/** Creates a room whose cards are real, with people at the table and a built-in agent. */
export async function newPhysicalRoom(server: Server, names: readonly string[]) {
  const atTable = names.map((name) => ({ name, filledBy: { case: "atTable" as const, value: ParticipantKind.HUMAN } }));
  const { room, tableTicket } = await clientsOf(server).rooms.createRoom({
    name: "Kitchen table",
    rules: { preset: "paper", players: names.length + 1 },
    seats: [...atTable, { filledBy: filledBy("greedy") }],
    physical: true,
  });
  if (!room) throw new Error("the server did not say which room it made");
  return { roomId: room.roomId, tableTicket };
}

function secondShift(dealt: readonly (readonly number[])[], top: number) {
  const golden = dealt.findLastIndex((cards) => cards.includes(top));
  const hands = dealt.map((cards, seat) => ({ seat, cards: cards.toSorted((a, b) => a - b), golden: seat === golden }));
  return { shift: 2, hands, lastOrder: [...dealt.keys()].slice(1).concat(0) };
}

function filledBy(who: string) {
  if (who === "person") return { case: "reservedFor" as const, value: ParticipantKind.HUMAN };
  if (who === "agent") return { case: "reservedFor" as const, value: ParticipantKind.AGENT };
  if (who === "wizard") return { case: "wizard" as const, value: ParticipantKind.ROBOT };
  return { case: "builtInAgent" as const, value: who };
}

/** Runs a command of the program and returns its exit code. */
export function program(...args: readonly string[]): Promise<number | null> {
  const child = spawn(process.env.CHEFSHAT_BIN ?? "", args, { stdio: "ignore" });
  return new Promise((resolve, reject) => {
    child.once("error", reject);
    child.once("exit", resolve);
  });
}

/** Runs an agent for one game. Returns its exit code, 0 if the game ended normally. */
export function agent(server: Server, kind: string, code: string, name: string): Promise<number | null> {
  return program("agent", kind, "--server", server.url, "--code", code, "--name", name, "--seed", "1");
}

/** The id of a room's game. */
export async function gameOf(server: Server, roomId: string): Promise<string> {
  const { room } = await clientsOf(server).rooms.getRoom({ roomId });
  return room?.gameId ?? "";
}

/** The record of a finished game, once the server has written it. */
export async function recordOf(server: Server, gameId: string): Promise<RecordLine[]> {
  const path = join(server.dataDir, "records", `${gameId}.jsonl`);
  await until(() => existsSync(path));
  const lines = readFileSync(path, "utf8").trim().split("\n");
  return lines.map((line) => fromJson(RecordLineSchema, JSON.parse(line) as JsonValue));
}
