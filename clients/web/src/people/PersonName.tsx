// A participant's name, linked to its page.

import { hidden } from "../hiding";
import { t } from "../i18n";
import { pathOf } from "../router";

/** Digits shown of a fingerprint. */
const DIGITS = 4;

interface PersonNameProps {
  name: string;
  /**
   * Name of the built-in agent: its games are listed under this name, whatever it is called in the
   * game or tournament.
   */
  builtIn?: string;
  /** Of the name and its key; empty if it has none. */
  fingerprint?: string;
  /** Not in the wall view, where nobody can follow a link. */
  linked?: boolean;
}

/** The name. */
export function PersonName({ name, builtIn = "", fingerprint = "", linked = true }: PersonNameProps) {
  // A study may hide links to other pages.
  if (!linked || hidden.value.includes("pages")) return <b data-part="person-name">{name}</b>;
  return (
    <a data-part="person-name" href={pathOf({ page: "person", name: builtIn || name, fingerprint })}>
      {name}
    </a>
  );
}

/** The beginning of a name's fingerprint, or all of it. */
export function Fingerprint({ of, whole = false }: { of: string; whole?: boolean }) {
  if (of === "") return null;
  return (
    <span class="soft small number" title={t().people.fingerprint(of)}>
      #{whole ? of : of.slice(0, DIGITS)}
    </span>
  );
}
