// Marks: words in an attribute of the document, which parts of the page set while they are there, for
// the styles of what surrounds them. With `:has()` of the document instead, the browser would compute
// the styles of the whole page after each change of any part.

import { useLayoutEffect } from "preact/hooks";

/** What the page shows, as far as the styles of other parts depend on it. */
type Shown = "table" | "actions" | "lesson" | "update" | "wall";

/**
 * A function that marks the document until the one that it returns is called. `changed` gets all marks
 * after each change.
 */
export function documentMarker<Mark extends string>(
  attribute: "hide" | "shows",
  changed: (marks: readonly Mark[]) => void = () => {},
): (marks: readonly Mark[]) => () => void {
  // During a change of pages the second part may arrive before the first one leaves.
  const wanted = new Set<readonly Mark[]>();
  const show = () => {
    const marks = [...new Set([...wanted].flat())];
    const { dataset } = document.documentElement;
    if (marks.length > 0) dataset[attribute] = marks.join(" ");
    else delete dataset[attribute];
    changed(marks);
  };
  return (marks) => {
    const own = [...marks];
    wanted.add(own);
    show();
    return () => {
      wanted.delete(own);
      show();
    };
  };
}

const mark = documentMarker<Shown>("shows");

/**
 * Marks the document with what a part shows (`data-shows`), while it does. The first child of that part,
 * so that what follows measures itself with the styles of the mark.
 */
export function Shows({ what }: { what: Shown }) {
  useLayoutEffect(() => mark([what]), [what]);
  return null;
}
