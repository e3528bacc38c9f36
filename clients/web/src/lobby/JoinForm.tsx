// The form for a join code or the pasted address of an invitation.

import { useState } from "preact/hooks";
import { t } from "../i18n";
import { Button } from "../parts/Button";
import { TextField } from "../parts/Field";
import { navigate } from "../router";
import css from "./Join.module.css";
import { canonical } from "./seat";

/** The form. */
export function JoinForm() {
  const words = t().lobby.join;
  const [code, setCode] = useState("");
  const [missing, setMissing] = useState(false);
  const go = (event: Event) => {
    event.preventDefault();
    const tournament = tournamentIn(code);
    if (tournament) return navigate({ page: "tournament", tournamentId: tournament.id }, { search: tournament.search });
    const typed = codeIn(code);
    setMissing(typed.code === "");
    if (typed.code !== "") navigate({ page: "join", code: typed.code }, { search: typed.search });
  };
  return (
    <form class={css.form} onSubmit={go}>
      <TextField
        label={words.code}
        value={code}
        onText={setCode}
        fault={missing ? words.codeMissing : undefined}
        autoComplete="off"
        autoCapitalize="characters"
        placeholder="BCDF2345"
      />
      <Button type="submit">{words.go}</Button>
    </form>
  );
}

/**
 * The code in the input, which is a code or an address that ends in one, and the address's query.
 */
export function codeIn(typed: string): { code: string; search: string } {
  const address = /\/join\/([^/?#\s]+)(\?[^#\s]*)?/.exec(typed);
  return { code: canonical(address?.[1] ?? typed), search: address?.[2] ?? "" };
}

/** The tournament of a pasted invitation, and its query; null for any other input. */
export function tournamentIn(typed: string): { id: string; search: string } | null {
  const address = /\/tournaments\/([0-9a-f]+)(\?\S*)?$/.exec(typed.trim());
  return address?.[1] ? { id: address[1], search: address[2] ?? "" } : null;
}
