// The rules in short. `/rules#passing` scrolls to one of them.

import { useEffect } from "preact/hooks";
import { t } from "../i18n";
import { ButtonLink } from "../parts/Button";
import css from "./Rules.module.css";

/** The page. */
export function RulesPage() {
  const words = t().rules;
  useEffect(() => {
    // The browser has looked for the anchor before the page was drawn.
    document.getElementById(location.hash.slice(1))?.scrollIntoView();
  }, []);
  return (
    <article class={`${css.rules} sheet stack`} data-part="rules">
      <h1>{words.title}</h1>
      {Object.entries(words.each).map(([name, { title, text }]) => (
        <section key={name} id={name}>
          <h2>{title}</h2>
          <p>{text}</p>
        </section>
      ))}
      <p class="soft">{words.complete}</p>
      <p>
        <ButtonLink href="/tutorial">{t().common.nav.tutorial}</ButtonLink>
      </p>
    </article>
  );
}
