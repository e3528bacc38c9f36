// The controls of a replay: the perspectives that a record has.

import { expect, test } from "vitest";
import type { RecordLine } from "../src/gen/chefshat/v1/record_pb";
import { Controls } from "../src/replay/Controls";
import { filmOf } from "../src/replay/frames";
import { mount, root } from "./mounted";
import { recorded, withoutHands } from "./record";

/** The choices of the cards shown. */
async function perspectives(lines: readonly RecordLine[]): Promise<(string | null)[]> {
  const film = filmOf(lines);
  const nothing = () => {};
  await mount(
    <Controls
      film={film}
      frame={film.at(0)}
      at={0}
      playing={false}
      speed={1}
      perspective="all"
      onGo={nothing}
      onPlaying={nothing}
      onSpeed={nothing}
      onPerspective={nothing}
    />,
  );
  const list = [...root.querySelectorAll("select")].find((select) => select.value === "all");
  return [...(list?.options ?? [])].map(({ textContent }) => textContent);
}

test("a game whose hands are known shows all of them, or those of one seat, or none", async () => {
  // Two seats have the same agent.
  expect(await perspectives(recorded("fixed"))).toEqual([
    "all hands",
    "as greedy (1)",
    "as random",
    "as greedy (3)",
    "as a spectator",
  ]);
});

test("an imported game without hands does not claim to show them", async () => {
  const shown = await perspectives(withoutHands(recorded("committed")));
  expect(shown[0]).toBe("played cards (no hand is known)");
  expect(shown).not.toContain("all hands");
});
