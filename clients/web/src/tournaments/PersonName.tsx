// The name of a participant, leading to its page.

import { hidden } from "../experiment/hiding";
import { pathOf } from "../router";

interface PersonNameProps {
  name: string;
  /** Name of the built-in agent that it is: its games are found under that, whatever it is called in a tournament. */
  builtIn?: string;
  /** Not on a wall, where nobody can follow a link. */
  linked?: boolean;
}

/** The name. */
export function PersonName({ name, builtIn = "", linked = true }: PersonNameProps) {
  // A study may leave out the ways to other pages.
  if (!linked || hidden.value.includes("pages")) return <b data-part="person-name">{name}</b>;
  return (
    <a data-part="person-name" href={pathOf({ page: "person", name: builtIn || name })}>
      {name}
    </a>
  );
}
