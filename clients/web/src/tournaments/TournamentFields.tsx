// The fields of a new tournament: format, participants, start.

import { useId } from "preact/hooks";
import { t } from "../i18n";
import formCss from "../lobby/FormPage.module.css";
import type { FieldFaults } from "../lobby/form-state";
import { Typed } from "../lobby/GameFields";
import { CheckField, SelectField, TextField } from "../parts/Field";
import fieldCss from "../parts/Field.module.css";
import { Choices } from "./Choices";
import tournamentsCss from "./Tournaments.module.css";
import {
  builtIns,
  isNoCount,
  type TournamentField,
  type TournamentForm,
  withFormat,
  withTable,
} from "./tournament-form";

/** The props of each group of fields. */
export interface FormProps {
  form: TournamentForm;
  faults: FieldFaults<TournamentField>;
  change: (changed: Partial<TournamentForm>) => void;
}

const FORMATS: readonly TournamentForm["format"][] = ["knockout", "roundRobin", "swiss"];
const PLAYERS: readonly TournamentForm["players"][] = ["2", "3", "4", "5", "6"];

/** The format, and the number of games. */
export function FormatFields(props: FormProps) {
  const { form, faults, change } = props;
  const words = t().organise;
  const knockout = form.format === "knockout";
  return (
    <>
      <Choices
        label={words.format}
        value={form.format}
        options={FORMATS.map((value) => ({
          value,
          name: t().tournaments.formats[value],
          hint: words.formats[value],
        }))}
        fault={faults.format}
        onPick={(format) => change(withFormat(form, format))}
      />
      <div class={formCss.fields}>
        <SelectField
          label={words.players}
          hint={knockout ? words.playersKnockout : undefined}
          fault={faults.players}
          value={form.players}
          options={PLAYERS.filter((count) => !knockout || count === "4").map((value) => ({ value, label: value }))}
          onPick={(players) => change(withTable(form, players))}
        />
        {!knockout && <Typed {...props} name="rounds" label={words.rounds} hint={words.roundsHint} />}
        <Typed
          {...props}
          name="gamesPerPairing"
          label={words.gamesPerPairing}
          hint={form.deals === "rotated" ? words.gamesPerPairingRotated : words.gamesPerPairingHint}
        />
      </div>
    </>
  );
}

/** The built-in agents, and who else may join. */
export function WhoFields(props: FormProps & { agents: string[] }) {
  const { form, faults, change, agents } = props;
  const words = t().organise;
  const id = useId();
  // An error in the sum belongs to all of them.
  const counts = Object.values(form.builtIn);
  const atFault = (count: string) => Boolean(faults.builtIn) && (isNoCount(count) || !counts.some(isNoCount));
  return (
    <>
      <fieldset class={tournamentsCss.newTournamentGroup}>
        <legend>{words.builtIn}</legend>
        <p class="soft small">{words.builtInHint}</p>
        <div class={tournamentsCss.newTournamentCounts}>
          {agents.map((agent) => (
            <TextField
              key={agent}
              label={agent}
              value={form.builtIn[agent] ?? ""}
              faultId={atFault(form.builtIn[agent] ?? "") ? `${id}-built-in` : undefined}
              onText={(count) => change({ builtIn: { ...form.builtIn, [agent]: count } })}
            />
          ))}
        </div>
        {builtIns(form) > 0 && <p class="small">{words.builtInSum(builtIns(form))}</p>}
        {faults.builtIn && (
          <p id={`${id}-built-in`} class={fieldCss.fault} role="alert">
            {faults.builtIn}
          </p>
        )}
      </fieldset>
      <fieldset class={tournamentsCss.newTournamentGroup}>
        <legend>{words.kinds}</legend>
        <div class={tournamentsCss.newTournamentKinds}>
          {(["people", "agents", "robots", "models"] as const).map((kind) => (
            <CheckField
              key={kind}
              label={words.kind[kind]}
              checked={form[kind]}
              faultId={faults.people && `${id}-kinds`}
              // The error that nobody may join is shown at the first kind, whichever is picked to
              // fix it.
              onCheck={(may) => change({ people: form.people, [kind]: may })}
            />
          ))}
        </div>
        {faults.people && (
          <p id={`${id}-kinds`} class={fieldCss.fault} role="alert">
            {faults.people}
          </p>
        )}
      </fieldset>
      <div class={formCss.fields}>
        <Typed {...props} name="maxParticipants" label={words.maxParticipants} hint={words.maxParticipantsHint} />
        <Typed {...props} name="physicalTables" label={words.physicalTables} hint={words.physicalTablesHint} />
      </div>
    </>
  );
}

/** When it starts, and how long games wait for absent players. */
export function StartFields(props: FormProps) {
  const { form, faults, change } = props;
  const words = t().organise;
  return (
    <div class={formCss.fields}>
      <SelectField
        label={words.start.label}
        hint={words.start[`${form.start}Hint`]}
        value={form.start}
        options={(["byHand", "joined", "time"] as const).map((value) => ({ value, label: words.start[value] }))}
        onPick={(start) => change({ start })}
      />
      {form.start === "joined" && (
        <Typed {...props} name="startWhen" label={words.startWhen} hint={words.startWhenHint} />
      )}
      {form.start === "time" && (
        <TextField
          type="datetime-local"
          label={words.startAt}
          value={form.startAt}
          fault={faults.startAt}
          onText={(startAt) => change({ startAt })}
        />
      )}
      <Typed {...props} name="noShowSeconds" label={words.noShow} hint={words.noShowHint} />
    </div>
  );
}
