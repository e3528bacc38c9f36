// The form fields that rooms and tournaments share: clock, rules, late and invalid answers,
// spectators. Their values are in game-form.ts.

import type { ComponentChildren } from "preact";
import type { RuleSet } from "../gen/chefshat/v1/rules_pb";
import { t } from "../i18n";
import { CheckField, SelectField, TextField } from "../parts/Field";
import css from "./FormPage.module.css";
import type { FieldFaults } from "./form-state";
import { type GameField, type GameForm, withPreset } from "./game-form";
import { LARGEST, type NumberProblem } from "./problems";

/** The props of each group of fields. */
export interface GameProps {
  form: GameForm;
  faults: FieldFaults<GameField>;
  change: (changed: Partial<GameForm>) => void;
}

/** A problem with a number, in words. */
export function wordsOfProblem(problem: NumberProblem): string {
  const words = t().lobby.make.problems;
  if (typeof problem === "string") return words[problem];
  if ("places" in problem) return words.places(problem.places);
  const [from, to] = problem.bounds;
  return to === LARGEST ? words.from(from) : words.between(from, to);
}

/** The same for every field with a problem. */
export function wordsOfProblems<Name extends string>(
  problems: Partial<Record<Name, NumberProblem>>,
): FieldFaults<Name> {
  const entries = Object.entries(problems) as [Name, NumberProblem][];
  return Object.fromEntries(entries.map(([field, problem]) => [field, wordsOfProblem(problem)])) as FieldFaults<Name>;
}

/** The clock. */
export function ClockFields(props: GameProps) {
  const { form, change } = props;
  const words = t().lobby.make.clocks;
  const choices = ["noHurry", "relaxed", "brisk", "own"] as const;
  return (
    <div class={css.fields}>
      <SelectField
        label={words.label}
        hint={form.clock === "own" ? undefined : words.hints[form.clock]}
        value={form.clock}
        options={choices.map((value) => ({ value, label: words.names[value] }))}
        onPick={(clock) => change({ clock })}
      />
      {form.clock === "own" && (
        <>
          <Typed {...props} name="decisionSeconds" label={words.decision} hint={words.decisionHint} />
          <Typed {...props} name="bankSeconds" label={words.bank} hint={words.bankHint} />
        </>
      )}
      <Typed {...props} name="paceSeconds" label={words.pace} hint={words.paceHint} />
    </div>
  );
}

/** The rules for a number of players: a preset, and every field of it. */
export function RuleFields(props: GameProps & { players: number; presets: RuleSet[] }) {
  const { form, change, players, presets } = props;
  const words = t().lobby.make.rule;
  const names: Record<string, string> = words.presets;
  return (
    <>
      <div class={css.fields}>
        <SelectField
          label={words.preset}
          hint={words.presetHint}
          value={form.preset}
          options={presets.map(({ preset }) => ({ value: preset, label: names[preset] ?? preset }))}
          onPick={(picked) => {
            const preset = presets.find((one) => one.preset === picked);
            if (preset) change(withPreset(form, preset, players));
          }}
        />
        <SelectField
          label={words.stop}
          value={form.stop}
          options={[
            { value: "points", label: words.stopPoints },
            { value: "shifts", label: words.stopShifts },
          ]}
          onPick={(stop) => change({ stop, target: stop === "points" ? "15" : "3" })}
        />
        <Typed {...props} name="target" label={form.stop === "points" ? words.targetPoints : words.targetShifts} />
        <Typed {...props} name="points" label={words.points} hint={words.pointsHint} />
        <Typed {...props} name="faces" label={words.faces} hint="4–15" />
        <Typed {...props} name="jokers" label={words.jokers} hint="0–2" />
        <SelectField
          label={words.opening}
          fault={props.faults.opening}
          value={form.opening}
          options={[
            { value: "golden", label: words.openingGolden },
            { value: "anyTopFace", label: words.openingAny },
          ]}
          onPick={(opening) => change({ opening })}
        />
        <SelectField
          label={words.passScope}
          value={form.passScope}
          options={[
            { value: "pizza", label: words.passPizza },
            { value: "turn", label: words.passTurn },
          ]}
          onPick={(passScope) => change({ passScope })}
        />
        <Typed {...props} name="maxIdlePizzas" label={words.maxIdlePizzas} hint={words.maxIdlePizzasHint} />
        <Typed {...props} name="maxTurns" label={words.maxTurns} hint={words.maxTurnsHint} />
      </div>
      <div class={css.fields}>
        <CheckField label={words.exchange} checked={form.exchange} onCheck={(exchange) => change({ exchange })} />
        <CheckField
          label={words.specialActions}
          checked={form.specialActions}
          onCheck={(specialActions) => change({ specialActions })}
        />
        <CheckField
          label={words.openingPass}
          checked={form.openingPass}
          onCheck={(openingPass) => change({ openingPass })}
        />
      </div>
    </>
  );
}

