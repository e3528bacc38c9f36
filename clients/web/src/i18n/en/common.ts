// English texts that several parts of the page use: the frame, kinds of participants, words of the
// game.

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
    theme: "Theme",
    themes: { system: "System", light: "Light", dark: "Dark" },
    forget: "Forget everything on this device",
    forgetSure:
      "This removes your seats, your places in tournaments, the rooms and tournaments you created, your name and your settings from this device. You cannot get them back.",
    forgetDo: "Forget everything",
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
  pageNotLoaded: "This page could not be loaded. Check your connection and reload.",
  notFound: { title: "Page not found", text: "There is nothing at this address.", link: "Go to the lobby" },
};
