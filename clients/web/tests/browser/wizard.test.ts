// A person plays a whole Shift as a robot from the console. Others see a robot; the record says who it
// was.

import type { Page } from "playwright-core";
import { expect, test } from "vitest";
import { ExpressionSource } from "../../src/gen/chefshat/v1/decision_pb";
import { ParticipantKind } from "../../src/gen/chefshat/v1/room_pb";
import { byClicks, nextDecision, playOn, sitDown, type Way } from "./play";
import { clientsOf, gameOf, newRoom, recordOf } from "./rooms";
import { browser, person, server, useStage } from "./stage";

const { HUMAN, AGENT, ROBOT, UNSPECIFIED } = ParticipantKind;

useStage();

/** The decisions taken as the agent suggests; computing a hint takes time. */
const SUGGESTED = 2;

/** Decides at the console: at first as the agent suggests, then the first of the legal moves. */
function atConsole(): Way {
  let taken = 0;
  return async (page) => {
    taken += 1;
    if (taken > SUGGESTED) return page.locator("[data-move]").first().click();
    await page.locator('[data-action="suggest"]').click();
    await page.locator('[data-move][data-look="main"]').click();
  };
}

/** Waits until the seat called Robbie is shown as a robot's. */
const robotSeen = (page: Page) =>
  page.locator('[data-part~="seat"]').filter({ hasText: "Robbie" }).getByText("robot", { exact: true }).waitFor();

test("a person plays a Shift as a robot, with lines, an expression and an agent's suggestions", async () => {
  const { roomId, code } = await newRoom(server, {
    seats: ["wizard", "person", "greedy", "random"],
    faces: 6,
    policy: { hints: true },
  });
  const [wizard, mia, spectator] = [await person(browser), await person(browser), await person(browser)];
  await spectator.page.goto(`${server.url}/watch/${roomId}`);
  await sitDown(wizard.page, server, `${code}?as=robot`, "Robbie");
  await sitDown(mia.page, server, code, "Mia");
  const others = [mia.page, spectator.page];

  const expressions = wizard.page.getByRole("group", { name: "Expressions" });
  const acting = playOn(wizard.page, atConsole(), async (taken) => {
    if (taken > 0) return;
    await wizard.page.getByRole("button", { name: "Hello!" }).click();
    await wizard.page.keyboard.press("Alt+2");
    await expressions.getByRole("button", { name: "joy" }).click();
    // Everybody sees a robot that speaks and shows a feeling.
    for (const page of others) {
      for (const text of ["says “Hello!”", "says “Let me think.”", "shows joy"])
        await page.locator('[data-part="log"] li').filter({ hasText: "Robbie" }).getByText(text).waitFor();
      await robotSeen(page);
      expect(await page.locator('[data-part="wizard"]').count()).toBe(0);
    }
  });
  const [decisions] = await Promise.all([acting, playOn(mia.page, byClicks)]);
  expect(decisions).toBeGreaterThan(SUGGESTED);
  for (const page of others) {
    await nextDecision(page);
    await robotSeen(page);
  }
  const { room } = await clientsOf(server).rooms.getRoom({ roomId });
  expect(room?.seats.map(({ kind, shownKind }) => [kind, shownKind])).toEqual([
    [ROBOT, UNSPECIFIED],
    [HUMAN, UNSPECIFIED],
    [AGENT, UNSPECIFIED],
    [AGENT, UNSPECIFIED],
  ]);

  const lines = (await recordOf(server, await gameOf(server, roomId))).map(({ line }) => line);
  const [header] = lines.flatMap((line) => (line.case === "header" ? [line.value] : []));
  expect(header?.seats.map(({ name, kind, shownKind }) => [name, kind, shownKind]).slice(0, 2)).toEqual([
    ["Robbie", HUMAN, ROBOT],
    ["Mia", HUMAN, UNSPECIFIED],
  ]);
  const shown = lines.flatMap((line) =>
    line.case === "event" && line.value.kind.case === "expressionShown" ? [line.value.kind.value] : [],
  );
  expect(shown.map(({ seat, expression }) => [seat, expression?.label, expression?.media, expression?.source])).toEqual(
    [
      [0, "say", "data:,Hello!", ExpressionSource.WIZARD],
      [0, "say", "data:,Let%20me%20think.", ExpressionSource.WIZARD],
      [0, "joy", "", ExpressionSource.WIZARD],
    ],
  );
  const taken = lines.flatMap((line) => (line.case === "decision" && line.value.seat === 0 ? [line.value] : []));
  expect(taken.map(({ hints }) => hints)).toEqual([1, 1, ...Array<number>(decisions - SUGGESTED).fill(0)]);
  expect([...wizard.faults, ...mia.faults, ...spectator.faults]).toEqual([]);
});
