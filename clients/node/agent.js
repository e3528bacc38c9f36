// One agent, without an SDK: it reads the .proto files, takes a seat with a join code and plays a random legal action at every
// decision. It knows no rules of the game. A lost connection is made again and resumes where it broke off.
import { randomInt } from "node:crypto";
import { setTimeout as sleep } from "node:timers/promises";
import { fileURLToPath, pathToFileURL } from "node:url";
import { parseArgs, promisify } from "node:util";
import grpc from "@grpc/grpc-js";
import loader from "@grpc/proto-loader";

const PROTO = process.env.CHEFSHAT_PROTO || fileURLToPath(new URL("../../proto", import.meta.url));
const FILES = ["chefshat/v1/room_service.proto", "chefshat/v1/play_service.proto"];
const FORM = { includeDirs: [PROTO], keepCase: true, longs: Number, enums: String, oneofs: true, defaults: true };
export const protocol = grpc.loadPackageDefinition(loader.loadSync(FILES, FORM)).chefshat.v1;

const MAX_FAILURES = 9; // Connections in a row that may bring nothing before the agent gives up.
const connect = (Service, address) => new Service(address, grpc.credentials.createInsecure());

/** The legal actions of a mask: bit i%8 of byte i/8 is action i. */
export function legalActions(mask) {
  return Array.from({ length: mask.length * 8 }, (_, i) => i).filter((i) => mask[i >> 3] & (1 << (i & 7)));
}

function join(address, code, name) {
  const rooms = connect(protocol.RoomService, address);
  const request = { join_code: code, name, kind: "PARTICIPANT_KIND_AGENT" };
  return promisify(rooms.JoinRoom).call(rooms, request, { deadline: Date.now() + 10_000 }).finally(() => rooms.close());
}

/** Plays one game to its end; gives the seat and the standings, or throws an error that says why there are none. */
export async function play({ address, code, name }) {
  const { ticket, seat } = await join(address, code, name);
  const client = connect(protocol.PlayService, address);
  let [next, end, open, lost] = [0, {}, {}, new Error("the server ended the stream")];
  const told = {
    events: ({ events }, handle, stream) => events.forEach((event) => {
      next = event.sequence + 1;
      if (event.game_ended || event.game_aborted) end = event;
      if (event.substituted?.seat === seat) stream.write({ commands: [{ handle, resume: {} }] }); // Back from being late too often.
    }),
    decision: (request, handle, stream) => {
      open = request;
      const legal = legalActions(request.action_mask);
      const answer = { decision_id: request.decision_id, action: legal[randomInt(legal.length)] };
      stream.write({ commands: [{ handle, answer }] });
    },
    result: ({ decision_id, status }, handle, stream) => {
      const again = status === "ANSWER_STATUS_INVALID" && decision_id === open.decision_id; // It is not put again.
      if (again) told.decision(open, handle, stream);
    },
    refused: ({ message, reason }) => { throw new Error(`refused: ${message} (${reason})`); },
    detached: ({ reason }) => {
      if (reason !== "DETACH_REASON_GAME_OVER") throw new Error(`the seat is lost (${reason})`);
      if (!end.game_ended) throw new Error(`the game has no result (${end.game_aborted?.reason})`);
      return { seat, standings: end.game_ended.standings };
    },
  };
  try {
    for (let failures = 0; failures < MAX_FAILURES; failures += 1) {
      await sleep(failures && 50 * 2 ** failures);
      const stream = client.Play().on("error", (error) => { lost = error; });
      stream.write({ commands: [{ attach: { ticket, from_sequence: next } }] });
      try {
        for await (const { updates } of stream) {
          failures = 0;
          for (const { handle, update, ...content } of updates) {
            const result = told[update]?.(content[update], handle, stream);
            if (result) return result;
          }
        }
      } catch (error) { if (error !== lost) throw error; } finally { stream.cancel(); }
    }
    throw lost;
  } finally { client.close(); }
}

if (import.meta.url === pathToFileURL(process.argv[1] ?? "").href) {
  const option = (value) => ({ type: "string", default: value });
  const options = { address: option("127.0.0.1:50051"), code: option(process.env.CHEFSHAT_CODE), name: option("Node") };
  try {
    console.log(JSON.stringify(await play(parseArgs({ options }).values)));
  } catch (error) {
    console.error(`agent: ${error.details ?? error.message}`);
    process.exitCode = 1;
  }
}
