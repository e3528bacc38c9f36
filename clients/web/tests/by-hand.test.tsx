// The organiser's changes by hand: pausing, games that are called or postponed, removing a participant
// by name, giving its place to an agent, and the links of people who take over a place.

import { create } from "@bufbuild/protobuf";
import { act } from "preact/test-utils";
import { beforeEach, expect, test, vi } from "vitest";
import { tournamentApi } from "../src/api/client";
import { TournamentGameState, TournamentSchema, TournamentState } from "../src/gen/chefshat/v1/tournament_pb";
import {
  CallGameResponseSchema,
  ListTournamentGamesResponseSchema,
  PauseTournamentResponseSchema,
  PostponeGameResponseSchema,
  RemoveParticipantResponseSchema,
  ReplaceParticipantResponseSchema,
  ResumeTournamentResponseSchema,
} from "../src/gen/chefshat/v1/tournament_service_pb";
import { t } from "../src/i18n";
import { WhichOne } from "../src/lobby/WhichOne";
import { remember } from "../src/store";
import { ManageGames, ManageParticipants, Pause } from "../src/tournaments/ByHand";
import { hostedTournament, placeLinks, removeParticipant, replaceByPerson } from "../src/tournaments/hosting";
import { button, mount, press, root, settle } from "./mounted";

const ID = "5f0c6a4de2b14b7f8a3d9c1e7b60425d";
const TICKET = "ab".repeat(48);
const OWNER = { tournamentId: ID, ownerToken: "cd".repeat(48) };

beforeEach(() => {
  remember(`organised.${ID}`, JSON.stringify({ joinCode: "ABCD", ownerToken: OWNER.ownerToken }));
});

const tournament = (names: readonly string[], state = TournamentState.OPEN) =>
  create(TournamentSchema, {
    tournamentId: ID,
    state,
    participants: names.map((name, participant) => ({ name, participant })),
  });
const show = (...names: string[]) =>
  mount(<ManageParticipants tournament={tournament(names)} agents={["greedy", "trained"]} />);
const removing = () =>
  vi.spyOn(tournamentApi, "removeParticipant").mockResolvedValue(create(RemoveParticipantResponseSchema));
const replacing = () =>
  vi
    .spyOn(tournamentApi, "replaceParticipant")
    .mockResolvedValue(create(ReplaceParticipantResponseSchema, { ticket: TICKET }));

test("the question names the participant, who is removed", async () => {
  const remove = removing();
  await show("Ada", "Bo");
  await press("Remove…");
  expect(root.querySelector('[data-part="question"]')?.textContent).toContain("Remove Ada?");
  await press("Remove now");
  expect(remove.mock.calls.map(([{ participant }]) => participant)).toEqual([0]);
});

test("a participant who takes the number while the question is open is not removed", async () => {
  const remove = removing();
  await show("Ada", "Bo");
  await press("Remove…");
  await show("Cleo", "Bo");
  expect(root.querySelector('[data-part="question"]')?.textContent).toBe(
    "Nothing was done: Cleo has taken the place of Ada in the meantime.",
  );
  expect(button("Remove now")).toBeUndefined();
  expect(remove).not.toHaveBeenCalled();
  // Asked again, it is about the other one.
  await press("Cancel");
  await press("Remove…");
  expect(root.querySelector('[data-part="question"]')?.textContent).toContain("Remove Cleo?");
});

test("the link of a replacement stays on the device until it is dismissed", async () => {
  replacing();
  await replaceByPerson(ID, 1, " Dora ");
  // As after a reload: nothing but what is stored.
  await show("Ada", "Dora");
  const link = root.querySelector('[data-part="invite-link"]')?.textContent ?? "";
  expect(decodeURIComponent(link)).toContain(JSON.stringify([TICKET, 1, "Dora"]));
  expect(root.querySelector("details")?.open).toBe(true);
  await press("I have passed it on");
  expect(root.querySelector('[data-part="invite-link"]')).toBeNull();
  expect(placeLinks(ID)).toEqual([]);
  expect(hostedTournament(ID)?.joinCode).toBe("ABCD");
});

test.each([
  ["is removed", () => removeParticipant(ID, 1)],
  ["is replaced again", () => replaceByPerson(ID, 1, "Eve")],
])("the link is void once the place %s", async (_, change) => {
  removing();
  replacing();
  await replaceByPerson(ID, 1, "Dora");
  await replaceByPerson(ID, 0, "Fay");
  await change();
  expect(placeLinks(ID).map(({ name }) => name)).not.toContain("Dora");
  expect(placeLinks(ID).map(({ name }) => name)).toContain("Fay");
});

test("a device asks which of two places it shall have", async () => {
  const decide = vi.fn();
  const held = { ticket: TICKET, participant: 0, name: "Ada" };
  const brought = { ticket: "ef".repeat(48), participant: 1, name: "Bo" };
  await mount(<WhichOne {...{ held, brought, decide }} words={t().tournaments.part.which} />);
  expect(root.textContent).toContain("this device loses the place of Ada");
  await press("Continue as Ada");
  await press("Take part as Bo");
  expect(decide.mock.calls).toEqual([[null], [brought]]);
});

