// "What can I do?": the rules of this moment, and the keys of the table.

import { hidden } from "../../hiding";
import { t } from "../../i18n";
import { Dialog } from "../../parts/Dialog";
import { isOn } from "../../preferences";
import { keyOf } from "../keys";
import type { OpenDecision } from "../model/live";
import { rulesNow } from "../model/situation";
import type { TableState } from "../model/state";
import css from "./Help.module.css";
import { nowHeading } from "./Now";

interface HelpProps {
  table: TableState;
  own: number | undefined;
  decision: OpenDecision | undefined;
  /** The seat whose decision is open, if the reader may know. */
  next: number | undefined;
  /** Whether the reader plays here, and so has keys. */
  plays: boolean;
  onClose: () => void;
}

export function Help({ table, own, decision, next, plays, onClose }: HelpProps) {
  const words = t().rules;
  const rules = rulesNow(table, own, decision);
  return (
    <Dialog title={words.help.title} onClose={onClose}>
      <div class={`${css.help} stack`} data-part="help-rules">
        <p class="soft">{nowHeading({ table, own, decision, next })}</p>
        {rules.map((rule) => (
          <section key={rule}>
            <h3>{words.each[rule].title}</h3>
            <p>{words.each[rule].text}</p>
          </section>
        ))}
        {!hidden.value.includes("pages") && (
          <p>
            {/* The table stays open. */}
            <a href={`/rules#${rules[0]}`} target="_blank" rel="noopener">
              {words.help.all}
            </a>
          </p>
        )}
        {plays && (
          <section class={css.keyboard}>
            <h3>{words.help.keys}</h3>
            {isOn("keys") ? <Keys table={table} /> : <p>{words.help.keysOff}</p>}
          </section>
        )}
      </div>
    </Dialog>
  );
}

function Keys({ table }: { table: TableState }) {
  const words = t().rules.help.key;
  const lines: (readonly [keys: readonly string[], meaning: string])[] = [
    [[words.faces(table.faces)], words.pick(table.faces)],
    ...(table.jokers > 0
      ? ([
          [["j"], words.addJoker],
          [[keyOf(undefined) ?? ""], words.jokers],
        ] as const)
      : []),
    [["Enter"], words.play],
    [["p"], words.pass],
    [["d", "n"], words.special],
    [["Esc"], words.back],
    [["e"], words.express],
    [["?"], words.help],
  ];
  return (
    <dl class={css.keys}>
      {lines.map(([keys, meaning]) => (
        <div key={meaning}>
          <dt>
            {keys.map((key) => (
              <kbd key={key}>{key}</kbd>
            ))}
          </dt>
          <dd>{meaning}</dd>
        </div>
      ))}
    </dl>
  );
}
