// The offer to load the page again after the server has been updated. It lies over the bottom of the
// page, so that nothing moves; where somebody plays or answers a study it is in the settings only.

import { useEffect, useState } from "preact/hooks";
import { outdated } from "../api/update";
import { t } from "../i18n";
import { announce } from "./Announcer";
import { Button } from "./Button";
import { Shows } from "./marks";
import css from "./Update.module.css";

/** The offer on the page, until it is closed. Where nobody can press a button, as on a wall, the page loads itself. */
export function UpdateNotice({ unattended }: { unattended: boolean }) {
  const [closed, setClosed] = useState(false);
  const shown = outdated.value && !closed;
  useEffect(() => {
    if (!shown) return;
    if (unattended) location.reload();
    else announce(t().common.outdated.text);
  }, [shown, unattended]);
  if (!shown || unattended) return null;
  return (
    <aside class={css.notice} data-part="update">
      <Shows what="update" />
      <Offer />
      <button type="button" class={css.close} aria-label={t().common.close} onClick={() => setClosed(true)}>
        <span aria-hidden="true">×</span>
      </button>
    </aside>
  );
}

/** The offer in the settings. */
export function UpdateSetting() {
  return outdated.value ? (
    <div class={css.offer}>
      <Offer />
    </div>
  ) : null;
}

function Offer() {
  const words = t().common.outdated;
  return (
    <>
      <p>{words.text}</p>
      <Button look="main" onClick={() => location.reload()}>
        {words.load}
      </Button>
    </>
  );
}
