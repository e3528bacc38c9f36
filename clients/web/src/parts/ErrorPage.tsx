// The page in place of one that cannot be shown: title, error, what to do, and a link to the lobby
// unless a study hides links.

import type { ComponentChildren } from "preact";
import { hidden } from "../hiding";
import { t } from "../i18n";
import { ButtonLink } from "./Button";
import { Notice } from "./Notice";
import css from "./Notice.module.css";

interface ErrorPageProps {
  title: string;
  words: string;
  /** What to do. */
  children?: ComponentChildren;
}

/** The error page. */
export function ErrorPage({ title, words, children }: ErrorPageProps) {
  return (
    <section class={css.errorPage} data-part="error-page">
      <h1>{title}</h1>
      <Notice kind="fault">{words}</Notice>
      {children && <p>{children}</p>}
      {!hidden.value.includes("pages") && (
        <p>
          <ButtonLink href="/">{t().common.toLobby}</ButtonLink>
        </p>
      )}
    </section>
  );
}
