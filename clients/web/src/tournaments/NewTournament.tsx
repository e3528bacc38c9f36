// Making a tournament: its form, who takes part, when it begins, how fast it is played; what most people never change is folded away. What the
// form holds and asks for is in tournament-form.ts; the fields of every game are those of a new room (lobby/GameFields.tsx).

import { type Offered, useOffered } from "../api/server";
import { t } from "../i18n";
import { useFilling } from "../lobby/filling";
import { ClockFields, FaultFields, RuleFields, Typed, WatchFields, wordsOfProblem } from "../lobby/GameFields";
import type { NumberProblem } from "../lobby/problems";
import { MAX_NAME } from "../lobby/room-form";
import { Button } from "../parts/Button";
import { CheckField, SelectField, TextField } from "../parts/Field";
import { Notice } from "../parts/Notice";
import { navigate } from "../router";
import { Choices } from "./Choices";
import { makeTournament } from "./hosting";
import { FormatFields, type FormProps, StartFields, WhoFields } from "./TournamentFields";
import {
  newTournament,
  type Problem,
  problemsOf,
  settingsOf,
  TOURNAMENT_FIELDS,
  type TournamentForm,
} from "./tournament-form";
import "../lobby/new-room.css";
import "./tournaments.css";

/** The page. */
export function NewTournament() {
  const { offered, fault } = useOffered();
  return (
    <section class="new-room new-tournament">
      <h1>{t().organise.title}</h1>
      {fault && <Notice kind="fault">{fault}</Notice>}
      {offered && <TournamentFormView offered={offered} />}
    </section>
  );
}

function problemWords(problem: Problem): string {
  const own: Partial<Record<string, string>> = t().organise.problems;
  return (typeof problem === "string" && own[problem]) || wordsOfProblem(problem as NumberProblem);
}

function TournamentFormView({ offered }: { offered: Offered }) {
  const words = t().organise;
  const filling = useFilling(() => newTournament(offered.agents), {
    check: (form) =>
      Object.fromEntries(Object.entries(problemsOf(form)).map(([field, problem]) => [field, problemWords(problem)])),
    fields: TOURNAMENT_FIELDS,
    send: async (form) => {
      const tournamentId = await makeTournament(settingsOf(form));
      navigate({ page: "tournament", tournamentId });
    },
  });
  const { form, faults, change } = filling;
  const parts: FormProps = { form, faults, change };
  return (
    <form class="new-room-form" onSubmit={filling.submit} noValidate>
      <section class="sheet new-room-part">
        <TextField
          label={words.name}
          value={form.name}
          onText={(name) => change({ name })}
          fault={faults.name}
          maxLength={MAX_NAME}
          autoComplete="off"
          placeholder={words.namePlaceholder}
        />
        <FormatFields {...parts} />
      </section>
      <section class="sheet new-room-part">
        <h2>{words.who}</h2>
        <WhoFields {...parts} agents={offered.agents} />
      </section>
      <section class="sheet new-room-part">
        <h2>{words.when}</h2>
        <StartFields {...parts} />
      </section>
      <section class="sheet new-room-part">
        <h2>{t().lobby.make.clock}</h2>
        <Clocks {...parts} />
      </section>
      <details
        class="sheet new-room-part"
        open={filling.unfolded}
        onToggle={(event) => filling.unfold(event.currentTarget.open)}
      >
        <summary>
          <h2>{words.more}</h2>
        </summary>
        <Folded {...parts} offered={offered} />
      </details>
      {filling.refusal && <Notice kind="fault">{filling.refusal}</Notice>}
      <div>
        <Button look="main" type="submit" busy={filling.busy}>
          {words.submit}
        </Button>
      </div>
    </form>
  );
}

/** The clock of all, and other times for programs. */
function Clocks(props: FormProps) {
  const { form, change } = props;
  const words = t().organise;
  return (
    <>
      <ClockFields {...props} />
      <div class="fields">
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
          </>
        )}
      </div>
    </>
  );
}

/** What is mostly left alone. */
function Folded(props: FormProps & { offered: Offered }) {
  const { form, change, offered } = props;
  const words = t().organise;
  const rooms = t().lobby.make;
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
      <FaultFields {...props} agents={offered.agents}>
        <SelectField
          label={words.filler}
          hint={words.fillerHint}
          value={form.filler}
          options={offered.agents.map((value) => ({ value, label: value }))}
          onPick={(filler) => change({ filler })}
        />
        <Typed {...props} name="maxCalls" label={words.maxCalls} hint={words.maxCallsHint} />
        <Typed {...props} name="maxParallel" label={words.maxParallel} />
      </FaultFields>
      <h3>{rooms.watching}</h3>
      {form.deals === "independent" ? <WatchFields {...props} /> : <p class="soft">{words.notWatched}</p>}
      <h3>{words.experiment}</h3>
      <div class="fields">
        <Typed {...props} name="drawSeed" label={words.drawSeed} hint={words.drawSeedHint} />
        <Typed {...props} name="dealSeed" label={words.dealSeed} hint={words.dealSeedHint} />
      </div>
    </>
  );
}
