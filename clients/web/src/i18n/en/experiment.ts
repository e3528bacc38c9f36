// English texts of experiment/.

import { plurals } from "../plural";
import { time } from "./time";

const plural = plurals("en");

export const experiment = {
  join: {
    title: "You are invited to a study",
    as: (name: string) => `You take part as ${name}.`,
    atSeat: (seat: number) => `Your seat is number ${seat}.`,
    consent: "Before you begin",
    fromHost: "These words come from whoever invited you, not from the makers of this page.",
    agree: "I have read this and agree",
    decline: "I do not agree",
    declined: "You do not take part. Nothing was stored; you can close this page.",
    before: "First a questionnaire",
    beforeText: (host: string) => `It opens in a window of its own, at ${host}. Come back here afterwards.`,
    open: "Open the questionnaire",
    done: "I have filled it in",
    reconsider: "Read it again",
    gone: "This link leads nowhere any more: its room has been closed, or its game is over. Ask whoever sent it to you.",
    taken: (name: string) => `Somebody has sat down with this link on this device already, as ${name}.`,
    goOn: (name: string) => `Go on as ${name}`,
    another: "Take another seat",
    held: (name: string) => `On this device ${name} has a seat in this room already.`,
    oneSeat: (name: string) =>
      `A device has one seat in a room: when somebody else sits down here, the seat of ${name} is given back.`,
    begun: (name: string) => `The game has begun: here only ${name} can go on. Open this link on another device.`,
    giveBack: (name: string, as: string) => `Give the seat of ${name} back and take part as ${as}`,
    seated: (name: string) =>
      `${name} has sat down already. Go on at the device where that was; if it was not you, ask whoever sent you this link.`,
    takenPlace: (name: string) => `Somebody has joined with this link on this device already, as ${name}.`,
    heldPlace: (name: string) => `On this device ${name} takes part in this tournament already.`,
    onePlace: (name: string) =>
      `A device plays for one participant: when somebody else joins here, ${name} can play no more games.`,
    joinAs: (name: string) => `Take part as ${name}`,
    anotherPlace: "Join as somebody else",
    come: { room: "Sit down at the table", tournament: "Join the tournament" },
    recorded: {
      room: "The game is recorded: the name above, your decisions and how long they take, and the expressions you show. Nothing else is.",
      tournament:
        "The games are recorded: the name above, your decisions and how long they take, and the expressions you show. Nothing else is. Stay on this page: your games begin here by themselves.",
    },
    over: "You have taken part in this study",
    timed: "How long you take is measured on this device too and recorded with your decisions.",
  },
  after: {
    title: "Thank you for playing",
    text: (host: string) => `One last thing: a questionnaire at ${host}.`,
    whose: (name: string) => `It is for ${name}.`,
  },
  links: {
    title: "Links for a study",
    text: "A link that fixes who takes part, in which seat and language, and what they see. Everything stands in the link itself; the server keeps none of it.",
    tournamentText:
      "A link that fixes who takes part, in which language, and what they see in every game. Everything stands in the link itself; the server keeps none of it.",
    where: "They play",
    here: "all in this room",
    names: "Participants, one a line",
    namesHint: "Pseudonyms such as P07, or P01-P20 for twenty. Empty: each chooses a name.",
    tooManyNames: (most: number) => `No more than ${most} at a time: the rest is left out.`,
    tooLong: (most: number) => `A name has at most ${most} characters: there are no links for longer ones.`,
    seat: "Seat of the first; the others follow",
    anySeat: "any free seat",
    language: "Language",
    browserLanguage: "of their browser",
    hide: "Leave out at the table",
    hidden: {
      log: "what happened",
      lookup: "what is possible",
      expressions: "expressions",
      played: "cards played in the Shift",
      pages: "ways to other pages",
    },
    times: "Record the time measured at their side too",
    timesHint: "As an annotation of each decision, apart from the server’s own measurement.",
    consent: "Consent text",
    consentHint: "They must agree to it before they sit down. Plain text.",
    consentTournamentHint: "They must agree to it before they join. Plain text.",
    before: "Address of a questionnaire before",
    after: "Address of a questionnaire after",
    beforeHint: "https://…; {name} is filled in if it is fixed.",
    afterHint: "https://…; {name} and {room} are filled in.",
    afterTournamentHint: "Offered when the tournament is over. https://…; {name} and {tournament} are filled in.",
    notAnAddress: "This is no address that begins with https:// or http://.",
    tooMany: (seats: number) =>
      plural(seats, {
        one: "There are more names than seats: # seat is there for them.",
        other: "There are more names than seats: # seats are there for them.",
      }),
    own: {
      label: "each in a room of their own like this one",
      namesHint: "Pseudonyms such as P07, or P01-P20 for twenty: a room is made for each.",
      seat: "Their seat",
      text: "Each room gets the rules, the times and the agents of this one. This device keeps what it needs to close them; their links stay listed here, each with what this form said when its room was made.",
      barred: {
        seed: "This room’s deals are fixed, by a seed that nobody is told: the other rooms are dealt by chance.",
        hands: "This room begins with given hands, which are not known here: no other room can be made like it.",
      },
      wait: "Each room waits",
      waitHint: "If the participant has not come by then, the room is closed and the link leads nowhere.",
      time,
      namesMissing: "Say above who takes part.",
      make: (count: number) => plural(count, { one: "Make # room", other: "Make # rooms" }),
      making: (made: number, all: number) => `${made} of ${all} rooms are made…`,
      keptMade: (made: number, missing: number) =>
        `${made} are made and listed below; ${missing} are still to be made.`,
    },
    copyAll: "Copy all",
    download: "Download as a table (CSV)",
    result: "Links",
    everybody: "everybody",
  },
};
