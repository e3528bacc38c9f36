// The results of a tournament and its certificates, to print.

import { create } from "@bufbuild/protobuf";
import { act } from "preact/test-utils";
import { beforeEach, expect, test, vi } from "vitest";
import { tournamentApi } from "../src/api/client";
import {
  TournamentFormat,
  TournamentGameState,
  TournamentSchema,
  TournamentStandingSchema,
  TournamentState,
} from "../src/gen/chefshat/v1/tournament_pb";
import { ListTournamentGamesResponseSchema } from "../src/gen/chefshat/v1/tournament_service_pb";
import { dateOf, setLanguage } from "../src/i18n";
import { fileName } from "../src/parts/download";
import { certificatesOf } from "../src/tournaments/certificate";
import { Results } from "../src/tournaments/ResultsPage";
import { eventually, mount, root } from "./mounted";

const CREATED_MS = Date.UTC(2026, 2, 14, 12);
const NAMES = ["Ada", "Bo & Çem", "greedy", "Zoë", "Łucja 你好"];

function tournament(state = TournamentState.FINISHED) {
  return create(TournamentSchema, {
    tournamentId: "5f0c6a4de2b14b7f8a3d9c1e7b60425d",
    state,
    rounds: 3,
    round: 3,
    games: 3,
    gamesOver: 3,
    createdAtMs: BigInt(CREATED_MS),
    settings: { name: "Spring cup", format: TournamentFormat.SWISS, rounds: 3, gamesPerPairing: 1 },
    participants: NAMES.map((name, participant) => ({
      participant,
      name,
      builtInAgent: name === "greedy" ? name : "",
      withdrawn: name === "Zoë",
    })),
  });
}
const standings = NAMES.map((_, participant) =>
  create(TournamentStandingSchema, {
    participant,
    place: participant + 1,
    games: 3,
    score: BigInt(9 - participant),
    places: participant === 0 ? [2, 1] : [],
  }),
);
const game = (number: number, state: TournamentGameState) => ({
  game: number,
  round: 1 + (number % 2),
  table: 1,
  number: 1,
  state,
  seats: [
    { participant: 1, place: 2, score: 1, formerName: "Di" },
    { participant: 0, place: 1, score: 3 },
  ],
});

beforeEach(() => {
  const games = [game(0, TournamentGameState.COUNTED), game(1, TournamentGameState.VOID)];
  vi.spyOn(tournamentApi, "listTournamentGames").mockResolvedValue(
    create(ListTournamentGamesResponseSchema, { games }),
  );
});

test("the page has standings, date, settings and the games that count", async () => {
  await mount(<Results live={{ tournament: tournament(), standings, games: [] }} />);
  await eventually(() => expect(root.textContent).toContain("1. Ada +3 · 2. Di +1"));
  expect(root.textContent).toContain("2026");
  expect(root.textContent).toContain("Swiss");
  expect(root.querySelectorAll('[data-part~="standings"] tbody tr')).toHaveLength(NAMES.length);
  // The void game is not listed.
  expect(root.textContent).toContain("Round 1");
  expect(root.textContent).not.toContain("Round 2");
});

test.each([
  [TournamentState.PLAYING, "Standings"],
  [TournamentState.FINISHED, "Final standings"],
  // It was closed early: nobody has won.
  [TournamentState.CLOSED, "Standings"],
])("in state %i the standings and their table are called %j", async (state, title) => {
  await mount(<Results live={{ tournament: tournament(state), standings, games: [] }} />);
  const titles = [...root.querySelectorAll('section:has([data-part~="standings"]) > h2, caption')];
  expect(titles.slice(0, 2).map(({ textContent }) => textContent)).toEqual([title, title]);
});

test.each([
  ["en", "took 1st place of 5 in the tournament", "took part in the tournament", "first in 2 games"],
  ["de", "hat im Turnier den 1. Platz von 5 erreicht", "hat am Turnier teilgenommen", "2 gewonnene Partien"],
  ["es", "obtuvo el 1.º puesto de 5 en el torneo", "participó en el torneo", "2 partidas ganadas"],
  ["it", "ha ottenuto il 1º posto su 5 nel torneo", "ha partecipato al torneo", "2 partite vinte"],
] as const)("certificates in %s say who achieved what", async (language, first, part, wins) => {
  await setLanguage(language);
  const certificates = certificatesOf(tournament(), standings);
  // Built-in agents get none.
  expect(certificates.map(({ name }) => name)).toEqual(["Ada", "Bo & Çem", "Zoë", "Łucja 你好"]);
  expect(certificates[0]).toMatchObject({ achieved: first, tournament: "Spring cup" });
  expect(certificates[0]?.lines.join()).toContain(wins);
  // A participant who has left has no place.
  expect(certificates[2]?.achieved).toBe(part);
  await setLanguage("en");
});

test("they have the day on which it started, not that on which it was created", () => {
  const { settings } = tournament();
  const dayOf = (startMs: number) => {
    const planned = tournament();
    if (settings) planned.settings = { ...settings, startAtMs: BigInt(startMs) };
    return certificatesOf(planned, standings)[0]?.lines[0];
  };
  expect(dayOf(0)).toContain(dateOf(BigInt(CREATED_MS)));
  vi.spyOn(Date, "now").mockReturnValue(CREATED_MS + 20 * 86_400_000);
  expect(dayOf(CREATED_MS + 19 * 86_400_000)).toContain(dateOf(BigInt(CREATED_MS + 19 * 86_400_000)));
  // It was started by hand, long before.
  expect(dayOf(CREATED_MS + 21 * 86_400_000)).toContain(dateOf(BigInt(CREATED_MS)));
});

test("there are none before the end, or if it was closed early", () => {
  expect(certificatesOf(tournament(TournamentState.PLAYING), standings)).toEqual([]);
  expect(certificatesOf(tournament(TournamentState.CLOSED), standings)).toEqual([]);
});

test("certificates are on the page while the browser prints them", async () => {
  const sheets = () => [...root.querySelectorAll('[data-part="certificate"]')].map(({ textContent }) => textContent);
  const printed: (string | null)[][] = [];
  vi.stubGlobal("print", () => printed.push(sheets()));
  await mount(<Results live={{ tournament: tournament(), standings, games: [] }} />);
  const press = (label: string) =>
    act(async () => {
      const buttons = [...root.querySelectorAll("button")].filter(({ textContent }) => textContent === label);
      expect(buttons).toHaveLength(1);
      buttons[0]?.click();
    });

  await press("Print all 4 certificates");
  expect(printed).toHaveLength(1);
  expect(printed[0]?.map((text) => text?.includes("Spring cup"))).toEqual([true, true, true, true]);
  await act(async () => void window.dispatchEvent(new Event("afterprint")));
  expect(sheets()).toEqual([]);

  await press("Print the certificate of Łucja 你好");
  expect(printed[1]?.length).toBe(1);
  expect(printed[1]?.[0]).toContain("Łucja 你好");
  vi.unstubAllGlobals();
});

test.each([
  ["Spring cup: Çem/Bo", "Spring-cup-Çem-Bo"],
  ["…", "file"],
])("%s is saved as %s", (name, expected) => expect(fileName(name)).toBe(expected));
