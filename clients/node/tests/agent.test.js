// The agent against a scripted server: games, lost connections and refusals. No rules of the game; games on the real server are in
// server.test.js.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { once } from "node:events";
import { mkdirSync, readFileSync } from "node:fs";
import { mkdir, mkdtemp, readFile, readdir, rm, stat, writeFile } from "node:fs/promises";
import { connect, createServer } from "node:net";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { after, test } from "node:test";
import grpc from "@grpc/grpc-js";
import { legalActions, play, protocol } from "../agent.js";

const AGENT = fileURLToPath(new URL("../agent.js", import.meta.url));
const BARE = { CHEFSHAT_TICKET: "", CHEFSHAT_CODE: "", CHEFSHAT_TOKEN: "", CHEFSHAT_CA: "" }; // Variables of the environment must not reach the agent.
const STANDINGS = [{ seat: 2, points: 15, place: 1 }, { seat: 0, points: 9, place: 2 }];
const servers = [];
after(() => servers.forEach((server) => server.forceShutdown()));

const PROTO = process.env.CHEFSHAT_PROTO || fileURLToPath(new URL("../../../proto", import.meta.url));
const TLS = join(PROTO, "../tests/fixtures/tls");
const CA = join(TLS, "localhost.pem"); // A certificate for this machine, which is its own authority.

/** A server. Its n-th connection is served by the n-th of `connections`, a function of the stream and of a reader of its commands. */
const serve = (...connections) => serveWith({}, ...connections);

/** The same with TLS, where every call needs the `token`. `served.calls` counts the calls. */
async function serveWith({ token }, ...connections) {
  const joins = [];
  const served = { joins, remaining: connections, calls: 0 };
  const refusal = { code: grpc.status.UNAUTHENTICATED, details: "a token is needed" };
  const guard = (descriptor, call) => new grpc.ServerInterceptingCall(call, {
    start: (next) => next({
      onReceiveMetadata: (metadata, pass) => {
        served.calls += 1;
        if (!token || metadata.get("authorization")[0] === `Bearer ${token}`) pass(metadata);
        else call.sendStatus(refusal);
      },
    }),
  });
  const server = new grpc.Server({ interceptors: [guard] });
  server.addService(protocol.RoomService.service, {
    JoinRoom: ({ request }, done) => {
      joins.push(request);
      served.joining?.();
      if (served.failures?.length) done({ code: grpc.status[served.failures.shift()], details: "not now" });
      else if (request.join_code === "TABLE") done(null, { seat: 2, ticket: "a ticket" });
      else done({ code: grpc.status.PERMISSION_DENIED, details: "no room has this join code" });
    },
  });
  server.addService(protocol.TournamentService.service, {
    JoinTournament: ({ request }, done) => {
      joins.push(request);
      done(null, { participant: 5, ticket: "cup" });
    },
  });
  const { Play } = protocol.PlayService.service;
  const responseSerialize = (message) => (Buffer.isBuffer(message) ? message : Play.responseSerialize(message));
  server.addService({ Play: { ...Play, responseSerialize } }, {
    Play: async (stream) => {
      const messages = stream[Symbol.asyncIterator]();
      const read = async () => (await messages.next()).value?.commands;
      await connections.shift()(stream, read);
    },
  });
  servers.push(server);
  const port = await new Promise((resolve, reject) => {
    const bound = (error, number) => (error ? reject(error) : resolve(number));
    const [cert_chain, private_key] = [CA, join(TLS, "localhost.key")].map((file) => readFileSync(file));
    const tls = () => grpc.ServerCredentials.createSsl(null, [{ cert_chain, private_key }]);
    server.bindAsync("127.0.0.1:0", token ? tls() : grpc.ServerCredentials.createInsecure(), bound);
  });
  served.address = `${token ? "https://" : ""}127.0.0.1:${port}`;
  return served;
}

