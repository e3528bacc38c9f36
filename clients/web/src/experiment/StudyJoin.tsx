// The way of a study's participant to the table, one step after the other: what is agreed to, a questionnaire, the seat.

import { useState } from "preact/hooks";
import { inWords } from "../api/faults";
import { t } from "../i18n";
import { MAX_NAME } from "../lobby/room-form";
import { lastName, takeSeat } from "../lobby/seat";
import { Button } from "../parts/Button";
import { TextField } from "../parts/Field";
import { Notice } from "../parts/Notice";
import { navigate } from "../router";
import { remember } from "../store";
import { QuestionnaireLink } from "./QuestionnaireLink";
import { hostOf, languageOf, rememberStudy, type Study } from "./study";
import "./experiment.css";

type Step = "consent" | "declined" | "before" | "seat";

/** The page of an invitation to a study. */
export function StudyJoin({ code, study }: { code: string; study: Study }) {
  const words = t().experiment.join;
  const afterConsent: Step = study.before ? "before" : "seat";
  const [step, setStep] = useState<Step>(study.consent ? "consent" : afterConsent);
  if (step === "declined") return <p class="sheet study">{words.declined}</p>;
  return (
    <section class="sheet study">
      <h1>{words.title}</h1>
      {study.name && <p>{words.as(study.name)}</p>}
      {study.seat !== undefined && <p>{words.atSeat(study.seat)}</p>}
      {step === "consent" && (
        <>
          <h2>{words.consent}</h2>
          <blockquote class="study-consent">{study.consent}</blockquote>
          <p class="soft small">{words.fromHost}</p>
          <p class="study-ways">
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
          <p class="study-ways">
            <QuestionnaireLink address={study.before} name={study.name} roomId="" />
            <Button onClick={() => setStep("seat")}>{words.done}</Button>
          </p>
        </>
      )}
      {step === "seat" && <TakeSeat code={code} study={study} />}
    </section>
  );
}

function TakeSeat({ code, study }: { code: string; study: Study }) {
  const words = t().experiment.join;
  const [name, setName] = useState(study.name);
  const [missing, setMissing] = useState(false);
  const [busy, setBusy] = useState(false);
  const [fault, setFault] = useState("");
  const sit = async (event: Event) => {
    event.preventDefault();
    setMissing(name.trim() === "");
    if (name.trim() === "") return;
    setBusy(true);
    setFault("");
    const before = lastName();
    try {
      const room = await takeSeat(code, name, study.seat);
      // The next one at this device is somebody else.
      remember("name", before === "" ? null : before);
      rememberStudy(room.roomId, { ...study, name: name.trim() });
      navigate({ page: "room", roomId: room.roomId }, { replace: true, search: languageOf(location.search) });
    } catch (thrown) {
      setFault(inWords(thrown));
      setBusy(false);
    }
  };
  return (
    <form class="study" onSubmit={sit}>
      {study.name === "" && (
        <TextField
          label={t().lobby.join.name}
          hint={t().lobby.join.nameHint}
          value={name}
          onText={setName}
          maxLength={MAX_NAME}
          autoComplete="off"
          fault={missing ? t().lobby.join.nameMissing : undefined}
        />
      )}
      <p class="soft">{words.recorded}</p>
      {study.times && <p class="soft">{words.timed}</p>}
      {fault && <Notice kind="fault">{fault}</Notice>}
      <Button look="main" type="submit" busy={busy}>
        {words.sitDown}
      </Button>
    </form>
  );
}
