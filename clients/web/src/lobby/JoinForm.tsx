// Where a join code is typed in, or pasted as the whole address of an invitation.

import { useState } from "preact/hooks";
import { t } from "../i18n";
import { Button } from "../parts/Button";
import { TextField } from "../parts/Field";
import { navigate } from "../router";
import { canonical } from "./seat";
import "./join.css";

/** The form. */
export function JoinForm() {
  const words = t().lobby.join;
  const [code, setCode] = useState("");
  const [missing, setMissing] = useState(false);
  const go = (event: Event) => {
    event.preventDefault();
    const typed = codeIn(code);
    setMissing(typed === "");
    if (typed !== "") navigate({ page: "join", code: typed });
  };
  return (
    <form class="join-form" onSubmit={go}>
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

/** The code in what was typed: a code, or an address that ends in one. */
export function codeIn(typed: string): string {
  const address = /\/join\/([^/?#\s]+)/.exec(typed);
  return canonical(address?.[1] ?? typed);
}