const ask = (decision_id, ...bytes) => ({ handle: 0, decision: { decision_id, action_mask: Buffer.from(bytes) } });
const events = (...list) => ({ handle: 0, events: { events: list } });
const ended = (sequence) => ({ sequence, game_ended: { standings: STANDINGS } });
const attached = { handle: 0, attached: { seat: 2, next_sequence: 1 } };
const refused = (reason, message, code = "UNAUTHENTICATED") => ({ handle: 0, refused: { reason, message, code: grpc.status[code] } });
const detached = (reason) => ({ handle: 0, detached: { reason: `DETACH_REASON_${reason}` } });

for (const [bytes, actions] of [
  [[], []],
  [[0b0000_0001], [0]],
  [[0b1000_0000, 0, 0b0000_0110], [7, 17, 18]],
  [[0xff], [0, 1, 2, 3, 4, 5, 6, 7]],
]) {
  test(`the mask ${JSON.stringify(bytes)} allows ${JSON.stringify(actions)}`, () => {
    assert.deepEqual(legalActions(Buffer.from(bytes)), actions);
  });
}

test("a game: attaches, answers with set bits, returns the standings", async () => {
  const answers = [];
  const server = await serve(async (stream, read) => {
    const [{ attach }] = await read();
    assert.equal(attach.ticket, "a ticket");
    assert.equal(attach.from_sequence, 0);
    stream.write({ updates: [attached] });
    for (let id = 1; id <= 20; id += 1) {
      stream.write({ updates: [events({ sequence: id }), ask(id, 0, 0b0010_0100)] });
      const [{ handle, answer }] = await read();
      assert.equal(handle, 0);
      answers.push([answer.decision_id, answer.action]);
    }
    stream.write({ updates: [events(ended(21)), detached("GAME_OVER")] });
  });
  const result = await play({ address: server.address, code: "TABLE", name: "Ada" });
  assert.deepEqual(result, { seat: 2, standings: STANDINGS });
  assert.deepEqual(answers.map(([id]) => id), Array.from({ length: 20 }, (_, i) => i + 1));
  for (const [, action] of answers) assert.ok([10, 13].includes(action), `action ${action} is not in the mask`);
  assert.equal(server.joins.length, 1);
  assert.deepEqual([server.joins[0].name, server.joins[0].kind], ["Ada", "PARTICIPANT_KIND_AGENT"]);
});

test("what a newer server adds is ignored", async () => {
  const server = await serve(async (stream, read) => {
    await read();
    stream.write({ updates: [attached] });
    stream.write(Buffer.from([0x0a, 3, 0xc2, 0x0c, 0])); // An update with field 200.
    stream.write(Buffer.from([0x0a, 9, 0x1a, 7, 0x0a, 5, 0x08, 1, 0xc2, 0x0c, 0])); // Event 1, with field 200.
    stream.write({ updates: [events(ended(2)), detached("GAME_OVER")] });
  });
  assert.deepEqual(await play({ address: server.address, ticket: "a ticket" }), { seat: 2, standings: STANDINGS });
});

test("a lost connection is replaced by one that resumes after the last event seen", async () => {
  const from = [];
  const attach = async (read) => from.push((await read())[0].attach.from_sequence);
  const server = await serve(
    async (stream, read) => {
      await attach(read);
      stream.write({ updates: [attached, events({ sequence: 1 }, { sequence: 2 }), ask(1, 1)] });
      await read();
      stream.emit("error", { code: grpc.status.UNAVAILABLE, details: "cut" });
    },
    async (stream, read) => {
      await attach(read);
      stream.end();
    },
    async (stream, read) => {
      await attach(read);
      stream.write({ updates: [attached, { handle: 0, snapshot: { next_sequence: 40 } }] }); // The room no longer has the events before.
      stream.end();
    },
    async (stream, read) => {
      await attach(read);
      stream.write({ updates: [attached, events({ sequence: 40 }, ended(41)), detached("GAME_OVER")] });
    },
  );
  const outcome = await play({ address: server.address, code: "TABLE", name: "Ada" });
  assert.deepEqual(outcome, { seat: 2, standings: STANDINGS });
  assert.deepEqual(from, [0, 3, 3, 40]);
  assert.equal(server.remaining.length, 0);
});

