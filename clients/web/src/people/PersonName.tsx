// A participant's name, linked to its page.

import { hidden } from "../experiment/hiding";
import { pathOf } from "../router";

interface PersonNameProps {
  name: string;
  /**
   * Name of the built-in agent: its games are listed under this name, whatever it is called in the
   * game or tournament.
   */
  builtIn?: string;
  /** Not in the wall view, where nobody can follow a link. */
  linked?: boolean;
}

/** The name. */
export function PersonName({ name, builtIn = "", linked = true }: PersonNameProps) {
  // A study may hide links to other pages.
  if (!linked || hidden.value.includes("pages")) return <b data-part="person-name">{name}</b>;
  return (
    <a data-part="person-name" href={pathOf({ page: "person", name: builtIn || name })}>
      {name}
    </a>
  );
}