test("an agent takes the place of a participant", async () => {
  const replace = replacing();
  await show("Ada", "Bo");
  const [, form] = root.querySelectorAll("form");
  const by = form?.querySelector("select");
  if (!form || !by) throw new Error("Bo can be replaced");
  expect([...by.options].map(({ textContent }) => textContent)).toEqual([
    "another person",
    "the agent “greedy”",
    "the agent “trained”",
  ]);
  const submit = () => act(() => form.requestSubmit());
  // Another person needs a name, an agent does not.
  await submit();
  expect(form.textContent).toContain("Enter a name.");
  expect(replace).not.toHaveBeenCalled();
  by.value = "trained";
  await act(() => {
    by.dispatchEvent(new Event("change", { bubbles: true }));
  });
  expect(form.querySelector("input")).toBeNull();
  await submit();
  await settle();
  expect(replace.mock.calls.map(([request]) => request)).toEqual([
    { ...OWNER, participant: 1, builtInAgent: "trained" },
  ]);
  // No link is to be passed on.
  expect(placeLinks(ID)).toEqual([]);
});

test("a tournament is paused and resumed, and an error is shown", async () => {
  const pause = vi.spyOn(tournamentApi, "pauseTournament");
  pause.mockRejectedValueOnce(new Error("not now")).mockResolvedValue(create(PauseTournamentResponseSchema));
  const resume = vi.spyOn(tournamentApi, "resumeTournament");
  resume.mockResolvedValue(create(ResumeTournamentResponseSchema));
  const showPause = (paused: boolean) => mount(<Pause tournament={{ ...tournament([]), paused }} />);
  await showPause(false);
  expect(root.textContent).toContain("No new game starts; running games continue.");
  await press("Pause");
  await settle();
  expect(root.querySelector('[role="alert"]')?.textContent).toContain("The server does not answer.");
  await press("Pause");
  await settle();
  expect(root.querySelector('[role="alert"]')).toBeNull();
  expect(pause.mock.calls.map(([request]) => request)).toEqual([OWNER, OWNER]);
  expect(resume).not.toHaveBeenCalled();

  await showPause(true);
  expect(root.textContent).toContain("The tournament is paused");
  await press("Resume the tournament");
  await settle();
  expect(resume.mock.calls.map(([request]) => request)).toEqual([OWNER]);
  expect(pause).toHaveBeenCalledTimes(2);
});

test("a due game is called or postponed, a void one called again, and no other game is listed", async () => {
  const names = ["Ada", "Bo", "Cleo", "Dora"];
  const states = [
    TournamentGameState.COUNTED,
    TournamentGameState.PLAYING,
    TournamentGameState.DUE,
    TournamentGameState.VOID,
  ];
  const games = states.map((state, game) => ({
    game,
    state,
    round: 2,
    table: game + 1,
    number: 1,
    seats: [{ participant: game }, { participant: 0 }],
  }));
  const list = vi
    .spyOn(tournamentApi, "listTournamentGames")
    .mockResolvedValue(create(ListTournamentGamesResponseSchema, { games }));
  const call = vi.spyOn(tournamentApi, "callGame").mockResolvedValue(create(CallGameResponseSchema));
  const postpone = vi.spyOn(tournamentApi, "postponeGame").mockResolvedValue(create(PostponeGameResponseSchema));
  const live = { tournament: tournament(names, TournamentState.PLAYING), standings: [], games: [] };
  // Another part of the page shows them, too.
  await mount([<ManageGames key="one" live={live} />, <ManageGames key="other" live={live} />]);
  await settle();
  expect(root.querySelectorAll('[data-part="manage-games"]')).toHaveLength(2);
  expect(list).toHaveBeenCalledTimes(1);
  await mount(<ManageGames live={live} />);
  await settle();
  const [due, again, ...others] = root.querySelectorAll("li");
  expect(others).toEqual([]);
  expect(due?.textContent).toContain("Cleo, Ada");
  expect(again?.textContent).toContain("Dora, Ada");
  const buttons = (within: Element | undefined) => [...(within?.querySelectorAll("button") ?? [])];
  expect(buttons(due).map(({ textContent }) => textContent)).toEqual(["Call now", "Postpone"]);
  expect(buttons(again).map(({ textContent }) => textContent)).toEqual(["Call now"]);
  for (const one of [...buttons(due), ...buttons(again)]) {
    await act(() => one.click());
    await settle();
  }
  expect(call.mock.calls.map(([request]) => request)).toEqual([
    { ...OWNER, game: 2 },
    { ...OWNER, game: 3 },
  ]);
  expect(postpone.mock.calls.map(([request]) => request)).toEqual([{ ...OWNER, game: 2 }]);
});