/** What happens after late and invalid answers. */
export function FaultFields(props: GameProps & { agents: string[]; children?: ComponentChildren }) {
  const { form, change, agents, children } = props;
  const words = t().lobby.make.fault;
  return (
    <div class={css.fields}>
      <Typed {...props} name="maxInvalidAttempts" label={words.invalid} hint={words.invalidHint} />
      <Typed {...props} name="maxTimeouts" label={words.timeouts} hint={words.timeoutsHint} />
      <Typed {...props} name="absenceSeconds" label={words.absence} hint={words.absenceHint} />
      <SelectField
        label={words.substitute}
        value={form.substitute}
        options={agents.map((value) => ({ value, label: value }))}
        onPick={(substitute) => change({ substitute })}
      />
      {children}
    </div>
  );
}

/** Who sees the room or tournament. */
export function VisibilityField({ form, change }: GameProps) {
  const words = t().lobby.make.visibility;
  const choices = ["public", "unlisted", "private"] as const;
  return (
    <div class={css.fields}>
      <SelectField
        label={words.label}
        hint={words.hints[form.visibility]}
        value={form.visibility}
        options={choices.map((value) => ({ value, label: words.names[value] }))}
        onPick={(visibility) => change({ visibility })}
      />
    </div>
  );
}

/** Who may watch, and what spectators see. */
export function WatchFields(props: GameProps) {
  const { form, change } = props;
  const words = t().lobby.make.watch;
  return (
    <div class={css.fields}>
      <CheckField
        label={words.playersHints}
        hint={words.playersHintsHint}
        checked={form.hints}
        onCheck={(hints) => change({ hints })}
      />
      <CheckField label={words.chat} hint={words.chatHint} checked={form.chat} onCheck={(chat) => change({ chat })} />
      <CheckField label={words.allowed} checked={form.spectators} onCheck={(spectators) => change({ spectators })} />
      {form.spectators && (
        <>
          <Typed {...props} name="spectatorDelay" label={words.delay} hint={words.delayHint} />
          <CheckField
            label={words.hands}
            hint={words.handsHint}
            fault={props.faults.spectatorsSeeHands}
            checked={form.spectatorsSeeHands}
            onCheck={(spectatorsSeeHands) =>
              change({
                spectatorsSeeHands,
                ...(spectatorsSeeHands && form.spectatorDelay === "0" ? { spectatorDelay: "1" } : {}),
              })
            }
          />
        </>
      )}
    </div>
  );
}

interface TypedProps<Name extends string> {
  form: NoInfer<Readonly<Record<Name, string>>>;
  faults: NoInfer<FieldFaults<Name>>;
  change: NoInfer<(changed: { [Key in Name]?: string }) => void>;
  name: Name;
  label: string;
  hint?: string;
}

/** A text field of the form. */
export function Typed<Name extends string>(props: TypedProps<Name>) {
  const { form, faults, change, name, label, hint } = props;
  return (
    <TextField
      label={label}
      hint={hint}
      value={form[name]}
      fault={faults[name]}
      onText={(text) => change({ [name]: text } as { [Key in Name]?: string })}
    />
  );
}
