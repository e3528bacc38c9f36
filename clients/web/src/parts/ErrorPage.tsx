// The page in place of one that cannot be shown: title, error, and a link to the lobby unless a
// study hides links.

import { hidden } from "../experiment/hiding";
import { t } from "../i18n";
import { ButtonLink } from "./Button";
import { Notice } from "./Notice";
import css from "./Notice.module.css";

/** The error page. */
export function ErrorPage({ title, words }: { title: string; words: string }) {
  return (
    <section class={css.errorPage} data-part="error-page">
      <h1>{title}</h1>
      <Notice kind="fault">{words}</Notice>
      {!hidden.value.includes("pages") && (
        <p>
          <ButtonLink href="/">{t().common.notFound.link}</ButtonLink>
        </p>
      )}
    </section>
  );
}
