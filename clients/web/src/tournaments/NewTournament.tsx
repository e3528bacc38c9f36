// The page that creates a tournament. The form's values are in tournament-form.ts; the fields of
// every game are shared with new rooms (lobby/GameFields.tsx).

import { agentsFor, type Offered } from "../api/server";
import { t } from "../i18n";
import { FormFrame, FormPage, FormPart } from "../lobby/FormPage";
import formCss from "../lobby/FormPage.module.css";
import { useFormState } from "../lobby/form-state";
import {
  ClockFields,
  FaultFields,
  RuleFields,
  Typed,
  VisibilityField,
  WatchFields,
  wordsOfProblem,
} from "../lobby/GameFields";
import type { NumberProblem } from "../lobby/problems";
import { CheckField, SelectField } from "../parts/Field";
import { navigateFromHere } from "../router";
import { Choices } from "./Choices";
import { createTournament } from "./hosting";
import { FormatFields, type FormProps, StartFields, WhoFields } from "./TournamentFields";
import {
  newTournament,
  type Problem,
  problemsOf,
  settingsOf,
  TOURNAMENT_FIELDS,
  type TournamentForm,
} from "./tournament-form";

/** The page. */
export function NewTournament() {
  return <FormPage title={t().organise.title}>{(offered) => <TournamentFormView offered={offered} />}</FormPage>;
}

function problemWords(problem: Problem): string {
  const { realOpening } = t().lobby.make;
  const own: Partial<Record<string, string>> = { ...t().organise.problems, realOpening };
  return (typeof problem === "string" && own[problem]) || wordsOfProblem(problem as NumberProblem);
}

function TournamentFormView({ offered }: { offered: Offered }) {
  const words = t().organise;
  const state = useFormState(() => newTournament(offered.agents), {
    check: (form) =>
      Object.fromEntries(Object.entries(problemsOf(form)).map(([field, problem]) => [field, problemWords(problem)])),
    fields: TOURNAMENT_FIELDS,
    send: async (form) => {
      const navigate = navigateFromHere();
      const tournamentId = await createTournament(settingsOf(form));
      navigate({ page: "tournament", tournamentId });
    },
  });
  const { form, faults, change } = state;
  const parts: FormProps = { form, faults, change };
  return (
    <FormFrame
      state={state}
      words={words}
      first={<FormatFields {...parts} />}
      folded={<Folded {...parts} offered={offered} />}
    >
      <FormPart title={words.who}>
        <WhoFields {...parts} agents={offered.agents} />
      </FormPart>
      <FormPart title={words.when}>
        <StartFields {...parts} />
      </FormPart>
      <FormPart title={t().lobby.make.clock}>
        <Clocks {...parts} />
      </FormPart>
      <FormPart title={t().lobby.make.visibility.title}>
        <VisibilityField {...parts} />
      </FormPart>
    </FormFrame>
  );
}

/** The clock for everyone, and different times for programs. */
function Clocks(props: FormProps) {
  const { form, change } = props;
  const words = t().organise;
  return (
    <>
      <ClockFields {...props} />
      <div class={formCss.fields}>
        <CheckField
          label={words.otherClocks}
          hint={words.otherClocksHint}
          checked={form.otherClocks}
          onCheck={(otherClocks) => change({ otherClocks })}
        />
        {form.otherClocks && (
          <>
            <Typed {...props} name="agentSeconds" label={words.agentSeconds} />
            <Typed {...props} name="robotSeconds" label={words.robotSeconds} />
            <Typed {...props} name="modelSeconds" label={words.modelSeconds} />
          </>
        )}
      </div>
    </>
  );
}

/** The settings that few people change. */
function Folded(props: FormProps & { offered: Offered }) {
  const { form, change, offered } = props;
  const words = t().organise;
  const rooms = t().lobby.make;
  const real = Number(form.physicalTables) > 0;
  const deals: TournamentForm["deals"][] = ["independent", "same", "rotated"];
  return (
    <>
      <Choices
        label={words.deals}
        value={form.deals}
        options={deals.map((value) => ({ value, ...words.dealWords[value] }))}
        fault={props.faults.deals}
        onPick={(picked) => change({ deals: picked })}
      />
      <h3>{rooms.rules}</h3>
      <RuleFields {...props} players={Number(form.players)} presets={offered.presets} />
      <h3>{rooms.faults}</h3>
      <FaultFields {...props} agents={agentsFor(offered, real, form.substitute)}>
        <SelectField
          label={words.filler}
          hint={words.fillerHint}
          value={form.filler}
          options={agentsFor(offered, real, form.filler).map((value) => ({ value, label: value }))}
          onPick={(filler) => change({ filler })}
        />
        <Typed {...props} name="maxCalls" label={words.maxCalls} hint={words.maxCallsHint} />
        <Typed {...props} name="maxParallel" label={words.maxParallel} />
      </FaultFields>
      <h3>{rooms.watching}</h3>
      {form.deals === "independent" ? <WatchFields {...props} /> : <p class="soft">{words.notWatched}</p>}
      <h3>{words.experiment}</h3>
      <div class={formCss.fields}>
        <Typed {...props} name="drawSeed" label={words.drawSeed} hint={words.drawSeedHint} />
        <Typed {...props} name="dealSeed" label={words.dealSeed} hint={words.dealSeedHint} />
      </div>
    </>
  );
}
