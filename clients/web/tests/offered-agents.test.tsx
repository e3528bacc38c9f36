// The agents that people can choose from: wherever there is a list, none is for programs only.

import { create } from "@bufbuild/protobuf";
import { Code, ConnectError } from "@connectrpc/connect";
import type { ComponentChild } from "preact";
import { beforeEach, expect, test, vi } from "vitest";
import { serverApi } from "../src/api/client";
import { GetServerInfoResponseSchema } from "../src/gen/chefshat/v1/server_service_pb";
import { TournamentSchema, TournamentState } from "../src/gen/chefshat/v1/tournament_pb";
import { NewRoom } from "../src/lobby/NewRoom";
import { remember } from "../src/store";
import { NewStudyPage } from "../src/studies/NewStudyPage";
import { NewTournament } from "../src/tournaments/NewTournament";
import { Organiser } from "../src/tournaments/Organiser";
import { later, mount, root, settle } from "./mounted";

const ID = "5f0c6a4de2b14b7f8a3d9c1e7b60425d";
const AGENTS = ["greedy", "random", "random_unmasked", "search", "trained"];

beforeEach(() => {
  vi.spyOn(serverApi, "getServerInfo").mockResolvedValue(
    create(GetServerInfoResponseSchema, {
      presets: [{ preset: "paper", players: 4, faces: 11 }],
      builtInAgents: AGENTS,
      quickBuiltInAgents: AGENTS.filter((agent) => agent !== "search"),
    }),
  );
});

const organised = {
  tournament: create(TournamentSchema, {
    tournamentId: ID,
    state: TournamentState.OPEN,
    settings: { physicalTables: 1 },
    participants: [{ participant: 0, name: "Ada" }],
  }),
  standings: [],
  games: [],
};

const PAGES: [string, () => ComponentChild][] = [
  ["a new room", () => <NewRoom />],
  ["a new tournament", () => <NewTournament />],
  ["a new study", () => <NewStudyPage />],
  ["a replacement in a tournament with real cards", () => <Organiser live={organised} />],
];

test.each(PAGES)("%s", async (_, page) => {
  remember(`organised.${ID}`, JSON.stringify({ joinCode: "ABCD", ownerToken: "cd".repeat(48) }));
  await mount(page());
  await settle();
  // A list with every other agent is there.
  const options = [...root.querySelectorAll("option")].map(({ value, textContent }) => `${value} ${textContent}`);
  expect(options.filter((option) => option.includes("trained"))).not.toEqual([]);
  expect(root.innerHTML).toContain("greedy");
  expect(root.innerHTML).not.toContain("random_unmasked");
});

test("a form that was opened while the server was away gets its fields when it is back", async () => {
  vi.resetModules();
  const { serverApi } = await import("../src/api/client");
  const { startLanguage } = await import("../src/i18n");
  const { NewRoom } = await import("../src/lobby/NewRoom");
  await startLanguage();
  vi.useFakeTimers({ toFake: ["setTimeout", "clearTimeout"] });
  const away = new ConnectError("away", Code.Unavailable);
  vi.spyOn(serverApi, "getServerInfo")
    .mockRejectedValueOnce(away)
    .mockRejectedValueOnce(away)
    .mockResolvedValue(
      create(GetServerInfoResponseSchema, {
        presets: [{ preset: "paper", players: 4, faces: 11 }],
        builtInAgents: AGENTS,
      }),
    );
  await mount(<NewRoom />);
  await later(0);
  expect(root.querySelector('[role="alert"]')).not.toBeNull();
  expect(root.querySelector("form")).toBeNull();
  await later(60_000);
  expect(root.querySelector('[role="alert"]')).toBeNull();
  expect(root.querySelector("form")).not.toBeNull();
  vi.useRealTimers();
});
