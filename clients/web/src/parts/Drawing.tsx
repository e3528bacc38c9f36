// The drawings of the server's pictures (ingredients, hats, kinds, roles), so that a table looks
// the same on paper and in a browser. They are inline, so that a part may colour their lines, and
// decorative: text beside them says what they mean.

import css from "./Drawing.module.css";

const files = import.meta.glob<string>("../../../../server/assets/symbols/*.svg", {
  query: "?raw",
  import: "default",
  eager: true,
});

/** The content of each drawing's <svg> by name; all have a view box of 48 by 48. */
const drawings: ReadonlyMap<string, string> = new Map(
  Object.entries(files).map(([path, svg]) => [
    path.slice(path.lastIndexOf("/") + 1, -".svg".length),
    svg.slice(svg.indexOf(">") + 1, svg.lastIndexOf("</svg>")).trim(),
  ]),
);

/**
 * A drawing by file name, such as "face-3-anchovy" or "role-chef"; one line of text high unless
 * styled.
 */
export function Drawing(props: { name: string; class?: string | undefined }) {
  return (
    <svg
      class={`${css.drawing} ${props.class ?? ""}`}
      data-part="drawing"
      viewBox="0 0 48 48"
      aria-hidden="true"
      fill="none"
      stroke="#2b2320"
      stroke-width="2"
      stroke-linecap="round"
      stroke-linejoin="round"
      // Files of this repository, inserted at build time.
      dangerouslySetInnerHTML={{ __html: insideOf(props.name) }}
    />
  );
}

/** The content of a drawing's <svg>, for composite pictures; empty if the name is unknown. */
export function insideOf(name: string): string {
  return drawings.get(name) ?? "";
}

/** The drawing of a face: its ingredient, or the plate for faces without one (12 and above). */
export function faceDrawing(face: number): string {
  const start = `face-${face}-`;
  return [...drawings.keys()].find((name) => name.startsWith(start)) ?? "plate";
}
