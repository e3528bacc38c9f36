// The ratings of all who have played.

import { t } from "../i18n";

/** The page. */
export function LeaderboardPage() {
  return (
    <section class="sheet">
      <h1>{t().people.title}</h1>
    </section>
  );
}
