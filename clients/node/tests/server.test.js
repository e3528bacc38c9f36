// The agent against the real server, where CHEFSHAT_BIN names one: a whole Shift and a whole tournament against built-in agents, on a
// server in a process of its own.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { once } from "node:events";
import { mkdtemp, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { createInterface } from "node:readline";
import { test } from "node:test";
import { promisify } from "node:util";
import grpc from "@grpc/grpc-js";
import { play, playTournament, protocol } from "../agent.js";

const SERVER = process.env.CHEFSHAT_BIN;

/** The address a server says it listens on, in its first line that says so. */
async function listening(server) {
  for await (const line of createInterface({ input: server.stdout })) {
    const said = JSON.parse(line);
    if (said.event === "listening") return said.address;
  }
  throw new Error("the server ended without listening");
}

/** A real server on a port of the system's choice, for as long as `use` takes. */
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

/** One call of a service. */
async function call(Service, method, address, request) {
  const service = new Service(address, grpc.credentials.createInsecure());
  try {
    return await promisify(service[method]).call(service, request);
  } finally {
    service.close();
  }
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

  const played = await playTournament({ address, tournament: made.join_code, name: "Node", games: "2" });

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