test("a lost server is waited for, about ten minutes", async () => {
  const lost = async (stream, read) => {
    await read();
    stream.emit("error", { code: grpc.status.UNAVAILABLE, details: "stopping" });
  };
  const begins = async (stream, read) => {
    await read();
    stream.write({ updates: [attached, events({ sequence: 1 })] });
    stream.end();
  };
  const pause = async (ms) => { delays.push(ms); };
  const delays = [];
  const server = await serve();
  for (const [breaks, message] of [[lost, /stopping/], [begins, /the server ended the stream/]]) {
    delays.length = 0;
    server.remaining.splice(0, Infinity, ...Array(300).fill(breaks));
    await assert.rejects(play({ address: server.address, ticket: "a ticket", pause }), message);
    assert.ok(delays.every((ms) => ms > 0 && ms <= 5_000));
    const minutes = delays.reduce((sum, ms) => sum + ms) / 60_000;
    assert.ok(minutes > 8 && minutes < 13, `${minutes} minutes`);
  }

  // What follows the state ends the outage: the next one has all its time.
  const works = async (stream, read) => {
    await read();
    stream.write({ updates: [attached] });
    stream.write({ updates: [events({ sequence: 1 })] });
    stream.end();
  };
  const ends = async (stream, read) => {
    await read();
    stream.write({ updates: [attached, events(ended(2)), detached("GAME_OVER")] });
  };
  server.remaining.splice(0, Infinity, ...Array(100).fill(lost), works, ...Array(100).fill(lost), ends);
  assert.deepEqual(await play({ address: server.address, ticket: "a ticket", pause }), { seat: 2, standings: STANDINGS });
  assert.equal(server.remaining.length, 0);
});

for (const code of [
  "INVALID_ARGUMENT", "NOT_FOUND", "ALREADY_EXISTS", "PERMISSION_DENIED", "FAILED_PRECONDITION", "OUT_OF_RANGE", "UNIMPLEMENTED", "UNAUTHENTICATED",
]) {
  test(`${code} is an error and does not cause a reconnection`, async () => {
    const server = await serve(async (stream, read) => {
      await read();
      stream.emit("error", { code: grpc.status[code], details: "no" });
    });
    await assert.rejects(play({ address: server.address, ticket: "a ticket" }), /no/);
    assert.equal(server.remaining.length, 0);
  });
}

test("joining is repeated with the same request id, and so takes one seat", async () => {
  const pauses = [];
  const way = { code: "TABLE", name: "Ada", pause: async (ms) => { pauses.push(ms); } };
  const server = await serve(async (stream, read) => {
    await read();
    stream.write({ updates: [attached, events(ended(1)), detached("GAME_OVER")] });
  });
  server.failures = ["UNAVAILABLE", "RESOURCE_EXHAUSTED"];
  assert.deepEqual(await play({ address: server.address, ...way }), { seat: 2, standings: STANDINGS });
  const ids = server.joins.map(({ request_id }) => request_id.toString("hex"));
  assert.deepEqual([ids.length, new Set(ids).size, ids[0].length, pauses.length], [3, 1, 64, 2]);

  for (const [failures, calls] of [[Array(9).fill("UNAVAILABLE"), 8], [["PERMISSION_DENIED"], 1]]) {
    server.joins.length = 0;
    server.failures = failures;
    await assert.rejects(play({ address: server.address, ...way }), /not now/);
    assert.equal(server.joins.length, calls);
  }
});

test("a refused decision is answered again, and the seat is taken back from its substitute", async () => {
  const heard = [];
  const server = await serve(async (stream, read) => {
    await read();
    stream.write({ updates: [attached, ask(1, 0b0011_0000)] });
    const hear = async () => { const [{ handle, answer, resume }] = await read(); heard.push([handle, answer?.decision_id, resume]); };
    await hear();
    for (const status of ["CLOSED", "INVALID"]) {
      stream.write({ updates: [{ handle: 0, result: { decision_id: 1, status: `ANSWER_STATUS_${status}` } }] });
    }
    await hear();
    stream.write({ updates: [events({ sequence: 1, substituted: { seat: 1 } }, { sequence: 2, substituted: { seat: 2 } })] });
    await hear();
    stream.write({ updates: [{ handle: 0, substitution: { active: true } }, { handle: 0, substitution: { active: false } }] });
    await hear();
    stream.write({ updates: [events(ended(3)), detached("GAME_OVER")] });
  });
  await play({ address: server.address, code: "TABLE", name: "Ada" });
  assert.deepEqual(heard, [[0, 1, undefined], [0, 1, undefined], [0, undefined, {}], [0, undefined, {}]]);
});

