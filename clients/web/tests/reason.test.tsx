// The reason that an agent gave for its decision, in the replay.

import { create } from "@bufbuild/protobuf";
import { expect, test } from "vitest";
import { tableOf } from "../src/attend/words";
import { DecisionKind } from "../src/gen/chefshat/v1/decision_pb";
import { DecisionRecordSchema } from "../src/gen/chefshat/v1/record_pb";
import { Decision } from "../src/replay/ReplayPage";
import { actionOf } from "../src/table/model/actions";
import { mount, root } from "./mounted";
import { DEALT, stateOf } from "./table-state";

const FACES = 11;

test.each([
  [{ reason: "it <b>saves</b> the jokers" }, "Reason given: it <b>saves</b> the jokers"],
  [{ person_decision_time_ms: "800" }, undefined],
])("the replay of a decision annotated with %o", async (extra, words) => {
  const table = { ...tableOf(stateOf({ observation: DEALT })), faces: FACES };
  const action = actionOf({ kind: "pass" }, FACES);
  const open = create(DecisionRecordSchema, { seat: 0, kind: DecisionKind.TURN, action, annotations: { extra } });
  await mount(<Decision table={table} open={open} />);
  expect(root.querySelector('[data-part="reason"]')?.textContent).toBe(words);
});
