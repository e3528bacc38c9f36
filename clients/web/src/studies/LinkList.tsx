// The links of a study's participants, to copy one by one or all at once, or to download as CSV.

import { t } from "../i18n";
import { CopyLine, useCopying } from "../lobby/Invite";
import { Button } from "../parts/Button";
import { download } from "../parts/download";
import css from "./Own.module.css";

/** The link of a participant. */
interface NamedLink {
  readonly name: string;
  readonly address: string;
}

/** The links. */
export function LinkList({ links }: { links: readonly NamedLink[] }) {
  const words = t().studies.own.links;
  const all = links.map(({ name, address }) => `${name}\t${address}`).join("\n");
  const { copied, copy } = useCopying(all);
  return (
    <>
      {links.length > 1 && (
        <p class="row">
          {copy && <Button onClick={copy}>{copied ? `✓ ${t().common.copied}` : words.copyAll}</Button>}
          <Button onClick={() => download(tableOf(links), "links.csv", "text/csv;charset=utf-8")}>
            {words.download}
          </Button>
        </p>
      )}
      <div class={css.linkList}>
        {links.map(({ name, address }) => (
          <CopyLine key={name} label={name} text={address} />
        ))}
      </div>
    </>
  );
}

/** The links as CSV (RFC 4180): names and addresses. No cell is a formula, as in the server's tables. */
export function tableOf(links: readonly NamedLink[]): string {
  const rows = [["name", "link"], ...links.map(({ name, address }) => [name, address])];
  return rows.map((row) => `${row.map(quoted).join(",")}\r\n`).join("");
}

function quoted(text: string): string {
  const cell = /^[=+\-@\t\r\n]/.test(text) ? `'${text}` : text;
  return /[",\r\n]/.test(cell) ? `"${cell.replaceAll('"', '""')}"` : cell;
}
