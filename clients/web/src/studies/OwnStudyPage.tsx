// A study, for its researcher: progress, links, participants, data. Only devices with the owner
// token show it.

import { type Signal, signal } from "@preact/signals";
import type { ComponentChild } from "preact";
import { useEffect, useState } from "preact/hooks";
import { faultOf, wordsOf } from "../api/faults";
import { type Following, follow } from "../api/follow";
import {
  type Study,
  type StudyLink,
  type StudyParticipant,
  StudyPointer,
  type StudyRequiredDevice,
} from "../gen/chefshat/v1/study_pb";
import { hex } from "../hex";
import { momentOf, t } from "../i18n";
import { CopyLine, QrCode } from "../lobby/Invite";
import { MAX_NAME } from "../lobby/room-form";
import { ActionButton, Submit } from "../parts/ActionButton";
import { useAttempt } from "../parts/attempt";
import { Button } from "../parts/Button";
import { ConfirmButton } from "../parts/ConfirmButton";
import { download, fileName } from "../parts/download";
import { CheckField, TextField } from "../parts/Field";
import { Notice } from "../parts/Notice";
import { useStarted } from "../parts/started";
import { zipped } from "../parts/zip";
import { navigateFromHere, type PageProps } from "../router";
import { byCondition, stateName, statesOf } from "./board";
import { studyApi } from "./client";
import { LinkList } from "./LinkList";
import css from "./Own.module.css";
import { addressOf, deleteStudy, exportStudy, keepOwnerToken, mayOwn, ownership, ownerTokenOf } from "./owning";
import { MAX_ADDED, participantsIn } from "./participants";
import { fileOf } from "./settings-file";

/** The page. */
export function OwnStudyPage({ route: { studyId } }: PageProps<"ownStudy">) {
  // How often a key has been entered: with another one the study is asked for again.
  const [keys, setKeys] = useState(0);
  const unlock = <Unlock studyId={studyId} onKey={() => setKeys(keys + 1)} />;
  return ownerTokenOf(studyId) === null ? unlock : <Owned key={keys} studyId={studyId} unlock={unlock} />;
}

/** Takes the owner token of a study that another device created. */
function Unlock({ studyId, onKey }: { studyId: string; onKey: () => void }) {
  const words = t().studies.own;
  const [key, setKey] = useState("");
  const [tried, setTried] = useState(false);
  const use = (event: Event) => {
    event.preventDefault();
    setTried(true);
    if (!mayOwn(studyId, key.trim())) return;
    keepOwnerToken(studyId, key.trim());
    onKey();
  };
  return (
    <form class={`sheet ${css.part}`} onSubmit={use} noValidate>
      <h1>{words.title}</h1>
      <p>{words.notOwned}</p>
      <TextField
        label={words.key}
        hint={words.keyHint}
        value={key}
        onText={setKey}
        fault={tried ? words.keyHint : undefined}
      />
      <div>
        <Button type="submit">{words.useKey}</Button>
      </div>
    </form>
  );
}

/** The study as the stream reports it. */
export interface FollowedStudy {
  readonly study: Study;
  readonly participants: readonly StudyParticipant[];
}

interface StudyFollowing {
  readonly live: Signal<FollowedStudy | undefined>;
  readonly following: Following;
  /** Takes over what is known of participants. */
  merge(study: Study | undefined, participants: readonly StudyParticipant[]): void;
  stop(): void;
}

function useStudy(studyId: string): StudyFollowing | undefined {
  const start = () => {
    const live = signal<FollowedStudy | undefined>(undefined);
    const merge = (study: Study | undefined, participants: readonly StudyParticipant[]) => {
      const now = live.peek();
      const next = study ?? now?.study;
      if (!next) return;
      const merged = new Map([...(now?.participants ?? []), ...participants].map((one) => [one.number, one]));
      live.value = {
        study: next,
        participants: [...merged.values()].sort((one, other) => one.number - other.number),
      };
    };
    const isOver = () => {
      const study = live.peek()?.study;
      return study?.closed === true && study.active === 0;
    };
    const following = follow(
      (abort) => studyApi.followStudy(ownership(studyId), { signal: abort }),
      ({ study, participants }) => {
        merge(study, participants);
        return true;
      },
      { isComplete: isOver, restsWhileHidden: true },
    );
    return { live, following, merge, stop: following.stop };
  };
  return useStarted(start, studyId);
}

