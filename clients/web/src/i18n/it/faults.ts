// What can go wrong in a call, in Italian.

import type { Texts } from "../en";
import { time } from "./time";

export const faults: Texts["faults"] = {
  notReached: "Il server non risponde. Forse si sta riavviando: riprova tra poco.",
  unknown: "Qualcosa è andato storto.",
  tooMuch: "Troppe richieste in una volta.",
  again: (ms: number) => `Riprova tra ${time(ms)}.`,
  byReason: {
    TOKEN_MISSING:
      "Questo server è aperto solo agli invitati. Chiedi a chi lo gestisce un link con un token e aprilo qui.",
    TOKEN_UNKNOWN:
      "Il server non riconosce il token del tuo link. Controlla di aver aperto il link completo, o chiedine uno nuovo a chi gestisce il server.",
    TOKEN_EXPIRED: "Il token del tuo link è scaduto. Chiedi un nuovo link a chi gestisce il server.",
    ROLE_TOO_LOW: "Il tuo link non lo permette. Chiedine uno adatto a chi gestisce il server.",
    OUT_OF_SCOPE: "Il tuo link vale per un’altra stanza o un altro torneo.",
    ROOM_UNKNOWN: "Questa stanza non esiste più, oppure è privata.",
    ROOM_FULL: "Tutti i posti di questa stanza sono occupati.",
    SEAT_TAKEN: "Qualcun altro ha appena preso questo posto.",
    NO_SUCH_SEAT: "Questa stanza non ha quel posto.",
    KIND_NOT_ADMITTED: "I posti liberi sono riservati ad altri tipi di partecipanti.",
    CLIENT_HAS_SEAT: "Hai già un posto in questa stanza, e ognuno può prenderne solo uno.",
    GAME_STARTED: "La partita è già iniziata. Puoi guardarla.",
    GAME_OVER: "La partita è finita.",
    GAME_NOT_STARTED: "La partita non è ancora iniziata.",
    GAME_NOT_PHYSICAL: "Questa partita non si gioca con carte vere.",
    NO_PHYSICAL_TABLES: "Questo torneo non ha partite con carte vere: non si può aggiungere nessuno a un tavolo.",
    NO_SUCH_OPTION: "La domanda non prevede questa risposta, oppure ha già avuto risposta.",
    TOO_MANY_QUESTIONS: "Ci sono troppe domande in sospeso. Prima rispondi a quelle.",
    TOO_MANY_SEATINGS: "I posti di questa stanza sono stati presi e lasciati troppe volte. Chiedi una nuova stanza.",
    TOO_MANY_HELD_REPORTS:
      "Prima bisogna rispondere a una domanda: dalla risposta dipendono le segnalazioni in attesa.",
    NOT_CORRECTABLE: "Questa segnalazione non si può più correggere.",
    JOIN_CODE_WRONG:
      "Questo codice non corrisponde a nessuna stanza e a nessun torneo in cui si possa entrare. Controllalo; può anche darsi che la partita sia finita.",
    TICKET_UNKNOWN: "Il posto è stato liberato. Entra di nuovo con il codice.",
    SPECTATORS_NOT_ADMITTED: "Questa stanza non ammette spettatori.",
    TOO_MANY_SPECTATORS: "Questa stanza ha già il numero massimo di spettatori.",
    DECISION_CLOSED: "Questa decisione non è più aperta.",
    HINTS_OFF: "In questa stanza non ci sono suggerimenti.",
    TOO_MANY_HINTS: "Hai già avuto tutti i suggerimenti per questa decisione.",
    TOO_MANY_EXPRESSIONS: "Troppe espressioni in poco tempo. Aspetta un momento.",
    TOO_MANY_ROOMS:
      "Ora non si possono creare altre stanze. Chiudine una che non ti serve più, o aspetta che una partita finisca.",
    TOO_MANY_CALLS: "Il server riceve troppe richieste dalla tua rete o con il tuo link.",
    TOO_MANY_CALLS_AT_ONCE: "Il server riceve troppe richieste dalla tua rete o con il tuo link.",
    TOO_MANY_UNREAD_ANSWERS: "Il server riceve troppe richieste dalla tua rete o con il tuo link.",
    TOO_MANY_WAITING_CALLS: "Il server riceve troppe richieste dalla tua rete o con il tuo link. Ricarica la pagina.",
    TOO_MANY_STREAMS: "Troppe pagine e troppi agenti sono collegati dalla tua rete o con il tuo link. Chiudine alcuni.",
    TOO_MANY_FOLLOWERS: "Al momento troppe persone seguono dei tornei.",
    TOO_MANY_WRONG_CODES: "Sono stati inseriti troppi codici sbagliati. Controlla il codice.",
    READER_TOO_SLOW: "La tua connessione è troppo lenta per caricare questa partita. Riprova con una migliore.",
    EVENTS_GONE: "L’inizio di questa partita non è più visibile. La registrazione sarà disponibile alla fine.",
    DISK_NEARLY_FULL:
      "Il disco del server è quasi pieno: non possono iniziare nuove partite. Chiedi a chi gestisce il server di liberare spazio. Le partite in corso continuano.",
    STORE_FAILED:
      "Il server non riesce a salvare le partite e si sta fermando. Le tue decisioni finora sono salvate; le partite riprendono al suo ritorno.",
    OWNER_UNREACHABLE: "Il server che se ne occupa non è raggiungibile, o un altro sta subentrando. Riprova tra poco.",
    ROOM_GONE: "Questa stanza si è appena chiusa, o il server si sta fermando. Riprova tra poco.",
    INTERNAL: "Il server non è riuscito a farlo. Riprova; se non basta, avvisa chi gestisce il server.",
    SHUTTING_DOWN: "Il server si sta spegnendo. Le partite riprendono al suo ritorno.",
    GAME_UNKNOWN: "Il server non ha la registrazione di questa partita, oppure è privata.",
    GAME_RUNNING: "La partita è ancora in corso. La registrazione sarà disponibile alla fine.",
    SERIES_OPEN:
      "Altre partite con le stesse carte sono ancora in corso. La registrazione sarà disponibile alla fine del turno.",
    TOURNAMENT_UNKNOWN: "Questo torneo non esiste, oppure è privato.",
    TOURNAMENT_STARTED: "Il torneo è già iniziato.",
    TOO_FEW_PARTICIPANTS: "Prima dell’inizio devono iscriversi almeno due partecipanti.",
    TOO_MANY_TOURNAMENTS:
      "Ora non si possono creare altri tornei. Chiudine uno che non ti serve più, o aspetta che uno finisca.",
    OWNER_TOKEN_WRONG: "Può farlo solo il dispositivo che l’ha creato.",
    NOT_STATELESS: "Le persone non possono iscriversi: le stesse carte si giocano più volte.",
    TOURNAMENT_FULL: "Il torneo è al completo.",
    NAME_REFUSED: "Questo nome ha più di 64 caratteri o contiene caratteri invisibili. Scegline un altro.",
    NAME_RESERVED: "Nomi così sono degli agenti che completano i tavoli. Scegline un altro.",
    PARTICIPANT_UNKNOWN: "Questo partecipante non c’è più.",
    PARTICIPANT_IS_FILLER: "Questo agente completa i tavoli e non può lasciare il torneo. Puoi sostituirlo.",
    REPLACED_TOO_OFTEN: "Questo posto non può passare a nessun altro: è già cambiato troppe volte.",
    TOURNAMENT_OVER: "Il torneo è finito.",
    TOURNAMENT_NOT_PLAYING: "È possibile solo mentre il torneo è in corso.",
    GAME_NOT_DUE: "Nel frattempo la partita è iniziata o finita.",
    NOT_IN_GAME: "Non giochi in questa partita.",
    POSTPONED_TOO_OFTEN: "Non puoi rimandare ancora questa partita. Chiedi a chi organizza.",
    TOO_MANY_CHANGES: "Questo torneo è stato modificato troppe volte.",
    NAME_TAKEN: "Qualcun altro ha già questo nome. Scegline un altro.",
  },
};
