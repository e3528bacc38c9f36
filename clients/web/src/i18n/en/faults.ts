// What can go wrong in a call, in English: by the server's reason, for reasons that a person at the page can meet.

export const faults = {
  notReached: "The server does not answer. It may be starting again; try in a moment.",
  unknown: "Something went wrong.",
  byReason: {
    ROOM_UNKNOWN: "There is no such room any more.",
    ROOM_FULL: "All seats of this room are taken.",
    SEAT_TAKEN: "Somebody else has just taken this seat.",
    NO_SUCH_SEAT: "This room has no such seat.",
    KIND_NOT_ADMITTED: "The free seats are kept for other kinds of participants.",
    GAME_STARTED: "The game has begun already. You can watch it.",
    GAME_OVER: "The game is over.",
    JOIN_CODE_WRONG:
      "No room or tournament that can be joined has this code. Look at it again; or it is over, and its code with it.",
    TICKET_UNKNOWN: "The seat has been given up. Join again with the code.",
    SPECTATORS_NOT_ADMITTED: "Nobody may watch this room.",
    TOO_MANY_SPECTATORS: "Too many are watching this room already.",
    TOO_MANY_EXPRESSIONS: "That was a lot of expressions. Wait a little.",
    TOO_MANY_ROOMS: "The server has as many rooms as it can hold. Try later.",
    SHUTTING_DOWN: "The server is shutting down. Games go on when it is back.",
    GAME_UNKNOWN: "The server has no record of this game.",
    GAME_RUNNING: "The game is still being played; its record comes when it has ended.",
    SERIES_OPEN: "Other games with the same deals are still being played; the record comes when the round is over.",
    TOURNAMENT_UNKNOWN: "There is no such tournament.",
    TOURNAMENT_STARTED: "The tournament has begun already.",
    TOO_FEW_PARTICIPANTS: "At least two must have joined before it can begin.",
    TOO_MANY_TOURNAMENTS: "The server has as many tournaments as it can hold. Try when some are over.",
    OWNER_TOKEN_WRONG: "Only the device that made this can do that.",
    NOT_STATELESS: "This tournament is not for people: its deals come up again.",
    TOURNAMENT_FULL: "The tournament is full.",
    NAME_TAKEN: "Somebody else has this name already. Choose another.",
  },
};
