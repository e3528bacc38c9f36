// A study, for a participant: one stage after the other, as the server says. Withdrawing is possible
// on every screen. The page knows nothing about conditions.

import { Code } from "@connectrpc/connect";
import type { ComponentChildren } from "preact";
import { useEffect, useLayoutEffect, useRef, useState } from "preact/hooks";
import { wordsOf } from "../api/faults";
import {
  type StudyConsent,
  type StudyEnd,
  StudyEndReason,
  type StudyExternalQuestionnaire,
  type StudyShownArrival,
  type StudyText,
  type StudyView,
} from "../gen/chefshat/v1/study_pb";
import { leaveOut } from "../hiding";
import { dateOf, showLanguage, t } from "../i18n";
import { ActionButton, Submit } from "../parts/ActionButton";
import { announce } from "../parts/Announcer";
import { useAttempt } from "../parts/attempt";
import { Button } from "../parts/Button";
import buttonCss from "../parts/Button.module.css";
import { ConfirmButton } from "../parts/ConfirmButton";
import { download } from "../parts/download";
import { CheckField } from "../parts/Field";
import { Notice } from "../parts/Notice";
import { useStarted } from "../parts/started";
import { useTabMark } from "../parts/tab";
import type { PageProps } from "../router";
import { Formatted } from "./Formatted";
import { WithPictures } from "./Pictures";
import { type Participating, startParticipating } from "./participating";
import { Questionnaire } from "./Questionnaire";
import { StageTitle } from "./Stage";
import css from "./Study.module.css";
import { StudyGame } from "./StudyGame";
import { safeAddress } from "./safe-address";
import { WRONG_DEVICE, WrongDevice } from "./WrongDevice";

/** How long after its date the data of a study are deleted, at most. */
const DELETION_TAKES_MS = 7_200_000n;

/** The page. */
export function StudyPage({ route }: PageProps<"study">) {
  const part = useStarted(() => startParticipating(route.link), route.link);
  // Other pages of the server are not part of the study.
  useLayoutEffect(() => leaveOut(["pages"]), []);
  return part ? <Taking part={part} /> : null;
}

/** The study as it stands. */
export function Taking({ part }: { part: Participating }) {
  const words = t().studies;
  const view = part.view.value;
  const presence = part.presence.value;
  useEffect(() => {
    if (view) void showLanguage(view.language);
  }, [view?.language]);
  useWaitIsOver(view);
  if (presence === "superseded") {
    return (
      <section class={`sheet ${css.stage}`} data-part="study-elsewhere">
        <h1>{words.elsewhere.title}</h1>
        <Notice kind="hint">{words.elsewhere.text}</Notice>
        <div>
          <Button look="main" onClick={part.open}>
            {words.elsewhere.here}
          </Button>
        </div>
      </section>
    );
  }
  if (presence === "failed" && part.fault.value?.reason === WRONG_DEVICE) {
    return (
      <div class={css.study}>
        <WrongDevice fault={part.fault.value} retry={part.open} />
        {part.hasLink() && <Withdraw end={undefined} part={part} />}
      </div>
    );
  }
  if (presence === "failed" && part.fault.value) {
    return (
      <section class={`sheet ${css.stage}`}>
        <h1>{words.title}</h1>
        <Notice kind="fault">{wordsOf(part.fault.value)}</Notice>
        {part.fault.value.code === Code.Internal && (
          <div>
            <Button look="main" onClick={part.open}>
              {words.device.retry}
            </Button>
          </div>
        )}
        <GoOn url={part.fault.value.metadata.url ?? ""} />
      </section>
    );
  }
  if (!view) {
    return (
      <section class={`sheet ${css.stage}`}>
        <h1>{words.title}</h1>
        {part.link.value === "lost" ? <Notice kind="fault">{t().table.link.lost}</Notice> : <p>{t().common.loading}</p>}
      </section>
    );
  }
  return (
    <div class={css.study} data-part="study">
      {part.link.value === "lost" && <Notice kind="fault">{t().table.link.lost}</Notice>}
      <Progress view={view} />
      {view.test && <TestNotice key={stageKey(view)} view={view} part={part} />}
      <WithPictures load={part.picture}>
        <Stage key={stageKey(view)} {...{ view, part }} />
      </WithPictures>
      <Withdraw end={view.content.case === "end" ? view.content.value.reason : undefined} part={part} />
    </div>
  );
}

/** Marks the tab when others have come for whom the participant waited, until somebody looks at it. */
function useWaitIsOver(view: StudyView | undefined): void {
  const content = view?.content;
  const waits = content?.case === "arrival" || (content?.case === "game" && content.value.waitsFor > 0);
  const [marked, setMarked] = useState(false);
  useEffect(() => {
    if (!waits) return;
    return () => setMarked(document.hidden);
  }, [waits]);
  useEffect(() => {
    if (!marked) return;
    const look = () => setMarked(document.hidden);
    document.addEventListener("visibilitychange", look);
    return () => document.removeEventListener("visibilitychange", look);
  }, [marked]);
  useTabMark(marked && view?.content.case !== "end" ? t().studies.arrival.complete : "");
}