for (const [what, updates, message] of [
  ["a refusal", [refused("TICKET_UNKNOWN", "join again")], /refused: join again \(TICKET_UNKNOWN\)/],
  ["a newer connection", [detached("SUPERSEDED")], /the seat is lost \(DETACH_REASON_SUPERSEDED\)/],
  [
    "an aborted game",
    [events({ sequence: 1, game_aborted: { reason: "ABORT_REASON_SHUTDOWN" } }), detached("GAME_OVER")],
    /no result \(ABORT_REASON_SHUTDOWN\)/,
  ],
]) {
  test(`${what} is an error and does not cause a reconnection`, async () => {
    const server = await serve(async (stream, read) => {
      await read();
      stream.write({ updates });
    });
    await assert.rejects(play({ address: server.address, code: "TABLE", name: "Ada" }), message);
    assert.equal(server.remaining.length, 0);
  });
}

test("a command that is refused for now is no error and causes a reconnection", async () => {
  const server = await serve(
    async (stream, read) => {
      await read();
      stream.write({ updates: [attached, ask(1, 1)] });
      await read();
      stream.write({ updates: [refused("ROOM_GONE", "connect again", "UNAVAILABLE")] });
    },
    async (stream, read) => {
      await read();
      stream.write({ updates: [attached, events(ended(1)), detached("GAME_OVER")] });
    },
  );
  assert.deepEqual(await play({ address: server.address, ticket: "a ticket" }), { seat: 2, standings: STANDINGS });
  assert.equal(server.remaining.length, 0);
});

test("TLS with an authority of its own, and a token with every call", async () => {
  const game = async (stream, read) => {
    await read();
    stream.write({ updates: [attached, events(ended(1)), detached("GAME_OVER")] });
  };
  const server = await serveWith({ token: "chefshat_1_2" }, game);
  const way = { address: server.address, ca: CA, code: "TABLE", name: "Ada" };
  assert.deepEqual(await play({ ...way, token: "chefshat_1_2\n" }), { seat: 2, standings: STANDINGS });
  assert.equal(server.calls, 2);
  await assert.rejects(play(way), /a token is needed/);
  await assert.rejects(play({ ...way, ticket: "a ticket" }), /a token is needed/);
  assert.equal(server.calls, 4, "refused once each");
  await assert.rejects(play({ ...way, ca: undefined, pause: async () => {} }), /self-signed certificate/);
});

test("a connection that goes silent is replaced", async () => {
  const ends = async (stream, read) => {
    await read();
    stream.write({ updates: [attached, events(ended(1)), detached("GAME_OVER")] });
  };
  const sockets = [];
  const falls = async (stream, read) => {
    await read();
    // Both directions stay open, but nothing more arrives.
    for (const socket of sockets) socket.pause();
    stream.write({ updates: [attached] });
  };
  const server = await serve(falls, ends);
  const [host, port] = server.address.split(":");
  const relay = createServer((near) => {
    const far = connect({ host, port });
    if (server.remaining.length === 2) sockets.push(near, far);
    for (const [from, to] of [[near, far], [far, near]]) {
      from.on("data", (bytes) => { if (!from.isPaused()) to.write(bytes); });
      from.on("close", () => to.destroy()).on("error", () => to.destroy());
    }
  });
  await once(relay.listen(0, "127.0.0.1"), "listening");
  try {
    const address = `127.0.0.1:${relay.address().port}`;
    assert.deepEqual(await play({ address, ticket: "a ticket" }), { seat: 2, standings: STANDINGS });
    assert.equal(server.remaining.length, 0);
  } finally {
    for (const socket of sockets) socket.destroy();
    relay.close();
  }
});