/** The study, or `unlock` to enter another key if this device's is not that of a study of the server. */
function Owned({ studyId, unlock }: { studyId: string; unlock: ComponentChild }) {
  const followed = useStudy(studyId);
  const live = followed?.live.value;
  const link = followed?.following.link.value;
  const fault = link === "failed" && followed?.following.fault.value;
  if (fault) {
    return (
      <>
        <Notice kind="fault">{wordsOf(fault)}</Notice>
        {fault.reason === "STUDY_UNKNOWN" && unlock}
      </>
    );
  }
  return (
    <>
      {link === "lost" && <Notice kind="fault">{t().table.link.lost}</Notice>}
      {live && followed ? (
        <OwnStudy {...live} onChanged={(participant) => followed.merge(undefined, [participant])} />
      ) : (
        <p class="soft">{t().common.loading}</p>
      )}
    </>
  );
}

interface OwnStudyProps extends FollowedStudy {
  /** After a call has changed a participant: when the study is over, no stream says so. */
  onChanged: (participant: StudyParticipant) => void;
}

/** The page of a study. */
export function OwnStudy({ study, participants, onChanged }: OwnStudyProps) {
  const words = t().studies.own;
  const { studyId, settings, closed } = study;
  const deletesAtMs = settings?.deletesAtMs ?? 0n;
  const close = () => studyApi.closeStudy(ownership(studyId)).then(() => false);
  return (
    <div class={css.page} data-part="own-study">
      <header class={css.head}>
        <div>
          <h1>{settings?.name}</h1>
          <p class="soft">
            {closed ? words.closed : words.open} · {words.counts(study.completed, settings?.participants ?? 0)}
          </p>
        </div>
        <Export study={study} test={false} />
      </header>
      {closed && <Notice kind="hint">{words.isClosed}</Notice>}
      {deletesAtMs > 0n && <Notice kind="hint">{words.deletes(momentOf(deletesAtMs, "short"))}</Notice>}
      {settings?.device && <Notice kind="hint">{deviceWords(settings.device)}</Notice>}
      <Counts study={study} participants={participants} />
      {!closed && study.openLink && <OpenLink study={study} />}
      {!closed && <Add study={study} />}
      <Tests study={study} />
      <Links studyId={studyId} known={participants.length} />
      <Participants {...{ study, participants, onChanged }} />
      <details class={`sheet ${css.part}`}>
        <summary>{words.showKey}</summary>
        <CopyLine label={words.key} text={ownerTokenOf(studyId) ?? ""} mono />
        <CopyLine label={words.seeds} text={hex(study.seedsSha256)} mono />
      </details>
      <SettingsFile studyId={studyId} />
      {!closed && (
        <ConfirmButton label={words.close} confirm={words.closeDo} act={close}>
          {words.closeText}
        </ConfirmButton>
      )}
      <Delete study={study} />
    </div>
  );
}

/** The device that participants need, in words. */
function deviceWords({ pointer, minWidth }: StudyRequiredDevice): string {
  const words = t().studies.make;
  const device = pointer === StudyPointer.FINE ? "fine" : pointer === StudyPointer.COARSE ? "coarse" : "any";
  const needed = `${words.devices}: ${words.device[device]}`;
  return minWidth > 0 ? `${needed}. ${words.minWidth}: ${minWidth}` : needed;
}

/** The settings as a file; only a call for them has the pictures. */
function SettingsFile({ studyId }: { studyId: string }) {
  const save = async () => {
    const settings = (await studyApi.getStudy(ownership(studyId))).study?.settings;
    if (settings) download(fileOf(settings), `${fileName(settings.name)}.json`, "application/json");
  };
  return (
    <div class={css.export}>
      <ActionButton look="quiet" again act={save}>
        {t().studies.own.settings}
      </ActionButton>
    </div>
  );
}

/** Deletes the study; with the participants who are in the middle of it only after the server refused. */
function Delete({ study }: { study: Study }) {
  const words = t().studies.own.erase;
  const [refused, setRefused] = useState(false);
  const erase = async (force: boolean) => {
    const navigate = navigateFromHere();
    try {
      await deleteStudy(study.studyId, force);
    } catch (thrown) {
      if (faultOf(thrown).reason === "STUDY_RUNNING") setRefused(true);
      throw thrown;
    }
    navigate({ page: "studies" }, { replace: true });
  };
  return (
    <>
      <ConfirmButton label={words.button} confirm={words.confirm} act={() => erase(false)}>
        {words.text}
      </ConfirmButton>
      {refused && (
        <ConfirmButton label={words.force} confirm={words.forceConfirm} act={() => erase(true)}>
          {words.forceText} {words.text}
        </ConfirmButton>
      )}
    </>
  );
}

