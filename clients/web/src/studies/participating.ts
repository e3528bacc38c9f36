// Taking part in a study: opens it with the link's secret, follows what to show, and sends what the
// participant does. The link is enough to come back, also on another device.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { effect, type Signal, signal } from "@preact/signals";
import { askUntilAnswered } from "../api/asking";
import { type Fault, faultOf, isPassing } from "../api/faults";
import { type Following, follow, type Link } from "../api/follow";
import {
  StudyEndReason,
  type StudyItemAnswer,
  type StudyItemAnswerSchema,
  type StudyTraceSchema,
  type StudyView,
} from "../gen/chefshat/v1/study_pb";
import { replaceAddress } from "../router";
import { participationApi } from "./client";
import { thisDevice } from "./device";
import { forgetJoined, join } from "./joining";

/**
 * How this page takes part: opening the study, open, taken over by another page or device, or
 * failed with an error that a retry does not fix.
 */
export type Presence = "opening" | "open" | "superseded" | "failed";

/** An answer to an item. */
export type ItemAnswer = MessageInitShape<typeof StudyItemAnswerSchema>;
/** An interface trace. */
export type Trace = MessageInitShape<typeof StudyTraceSchema>;

/** How far a participant was at a step when the study was opened here. */
export interface Progress {
  readonly step: number;
  /** When the step was reached, by performance.now(). */
  readonly reachedAtMs: number;
  /** What was entered there. */
  readonly saved: readonly StudyItemAnswer[];
}

export interface Participating {
  readonly presence: Signal<Presence>;
  /** What is shown; undefined until the study is open. */
  readonly view: Signal<StudyView | undefined>;
  /** Why it failed. */
  readonly fault: Signal<Fault | undefined>;
  /** The state of the stream. */
  readonly link: Signal<Link>;
  /** Whether the link is the participant's own, as far as it is known: not the open link of the study. */
  hasLink(): boolean;
  /** Of the step that is shown. */
  progress(): Progress;
  /** Agrees to the text that is shown. */
  consent(): Promise<void>;
  answer(answers: ItemAnswer[]): Promise<void>;
  /** Lets the server keep what was entered so far. */
  save(answers: ItemAnswer[], step: number): Promise<void>;
  /** Continues from a text, another site or a game. */
  proceed(): Promise<void>;
  sendTraces(gameId: string, traces: Trace[]): Promise<void>;
  /** The file of a picture of the text that is shown. */
  picture(name: string): Promise<Uint8Array>;
  withdraw(deleteData: boolean): Promise<void>;
  /** Opens the study here, also if another device has it. */
  open(): void;
  stop(): void;
}

/** Nothing more can be done here. */
const ENDING = ["SESSION_SUPERSEDED", "STUDY_FULL", "STUDY_CLOSED"];
/** The page is behind: the newest view says what to do. */
const OUTDATED = ["STEP_OVER", "STEP_MISMATCH", "PARTICIPATION_OVER"];

