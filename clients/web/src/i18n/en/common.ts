// English texts that several parts of the page use: the frame, kinds of participants, words of the game.

import { ordinals, plurals } from "../plural";

const plural = plurals("en");

export const common = {
  name: "Chef’s Hat",
  skipToContent: "Skip to content",
  nav: {
    label: "Pages",
    lobby: "Lobby",
    tournaments: "Tournaments",
    leaderboard: "Leaderboard",
    tutorial: "Learn to play",
  },
  settings: {
    title: "Settings",
    language: "Language",
    look: "Look",
    looks: { system: "As the system", light: "Light", dark: "Dark" },
    forget: "Forget everything on this device",
    forgetSure:
      "Your seats, places in tournaments, the rooms and tournaments you made, your name and settings? You cannot come back to them.",
    forgetDo: "Forget it",
  },
  kinds: { agent: "agent", human: "person", robot: "robot", builtIn: "built-in agent", open: "free" },
  roles: { chef: "Chef", sousChef: "Sous-Chef", cook: "Cook", waiter: "Waiter", dishwasher: "Dishwasher" },
  faces: [
    "truffle",
    "shrimp",
    "anchovy",
    "artichoke",
    "chilli",
    "basil",
    "olive",
    "pepper",
    "mushroom",
    "tomato",
    "mozzarella",
  ],
  joker: "joker",
  golden: "Golden",
  cards: (count: number) => plural(count, { one: "# card", other: "# cards" }),
  points: (count: number) => plural(count, { one: "# point", other: "# points" }),
  place: ordinals("en", { one: "st", two: "nd", few: "rd", other: "th" }),
  seat: (seat: number) => `Seat ${seat}`,
  close: "Close",
  cancel: "Cancel",
  back: "Back",
  copy: "Copy",
  copied: "Copied",
  loading: "Loading…",
  more: "More",
  showMore: "Show more",
  pageNotLoaded: "This page could not be loaded. Check the connection, then load it again.",
  notFound: { title: "There is no such page", text: "The address names nothing here.", link: "To the lobby" },
};
