// What a participant is: person, robot or agent, always by drawing and word together. A built-in agent of the server has a drawing of its
// own; which one it is stands where its name stands.

import { ParticipantKind } from "../gen/chefshat/v1/room_pb";
import { t } from "../i18n";
import { Drawing } from "./Drawing";
import css from "./KindBadge.module.css";

interface KindBadgeProps {
  kind: ParticipantKind;
  /** Name of the built-in agent that it is; empty or left out if it is none. */
  builtIn?: string;
}

/** The badge of a participant. */
export function KindBadge({ kind, builtIn = "" }: KindBadgeProps) {
  return (
    <span class={css.kindBadge} data-part="kind-badge" title={builtIn === "" ? undefined : t().common.kinds.builtIn}>
      <Drawing name={builtIn === "" ? symbols[kind] : "kind-built-in"} />
      <span>{builtIn === "" ? kindWord(kind) : t().common.kinds.agent}</span>
    </span>
  );
}

const symbols: Record<ParticipantKind, string> = {
  [ParticipantKind.UNSPECIFIED]: "kind-open",
  [ParticipantKind.AGENT]: "kind-agent",
  [ParticipantKind.HUMAN]: "kind-person",
  [ParticipantKind.ROBOT]: "kind-robot",
};

/** The word for a kind. */
export function kindWord(kind: ParticipantKind): string {
  const words = t().common.kinds;
  switch (kind) {
    case ParticipantKind.AGENT:
      return words.agent;
    case ParticipantKind.HUMAN:
      return words.human;
    case ParticipantKind.ROBOT:
      return words.robot;
    default:
      return words.open;
  }
}
