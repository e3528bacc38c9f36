// The tournaments of the server.

import { t } from "../i18n";

/** The page. */
export function TournamentsPage() {
  return (
    <section class="sheet">
      <h1>{t().tournaments.title}</h1>
    </section>
  );
}
