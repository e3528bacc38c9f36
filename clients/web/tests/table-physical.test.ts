// The model of a physical table: hands that become known, violations, corrections, pauses.

import { create, type MessageInitShape } from "@bufbuild/protobuf";
import { beforeAll, describe, expect, test } from "vitest";
import { DecisionKind } from "../src/gen/chefshat/v1/decision_pb";
import { DecisionSource, type GameEvent, GameEventSchema } from "../src/gen/chefshat/v1/event_pb";
import { GameOrigin, ParticipantKind, RoomSchema } from "../src/gen/chefshat/v1/room_pb";
import { ViolatedRule } from "../src/gen/chefshat/v1/table_pb";
import { type Language, setLanguage } from "../src/i18n";
import { filmOf } from "../src/replay/frames";
import { applyUpdate, startLive } from "../src/table/model/live";
import { applyEvents } from "../src/table/model/reduce";
import { awaitsHand, type TableState, tableFromRoom } from "../src/table/model/state";
import { spokenLine, violationWords } from "../src/table/words";

type Kind = NonNullable<MessageInitShape<typeof GameEventSchema>["kind"]>;

/** Two people at the table and one remote participant. */
const SEATS = [
  { seat: 0, name: "Ada", kind: ParticipantKind.HUMAN, atTable: true },
  { seat: 1, name: "Bo", kind: ParticipantKind.HUMAN, atTable: true },
  { seat: 2, name: "Cleo", kind: ParticipantKind.AGENT, connected: true },
];
const room = create(RoomSchema, { roomId: "r", gameId: "g", origin: GameOrigin.PHYSICAL, seats: SEATS });
const REMOTE = 2;

/** Events with consecutive numbers from `from`. */
function numbered(kinds: readonly Kind[], from = 1): GameEvent[] {
  return kinds.map((kind, index) => create(GameEventSchema, { sequence: BigInt(from + index), kind }));
}

const plays = (seat: number, face: number, quantity: number, cardsLeft: number): Kind => ({
  case: "play",
  value: { seat, face, quantity, cardsLeft, source: DecisionSource.TABLE },
});
const passes = (seat: number): Kind => ({ case: "pass", value: { seat, source: DecisionSource.TABLE } });
const corrects = (firstVoid: bigint): Kind => ({ case: "correction", value: { firstVoid, text: "Bo laid two 6s" } });
const hand = (cards: number[], golden = false): Kind => ({
  case: "handReported",
  value: { hand: { seat: REMOTE, cards, golden }, dealt: true },
});

const START: Kind[] = [
  { case: "gameStarted", value: { gameId: "g", rules: { faces: 11, jokers: 2 }, seats: SEATS } },
  { case: "shiftStarted", value: { shift: 1 } },
];
const BEGUN: Kind[] = [...START, hand([1, 2, 2]), plays(0, 11, 1, 21), plays(1, 9, 2, 20)];
const tableOf = (kinds: readonly Kind[]): TableState => applyEvents(tableFromRoom(room), numbered(kinds));

beforeAll(() => setLanguage("en"));

describe("a hand", () => {
  test("is awaited by its remote player alone, until it is known", () => {
    const dealt = tableOf(START);
    expect(SEATS.map(({ seat }) => awaitsHand(dealt, seat))).toEqual([false, false, true]);
    expect(awaitsHand(dealt, undefined)).toBe(false);
    const known = tableOf([...START, hand([1, 2, 11], true)]);
    expect(known.seats[REMOTE]?.hand).toEqual([
      { kind: "face", face: 1 },
      { kind: "face", face: 2 },
      { kind: "golden", face: 11 },
    ]);
    expect(awaitsHand(known, REMOTE)).toBe(false);
  });

  test("that the viewer may not see stays hidden, and a known one is not forgotten", () => {
    expect(tableOf([...START, hand([])]).seats[REMOTE]?.hand).toBeUndefined();
    expect(tableOf([...START, hand([1, 2]), hand([])]).seats[REMOTE]?.hand).toHaveLength(2);
  });

  test("is unknown again after a gift of unknown cards", () => {
    const gift: Kind = { case: "cardsExchanged", value: { giver: REMOTE, receiver: 0, count: 1 } };
    expect(tableOf([...START, hand([1, 2]), gift]).seats[REMOTE]).toMatchObject({ hand: undefined, cardsLeft: 21 });
  });
});

