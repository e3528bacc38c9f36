// The studies of a researcher at this device.

import { wordsOf } from "../api/faults";
import { usePolled } from "../api/poll";
import { t } from "../i18n";
import { ButtonLink } from "../parts/Button";
import { Notice } from "../parts/Notice";
import { pathOf } from "../router";
import css from "./Own.module.css";
import { ownStudies } from "./owning";

/** Polling interval, milliseconds. */
const EVERY_MS = 10_000;

/** The page. */
export function StudiesPage() {
  const words = t().studies.own;
  const { value: studies, fault } = usePolled(ownStudies, EVERY_MS, "");
  return (
    <div class={css.page}>
      <header class={css.head}>
        <h1>{words.title}</h1>
        <ButtonLink href={pathOf({ page: "newStudy" })} look="main">
          {words.create}
        </ButtonLink>
      </header>
      <p class="soft">{words.text}</p>
      {fault && <Notice kind="fault">{wordsOf(fault)}</Notice>}
      {!studies && !fault && <p class="soft">{t().common.loading}</p>}
      {studies?.length === 0 && <p class="sheet">{words.none}</p>}
      <ul class={css.list} data-part="studies">
        {studies?.map(({ studyId, settings, completed, closed }) => (
          <li key={studyId}>
            <a class={`sheet ${css.card}`} href={pathOf({ page: "ownStudy", studyId })}>
              <b>{settings?.name}</b>
              <span class="soft small">
                {closed ? words.closed : words.open} · {words.counts(completed, settings?.participants ?? 0)}
              </span>
            </a>
          </li>
        ))}
      </ul>
    </div>
  );
}
