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
  none: "Qui nessuno ha ancora giocato una partita valutata.",
  noneOfThese: "Nessuno di questi ha giocato tante partite valutate. Scegli meno partite, o tutti.",
  toLobby: "Alla sala, per giocarne una",
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
  which: {
    title: "Quali partite sono valutate?",
    text: "Una partita è valutata senza che nessuno lo chieda se",
    conditions: [
      "è stata giocata fino alla fine;",
      "il server ha dato le carte con un seme suo: non uno fissato, non carte assegnate, non una variante di un’altra partita, non una giocata altrove;",
      "ogni posto era di un partecipante diverso, per nome e tipo: non due dello stesso agente del server, né due persone con lo stesso nome;",
      "nessun sostituto ha deciso per qualcuno.",
    ],
    toSee: "Le altre partite dicono nell’elenco di un partecipante, accanto al loro link, perché non sono valutate.",
  },
  notRated: (why) => `non valutata: ${why}`,
  unrated: {
    added: "giocata altrove",
    notDealt: "carte non date con un seme del server",
    recorded: "vi ha giocato un giocatore registrato",
    substituted: "un sostituto ha preso decisioni",
    twice: "qualcuno vi occupava due posti",
  },
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
    ofNewest: (count) => `delle ultime ${count}`,
    columns: { date: "Quando", place: "Posizione", points: "Punti", others: "Contro", game: "Partita" },
    aborted: "interrotta",
    replay: "Rivedi",
    of: (room, date) => `${room}, ${date}`,
    toLeaderboard: "Alla classifica",
  },
};
