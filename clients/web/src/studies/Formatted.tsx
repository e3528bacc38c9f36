// A text in Markdown as elements. HTML in it is shown as it is written, so nothing of it runs.

import type { Definition, Nodes, Root } from "mdast";
import { fromMarkdown } from "mdast-util-from-markdown";
import type { ComponentChildren, JSX } from "preact";
import { useMemo } from "preact/hooks";
import css from "./Formatted.module.css";
import { Picture } from "./Pictures";
import { safeAddress } from "./safe-address";

/** The text. */
export function Formatted({ text }: { text: string }) {
  const tree = useMemo(() => fromMarkdown(text), [text]);
  return <div class={css.text}>{inside(tree, definitionsOf(tree))}</div>;
}

/**
 * A question, in the legend of a group, where only words may stand: blocks other than paragraphs are
 * shown as they are written.
 */
export function FormattedQuestion({ text }: { text: string }) {
  const tree = useMemo(() => fromMarkdown(text), [text]);
  const definitions = definitionsOf(tree);
  return (
    <span class={css.question}>
      {tree.children.map((node, index) => (
        // A text does not change.
        <span key={index}>{node.type === "paragraph" ? inside(node, definitions) : written(node, text)}</span>
      ))}
    </span>
  );
}

/** The words of a question without its markup, for names of fields. */
export function plainText(text: string): string {
  const words = (node: Nodes): string => {
    if ("children" in node) return node.children.map(words).join("");
    if (node.type === "break") return " ";
    if ("alt" in node) return node.alt ?? "";
    return "value" in node ? node.value : "";
  };
  const blocks = fromMarkdown(text).children;
  return blocks.map((node) => (node.type === "paragraph" ? words(node) : written(node, text))).join(" ");
}

/** A part of a text with its markup. */
function written({ position }: Nodes, text: string): string {
  return position ? text.slice(position.start.offset, position.end.offset) : "";
}

/** Addresses that a text defines apart from its links. */
type Definitions = ReadonlyMap<string, string>;

function definitionsOf(tree: Root): Definitions {
  const defined = tree.children.filter((node): node is Definition => node.type === "definition");
  // The first one of a name counts.
  return new Map(defined.reverse().map(({ identifier, url }) => [identifier, url]));
}

function inside(node: Nodes, definitions: Definitions): ComponentChildren {
  if (!("children" in node)) return null;
  return node.children.map((child, index) => (
    // A text does not change.
    <Node key={index} node={child} definitions={definitions} />
  ));
}

interface NodeProps {
  node: Nodes;
  definitions: Definitions;
}

function Node({ node, definitions }: NodeProps): JSX.Element | string | null {
  const within = inside(node, definitions);
  switch (node.type) {
    case "text":
    case "html":
      return node.value;
    case "paragraph":
      return <p>{within}</p>;
    case "heading": {
      // The title of the stage is above all headings.
      const Heading = node.depth === 1 ? "h2" : node.depth === 2 ? "h3" : "h4";
      return <Heading>{within}</Heading>;
    }
    case "emphasis":
      return <em>{within}</em>;
    case "strong":
      return <strong>{within}</strong>;
    case "inlineCode":
      return <code>{node.value}</code>;
    case "code":
      return <pre>{node.value}</pre>;
    case "blockquote":
      return <blockquote>{within}</blockquote>;
    case "list":
      return node.ordered ? <ol start={node.start ?? 1}>{within}</ol> : <ul>{within}</ul>;
    case "listItem":
      return <li>{within}</li>;
    case "break":
      return <br />;
    case "thematicBreak":
      return <hr />;
    case "link":
      return <Link address={node.url}>{within}</Link>;
    case "linkReference":
      return <Link address={definitions.get(node.identifier) ?? ""}>{within}</Link>;
    case "image":
      return <Picture name={node.url} words={node.alt ?? ""} />;
    case "imageReference":
      return <Picture name={definitions.get(node.identifier) ?? ""} words={node.alt ?? ""} />;
    default:
      return null;
  }
}

function Link({ address, children }: { address: string; children: ComponentChildren }) {
  const safe = safeAddress(address);
  if (!safe) return <>{children}</>;
  return (
    <a href={safe} target="_blank" rel="noopener noreferrer external">
      {children}
    </a>
  );
}
