// The form for a join code or the pasted address of an invitation, or of any other page: the installed
// page has no address bar.

import { useState } from "preact/hooks";
import { t } from "../i18n";
import { Button } from "../parts/Button";
import { TextField } from "../parts/Field";
import { navigate, pathOf, routeOf } from "../router";
import css from "./Join.module.css";
import { canonical } from "./seat";

/** The form. */
export function JoinForm() {
  const words = t().lobby.join;
  const [code, setCode] = useState("");
  const [missing, setMissing] = useState(false);
  const go = (event: Event) => {
    event.preventDefault();
    const address = addressIn(code);
    // As if the link were followed: what it brings behind "#" is taken before anything is shown.
    if (address) return location.assign(address);
    const typed = codeIn(code);
    setMissing(typed === "");
    if (typed !== "") navigate({ page: "join", code: typed });
  };
  return (
    <form class={css.form} onSubmit={go}>
      <TextField
        label={words.code}
        value={code}
        onText={setCode}
        fault={missing ? words.codeMissing : undefined}
        autoCapitalize="characters"
        placeholder="BCDF2345"
      />
      <Button type="submit">{words.go}</Button>
    </form>
  );
}

/** The code in the input; empty if it may be a part of a link, which has "/" or "#" and may have a secret. */
export function codeIn(typed: string): string {
  return /[/#]/.test(typed) ? "" : canonical(typed);
}

/** The path, query and fragment here of a pasted link to a page; null for any other input. */
export function addressIn(typed: string): string | null {
  const [, path] = /(?:https?:\/\/)?[^\s/]*(\/\S+)/.exec(typed) ?? [];
  if (!path) return null;
  const { pathname, search, hash } = new URL(location.origin + path);
  const route = routeOf(pathname);
  return route.page === "unknown" ? null : pathOf(route) + search + hash;
}
