// What a study says when it is over: thanks, and the way to its last questionnaire.

import { t } from "../i18n";
import { Notice } from "../parts/Notice";
import { QuestionnaireLink } from "./QuestionnaireLink";
import { type Blanks, finishedIn, hostOf } from "./study";

interface AfterStudyProps {
  /** Address of the questionnaire; empty: there is none. */
  after: string;
  blanks: Blanks;
  /** Whether to say whose it is: several may have taken part at this device. */
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

/** The notices for those who took part in a room at this device and have left its table; mostly none. */
export function AfterRoom({ roomId }: { roomId: string }) {
  return (
    <>
      {finishedIn(roomId).map(({ name, after }) => (
        <AfterStudy key={name} after={after} blanks={{ name, room: roomId }} named />
      ))}
    </>
  );
}
