// English texts of making and holding a tournament, in tournaments/.

import { plurals } from "../plural";

const plural = plurals("en");

export const organise = {
  title: "Make a tournament",
  link: "Make a tournament…",
  name: "Name of the tournament",
  namePlaceholder: "Spring cup",
  format: "Who plays whom",
  formats: {
    knockout:
      "Tables of four, drawn by lot; the first two of each go on, to a final of four. Short, and somebody wins it.",
    roundRobin: "All meet, as evenly as their number allows. The fairest order, and the most games.",
    swiss: "Some rounds in which those who score alike meet. Nobody is out, and it takes fewer games.",
  },
  players: "Players at a table",
  playersKnockout: "A knockout is for tables of four.",
  rounds: "Rounds",
  roundsHint: "Empty: as many as the format suggests",
  gamesPerPairing: "Games of a table in a round",
  gamesPerPairingHint: "Seats move on by one from game to game.",
  gamesPerPairingRotated: "Here: deals, each of which is played once for each seat.",
  who: "Who takes part",
  builtIn: "Agents of the server",
  builtInHint: "How many of each; 0 for none",
  builtInSum: (count: number) => plural(count, { one: "# agent of the server", other: "# agents of the server" }),
  kinds: "Who may join with the code",
  kind: { people: "People", agents: "Agents", robots: "Robots" },
  maxParticipants: "Participants at most",
  maxParticipantsHint: "2 to 1024, agents of the server included",
  filler: "Agent that fills up",
  fillerHint: "It completes a knockout or a table, and plays for those who do not come.",
  when: "When it begins",
  start: {
    label: "It begins",
    byHand: "when I say so",
    joined: "by itself, at a number of participants",
    byHandHint: "With a button on its page, which only this device has.",
    joinedHint: "As soon as so many have joined.",
  },
  startWhen: "Participants",
  startWhenHint: "Agents of the server included",
  noShow: "Seconds that a game waits for those who are absent",
  noShowHint: "1 to 86400. Then it is called again later.",
  maxCalls: "Calls of a game",
  maxCallsHint: "At the last one it is played without those who do not come.",
  otherClocks: "Other times for agents and robots",
  otherClocksHint: "Programs need seconds, people more.",
  agentSeconds: "Seconds for a decision of an agent",
  robotSeconds: "Seconds for a decision of a robot",
  more: "Deals, rules, faults and watching",
  deals: "How games are dealt",
  dealWords: {
    independent: {
      name: "Each game anew",
      hint: "For people and agents alike.",
    },
    same: {
      name: "All tables of a round alike",
      hint: "Luck with the cards cancels out. Nobody may watch, and replays open when the round is over.",
    },
    rotated: {
      name: "Each deal once for each seat",
      hint: "For agents of the server and agents that declare that they remember nothing. People cannot join.",
    },
  },
  maxParallel: "Games at a time, at most",
  notWatched: "With such deals nobody may watch: the cards of one table would tell those of another.",
  experiment: "For an experiment that is to be repeated",
  drawSeed: "Seed of the draws",
  drawSeedHint: "64 hexadecimal digits; empty: by chance",
  dealSeed: "Seed of the deals",
  dealSeedHint: "Whoever knows it knows the cards, and the games are not rated.",
  problems: {
    nameMissing: "Give it a name.",
    tooMany: "More than 1024 cannot take part.",
    nobody: "Somebody must be allowed to join.",
    notASeed: "These are not 64 hexadecimal digits.",
  },
  submit: "Make the tournament",
  own: {
    title: "You hold this tournament",
    text: "Only this device can begin and close it.",
    invite: "Invite participants",
    agent: "For an agent of the server’s kinds, in a terminal",
    joined: (count: number) => plural(count, { one: "# has joined.", other: "# have joined." }),
    startsAt: (count: number) => `It begins by itself when there are ${count}.`,
    start: "Begin the tournament",
    startText: "Draws the tables and calls the first games. After that nobody can join.",
    filledUp: (field: number, filler: string, more: number) =>
      plural(more, {
        one: `To make ${field}, # agent “${filler}” fills up.`,
        other: `To make ${field}, # agents “${filler}” fill up.`,
      }),
    close: "Close the tournament…",
    closeOpen: "Nobody can join any more, and nothing is played.",
    closePlaying:
      "Games that are being played are aborted; what has been counted stays, and the standings are not final.",
    closeDo: "Close it now",
  },
};
