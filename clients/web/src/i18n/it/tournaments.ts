// Italian texts of tournaments/.

import { plurals } from "../plural";
import type { Texts } from "../texts";
import { time } from "./time";

const plural = plurals("it");

export const tournaments: Texts["tournaments"] = {
  none: "Non c’è ancora nessun torneo. Creane uno, manda l’indirizzo a persone e agenti e segui qui la classifica.",
  sections: { open: "Iscrizioni aperte", playing: "In corso", over: "Conclusi", closed: "Chiusi in anticipo" },
  states: {
    open: "iscrizioni aperte",
    playing: "in corso",
    paused: "in pausa",
    finished: "finito",
    closed: "chiuso in anticipo",
  },
  formats: { knockout: "A eliminazione", roundRobin: "All’italiana", swiss: "Svizzero" },
  deals: {
    same: "Tutti i tavoli di un turno ricevono le stesse carte. Spettatori e replay sono ammessi solo a turno concluso.",
    rotated: "Ogni tavolo gioca ogni distribuzione una volta per posto.",
  },
  participants: (count) => plural(count, { one: "# partecipante", other: "# partecipanti" }),
  made: (date) => `creato il ${date}`,
  gamesOver: (over, games) => `${over} di ${plural(games, { one: "# partita", other: "# partite" })} concluse`,
  roundOf: (round, rounds) => `turno ${round} di ${rounds}`,
  round: (round) => `Turno ${round}`,
  final: "Finale",
  table: (table) => `Tavolo ${table}`,
  game: (number) => `partita ${number}`,
  wall: {
    open: "Vista per maxischermo",
    close: "Esci dalla vista per maxischermo",
    more: (from, to) => `da ${from} a ${to}`,
    tables: (from, to) => `tavoli da ${from} a ${to}`,
    join: "Inquadra il codice per iscriverti",
    orCode: (host) => `oppure apri ${host} e inserisci`,
  },
  print: "Stampa",
  results: {
    title: "Risultati",
    open: "Risultati e attestati",
    back: "Torna al torneo",
    provisional: (date) => `Situazione al ${date}; il torneo non è finito.`,
    settings: "Come si è giocato",
    table: "Tavolo",
    game: "Partita",
    result: "Risultato",
    foot: (id) => `Chef’s Hat · torneo ${id}`,
  },
  certificate: {
    heading: "Attestati",
    text: "Su carta o, dalla finestra di stampa, in PDF. Firmali a mano.",
    all: (count) => plural(count, { one: "Stampa # attestato", other: "Stampa tutti i # attestati" }),
    of: "Stampa l’attestato di",
    title: "Attestato",
    placed: (place, of) => `ha ottenuto il ${place}º posto su ${of} nel torneo`,
    tookPart: "ha partecipato al torneo",
    rounds: (count) => plural(count, { one: "# turno", other: "# turni" }),
    games: (count) => plural(count, { one: "# partita giocata", other: "# partite giocate" }),
    score: (mean) => `punteggio medio ${mean}`,
    wins: (count) => plural(count, { one: "# partita vinta", other: "# partite vinte" }),
    signature: "Firma di chi organizza",
  },
  countdown: {
    label: "Inizia fra",
    due: "Inizia appena ci sono due iscritti",
    days: (days, clock) => `${plural(days, { one: "# giorno", other: "# giorni" })} ${clock}`,
  },
  play: {
    beginsAt: (count) => `Inizia automaticamente con ${count} partecipanti`,
    beginsByHand: "Inizia quando lo avvia chi organizza",
    beginsOn: (moment) => `Inizia il ${moment}`,
    beginsAtOrOn: (count, moment) => `Inizia con ${count} partecipanti, al più tardi il ${moment}`,
    knockout: (games) =>
      `${plural(games, { one: "# partita per turno", other: "# partite per turno" })} a tavoli da quattro; i primi due vanno avanti`,
    rounds: (rounds, games) =>
      rounds === 0
        ? `Tanti turni quanti ne richiede il numero dei partecipanti, di ${plural(games, { one: "# partita", other: "# partite" })} ciascuno`
        : `${plural(rounds, { one: "# turno", other: "# turni" })} di ${plural(games, { one: "# partita", other: "# partite" })}`,
    toPoints: (points) => plural(points, { one: "Si gioca a # punto", other: "Si gioca a # punti" }),
    shifts: (shifts) => plural(shifts, { one: "Una partita è di # Shift", other: "Una partita è di # Shift" }),
    clock: (decisionMs, bankMs) =>
      `Le persone hanno ${time(decisionMs)} per ogni decisione${bankMs > 0 ? ` e ${time(bankMs)} in più in tutta la partita` : ""}`,
  },
  standings: {
    title: "Classifica",
    final: "Classifica finale",
    score: "Punteggio medio",
    scoreHint: "Punti in media per la posizione in una partita. Decidono l’ordine",
    placesWords: (places) => places.map((count, index) => `${count} × ${index + 1}º posto`).join(", "),
    ratingHint: "Media e incertezza, dalle partite valutate di questo torneo",
    round: "Ultimo turno",
    forfeited: (count) => plural(count, { one: "# assenza", other: "# assenze" }),
    byes: (count) => plural(count, { one: "# riposo", other: "# riposi" }),
    filler: "completa il tabellone",
    withdrawn: "ha lasciato",
    former: (names) => `prima: ${names}`,
    none: "Non si è ancora iscritto nessuno.",
    field: "Partecipanti",
  },
  games: {
    title: "Partite",
    bracket: "Tabellone",
    due: "non ancora chiamata",
    void: "annullata",
    of: (table, number) => `${table}, partita ${number}`,
    from: (first) => `i primi due del tavolo ${first}`,
    forfeited: "non si è presentato",
    advances: "passa il turno",
    champion: "vince il torneo",
    none: "I tavoli si sorteggiano all’inizio del torneo.",
    truncated: (count) => `Si vedono solo le prime ${count} partite.`,
  },
  confidence: {
    title: "Quanto è certo l’ordine?",
    text: "Stima dai punteggi finora, per ogni coppia di vicini in classifica.",
    pair: (upper, lower) => `${upper} prima di ${lower}`,
    grades: {
      certain: "quasi certo",
      likely: "probabile",
      leaning: "più probabile che no",
      open: "non si può ancora dire",
      against: "i punteggi dicono il contrario",
    },
    percent: (percent) => `${percent}%`,
    more: (games) =>
      plural(games, {
        one: "circa # altra partita a testa lo deciderebbe",
        other: "circa # altre partite a testa lo deciderebbero",
      }),
  },
  join: {
    title: "Partecipa",
    text: "Si gioca nel browser. Resta su questa pagina: le tue partite iniziano qui automaticamente.",
    code: "Codice d’ingresso del torneo",
    codeMissing: "Inserisci il codice che ti ha dato chi organizza.",
    nameHint: "Lo vedono tutti. Dev’essere unico nel torneo.",
    submit: "Iscriviti al torneo",
    notForPeople: "Le persone non possono iscriversi a questo torneo.",
  },
  part: {
    you: (name) => `Partecipi come ${name}.`,
    waitOpen:
      "Resta su questa pagina. Il torneo inizia quando lo avvia chi organizza o quando ci sono abbastanza iscritti.",
    waitNext: "Resta su questa pagina: la tua prossima partita inizia qui automaticamente.",
    waitPaused: "Chi organizza ha messo il torneo in pausa. Alla ripresa la tua prossima partita inizia qui.",
    postpone: (place) => `Rimanda la mia prossima partita (${place})`,
    leave: "Lascia il torneo…",
    leaveDo: "Lascialo ora",
    leaveOpen: "Il tuo posto torna libero per altri.",
    leavePlaying: "Un sostituto finisce la tua partita in corso; nelle altre risulti assente. Non puoi rientrare.",
    left: "Non partecipi più a questo torneo. I tuoi risultati ottenuti finora contano.",
    replaced: "Il tuo posto in questo torneo è passato a un’altra persona.",
    over: "Il torneo è finito. Grazie per aver giocato.",
    superseded: "Stai partecipando in un’altra finestra o su un altro dispositivo.",
    takeBack: "Partecipa qui",
    begins: (place) => `La tua partita inizia: ${place}.`,
    back: "Torna alla classifica",
    place: (round, table) => `turno ${round}, tavolo ${table}`,
    toGame: "Vai alla mia partita",
    which: {
      title: "Quale posto vuoi usare?",
      text: (held, brought) =>
        `Su questo dispositivo ${held} partecipa già a questo torneo. Il link porta il posto di ${brought}.`,
      lost: (held) =>
        `Un dispositivo gioca per un solo partecipante. Se usi il link qui, questo dispositivo perde il posto di ${held}.`,
      stay: (held) => `Continua come ${held}`,
      take: (brought) => `Partecipa come ${brought}`,
    },
  },
};
