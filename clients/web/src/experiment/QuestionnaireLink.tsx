// The way to a questionnaire, in a window of its own which learns nothing of this one.

import { t } from "../i18n";
import { filledIn } from "./study";

interface QuestionnaireLinkProps {
  address: string;
  name: string;
  /** Empty before the participant has a room. */
  roomId: string;
}

/** The link. */
export function QuestionnaireLink({ address, name, roomId }: QuestionnaireLinkProps) {
  return (
    <a
      class="button button-main"
      href={filledIn(address, name, roomId)}
      target="_blank"
      rel="noopener noreferrer external"
    >
      {t().experiment.join.open}
    </a>
  );
}
