// The agent on the real server that CHEFSHAT_BIN names: a complete Shift and a complete tournament against built-in agents.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { once } from "node:events";
import { mkdtemp, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { createInterface } from "node:readline";
import { test } from "node:test";
import { promisify } from "node:util";
import grpc from "@grpc/grpc-js";
import { legalActions, play, protocol } from "../agent.js";

const AGENT = fileURLToPath(new URL("../agent.js", import.meta.url));
const SERVER = process.env.CHEFSHAT_BIN;

/** The address that a server reports. */
async function listening(server) {
  for await (const line of createInterface({ input: server.stdout })) {
    const report = JSON.parse(line);
    if (report.event === "listening") return report.address;
  }
  throw new Error("the server ended without listening");
}

/** Runs a server on a free port during `use`. */
async function withServer(use) {
  const data = await mkdtemp(join(tmpdir(), "chefshat-node-"));
  const args = ["serve", "--listen", "127.0.0.1:0", "--json", "--data-dir", data];
  const server = spawn(SERVER, args, { stdio: ["ignore", "pipe", "inherit"] });
  const closed = once(server, "close");
  try {
    await use(await listening(server));
  } finally {
    server.kill();
    await closed;
    await rm(data, { recursive: true, force: true });
  }
}

/** Calls a method of a service. */
async function call(Service, method, address, request) {
  const service = new Service(address, grpc.credentials.createInsecure());
  try {
    return await promisify(service[method]).call(service, request);
  } finally {
    service.close();
  }
}

/**
 * Attaches the ticket and answers `decisions` decisions with the first legal action, then none until `release`. Returns a promise that
 * resolves when the game is blocked, and the functions to release and end it.
 */
function block(address, ticket, decisions) {
  const service = new protocol.PlayService(address, grpc.credentials.createInsecure());
  const stream = service.Play().on("error", () => {}); // The stream is cancelled at the end.
  const held = [];
  let [left, onBlocked] = [decisions, undefined];
  const blocked = new Promise((resolve) => { onBlocked = resolve; });
  const answer = ({ handle, decision: { decision_id, action_mask } }) => {
    stream.write({ commands: [{ handle, answer: { decision_id, action: legalActions(action_mask)[0] } }] });
  };
  stream.on("data", ({ updates }) => updates.filter(({ update }) => update === "decision").forEach((update) => {
    left -= 1;
    if (left >= 0) return answer(update);
    held.push(update);
    return onBlocked();
  }));
  stream.write({ commands: [{ attach: { ticket } }] });
  const release = () => { left = Infinity; held.splice(0).forEach(answer); };
  return { blocked, release, end: () => { stream.cancel(); service.close(); } };
}

/** Runs the agent, kills it when the game is blocked, and resumes with its ticket. Returns the output of the second process. */
async function killAndResume(args, { blocked, release }) {
  const bare = { CHEFSHAT_TICKET: "", CHEFSHAT_CODE: "" }; // Variables of the environment must not reach the agent.
  const start = (some, env = {}) => spawn(process.execPath, [AGENT, ...some], { env: { ...process.env, ...bare, ...env } });
  const first = start(args);
  const ended = once(first, "close");
  let printed = "";
  first.stderr.on("data", (part) => { printed += part; });
  const early = ended.then((end) => assert.fail(`the agent ended (${end}) before it was killed: ${printed}`));
  early.catch(() => {}); // The kill below settles it too.
  await Promise.race([blocked, early]);
  first.kill("SIGKILL");
  assert.deepEqual(await ended, [null, "SIGKILL"]);
  const [, ticket] = /--ticket (\S+)\n$/.exec(printed);
  const second = start(args.slice(0, 2), { CHEFSHAT_TICKET: ticket });
  release();
  let out = "";
  second.stdout.on("data", (part) => { out += part; });
  second.stderr.pipe(process.stderr);
  assert.deepEqual(await once(second, "close"), [0, null]);
  return JSON.parse(out);
}

const skip = SERVER ? false : "CHEFSHAT_BIN names no server";

test("a Shift on the real server", { skip }, () => withServer(async (address) => {
  const builtIn = { built_in_agent: "random" };
  const request = {
    name: "node test",
    rules: { target_shifts: 1 },
    seats: [builtIn, { reserved_for: "PARTICIPANT_KIND_AGENT" }, builtIn, builtIn],
  };
  const { join_code: code } = await call(protocol.RoomService, "CreateRoom", address, request);

  const { seat, standings } = await play({ address, code, name: "Node" });

  assert.equal(seat, 1);
  assert.deepEqual(standings.map(({ place }) => place), [1, 2, 3, 4]);
  assert.deepEqual(standings.map(({ points }) => points), [5, 3, 1, 0]);
  assert.deepEqual(standings.map((line) => line.seat).sort(), [0, 1, 2, 3]);
}));

test("a tournament on the real server", { skip }, () => withServer(async (address) => {
  const settings = {
    name: "node cup",
    format: "TOURNAMENT_FORMAT_ROUND_ROBIN",
    rules: { target_shifts: 1 },
    rounds: 3,
    games_per_pairing: 2,
    built_in_agents: ["random", "random", "random"],
    start_when_joined: 4,
  };
  const made = await call(protocol.TournamentService, "CreateTournament", address, { settings });

  const played = await play({ address, tournament: made.join_code, name: "Node", games: "2" });

  const { tournament_id } = made.tournament;
  const { games } = await call(protocol.TournamentService, "ListTournamentGames", address, { tournament_id });
  assert.equal(games.length, 6);
  assert.equal(played.games.length, 6);
  for (const { game_id, seat, standings } of played.games) {
    const counted = games.find((game) => game.game_id === game_id).seats[seat];
    const mine = standings.find((line) => line.seat === seat);
    assert.equal(counted.participant, played.participant);
    assert.deepEqual([counted.place, counted.points], [mine.place, mine.points]);
  }
}));

// Far longer than a test, so that a killed agent resumes in time on any machine.
const patient = { decision_time_ms: 600_000 };

test("an agent killed in the middle of a game resumes its seat", { skip }, () => withServer(async (address) => {
  const request = { name: "kill", policy: patient, seats: [{}, {}, { built_in_agent: "random" }, { built_in_agent: "random" }] };
  const { room, join_code: code } = await call(protocol.RoomService, "CreateRoom", address, request);
  const other = await call(protocol.RoomService, "JoinRoom", address, { join_code: code, name: "other", kind: "PARTICIPANT_KIND_AGENT" });
  const blocker = block(address, other.ticket, 3);

  const { seat, standings } = await killAndResume(["--address", address, "--code", code], blocker);

  blocker.end();
  const seats = (await call(protocol.RoomService, "GetRoom", address, { room_id: room.room_id })).room.seats;
  assert.equal(seats[seat].name, "Node");
  assert.deepEqual(standings.map(({ place }) => place), [1, 2, 3, 4]);
}));

test("an agent killed in the middle of a game resumes its tournament", { skip }, () => withServer(async (address) => {
  const settings = {
    name: "killed",
    format: "TOURNAMENT_FORMAT_ROUND_ROBIN",
    rules: { target_shifts: 1 },
    policy: patient,
    rounds: 2,
    games_per_pairing: 2,
    built_in_agents: ["random", "random"],
    start_when_joined: 4,
  };
  const made = await call(protocol.TournamentService, "CreateTournament", address, { settings });
  const asked = { join_code: made.join_code, name: "other", kind: "PARTICIPANT_KIND_AGENT", max_games: 2 };
  const other = await call(protocol.TournamentService, "JoinTournament", address, asked);
  const blocker = block(address, other.ticket, 2);

  const args = ["--address", address, "--tournament", made.join_code, "--games", "2"];
  const played = await killAndResume(args, blocker);

  blocker.end();
  const { tournament_id } = made.tournament;
  const { games } = await call(protocol.TournamentService, "ListTournamentGames", address, { tournament_id });
  assert.equal(games.length, 4);
  assert.deepEqual(played.games.map(({ game_id }) => game_id).sort(), games.map(({ game_id }) => game_id).sort());
  for (const { game_id, seat, standings } of played.games) {
    const counted = games.find((game) => game.game_id === game_id);
    assert.equal(counted.seats[seat].participant, played.participant);
    assert.equal(counted.seats[seat].place, standings.find((line) => line.seat === seat).place);
    assert.ok(counted.rated, "nobody forfeited or was substituted");
  }
}));
