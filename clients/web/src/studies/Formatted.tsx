// A text in Markdown as elements. HTML in it is shown as it is written, so nothing of it runs.

import type { Definition, Nodes, Root } from "mdast";
import { fromMarkdown } from "mdast-util-from-markdown";
import type { ComponentChildren, JSX } from "preact";
import { useMemo } from "preact/hooks";
import css from "./Formatted.module.css";
import { safeAddress } from "./safe-address";

/** The text. */
export function Formatted({ text }: { text: string }) {
  const tree = useMemo(() => fromMarkdown(text), [text]);
  return <div class={css.text}>{inside(tree, definitionsOf(tree))}</div>;
}

/** A question: its paragraphs stand where only words may, in the legend of a group. */
export function FormattedQuestion({ text }: { text: string }) {
  const tree = useMemo(() => fromMarkdown(text), [text]);
  return <span class={css.question}>{inside(tree, definitionsOf(tree), "span")}</span>;
}

/** The words of a text without its markup, for names of fields. */
export function plainText(text: string): string {
  const words = (node: Nodes): string => {
    if ("children" in node) return node.children.map(words).join("");
    return "value" in node ? node.value : "";
  };
  return words(fromMarkdown(text));
}

/** Addresses that a text defines apart from its links. */
type Definitions = ReadonlyMap<string, string>;

function definitionsOf(tree: Root): Definitions {
  const defined = tree.children.filter((node): node is Definition => node.type === "definition");
  return new Map(defined.map(({ identifier, url }) => [identifier, url]));
}

/** What a paragraph is. */
type Paragraph = "p" | "span";

function inside(node: Nodes, definitions: Definitions, paragraph: Paragraph = "p"): ComponentChildren {
  if (!("children" in node)) return null;
  return node.children.map((child, index) => (
    // A text does not change.
    <Node key={index} node={child} {...{ definitions, paragraph }} />
  ));
}

interface NodeProps {
  node: Nodes;
  definitions: Definitions;
  paragraph: Paragraph;
}

function Node({ node, definitions, paragraph }: NodeProps): JSX.Element | string | null {
  const within = inside(node, definitions, paragraph);
  const Paragraph = paragraph;
  switch (node.type) {
    case "text":
    case "html":
      return node.value;
    case "paragraph":
      return <Paragraph>{within}</Paragraph>;
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
    case "imageReference":
      return node.alt ?? "";
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
