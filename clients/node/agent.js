// One agent, without an SDK: it reads the .proto files, takes a seat with a join code and plays a random legal action at every
// decision, in one game or in all of its games of a tournament. It knows no rules of the game. A lost connection is made again and
// resumes where it broke off.
import { randomInt } from "node:crypto";
import { setTimeout as sleep } from "node:timers/promises";
import { fileURLToPath, pathToFileURL } from "node:url";
import { parseArgs, promisify } from "node:util";
import grpc from "@grpc/grpc-js";
import loader from "@grpc/proto-loader";

const PROTO = process.env.CHEFSHAT_PROTO || fileURLToPath(new URL("../../proto", import.meta.url));
const FILES = ["room", "play", "tournament"].map((name) => `chefshat/v1/${name}_service.proto`);
const FORM = { includeDirs: [PROTO], keepCase: true, longs: Number, enums: String, oneofs: true, defaults: true };
export const protocol = grpc.loadPackageDefinition(loader.loadSync(FILES, FORM)).chefshat.v1;

const MAX_FAILURES = 9; // Connections in a row that may bring nothing before the agent gives up.
const connect = (Service, address) => new Service(address, grpc.credentials.createInsecure());

/** The legal actions of a mask: bit i%8 of byte i/8 is action i. */
export function legalActions(mask) {
  return Array.from({ length: mask.length * 8 }, (_, i) => i).filter((i) => mask[i >> 3] & (1 << (i & 7)));
}

function join(Service, method, address, request) {
  const service = connect(Service, address);
  const asked = { kind: "PARTICIPANT_KIND_AGENT", ...request };
  return promisify(service[method]).call(service, asked, { deadline: Date.now() + 10_000 }).finally(() => service.close());
}

/** One seat: what it makes of each update it is told. `say` sends a command for it. What is returned is the outcome of its game. */
function takeSeat(ticket, seat, about = {}) {
  let [end, open] = [{}, {}];
  const failed = (error) => ({ ...about, seat, error });
  const self = {
    ticket,
    next: 0, // The first event it has not seen.
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
      if (!end.game_ended) return failed(`the game has no result (${end.game_aborted?.reason})`);
      return { ...about, seat, standings: end.game_ended.standings };
    },
  };
  return self;
}

/** Plays these seats, and with a tournament's ticket all that the server gives it; gives their outcomes when all is over. */
async function playSeats(address, seats, tournament) {
  const client = connect(protocol.PlayService, address);
  let [outcomes, lost] = [[], new Error("the server ended the stream")];
  try {
    for (let failures = 0; failures < MAX_FAILURES; failures += 1) {
      await sleep(failures && 50 * 2 ** failures);
      const stream = client.Play().on("error", (error) => { lost = error; });
      const commands = seats.map(({ ticket, next }) => ({ attach: { ticket, from_sequence: next } }));
      if (tournament) commands.push({ attach: { ticket: tournament } }); // Last, so that it is not given the seats it has already.
      stream.write({ commands });
      const byHandle = new Map(seats.entries()); // A handle is the number of an attachment, until the server makes its own.
      const entered = tournament ? seats.length : -1;
      try {
        for await (const { updates } of stream) {
          failures = 0;
          for (const { handle, update, [update]: content } of updates) {
            if (update === "attached" && content.ticket) {
              const known = seats.find(({ ticket }) => ticket === content.ticket);
              byHandle.set(handle, known ?? takeSeat(content.ticket, content.seat, { game_id: content.game_id }));
              if (!known) seats.push(byHandle.get(handle));
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
            if (!tournament && !seats.length) return outcomes;
          }
        }
      } catch (error) { if (error !== lost) throw error; } finally { stream.cancel(); }
    }
    throw lost;
  } finally { client.close(); }
}

/** Plays one game to its end; gives the seat and the standings, or throws an error that says why there are none. */
export async function play({ address, code, name }) {
  const { ticket, seat } = await join(protocol.RoomService, "JoinRoom", address, { join_code: code, name });
  const [{ error, ...outcome }] = await playSeats(address, [takeSeat(ticket, seat)]);
  if (error) throw new Error(error);
  return outcome;
}

/** Takes part in a tournament to its end; gives the participant's number and what came of each of its games. */
export async function playTournament({ address, tournament, name, games }) {
  const request = { join_code: tournament, name, max_games: Number(games) };
  const { ticket, participant } = await join(protocol.TournamentService, "JoinTournament", address, request);
  return { participant, games: await playSeats(address, [], ticket) };
}

if (import.meta.url === pathToFileURL(process.argv[1] ?? "").href) {
  const option = (value) => ({ type: "string", default: value });
  const where = { address: option("127.0.0.1:50051"), code: option(process.env.CHEFSHAT_CODE), tournament: option() };
  try {
    const { values } = parseArgs({ options: { ...where, name: option("Node"), games: option("1") } });
    console.log(JSON.stringify(await (values.tournament ? playTournament : play)(values)));
  } catch (error) {
    console.error(`agent: ${error.details ?? error.message}`);
    process.exitCode = 1;
  }
}
