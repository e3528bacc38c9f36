// A study at the table: what is left out is left out, and when the game is over the last questionnaire is offered.

import { useEffect } from "preact/hooks";
import { t } from "../i18n";
import { Notice } from "../parts/Notice";
import { setHidden } from "./hiding";
import { QuestionnaireLink } from "./QuestionnaireLink";
import { hostOf, studyIn } from "./study";
import "./experiment.css";

interface AtTableProps {
  roomId: string;
  /** Whether the game is over, with a result or without. */
  over: boolean;
}

/** What a study adds to the banner of a table; nothing where this device takes part in none. */
export function AtTable({ roomId, over }: AtTableProps) {
  const study = studyIn(roomId);
  const hide = study?.hide.join(" ") ?? "";
  useEffect(() => {
    setHidden(study?.hide ?? []);
    return () => setHidden([]);
  }, [hide]);
  if (!study || !over) return null;
  const words = t().experiment.after;
  return (
    <Notice kind="good">
      <strong>{words.title}.</strong>{" "}
      {study.after && (
        <>
          {words.text(hostOf(study.after))}{" "}
          <QuestionnaireLink address={study.after} name={study.name} roomId={roomId} />
        </>
      )}
    </Notice>
  );
}
