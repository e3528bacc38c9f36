// Italian texts of attend/: chi assiste a un tavolo con carte vere.

import { plurals } from "../plural";
import type { Texts } from "../texts";

const plural = plurals("it");

/** The names of a list in English, "Ada, Bo and Cy", in Italian. */
const names = (list: string) => list.replace(" and ", " e ");

export const attend: Texts["attend"] = {
  title: "Assisti al tavolo",
  heading: (room) => room || "Tavolo con carte vere",
  noTicket:
    "Questo dispositivo non può fare segnalazioni su questo tavolo. Apri il link per chi assiste, o inquadra il suo codice QR, dal dispositivo che ha creato la stanza.",
  gone: "Questo tavolo non esiste più, o il link è sbagliato.",
  now: {
    label: "Che cosa aspetta il tavolo",
    waiting: "In attesa dei giocatori a distanza",
    waitingText: "La partita inizia appena tutti i posti a distanza sono presi e connessi.",
    hand: (name) => `Mostra la mano di ${name}`,
    handText:
      "Tieni le carte in modo che la telecamera le veda tutte, o inseriscile qui sotto. Non mostrarle agli altri.",
    special: "Qualcuno dichiara un’azione speciale?",
    specialOf: (name) => `${name} decide su un’azione speciale`,
    specialText: "Può farlo chi ha tutti e due i jolly. Segnala chi dichiara, o che nessuno lo fa.",
    gift: (name) => `${name} dà delle carte`,
    giftOf: (name) => `${name} sceglie che cosa dare`,
    giftText: "Segnala lo scambio quando le carte sono passate di mano. Non occorre vederle.",
    opening: (face) => `Apre lo Shift chi ha la carta d’oro (${face})`,
    turn: (name) => `Tocca a ${name}`,
    turnOf: (name) => `${name} sta decidendo`,
    remoteText: "Gioca a distanza. Non c’è niente da fare finché non arriva la decisione.",
    question: "Una domanda per te",
    questionText: "La partita continua dopo la risposta.",
    confirmation: "L’ultima giocata è stata letta bene?",
    confirmationText:
      "Allora la partita è finita. Altrimenti correggila; senza segnalazioni il risultato vale dopo 20 secondi.",
    confirm: "Sì, la partita è finita",
    over: "La partita è finita",
    paused: "In pausa",
    pausedText: "Gli orologi sono fermi. Le segnalazioni valgono lo stesso.",
    pause: "Pausa",
    resume: "Riprendi",
  },
  violation: {
    label: "Non permesso",
    todo: "Non conta. Fai riprendere le carte, o correggi ciò che è stato letto male.",
    takenBack: "Carte riprese",
    reenter: "Inserisci che cosa c’è davvero",
    correct: "Correggi una segnalazione precedente",
  },
  questions: {
    picture: "Che cosa vede la telecamera",
    withdraw: "Nessuna risposta",
    words: (text) => {
      const [, passed] = /^Did (.+) pass\?$/.exec(text) ?? [];
      if (passed) return `${names(passed)}: ${passed.includes(" and ") ? "hanno" : "ha"} passato?`;
      const [, leads] = /^Is that a new play by (.+)\?$/.exec(text) ?? [];
      if (leads) return `${leads}: è una nuova giocata?`;
      return text === "Who opened the Shift?" ? "Chi ha aperto lo Shift?" : text;
    },
    option: (text) => {
      const [, name, play] = /^No, (.+) passed before (.+)$/.exec(text) ?? [];
      if (name) return `No, ${name} aveva passato prima (${play})`;
      return text === "Yes" ? "Sì" : text === "No" ? "No" : text;
    },
  },
  toLay: {
    title: "Da fare al tavolo",
    lay: (name) => `Posa per ${name}`,
    pass: (name) => `Mostra la carta «passo» di ${name}`,
    give: (name, to) => `Passa le carte di ${name} a ${to}`,
    foodFight: (name) => `Annuncia: ${name} dichiara Food Fight`,
    dinner: (name) => `Annuncia: ${name} dichiara Dinner is Served`,
    done: "Fatto",
  },
  enter: {
    title: "Inserisci a mano",
    what: "Che cosa è successo",
    kinds: {
      turn: "Giocata o passo",
      hand: "Una mano",
      special: "Azione speciale",
      gift: "Scambio",
      role: "Ruolo preso",
      passWithdrawn: "Passo ritirato",
      cleared: "Piatto svuotato",
    },
    seat: "Chi",
    face: "Valore",
    number: "Quante",
    jokers: "Jolly insieme",
    fewer: (what) => `Meno: ${what}`,
    more: (what) => `Di più: ${what}`,
    golden: (face) => `Tra queste c’è la carta d’oro (${face})`,
    notAllowed: "ora non permesso",
    lay: "Segnala la giocata",
    lays: (name, cards) => `${name} posa ${cards}`,
    pass: "Passo",
    passes: (name) => `${name} passa`,
    passWithdrawn: (name) => `${name} ritira il passo`,
    clearedText: "La pizza è finita e le carte sono state tolte dal piatto.",
    declares: (name) => `${name} dichiara`,
    nobodyDeclares: "Nessuno dichiara",
    giftUnseen: (name) => `${name} ha dato, carte non viste`,
    giftSeen: (name) => `${name} ha dato queste carte`,
    handSeen: (name) => `Questa è la mano di ${name}`,
    role: "Ruolo",
    takesRole: (name, role) => `${name} è ${role}`,
    whoFirst: "Scegli chi è stato.",
    hand: {
      label: "Carte",
      hint: "Scrivile, per esempio 3 4 4 11 J o 2x4, oppure toccale qui sotto.",
      tap: "Tocca per aggiungere",
      remove: (card) => `Togli ${card}`,
      add: (card) => `Aggiungi ${card}`,
      count: (count, of) =>
        of === undefined ? plural(count, { one: "# carta", other: "# carte" }) : `${count} carte su ${of}`,
      clear: "Svuota",
      word: (word) => `«${word}» non è una carta. Scrivi numeri, e J per un jolly.`,
      tooMany: (face, all) =>
        plural(all, {
          one: `Il mazzo ha solo # carta di valore ${face}.`,
          other: `Il mazzo ha solo # carte di valore ${face}.`,
        }),
      tooManyJokers: (all) => `Il mazzo ha solo ${all} jolly.`,
      mustBe: (count) => plural(count, { one: "La mano ha # carta.", other: "La mano ha # carte." }),
    },
  },
  reports: {
    title: "Segnalazioni di questo Shift",
    none: "Non è ancora stato segnalato nulla.",
    assumed: "(chi è stato è presunto)",
    change: "Cambia",
    remove: "Elimina",
    removeSure: "È come se non fosse mai successo. Viene eliminato anche ciò che dopo non è più valido.",
    changeTitle: (text) => `Cambia: ${text}`,
    changeText: "Che cosa è successo invece? Tutto il resto viene giudicato di nuovo.",
    laid: (name, cards) => `${name} ha posato ${cards}`,
    passed: (name) => `${name} ha passato`,
    passWithdrawn: (name) => `${name} ha ritirato il passo`,
    hand: (name) => `È stata vista la mano di ${name}`,
    cleared: "Il piatto è stato svuotato",
    declared: (name) => `${name} ha dichiarato un’azione speciale`,
    nobodyDeclared: "Nessuno ha dichiarato un’azione speciale",
    gave: (name) => `${name} ha dato delle carte`,
    gaveCards: (name, cards) => `${name} ha dato ${cards}`,
    role: (name, role) => `${name} ha preso la carta ${role}`,
  },
  outcome: {
    accepted: "Segnalato.",
    known: "Si sapeva già.",
    held: "Aspetta la risposta a una domanda.",
    notSent: "Non inviata, perché la segnalazione precedente non conta. Guarda il tavolo e inseriscila di nuovo.",
    violation: "Non permesso: non conta.",
    void: (count) =>
      plural(count, {
        one: "Corretto. # segnalazione successiva non è più valida ed è stata eliminata: inserisci di nuovo che cosa è successo.",
        other:
          "Corretto. # segnalazioni successive non sono più valide e sono state eliminate: inserisci di nuovo che cosa è successo.",
      }),
  },
  seats: {
    remote: "a distanza",
    handKnown: "mano nota",
    handUnknown: "mano non nota",
    passed: "ha passato",
    next: "gioca",
  },
  link: {
    title: "Su un tablet accanto al tavolo",
    text: "Chi ha questo indirizzo può fare segnalazioni sul tavolo. Mostralo solo a chi assiste.",
    qr: "Codice QR della vista di chi assiste",
  },
  room: {
    realCards: "carte vere",
  },
};
