// A study on a fake server: its views follow each other when the participant acts.

import { create, type MessageInitShape } from "@bufbuild/protobuf";
import { ConnectError } from "@connectrpc/connect";
import { vi } from "vitest";
import { StudyEndReason, type StudyItemAnswer, type StudyView, StudyViewSchema } from "../src/gen/chefshat/v1/study_pb";
import {
  AnswerQuestionnaireResponseSchema,
  ContinueStudyResponseSchema,
  FollowParticipationResponseSchema,
  GiveConsentResponseSchema,
  OpenStudyResponseSchema,
  RecordTracesResponseSchema,
  SaveAnswersRequestSchema,
  SaveAnswersResponseSchema,
  WithdrawFromStudyResponseSchema,
} from "../src/gen/chefshat/v1/study_service_pb";
import { participationApi } from "../src/studies/client";

type Content = MessageInitShape<typeof StudyViewSchema>["content"];

/** A view of a study with these stages. */
export function viewOf(stages: readonly NonNullable<Content>[], step: number, traces = false): StudyView {
  const end = { case: "end" as const, value: { reason: StudyEndReason.COMPLETED } };
  return create(StudyViewSchema, {
    title: "Cooking together",
    language: "en",
    pseudonym: "P07",
    step,
    steps: stages.length,
    traces,
    content: stages[step] ?? end,
  });
}

/** Replaces the calls of participants; what the page sent is in `sent`. */
export function fakeStudy(stages: readonly NonNullable<Content>[], options: { traces?: boolean } = {}) {
  const state = { step: 0, session: 0, savedAnswers: [] as StudyItemAnswer[], stepAgeMs: 0n };
  const view = () => viewOf(stages, state.step, options.traces);
  const sent: { call: string; request: object }[] = [];
  const streams: { push: (next: StudyView) => void; fail: (why: ConnectError) => void }[] = [];
  const next = (call: string) => async (request: object) => {
    sent.push({ call, request });
    state.step += 1;
    return { view: view() };
  };
  vi.spyOn(participationApi, "openStudy").mockImplementation(async (request) => {
    sent.push({ call: "open", request });
    state.session += 1;
    const { savedAnswers, stepAgeMs } = state;
    return create(OpenStudyResponseSchema, {
      session: `session ${state.session}`,
      view: view(),
      savedAnswers,
      stepAgeMs,
    });
  });
  vi.spyOn(participationApi, "followParticipation").mockImplementation(async function* () {
    const waiting: (StudyView | ConnectError)[] = [];
    let wake = () => {};
    const add = (one: StudyView | ConnectError) => {
      waiting.push(one);
      wake();
    };
    streams.push({ push: add, fail: add });
    for (;;) {
      for (let one = waiting.shift(); one; one = waiting.shift()) {
        if (one instanceof ConnectError) throw one;
        yield create(FollowParticipationResponseSchema, { view: one });
      }
      await new Promise<void>((resolve) => {
        wake = resolve;
      });
    }
  });
  const consent = next("consent");
  vi.spyOn(participationApi, "giveConsent").mockImplementation(async (request) =>
    create(GiveConsentResponseSchema, await consent(request)),
  );
  const answer = next("answer");
  vi.spyOn(participationApi, "answerQuestionnaire").mockImplementation(async (request) =>
    create(AnswerQuestionnaireResponseSchema, await answer(request)),
  );
  vi.spyOn(participationApi, "saveAnswers").mockImplementation(async (request) => {
    sent.push({ call: "save", request });
    state.savedAnswers = create(SaveAnswersRequestSchema, request).answers;
    return create(SaveAnswersResponseSchema);
  });
  const proceed = next("continue");
  vi.spyOn(participationApi, "continueStudy").mockImplementation(async (request) =>
    create(ContinueStudyResponseSchema, await proceed(request)),
  );
  vi.spyOn(participationApi, "recordTraces").mockImplementation(async (request) => {
    sent.push({ call: "traces", request });
    return create(RecordTracesResponseSchema);
  });
  vi.spyOn(participationApi, "withdrawFromStudy").mockImplementation(async (request) => {
    sent.push({ call: "withdraw", request });
    const reason = request.deleteData ? StudyEndReason.DATA_DELETED : StudyEndReason.WITHDRAWN;
    const { title, language, step, steps } = view();
    const over = create(StudyViewSchema, {
      ...{ title, language, step, steps },
      content: { case: "end", value: { reason } },
    });
    return create(WithdrawFromStudyResponseSchema, { view: over });
  });
  return { sent, streams, state, view };
}
