// States of a physical table as its server sends them, for the tests of the attendant's view, and a decision at a table.

import { create, type MessageInitShape } from "@bufbuild/protobuf";
import { DecisionKind } from "../src/gen/chefshat/v1/decision_pb";
import { GameOrigin, ParticipantKind } from "../src/gen/chefshat/v1/room_pb";
import { SpecialAction } from "../src/gen/chefshat/v1/rules_pb";
import { TableStage, type TableState, TableStateSchema } from "../src/gen/chefshat/v1/table_service_pb";
import type { Card } from "../src/table/model/cards";
import type { OpenDecision } from "../src/table/model/live";

const bytes = (...counts: number[]) => Uint8Array.from(counts);

/** Ada and Bo at the table, Cleo remote, Dan the robot at the table. */
export const SEATS = [
  { seat: 0, name: "Ada", kind: ParticipantKind.HUMAN, atTable: true },
  { seat: 1, name: "Bo", kind: ParticipantKind.HUMAN, atTable: true },
  { seat: 2, name: "Cleo", kind: ParticipantKind.HUMAN, connected: true },
  { seat: 3, name: "Dan", kind: ParticipantKind.ROBOT, atTable: true },
];

/** What is public at the third turn of the first Shift: two 9s and a joker lie there. */
export const OBSERVATION = {
  shift: 1,
  pizza: 1,
  boardFace: 9,
  boardSize: 3,
  boardJokers: 1,
  cardsLeft: bytes(16, 14, 17, 17),
  passed: bytes(0, 0, 0, 1),
  places: bytes(0, 0, 0, 0),
  roles: bytes(0, 0, 0, 0),
  points: [0n, 0n, 0n, 0n],
  played: bytes(0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 1, 1),
};

/** What is public before the first turn of a Shift. */
export const DEALT = {
  ...OBSERVATION,
  pizza: 1,
  boardFace: 0,
  boardSize: 0,
  boardJokers: 0,
  cardsLeft: bytes(17, 17, 17, 17),
  passed: bytes(0, 0, 0, 0),
  played: new Uint8Array(12),
};

/** A table that waits for Ada's turn, unless it is changed. */
export function stateOf(changed: MessageInitShape<typeof TableStateSchema> = {}): TableState {
  const usual: MessageInitShape<typeof TableStateSchema> = {
    version: 1n,
    room: {
      roomId: "r1",
      gameId: "g1",
      name: "Friday evening",
      origin: GameOrigin.PHYSICAL,
      rules: { players: 4, faces: 11, jokers: 2, exchange: true, specialActions: true },
      seats: SEATS,
    },
    stage: TableStage.TURN,
    seat: 0,
    waitingFor: "It is Ada's turn.",
    observation: OBSERVATION,
    playRequirement: { lowestFace: 1, highestFace: 8, fewestCards: 3, mayPass: true },
    seats: SEATS.map(({ seat, atTable = false }) => ({ atTable, handKnown: seat === 2 })),
  };
  return create(TableStateSchema, { ...usual, ...changed } as typeof usual);
}

/** An open turn of a seat with these cards, unless it is changed. */
export function decisionOf(
  hand: readonly Card[],
  legal: readonly number[],
  changed: Partial<OpenDecision> = {},
): OpenDecision {
  return {
    id: 7n,
    kind: DecisionKind.TURN,
    legal,
    hand,
    requirement: undefined,
    gift: undefined,
    special: SpecialAction.UNSPECIFIED,
    timeLeftMs: 0,
    bankLeftMs: 0,
    receivedAtMs: 0,
    attemptsLeft: undefined,
    ...changed,
  };
}
