// Italian texts of people/.

import type { Texts } from "../en";
import { plurals } from "../plural";

const plural = plurals("it");

export const people: Texts["people"] = {
  title: "Classifica",
  text: "Tutti coloro che su questo server hanno giocato una partita valutata. Chi gioca sceglie un nome; i nomi non sono protetti.",
  ratedGames: (games) => plural(games, { one: "# partita valutata", other: "# partite valutate" }),
  kinds: { label: "Chi", all: "Tutti", human: "Persone", robot: "Robot", agent: "Agenti" },
  minGames: { label: "Con almeno", games: (games) => plural(games, { one: "# partita", other: "# partite" }) },
  none: "Nessuno ha ancora giocato una partita valutata di questo tipo.",
  columns: {
    place: "Posizione",
    name: "Nome",
    rating: "Valutazione",
    ratingHint: "L’abilità stimata, ± quanto può essere sbagliata (95%)",
    games: "Partite",
    places: "Piazzamenti",
    range: (from, to) => `tra ${from} e ${to}`,
  },
  order: "In ordine di quanto si può credere almeno di ciascuno: la valutazione meno due deviazioni.",
  person: {
    unrated: "Ancora nessuna partita valutata.",
    rated: (place) => `${place}º posto in classifica`,
    rating: "Valutazione",
    ratingRange: (from, to) => `L’abilità è tra ${from} e ${to} con una confidenza del 95%.`,
    games: "Partite",
    wins: "Vinte",
    meanPlace: "Piazzamento medio",
    sameName: "I nomi non sono protetti: queste partite possono essere di più persone con lo stesso nome.",
    played: "Partite giocate",
    none: "Non c’è nessuna partita registrata con questo nome.",
    newest: (count) => `Si vedono le ${count} partite più recenti.`,
    columns: { date: "Quando", place: "Posizione", points: "Punti", others: "Contro", game: "Partita" },
    aborted: "interrotta",
    replay: "Rivedi",
    of: (room, date) => `${room}, ${date}`,
    toLeaderboard: "Alla classifica",
    added: "giocata altrove",
  },
};
