// One agent, without an SDK: it reads the .proto files, takes a seat with a join code and plays a random legal action at every
// decision, in one game or in all of its games of a tournament. It knows no rules of the game. A lost connection is made again and
// resumes where it broke off; with its ticket another process goes on in its place.
import { randomInt } from "node:crypto";
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

const MAX_GAMES = 64; // A participant may play so many games at a time.
const MAX_FAILURES = 9; // Connections in a row that may bring nothing before the agent gives up.
const connect = (Service, address) => new Service(address, grpc.credentials.createInsecure());

/** The legal actions of a mask: bit i%8 of byte i/8 is action i. */
export function legalActions(mask) {
  return Array.from({ length: mask.length * 8 }, (_, i) => i).filter((i) => mask[i >> 3] & (1 << (i & 7)));
}

function join(Service, method, address, request) {
  const service = connect(Service, address);
  const asked = { kind: "PARTICIPANT_KIND_AGENT", ...request };
  return promisify(service[method]).call(service, asked, { deadline: Date.now() + 30_000 }).finally(() => service.close());
}

/** One seat: what it makes of each update it is told. `say` sends a command for it. What is returned is the outcome of its game. */
function takeSeat(ticket, about = {}) {
  let [seat, end, open] = [undefined, {}, {}];
  const failed = (error) => ({ ...about, seat, error });
  const self = {
    ticket,
    next: 0, // The first event it has not seen.
    attached: (attached) => { seat = attached.seat; },
    events: ({ events }, say) => events.filter(({ sequence }) => sequence >= self.next).forEach((event) => {
      self.next = event.sequence + 1;
      if (event.game_ended || event.game_aborted) end = event;
      if (event.substituted?.seat === seat) say({ resume: {} }); // Back from being late too often.
    }),
    decision: (request, say) => {
      open = request;
      const legal = legalActions(request.action_mask);
      say({ answer: { decision_id: request.decision_id, action: legal[randomInt(legal.length)] } });
    },
    result: ({ decision_id, status }, say) => {
      const again = status === "ANSWER_STATUS_INVALID" && decision_id === open.decision_id; // It is not put again.
      if (again) self.decision(open, say);
    },
    refused: ({ message, reason }) => failed(`refused: ${message} (${reason})`),
    detached: ({ reason }) => {
      if (reason !== "DETACH_REASON_GAME_OVER") return failed(`the seat is lost (${reason})`);
      if (!end.game_ended) return { ...failed(`the game has no result (${end.game_aborted?.reason})`), over: true };
      return { ...about, seat, standings: end.game_ended.standings };
    },
  };
  return self;
}