describe("a correction", () => {
  const corrected = [...BEGUN, passes(2), corrects(5n)];

  test("rebuilds the table without the void events", () => {
    const table = tableOf(corrected);
    expect(table).toMatchObject({ board: [{ kind: "golden", face: 11 }], next: 1, turn: 2, nextSequence: 8 });
    expect(table.seats[1]).toMatchObject({ lastMove: undefined, cardsLeft: 22 });
    expect(table.seats[REMOTE]).toMatchObject({ passed: false });
    expect(table.log.map(({ entry }) => entry.kind)).toEqual([
      "gameStarted",
      "dealt",
      "handReported",
      "played",
      "corrected",
    ]);
  });

  test("is followed by what replaces them, and leads to the table of a game without the mistake", () => {
    const table = tableOf([...corrected, plays(1, 6, 2, 20)]);
    const right = tableOf([...START, hand([1, 2, 2]), plays(0, 11, 1, 21), plays(1, 6, 2, 20)]);
    const plain = ({ log: _log, nextSequence: _next, history: _history, ...rest }: TableState) => rest;
    expect(plain(table)).toEqual(plain(right));
  });

  test("keeps what happened in the room, and earlier corrections", () => {
    const noise: Kind[] = [
      passes(2),
      { case: "disconnected", value: { seat: REMOTE } },
      { case: "expressionShown", value: { seat: 0, expression: { label: "joy" } } },
      { case: "tablePaused", value: { paused: true } },
      { case: "violation", value: { seat: 0, rule: ViolatedRule.TURN, text: "Not yet." } },
    ];
    const table = tableOf([...BEGUN, ...noise, corrects(6n), passes(2), corrects(5n)]);
    expect(table).toMatchObject({ paused: true, violation: undefined, next: 1 });
    expect(table.seats[REMOTE]).toMatchObject({ connected: false, passed: false });
    expect(table.seats[0]?.expression?.label).toBe("joy");
    expect(table.log.filter(({ entry }) => entry.kind === "corrected")).toHaveLength(2);
  });

  test("of nothing that counts changes only the log", () => {
    const table = tableOf([...BEGUN, corrects(0n)]);
    expect(table.board).toHaveLength(2);
    expect(table.log.at(-1)?.entry).toEqual({ kind: "corrected", text: "Bo laid two 6s" });
  });

  test("reaches back beyond the end of a Shift", () => {
    const end: Kind[] = [
      plays(0, 8, 3, 0),
      { case: "seatFinished", value: { seat: 0, place: 1 } },
      { case: "shiftEnded", value: { shift: 1, order: [0, 1, 2], shiftPoints: [5, 3, 0], points: [5n, 3n, 0n] } },
      { case: "shiftStarted", value: { shift: 2 } },
    ];
    expect(tableOf([...BEGUN, passes(2), ...end])).toMatchObject({ shift: 2 });
    const table = tableOf([...BEGUN, passes(2), ...end, corrects(7n)]);
    expect(table).toMatchObject({ shift: 1, phase: "pizza", results: [] });
    expect(table.seats.map(({ points }) => points)).toEqual([0, 0, 0]);
  });

  test("closes the open decision, which is asked again", () => {
    const update = (kinds: Kind[], from: number) => ({
      $typeName: "chefshat.v1.SeatUpdate" as const,
      handle: 0,
      update: {
        case: "events" as const,
        value: { $typeName: "chefshat.v1.EventBatch" as const, events: numbered(kinds, from) },
      },
    });
    const live = applyUpdate(startLive(tableFromRoom(room), REMOTE), update(BEGUN, 1), 0);
    const decision = {
      id: 1n,
      kind: DecisionKind.TURN,
      legal: [],
      hand: [],
      requirement: undefined,
      gift: undefined,
      special: 0,
      timeLeftMs: 0,
      bankLeftMs: 0,
      receivedAtMs: 0,
      attemptsLeft: undefined,
    };
    expect(applyUpdate({ ...live, decision }, update([corrects(0n)], 6), 0).decision).toBe(decision);
    expect(applyUpdate({ ...live, decision }, update([corrects(5n)], 6), 0).decision).toBeUndefined();
  });

  test("in a record makes nothing void", () => {
    const lines = numbered([...BEGUN, corrects(0n), passes(2)]).map((event) => ({
      $typeName: "chefshat.v1.RecordLine" as const,
      line: { case: "event" as const, value: event },
    }));
    const film = filmOf(lines);
    expect(film.at(film.length - 1).table).toMatchObject({ board: [{ face: 9 }, { face: 9 }], history: undefined });
  });
});

