// The look-up table of a turn: rows are faces, columns are quantities, each with no, one or two
// jokers. Every cell has a sign besides its colour.

import { t } from "../../i18n";
import { Drawing, faceDrawing } from "../../parts/Drawing";
import type { Cell, CellState, Lookup } from "../model/lookup";
import { moveWords } from "../words";
import css from "./LookupTable.module.css";

const SIGNS: Record<CellState, string> = { legal: "✓", notInHand: "", notAllowed: "✕", impossible: "" };
const STATES: readonly CellState[] = ["legal", "notInHand", "notAllowed", "impossible"];

interface LookupTableProps {
  lookup: Lookup;
  /** The action that was taken, if known. */
  taken?: number | undefined;
}

export function LookupTable({ lookup, taken }: LookupTableProps) {
  const words = t().table.lookup;
  const faces = lookup.plays.length;
  const cells = [...lookup.plays.flat(2), ...lookup.others];
  const legal = cells.filter((cell) => cell.state === "legal").length;
  return (
    <div class={`${css.lookup} stack`} data-part="lookup">
      <p>
        <strong>{words.count(legal)}</strong> <span class="soft small">{words.groups}</span>
      </p>
      {/* biome-ignore lint/a11y/noNoninteractiveTabindex: a scrollable region must be reachable by keyboard */}
      <section class={css.scroll} tabIndex={0} aria-label={words.caption}>
        <table>
          <caption class="visually-hidden">{words.caption}</caption>
          <thead>
            <tr>
              <th scope="col">
                <span class="visually-hidden">{words.face}</span>
              </th>
              {lookup.plays.map((_, index) => (
                <th scope="col" key={index} class="number">
                  {index + 1}
                </th>
              ))}
            </tr>
          </thead>
          <tbody>
            {lookup.plays.map((quantities, index) => (
              <tr key={index}>
                <th scope="row" class="number">
                  {index + 1} <Drawing name={faceDrawing(index + 1)} />
                </th>
                {quantities.map((group, quantity) => (
                  <td key={quantity}>
                    <span class={css.group}>
                      {group.map((cell) => (
                        <Sign key={cell.action} cell={cell} taken={cell.action === taken} />
                      ))}
                    </span>
                  </td>
                ))}
                {faces > quantities.length && <td colSpan={faces - quantities.length} />}
              </tr>
            ))}
          </tbody>
          {/* Actions that are not a play of a face have rows of their own at the end. */}
          <tbody class={css.others}>
            {lookup.others.map((cell) => (
              <tr key={cell.action}>
                <th scope="row">
                  {cell.move.kind === "pass" ? <span aria-hidden="true">–</span> : <Drawing name="joker" />}
                  <span class="visually-hidden">{cell.move.kind === "pass" ? words.pass : words.loneJoker}</span>
                </th>
                <td colSpan={faces}>
                  <Sign cell={cell} taken={cell.action === taken} />{" "}
                  <span aria-hidden="true">{cell.move.kind === "pass" ? words.pass : words.loneJoker}</span>
                </td>
              </tr>
            ))}
          </tbody>
        </table>
      </section>
      <section class={css.key}>
        <h3>{words.signs}</h3>
        <ul>
          {STATES.map((state) => (
            <li key={state}>
              <span class={`${css.cell} ${css[state]}`} aria-hidden="true">
                {SIGNS[state]}
              </span>{" "}
              {words[state]}
            </li>
          ))}
        </ul>
      </section>
    </div>
  );
}

function Sign({ cell, taken }: { cell: Cell; taken: boolean }) {
  const words = t().table.lookup;
  const label = `${moveWords(cell.move)}: ${words[cell.state]}${taken ? `, ${words.chosen}` : ""}`;
  const look = `${css.cell} ${css[cell.state]} ${taken ? css.taken : ""}`;
  if (cell.state !== "legal")
    return (
      <span class={look} title={label} aria-hidden="true">
        {SIGNS[cell.state]}
      </span>
    );
  return (
    <span class={look} title={label} role="img" aria-label={label}>
      {SIGNS.legal}
    </span>
  );
}
