// The end of a study: thanks, and a link to the last questionnaire.

import { t } from "../i18n";
import { Notice } from "../parts/Notice";
import { QuestionnaireLink } from "./QuestionnaireLink";
import { type Blanks, finishedIn, hostOf } from "./study";

interface AfterStudyProps {
  /** Address of the questionnaire; empty for none. */
  after: string;
  blanks: Blanks;
  /** Whether to name the participant: several may have taken part on this device. */
  named?: boolean;
}

/** The notice. */
export function AfterStudy({ after, blanks, named = false }: AfterStudyProps) {
  const words = t().experiment.after;
  return (
    <Notice kind="good">
      <strong>{words.title}.</strong>{" "}
      {after && (
        <>
          {words.text(hostOf(after))} {named && <>{words.whose(blanks.name)} </>}
          <QuestionnaireLink address={after} blanks={blanks} />
        </>
      )}
    </Notice>
  );
}

/** The notices for participants on this device who have left the table of a room; usually none. */
export function AfterRoom({ roomId }: { roomId: string }) {
  return (
    <>
      {finishedIn(roomId).map(({ name, after }) => (
        <AfterStudy key={name} after={after} blanks={{ name, room: roomId }} named />
      ))}
    </>
  );
}
