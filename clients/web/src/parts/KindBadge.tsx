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
      <Drawing name={builtIn === "" ? KINDS[kind][1] : "kind-built-in"} />
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

const KINDS = {
  [ParticipantKind.UNSPECIFIED]: ["open", "kind-open"],
  [ParticipantKind.AGENT]: ["agent", "kind-agent"],
  [ParticipantKind.HUMAN]: ["human", "kind-person"],
  [ParticipantKind.ROBOT]: ["robot", "kind-robot"],
  [ParticipantKind.MODEL]: ["model", "kind-model"],
} as const;

/** A kind in a word. */
export function kindWord(kind: ParticipantKind): string {
  return t().common.kinds[KINDS[kind][0]];
}
