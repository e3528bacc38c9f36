// The numbers on the progress board of a study.

import { type Study, type StudyParticipant, StudyParticipantState } from "../gen/chefshat/v1/study_pb";
import type { Texts } from "../i18n/texts";

/** The states in the order of the columns, with their names in the texts. */
const STATES = new Map<StudyParticipantState, keyof Texts["studies"]["own"]["state"]>([
  [StudyParticipantState.INVITED, "invited"],
  [StudyParticipantState.ACTIVE, "active"],
  [StudyParticipantState.COMPLETED, "completed"],
  [StudyParticipantState.WITHDRAWN, "withdrawn"],
  [StudyParticipantState.DROPPED_OUT, "droppedOut"],
  [StudyParticipantState.REMOVED, "removed"],
  [StudyParticipantState.SCREENED_OUT, "screenedOut"],
  [StudyParticipantState.LEFT_OVER, "leftOver"],
]);

/** A state's name in the texts. */
export function stateName(state: StudyParticipantState) {
  return STATES.get(state) ?? "invited";
}

/** The states that participants of a study can have. */
export function statesOf(study: Study): StudyParticipantState[] {
  return [...STATES.keys()].filter((state) => state !== StudyParticipantState.LEFT_OVER || study.settings?.groups);
}

/**
 * The participants in each state, without test participants: of each condition, and last of all
 * (`condition` undefined).
 */
export function byCondition(
  study: Study,
  all: readonly StudyParticipant[],
): { condition: string | undefined; counts: number[] }[] {
  const participants = all.filter(({ test }) => !test);
  const count = (some: readonly StudyParticipant[]) =>
    statesOf(study).map((state) => some.filter((participant) => participant.state === state).length);
  const rows: { condition: string | undefined; counts: number[] }[] = (study.settings?.conditions ?? []).map(
    ({ id }) => ({
      condition: id,
      counts: count(participants.filter(({ conditions }) => conditions.includes(id))),
    }),
  );
  return [...rows, { condition: undefined, counts: count(participants) }];
}
