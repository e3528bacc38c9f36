// English texts of tutorial/.

export const tutorial = {
  you: "Rosa",
  step: (step: number, all: number) => `${step} / ${all}`,
  next: "Continue",
  watch: "The others play…",
  play: "Play a game now",
  notThis: "A good idea for later, but this lesson asks for something else.",
  lessons: {
    cards:
      "Four players, one aim: be the first without cards. The number of a card is its face. The lower it is, the rarer: there is one 1, there are two 2s, and so on up to eleven 11s, and two jokers.",
    opening:
      "You hold the Golden 11, so you open the Shift, and on this turn you must play it. Cards of one face may go together: pick both 11s, then Play.",
    beating:
      "Gustav has played two 9s. To beat them you need a rarer face, a lower number, and at least as many cards. Your two 8s will do.",
    leading:
      "Everyone else has passed, so this pizza is done. The last player who played leads the next one: the board is empty, and any play is allowed. Get rid of your single 10.",
    passing:
      "Gustav’s 2 is very rare, and you hold nothing rarer, so you have to pass. You are out until this pizza is done, and back for the next one.",
    again: "A new pizza. Gustav leads with two 6s. Beat them with your two 5s.",
    joker:
      "Rolf plays two 4s. You have one 3 and a joker. A joker takes the face of the cards it is played with, so together they are two 3s. Play both and you are the first without cards!",
    points:
      "First place earns 5 points, second 3, third 1. The places are also the roles of the next Shift: Chef, Sous-Chef, Waiter, Dishwasher. The game continues until someone has 15 points.",
    special:
      "Now and then someone is dealt both jokers and may declare it: Dinner is Served, and no cards are exchanged; or, as Dishwasher, Food Fight, and all roles are reversed.",
    exchange:
      "Before a Shift, cards are exchanged: the Dishwasher’s two rarest go to the Chef, who gives back any two; the Waiter and the Sous-Chef do the same with one. You are Chef. Which card can you do without?",
    exchangeAgain: "And one more. You see what you receive once everyone has chosen.",
    end: "That is all. The cards you can play are bright, and the page tells you why the others cannot be played. Now sit down at a real table.",
  },
};