/** An update of a seat that the server attached: `number` counts these seats from 0. */
const ofSeat = (number, update) => ({ ...update, handle: 2 ** 31 + number });
const seated = (number, game_id) => {
  const attached = { game_id, seat: 2, ticket: `ticket of ${game_id}`, tournament_id: "tournament" };
  return ofSeat(number, { attached });
};
const over = (handle) => ({ handle, detached: { reason: "DETACH_REASON_TOURNAMENT_OVER" } });

test("a tournament: several games at a time, through lost connections, to its end", async () => {
  const attaches = [];
  const attach = async (read) => attaches.push((await read()).map((command) => [command.attach.ticket, command.attach.from_sequence]));
  const answers = [];
  const answer = async (read) => { const [{ handle, answer }] = await read(); answers.push([handle, answer.decision_id]); };
  const server = await serve(
    async (stream, read) => {
      await attach(read);
      stream.write({ updates: [{ handle: 0, entered: { participant: 5 } }, seated(0, "a"), seated(1, "b")] });
      stream.write({ updates: [ofSeat(1, ask(7, 1)), ofSeat(0, events({ sequence: 1 }, { sequence: 2 }))] });
      await answer(read);
      stream.write({ updates: [ofSeat(0, events(ended(3))), ofSeat(0, detached("GAME_OVER")), ofSeat(0, ask(9, 1))] });
      stream.write({ updates: [seated(2, "c"), ofSeat(2, ask(8, 1))] });
      await answer(read);
      stream.emit("error", { code: grpc.status.UNAVAILABLE, details: "cut" });
    },
    async (stream, read) => {
      await attach(read);
      stream.write({ updates: [{ handle: 0, attached: { game_id: "b", seat: 2 } }, ask(7, 1)] });
      await answer(read);
      stream.write({ updates: [{ ...refused("TICKET_UNKNOWN", "its room is gone"), handle: 1 }] });
      stream.write({ updates: [{ handle: 2, entered: { participant: 5 } }, over(2)] });
      stream.write({ updates: [events(ended(1)), detached("GAME_OVER")] });
    },
  );
  const played = await play({ address: server.address, tournament: "CUP", name: "Ada", games: "2" });
  assert.deepEqual([server.joins[0].join_code, server.joins[0].name, server.joins[0].max_games], ["CUP", "Ada", 2]);
  assert.deepEqual(attaches, [[["cup", 0]], [["ticket of b", 0], ["ticket of c", 0], ["cup", 0]]]);
  assert.deepEqual(answers, [[2 ** 31 + 1, 7], [2 ** 31 + 2, 8], [0, 7]]);
  assert.equal(played.participant, 5);
  assert.deepEqual(played.games, [
    { game_id: "a", seat: 2, standings: STANDINGS },
    { game_id: "c", seat: 2, error: "refused: its room is gone (TICKET_UNKNOWN)" },
    { game_id: "b", seat: 2, standings: STANDINGS },
  ]);
});

test("a game of a tournament that is over is not played again", async () => {
  const heard = [];
  const server = await serve(
    async (stream, read) => {
      await read();
      stream.write({ updates: [{ handle: 0, entered: { participant: 5 } }, seated(0, "a")] });
      stream.write({ updates: [ofSeat(0, events(ended(1))), ofSeat(0, detached("GAME_OVER"))] });
      stream.emit("error", { code: grpc.status.UNAVAILABLE, details: "cut" });
    },
    async (stream, read) => {
      await read();
      stream.write({ updates: [{ handle: 0, entered: { participant: 5 } }, seated(0, "a"), ofSeat(0, events(ended(1)))] });
      const [{ handle, command }] = await read();
      heard.push([handle, command]);
      stream.write({ updates: [ofSeat(0, detached("REQUESTED")), over(0)] });
    },
  );
  const played = await play({ address: server.address, tournament: "CUP", name: "Ada", games: "1" });
  assert.deepEqual(played, { participant: 5, games: [{ game_id: "a", seat: 2, standings: STANDINGS }] });
  assert.deepEqual(heard, [[2 ** 31, "detach"]]);
});

