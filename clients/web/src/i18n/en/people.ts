// English texts of people/.

import { plurals } from "../plural";

const plural = plurals("en");

export const people = {
  title: "Leaderboard",
  text: "Everybody who has played a rated game on this server. Who plays chooses a name; names are not protected.",
  ratedGames: (games: number) => plural(games, { one: "# rated game", other: "# rated games" }),
  kinds: { label: "Who", all: "Everybody", human: "People", robot: "Robots", agent: "Agents" },
  minGames: { label: "With at least", games: (games: number) => plural(games, { one: "# game", other: "# games" }) },
  none: "Nobody has played such a rated game yet.",
  columns: {
    place: "Place",
    name: "Name",
    rating: "Rating",
    ratingHint: "The skill as it is believed, ± how far it may be off (95%)",
    games: "Games",
    places: "Places",
    range: (from: string, to: string) => `between ${from} and ${to}`,
  },
  order: "In order of what is at least to be believed of each: the rating less two deviations.",
  person: {
    unrated: "No rated games yet.",
    rated: (place: number) => `Place ${place} of the leaderboard`,
    rating: "Rating",
    ratingRange: (from: string, to: string) => `The skill lies between ${from} and ${to} with 95% confidence.`,
    games: "Games",
    wins: "Won",
    meanPlace: "Mean place",
    sameName: "Names are not protected: these may be games of several who chose the same name.",
    played: "Games played",
    none: "There is no record of a game with this name.",
    newest: (count: number) => `The newest ${count} games are shown.`,
    columns: { date: "When", place: "Place", points: "Points", others: "Against", game: "Game" },
    aborted: "aborted",
    replay: "Replay",
    of: (room: string, date: string) => `${room}, ${date}`,
    toLeaderboard: "To the leaderboard",
    added: "played elsewhere",
  },
};
