// Italian texts of making and holding a tournament, in tournaments/.

import type { Texts } from "../en";
import { plurals } from "../plural";

const plural = plurals("it");

export const organise: Texts["organise"] = {
  title: "Crea un torneo",
  link: "Crea un torneo…",
  name: "Nome del torneo",
  namePlaceholder: "Coppa di primavera",
  format: "Chi gioca con chi",
  formats: {
    knockout:
      "Tavoli da quattro, sorteggiati; i primi due di ognuno vanno avanti, fino a una finale a quattro. Breve, e qualcuno vince.",
    roundRobin:
      "Si incontrano tutti, per quanto il numero lo permette. L’ordine più giusto, e il maggior numero di partite.",
    swiss: "Alcuni turni in cui si incontra chi ha punteggi simili. Nessuno viene eliminato e bastano meno partite.",
  },
  players: "Giocatori per tavolo",
  playersKnockout: "L’eliminazione si gioca a tavoli da quattro.",
  rounds: "Turni",
  roundsHint: "Vuoto: quanti ne suggerisce la formula",
  gamesPerPairing: "Partite di un tavolo in un turno",
  gamesPerPairingHint: "I posti scorrono di uno da una partita all’altra.",
  gamesPerPairingRotated: "Qui: distribuzioni, ognuna giocata una volta per posto.",
  who: "Chi partecipa",
  builtIn: "Agenti del server",
  builtInHint: "Quanti di ciascuno; 0 per nessuno",
  builtInSum: (count) => plural(count, { one: "# agente del server", other: "# agenti del server" }),
  kinds: "Chi può iscriversi con il codice",
  kind: { people: "Persone", agents: "Agenti", robots: "Robot" },
  maxParticipants: "Partecipanti al massimo",
  maxParticipantsHint: "Da 2 a 1024, compresi gli agenti del server",
  filler: "Agente che completa",
  fillerHint: "Completa il tabellone o un tavolo, e gioca per chi non si presenta.",
  when: "Quando comincia",
  start: {
    label: "Comincia",
    byHand: "quando lo dico io",
    joined: "da solo, raggiunto un numero di partecipanti",
    byHandHint: "Con un pulsante sulla sua pagina, che ha solo questo dispositivo.",
    joinedHint: "Appena si raggiunge questo numero di iscritti.",
  },
  startWhen: "Partecipanti",
  startWhenHint: "Compresi gli agenti del server",
  noShow: "Secondi che una partita aspetta gli assenti",
  noShowHint: "Da 1 a 86400. Poi viene richiamata più tardi.",
  maxCalls: "Chiamate di una partita",
  maxCallsHint: "All’ultima si gioca senza chi non si presenta.",
  otherClocks: "Altri tempi per agenti e robot",
  otherClocksHint: "Ai programmi bastano secondi, alle persone serve di più.",
  agentSeconds: "Secondi per decisione di un agente",
  robotSeconds: "Secondi per decisione di un robot",
  more: "Carte, regole, errori e pubblico",
  deals: "Come si distribuiscono le carte",
  dealWords: {
    independent: {
      name: "Nuove a ogni partita",
      hint: "Per persone e agenti.",
    },
    same: {
      name: "Uguali a tutti i tavoli di un turno",
      hint: "La fortuna con le carte si compensa. Nessuno può guardare, e le partite si rivedono a turno concluso.",
    },
    rotated: {
      name: "Ogni distribuzione una volta per posto",
      hint: "Per agenti del server e agenti che dichiarano di non ricordare nulla. Le persone non possono iscriversi.",
    },
  },
  maxParallel: "Partite insieme, al massimo",
  notWatched: "Con queste carte nessuno può guardare: quelle di un tavolo rivelerebbero quelle di un altro.",
  experiment: "Per un esperimento da ripetere",
  drawSeed: "Seme dei sorteggi",
  drawSeedHint: "64 cifre esadecimali; vuoto: a caso",
  dealSeed: "Seme delle distribuzioni",
  dealSeedHint: "Chi lo conosce conosce le carte, e le partite non sono valutate.",
  problems: {
    nameMissing: "Dagli un nome.",
    tooMany: "Non possono partecipare in più di 1024.",
    nobody: "Qualcuno deve potersi iscrivere.",
    notASeed: "Queste non sono 64 cifre esadecimali.",
  },
  submit: "Crea il torneo",
  own: {
    title: "Questo torneo è tuo",
    text: "Solo questo dispositivo può avviarlo e chiuderlo.",
    invite: "Invita i partecipanti",
    agent: "Per un agente come quelli del server, in un terminale",
    joined: (count) => plural(count, { one: "# iscritto.", other: "# iscritti." }),
    startsAt: (count) => `Comincia da solo quando sono ${count}.`,
    start: "Avvia il torneo",
    startText: "Sorteggia i tavoli e chiama le prime partite. Dopo non ci si può più iscrivere.",
    filledUp: (field, filler, more) =>
      plural(more, {
        one: `Per arrivare a ${field} si aggiunge # agente «${filler}».`,
        other: `Per arrivare a ${field} si aggiungono # agenti «${filler}».`,
      }),
    close: "Chiudi il torneo…",
    closeOpen: "Nessuno potrà più iscriversi e non si giocherà nulla.",
    closePlaying:
      "Le partite in corso vengono interrotte; ciò che è stato contato resta, e la classifica non è definitiva.",
    closeDo: "Chiudilo ora",
  },
};
