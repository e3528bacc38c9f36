// English texts of creating and running a tournament, in tournaments/.

import { plurals } from "../plural";

const plural = plurals("en");

export const organise = {
  title: "Create a tournament",
  link: "Create a tournament…",
  name: "Name of the tournament",
  namePlaceholder: "Spring cup",
  format: "Who plays whom",
  formats: {
    knockout:
      "Tables of four, drawn at random. The first two of each table advance, up to a final of four. Short, with a clear winner.",
    roundRobin: "Everyone meets everyone, as evenly as the number allows. The fairest ranking, and the most games.",
    swiss:
      "A few rounds in which participants with similar scores meet. Nobody is eliminated, and it takes fewer games.",
  },
  players: "Players per table",
  playersKnockout: "A knockout always has tables of four.",
  rounds: "Rounds",
  roundsHint: "Empty for as many as the format suggests",
  gamesPerPairing: "Games per table and round",
  gamesPerPairingHint: "Seats rotate by one from game to game.",
  gamesPerPairingRotated: "Here, the number of deals; each is played once per seat.",
  who: "Who takes part",
  builtIn: "Built-in agents",
  builtInHint: "How many of each; 0 for none",
  builtInSum: (count: number) => plural(count, { one: "# built-in agent", other: "# built-in agents" }),
  kinds: "Who may join with the code",
  kind: { people: "People", agents: "Agents", robots: "Robots" },
  maxParticipants: "Maximum number of participants",
  maxParticipantsHint: "2 to 1024, including built-in agents",
  filler: "Filler agent",
  fillerHint: "Completes a knockout or a table, and plays for participants who do not show up.",
  when: "When it starts",
  start: {
    label: "It starts",
    byHand: "when I start it",
    joined: "automatically, at a number of participants",
    byHandHint: "With a button on its page that only this device shows.",
    joinedHint: "As soon as this many have joined.",
  },
  startWhen: "Participants",
  startWhenHint: "Including built-in agents",
  noShow: "Seconds a game waits for absent players",
  noShowHint: "1 to 86400. After that, the game is called again later.",
  maxCalls: "Calls per game",
  maxCallsHint: "At the last call, it is played without the missing players.",
  otherClocks: "Different times for agents and robots",
  otherClocksHint: "Programs need seconds, people need longer.",
  agentSeconds: "Seconds per decision of an agent",
  robotSeconds: "Seconds per decision of a robot",
  more: "Deals, rules, errors and spectators",
  deals: "How games are dealt",
  dealWords: {
    independent: {
      name: "A new deal for every game",
      hint: "For people and agents alike.",
    },
    same: {
      name: "The same deals at all tables of a round",
      hint: "The luck of the cards cancels out. Spectators are not allowed, and replays open when the round is over.",
    },
    rotated: {
      name: "Every deal once per seat",
      hint: "For built-in agents and agents that declare themselves stateless. People cannot join.",
    },
  },
  maxParallel: "Maximum number of games at a time",
  notWatched: "Spectators are not allowed with these deals: the cards of one table would reveal those of another.",
  experiment: "For a reproducible experiment",
  drawSeed: "Seed of the pairings",
  drawSeedHint: "64 hexadecimal digits; empty for a random seed",
  dealSeed: "Seed of the deals",
  dealSeedHint: "Anyone who knows it knows the cards; the games are not rated.",
  problems: {
    nameMissing: "Enter a name.",
    tooMany: "At most 1024 can take part.",
    nobody: "Allow at least one kind of participant to join.",
    notASeed: "Enter 64 hexadecimal digits.",
  },
  submit: "Create the tournament",
  own: {
    title: "You are the organiser",
    text: "Only this device can start and close it.",
    invite: "Invite participants",
    agent: "For an agent, in a terminal",
    joined: (count: number) => plural(count, { one: "# has joined.", other: "# have joined." }),
    startsAt: (count: number) => `It starts automatically when ${count} have joined.`,
    start: "Start the tournament",
    startText: "Draws the tables and calls the first games. After that, nobody can join.",
    filledUp: (field: number, filler: string, more: number) =>
      plural(more, {
        one: `# agent “${filler}” is added to make ${field}.`,
        other: `# agents “${filler}” are added to make ${field}.`,
      }),
    tables: {
      title: "Games with real cards",
      text: "Attend to the table on this device. Its page also has the link for another device.",
    },
    close: "Close the tournament…",
    closeOpen: "Nobody will be able to join, and no game will be played.",
    closePlaying: "Running games are aborted. Results so far are kept, and the standings are not final.",
    closeDo: "Close it now",
  },
};
