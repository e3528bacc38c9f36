// The agent against the real server, where CHEFSHAT_BIN names one: a whole Shift against three built-in agents, in processes of
// their own on a port of the system's choice.
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
import { play, protocol } from "../agent.js";

const SERVER = process.env.CHEFSHAT_BIN;

/** The address a server says it listens on, in its first line that says so. */
async function listening(server) {
  for await (const line of createInterface({ input: server.stdout })) {
    const said = JSON.parse(line);
    if (said.event === "listening") return said.address;
  }
  throw new Error("the server ended without listening");
}

test("a Shift on the real server", { skip: SERVER ? false : "CHEFSHAT_BIN names no server" }, async () => {
  const data = await mkdtemp(join(tmpdir(), "chefshat-node-"));
  const args = ["serve", "--listen", "127.0.0.1:0", "--json", "--data-dir", data];
  const server = spawn(SERVER, args, { stdio: ["ignore", "pipe", "inherit"] });
  const closed = once(server, "close");
  try {
    const address = await listening(server);
    const rooms = new protocol.RoomService(address, grpc.credentials.createInsecure());
    const builtIn = { built_in_agent: "random" };
    const request = {
      name: "node test",
      rules: { target_shifts: 1 },
      seats: [builtIn, { reserved_for: "PARTICIPANT_KIND_AGENT" }, builtIn, builtIn],
    };
    const { join_code: code } = await promisify(rooms.CreateRoom).call(rooms, request);
    rooms.close();

    const { seat, standings } = await play({ address, code, name: "Node" });

    assert.equal(seat, 1);
    assert.deepEqual(standings.map(({ place }) => place), [1, 2, 3, 4]);
    assert.deepEqual(standings.map(({ points }) => points), [5, 3, 1, 0]);
    assert.deepEqual(standings.map((line) => line.seat).sort(), [0, 1, 2, 3]);
  } finally {
    server.kill();
    await closed;
    await rm(data, { recursive: true, force: true });
  }
});