describe("a violation", () => {
  const violates = (rule: ViolatedRule, seat?: number): Kind => ({
    case: "violation",
    value: { rule, text: "The server's sentence.", report: 3n, ...(seat === undefined ? {} : { seat }) },
  });

  test("is shown until a play or pass counts", () => {
    const table = tableOf([...BEGUN, violates(ViolatedRule.FACE, 2)]);
    expect(table.violation?.breach).toMatchObject({ seat: 2, rule: ViolatedRule.FACE });
    expect(spokenLine(table, table.log.at(-1) ?? { sequence: 0, entry: { kind: "aborted" } })).toBe(
      "Cleo is stopped by the referee: The server's sentence.",
    );
    expect(tableOf([...BEGUN, violates(ViolatedRule.FACE, 2), passes(2)]).violation).toBeUndefined();
    expect(tableOf([...BEGUN, violates(ViolatedRule.FACE, 2), corrects(0n)]).violation).toBeUndefined();
  });

  test.each([
    [BEGUN, ViolatedRule.FACE, "Sul piatto ci sono già carte di valore 9: serve un 8 o un numero più basso."],
    [BEGUN, ViolatedRule.SIZE, "Servono almeno 2 carte."],
    [BEGUN, ViolatedRule.TURN, "Non è il suo turno: tocca a Cleo."],
    [START, ViolatedRule.OPENING, "Lo Shift si apre con l’11 d’oro: solo 11 e jolly insieme."],
    [[...BEGUN, plays(2, 1, 2, 20)], ViolatedRule.FACE, "Niente batte il tartufo sul piatto: si può solo passare."],
    [BEGUN, ViolatedRule.CARDS, "The server's sentence."],
  ])("after %# has an Italian sentence where the page can make one", async (before, rule, sentence) => {
    expect(await sentenceIn("it", before, rule)).toBe(sentence);
  });

  test.each([
    [
      "de",
      ViolatedRule.FACE,
      "Auf dem Brett liegen schon Karten mit Wert 9: Nötig ist eine 8 oder eine kleinere Zahl.",
    ],
    ["de", ViolatedRule.TURN, "Falsche Reihenfolge: Cleo ist dran."],
    ["es", ViolatedRule.FACE, "En el tablero ya hay cartas de valor 9: hace falta un 8 o un número más bajo."],
    ["es", ViolatedRule.TURN, "No es su turno: le toca a Cleo."],
  ] as const)("in %s of %i", async (language, rule, sentence) => {
    expect(await sentenceIn(language, BEGUN, rule)).toBe(sentence);
  });

  async function sentenceIn(language: Language, before: Kind[], rule: ViolatedRule) {
    await setLanguage(language);
    const { violation, ...table } = tableOf([...before, violates(rule, 0)]);
    const words = violation && violationWords({ ...table, violation }, violation.breach, violation.demand);
    await setLanguage("en");
    return words;
  }
});

test("the game is paused and resumed", () => {
  const pause = (paused: boolean): Kind => ({ case: "tablePaused", value: { paused } });
  expect(tableOf([...BEGUN, pause(true)]).paused).toBe(true);
  expect(tableOf([...BEGUN, pause(true), pause(false)]).paused).toBe(false);
});