function Counts({ study, participants }: FollowedStudy) {
  const words = t().studies.own;
  const rows = byCondition(study, participants);
  const states = statesOf(study);
  return (
    <section class={`sheet ${css.part}`}>
      <h2>{words.board.title}</h2>
      {/* biome-ignore lint/a11y/noNoninteractiveTabindex: a region that scrolls must be reachable with the keyboard */}
      <section class={css.scroll} tabIndex={0} aria-label={words.board.title}>
        <table class={`listing ${css.table}`} data-part="conditions">
          <thead>
            <tr>
              <th scope="col">{words.board.condition}</th>
              {states.map((state) => (
                <th scope="col" key={state}>
                  {words.state[stateName(state)]}
                </th>
              ))}
            </tr>
          </thead>
          <tbody>
            {rows.map(({ condition, counts }) => (
              <tr key={condition ?? ""}>
                <th scope="row">{condition ?? words.board.all}</th>
                {counts.map((count, index) => (
                  <td class="number" key={states[index]}>
                    {count}
                  </td>
                ))}
              </tr>
            ))}
          </tbody>
        </table>
      </section>
    </section>
  );
}

/** The link for everyone. */
function OpenLink({ study: { openLink, settings } }: { study: Study }) {
  const words = t().studies.own.openLink;
  const parameter = settings?.recruiting?.idParameter ?? "";
  const address = addressOf({ link: openLink });
  return (
    <section class={`sheet ${css.part}`} data-part="open-link">
      <h2>{words.title}</h2>
      <p class="soft">{words.text}</p>
      {parameter === "" ? (
        <>
          <CopyLine label={words.label} text={address} />
          <QrCode text={address} label={words.label} />
        </>
      ) : (
        <>
          <CopyLine label={words.label} text={`${address}?${parameter}=`} />
          <p class="soft">{words.withId}</p>
        </>
      )}
    </section>
  );
}

function Add({ study: { studyId, settings } }: { study: Study }) {
  const words = t().studies.own.add;
  const [count, setCount] = useState("");
  const [names, setNames] = useState("");
  const [together, setTogether] = useState(false);
  const [unsure, setUnsure] = useState(false);
  const size = settings?.groups?.size ?? 1;
  const [tried, setTried] = useState(false);
  const { busy, fault, run } = useAttempt();
  const pseudonyms = participantsIn(names);
  const number = count.trim() === "" ? 0 : Number(count);
  const fits = Number.isInteger(number) && number >= 0 && number <= MAX_ADDED;
  const valid =
    fits && number + pseudonyms.length > 0 && pseudonyms.every((name) => Array.from(name).length <= MAX_NAME);
  const isUneven = together && (number + pseudonyms.length) % size !== 0;
  const wrongGroups = tried && valid && isUneven;
  const add = (event: Event) => {
    event.preventDefault();
    setTried(true);
    if (!valid || isUneven) return;
    setUnsure(false);
    run(async () => {
      try {
        await studyApi.addStudyParticipants({ ...ownership(studyId), count: number, pseudonyms, together });
      } catch (thrown) {
        // The answer was lost. Repeated, the request would add others.
        setUnsure(faultOf(thrown).reason === "");
        throw thrown;
      }
      setCount("");
      setNames("");
      setTried(false);
      return false;
    });
  };
  return (
    <form class={`sheet ${css.part}`} onSubmit={add} noValidate data-part="add-participants">
      <h2>{words.title}</h2>
      <div class={css.fields}>
        <TextField label={words.count} value={count} onText={setCount} inputMode="numeric" />
        <TextField
          label={words.names}
          hint={words.namesHint}
          rows={2}
          value={names}
          onText={setNames}
          fault={tried && !valid ? words.problem : undefined}
        />
      </div>
      {size > 1 && (
        <CheckField
          label={words.together}
          hint={words.togetherHint(size)}
          checked={together}
          onCheck={setTogether}
          fault={wrongGroups ? words.wholeGroups(size) : undefined}
        />
      )}
      {unsure && <Notice kind="hint">{words.unsure}</Notice>}
      <Submit look="plain" {...{ busy, fault }}>
        {words.submit}
      </Submit>
    </form>
  );
}

