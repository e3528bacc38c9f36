// A link to a questionnaire, in a new window without access to this one.

import { t } from "../i18n";
import css from "../parts/Button.module.css";
import { type Blanks, filledIn } from "./study";

interface QuestionnaireLinkProps {
  address: string;
  blanks: Blanks;
}

/** The link. */
export function QuestionnaireLink({ address, blanks }: QuestionnaireLinkProps) {
  return (
    <a
      class={css.button}
      data-look="main"
      data-part="button"
      href={filledIn(address, blanks)}
      target="_blank"
      rel="noopener noreferrer external"
    >
      {t().experiment.join.open}
    </a>
  );
}
