// English texts of tournaments/.

import { plurals } from "../plural";
import { time } from "./time";

const plural = plurals("en");

export const tournaments = {
  title: "Tournaments",
  none: "There is no tournament yet. Make one, send its address to people and agents, and watch the standings here.",
  sections: { open: "Open to join", playing: "Being played", over: "Over", closed: "Closed before their end" },
  states: { open: "open to join", playing: "being played", finished: "finished", closed: "closed early" },
  formats: { knockout: "Knockout", roundRobin: "Round robin", swiss: "Swiss" },
  deals: {
    same: "All tables of a round are dealt alike; what could tell the deals stays closed until the round is over.",
    rotated: "Every table plays each deal once for each seat.",
  },
  participants: (count: number) => plural(count, { one: "# participant", other: "# participants" }),
  made: (date: string) => `made ${date}`,
  gamesOver: (over: number, games: number) => `${over} of ${plural(games, { one: "# game", other: "# games" })} over`,
  roundOf: (round: number, rounds: number) => `round ${round} of ${rounds}`,
  round: (round: number) => `Round ${round}`,
  final: "Final",
  table: (table: number) => `Table ${table}`,
  game: (number: number) => `game ${number}`,
  wall: {
    open: "For a wall",
    close: "Leave the wall view",
    more: (from: number, to: number) => `${from} to ${to}`,
    tables: (from: number, to: number) => `tables ${from} to ${to}`,
  },
  play: {
    beginsAt: (count: number) => `Begins by itself with ${count} participants`,
    beginsByHand: "Begins when its organiser says so",
    knockout: (games: number) =>
      `${plural(games, { one: "# game a round", other: "# games a round" })} at tables of four; the first two go on`,
    rounds: (rounds: number, games: number) =>
      rounds === 0
        ? `As many rounds as suit the number of participants, of ${plural(games, { one: "# game", other: "# games" })} each`
        : `${plural(rounds, { one: "# round", other: "# rounds" })} of ${plural(games, { one: "# game", other: "# games" })}`,
    toPoints: (points: number) => plural(points, { one: "A game goes to # point", other: "A game goes to # points" }),
    shifts: (shifts: number) => plural(shifts, { one: "A game is # Shift", other: "A game is # Shifts" }),
    clock: (decisionMs: number, bankMs: number) =>
      `People have ${time(decisionMs)} for each decision${bankMs > 0 ? ` and ${time(bankMs)} beyond that over a game` : ""}`,
  },
  standings: {
    title: "Standings",
    final: "Final standings",
    place: "Place",
    name: "Name",
    games: "Games",
    score: "Mean score",
    scoreHint: "Points of the rules for the place in a game, on average: they decide the order",
    points: "Points",
    places: "Places",
    placesWords: (places: number[]) => places.map((count, index) => `${count} × place ${index + 1}`).join(", "),
    rating: "Rating",
    ratingHint: "Mean and uncertainty, from the rated games of this tournament",
    round: "Last round",
    forfeited: (count: number) => plural(count, { one: "# forfeited", other: "# forfeited" }),
    byes: (count: number) => plural(count, { one: "# bye", other: "# byes" }),
    filler: "fills up",
    away: "not connected",
    none: "Nobody has joined yet.",
    field: "Who takes part",
  },
  games: {
    title: "Games",
    bracket: "Bracket",
    due: "not yet called",
    playing: "being played",
    over: "over",
    void: "given up",
    watch: "Watch",
    replay: "Replay",
    of: (table: string, number: number) => `${table}, game ${number}`,
    free: "to be decided",
    from: (first: number) => `the first two of table ${first}`,
    forfeited: "did not come",
    advances: "goes on",
    champion: "wins the tournament",
    none: "The tables are drawn when the tournament begins.",
    truncated: (count: number) => `Only the first ${count} games are shown.`,
  },
  confidence: {
    title: "How sure is the order?",
    text: "From the scores so far, for each two who follow one another.",
    pair: (upper: string, lower: string) => `${upper} before ${lower}`,
    grades: {
      certain: "as good as certain",
      likely: "likely",
      leaning: "rather so than not",
      open: "cannot be told yet",
      against: "the scores speak against it",
    },
    percent: (percent: number) => `${percent}%`,
    more: (games: number) =>
      plural(games, {
        one: "about # game more each would settle it",
        other: "about # games more each would settle it",
      }),
  },
  join: {
    title: "Take part",
    text: "You play in the browser. Stay on this page: your games begin here by themselves.",
    code: "Join code of the tournament",
    codeMissing: "Type the code that the organiser gave you.",
    name: "Your name",
    nameHint: "Everybody sees it; nobody else in the tournament may have it.",
    nameMissing: "Say how the others shall call you.",
    submit: "Join the tournament",
    notForPeople: "This tournament is not for people.",
  },
  part: {
    you: (name: string) => `You take part as ${name}.`,
    waitOpen: "Stay on this page. The tournament begins when its organiser says so or when enough have joined.",
    waitNext: "Stay on this page: your next game begins here by itself.",
    over: "The tournament is over. Thank you for playing.",
    connecting: "Connecting…",
    lost: "The connection is lost; trying again…",
    superseded: "You take part in another window.",
    takeBack: "Take part here",
    begins: (place: string) => `Your game begins: ${place}.`,
    back: "Back to the standings",
    place: (round: number, table: number) => `round ${round}, table ${table}`,
    toGame: "To my game",
  },
};
