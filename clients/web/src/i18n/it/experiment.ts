// Italian texts of experiment/.

import type { Texts } from "../en";
import { plurals } from "../plural";

const plural = plurals("it");

export const experiment: Texts["experiment"] = {
  join: {
    title: "Sei invitato a uno studio",
    as: (name) => `Partecipi come ${name}.`,
    atSeat: (seat) => `Il tuo posto è il numero ${seat}.`,
    consent: "Prima di cominciare",
    fromHost: "Queste parole sono di chi ti ha invitato, non di chi ha fatto questa pagina.",
    agree: "Ho letto e acconsento",
    decline: "Non acconsento",
    declined: "Non partecipi. Non è stato salvato nulla; puoi chiudere questa pagina.",
    before: "Prima un questionario",
    beforeText: (host) => `Si apre in una finestra a parte, su ${host}. Poi torna qui.`,
    open: "Apri il questionario",
    done: "L’ho compilato",
    taken: (name) => `Con questo link qualcuno si è già seduto su questo dispositivo, come ${name}.`,
    goOn: (name) => `Continua come ${name}`,
    another: "Prendi un altro posto",
    sitDown: "Siediti al tavolo",
    recorded:
      "La partita viene registrata: il nome qui sopra, le tue decisioni e quanto tempo richiedono, e le espressioni che mostri. Nient’altro.",
    timed: "Il tempo che impieghi si misura anche su questo dispositivo e si registra con le tue decisioni.",
  },
  after: {
    title: "Grazie di aver giocato",
    text: (host) => `Un’ultima cosa: un questionario su ${host}.`,
  },
  links: {
    title: "Link per uno studio",
    text: "Un link che fissa chi partecipa, in quale posto e lingua, e che cosa vede. Tutto sta nel link stesso; il server non ne conserva nulla.",
    names: "Partecipanti, uno per riga",
    namesHint: "Pseudonimi come P07. Vuoto: ognuno sceglie un nome.",
    seat: "Posto del primo; gli altri seguono",
    anySeat: "un posto libero qualsiasi",
    language: "Lingua",
    browserLanguage: "del loro browser",
    hide: "Da non mostrare al tavolo",
    hidden: {
      log: "che cosa è successo",
      lookup: "che cosa è possibile",
      expressions: "le espressioni",
      played: "le carte giocate nello Shift",
      pages: "i passaggi ad altre pagine",
    },
    times: "Registra anche il tempo misurato dalla loro parte",
    timesHint: "Come annotazione di ogni decisione, separata dalla misura del server.",
    consent: "Testo del consenso",
    consentHint: "Devono acconsentire prima di sedersi. Testo semplice.",
    before: "Indirizzo di un questionario prima",
    after: "Indirizzo di un questionario dopo",
    beforeHint: "https://…; {name} viene compilato se è fissato.",
    afterHint: "https://…; {name} e {room} vengono compilati.",
    notAnAddress: "Questo non è un indirizzo che comincia con https:// o http://.",
    tooMany: (seats) =>
      plural(seats, {
        one: "Ci sono più nomi che posti: per loro c’è # posto.",
        other: "Ci sono più nomi che posti: per loro ci sono # posti.",
      }),
    result: "Link",
    everybody: "tutti",
  },
};
