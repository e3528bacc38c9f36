// Italian texts of experiment/.

import type { Texts } from "../en";
import { plurals } from "../plural";
import { time } from "./time";

const plural = plurals("it");

export const experiment: Texts["experiment"] = {
  join: {
    title: "Ti invitiamo a partecipare a uno studio",
    as: (name) => `Partecipi come ${name}.`,
    atSeat: (seat) => `Il tuo posto è il numero ${seat + 1}.`,
    consent: "Prima di cominciare",
    fromHost: "Questo testo è di chi ti ha invitato, non di chi ha realizzato questa pagina.",
    agree: "Ho letto e acconsento",
    decline: "Non acconsento",
    declined: "Non partecipi. Non è stato salvato nulla; puoi chiudere questa pagina.",
    before: "Prima di tutto, un questionario",
    beforeText: (host) => `Si apre in una nuova finestra, su ${host}. Torna qui quando hai finito.`,
    open: "Apri il questionario",
    done: "L’ho compilato",
    reconsider: "Rileggi il testo",
    gone: "Questo link non funziona più: la stanza è stata chiusa o la partita è finita. Chiedi a chi te l’ha mandato.",
    taken: (name) => `Qualcuno ha già preso posto con questo link su questo dispositivo, come ${name}.`,
    goOn: (name) => `Continua come ${name}`,
    another: "Prendi un altro posto",
    held: (name) => `${name} ha già un posto in questa stanza su questo dispositivo.`,
    oneSeat: (name) =>
      `Un dispositivo può avere un solo posto per stanza. Se qui si siede un’altra persona, il posto di ${name} si libera.`,
    begun: (name) =>
      `La partita è iniziata, e su questo dispositivo può continuare solo ${name}. Apri questo link su un altro dispositivo.`,
    giveBack: (name, as) => `Libera il posto di ${name} e partecipa come ${as}`,
    seated: (name) =>
      `${name} ha già un posto. Continua sul dispositivo che hai usato allora; se non eri tu, chiedi a chi ti ha mandato il link.`,
    takenPlace: (name) => `Qualcuno si è già iscritto con questo link su questo dispositivo, come ${name}.`,
    heldPlace: (name) => `${name} partecipa già a questo torneo su questo dispositivo.`,
    onePlace: (name) =>
      `Un dispositivo gioca per un solo partecipante. Se qui si iscrive un’altra persona, ${name} non potrà più giocare.`,
    joinAs: (name) => `Partecipa come ${name}`,
    anotherPlace: "Iscrivi un’altra persona",
    come: { room: "Siediti al tavolo", tournament: "Iscriviti al torneo" },
    recorded: {
      room: "La partita viene registrata: il nome qui sopra, le tue decisioni e il tempo di ciascuna, e le espressioni che mostri. Nient’altro.",
      tournament:
        "Le partite vengono registrate: il nome qui sopra, le tue decisioni e il tempo di ciascuna, e le espressioni che mostri. Nient’altro. Resta su questa pagina: le tue partite iniziano qui automaticamente.",
    },
    over: "Hai partecipato a questo studio",
    timed: "Il tempo che impieghi viene misurato anche su questo dispositivo e registrato con le tue decisioni.",
  },
  after: {
    title: "Grazie per aver giocato",
    text: (host) => `Un’ultima cosa: un questionario su ${host}.`,
    whose: (name) => `È per ${name}.`,
  },
  links: {
    title: "Link per uno studio",
    text: "Un link che stabilisce chi partecipa, in quale posto e lingua, e che cosa vede. Tutto questo è contenuto nel link; il server non ne conserva nulla.",
    tournamentText:
      "Un link che stabilisce chi partecipa, in quale lingua e che cosa vede in ogni partita. Tutto questo è contenuto nel link; il server non ne conserva nulla.",
    hosted: "Per condizioni assegnate dal server, consenso registrato e questionari integrati, crea invece uno studio:",
    where: "Dove giocano",
    here: "tutti in questa stanza",
    names: "Partecipanti, uno per riga",
    namesHint: "Pseudonimi come P07, o P01-P20 per venti. Se è vuoto, ognuno sceglie un nome.",
    tooManyNames: (most) => `Al massimo ${most} alla volta; gli altri restano esclusi.`,
    tooLong: (most) => `Un nome può avere al massimo ${most} caratteri; per i nomi più lunghi non c’è un link.`,
    seat: "Posto del primo partecipante; gli altri seguono",
    anySeat: "un posto libero qualsiasi",
    language: "Lingua",
    browserLanguage: "quella del browser",
    hide: "Nascondi al tavolo",
    hidden: {
      log: "che cosa è successo",
      lookup: "le giocate possibili",
      expressions: "le espressioni",
      played: "le carte giocate nello Shift",
      pages: "i link alle altre pagine",
    },
    times: "Registra anche il tempo misurato nel browser",
    timesHint: "Salvato come annotazione di ogni decisione, accanto alla misura del server.",
    consent: "Testo del consenso",
    consentHint: "I partecipanti devono acconsentire prima di sedersi. Testo semplice.",
    consentTournamentHint: "I partecipanti devono acconsentire prima di iscriversi. Testo semplice.",
    before: "Indirizzo di un questionario prima di giocare",
    after: "Indirizzo di un questionario dopo aver giocato",
    beforeHint: "https://…; {name} viene sostituito se il link stabilisce un nome.",
    afterHint: "https://…; {name} e {room} vengono sostituiti.",
    afterTournamentHint: "Mostrato a torneo concluso. https://…; {name} e {tournament} vengono sostituiti.",
    notAnAddress: "Inserisci un indirizzo che comincia con https:// o http://.",
    tooMany: (seats) =>
      plural(seats, {
        one: "Ci sono più nomi che posti: è disponibile solo # posto.",
        other: "Ci sono più nomi che posti: sono disponibili solo # posti.",
      }),
    own: {
      label: "ognuno in una stanza separata, come questa",
      namesHint: "Pseudonimi come P07, o P01-P20 per venti: per ognuno si crea una stanza.",
      seat: "Il loro posto",
      text: "Ogni stanza ha le regole, i tempi e gli agenti di questa. Questo dispositivo conserva ciò che serve per chiuderle. I link restano elencati qui, ciascuno con le impostazioni che questo modulo aveva quando la stanza è stata creata.",
      barred: {
        seed: "Le carte di questa stanza sono fissate da un seme segreto; nelle altre stanze vengono distribuite a caso.",
        real: "Questa stanza ha un tavolo con carte vere, e non ce n’è un secondo.",
        hands:
          "Questa stanza inizia con mani prestabilite, che qui non sono note: non se ne può creare un’altra uguale.",
      },
      wait: "Ogni stanza aspetta",
      waitHint: "Se entro allora il partecipante non è arrivato, la stanza si chiude e il link smette di funzionare.",
      time,
      namesMissing: "Inserisci sopra i partecipanti.",
      make: (count) => plural(count, { one: "Crea # stanza", other: "Crea # stanze" }),
      making: (made, all) => `Create ${made} stanze su ${all}…`,
      keptMade: (made, missing) => `${made} create ed elencate qui sotto; ${missing} ancora da creare.`,
    },
    copyAll: "Copia tutti",
    download: "Scarica come tabella (CSV)",
    result: "Link",
    everybody: "tutti",
  },
};
