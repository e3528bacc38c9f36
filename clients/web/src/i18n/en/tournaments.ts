// English texts of tournaments/.

import { ordinals, plurals } from "../plural";
import { time } from "./time";

const plural = plurals("en");
const th = ordinals("en", { one: "st", two: "nd", few: "rd", other: "th" });

export const tournaments = {
  none: "There is no tournament yet. Create one, send its address to people and agents, and watch the standings here.",
  sections: { open: "Open to join", playing: "In progress", over: "Finished", closed: "Closed early" },
  states: {
    open: "open to join",
    playing: "in progress",
    paused: "paused",
    finished: "finished",
    closed: "closed early",
  },
  formats: { knockout: "Knockout", roundRobin: "Round robin", swiss: "Swiss" },
  deals: {
    same: "All tables of a round get the same deals. Spectating and replays are closed until the round is over.",
    rotated: "Every table plays each deal once per seat.",
  },
  participants: (count: number) => plural(count, { one: "# participant", other: "# participants" }),
  made: (date: string) => `created ${date}`,
  gamesOver: (over: number, games: number) => `${over} of ${plural(games, { one: "# game", other: "# games" })} over`,
  roundOf: (round: number, rounds: number) => `round ${round} of ${rounds}`,
  round: (round: number) => `Round ${round}`,
  final: "Final",
  table: (table: number) => `Table ${table}`,
  game: (number: number) => `game ${number}`,
  wall: {
    open: "Wall view",
    close: "Leave the wall view",
    more: (from: number, to: number) => `${from} to ${to}`,
    tables: (from: number, to: number) => `tables ${from} to ${to}`,
    join: "Scan to join",
    orCode: (host: string) => `or open ${host} and enter`,
  },
  print: "Print",
  results: {
    title: "Results",
    open: "Results and certificates",
    back: "Back to the tournament",
    provisional: (date: string) => `As of ${date}; the tournament is not over.`,
    settings: "How it was played",
    table: "Table",
    game: "Game",
    result: "Result",
    foot: (id: string) => `Chef’s Hat · tournament ${id}`,
  },
  certificate: {
    heading: "Certificates",
    text: "On paper, or as PDF by the dialog that opens. Sign them by hand.",
    all: (count: number) => plural(count, { one: "Print # certificate", other: "Print all # certificates" }),
    of: "Print the certificate of",
    title: "Certificate",
    placed: (place: number, of: number) => `took ${th(place)} place of ${of} in the tournament`,
    tookPart: "took part in the tournament",
    rounds: (count: number) => plural(count, { one: "# round", other: "# rounds" }),
    games: (count: number) => plural(count, { one: "# game played", other: "# games played" }),
    score: (mean: string) => `mean score ${mean}`,
    wins: (count: number) => plural(count, { one: "first in # game", other: "first in # games" }),
    signature: "Signature of the organiser",
  },
  countdown: {
    label: "Starts in",
    due: "Starts as soon as two have joined",
    days: (days: number, clock: string) => `${plural(days, { one: "# day", other: "# days" })} ${clock}`,
  },
  play: {
    beginsAt: (count: number) => `Starts automatically with ${count} participants`,
    beginsByHand: "Starts when the organiser starts it",
    beginsOn: (moment: string) => `Starts on ${moment}`,
    beginsAtOrOn: (count: number, moment: string) => `Starts with ${count} participants, at the latest on ${moment}`,
    knockout: (games: number) =>
      `${plural(games, { one: "# game per round", other: "# games per round" })} at tables of four; the first two advance`,
    rounds: (rounds: number, games: number) =>
      rounds === 0
        ? `As many rounds as the number of participants requires, of ${plural(games, { one: "# game", other: "# games" })} each`
        : `${plural(rounds, { one: "# round", other: "# rounds" })} of ${plural(games, { one: "# game", other: "# games" })}`,
    toPoints: (points: number) => plural(points, { one: "A game goes to # point", other: "A game goes to # points" }),
    shifts: (shifts: number) => plural(shifts, { one: "A game is # Shift", other: "A game is # Shifts" }),
    clock: (decisionMs: number, bankMs: number) =>
      `People have ${time(decisionMs)} per decision${bankMs > 0 ? `, plus ${time(bankMs)} for the whole game` : ""}`,
  },
  standings: {
    title: "Standings",
    final: "Final standings",
    score: "Mean score",
    scoreHint: "Average points for the place in a game. They decide the order",
    placesWords: (places: number[]) => places.map((count, index) => `${count} × place ${index + 1}`).join(", "),
    ratingHint: "Mean and uncertainty, from the rated games of this tournament",
    round: "Last round",
    forfeited: (count: number) => plural(count, { one: "# forfeited", other: "# forfeited" }),
    byes: (count: number) => plural(count, { one: "# bye", other: "# byes" }),
    filler: "filler",
    withdrawn: "left",
    former: (names: string) => `before: ${names}`,
    none: "Nobody has joined yet.",
    field: "Participants",
  },
  games: {
    title: "Games",
    bracket: "Bracket",
    due: "not yet called",
    void: "void",
    of: (table: string, number: number) => `${table}, game ${number}`,
    from: (first: number) => `the first two of table ${first}`,
    forfeited: "did not show up",
    advances: "advances",
    champion: "wins the tournament",
    none: "The tables are drawn when the tournament starts.",
    truncated: (count: number) => `Only the first ${count} games are shown.`,
  },
  confidence: {
    title: "How certain is the order?",
    text: "Estimated from the scores so far, for each pair of neighbours in the standings.",
    pair: (upper: string, lower: string) => `${upper} before ${lower}`,
    grades: {
      certain: "almost certain",
      likely: "likely",
      leaning: "more likely than not",
      open: "not yet clear",
      against: "the scores suggest the opposite",
    },
    percent: (percent: number) => `${percent}%`,
    more: (games: number) =>
      plural(games, {
        one: "about # more game each would settle it",
        other: "about # more games each would settle it",
      }),
  },
  join: {
    title: "Take part",
    text: "You play in the browser. Stay on this page: your games start here automatically.",
    code: "Join code of the tournament",
    codeMissing: "Enter the code that the organiser gave you.",
    nameHint: "Everyone sees it. It must be unique in the tournament.",
    submit: "Join the tournament",
    notForPeople: "People cannot join this tournament.",
  },
  part: {
    you: (name: string) => `You are taking part as ${name}.`,
    waitOpen:
      "Stay on this page. The tournament starts when the organiser starts it or when enough participants have joined.",
    waitNext: "Stay on this page: your next game starts here automatically.",
    waitPaused: "The organiser has paused the tournament. Your next game starts here when it is resumed.",
    postpone: (place: string) => `Postpone my next game (${place})`,
    leave: "Leave the tournament…",
    leaveDo: "Leave it now",
    leaveOpen: "Your place becomes free for others.",
    leavePlaying: "A substitute plays your running game to its end, and you forfeit the others. You cannot come back.",
    left: "You no longer take part in this tournament. Your results so far count.",
    replaced: "Someone else has taken your place in this tournament.",
    over: "The tournament is over. Thank you for playing.",
    superseded: "You are taking part in another window or on another device.",
    takeBack: "Take part here",
    begins: (place: string) => `Your game starts: ${place}.`,
    back: "Back to the standings",
    place: (round: number, table: number) => `round ${round}, table ${table}`,
    toGame: "Go to my game",
    which: {
      title: "Which place do you want to use?",
      text: (held: string, brought: string) =>
        `On this device, ${held} is taking part in this tournament. The link brings the place of ${brought}.`,
      lost: (held: string) =>
        `A device plays for one participant. If you use the link here, this device loses the place of ${held}.`,
      stay: (held: string) => `Continue as ${held}`,
      take: (brought: string) => `Take part as ${brought}`,
    },
  },
};
