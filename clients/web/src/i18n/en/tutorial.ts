// English texts of tutorial/.

export const tutorial = {
  title: "Learn to play",
  you: "Rosa",
  step: (step: number, all: number) => `${step} / ${all}`,
  next: "Go on",
  watch: "The others play…",
  play: "Play a game now",
  toLobby: "To the lobby",
  notThis: "Good idea for later; the lesson asks for something else now.",
  lessons: {
    cards:
      "Four players, one aim: be the first without cards. The number of a card is its face. The lower it is, the rarer: there is one 1, there are two 2s, and so on up to eleven 11s, and two jokers.",
    opening:
      "You hold the Golden 11, so you open the Shift, and on this turn you must play it. Cards of one face may go together: pick both 11s, then Play.",
    beating:
      "Gustav has put down two 9s. To beat them you need a rarer face, a lower number, and at least as many cards. Your two 8s will do.",
    leading:
      "Everybody else has passed: this pizza is done. Who played last leads the next one, on an empty board, with whatever they like. Get rid of your single 10.",
    passing:
      "Gustav's 2 is very rare, and you hold nothing rarer. Then you pass. You are out until this pizza is done, and back for the next one.",
    again: "A new pizza. Gustav leads with two 6s. Beat them with your two 5s.",
    joker:
      "Rolf's two 4s. You have one 3 and a joker: a joker takes the face of the cards it is played with. Together they are two 3s. Play both and you are out of cards, first of all!",
    points:
      "First place brings 5 points, second 3, third 1. The places are also the roles of the next Shift: Chef, Sous-Chef, Waiter, Dishwasher. The game goes on until somebody has 15 points.",
    special:
      "Now and then somebody is dealt both jokers and may declare it: Dinner is Served, and nobody gives cards away; or, as Dishwasher, Food Fight, and all roles turn around.",
    exchange:
      "Before a Shift cards are given: the Dishwasher's two rarest go to the Chef, who gives back any two; the Waiter and the Sous-Chef do the same with one. You are Chef. Which card can you do without?",
    exchangeAgain: "And one more. What you receive you see when everybody has chosen.",
    end: "That is all. What you may play is always bright, and the page tells you why the rest is not. Have a seat at a real table.",
  },
};
