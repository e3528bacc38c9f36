// The kind of a participant: person, robot, agent or language model, always as a drawing and a
// word. A built-in agent has a drawing of its own; its name is shown elsewhere.

import { ParticipantKind } from "../gen/chefshat/v1/room_pb";
import { t } from "../i18n";
import { inStudy } from "../table/labels";
import { Drawing } from "./Drawing";
import css from "./KindBadge.module.css";

interface KindBadgeProps {
  kind: ParticipantKind;
  /** Name of the built-in agent; empty or absent for other participants. */
  builtIn?: string;
  /** The participant's name, where it is shown. A built-in agent of another name says how it plays, but not in a study. */
  name?: string;
}

/** The badge of a participant; nothing if its kind is hidden by a study. */
export function KindBadge({ kind, builtIn = "", name = builtIn }: KindBadgeProps) {
  if (builtIn === "" && kind === ParticipantKind.UNSPECIFIED) return null;
  const character = name === "" || name === builtIn || inStudy.value ? undefined : characterWords(builtIn);
  return (
    <span class={css.kindBadge} data-part="kind-badge" title={builtIn === "" ? undefined : t().common.kinds.builtIn}>
      <Drawing name={builtIn === "" ? symbols[kind] : "kind-built-in"} />
      <span>
        {builtIn === "" ? kindWord(kind) : t().common.kinds.agent}
        {character && <span data-part="character"> · {character}</span>}
      </span>
    </span>
  );
}

/** How a built-in agent plays; undefined of others, such as those that repeat a recorded player. */
function characterWords(builtIn: string): string | undefined {
  // A search may have a budget: "monte_carlo:400".
  const [agent = ""] = builtIn.split(":");
  return t().common.characters[agent];
}

const symbols: Record<ParticipantKind, string> = {
  [ParticipantKind.UNSPECIFIED]: "kind-open",
  [ParticipantKind.AGENT]: "kind-agent",
  [ParticipantKind.HUMAN]: "kind-person",
  [ParticipantKind.ROBOT]: "kind-robot",
  [ParticipantKind.MODEL]: "kind-model",
};

/** A kind in a word. */
export function kindWord(kind: ParticipantKind): string {
  const words = t().common.kinds;
  switch (kind) {
    case ParticipantKind.AGENT:
      return words.agent;
    case ParticipantKind.HUMAN:
      return words.human;
    case ParticipantKind.ROBOT:
      return words.robot;
    case ParticipantKind.MODEL:
      return words.model;
    default:
      return words.open;
  }
}