/** Test participants: to look at the study, or to try an analysis with their data. */
function Tests({ study }: { study: Study }) {
  const words = t().studies.own.tests;
  const { studyId, closed, testParticipants } = study;
  const [count, setCount] = useState("1");
  const { busy, fault, run } = useAttempt();
  const number = Number(count);
  const valid = Number.isInteger(number) && number >= 1 && number <= MAX_ADDED;
  const add = (event: Event) => {
    event.preventDefault();
    const request = { ...ownership(studyId), count: number, test: true };
    if (valid) run(() => studyApi.addStudyParticipants(request).then(() => false));
  };
  if (closed && testParticipants === 0) return null;
  return (
    <section class={`sheet ${css.part}`} data-part="test-participants">
      <h2>{words.title}</h2>
      {!closed && (
        <form class={css.part} onSubmit={add} noValidate>
          <p class="soft">{words.text}</p>
          <TextField
            label={words.count}
            value={count}
            onText={setCount}
            inputMode="numeric"
            fault={valid ? undefined : t().studies.make.problems.number(1, MAX_ADDED)}
          />
          <Submit look="plain" {...{ busy, fault }}>
            {words.submit}
          </Submit>
        </form>
      )}
      {testParticipants > 0 && (
        <>
          <TestLinks studyId={studyId} known={testParticipants} />
          <Export study={study} test />
        </>
      )}
    </section>
  );
}

interface LinksProps {
  studyId: string;
  /** How many participants there are. */
  known: number;
}

/** The links of a study that are wanted, once they are requested; and again for each participant that is added. */
function useLinks({ studyId, known }: LinksProps, isWanted: (link: StudyLink) => boolean) {
  const [links, setLinks] = useState<StudyLink[] | null>(null);
  const { busy, fault, run } = useAttempt();
  const show = () =>
    run(async () => {
      setLinks((await studyApi.listStudyLinks(ownership(studyId))).links.filter(isWanted));
      return false;
    });
  useEffect(() => {
    if (links) show();
  }, [known]);
  return { links, show, busy, fault };
}

function TestLinks(props: LinksProps) {
  const { links, show, busy, fault } = useLinks(props, ({ test }) => test);
  if (links?.length === 0) return <p class="soft">{t().studies.own.tests.noLinks}</p>;
  return links ? (
    <LinkList links={links.map((link) => ({ name: link.pseudonym, address: addressOf(link) }))} />
  ) : (
    <div>
      <Button busy={busy} onClick={show}>
        {t().studies.own.tests.links}
      </Button>
      {fault && <Notice kind="fault">{fault}</Notice>}
    </div>
  );
}

/** The links, requested when asked for: they let anybody take part. */
function Links(props: LinksProps) {
  const words = t().studies.own.links;
  // Those who joined have theirs; those of test participants are not to be handed out.
  const { links, show, busy, fault } = useLinks(props, ({ joined, test }) => !joined && !test);
  return (
    <section class={`sheet ${css.part} ${css.links}`} data-part="links">
      <h2>{words.title}</h2>
      <p class="soft">{words.text}</p>
      {fault && <Notice kind="fault">{fault}</Notice>}
      {links === null ? (
        <div>
          <Button busy={busy} onClick={show}>
            {words.show}
          </Button>
        </div>
      ) : (
        <>
          <LinkList links={links.map((link) => ({ name: link.pseudonym, address: addressOf(link) }))} />
          <div>
            <Button onClick={() => window.print()}>{words.print}</Button>
          </div>
          <ul class={css.slips}>
            {links.map((link) => (
              <li key={link.number}>
                <b>{link.pseudonym}</b>
                <QrCode text={addressOf(link)} label={words.of(link.pseudonym)} />
                <span class="small">{addressOf(link)}</span>
              </li>
            ))}
          </ul>
        </>
      )}
    </section>
  );
}

