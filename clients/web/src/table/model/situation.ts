// The rules that matter at a moment of the game, for "What can I do?". Their texts are in i18n.

import { DecisionKind } from "../../gen/chefshat/v1/decision_pb";
import type { Texts } from "../../i18n/texts";
import type { OpenDecision } from "./live";
import { isOpening, publicRequirement } from "./requirement";
import type { TableState } from "./state";

export type Rule = keyof Texts["rules"]["each"];

/** The rules of a moment, the most important first. */
export function rulesNow(
  table: TableState,
  own: number | undefined,
  decision: Pick<OpenDecision, "kind" | "requirement"> | undefined,
): Rule[] {
  switch (decision?.kind) {
    case DecisionKind.EXCHANGE:
      return ["exchange", "roles"];
    case DecisionKind.SPECIAL_ACTION:
      return ["special", "exchange"];
    default:
  }
  const mine = own === undefined ? undefined : table.seats[own];
  switch (table.phase) {
    case "waiting":
      return ["goal", "cards"];
    case "shiftOver":
      return ["points", "roles", "end"];
    case "gameOver":
    case "aborted":
      return ["end", "points"];
    case "dealt":
      if (!decision) return table.shift > 1 ? ["exchange", "special", "roles"] : ["opening", "golden"];
      break;
    default:
      if (mine && !decision && mine.place > 0) return ["finishing", "points"];
      if (mine && !decision && mine.passed) return ["passing", "pizzaDone"];
  }
  const requirement = decision?.requirement ?? publicRequirement(table);
  if (isOpening(requirement)) return ["opening", "golden", "jokers"];
  if (table.board.length === 0) return ["leading", "jokers", "passing"];
  return requirement.highestFace === 0 ? ["passing", "pizzaDone"] : ["beating", "jokers", "passing"];
}