for (const [what, updates] of [
  ["whose room is gone", [refused("TICKET_UNKNOWN", "join again")]],
  ["that a newer connection took", [attached, detached("SUPERSEDED")]],
]) {
  test(`the result of a game is known, also of one ${what} after its end`, async () => {
    const server = await serve(
      async (stream, read) => {
        await read();
        stream.write({ updates: [attached, events(ended(1))] });
        stream.end();
      },
      async (stream, read) => {
        await read();
        stream.write({ updates });
      },
    );
    assert.deepEqual(await play({ address: server.address, ticket: "a ticket" }), { seat: 2, standings: STANDINGS });
  });
}

test("a newer connection in a tournament is an error and does not cause a reconnection", async () => {
  const server = await serve(async (stream, read) => {
    await read();
    stream.write({ updates: [{ handle: 0, entered: { participant: 5 } }, detached("SUPERSEDED")] });
  });
  const playing = play({ address: server.address, tournament: "CUP", name: "Ada", games: "1" });
  await assert.rejects(playing, /the tournament is lost \(DETACH_REASON_SUPERSEDED\)/);
  assert.equal(server.remaining.length, 0);
});

/** A temporary folder, deleted after the test. */
async function folderOf(context) {
  const folder = await mkdtemp(join(tmpdir(), "chefshat-node-"));
  context.after(() => rm(folder, { recursive: true }));
  return folder;
}

/** Runs the agent as a process; `started` receives the process. */
async function run(args, env = {}, started = () => {}) {
  const agent = spawn(process.execPath, [AGENT, ...args], { env: { ...process.env, ...BARE, ...env } });
  started(agent);
  let [out, err] = ["", ""];
  agent.stdout.on("data", (part) => { out += part; });
  agent.stderr.on("data", (part) => { err += part; });
  const [status] = await once(agent, "close");
  return { status, out, err };
}

test("the process prints the standings as one line of JSON and exits with 0", async () => {
  const server = await serve(async (stream, read) => {
    await read();
    stream.write({ updates: [attached, events(ended(1)), detached("GAME_OVER")] });
  });
  const { status, out, err } = await run(["--address", server.address], { CHEFSHAT_CODE: "TABLE" });
  assert.equal(err, "if this process ends before the game, resume with --ticket a ticket\n");
  assert.equal(status, 0);
  assert.match(out, /^[^\n]+\n$/);
  assert.deepEqual(JSON.parse(out), { seat: 2, standings: STANDINGS });
});

test("the process takes part in a tournament and prints its games as one line of JSON", async () => {
  const server = await serve(async (stream, read) => {
    await read();
    stream.write({ updates: [{ handle: 0, entered: { participant: 5 } }, seated(0, "a")] });
    stream.write({ updates: [ofSeat(0, events(ended(1))), ofSeat(0, detached("GAME_OVER")), over(0)] });
  });
  const { status, out, err } = await run(["--address", server.address, "--tournament", "CUP", "--games", "3"]);
  assert.deepEqual([status, err], [0, "if this process ends before the tournament, resume with --ticket cup\n"]);
  assert.match(out, /^[^\n]+\n$/);
  assert.deepEqual(JSON.parse(out), { participant: 5, games: [{ game_id: "a", seat: 2, standings: STANDINGS }] });
  assert.equal(server.joins[0].max_games, 3);
});

/** Serves a connection: notes its ticket, and ends the game. */
const ending = (tickets) => async (stream, read) => {
  tickets.push((await read())[0].attach.ticket);
  stream.write({ updates: [attached, events(ended(1)), detached("GAME_OVER")] });
};

for (const [how, args, env] of [["an argument", ["--ticket", "kept"], {}], ["the environment", [], { CHEFSHAT_TICKET: "kept" }]]) {
  test(`the process resumes with a ticket from ${how}, and does not join`, async () => {
    const tickets = [];
    const server = await serve(ending(tickets));
    const { status, out, err } = await run(["--address", server.address, ...args], { CHEFSHAT_CODE: "TABLE", ...env });
    assert.deepEqual([status, err], [0, ""]);
    assert.deepEqual(JSON.parse(out), { seat: 2, standings: STANDINGS });
    assert.deepEqual([tickets, server.joins], [["kept"], []]);
  });
}

