// What there is to say of the connection to a seat: in a room, and in a game of a study.

import { wordsOf } from "../api/faults";
import { t } from "../i18n";
import { Button } from "../parts/Button";
import { Notice } from "../parts/Notice";
import { isOver } from "./model/state";
import type { Session } from "./session";
import { refusedWords } from "./words";

/** The state of the connection, if there is something to say. */
export function SeatBanner({ session }: { session: Session }) {
  const { attachment, substituted, table } = session.live.value;
  const { link, fault } = session.following.value;
  const words = t().table.link;
  if (attachment.kind === "superseded") {
    return (
      <Notice kind="hint">
        {words.superseded} <Button onClick={session.takeBack}>{words.takeBack}</Button>
      </Notice>
    );
  }
  if (attachment.kind === "refused") return <Notice kind="fault">{refusedWords(attachment)}</Notice>;
  if (link.value === "failed") return <Notice kind="fault">{fault.value && wordsOf(fault.value)}</Notice>;
  if (link.value === "lost") return <Notice kind="fault">{words.lost}</Notice>;
  if (substituted && !isOver(table)) {
    return (
      <Notice kind="hint">
        {words.substituted}{" "}
        <Button look="main" onClick={session.resume}>
          {words.resume}
        </Button>
      </Notice>
    );
  }
  return null;
}
