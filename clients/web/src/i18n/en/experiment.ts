// English texts of experiment/.

import { plurals } from "../plural";

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
    taken: (name: string) => `Somebody has sat down with this link on this device already, as ${name}.`,
    goOn: (name: string) => `Go on as ${name}`,
    another: "Take another seat",
    sitDown: "Sit down at the table",
    recorded:
      "The game is recorded: the name above, your decisions and how long they take, and the expressions you show. Nothing else is.",
    timed: "How long you take is measured on this device too and recorded with your decisions.",
  },
  after: {
    title: "Thank you for playing",
    text: (host: string) => `One last thing: a questionnaire at ${host}.`,
  },
  links: {
    title: "Links for a study",
    text: "A link that fixes who takes part, in which seat and language, and what they see. Everything stands in the link itself; the server keeps none of it.",
    names: "Participants, one a line",
    namesHint: "Pseudonyms such as P07. Empty: each chooses a name.",
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
    before: "Address of a questionnaire before",
    after: "Address of a questionnaire after",
    beforeHint: "https://…; {name} is filled in if it is fixed.",
    afterHint: "https://…; {name} and {room} are filled in.",
    notAnAddress: "This is no address that begins with https:// or http://.",
    tooMany: (seats: number) =>
      plural(seats, {
        one: "There are more names than seats: # seat is there for them.",
        other: "There are more names than seats: # seats are there for them.",
      }),
    result: "Links",
    everybody: "everybody",
  },
};