test("a ticket is stored in a file until the game is over: a killed process resumes when it is started again", async (context) => {
  const folder = await folderOf(context);
  const file = join(folder, "ticket");
  const tickets = [];
  let agent;
  const killing = async (stream, read) => {
    tickets.push((await read())[0].attach.ticket);
    agent.kill("SIGKILL");
  };
  const server = await serve(killing, ending(tickets));
  const args = ["--address", server.address, "--code", "TABLE", "--ticket-file", file];
  const killed = await run(args, {}, (started) => { agent = started; });
  assert.equal(killed.out, "");
  assert.match(killed.err, /^if this process ends before the game, resume by the same command: the ticket is in .*ticket\n$/);
  assert.equal(await readFile(file, "utf8"), "a ticket\n");
  assert.equal((await stat(file)).mode & 0o777, 0o600);

  const { status, out, err } = await run(args);
  assert.deepEqual([status, err], [0, `resuming with the ticket in ${file}\n`]);
  assert.deepEqual(JSON.parse(out), { seat: 2, standings: STANDINGS });
  assert.deepEqual([tickets, server.joins.length], [["a ticket", "a ticket"], 1]);
  assert.deepEqual(await readdir(folder), []);

  const aborted = [attached, events({ sequence: 1, game_aborted: { reason: "ABORT_REASON_CLOSED" } }), detached("GAME_OVER")];
  const lost = [attached, detached("SUPERSEDED")];
  for (const [updates, left] of [[aborted, []], [lost, ["ticket"]]]) {
    server.remaining.push(async (stream, read) => { await read(); stream.write({ updates }); });
    assert.equal((await run(args)).status, 1);
    assert.deepEqual(await readdir(folder), left);
  }
});

test("a second agent with the same ticket file is refused, and a stale lock is ignored", async (context) => {
  const folder = await folderOf(context);
  const file = join(folder, "ticket");
  const tickets = [];
  const args = (server) => ["--address", server.address, "--code", "TABLE", "--ticket-file", file];
  let second;
  const server = await serve(async (stream, read) => {
    tickets.push((await read())[0].attach.ticket);
    second = await run(args(server)); // While the first agent plays.
    stream.write({ updates: [attached, events(ended(1)), detached("GAME_OVER")] });
  });
  assert.equal((await run(args(server))).status, 0);
  assert.equal(second.status, 1);
  assert.match(second.err, /^agent: another agent uses .*ticket; if process \d+ is not an agent, remove .*\.ticket\.lock\n$/);
  assert.equal(server.joins.length, 1);
  assert.deepEqual(await readdir(folder), []);

  const gone = spawn(process.execPath, ["--eval", ""]);
  await once(gone, "close");
  await writeFile(join(folder, ".ticket.new"), "left behind");
  // Of a process that has ended, half written, and of one before the machine was started again.
  const stale = [`${gone.pid}`, "", "0", `${process.pid} another-boot`];
  for (const lock of stale) {
    await writeFile(join(folder, ".ticket.lock"), lock);
    server.remaining.push(ending(tickets));
    assert.equal((await run(args(server))).status, 0, lock);
    assert.deepEqual(await readdir(folder), []);
  }
  assert.equal(tickets.length, 1 + stale.length);

  await writeFile(join(folder, ".ticket.lock"), `${process.pid}`); // As earlier versions write it.
  assert.match((await run(args(server))).err, /^agent: another agent uses /);
});

for (const signal of ["SIGINT", "SIGTERM"]) {
  test(`${signal} ends the process with 1`, async () => {
    let agent;
    const server = await serve(async (stream, read) => {
      await read();
      agent.kill(signal);
    });
    const { status, out, err } = await run(["--address", server.address, "--ticket", "kept"], {}, (started) => { agent = started; });
    assert.deepEqual([status, out, err], [1, "", "agent: stopped by a signal\n"]);
  });
}

