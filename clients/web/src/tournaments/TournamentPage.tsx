// One tournament.

import { t } from "../i18n";

/** The page. */
export function TournamentPage() {
  return (
    <section class="sheet">
      <h1>{t().tournaments.title}</h1>
    </section>
  );
}
