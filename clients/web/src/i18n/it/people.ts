// Italian texts of people/.

import { plurals } from "../plural";
import type { Texts } from "../texts";

const plural = plurals("it");

export const people: Texts["people"] = {
  text: "Chiunque abbia giocato una partita valutata su questo server. Ognuno sceglie il proprio nome; una chiave distingue i nomi uguali.",
  ratedGames: (games) => plural(games, { one: "# partita valutata", other: "# partite valutate" }),
  kinds: {
    label: "Chi",
    all: "Tutti",
    human: "Persone",
    robot: "Robot",
    agent: "Agenti",
    model: "Modelli linguistici",
  },
  minGames: { label: "Con almeno", games: (games) => plural(games, { one: "# partita", other: "# partite" }) },
  none: "Qui nessuno ha ancora giocato una partita valutata.",
  noneOfThese: "Nessuno corrisponde a questi filtri. Scegli meno partite, o tutti.",
  toLobby: "Vai alla sala e giocane una",
  ratingHint: "Abilità stimata, ± la sua incertezza (95%)",
  order: "Ordine secondo una stima prudente: valutazione meno due deviazioni standard.",
  truncated: (count) => `Si vedono solo i primi ${count}.`,
  which: {
    title: "Quali partite sono valutate?",
    text: "Una partita è valutata automaticamente se",
    conditions: [
      "tutti possono trovarla: è in elenco e non su invito;",
      "è stata giocata fino alla fine, o interrotta da partecipanti assenti o dal proprietario che vi giocava;",
      "il server ha distribuito le carte con un proprio seme: nessun seme fissato, nessuna mano prestabilita, nessuna variante di un’altra partita, nessuna partita con carte vere o giocata altrove;",
      "ogni posto aveva un partecipante diverso, per nome, chiave e tipo: non due volte lo stesso agente integrato, né la stessa persona, nessun giocatore registrato e nessuno che giocasse come robot.",
    ],
    losing:
      "Chi alla fine è assente, ha un sostituto o riceve un suggerimento perde contro tutti gli altri, qualunque sia il suo posto. La partita resta valutata.",
    toSee: "L’elenco delle partite di un partecipante dice perché una partita non è valutata.",
  },
  notRated: (why) => `non valutata: ${why}`,
  forfeited: "valutata come persa contro tutti",
  unrated: {
    added: "giocata altrove",
    hidden: "non pubblica",
    hinted: "qualcuno ha ricevuto suggerimenti",
    notDealt: "carte non distribuite con un seme del server",
    recorded: "ha partecipato un giocatore registrato",
    substituted: "un sostituto ha preso decisioni",
    twice: "qualcuno occupava due posti",
    wizard: "una persona ha giocato come robot",
  },
  fingerprint: (fingerprint) => `Chiave del nome: ${fingerprint}`,
  person: {
    unrated: "Ancora nessuna partita valutata.",
    notListed: (lines) => `Non è tra i primi ${lines} della classifica.`,
    rated: (place) => `${place}º posto in classifica`,
    ratingRange: (from, to) => `L’abilità è compresa tra ${from} e ${to} con una confidenza del 95%.`,
    games: "Partite concluse",
    wins: "Vinte",
    meanPlace: "Piazzamento medio",
    sameName:
      "Un nome può avere più chiavi: queste partite possono essere di più persone che hanno scelto lo stesso nome.",
    played: "Partite giocate",
    none: "Non c’è nessuna partita registrata con questo nome che tu possa vedere.",
    noneOfNewest: "Nessuna delle partite più recenti con questo nome ha questa chiave.",
    ofShown: (count) => plural(count, { one: "su # partita mostrata", other: "su # partite mostrate" }),
    ofThese: (count) => plural(count, { one: "in questa partita", other: "in queste # partite" }),
    columns: { date: "Quando", place: "Posizione", points: "Punti", game: "Partita" },
    against: "Contro",
    aborted: "interrotta",
    of: (room, date) => `${room}, ${date}`,
    toLeaderboard: "Vai alla classifica",
  },
};
