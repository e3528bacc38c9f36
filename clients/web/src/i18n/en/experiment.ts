// English texts of experiment/.

import { plurals } from "../plural";
import { time } from "./time";

const plural = plurals("en");

export const experiment = {
  join: {
    title: "You are invited to a study",
    as: (name: string) => `You are taking part as ${name}.`,
    atSeat: (seat: number) => `Your seat is number ${seat + 1}.`,
    consent: "Before you begin",
    fromHost: "This text comes from the person who invited you, not from the makers of this page.",
    agree: "I have read this and agree",
    decline: "I do not agree",
    declined: "You are not taking part. Nothing was stored; you can close this page.",
    before: "First, a questionnaire",
    beforeText: (host: string) => `It opens in a new window, at ${host}. Come back here when you have finished.`,
    open: "Open the questionnaire",
    done: "I have filled it in",
    reconsider: "Read it again",
    gone: "This link no longer works: the room was closed or the game is over. Ask the person who sent it to you.",
    taken: (name: string) => `Someone has already taken a seat with this link on this device, as ${name}.`,
    goOn: (name: string) => `Continue as ${name}`,
    another: "Take another seat",
    held: (name: string) => `${name} already has a seat in this room on this device.`,
    oneSeat: (name: string) =>
      `A device can hold one seat in a room. If someone else sits down here, ${name}’s seat becomes free.`,
    begun: (name: string) =>
      `The game has started, and only ${name} can continue on this device. Open this link on another device.`,
    giveBack: (name: string, as: string) => `Give up ${name}’s seat and take part as ${as}`,
    seated: (name: string) =>
      `${name} already has a seat. Continue on the device where you sat down; if that was not you, ask the person who sent you this link.`,
    takenPlace: (name: string) => `Someone has already joined with this link on this device, as ${name}.`,
    heldPlace: (name: string) => `${name} is already taking part in this tournament on this device.`,
    onePlace: (name: string) =>
      `A device plays for one participant. If someone else joins here, ${name} cannot play any more games.`,
    joinAs: (name: string) => `Take part as ${name}`,
    anotherPlace: "Join as someone else",
    come: { room: "Sit down at the table", tournament: "Join the tournament" },
    recorded: {
      room: "The game is recorded: the name above, your decisions and how long each takes, and the expressions you show. Nothing else is recorded.",
      tournament:
        "The games are recorded: the name above, your decisions and how long each takes, and the expressions you show. Nothing else is recorded. Stay on this page: your games start here automatically.",
    },
    over: "You have taken part in this study",
    timed: "The time you take is also measured on this device and recorded with your decisions.",
  },
  after: {
    title: "Thank you for playing",
    text: (host: string) => `One last thing: a questionnaire at ${host}.`,
    whose: (name: string) => `It is for ${name}.`,
  },
  links: {
    title: "Links for a study",
    text: "A link that sets who takes part, in which seat and language, and what they see. The link itself contains all of this; the server stores none of it.",
    tournamentText:
      "A link that sets who takes part, in which language, and what they see in every game. The link itself contains all of this; the server stores none of it.",
    hosted:
      "For conditions that the server assigns, recorded consent and built-in questionnaires, create a study instead:",
    where: "Where they play",
    here: "all in this room",
    names: "Participants, one per line",
    namesHint: "Pseudonyms such as P07, or P01-P20 for twenty. If empty, each participant chooses a name.",
    tooManyNames: (most: number) => `At most ${most} at a time; the rest are left out.`,
    tooLong: (most: number) => `A name can have at most ${most} characters; longer names get no link.`,
    seat: "Seat of the first participant; the others follow",
    anySeat: "any free seat",
    language: "Language",
    browserLanguage: "the browser’s",
    hide: "Hide at the table",
    hidden: {
      log: "what happened",
      lookup: "possible plays",
      expressions: "expressions",
      played: "cards played in the Shift",
      pages: "links to other pages",
    },
    times: "Also record the time measured in the browser",
    timesHint: "Stored as an annotation of each decision, beside the server’s own measurement.",
    consent: "Consent text",
    consentHint: "Participants must agree before they sit down. Plain text.",
    consentTournamentHint: "Participants must agree before they join. Plain text.",
    before: "Address of a questionnaire before playing",
    after: "Address of a questionnaire after playing",
    beforeHint: "https://…; {name} is replaced if the link sets a name.",
    afterHint: "https://…; {name} and {room} are replaced.",
    afterTournamentHint: "Shown when the tournament is over. https://…; {name} and {tournament} are replaced.",
    notAnAddress: "Enter an address that begins with https:// or http://.",
    tooMany: (seats: number) =>
      plural(seats, {
        one: "There are more names than seats: only # seat is available.",
        other: "There are more names than seats: only # seats are available.",
      }),
    own: {
      label: "each in a separate room like this one",
      namesHint: "Pseudonyms such as P07, or P01-P20 for twenty: one room is created for each.",
      seat: "Their seat",
      text: "Each room gets the rules, times and agents of this one. This device stores what it needs to close them. Their links stay listed here, each with the settings that this form had when its room was created.",
      barred: {
        seed: "The deals of this room are fixed by a secret seed; the other rooms are dealt at random.",
        real: "This room has a table with real cards, and no second table.",
        hands: "This room starts with prescribed hands, which are not known here, so no room like it can be created.",
      },
      wait: "Each room waits",
      waitHint: "If the participant has not arrived by then, the room is closed and the link stops working.",
      time,
      namesMissing: "Enter the participants above.",
      make: (count: number) => plural(count, { one: "Create # room", other: "Create # rooms" }),
      making: (made: number, all: number) => `Created ${made} of ${all} rooms…`,
      keptMade: (made: number, missing: number) => `${made} created and listed below; ${missing} still to create.`,
    },
    copyAll: "Copy all",
    download: "Download as a table (CSV)",
    result: "Links",
    everybody: "everyone",
  },
};
