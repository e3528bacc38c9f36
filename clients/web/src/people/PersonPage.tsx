// One participant.

import { t } from "../i18n";

/** The page. */
export function PersonPage() {
  return (
    <section class="sheet">
      <h1>{t().people.title}</h1>
    </section>
  );
}
