// The drawings of the server's pictures (ingredients, hats, kinds, roles), taken from there so that a table looks the same on paper and in
// a browser, and drawn inline so that a part may colour their lines. They are decoration: what they mean is said in words beside them.

import css from "./Drawing.module.css";

const files = import.meta.glob<string>("../../../../server/assets/symbols/*.svg", {
  query: "?raw",
  import: "default",
  eager: true,
});

/** By name, what stands between the outermost tags; all have a view box of 48 by 48. */
const drawings: ReadonlyMap<string, string> = new Map(
  Object.entries(files).map(([path, svg]) => [
    path.slice(path.lastIndexOf("/") + 1, -".svg".length),
    svg.slice(svg.indexOf(">") + 1, svg.lastIndexOf("</svg>")).trim(),
  ]),
);

/** A drawing by the name of its file, such as "face-3-anchovy" or "role-chef"; as high as a line of text unless styled. */
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
      // Files of this repository, put in when the page is built.
      dangerouslySetInnerHTML={{ __html: insideOf(props.name) }}
    />
  );
}

/** What stands inside the drawing's <svg>, for a picture made of several; empty if there is none of the name. */
export function insideOf(name: string): string {
  return drawings.get(name) ?? "";
}

/** The name of a face's drawing: its ingredient, or the plate for faces that have none (12 and above). */
export function faceDrawing(face: number): string {
  const start = `face-${face}-`;
  return [...drawings.keys()].find((name) => name.startsWith(start)) ?? "plate";
}
