// The script of the tutorial: a Shift with small hands in which every decision teaches one rule,
// and the exchange after it. Its events are those of the protocol and are applied by the same model
// as a real game. The texts are in i18n, by the name of the lesson.

import { create, type MessageInitShape } from "@bufbuild/protobuf";
import { DecisionKind } from "../gen/chefshat/v1/decision_pb";
import { type GameEvent, GameEventSchema } from "../gen/chefshat/v1/event_pb";
import { ParticipantKind, ParticipantSchema } from "../gen/chefshat/v1/room_pb";
import { Role } from "../gen/chefshat/v1/rules_pb";
import type { Texts } from "../i18n/texts";
import { type Move, moveOf } from "../table/model/actions";
import { cardsFromNumbers } from "../table/model/cards";
import { emptyTable, type SeatState, seatFromParticipant, type TableState } from "../table/model/state";

type Kind = NonNullable<MessageInitShape<typeof GameEventSchema>["kind"]>;

/** A lesson: its text, the expected decision, and what follows. */
export interface Lesson {
  readonly name: keyof Texts["tutorial"]["lessons"];
  /** The expected decision; without one the reader continues with a button. */
  readonly decision?: { readonly kind: DecisionKind; readonly moves: readonly Move[] };
  /** The events after it, given all actions so far. */
  readonly follows: (actions: readonly number[]) => readonly Kind[];
}

const FACES = 11;
const JOKER = FACES + 1;
const OWN = 0;
const GRETA = 1;
const ROLF = 2;
const GUSTAV = 3;

/** The reader's initial hand. Every seat has as many cards. */
const HAND = [3, 5, 5, 8, 8, 10, 11, 11, JOKER];
/** The hand of the second Shift, before the exchange. */
const SECOND_HAND = [4, 6, 6, 7, 9, 10, 10, 11, 11];
/** The Dishwasher's gift. */
const GIFT = [1, 3];

const play = (seat: number, quantity: number, face: number, cardsLeft: number, jokers = 0): Kind => {
  return { case: "play", value: { seat, face, quantity, jokers, cardsLeft } };
};
const pass = (seat: number): Kind => ({ case: "pass", value: { seat } });
const finished = (seat: number, place: number): Kind => ({ case: "seatFinished", value: { seat, place } });
const done = (pizza: number, lastToPlay: number, nextLeader: number): Kind => {
  return { case: "pizzaDone", value: { pizza, lastToPlay, nextLeader } };
};
const turn = (...moves: Move[]) => ({ kind: DecisionKind.TURN, moves });
const cards = (face: number, quantity: number, jokers = 0): Move => ({ kind: "play", face, quantity, jokers });

/** Any card of the second hand. */
const gifts: readonly Move[] = [...new Set(SECOND_HAND)].map((face) => ({ kind: "give", face }));
/** How many cards the reader gives in the exchange, and to whom. */
export const GIFTS = { total: 2, receiver: GUSTAV } as const;

/** The cards given by these actions. */
export function givenBy(actions: readonly number[]): number[] {
  return actions.flatMap((action) => {
    const move = moveOf(action, FACES);
    return move?.kind === "give" ? move.face : [];
  });
}

export const LESSONS: readonly Lesson[] = [
  { name: "cards", follows: () => [] },
  {
    name: "opening",
    decision: turn(cards(11, 2)),
    follows: () => [play(OWN, 2, 11, 7), play(GRETA, 2, 10, 7), pass(ROLF), play(GUSTAV, 2, 9, 7)],
  },
  {
    name: "beating",
    decision: turn(cards(8, 2)),
    follows: () => [play(OWN, 2, 8, 5), pass(GRETA), pass(GUSTAV), done(1, OWN, OWN)],
  },
  {
    name: "leading",
    decision: turn(cards(10, 1)),
    follows: () => [play(OWN, 1, 10, 4), play(GRETA, 1, 7, 6), play(ROLF, 1, 6, 8), play(GUSTAV, 1, 2, 6)],
  },
  {
    name: "passing",
    decision: turn({ kind: "pass" }),
    follows: () => [pass(OWN), pass(GRETA), pass(ROLF), done(2, GUSTAV, GUSTAV), play(GUSTAV, 2, 6, 4)],
  },
  {
    name: "again",
    decision: turn(cards(5, 2)),
    follows: () => [play(OWN, 2, 5, 2), pass(GRETA), play(ROLF, 2, 4, 6), pass(GUSTAV)],
  },
  {
    name: "joker",
    decision: turn(cards(3, 1, 1)),
    follows: () => [
      play(OWN, 1, 3, 0, 1),
      finished(OWN, 1),
      pass(ROLF),
      done(3, OWN, GRETA),
      play(GRETA, 6, 11, 0),
      finished(GRETA, 2),
      play(ROLF, 6, 9, 0),
      finished(ROLF, 3),
      {
        case: "shiftEnded",
        value: { shift: 1, order: [OWN, GRETA, ROLF, GUSTAV], shiftPoints: [5, 3, 1, 0], points: [5n, 3n, 1n, 0n] },
      },
    ],
  },
  {
    name: "points",
    follows: () => [
      { case: "shiftStarted", value: { shift: 2, hands: [{ seat: OWN, cards: SECOND_HAND, golden: false }] } },
      { case: "rolesAssigned", value: { roles: [Role.CHEF, Role.SOUS_CHEF, Role.WAITER, Role.DISHWASHER] } },
    ],
  },
  { name: "special", follows: () => [] },
  {
    name: "exchange",
    decision: { kind: DecisionKind.EXCHANGE, moves: gifts },
    follows: () => [],
  },
  {
    name: "exchangeAgain",
    decision: { kind: DecisionKind.EXCHANGE, moves: gifts },
    follows: (actions) => [
      { case: "cardsExchanged", value: { giver: GUSTAV, receiver: OWN, count: 2, cards: GIFT } },
      { case: "cardsExchanged", value: { giver: OWN, receiver: GUSTAV, count: 2, cards: givenBy(actions) } },
    ],
  },
  { name: "end", follows: () => [] },
];

/** The table before the first lesson. */
export function firstTable(you: string): TableState {
  const seat = (number: number, name: string, kind: ParticipantKind): SeatState => ({
    ...seatFromParticipant(create(ParticipantSchema, { seat: number, name, kind, reservedFor: kind, connected: true })),
    cardsLeft: HAND.length,
    hand: number === OWN ? cardsFromNumbers(HAND, true, FACES) : undefined,
  });
  const seats = [
    seat(OWN, you, ParticipantKind.HUMAN),
    seat(GRETA, "Greta", ParticipantKind.AGENT),
    seat(ROLF, "Rolf", ParticipantKind.ROBOT),
    seat(GUSTAV, "Gustav", ParticipantKind.HUMAN),
  ];
  return { ...emptyTable(seats), phase: "dealt", shift: 1, played: Array<number>(FACES + 1).fill(0) };
}

/** Creates an event of the script as the next one of a table. */
export function nextEvent(table: TableState, kind: Kind): GameEvent {
  return create(GameEventSchema, { sequence: BigInt(table.nextSequence), kind });
}
