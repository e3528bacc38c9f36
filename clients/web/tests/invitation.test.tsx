// The pages that an invitation opens: what a code belongs to, how often it is asked for, and a
// tournament that only its code shows.

import { create } from "@bufbuild/protobuf";
import { act } from "preact/test-utils";
import { beforeEach, expect, test, vi } from "vitest";
import { roomApi, tournamentApi } from "../src/api/client";
import { ParticipantSchema, RoomState, Visibility } from "../src/gen/chefshat/v1/room_pb";
import { GetRoomResponseSchema } from "../src/gen/chefshat/v1/room_service_pb";
import { TournamentSchema, TournamentState } from "../src/gen/chefshat/v1/tournament_pb";
import { GetTournamentResponseSchema } from "../src/gen/chefshat/v1/tournament_service_pb";
import { t } from "../src/i18n";
import { Join } from "../src/lobby/Join";
import { TournamentPage } from "../src/tournaments/TournamentPage";
import { later, mount, root, type } from "./mounted";
import { AWAY, refused } from "./refusals";

const ID = "5f0c6a4de2b14b7f8a3d9c1e7b60425d";
const CODE = "BCDF2345";

const room = () =>
  create(GetRoomResponseSchema, { room: { roomId: ID, name: "Table one", state: RoomState.WAITING, seats: [{}] } });
const tournament = () =>
  create(GetTournamentResponseSchema, {
    tournament: create(TournamentSchema, {
      tournamentId: ID,
      state: TournamentState.OPEN,
      settings: { name: "Club evening", policy: { visibility: Visibility.PRIVATE } },
    }),
  });

beforeEach(() => {
  vi.useFakeTimers({ toFake: ["setTimeout", "clearTimeout", "setInterval", "clearInterval"] });
});

async function opened() {
  await mount(<Join route={{ page: "join", code: CODE }} />);
  await later(0);
}

test("a wrong code is sent once, and its page says that it is wrong", async () => {
  const rooms = vi.spyOn(roomApi, "getRoom").mockRejectedValue(refused("JOIN_CODE_WRONG"));
  const tournaments = vi.spyOn(tournamentApi, "getTournament").mockRejectedValue(refused("JOIN_CODE_WRONG"));
  await opened();
  await later(600_000);
  expect(rooms).toHaveBeenCalledTimes(1);
  expect(tournaments).toHaveBeenCalledTimes(1);
  expect(root.textContent).toContain(t().faults.byReason.JOIN_CODE_WRONG);
});

test("who may try no more codes learns why", async () => {
  vi.spyOn(roomApi, "getRoom").mockRejectedValue(refused("TOO_MANY_WRONG_CODES"));
  await opened();
  expect(root.textContent).toContain(t().faults.byReason.TOO_MANY_WRONG_CODES);
  expect(root.querySelector("form")).toBeNull();
});

test("while the server is away, the room that was found stays, and one that was not can be joined", async () => {
  const rooms = vi.spyOn(roomApi, "getRoom").mockRejectedValueOnce(AWAY).mockResolvedValueOnce(room());
  rooms.mockRejectedValue(AWAY);
  await opened();
  expect(root.querySelector("form")).not.toBeNull();
  expect(root.querySelector('[data-part~="join-room"]')).toBeNull();
  await later(60_000);
  expect(root.querySelector('[data-part~="join-room"]')?.textContent).toContain("Table one");
});

test("a name that a join without an answer may have taken is tried again, any other is not", async () => {
  const rooms = vi.spyOn(roomApi, "getRoom").mockResolvedValue(room());
  const join = vi.spyOn(roomApi, "joinRoom").mockRejectedValue(AWAY);
  await opened();
  await enter("Ada");
  expect(join).toHaveBeenCalledTimes(1);
  const taken = room();
  taken.room?.seats.push(
    create(ParticipantSchema, { seat: 1, name: "Ada" }),
    create(ParticipantSchema, { seat: 2, name: "Bo" }),
  );
  rooms.mockResolvedValue(taken);
  await later(10_000);
  await enter("Bo");
  expect(join).toHaveBeenCalledTimes(1);
  await enter("Ada");
  expect(join).toHaveBeenCalledTimes(2);
});

/** Enters a text in the first field, and sends it. */
async function enter(text: string) {
  await type(root.querySelector("input"), text);
  await act(() => root.querySelector<HTMLElement>("form button")?.click());
  await later(0);
}

test("a pasted link is followed, with what it brings, and no code is asked for", async () => {
  const asked = vi.spyOn(roomApi, "getRoom");
  const followed = vi.spyOn(location, "assign").mockReturnValue();
  await mount(<Join route={{ page: "join", code: "" }} />);
  await enter(`https://example.org/rooms/${ID}#seat=secret`);
  expect(followed.mock.calls).toEqual([[`/rooms/${ID}#seat=secret`]]);
  await enter("https://example.org/else/where#secret");
  expect(root.textContent).toContain(t().lobby.join.codeMissing);
  expect(followed).toHaveBeenCalledTimes(1);
  expect(asked).not.toHaveBeenCalled();
  expect(location.pathname).toBe("/");
});

async function openTournament(search: string) {
  history.replaceState(null, "", `/tournaments/${ID}${search}`);
  vi.spyOn(tournamentApi, "followTournament").mockImplementation(() => {
    throw refused("TOURNAMENT_UNKNOWN");
  });
  await mount(<TournamentPage route={{ page: "tournament", tournamentId: ID }} />);
  await later(0);
}

test("a private tournament is shown to those who bring its code, who can join it", async () => {
  const asked = vi.spyOn(tournamentApi, "getTournament").mockResolvedValue(tournament());
  await openTournament(`?code=${CODE}`);
  expect(asked.mock.calls[0]?.[0]).toEqual({ joinCode: CODE });
  expect(root.querySelector("h1")?.textContent).toBe("Club evening");
  expect(root.querySelector("form")?.textContent).toContain(t().tournaments.join.submit);
});

test("without a code, or with a wrong one, a private tournament is not shown", async () => {
  const asked = vi.spyOn(tournamentApi, "getTournament").mockRejectedValue(refused("JOIN_CODE_WRONG"));
  await openTournament("");
  expect(asked).not.toHaveBeenCalled();
  expect(root.textContent).toContain(t().faults.byReason.TOURNAMENT_UNKNOWN);
  await mount(null);
  await openTournament(`?code=${CODE}`);
  await later(600_000);
  expect(asked).toHaveBeenCalledTimes(1);
  expect(root.textContent).toContain(t().faults.byReason.JOIN_CODE_WRONG);
});

test("the code of another tournament does not show this one", async () => {
  const other = tournament();
  if (other.tournament) other.tournament.tournamentId = "0".repeat(32);
  vi.spyOn(tournamentApi, "getTournament").mockResolvedValue(other);
  await openTournament(`?code=${CODE}`);
  expect(root.textContent).toContain(t().faults.byReason.TOURNAMENT_UNKNOWN);
});
