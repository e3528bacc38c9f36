// A participant's way into a study, step by step: consent, questionnaire, name. The page of the
// invitation takes the seat or place.

import { useState } from "preact/hooks";
import { t } from "../i18n";
import { MAX_NAME } from "../lobby/room-form";
import { lastName } from "../lobby/seat";
import { useAttempt } from "../parts/attempt";
import { Button } from "../parts/Button";
import { TextField } from "../parts/Field";
import { Notice } from "../parts/Notice";
import { remember } from "../store";
import css from "./Experiment.module.css";
import { QuestionnaireLink } from "./QuestionnaireLink";
import { hostOf, rememberStudy, type Study } from "./study";

interface StudyJoinProps {
  study: Study;
  /** What the participant joins. */
  what: "room" | "tournament";
  /**
   * Takes the seat, or the place in a tournament, with a name. Returns the id of the room or
   * tournament; null if the page has another question first.
   */
  take: (name: string) => Promise<string | null>;
  /** Whether a chosen name is taken; the server checks this for tournaments. */
  isTaken?: (name: string) => boolean;
  /** Navigates there. */
  arrive: (id: string) => void;
}

type Step = "consent" | "declined" | "before" | "seat";

/** The page of an invitation to a study. */
export function StudyJoin(props: StudyJoinProps) {
  const { study } = props;
  const words = t().experiment.join;
  const afterConsent: Step = study.before ? "before" : "seat";
  const [step, setStep] = useState<Step>(study.consent ? "consent" : afterConsent);
  if (step === "declined") {
    return (
      <section class={`sheet ${css.study}`}>
        <p>{words.declined}</p>
        <Button look="quiet" onClick={() => setStep("consent")}>
          {words.reconsider}
        </Button>
      </section>
    );
  }
  return (
    <section class={`sheet ${css.study}`}>
      <h1>{words.title}</h1>
      {study.name && <p>{words.as(study.name)}</p>}
      {study.seat !== undefined && <p>{words.atSeat(study.seat)}</p>}
      {step === "consent" && (
        <>
          <h2>{words.consent}</h2>
          <blockquote class={css.consent}>{study.consent}</blockquote>
          <p class="soft small">{words.fromHost}</p>
          <p class="row">
            <Button look="main" onClick={() => setStep(afterConsent)}>
              {words.agree}
            </Button>
            <Button onClick={() => setStep("declined")}>{words.decline}</Button>
          </p>
        </>
      )}
      {step === "before" && (
        <>
          <h2>{words.before}</h2>
          <p>{words.beforeText(hostOf(study.before))}</p>
          <p class="row">
            <QuestionnaireLink address={study.before} blanks={{ name: study.name }} />
            <Button onClick={() => setStep("seat")}>{words.done}</Button>
          </p>
        </>
      )}
      {step === "seat" && <Come {...props} />}
    </section>
  );
}

function Come({ study, what, take, isTaken, arrive }: StudyJoinProps) {
  const words = t().experiment.join;
  const [name, setName] = useState(study.name);
  const [missing, setMissing] = useState(false);
  const { busy, fault, run } = useAttempt();
  const taken = study.name === "" && (isTaken?.(name) ?? false);
  const come = (event: Event) => {
    event.preventDefault();
    setMissing(name.trim() === "");
    if (name.trim() === "" || taken) return;
    run(async () => {
      const before = lastName();
      const id = await take(name);
      if (id === null) return false;
      // The next person at this device is someone else.
      remember("name", before === "" ? null : before);
      rememberStudy(id, { ...study, name: name.trim() });
      arrive(id);
      return true;
    });
  };
  return (
    <form class={css.study} onSubmit={come}>
      {study.name === "" && (
        <TextField
          label={t().lobby.join.name}
          hint={what === "room" ? t().lobby.join.nameHint : t().tournaments.join.nameHint}
          value={name}
          onText={setName}
          maxLength={MAX_NAME}
          autoComplete="off"
          fault={taken ? t().lobby.join.nameTaken(name.trim()) : missing ? t().lobby.join.nameMissing : undefined}
        />
      )}
      <p class="soft">{words.recorded[what]}</p>
      {study.times && <p class="soft">{words.timed}</p>}
      {fault && <Notice kind="fault">{fault}</Notice>}
      <Button look="main" type="submit" busy={busy}>
        {words.come[what]}
      </Button>
    </form>
  );
}
