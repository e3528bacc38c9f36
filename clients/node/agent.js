// An agent without an SDK: it reads the .proto files, joins a room or a tournament and takes a random legal action at every decision.
// It contains no rules of the game. It reconnects after a lost connection; with its ticket another process can resume its seat.
import { randomBytes, randomInt } from "node:crypto";
import { existsSync, readFileSync, renameSync, rmSync, writeFileSync } from "node:fs";
import path from "node:path";
import { setTimeout as sleep } from "node:timers/promises";
import { fileURLToPath, pathToFileURL } from "node:url";
import { parseArgs, promisify } from "node:util";
import grpc from "@grpc/grpc-js";
import loader from "@grpc/proto-loader";

const PROTO = process.env.CHEFSHAT_PROTO || fileURLToPath(new URL("../../proto", import.meta.url));
const FILES = ["room", "play", "tournament"].map((name) => `chefshat/v1/${name}_service.proto`);
const FORM = { includeDirs: [PROTO], keepCase: true, longs: Number, enums: String, oneofs: true, defaults: true };
export const protocol = grpc.loadPackageDefinition(loader.loadSync(FILES, FORM)).chefshat.v1;

const MAX_GAMES = 64; // Maximum number of games that a participant plays at a time.
const MAX_FAILURES = 160; // Maximum number of consecutive connections without progress: together with the delays about ten minutes.
const MAX_JOINS = 8; // Maximum number of attempts to join.
const MAX_DELAY_MS = 5_000; // Maximum delay between two connections or attempts.
const FINAL = [ // Not retried.
  "INVALID_ARGUMENT", "NOT_FOUND", "ALREADY_EXISTS", "PERMISSION_DENIED", "FAILED_PRECONDITION", "OUT_OF_RANGE", "UNIMPLEMENTED", "UNAUTHENTICATED",
].map((code) => grpc.status[code]);
const CHANNEL = {
  "grpc.keepalive_time_ms": 3_000, // Finds a dead connection before a decision is lost.
  "grpc.keepalive_timeout_ms": 5_000,
  "grpc.initial_reconnect_backoff_ms": 100, // Short: the delays between connections are the agent's own.
  "grpc.max_reconnect_backoff_ms": 1_000,
};

let warned = false;

/** Warns once if a token can be read on the way to another machine. */
function warnOfUnencrypted(authority) {
  const { hostname } = new URL(`http://${authority}`);
  if (warned || /^(localhost|127(\.\d+){3}|\[::1\])$/.test(hostname)) return;
  warned = true;
  console.error(`warning: the token is sent unencrypted to ${hostname}; use https://${hostname}`);
}

