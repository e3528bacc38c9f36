// One agent, without an SDK: it reads the .proto files, takes a seat with a join code and plays a random legal action at every
// decision, in one game or in all of its games of a tournament. It knows no rules of the game. A lost connection is made again and
// resumes where it broke off; with its ticket another process goes on in its place.
import { randomInt } from "node:crypto";
import { existsSync, readFileSync, renameSync, rmSync, writeFileSync } from "node:fs";
import { setTimeout as sleep } from "node:timers/promises";
import { fileURLToPath, pathToFileURL } from "node:url";
import { parseArgs, promisify } from "node:util";
import grpc from "@grpc/grpc-js";
import loader from "@grpc/proto-loader";

const PROTO = process.env.CHEFSHAT_PROTO || fileURLToPath(new URL("../../proto", import.meta.url));
const FILES = ["room", "play", "tournament"].map((name) => `chefshat/v1/${name}_service.proto`);
const FORM = { includeDirs: [PROTO], keepCase: true, longs: Number, enums: String, oneofs: true, defaults: true };
export const protocol = grpc.loadPackageDefinition(loader.loadSync(FILES, FORM)).chefshat.v1;

const NO_RESULT = "the game has no result";
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
      if (!end.game_ended) return failed(`${NO_RESULT} (${end.game_aborted?.reason})`);
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
  if (participant !== undefined) return { participant, games: outcomes };
  const [{ error, ...outcome }] = outcomes;
  if (error) throw Object.assign(new Error(error), { over: error.startsWith(NO_RESULT) });
  return outcome;
}

/** The ticket of the place to play in: that in the file, or of one that is taken now and then kept there, or at least told. */
async function ticketOf(file, way) {
  const kept = file && existsSync(file) ? readFileSync(file, "utf8").trim() : "";
  if (kept) {
    console.error(`goes on in the place whose ticket is in ${file}`);
    return kept;
  }
  if (!way.code && !way.tournament) throw new Error("give --code, --tournament or the --ticket of a place that was taken before");
  const part = `${file}.${process.pid}`;
  if (file) {
    rmSync(part, { force: true });
    writeFileSync(part, "", { flag: "wx", mode: 0o600 }); // Before the place is taken, and for its owner alone.
  }
  try {
    const ticket = await takePlace(way);
    if (file) writeFileSync(part, `${ticket}\n`);
    if (file) renameSync(part, file);
    const how = file ? `it goes on in its place when it is started again: ${file} has its ticket` : `another goes on with --ticket ${ticket}`;
    console.error(`should this agent end before its ${way.tournament ? "tournament" : "game"}, ${how}`);
    return ticket;
  } finally {
    if (file) rmSync(part, { force: true });
  }
}

if (import.meta.url === pathToFileURL(process.argv[1] ?? "").href) {
  const option = (value) => ({ type: "string", default: value });
  const own = { ticket: option(process.env.CHEFSHAT_TICKET), "ticket-file": option() };
  const where = { address: option("127.0.0.1:50051"), code: option(), tournament: option() };
  try {
    const { values } = parseArgs({ options: { ...where, ...own, name: option("Node"), games: option("1") } });
    const { ticket, "ticket-file": file, ...way } = values;
    if ([way.code, way.tournament, ticket].filter(Boolean).length > 1 || (ticket && file)) {
      throw new Error("give one of --code, --tournament and --ticket (or CHEFSHAT_TICKET); --ticket-file is for the first two");
    }
    way.code ??= way.tournament ? undefined : process.env.CHEFSHAT_CODE;
    const forget = () => { if (file) rmSync(file, { force: true }); }; // All is over.
    const outcome = await play({ ...way, ticket: ticket || (await ticketOf(file, way)) }).catch((error) => {
      if (error.over) forget();
      throw error;
    });
    console.log(JSON.stringify(outcome));
    forget();
  } catch (error) {
    console.error(`agent: ${error.details ?? error.message}`);
    process.exitCode = 1;
  }
}