/** Takes part with the secret of a link: the participant's own, or the open link of the study. */
export function startParticipating(given: string): Participating {
  let secret = given;
  let isOpenLink = false;
  const presence = signal<Presence>("opening");
  const view = signal<StudyView | undefined>(undefined);
  const fault = signal<Fault | undefined>(undefined);
  const link = signal<Link>("connecting");
  let session = "";
  let progress: Progress = { step: -1, reachedAtMs: 0, saved: [] };
  let following: Following | undefined;
  let unwatch = () => {};
  let stopped = false;
  /** Counts how often the study was opened: an earlier attempt that ends late changes nothing. */
  let opened = 0;

  const leave = () => {
    unwatch();
    following?.stop();
    following = undefined;
  };
  const fail = (found: Fault) => {
    leave();
    fault.value = found;
    presence.value = found.reason === "SESSION_SUPERSEDED" ? "superseded" : "failed";
  };
  /** A view never leads back to an earlier step. */
  const show = (next: StudyView | undefined) => {
    const now = view.peek();
    if (!next || (now && next.step < now.step && next.content.case !== "end")) return;
    view.value = next;
    forgetDeleted(next);
  };

  const openStudy = (link: string) => participationApi.openStudy({ link, device: thisDevice() });

  /** An open link leads to the participant's own, which the page's address has from then on. */
  const joinFirst = async (thrown: unknown) => {
    const { reason, metadata } = faultOf(thrown);
    if (reason !== "LINK_OPEN") throw thrown;
    isOpenLink = true;
    const own = await join(secret, metadata.id_parameter ?? "");
    if (!stopped) {
      secret = own;
      isOpenLink = false;
      replaceAddress({ page: "study", link: own });
    }
    return openStudy(own);
  };

  /** What the server has deleted, this device forgets. */
  const forgetDeleted = (shown: StudyView | undefined) => {
    const { content } = shown ?? {};
    if (content?.case === "end" && content.value.reason === StudyEndReason.DATA_DELETED) forgetJoined(secret);
  };

  const open = async () => {
    leave();
    opened += 1;
    const attempt = opened;
    const isNewest = () => !stopped && attempt === opened;
    presence.value = "opening";
    const onFault = (found: Fault) => {
      if (!isNewest()) return;
      if (isPassing(found)) link.value = "lost";
      else fail(found);
    };
    const answer = await askUntilAnswered(() => openStudy(secret).catch(joinFirst), isNewest, onFault);
    if (!answer || !isNewest()) return;
    session = answer.session;
    progress = {
      step: answer.view?.step ?? -1,
      reachedAtMs: performance.now() - Number(answer.stepAgeMs),
      saved: answer.savedAnswers,
    };
    view.value = answer.view;
    forgetDeleted(answer.view);
    presence.value = "open";
    link.value = "open";
    if (session !== "") attend();
  };

  const attend = () => {
    const stream = follow(
      (abort) => participationApi.followParticipation({ session }, { signal: abort }),
      ({ view: next }) => {
        show(next);
        return next?.content.case !== "end";
      },
    );
    following = stream;
    unwatch = effect(() => {
      link.value = stream.link.value;
      const found = stream.fault.value;
      if (stream.link.value !== "failed" || !found) return;
      // The link still counts.
      if (found.reason === "SESSION_UNKNOWN") queueMicrotask(() => void open());
      else queueMicrotask(() => fail(found));
    });
  };

  /**
   * Does something at the step that is shown, and shows what comes next: unless the stream was faster,
   * whose view may be newer.
   */
  const act = async (call: (at: { session: string; step: number }) => Promise<{ view?: StudyView | undefined }>) => {
    const at = view.peek();
    if (!at) return;
    try {
      const next = (await call({ session, step: at.step })).view;
      if (view.peek() === at) show(next);
    } catch (thrown) {
      const found = faultOf(thrown);
      if (ENDING.includes(found.reason)) return fail(found);
      if (OUTDATED.includes(found.reason)) return open();
      if (found.reason === "SESSION_UNKNOWN") await open();
      throw thrown;
    }
  };

  void open();
  return {
    presence,
    view,
    fault,
    link,
    hasLink: () => !isOpenLink,
    progress: () => {
      const step = view.peek()?.step ?? -1;
      if (progress.step !== step) progress = { step, reachedAtMs: performance.now(), saved: [] };
      return progress;
    },
    consent: () => act((at) => participationApi.giveConsent(at)),
    answer: (answers) => act((at) => participationApi.answerQuestionnaire({ ...at, answers })),
    save: async (answers, step) => {
      await participationApi.saveAnswers({ session, step, answers });
    },
    proceed: () => act((at) => participationApi.continueStudy(at)),
    picture: async (picture) => (await participationApi.getStudyPicture({ link: secret, picture })).data,
    sendTraces: async (gameId, traces) => {
      await participationApi.recordTraces({ session, gameId, traces });
    },
    withdraw: async (deleteData) => {
      const answer = await participationApi.withdrawFromStudy({ link: secret, deleteData });
      leave();
      presence.value = "open";
      view.value = answer.view;
      forgetDeleted(answer.view);
    },
    open: () => void open(),
    stop: () => {
      stopped = true;
      leave();
    },
  };
}