/** Connects to `address`: host:port, or https:// for TLS with the authorities in the PEM file `ca` or Node's own. Sends `token` with every call. */
function connect(Service, { address, token, ca }) {
  const [, scheme, authority] = /^(?:(https?):\/\/)?(.*?)\/*$/.exec(address);
  if (token && scheme !== "https") warnOfUnencrypted(authority);
  const tls = () => grpc.credentials.createSsl(ca ? readFileSync(ca) : null);
  const start = (metadata, listener, next) => {
    if (token) metadata.set("authorization", `Bearer ${token.trim()}`);
    next(metadata, listener);
  };
  const interceptors = [(options, next) => new grpc.InterceptingCall(next(options), { start })];
  return new Service(authority, scheme === "https" ? tls() : grpc.credentials.createInsecure(), { ...CHANNEL, interceptors });
}

/** Returns the legal actions of a mask: bit i%8 of byte i/8 is action i. */
export function legalActions(mask) {
  return Array.from({ length: mask.length * 8 }, (_, i) => i).filter((i) => mask[i >> 3] & (1 << (i & 7)));
}

/** The delay after the n-th failure in a row, in milliseconds. */
const delay = (n) => Math.min(MAX_DELAY_MS, 50 * 2 ** n) * (0.5 + 0.5 * Math.random());

async function join(Service, method, { pause = sleep, ...server }, request) {
  const service = connect(Service, server);
  // With the same id, a call that is repeated after a lost response takes no second seat.
  const asked = { kind: "PARTICIPANT_KIND_AGENT", request_id: randomBytes(32), ...request };
  try {
    for (let failures = 1; ; failures += 1) {
      try {
        return await promisify(service[method]).call(service, asked, { deadline: Date.now() + 30_000 });
      } catch (error) {
        if (failures === MAX_JOINS || FINAL.includes(error.code)) throw error;
        await pause(delay(failures));
      }
    }
  } finally { service.close(); }
}

/** A seat with a handler for each kind of update. `send` sends a command for it. A handler returns the outcome when the game is over. */
function seatOf(ticket, about = {}) {
  let [seat, end, open] = [undefined, {}, {}];
  const failed = (error) => ({ ...about, seat, error });
  const known = () => { // Its ticket may be unknown soon after the end.
    if (end.game_ended) return { ...about, seat, standings: end.game_ended.standings, over: true };
    return end.game_aborted && { ...failed(`the game has no result (${end.game_aborted.reason})`), over: true };
  };
  const self = {
    ticket,
    next: 0, // The number of the next event.
    attached: (attached) => { seat = attached.seat; },
    events: ({ events }, send) => events.filter(({ sequence }) => sequence >= self.next).forEach((event) => {
      self.next = event.sequence + 1;
      if (event.game_ended || event.game_aborted) end = event;
      if (event.substituted?.seat === seat) send({ resume: {} }); // Takes the seat back from its substitute.
    }),
    snapshot: ({ next_sequence }) => { self.next = Math.max(self.next, next_sequence); }, // Stands for events that the room no longer has.
    substitution: ({ active }, send) => { if (active) send({ resume: {} }); }, // The same where a study hides its participants.
    decision: (request, send) => {
      open = request;
      const legal = legalActions(request.action_mask);
      send({ answer: { decision_id: request.decision_id, action: legal[randomInt(legal.length)] } });
    },
    result: ({ decision_id, status }, send) => {
      const again = status === "ANSWER_STATUS_INVALID" && decision_id === open.decision_id; // The server does not repeat the request.
      if (again) self.decision(open, send);
    },
    refused: ({ message, reason }) => known() ?? failed(`refused: ${message} (${reason})`),
    detached: ({ reason }) => {
      if (reason === "DETACH_REASON_GAME_OVER") return known() ?? { ...failed("the game has no result"), over: true };
      return known() ?? failed(`the seat is lost (${reason})`);
    },
  };
  return self;
}

/** Plays with the ticket of a seat, or of a tournament participant with all its seats, until the game or tournament is over. */
async function playTicket(server, ticket) {
  const client = connect(protocol.PlayService, server);
  const pause = server.pause ?? sleep;
  let [seats, tournament, participant] = [[seatOf(ticket)]];
  const outcomes = [];
  let lost;
  try {
    for (let failures = 0; failures < MAX_FAILURES; failures += 1) {
      if (failures) await pause(delay(failures));
      lost = new Error("the server ended the stream");
      const stream = client.Play().on("error", (error) => { if (error.code !== "ABORT_ERR") lost = error; }); // Node's own, after such an end.
      const commands = seats.map(({ ticket, next }) => ({ attach: { ticket, from_sequence: next } }));
      if (tournament) commands.push({ attach: { ticket: tournament } }); // Last, so that the server does not attach its seats again.
      stream.write({ commands });
      const byHandle = new Map(seats.entries()); // Handles number the attachments of the client; the server adds further ones.
      let entered = tournament ? seats.length : -1;
      let messages = 0;
      try {
        for await (const { updates } of stream) {
          messages += 1;
          if (messages > 1) failures = 0; // A stream begins with the state, so only what follows it is progress.
          for (const { handle, update, [update]: content } of updates) {
            if (!update) continue; // Of a kind that is newer than the .proto files.
            if (content.reason === "DETACH_REASON_SERVER_STOPPING") continue; // The end of the stream follows.
            if (update === "refused" && !FINAL.includes(content.code)) throw (lost = new Error(content.message)); // For example, the room is gone from its server.
            const isOver = update === "attached" && outcomes.some(({ game_id, over }) => over && game_id === content.game_id);
            if (isOver) { // The connection was lost before the tournament counted the game.
              stream.write({ commands: [{ handle, detach: {} }] });
            } else if (update === "attached" && content.ticket) {
              const known = seats.find(({ ticket }) => ticket === content.ticket);
              byHandle.set(handle, known ?? seatOf(content.ticket, { game_id: content.game_id }));
              byHandle.get(handle).attached(content);
              if (!known) seats.push(byHandle.get(handle));
            } else if (update === "entered") { // The ticket is a participant's.
              [tournament, participant, entered] = [ticket, content.participant, handle];
              seats = seats.filter((seat) => seat.ticket !== ticket);
            } else if (handle === entered && (update === "refused" || update === "detached")) {
              if (content.reason !== "DETACH_REASON_TOURNAMENT_OVER") throw new Error(`the tournament is lost (${content.reason})`);
              tournament = undefined;
            } else {
              const seat = byHandle.get(handle);
              const outcome = seat?.[update]?.(content, (command) => stream.write({ commands: [{ handle, ...command }] }));
              if (!outcome) continue;
              outcomes.push(outcome);
              seats = seats.filter((other) => other !== seat);
              byHandle.delete(handle);
            }
            if (!tournament && !seats.length) return { participant, outcomes };
          }
        }
      } catch (error) { if (error !== lost || FINAL.includes(error.code)) throw error; } finally { stream.cancel(); }
    }
    throw lost;
  } finally { client.close(); }
}

/** Joins a room or a tournament. Returns the ticket. */
async function joinTable({ code, tournament, name, games, ...server }) {
  if (!tournament) return (await join(protocol.RoomService, "JoinRoom", server, { join_code: code, name })).ticket;
  const request = { join_code: tournament, name, max_games: Number(games) };
  return (await join(protocol.TournamentService, "JoinTournament", server, request)).ticket;
}

/**
 * Joins, or resumes with a `ticket`, and plays to the end. Returns the seat and the standings; for a tournament the participant's number
 * and the outcome of each game. Throws an error if there is no result. `pause` waits for milliseconds; default: a timer.
 */
export async function play({ ticket, ...way }) {
  const { participant, outcomes } = await playTicket(way, ticket ?? (await joinTable(way)));
  if (participant !== undefined) return { participant, games: outcomes.map(({ over, ...outcome }) => outcome) };
  const [{ error, over, ...outcome }] = outcomes;
  if (error) throw Object.assign(new Error(error), { over });
  return outcome;
}

/** Whether another process with this id is running. 0 is no id. */
function runs(pid) {
  try {
    return pid > 0 && pid !== process.pid && process.kill(pid, 0); // A restarted container may reuse its own id.
  } catch ({ code }) {
    return code === "EPERM";
  }
}

/**
 * Locks a ticket file during `use`, by a file next to it with the process id. The lock of a process that has ended, and one that is
 * empty after a power cut, are ignored. In a read-only folder or on a full disk an existing ticket is used without a lock.
 */
async function withLock(file, use) {
  const lock = file && beside(file, "lock");
  const free = () => { try { rmSync(lock, { force: true }); } catch { /* The next process ignores it. */ } };
  const take = () => {
    try {
      writeFileSync(lock, `${process.pid} ${BOOT}`, { flag: "wx" });
    } catch (error) {
      if (error.code !== "EEXIST") free();
      throw error;
    }
  };
  if (!file) return use();
  try {
    take();
  } catch (error) {
    if (error.code !== "EEXIST" && existsSync(file)) return use();
    if (error.code !== "EEXIST") throw error;
    const [pid, boot = BOOT] = readFileSync(lock, "utf8").split(" ");
    if (boot === BOOT && runs(Number(pid))) throw new Error(`another agent uses ${file}; if process ${pid} is not an agent, remove ${lock}`);
    rmSync(lock, { force: true });
    take();
  }
  try {
    return await use();
  } finally {
    free();
  }
}

const beside = (file, what) => path.join(path.dirname(file), `.${path.basename(file)}.${what}`);
const stored = (file) => (file && existsSync(file) ? readFileSync(file, "utf8").trim() : "");
const BOOT = stored("/proc/sys/kernel/random/boot_id"); // On Linux: process ids from before the last boot mean nothing.

/** Returns the ticket in the file, or joins and stores or prints the new ticket. */
async function ticketOf(file, way) {
  if (stored(file)) {
    console.error(`resuming with the ticket in ${file}`);
    return stored(file);
  }
  if (!way.code && !way.tournament) throw new Error("give --code, --tournament or --ticket");
  const part = file && beside(file, "new");
  if (file) {
    rmSync(part, { force: true });
    writeFileSync(part, "", { flag: "wx", mode: 0o600 }); // Before joining, and readable only by the owner.
  }
  try {
    const ticket = await joinTable(way);
    let how = `with --ticket ${ticket}`;
    if (file) {
      try {
        writeFileSync(part, `${ticket}\n`, { flush: true });
        renameSync(part, file);
        how = `by the same command: the ticket is in ${file}`;
      } catch (error) { // The ticket exists nowhere else, so it is printed.
        console.error(`warning: cannot store the ticket in ${file}: ${error.message}`);
      }
    }
    console.error(`if this process ends before the ${way.tournament ? "tournament" : "game"}, resume ${how}`);
    return ticket;
  } finally {
    if (file) rmSync(part, { force: true });
  }
}

/** Deletes the file of a used ticket, unless it has another ticket by now. */
function forget(file, ticket) {
  try {
    if (stored(file) === ticket) rmSync(file, { force: true });
  } catch (error) {
    console.error(`warning: cannot delete the used ticket: ${error.message}; remove ${file}`);
  }
}

if (import.meta.url === pathToFileURL(process.argv[1] ?? "").href) {
  const option = (value) => ({ type: "string", default: value });
  const own = { ticket: option(process.env.CHEFSHAT_TICKET), "ticket-file": option() };
  const where = { address: option("127.0.0.1:50051"), code: option(), tournament: option() };
  const access = { token: option(process.env.CHEFSHAT_TOKEN), ca: option(process.env.CHEFSHAT_CA) };
  for (const signal of ["SIGINT", "SIGTERM"]) {
    process.once(signal, () => { // As process 1, a container's program is not ended by a signal that it does not handle.
      console.error("agent: stopped by a signal");
      process.exit(1); // The ticket remains in its file.
    });
  }
  try {
    const { values } = parseArgs({ options: { ...where, ...access, ...own, name: option("Node"), games: option("1") } });
    const { ticket: given, "ticket-file": file, ...way } = values;
    if ([way.code, way.tournament, given].filter(Boolean).length > 1 || (given && file)) {
      throw new Error("give one of --code, --tournament and --ticket (or CHEFSHAT_TICKET); --ticket-file excludes --ticket");
    }
    if (!/^\d{1,2}$/.test(way.games) || !(way.games >= 1 && way.games <= MAX_GAMES)) throw new Error(`--games must be a number from 1 to ${MAX_GAMES}`);
    way.code ??= way.tournament ? undefined : process.env.CHEFSHAT_CODE;
    const outcome = await withLock(file, async () => {
      const ticket = given || (await ticketOf(file, way));
      const end = () => { if (file) forget(file, ticket); };
      return play({ ...way, ticket }).then((played) => { end(); return played; }, (error) => { if (error.over) end(); throw error; });
    });
    console.log(JSON.stringify(outcome));
  } catch (error) {
    console.error(`agent: ${error.details ?? error.message}`);
    process.exitCode = 1;
  }
}
