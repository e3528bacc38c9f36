// The button below a list that shows more of it; absent if there is no more.

import type { Shown } from "../api/pages";
import { t } from "../i18n";
import { Button } from "./Button";

/** The button; `what` names the list for screen readers. */
export function MoreButton({ shown, what }: { shown: Shown<unknown>; what: string }) {
  if (!shown.list?.more) return null;
  return (
    <div>
      <Button onClick={shown.showMore}>
        {t().common.showMore}
        <span class="visually-hidden">: {what}</span>
      </Button>
    </div>
  );
}