/** A stage is rendered anew at each step; a game that is repeated, too. */
function stageKey({ step, content }: StudyView): string {
  return content.case === "game" ? `${step} ${content.value.ticket}` : `${step} ${content.case}`;
}

function Progress({ view: { title, step, steps, content } }: { view: StudyView }) {
  const words = t().studies;
  const over = content.case === "end";
  const said = words.progress(Math.min(step + 1, steps), steps);
  const first = useRef(true);
  useEffect(() => {
    if (!first.current && !over) announce(said);
    first.current = false;
  }, [step]);
  return (
    <header class={css.head}>
      <span class={css.title}>{title}</span>
      {!over && (
        <>
          <span class="soft small">{said}</span>
          <progress max={steps} value={step} aria-label={said} />
        </>
      )}
    </header>
  );
}

/** Says that this is a test, and lets go on from questions and games without answering and playing. */
function TestNotice({ view: { content }, part }: StageProps) {
  const words = t().studies.test;
  const { busy, fault, run } = useAttempt();
  const game = content.case === "game" && !content.value.ended ? content.value : undefined;
  const waits = content.case === "arrival" || (game && game.waitsFor > 0);
  const label = content.case === "questionnaire" ? words.skip : waits ? words.alone : game?.ticket && words.end;
  // The end of a game is shown a moment later.
  const [gone, setGone] = useState(false);
  const goOn = () =>
    run(async () => {
      await part.proceed();
      setGone(true);
      return false;
    });
  return (
    <Notice kind="hint">
      <p>
        <b>{words.title}</b> {words.text}
      </p>
      {!gone && label && (
        <Button busy={busy} onClick={goOn}>
          {label}
        </Button>
      )}
      {fault && <p>{fault}</p>}
    </Notice>
  );
}

interface StageProps {
  view: StudyView;
  part: Participating;
}

function Stage({ view, part }: StageProps) {
  const { content, step, title, traces, pseudonym } = view;
  switch (content.case) {
    case "consent":
      return <Consent consent={content.value} {...{ view, part }} />;
    case "questionnaire":
      return (
        <section class={`sheet ${css.stage}`}>
          <Questionnaire key={step} questionnaire={content.value} part={part} />
        </section>
      );
    case "externalQuestionnaire":
      return <External external={content.value} part={part} />;
    case "text":
      return <Text text={content.value} part={part} />;
    case "game":
      return <StudyGame game={content.value} {...{ title, traces, part }} />;
    case "arrival":
      return <Arrival arrival={content.value} />;
    case "end":
      return <End end={content.value} pseudonym={pseudonym} />;
    default:
      return <p class="soft">{t().common.loading}</p>;
  }
}

function Consent({ consent, view, part }: StageProps & { consent: StudyConsent }) {
  const words = t().studies.consent;
  const [agreed, setAgreed] = useState(false);
  const [tried, setTried] = useState(false);
  const { busy, fault, run } = useAttempt();
  const submit = (event: Event) => {
    event.preventDefault();
    setTried(true);
    if (agreed) run(() => part.consent().then(() => false));
  };
  return (
    <form class={`sheet ${css.stage}`} onSubmit={submit} noValidate data-part="consent">
      <StageTitle>{words.title}</StageTitle>
      <section class={css.consent} aria-label={words.textLabel}>
        <Formatted text={consent.text} />
      </section>
      {aboutConsent(consent, view).map((line) => (
        <p key={line} class="soft small">
          {line}
        </p>
      ))}
      <div>
        <Button look="quiet" onClick={() => download(copyOf(consent, view), "consent.txt", "text/plain;charset=utf-8")}>
          {words.copy}
        </Button>
      </div>
      <CheckField
        label={words.agree}
        checked={agreed}
        onCheck={setAgreed}
        fault={tried && !agreed ? words.must : undefined}
      />
      <Submit {...{ busy, fault }}>{words.submit}</Submit>
      <ConfirmButton label={words.decline} confirm={words.declineDo} act={() => part.withdraw(true).then(() => false)}>
        {words.declineText}
      </ConfirmButton>
    </form>
  );
}

/** What the server adds to the text of a consent: its version, and the date on which all data are deleted. */
function aboutConsent({ version }: StudyConsent, { deletesAtMs }: StudyView): string[] {
  const words = t().studies.consent;
  const deletion = deletesAtMs > 0n ? [words.deletion(dateOf(deletesAtMs + DELETION_TAKES_MS))] : [];
  return [words.version(version), ...deletion];
}

/** The text of a consent as a file for the participant. */
function copyOf(consent: StudyConsent, view: StudyView): string {
  return `${[view.title, consent.text, ...aboutConsent(consent, view)].join("\n\n")}\n`;
}

