// The organiser's changes by hand: removing a participant by name, and the links of people who take
// over a place.

import { create } from "@bufbuild/protobuf";
import { render } from "preact";
import { act } from "preact/test-utils";
import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { tournamentApi } from "../src/api/client";
import { TournamentSchema, TournamentState } from "../src/gen/chefshat/v1/tournament_pb";
import {
  RemoveParticipantResponseSchema,
  ReplaceParticipantResponseSchema,
} from "../src/gen/chefshat/v1/tournament_service_pb";
import { forgetAll, remember } from "../src/store";
import { ManageParticipants } from "../src/tournaments/ByHand";
import { hostedTournament, placeLinks, removeParticipant, replaceByPerson } from "../src/tournaments/hosting";
import { WhichPlace } from "../src/tournaments/OwnPlace";
import { root } from "./mounted";

const ID = "5f0c6a4de2b14b7f8a3d9c1e7b60425d";
const TICKET = "ab".repeat(48);

beforeEach(() => {
  remember(`organised.${ID}`, JSON.stringify({ joinCode: "ABCD", ownerToken: "cd".repeat(48) }));
});
afterEach(() => {
  vi.restoreAllMocks();
  forgetAll();
});

const show = (...names: string[]) =>
  act(() =>
    render(
      <ManageParticipants
        tournament={create(TournamentSchema, {
          tournamentId: ID,
          state: TournamentState.OPEN,
          participants: names.map((name, participant) => ({ name, participant })),
        })}
        agents={[]}
      />,
      root,
    ),
  );
const button = (words: string) =>
  [...root.querySelectorAll("button")].find((one) => one.textContent?.startsWith(words));
const press = (words: string) => act(() => button(words)?.click());
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
  await act(() => render(<WhichPlace {...{ held, brought, decide }} />, root));
  expect(root.textContent).toContain("this device loses the place of Ada");
  await press("Continue as Ada");
  await press("Take part as Bo");
  expect(decide.mock.calls).toEqual([[null], [brought]]);
});
