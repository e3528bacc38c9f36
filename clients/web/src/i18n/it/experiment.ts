// Italian texts of experiment/.

import type { Texts } from "../en";
import { plurals } from "../plural";
import { time } from "./time";

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
    reconsider: "Rileggi il testo",
    gone: "Questo link non porta più a nulla: la stanza è stata chiusa o la partita è finita. Chiedi a chi te l’ha mandato.",
    taken: (name) => `Con questo link qualcuno si è già seduto su questo dispositivo, come ${name}.`,
    goOn: (name) => `Continua come ${name}`,
    another: "Prendi un altro posto",
    held: (name) => `Su questo dispositivo ${name} ha già un posto in questa stanza.`,
    oneSeat: (name) =>
      `Un dispositivo ha un solo posto per stanza: quando qui si siede un’altra persona, il posto di ${name} si libera.`,
    begun: (name) =>
      `La partita è iniziata: qui può continuare solo ${name}. Apri questo link su un altro dispositivo.`,
    giveBack: (name, as) => `Libera il posto di ${name} e partecipa come ${as}`,
    seated: (name) =>
      `${name} si è già seduto al tavolo. Continua sul dispositivo usato allora; se non sei stato tu, chiedi a chi ti ha mandato il link.`,
    takenPlace: (name) => `Con questo link qualcuno si è già iscritto su questo dispositivo, come ${name}.`,
    heldPlace: (name) => `Su questo dispositivo ${name} partecipa già a questo torneo.`,
    onePlace: (name) =>
      `Un dispositivo gioca per un solo partecipante: se qui si iscrive un’altra persona, ${name} non può più giocare.`,
    joinAs: (name) => `Partecipa come ${name}`,
    anotherPlace: "Iscrivi un’altra persona",
    come: { room: "Siediti al tavolo", tournament: "Iscriviti al torneo" },
    recorded: {
      room: "La partita viene registrata: il nome qui sopra, le tue decisioni e quanto tempo richiedono, e le espressioni che mostri. Nient’altro.",
      tournament:
        "Le partite vengono registrate: il nome qui sopra, le tue decisioni e quanto tempo richiedono, e le espressioni che mostri. Nient’altro. Resta su questa pagina: le tue partite cominciano qui da sole.",
    },
    over: "Hai partecipato a questo studio",
    timed: "Il tempo che impieghi si misura anche su questo dispositivo e si registra con le tue decisioni.",
  },
  after: {
    title: "Grazie di aver giocato",
    text: (host) => `Un’ultima cosa: un questionario su ${host}.`,
    whose: (name) => `È per ${name}.`,
  },
  links: {
    title: "Link per uno studio",
    text: "Un link che fissa chi partecipa, in quale posto e lingua, e che cosa vede. Tutto sta nel link stesso; il server non ne conserva nulla.",
    tournamentText:
      "Un link che fissa chi partecipa, in quale lingua e che cosa vede in ogni partita. Tutto sta nel link stesso; il server non ne conserva nulla.",
    where: "Giocano",
    here: "tutti in questa stanza",
    names: "Partecipanti, uno per riga",
    namesHint: "Pseudonimi come P07, o P01-P20 per venti. Vuoto: ognuno sceglie un nome.",
    tooManyNames: (most) => `Non più di ${most} alla volta: gli altri restano fuori.`,
    tooLong: (most) => `Un nome ha al massimo ${most} caratteri: per quelli più lunghi non ci sono link.`,
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
    consentTournamentHint: "Devono acconsentire prima di iscriversi. Testo semplice.",
    before: "Indirizzo di un questionario prima",
    after: "Indirizzo di un questionario dopo",
    beforeHint: "https://…; {name} viene compilato se è fissato.",
    afterHint: "https://…; {name} e {room} vengono compilati.",
    afterTournamentHint: "Proposto a torneo concluso. https://…; {name} e {tournament} vengono compilati.",
    notAnAddress: "Questo non è un indirizzo che comincia con https:// o http://.",
    tooMany: (seats) =>
      plural(seats, {
        one: "Ci sono più nomi che posti: per loro c’è # posto.",
        other: "Ci sono più nomi che posti: per loro ci sono # posti.",
      }),
    own: {
      label: "ognuno in una stanza propria, come questa",
      namesHint: "Pseudonimi come P07, o P01-P20 per venti: per ognuno si crea una stanza.",
      seat: "Il loro posto",
      text: "Ogni stanza ha le regole, i tempi e gli agenti di questa. Questo dispositivo conserva ciò che serve per chiuderle; i link restano elencati qui, ciascuno con ciò che diceva questo modulo quando la stanza è stata creata.",
      barred: {
        seed: "Le carte di questa stanza sono fissate da un seme che non si rivela: nelle altre stanze si danno a caso.",
        hands:
          "Questa stanza comincia con carte assegnate, che qui non si conoscono: non se ne può creare un’altra uguale.",
      },
      wait: "Ogni stanza aspetta",
      waitHint: "Se entro allora il partecipante non è arrivato, la stanza si chiude e il link non porta a nulla.",
      time,
      namesMissing: "Scrivi sopra chi partecipa.",
      make: (count) => plural(count, { one: "Crea # stanza", other: "Crea # stanze" }),
      making: (made, all) => `Create ${made} stanze su ${all}…`,
      keptMade: (made, missing) => `${made} sono create ed elencate qui sotto; ${missing} restano da creare.`,
    },
    copyAll: "Copia tutti",
    download: "Scarica come tabella (CSV)",
    result: "Link",
    everybody: "tutti",
  },
};
