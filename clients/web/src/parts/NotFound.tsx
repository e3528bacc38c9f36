// The page of an unknown address.

import { t } from "../i18n";
import { ButtonLink } from "./Button";

/** Says so, and links to the lobby. */
export function NotFound() {
  const words = t().common.notFound;
  return (
    <section class="sheet stack">
      <h1>{words.title}</h1>
      <p>{words.text}</p>
      <p>
        <ButtonLink href="/">{t().common.toLobby}</ButtonLink>
      </p>
    </section>
  );
}
