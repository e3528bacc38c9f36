// English texts of people/.

import { plurals } from "../plural";

const plural = plurals("en");

export const people = {
  title: "Leaderboard",
  text: "Everybody who has played a rated game on this server. Who plays chooses a name; names are not protected.",
  ratedGames: (games: number) => plural(games, { one: "# rated game", other: "# rated games" }),
  kinds: { label: "Who", all: "Everybody", human: "People", robot: "Robots", agent: "Agents" },
  minGames: { label: "With at least", games: (games: number) => plural(games, { one: "# game", other: "# games" }) },
  none: "Nobody has played a rated game here yet.",
  noneOfThese: "Nobody of these has played so many rated games. Choose fewer games, or everybody.",
  toLobby: "To the lobby, to play one",
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
  which: {
    title: "Which games are rated?",
    text: "A game is rated by itself if",
    conditions: [
      "it was played to its end;",
      "the server dealt it by its own seed: none that was fixed, no given hands, no branch of another game, nothing played elsewhere;",
      "every seat was another participant’s, by name and kind: not two of the same agent of the server, nor two people of one name;",
      "no substitute took a decision for anybody.",
    ],
    toSee: "In a participant’s list of games each of the others says why it is not.",
  },
  notRated: (why: string) => `not rated: ${why}`,
  unrated: {
    added: "played elsewhere",
    notDealt: "not dealt by the server’s own seed",
    recorded: "a recorded player took part",
    substituted: "a substitute took decisions",
    twice: "somebody sat in it twice",
  },
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
    ofNewest: (count: number) => `of the newest ${count}`,
    columns: { date: "When", place: "Place", points: "Points", others: "Against", game: "Game" },
    aborted: "aborted",
    replay: "Replay",
    of: (room: string, date: string) => `${room}, ${date}`,
    toLeaderboard: "To the leaderboard",
  },
};
