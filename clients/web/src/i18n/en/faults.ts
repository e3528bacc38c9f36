// What can go wrong in a call, in English: by the server's reason, for reasons that a person at the
// page can meet.

import { time } from "./time";

export const faults = {
  notReached: "The server does not answer. It may be restarting; try again in a moment.",
  unknown: "Something went wrong.",
  tooMuch: "This was too much at once.",
  again: (ms: number) => `Try again in ${time(ms)}.`,
  byReason: {
    TOKEN_MISSING:
      "This server is open to invited people only. Ask its host for a link with a token, and open it here.",
    TOKEN_UNKNOWN:
      "The server does not know the token of your link. Check that you opened the complete link, or ask its host for a new one.",
    TOKEN_EXPIRED: "The token of your link has expired. Ask the server’s host for a new link.",
    ROLE_TOO_LOW: "Your link does not allow this. Ask the server’s host for one that does.",
    OUT_OF_SCOPE: "Your link is for another room or tournament.",
    ROOM_UNKNOWN: "This room no longer exists, or it is private.",
    ROOM_FULL: "All seats of this room are taken.",
    SEAT_TAKEN: "Someone else has just taken this seat.",
    NO_SUCH_SEAT: "This room has no such seat.",
    KIND_NOT_ADMITTED: "The free seats are reserved for other kinds of participants.",
    CLIENT_HAS_SEAT: "You have a seat in this room already, and everyone may take only one.",
    GAME_STARTED: "The game has already started. You can watch it.",
    GAME_OVER: "The game is over.",
    GAME_NOT_STARTED: "The game has not started yet.",
    GAME_NOT_PHYSICAL: "This game is not played with real cards.",
    NO_PHYSICAL_TABLES: "This tournament has no games with real cards, so nobody can be added at a table.",
    NO_SUCH_OPTION: "This question has no such answer, or it was answered already.",
    TOO_MANY_QUESTIONS: "Too many questions are open. Answer them first.",
    TOO_MANY_SEATINGS: "Seats of this room were taken and given up too often. Ask for a new room.",
    TOO_MANY_HELD_REPORTS: "Wait: a question must be answered first. Its answer decides about the reports that wait.",
    NOT_CORRECTABLE: "This report can no longer be corrected.",
    JOIN_CODE_WRONG:
      "This code does not belong to a room or tournament that you can join. Check it; the game may also be over.",
    TICKET_UNKNOWN: "This seat was given up. Join again with the code.",
    SPECTATORS_NOT_ADMITTED: "This room does not allow spectators.",
    TOO_MANY_SPECTATORS: "This room already has as many spectators as it allows.",
    DECISION_CLOSED: "This decision is not open any more.",
    HINTS_OFF: "There are no hints in this room.",
    TOO_MANY_HINTS: "You have had all hints for this decision.",
    TOO_MANY_EXPRESSIONS: "Too many expressions at once. Wait a moment.",
    TOO_MANY_ROOMS:
      "No more rooms can be created now. Close a room that you no longer need, or wait until one is over.",
    TOO_MANY_CALLS: "The server gets too many requests from your network, or with your link.",
    TOO_MANY_CALLS_AT_ONCE: "The server gets too many requests from your network, or with your link.",
    TOO_MANY_UNREAD_ANSWERS: "The server gets too many requests from your network, or with your link.",
    TOO_MANY_WAITING_CALLS:
      "The server gets too many requests from your network, or with your link. Load the page again.",
    TOO_MANY_STREAMS:
      "Too many pages and agents are connected from your network, or with your link. Close some of them.",
    TOO_MANY_FOLLOWERS: "Too many people follow tournaments at the moment.",
    TOO_MANY_WRONG_CODES: "Too many wrong codes were entered. Check the code.",
    READER_TOO_SLOW: "Your connection is too slow to load this game. Try again with a better one.",
    EVENTS_GONE: "The beginning of this game is no longer shown. Its replay is available when it ends.",
    DISK_NEARLY_FULL:
      "The server’s disk is nearly full: no new games can start. Ask its host to free some space. Running games continue.",
    STORE_FAILED:
      "The server cannot store games and is stopping. Your decisions so far are stored; games resume when it is back.",
    OWNER_UNREACHABLE:
      "The server that runs this cannot be reached, or another one is just taking over. Try again in a moment.",
    ROOM_GONE: "This room has just ended, or the server is stopping. Try again in a moment.",
    INTERNAL: "The server failed to do this. Try again; if it fails again, tell the server’s host.",
    SHUTTING_DOWN: "The server is shutting down. Games resume when it is back.",
    GAME_UNKNOWN: "The server has no record of this game, or it is private.",
    GAME_RUNNING: "The game is still running. Its record is available when it ends.",
    SERIES_OPEN: "Other games with the same deals are still running. The record is available when the round is over.",
    TOURNAMENT_UNKNOWN: "This tournament does not exist, or it is private.",
    TOURNAMENT_STARTED: "The tournament has already started.",
    TOO_FEW_PARTICIPANTS: "At least two participants must join before it can start.",
    TOO_MANY_TOURNAMENTS:
      "No more tournaments can be created now. Close one that you no longer need, or wait until one is over.",
    OWNER_TOKEN_WRONG: "Only the device that created it can do this.",
    NOT_STATELESS: "People cannot join: the same deals are played more than once.",
    TOURNAMENT_FULL: "The tournament is full.",
    NAME_REFUSED: "This name is longer than 64 characters or contains invisible characters. Choose another.",
    NAME_RESERVED: "Built-in agents that fill up tables have names like this. Choose another.",
    PARTICIPANT_UNKNOWN: "There is no such participant any more.",
    PARTICIPANT_IS_FILLER: "This agent fills up the tables and cannot leave. You can replace it.",
    REPLACED_TOO_OFTEN: "This place has been given to someone else as often as possible.",
    TOURNAMENT_OVER: "The tournament is over.",
    TOURNAMENT_NOT_PLAYING: "This is only possible while the tournament is in progress.",
    GAME_NOT_DUE: "The game has started or ended in the meantime.",
    NOT_IN_GAME: "You do not play in this game.",
    POSTPONED_TOO_OFTEN: "You have postponed this game as often as possible. Ask the organiser.",
    TOO_MANY_CHANGES: "This tournament has been changed too often.",
    NAME_TAKEN: "Someone else already has this name. Choose another.",
  },
};
