// The numbers on the progress board of a study.

import { type Study, type StudyParticipant, StudyParticipantState } from "../gen/chefshat/v1/study_pb";

/** The states in the order of the columns. */
const STATES = [
  StudyParticipantState.INVITED,
  StudyParticipantState.ACTIVE,
  StudyParticipantState.COMPLETED,
  StudyParticipantState.WITHDRAWN,
  StudyParticipantState.DROPPED_OUT,
  StudyParticipantState.REMOVED,
  StudyParticipantState.SCREENED_OUT,
  StudyParticipantState.LEFT_OVER,
] as const;

/** A state's name in the texts. */
export function stateName(state: StudyParticipantState) {
  switch (state) {
    case StudyParticipantState.ACTIVE:
      return "active";
    case StudyParticipantState.COMPLETED:
      return "completed";
    case StudyParticipantState.WITHDRAWN:
      return "withdrawn";
    case StudyParticipantState.DROPPED_OUT:
      return "droppedOut";
    case StudyParticipantState.REMOVED:
      return "removed";
    case StudyParticipantState.SCREENED_OUT:
      return "screenedOut";
    case StudyParticipantState.LEFT_OVER:
      return "leftOver";
    default:
      return "invited";
  }
}

/** The states that participants of a study can have. */
export function statesOf(study: Study): StudyParticipantState[] {
  return STATES.filter((state) => state !== StudyParticipantState.LEFT_OVER || study.settings?.groups);
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