/** Waits until the group is complete: the next view comes by itself. */
function Arrival({ arrival: { text, size, here, waitMs } }: { arrival: StudyShownArrival }) {
  const words = t().studies.arrival;
  const said = words.here(here, size);
  useEffect(() => announce(said), [said]);
  return (
    <section class={`sheet ${css.stage}`} data-part="study-arrival">
      <StageTitle>{words.title}</StageTitle>
      {text && <Formatted text={text} />}
      <ul class={css.places} aria-hidden="true">
        {Array.from({ length: size }, (_, place) => (
          <li key={place} data-taken={place < here} />
        ))}
      </ul>
      <p>
        <b>{said}</b>
      </p>
      <p>{words.text(Math.max(1, Math.ceil(Number(waitMs) / 60_000)))}</p>
    </section>
  );
}

function Text({ text, part }: { text: StudyText; part: Participating }) {
  return (
    <section class={`sheet ${css.stage}`} data-part="study-text">
      <StageTitle>{text.title || t().studies.title}</StageTitle>
      <Formatted text={text.text} />
      <Next part={part}>{t().studies.next}</Next>
    </section>
  );
}

function External({ external, part }: { external: StudyExternalQuestionnaire; part: Participating }) {
  const words = t().studies.external;
  const address = safeAddress(external.url);
  const [opened, setOpened] = useState(false);
  return (
    <section class={`sheet ${css.stage}`} data-part="study-external">
      <StageTitle>{words.title}</StageTitle>
      {external.text && <Formatted text={external.text} />}
      {address && (
        <>
          <p>{words.text(new URL(address).host)}</p>
          <p>
            <a
              class={buttonCss.button}
              data-look={opened ? "plain" : "main"}
              data-part="button"
              href={address}
              target="_blank"
              rel="noopener noreferrer external"
              onClick={() => setOpened(true)}
            >
              {words.open}
            </a>
          </p>
        </>
      )}
      <Next part={part}>{words.done}</Next>
    </section>
  );
}

function Next({ part, children }: { part: Participating; children: ComponentChildren }) {
  return (
    <div>
      <ActionButton again act={part.proceed}>
        {children}
      </ActionButton>
    </div>
  );
}

const ENDS: Partial<Record<StudyEndReason, keyof ReturnType<typeof t>["studies"]["end"]["texts"]>> = {
  [StudyEndReason.COMPLETED]: "completed",
  [StudyEndReason.WITHDRAWN]: "withdrawn",
  [StudyEndReason.DATA_DELETED]: "deleted",
  [StudyEndReason.DROPPED_OUT]: "droppedOut",
  [StudyEndReason.REMOVED]: "removed",
  [StudyEndReason.SCREENED_OUT]: "screenedOut",
  [StudyEndReason.LEFT_OVER]: "leftOver",
};

/** A link to the site from which the participant came. */
function GoOn({ url }: { url: string }) {
  const address = safeAddress(url);
  if (!address) return null;
  return (
    <p>
      <a class={buttonCss.button} data-look="main" data-part="go-on" href={address} rel="noreferrer external">
        {t().studies.end.goOn(new URL(address).host)}
      </a>
    </p>
  );
}

function End({ end: { reason, url, text }, pseudonym }: { end: StudyEnd; pseudonym: string }) {
  const words = t().studies.end;
  const which = ENDS[reason] ?? "completed";
  const isThanked = reason === StudyEndReason.COMPLETED || reason === StudyEndReason.LEFT_OVER;
  return (
    <section class={`sheet ${css.stage}`} data-part="study-end">
      <StageTitle>{isThanked ? words.thanks : words.title}</StageTitle>
      {text ? <Formatted text={text} /> : <p>{words.texts[which]}</p>}
      {pseudonym && <p class="soft">{words.pseudonym(pseudonym)}</p>}
      {url ? <GoOn url={url} /> : <p>{words.close}</p>}
    </section>
  );
}

/** Withdraws; after the end, for this reason, it can still delete the data. */
function Withdraw({ end, part }: { end: StudyEndReason | undefined; part: Participating }) {
  const words = t().studies.withdraw;
  const [deleting, setDeleting] = useState(false);
  if (end === StudyEndReason.DATA_DELETED) return null;
  const withdraw = async (deleteData: boolean) => {
    await part.withdraw(deleteData);
    return false;
  };
  return (
    <footer class={css.withdraw} data-part="withdraw">
      {end === undefined ? (
        <ConfirmButton key="withdraw" label={words.button} confirm={words.confirm} act={() => withdraw(deleting)}>
          {words.text}
          <CheckField label={words.deleteToo} hint={words.deleteHint} checked={deleting} onCheck={setDeleting} />
        </ConfirmButton>
      ) : (
        <ConfirmButton key="delete" label={words.deleteButton} confirm={words.deleteConfirm} act={() => withdraw(true)}>
          {words.deleteHint}
        </ConfirmButton>
      )}
    </footer>
  );
}