function Participants({ study, participants, onChanged }: OwnStudyProps) {
  const words = t().studies.own.board;
  if (participants.length === 0) return null;
  return (
    <section class={`sheet ${css.part}`}>
      <h2>{words.participants}</h2>
      <section class={css.scroll} aria-label={words.participants}>
        <table class={`listing ${css.table}`} data-part="participants">
          <thead>
            <tr>
              {[words.number, words.pseudonym, words.conditions, words.stateColumn, words.stage, words.seen].map(
                (title) => (
                  <th scope="col" key={title}>
                    {title}
                  </th>
                ),
              )}
              <th scope="col">
                <span class="visually-hidden">{words.change}</span>
              </th>
            </tr>
          </thead>
          <tbody>
            {participants.map((participant) => (
              <Row key={participant.number} {...{ study, participant, onChanged }} />
            ))}
          </tbody>
        </table>
      </section>
    </section>
  );
}

interface RowProps extends Pick<OwnStudyProps, "study" | "onChanged"> {
  participant: StudyParticipant;
}

function Row({ study, participant, onChanged }: RowProps) {
  const words = t().studies.own;
  const { number, pseudonym, panelId, state, step, sessions, connected, conditions, group, dataDeleted } = participant;
  const name = pseudonym || `${words.board.number} ${number}`;
  const over = !["invited", "active"].includes(stateName(state));
  const running = participant.games.find(({ joinCode }) => joinCode !== "");
  const request = { ...ownership(study.studyId), number };
  /** The participant of the answer is as it is then. */
  const act = async (call: Promise<{ participant?: StudyParticipant | undefined }>) => {
    const changed = (await call).participant;
    if (changed) onChanged(changed);
    return false;
  };
  return (
    <tr>
      <td class="number">{number}</td>
      <th scope="row">
        {dataDeleted ? <span class="soft">{words.board.deleted}</span> : pseudonym}
        {participant.test && <span class="soft small"> {words.tests.mark}</span>}
        {panelId && <span class="soft small"> {panelId}</span>}
      </th>
      <td>
        {conditions.join(", ")}
        {group > 0 && <span class="soft small"> {words.board.group(group)}</span>}
      </td>
      <td>{words.state[stateName(state)]}</td>
      <td class="number">
        {Math.min(step, study.steps)}/{study.steps}
      </td>
      <td>
        {!over && sessions > 0 && <span>{connected ? words.board.connected : words.board.away} · </span>}
        <span class="soft small">{seenWords(participant)}</span>
        {running && <span class="small"> {words.board.joinCode(running.joinCode)}</span>}
      </td>
      <td>
        {!dataDeleted && (
          <details>
            <summary>
              {words.board.change}
              <span class="visually-hidden"> {name}</span>
            </summary>
            <div class={css.changes}>
              {!over && (
                <>
                  <ConfirmButton
                    label={words.remove}
                    confirm={words.removeDo}
                    subject={name}
                    act={() => act(studyApi.removeStudyParticipant(request))}
                  >
                    {words.removeText(name)}
                  </ConfirmButton>
                  <ConfirmButton
                    label={words.replace}
                    confirm={words.replaceDo}
                    subject={name}
                    act={() => act(studyApi.removeStudyParticipant({ ...request, replace: true }))}
                  >
                    {words.replaceText(name)}
                  </ConfirmButton>
                </>
              )}
              <ConfirmButton
                label={words.deleteData}
                confirm={words.deleteDo}
                subject={name}
                act={() => act(studyApi.deleteStudyParticipant(request))}
              >
                {words.deleteText(name)}
              </ConfirmButton>
            </div>
          </details>
        )}
      </td>
    </tr>
  );
}

function seenWords({ beganAtMs, endedAtMs, sessions }: StudyParticipant): string {
  const words = t().studies.own.board;
  if (endedAtMs > 0n) return words.ended(momentOf(endedAtMs, "short"));
  if (beganAtMs > 0n) return `${words.began(momentOf(beganAtMs, "short"))} · ${words.sessions(sessions)}`;
  return "";
}

function Export({ study, test }: { study: Study; test: boolean }) {
  const words = t().studies.own;
  const [files, setFiles] = useState(0);
  const { busy, fault, run } = useAttempt();
  const save = () =>
    run(async () => {
      setFiles(0);
      const archive = zipped(await exportStudy(study.studyId, test, setFiles));
      const name = fileName(study.settings?.name ?? "study");
      download(archive, `${name}${test ? "-test" : ""}.zip`, "application/zip");
      return false;
    });
  return (
    <div class={css.export}>
      <Button busy={busy} onClick={save}>
        {test ? words.tests.export : words.export}
      </Button>
      {busy && <span class="soft small">{words.exporting(files)}</span>}
      {fault && <Notice kind="fault">{fault}</Notice>}
    </div>
  );
}
