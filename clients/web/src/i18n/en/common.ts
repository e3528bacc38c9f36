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
    table: {
      title: "At the table",
      names: {
        notification: "Notify me on my turn",
        tab: "Show my turn in the browser’s tab",
        vibration: "Vibrate on my turn",
        awake: "Keep the screen on",
        keys: "Keys for cards, passing and playing",
        plans: "Let me choose before my turn",
        autoPass: "Pass for me when nothing can be played",
        moments: "Show special moments in large",
      },
      hints: {
        notification: "While you look at something else. Your browser asks you first.",
        tab: "In its title and its icon.",
        vibration: "On devices that can.",
        awake: "During a game.",
        keys: "9 and Enter play a 9, p passes. The question mark shows them all.",
        plans: "It is played on your turn, unless it has become illegal.",
        autoPass: "After a pause like your own, so that it tells the others nothing. Not in studies.",
        moments: "Food Fight, Dinner is Served, the exchange, the Golden card, a last card.",
      },
      notAllowed:
        "Your browser does not allow notifications from this page. You can change that in the browser’s settings.",
    },
    names: {
      key: "Your identity key",
      hint: "Others can choose your name, but they do not have your key, so leaderboards list you separately. The key is created when you first join a game. Enter it on another device to be the same person there, and show it to nobody else.",
      notAKey: "A key has 64 digits from 0 to 9 and a to f.",
      use: "Use this key",
      replaces:
        "This device then plays as the person of the new key. Copy the former key first if you want to be that person again.",
    },
    measuring: "The connection is being measured…",
    lag: (ms: number) => `The server answers after ${ms}\u00a0ms.`,
    fullScreen: "Full screen",
    fullScreenOff: "Leave full screen",
    forget: "Forget everything on this device",
    forgetSure:
      "This removes your seats, your places in tournaments, the rooms and tournaments you created, your name with its key, and your settings from this device. You cannot get them back.",
    forgetDo: "Forget everything",
  },
  kinds: { agent: "agent", human: "person", robot: "robot", model: "model", builtIn: "built-in agent", open: "free" },
  /** How built-in agents with names of their own play. */
  characters: {
    trained: "experienced",
    greedy: "hasty",
    random: "on a whim",
    random_unmasked: "without looking",
    monte_carlo: "thoughtful",
  } as Record<string, string>,
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
  cards: (count: number) => plural(count, { one: "# card", other: "# cards" }),
  points: (count: number) => plural(count, { one: "# point", other: "# points" }),
  place: ordinals("en", { one: "st", two: "nd", few: "rd", other: "th" }),
  seat: (seat: number) => `Seat ${seat + 1}`,
  /** Headings of tables. */
  columns: {
    place: "Place",
    name: "Name",
    games: "Games",
    points: "Points",
    places: "Places",
    rating: "Rating",
  },
  close: "Close",
  cancel: "Cancel",
  changedMeanwhile: (before: string, now: string) =>
    `Nothing was done: ${now} has taken the place of ${before} in the meantime.`,
  copy: "Copy",
  copied: "Copied",
  loading: "Loading…",
  showMore: "Show more",
  toLobby: "Go to the lobby",
  pageNotLoaded: "This page could not be loaded. Check your connection and reload.",
  outdated: {
    text: "The server has been updated, and this page is the old version. Your seats and games stay as they are when you load the new one.",
    load: "Load the new version",
  },
  pageBroken: {
    title: "This page has met an error",
    text: "An error of the page itself, not of your connection. Your seat and everything at the table are kept.",
    reload: "Reload",
  },
  notFound: { title: "Page not found", text: "There is nothing at this address." },
};
