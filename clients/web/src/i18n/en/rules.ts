// English texts of the rules in short, for the page of rules and for the table's "What can I do?".
// The complete rules are docs/rules.md.

export const rules = {
  title: "The rules in short",
  complete: "These are the default rules. A room can change the deck, the points and some of the options.",
  each: {
    goal: {
      title: "The aim",
      text: "Get rid of your cards first. In a Shift all cards are dealt and played until only one player has cards left; the places earn points.",
    },
    cards: {
      title: "The cards",
      text: "The number on an ingredient is its face. A lower number is rarer and stronger: face 1 exists once, face 2 twice, and so on up to eleven 11s.",
    },
    golden: {
      title: "The Golden card",
      text: "One card of the top face is golden. Its holder opens the Shift. Otherwise it is an ordinary card of its face.",
    },
    jokers: {
      title: "Jokers",
      text: "A joker played with ingredients counts as one more card of their face. A joker alone is the weakest play there is: it can only start a pizza.",
    },
    opening: {
      title: "The first turn of a Shift",
      text: "The holder of the Golden card starts, must play it, alone or with more cards of its face and jokers, and may not pass.",
    },
    leading: {
      title: "Starting a pizza",
      text: "The board is empty: play any number of cards of one face, with or without jokers, or a joker alone. You may also pass.",
    },
    beating: {
      title: "Beating the board",
      text: "Play cards of one face. The face must be lower than the one on the board, and you need at least as many cards. More is fine, and jokers count.",
    },
    passing: {
      title: "Passing",
      text: "You may pass even if you could play. You are then out until this pizza is done, and back for the next one.",
    },
    pizzaDone: {
      title: "When a pizza is done",
      text: "A pizza is done when everybody else has passed. The board is cleared, and the last to play starts the next pizza; if they have no cards left, the next player to the left does.",
    },
    finishing: {
      title: "Finishing",
      text: "A player who plays their last card takes the best place that is still free. The Shift ends when only one player has cards left.",
    },
    roles: {
      title: "Roles",
      text: "Your place in the last Shift is your role in this one: Chef, Sous-Chef, Waiter, Dishwasher; in other numbers of players there are Cooks in between.",
    },
    special: {
      title: "Special actions",
      text: "Anyone dealt both jokers may announce something before the exchange, or keep quiet. As Dishwasher it is a Food Fight: all roles are reversed. For anyone else it is Dinner is Served: no cards are exchanged.",
    },
    exchange: {
      title: "The exchange",
      text: "The Dishwasher gives the Chef their two rarest ingredients and gets any two cards back. The Waiter and the Sous-Chef do the same with one card. Gifts are chosen before anyone sees what they receive.",
    },
    points: {
      title: "Points",
      text: "With four players the places of a Shift earn 5, 3, 1 and 0 points.",
    },
    end: {
      title: "The end of the game",
      text: "The game ends after the Shift in which somebody reaches 15 points. Most points win; if they are equal, the better place in the last Shift decides.",
    },
  },
  help: {
    title: "What can I do?",
    all: "All rules in short",
    keys: "Keys",
    keysOff: "The keys are switched off in the settings.",
    key: {
      faces: (last: number) => (last > 9 ? "1 … 9, 0" : `1 … ${last}`),
      pick: (last: number): string =>
        last > 10
          ? "pick cards of face 1 to 10; higher faces have a letter below their cards. Again: one card more."
          : "pick cards of a face. Again: one card more.",
      addJoker: "adds a joker to the picked cards, or takes the jokers away",
      jokers: "picks a joker alone",
      play: "plays or gives the picked cards",
      pass: "passes",
      special: "declares the special action, or does not",
      back: "puts everything back; Backspace puts back one card",
      express: "goes to the expressions",
      help: "opens this help",
    },
  },
};