test("a ticket that cannot be stored is printed, and the game is played", async (context) => {
  const folder = await folderOf(context);
  const file = join(folder, "ticket");
  const server = await serve(async (stream, read) => {
    await read();
    stream.write({ updates: [attached, events(ended(1)), detached("GAME_OVER")] });
  });
  server.joining = () => mkdirSync(file); // A folder takes the file's place after the agent has prepared it.
  const { status, out, err } = await run(["--address", server.address, "--code", "TABLE", "--ticket-file", file]);
  assert.equal(status, 0);
  assert.deepEqual(JSON.parse(out), { seat: 2, standings: STANDINGS });
  const [warning, printed, left] = err.split("\n");
  assert.match(warning, /^warning: cannot store the ticket in .*ticket: EISDIR/);
  assert.equal(printed, "if this process ends before the game, resume with --ticket a ticket");
  assert.match(left, /^warning: cannot delete the used ticket/);
});

test("a ticket that cannot be removed after the game is only a warning; another's ticket is not removed", async (context) => {
  const folder = await folderOf(context);
  const file = join(folder, "ticket");
  const server = await serve();
  const args = ["--address", server.address, "--ticket-file", file];
  for (const [meanwhile, left] of [
    [async () => { await rm(file); await mkdir(file); }, /^resuming .*\nwarning: cannot delete the used ticket: EISDIR.*\n$/],
    [() => writeFile(file, "another's"), /^resuming .*\n$/],
  ]) {
    await rm(file, { recursive: true, force: true });
    await writeFile(file, "kept");
    server.remaining.push(async (stream, read) => {
      await read();
      await meanwhile();
      stream.write({ updates: [attached, events(ended(1)), detached("GAME_OVER")] });
    });
    const { status, out, err } = await run(args);
    assert.deepEqual([status, JSON.parse(out)], [0, { seat: 2, standings: STANDINGS }]);
    assert.match(err, left);
  }
  assert.equal(await readFile(file, "utf8"), "another's");
});

test("the process reports errors and exits with 1", async () => {
  const { address } = await serve();
  const wrongCode = await run(["--address", address, "--code", "WRONG"]);
  assert.deepEqual(wrongCode, { status: 1, out: "", err: "agent: no room has this join code\n" });

  servers.pop().forceShutdown();
  await assert.rejects(play({ address, code: "TABLE", name: "Ada", pause: async () => {} }), /ECONNREFUSED/);

  for (const two of [["--code", "TABLE", "--ticket", "kept"], ["--code", "TABLE", "--tournament", "CUP"], ["--ticket", "T", "--ticket-file", "F"]]) {
    const { status, err } = await run(["--address", address, ...two]);
    assert.equal(status, 1);
    assert.match(err, /^agent: give one of --code, --tournament and --ticket/);
  }
  for (const games of ["0", "65", "two", "1e1", ""]) {
    const { status, err } = await run(["--address", address, "--tournament", "CUP", "--games", games]);
    assert.deepEqual([status, err], [1, "agent: --games must be a number from 1 to 64\n"]);
  }
  const nothing = await run(["--address", address]);
  assert.deepEqual([nothing.status, nothing.out], [1, ""]);
  assert.match(nothing.err, /^agent: give --code, --tournament or --ticket/);

  const misspelt = await run(["--adress", address]);
  assert.equal(misspelt.status, 1);
  assert.match(misspelt.err, /^agent: .*--adress/);
});

test("a token that others can read on the way is warned of once", async () => {
  const { address } = await serve(); // Refuses the join code.
  const port = address.split(":")[1];
  const warning = "warning: the token is sent unencrypted to 0.0.0.0; use https://0.0.0.0\n";
  for (const [host, token, said] of [["0.0.0.0", "secret", warning], ["0.0.0.0", "", ""], ["127.0.0.1", "secret", ""], ["localhost", "secret", ""]]) {
    const { err } = await run(["--address", `${host}:${port}`, "--code", "WRONG"], { CHEFSHAT_TOKEN: token });
    assert.equal(err, `${said}agent: no room has this join code\n`);
  }
});
