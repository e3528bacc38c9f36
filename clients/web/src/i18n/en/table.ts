// English texts of table/.

import { AbortReason, ParticipantKind } from "../../gen/chefshat/v1/room_pb";
import type { ViolatedRule } from "../../gen/chefshat/v1/table_pb";
import { numerals, plurals } from "../plural";

const plural = plurals("en");
const number = numerals("one two three four five six seven eight nine ten eleven twelve thirteen fourteen fifteen");

/** What the sentence about a violation is made of. */
export interface Breach {
  readonly rule: ViolatedRule;
  /** The server's sentence, in English. */
  readonly text: string;
  /** The highest face of the deck. */
  readonly top: number;
  /** The highest face allowed; `top` on an empty board, 0 if nothing beats the board. */
  readonly highest: number;
  /** The fewest cards allowed. */
  readonly fewest: number;
  /** Whether cards lay on the board. */
  readonly onBoard: boolean;
  /** Whether it was the first turn of a Shift that needs the Golden card. */
  readonly golden: boolean;
  /** The name of the seat whose turn it was; empty if unknown. */
  readonly next: string;
}

export const table = {
  title: "Table",
  heading: {
    waiting: "Waiting for everyone",
    before: (shift: number) => `Shift ${shift} · before the first pizza`,
    turn: (shift: number, pizza: number, turn: number) => `Shift ${shift} · Pizza ${pizza} · Turn ${turn}`,
    shiftOver: (shift: number) => `Shift ${shift} is over`,
    gameOver: "The game is over",
    aborted: "The game was aborted",
  },
  you: "you",
  freeSeat: "free seat",
  pointsWord: (count: number) => plural(count, { one: "point", other: "points" }),
  chips: { toPlay: "to play", toGive: "to give", toDeclare: "to declare?", passed: "passed", played: "played" },
  presence: {
    away: "not connected",
    substituted: (agent: string) => `${agent} stands in`,
  },
  card: {
    face: (face: number, ingredient: string) => `${face}, ${ingredient}`,
    golden: (face: number, ingredient: string) => `Golden ${face}, ${ingredient}`,
    joker: "joker",
    received: "received in the exchange",
  },
  /** Cards in short, as in "three 9s with 2 jokers". */
  play: (quantity: number, face: number, golden: boolean, jokers: number) => {
    const one = golden ? `the Golden ${face}` : `one ${face}`;
    const cards = quantity === 1 ? one : `${number(quantity)} ${face}s${golden ? " (one Golden)" : ""}`;
    return cards + (jokers === 0 ? "" : plural(jokers, { one: " with a joker", other: " with # jokers" }));
  },
  jokers: (count: number) => plural(count, { one: "a joker", other: "# jokers" }),
  board: { label: "Board", empty: "The board is empty", by: (cards: string, name: string) => `${cards} · ${name}` },
  hand: {
    label: "Your hand",
    of: (name: string) => `Hand of ${name}`,
    empty: "No cards left",
    help: "Arrow keys move, the space bar picks a card, Enter plays what is picked, Escape puts everything back.",
    keysHelp: "The number of a card picks it too, p passes, and the question mark shows all keys.",
  },
  log: {
    title: "What happened",
    dealt: (shift: number) => `Cards are dealt for Shift ${shift}`,
    plays: (cards: string) => `plays ${cards}`,
    passes: "passes",
    finishes: (place: string) => `finishes ${place}`,
    pizzaDone: (pizza: number, next: string) => `Pizza ${pizza} is done, ${next} leads`,
    foodFight: "declares Food Fight: all roles are reversed",
    dinner: "declares Dinner is Served: no exchange",
    gives: (what: string, to: string) => `gives ${what} to ${to}`,
    shiftOver: (shift: number, winner: string) => `Shift ${shift} is over, ${winner} finished first`,
    shows: (expression: string) => `shows ${expression}`,
    says: (phrase: string) => `says “${phrase}”`,
    seated: "sits down",
    left: "leaves",
    lost: "loses the connection",
    back: "is back",
    substituted: (agent: string) => `is replaced by ${agent}`,
    restarted: "The server restarted; the game continues",
    gameStarted: "The game starts",
    gameOver: "The game is over",
    aborted: "The game was aborted",
    causes: {
      agent: "",
      timeout: "time ran out",
      invalid: "no valid answer",
      disconnected: "not connected",
      substitute: "by a substitute",
      recorded: "as recorded",
      table: "",
    },
    handReported: (name: string) => `The referee has seen the hand of ${name}`,
    violated: (text: string) => `is stopped by the referee: ${text}`,
    corrected: (text: string) => text || "A misread report was corrected",
    paused: "The game is paused",
    resumed: "The game continues",
  },
  physical: {
    atTable: "at the table",
    paused: "The game is paused at the table.",
    violation: (name: string, text: string) => (name ? `${name}: ${text}` : text),
    handAwaited: "Your cards are on their way",
    handAwaitedText:
      "The attendant shows your cards to the camera or types them in. You see them here as soon as they are known.",
    handUnknown: "This hand is not known.",
  },
  violation: (what: Breach) => what.text,
  now: {
    yourTurn: "Your turn",
    turnOf: (name: string) => `${name} to play`,
    giveOf: (name: string) => `${name} gives a card`,
    declareOf: (name: string) => `${name} may declare`,
    wait: "Waiting for the others",
    awaited: (name: string, seconds: number) => `Waiting for ${name} for ${seconds}\u00a0s`,
    awaitedAway: (name: string, seconds: number | undefined) =>
      seconds === undefined ? `Waiting for ${name} (away)` : `Waiting for ${name} (away): ${seconds}\u00a0s`,
    waitExchange: "The cards have been dealt",
    youGive: "You give a card",
    youGiveOf: (number: number, of: number) => `You give card ${number} of ${of}`,
    youMayDeclare: "You hold both jokers",
    orLower: "or lower",
    cards: "cards",
    openingGolden: "the Golden card must be played",
    openingFace: "no other face",
    anything: "A new pizza: any play.",
    beat: (highest: number, fewest: number) =>
      `${highest}${highest > 1 ? " or lower" : ""}, at least ${plural(fewest, { one: "# card", other: "# cards" })}.`,
    nothing: "Nothing beats this. You have to pass.",
    opens: "Opens the Shift and cannot pass.",
    opensMayPass: "Opens the Shift.",
    giveTo: (name: string) => `Exchange: pick a card for ${name}.`,
    give: "Exchange: pick a card to give.",
    foodFight: "Food Fight would reverse all roles: you would become Chef.",
    dinner: "Dinner is Served would skip the exchange.",
    finished: (place: string) => `You have finished ${place}.`,
    outOfPizza: "You passed and are out until the next pizza.",
  },
  played: { title: "Played in this Shift", allOut: "all played" },
  actions: {
    label: "Your decision",
    play: "Play",
    playCards: (cards: string) => `Play ${cards}`,
    pass: "Pass",
    give: "Give",
    giveCard: (card: string) => `Give ${card}`,
    foodFight: "Food Fight!",
    dinner: "Dinner is Served!",
    decline: "Do not declare",
    putBack: "Put back",
    pick: "Pick cards, or pass.",
    pickMust: "Pick the cards to play.",
    onlyPass: "None of your cards can be played here.",
    autoPassing: "You cannot play here: passing for you…",
    planHint: "It is not your turn. You can already choose what to do then.",
    plan: (cards: string) => (cards ? `Then: ${cards}` : "Then: play"),
    planPass: "Then: pass",
    planned: (what: string) => `Chosen for your turn: ${what}`,
    planOff: (what: string) => `Not possible any more: ${what}. Choose again.`,
    unplan: "Take it back",
    more: (count: number) => plural(count, { one: "Pick one more card.", other: "Pick # more cards." }),
    ready: "Ready to play.",
    hint: "Hint",
    hintComes: "The hint is being computed…",
    suggested: (move: string) => `Suggested: ${move}`,
    points: (points: string, error: string) => `${points} ± ${error} points`,
    sending: "Sending…",
    noPass: "Pick cards: you open and cannot pass.",
    mustPlay: "Nobody has played for a while: you must play.",
  },
  reasons: {
    openingGolden: (face: number) => `Play the Golden ${face}, with ${face}s and jokers only.`,
    openingFace: (face: number) => `The Shift opens with face ${face}: no other face.`,
    notRarer: (face: number, board: number) => `${face} does not beat ${board}: play a lower number.`,
    nothingRarer: "Nothing beats the cards on the board.",
    tooFew: (need: number, have: number) =>
      `You need ${plural(need, { one: "# card", other: "# cards" })} of one face; you have ${have}.`,
    jokerAlone: "A joker alone can only start a pizza.",
    other: "This card cannot be played now.",
    declareFirst: "First decide whether to declare.",
    gift: "This card cannot be given now.",
    notYourTurn: "It is not your turn.",
    notHeld: (face: number | undefined) => (face === undefined ? "You have no joker." : `You have no ${face}.`),
    noJoker: "No joker can go with it.",
    mayNotPass: "You cannot pass now.",
  },
  moments: {
    foodFight: {
      title: (name: string) => `${name}: Food Fight!`,
      text: "All roles are reversed for this Shift: the Dishwasher is now the Chef.",
    },
    dinner: {
      title: (name: string) => `${name}: Dinner is Served!`,
      text: "No cards are exchanged in this Shift.",
    },
    exchange: {
      title: () => "The exchange",
      text: "In the exchange the Dishwasher gives the Chef the best cards and gets others back: the Chef’s privilege.",
    },
    opening: {
      title: (name: string) => `${name} plays the Golden card`,
      text: "It opens the Shift.",
    },
    lastCard: {
      title: (name: string) => `${name} has one card left`,
      text: "A player who plays their last card takes the best free place.",
    },
  },
  clock: {
    label: "Time",
    bank: (time: string) => `+ ${time} reserve`,
    onBank: "from the reserve",
    hurry: (seconds: number) => `${seconds} seconds left.`,
  },
  expressions: {
    label: "Show how you feel",
    words: {
      joy: "joy",
      amusement: "amusement",
      surprise: "surprise",
      concentration: "concentration",
      annoyance: "annoyance",
      sadness: "sadness",
    },
    say: "Say something",
    ownWords: "Your own words",
    sayIt: "Say it",
    phrases: {
      "good-luck": "Good luck!",
      "well-played": "Well played!",
      thanks: "Thank you!",
      "so-close": "That was close!",
      oops: "Oops!",
      sorry: "Sorry!",
      thinking: "Let me think…",
      "good-game": "Good game!",
    },
  },
  tools: {
    label: "Tools",
    soundOn: "Sound is on",
    soundOff: "Sound is off",
  },
  lookup: {
    title: "Possible plays",
    caption: "Every play by face, number of cards and jokers",
    legal: "legal",
    notInHand: "allowed, but not in this hand",
    notAllowed: "in this hand, but not allowed now",
    impossible: "neither",
    face: "face",
    loneJoker: "a joker alone",
    pass: "pass",
    count: (count: number) => plural(count, { one: "# legal action", other: "# legal actions" }),
    chosen: "taken",
    groups: "Rows: faces. Columns: cards of the face; within each column without a joker, with one, with two.",
    signs: "Key",
    none: "It is not your turn. This table is shown on your turns.",
  },
  aborted: {
    [AbortReason.UNSPECIFIED]: "It has no result.",
    [AbortReason.CLOSED]: "The room was closed by its owner.",
    [AbortReason.SHUTDOWN]: "The server was shut down.",
    [AbortReason.PARTICIPANTS_LOST]: "Too many participants lost their connection.",
    [AbortReason.NEVER_STARTED]: "Not all seats were taken in time.",
    [AbortReason.TOO_LONG]: "The game became longer than the server can store.",
  },
  result: {
    shift: (shift: number) => `Shift ${shift}`,
    game: "Final standings",
    total: "Total",
    curve: "Points of the game after each Shift, a line for each seat",
    adjudicated: "Ended by the turn limit.",
    replay: "Watch the replay",
    youWon: "You won!",
    wins: (name: string) => `${name} won`,
  },
  answers: {
    notLegal: "This action is illegal. Choose again.",
    notLegalLeft: (attempts: number) =>
      attempts === 0
        ? "This action is illegal. The default decision was taken for you."
        : plural(attempts, {
            one: "This action is illegal. Choose again: # attempt left.",
            other: "This action is illegal. Choose again: # attempts left.",
          }),
    closed: "Too late: this has already been decided.",
    unknownDecision: "The game has moved on. Reload the page if nothing changes.",
  },
  link: {
    lost: "Connection lost. Reconnecting…",
    superseded: "This seat is in use in another window or on another device.",
    takeBack: "Play here",
    substituted: "You were away: a built-in agent plays for you.",
    resume: "I am back",
    refused: "The seat could not be taken.",
  },
  room: {
    seats: "Seats",
    waiting: (count: number) => plural(count, { one: "# seat is still free", other: "# seats are still free" }),
    away: (count: number) => plural(count, { one: "# still has to connect", other: "# still have to connect" }),
    begins: "The game starts as soon as all seats are taken and connected.",
    ready: "ready",
    here: "connected",
    notHere: "seated, but not connected",
    waitsFor: {
      [ParticipantKind.UNSPECIFIED]: "waiting for anyone: a person, a robot, an agent or a language model",
      [ParticipantKind.HUMAN]: "waiting for a person",
      [ParticipantKind.ROBOT]: "waiting for a robot",
      [ParticipantKind.AGENT]: "waiting for an agent",
      [ParticipantKind.MODEL]: "waiting for a language model",
    },
    ways: "How others join",
    invited: "The creator of the room invites the others with an address or a join code.",
    assigned: "The tournament assigns the seats. Nobody else can join.",
    byCode: "Anyone with a join code can take a free seat.",
    toJoin: "I have a join code",
    invite: "The invitation is below.",
  },
  watch: {
    viewer: "spectator view",
    spectators: (count: number) => plural(count, { one: "# spectator", other: "# spectators" }),
  },
};
