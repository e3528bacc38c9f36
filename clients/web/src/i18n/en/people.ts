// English texts of people/.

import { plurals } from "../plural";

const plural = plurals("en");

export const people = {
  text: "Everyone who has played a rated game on this server. Players choose their own names; a key tells the same names apart.",
  ratedGames: (games: number) => plural(games, { one: "# rated game", other: "# rated games" }),
  kinds: { label: "Who", all: "Everyone", human: "People", robot: "Robots", agent: "Agents", model: "Language models" },
  minGames: { label: "With at least", games: (games: number) => plural(games, { one: "# game", other: "# games" }) },
  none: "Nobody has played a rated game here yet.",
  noneOfThese: "Nobody matches these filters. Choose fewer games, or everyone.",
  toLobby: "Go to the lobby and play one",
  ratingHint: "Estimated skill, ± its uncertainty (95%)",
  order: "Sorted by a cautious estimate: rating minus two standard deviations.",
  truncated: (count: number) => `Only the first ${count} are shown.`,
  which: {
    title: "Which games are rated?",
    text: "A game is rated automatically if",
    conditions: [
      "everybody can find it: it is neither unlisted nor private;",
      "it was played to the end, or broken off by participants who were away or by its owner, who played in it;",
      "the server dealt it from its own seed: no fixed seed, no prescribed hands, no branch of another game, no game with real cards or played elsewhere;",
      "every seat had a different participant, by name, key and kind: not the same built-in agent twice, nor the same person, no recorded player, and nobody who played as a robot.",
    ],
    losing:
      "A participant who is away at the end, for whom a substitute plays or who is given a hint loses to everybody else, whatever their place. The game stays rated.",
    toSee: "A participant’s list of games says why a game is not rated.",
  },
  notRated: (why: string) => `not rated: ${why}`,
  forfeited: "rated as lost to everyone",
  unrated: {
    added: "played elsewhere",
    hidden: "not public",
    hinted: "someone was given hints",
    notDealt: "not dealt from the server’s own seed",
    recorded: "a recorded player took part",
    substituted: "a substitute took decisions",
    twice: "someone played in two seats",
    wizard: "a person played as a robot",
  },
  fingerprint: (fingerprint: string) => `Key of the name: ${fingerprint}`,
  person: {
    unrated: "No rated games yet.",
    notListed: (lines: number) => `Not among the first ${lines} of the leaderboard.`,
    rated: (place: number) => `Place ${place} on the leaderboard`,
    ratingRange: (from: string, to: string) => `The skill lies between ${from} and ${to} with 95% confidence.`,
    games: "Finished games",
    wins: "Won",
    meanPlace: "Mean place",
    sameName: "A name can have several keys: these may be games of several people who chose the same name.",
    played: "Games played",
    none: "There is no record of a game with this name that you may see.",
    noneOfNewest: "None of the newest games with this name has this key.",
    ofShown: (count: number) => plural(count, { one: "of # game shown", other: "of # games shown" }),
    ofThese: (count: number) => plural(count, { one: "in this game", other: "in these # games" }),
    columns: { date: "When", place: "Place", points: "Points", game: "Game" },
    against: "Against",
    aborted: "aborted",
    of: (room: string, date: string) => `${room}, ${date}`,
    toLeaderboard: "To the leaderboard",
  },
};
