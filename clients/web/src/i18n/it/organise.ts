// Italian texts of creating and running a tournament, in tournaments/.

import { plurals } from "../plural";
import type { Texts } from "../texts";

const plural = plurals("it");

export const organise: Texts["organise"] = {
  title: "Crea un torneo",
  link: "Crea un torneo…",
  name: "Nome del torneo",
  namePlaceholder: "Coppa di primavera",
  format: "Chi gioca con chi",
  formats: {
    knockout:
      "Tavoli da quattro, sorteggiati. I primi due di ogni tavolo passano il turno, fino a una finale a quattro. Breve, con un vincitore chiaro.",
    roundRobin:
      "Si incontrano tutti, per quanto il numero lo permette. La classifica più equa, e il maggior numero di partite.",
    swiss:
      "Alcuni turni in cui si incontra chi ha un punteggio simile. Nessuno viene eliminato e bastano meno partite.",
  },
  players: "Giocatori per tavolo",
  playersKnockout: "L’eliminazione si gioca sempre a tavoli da quattro.",
  rounds: "Turni",
  roundsHint: "Vuoto: quanti ne suggerisce la formula",
  gamesPerPairing: "Partite per tavolo e turno",
  gamesPerPairingHint: "I posti ruotano di uno da una partita all’altra.",
  gamesPerPairingRotated: "Qui, il numero di distribuzioni; ognuna si gioca una volta per posto.",
  who: "Chi partecipa",
  builtIn: "Agenti integrati",
  builtInHint: "Quanti di ciascuno; 0 per nessuno",
  builtInSum: (count) => plural(count, { one: "# agente integrato", other: "# agenti integrati" }),
  kinds: "Chi può iscriversi con il codice",
  kind: { people: "Persone", agents: "Agenti", robots: "Robot", models: "Modelli linguistici" },
  maxParticipants: "Numero massimo di partecipanti",
  maxParticipantsHint: "Da 2 a 1024, compresi gli agenti integrati",
  physicalTables: "Tavoli con carte vere",
  physicalTablesHint: "Per chi gioca con carte vere: li aggiungi prima dell’inizio; 0 per nessuno",
  filler: "Agente di riserva",
  fillerHint: "Completa il tabellone o un tavolo, e gioca per chi non si presenta.",
  when: "Quando inizia",
  start: {
    label: "Inizia",
    byHand: "quando lo avvio io",
    joined: "automaticamente, a un certo numero di partecipanti",
    time: "automaticamente, a un’ora",
    timeHint: "Con chi si è iscritto fino ad allora, se sono almeno in due.",
    byHandHint: "Con un pulsante sulla sua pagina, visibile solo su questo dispositivo.",
    joinedHint: "Appena si raggiunge questo numero di iscritti.",
  },
  startWhen: "Partecipanti",
  startWhenHint: "Compresi gli agenti integrati",
  startAt: "Data e ora",
  noShow: "Secondi di attesa per gli assenti",
  noShowHint: "Da 1 a 86400. Dopo, la partita viene richiamata più tardi.",
  maxCalls: "Chiamate per partita",
  maxCallsHint: "All’ultima chiamata si gioca senza gli assenti.",
  otherClocks: "Tempi diversi per agenti, robot e modelli linguistici",
  otherClocksHint: "Ai programmi bastano pochi secondi, alle persone serve più tempo.",
  agentSeconds: "Secondi per decisione di un agente",
  robotSeconds: "Secondi per decisione di un robot",
  modelSeconds: "Secondi per decisione di un modello linguistico",
  more: "Carte, regole, errori e spettatori",
  deals: "Come si distribuiscono le carte",
  dealWords: {
    independent: {
      name: "Nuove a ogni partita",
      hint: "Per persone e agenti.",
    },
    same: {
      name: "Uguali a tutti i tavoli di un turno",
      hint: "La fortuna con le carte si compensa. Non sono ammessi spettatori, e le partite si rivedono a turno concluso.",
    },
    rotated: {
      name: "Ogni distribuzione una volta per posto",
      hint: "Per agenti integrati e agenti che si dichiarano senza memoria. Le persone non possono iscriversi.",
    },
  },
  maxParallel: "Numero massimo di partite contemporanee",
  notWatched:
    "Con queste distribuzioni non sono ammessi spettatori: le carte di un tavolo rivelerebbero quelle di un altro.",
  experiment: "Per un esperimento riproducibile",
  drawSeed: "Seme degli abbinamenti",
  drawSeedHint: "64 cifre esadecimali; vuoto per un seme casuale",
  dealSeed: "Seme delle distribuzioni",
  dealSeedHint: "Chi lo conosce, conosce le carte; le partite non sono valutate.",
  problems: {
    nameMissing: "Inserisci un nome.",
    tooMany: "Possono partecipare al massimo in 1024.",
    nobody: "Permetti l’iscrizione ad almeno un tipo di partecipanti.",
    notASeed: "Inserisci 64 cifre esadecimali.",
    startPassed: "Inserisci un’ora non ancora passata.",
  },
  submit: "Crea il torneo",
  own: {
    title: "Organizzi tu questo torneo",
    text: "Solo questo dispositivo può avviarlo, modificarlo e chiuderlo.",
    invite: "Invita i partecipanti",
    joined: (count) => plural(count, { one: "# iscritto.", other: "# iscritti." }),
    startsAt: (count) => `Inizia automaticamente con ${count} iscritti.`,
    start: "Avvia il torneo",
    startText: "Sorteggia i tavoli e chiama le prime partite. Dopo, non ci si può più iscrivere.",
    filledUp: (field, filler, more) =>
      plural(more, {
        one: `Si aggiunge # agente «${filler}» per arrivare a ${field}.`,
        other: `Si aggiungono # agenti «${filler}» per arrivare a ${field}.`,
      }),
    atTable: {
      title: "Aggiungi chi gioca a un tavolo con carte vere",
      text: "Nessuno si connette per loro: chi assiste al tavolo segnala che cosa fanno.",
      name: "Nome",
      kind: "Chi è",
      submit: "Aggiungi",
    },
    tables: {
      title: "Partite con carte vere",
      text: "Assisti al tavolo da questo dispositivo. La sua pagina ha anche il link per un altro dispositivo.",
    },
    pause: {
      pause: "Metti in pausa",
      resume: "Riprendi il torneo",
      text: "Non iniziano nuove partite; quelle in corso continuano.",
      isPaused: "Il torneo è in pausa: non iniziano nuove partite.",
    },
    people: {
      title: "Modifica i partecipanti",
      change: "Modifica…",
      remove: "Escludi…",
      removeDo: "Escludi ora",
      removeOpen: (name) => `Escludere ${name}? Il posto torna libero. Chi ha il codice può iscriversi di nuovo.`,
      removePlaying: (name) =>
        `Escludere ${name}? Un sostituto finisce la partita in corso; le altre contano come assenze.`,
      replace: "Dai il posto a",
      somebody: "un’altra persona",
      agent: (name) => `l’agente «${name}»`,
      newName: "Nome dell’altra persona",
      replaceDo: "Sostituisci",
      linkFor: (name) => `Manda questo link solo a ${name}: contiene il posto.`,
      linkSent: "L’ho consegnato",
    },
    games: {
      title: "Modifica le partite",
      text: "«Chiama ora» mette una partita davanti a tutte. «Rimanda» la mette in coda e non costa una chiamata.",
      call: "Chiama ora",
      postpone: "Rimanda",
      more: (count) => plural(count, { one: "… e # altra partita", other: "… e altre # partite" }),
    },
    close: "Chiudi il torneo…",
    closeOpen: "Nessuno potrà più iscriversi e non si giocherà nulla.",
    closePlaying:
      "Le partite in corso vengono interrotte. I risultati ottenuti restano, e la classifica non è definitiva.",
    closeDo: "Chiudilo ora",
  },
};