/** Plays the seat that the ticket is of or, if it is of a participant in a tournament, all that the server gives it, until all is over. */
async function playPlace(address, ticket) {
  const client = connect(protocol.PlayService, address);
  let [seats, tournament, participant] = [[takeSeat(ticket)]];
  let [outcomes, lost] = [[], new Error("the server ended the stream")];
  try {
    for (let failures = 0; failures < MAX_FAILURES; failures += 1) {
      await sleep(failures && 50 * 2 ** failures);
      const stream = client.Play().on("error", (error) => { lost = error; });
      const commands = seats.map(({ ticket, next }) => ({ attach: { ticket, from_sequence: next } }));
      if (tournament) commands.push({ attach: { ticket: tournament } }); // Last, so that it is not given the seats it has already.
      stream.write({ commands });
      const byHandle = new Map(seats.entries()); // A handle is the number of an attachment, until the server makes its own.
      let entered = tournament ? seats.length : -1;
      try {
        for await (const { updates } of stream) {
          failures = 0;
          for (const { handle, update, [update]: content } of updates) {
            if (update === "attached" && content.ticket) {
              const known = seats.find(({ ticket }) => ticket === content.ticket);
              byHandle.set(handle, known ?? takeSeat(content.ticket, { game_id: content.game_id }));
              byHandle.get(handle).attached(content);
              if (!known) seats.push(byHandle.get(handle));
            } else if (update === "entered") { // The ticket is no seat's.
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
      } catch (error) { if (error !== lost) throw error; } finally { stream.cancel(); }
    }
    throw lost;
  } finally { client.close(); }
}

/** Takes a place in a room or a tournament; gives its ticket. */
async function takePlace({ address, code, tournament, name, games }) {
  if (!tournament) return (await join(protocol.RoomService, "JoinRoom", address, { join_code: code, name })).ticket;
  const request = { join_code: tournament, name, max_games: Number(games) };
  return (await join(protocol.TournamentService, "JoinTournament", address, request)).ticket;
}

/**
 * Takes a place, or goes on in the one whose `ticket` is given, and plays to the end. Gives the seat and the standings; of a tournament
 * the participant's number and what came of each of its games. Throws an error that says why there is no such thing.
 */
export async function play({ ticket, ...way }) {
  const { participant, outcomes } = await playPlace(way.address, ticket ?? (await takePlace(way)));
  if (participant !== undefined) return { participant, games: outcomes.map(({ over, ...outcome }) => outcome) };
  const [{ error, over, ...outcome }] = outcomes;
  if (error) throw Object.assign(new Error(error), { over });
  return outcome;
}

/** Whether another process with this number runs. */
function runs(pid) {
  try {
    return pid !== process.pid && process.kill(pid, 0); // One's own number was another's before, where a container counts anew.
  } catch ({ code }) {
    return code === "EPERM";
  }
}

/**
 * Does something with a ticket file alone: a lock beside it names the process. That of a process which is gone counts for nothing.
 * A folder that nobody may write in needs none to go on with the ticket that is there.
 */
async function alone(file, use) {
  const lock = file && beside(file, "lock");
  const take = () => writeFileSync(lock, `${process.pid}`, { flag: "wx" });
  if (!file) return use();
  try {
    take();
  } catch (error) {
    if (error.code !== "EEXIST" && existsSync(file)) return use();
    if (error.code !== "EEXIST") throw error;
    const pid = Number(readFileSync(lock, "utf8"));
    if (runs(pid)) throw new Error(`another agent plays in the place of ${file}; if process ${pid} is none, remove ${lock}`);
    rmSync(lock, { force: true });
    take();
  }
  try {
    return await use();
  } finally {
    try { rmSync(lock, { force: true }); } catch { /* It is nobody's any more, and counts for nothing. */ }
  }
}

const beside = (file, what) => path.join(path.dirname(file), `.${path.basename(file)}.${what}`);
const kept = (file) => (file && existsSync(file) ? readFileSync(file, "utf8").trim() : "");

/** The ticket of the place to play in: that in the file, or of one that is taken now and then kept there, or at least told. */
async function ticketOf(file, way) {
  if (kept(file)) {
    console.error(`goes on in the place whose ticket is in ${file}`);
    return kept(file);
  }
  if (!way.code && !way.tournament) throw new Error("give --code, --tournament or the --ticket of a place that was taken before");
  const part = file && beside(file, "new");
  if (file) {
    rmSync(part, { force: true });
    writeFileSync(part, "", { flag: "wx", mode: 0o600 }); // Before the place is taken, and for its owner alone.
  }
  try {
    const ticket = await takePlace(way);
    let how = `another goes on with --ticket ${ticket}`;
    if (file) {
      try {
        writeFileSync(part, `${ticket}\n`);
        renameSync(part, file);
        how = `it goes on in its place when it is started again: ${file} has its ticket`;
      } catch (error) { // The place is taken, and nobody else knows the ticket.
        console.error(`warning: ${file} cannot keep the ticket: ${error.message}`);
      }
    }
    console.error(`should this agent end before its ${way.tournament ? "tournament" : "game"}, ${how}`);
    return ticket;
  } finally {
    if (file) rmSync(part, { force: true });
  }
}

/** All is over: the file goes, unless another ticket is in it by now. */
function forget(file, ticket) {
  try {
    if (kept(file) === ticket) rmSync(file, { force: true });
  } catch (error) {
    console.error(`warning: all is over, but its ticket is still kept: ${error.message}; remove ${file}`);
  }
}

if (import.meta.url === pathToFileURL(process.argv[1] ?? "").href) {
  const option = (value) => ({ type: "string", default: value });
  const own = { ticket: option(process.env.CHEFSHAT_TICKET), "ticket-file": option() };
  const where = { address: option("127.0.0.1:50051"), code: option(), tournament: option() };
  try {
    const { values } = parseArgs({ options: { ...where, ...own, name: option("Node"), games: option("1") } });
    const { ticket: given, "ticket-file": file, ...way } = values;
    if ([way.code, way.tournament, given].filter(Boolean).length > 1 || (given && file)) {
      throw new Error("give one of --code, --tournament and --ticket (or CHEFSHAT_TICKET); --ticket-file is for the first two");
    }
    if (!/^\d{1,2}$/.test(way.games) || !(way.games >= 1 && way.games <= MAX_GAMES)) throw new Error(`--games is a number from 1 to ${MAX_GAMES}`);
    way.code ??= way.tournament ? undefined : process.env.CHEFSHAT_CODE;
    const outcome = await alone(file, async () => {
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
